"""Fast turns: smaller facets for faces that turn fast, such as blades of rotors.

The gain of a flat facet of width w that turns at the rate Ω changes with the two-way phase between its ends, at up to
2 k w Ω. Knots carry the phases of the centres of facets exactly. Facets that are narrow for their rate therefore need
few sample times: those of the turn itself.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray, IntArray
from rfgen_sionna.scene.mesh import face_normals, lengths
from rfgen_sionna.tracing.moving.knots import FIRST_COUNT, max_phase_step
from rfgen_sionna.tracing.moving.sample_times import choose_sample_times

FAST_SPACING = 2.5e-3
"""Gap between sample times [s] below which facets become smaller instead: people's gaps are longer."""
TURN_STEP = 0.6
"""Largest turn of a face per gap [rad] over the root of the tolerance: faces that come into view have kinks in their
gains, at which splines err with the 1.5th power of the gap."""
LARGE_TURN = 0.15
"""Turn of most of a mesh per gap [rad] above which sample times follow the turn, whatever the size of the facets: faces
come into view and leave it."""
MIN_TURN = 5 * np.pi
"""Largest turning rate of any face [rad/s] for which facets stay as they are."""
_FACETS_PER_AREA, _SAMPLE_COST = 6.0, 4000
"""Facets per area over the square of the limit, as bisection leaves edges of 0.7 to 1 of it; cost of a sample time, in
facets."""
_MAX_HALVINGS, _MAX_COMPARED = 12, 500
LARGE_COST, MAX_COST = 5e6, 5e7
"""Facets times sample times of an interval above which a message states the cost, and above which it is refused."""
SECONDS_PER_FACET, SECONDS_PER_TIME, BYTES_PER_FACET = 5e-6, 1e-2, 1e3
"""Time of a facet and of a sample time on one core [s], and memory of a facet at one time [bytes]."""
_LOG = logging.getLogger(__name__)


def turning_rates(places: Sequence[FloatArray], faces: IntArray, spacing: float) -> FloatArray:
    """(face,) largest turning rate [rad/s] of each face with vertices (vertex, 3) [m] at `places`, `spacing` [s] apart:
    the largest angle of two of its edges from one time to the next."""
    found = np.zeros(len(faces))
    for before, after in pairwise(places):
        for one in (1, 2):
            old, new = (each[faces[:, one]] - each[faces[:, 0]] for each in (before, after))
            size = np.maximum(lengths(old), 1e-12)
            found = np.maximum(found, 2.0 * np.arcsin(np.minimum(0.5 * lengths(new - old) / size, 1.0)))
    return found / spacing


class FastTurn(NamedTuple):
    """Facets and sample times for fast turning faces."""

    longest_edges: list[FloatArray]
    """Of each mesh the (face,) largest edge of the facets [m]."""
    spacing: float
    """Largest gap between sample times [s]."""
    facets: int
    """Estimated number of facets."""


def _typical_rate(places: Sequence[Sequence[FloatArray]], faces: Sequence[IntArray], length: float) -> float:
    """Turning rate [rad/s] that a fifth of the faces of the fastest mesh exceed: that of a rotor, not of an arm."""
    spacing, found = length / (len(places) - 1), 0.0
    for k, every in enumerate(faces):
        if len(some := every[:: -(-len(every) // _MAX_COMPARED) or 1]):
            found = max(found, float(np.quantile(turning_rates([each[k] for each in places], some, spacing), 0.8)))
    return found


def choose_facet_limits(
    places: Sequence[Sequence[FloatArray]],
    faces: Sequence[IntArray],
    length: float,
    spacing: float,
    frequency: float,
    tolerance: float,
) -> FastTurn | None:
    """Limits of the facets for the least facets times sample times; None where no face turns fast, or facets without
    limits take less than twice the sample times.

    Parameters
    ----------
    places
        (vertex, 3) positions [m] of each mesh at evenly spaced times.
    faces
        (face, 3) of each mesh.
    length, spacing
        Interval and gap between the sample times of unlimited facets [s].
    frequency, tolerance
        Highest frequency of the band [Hz]; allowed relative error of gains between sample times.
    """
    gap = length / (len(places) - 1)
    rates = [turning_rates([each[k] for each in places], own, gap) for k, own in enumerate(faces)]
    fastest = max((float(each.max(initial=0.0)) for each in rates), default=0.0)
    if fastest <= MIN_TURN:
        return None
    wavenumber = 4 * np.pi * frequency / SPEED_OF_LIGHT
    phase = 2.0 * max_phase_step(tolerance, _MAX_HALVINGS)  # between the ends of a facet, per gap
    first = places[0]
    area = [0.5 * lengths(face_normals(points, own)) for points, own in zip(first, faces, strict=True)]
    longest = [
        np.max([lengths(points[own[:, k]] - points[own[:, k - 1]]) for k in range(3)], axis=0)
        for points, own in zip(first, faces, strict=True)
    ]
    best, found = np.inf, None
    # As in a short frame of a person, which has three gaps in any case.
    most_gaps = 0.5 * length / spacing if spacing > 0 else np.inf
    for halvings in range(_MAX_HALVINGS):
        step = TURN_STEP * np.sqrt(tolerance) / fastest / 2**halvings
        gaps = max(length / step, FIRST_COUNT - 1.0)
        if gaps > most_gaps:
            break
        tried = [phase / (wavenumber * np.maximum(rate, 1e-6) * step) for rate in rates]
        count = sum(
            float(np.where(edge > most, np.maximum(_FACETS_PER_AREA * size / most**2, 2 * edge / most), 1.0).sum())
            for size, edge, most in zip(area, longest, tried, strict=True)
        )
        cost = gaps * (count + _SAMPLE_COST)
        if cost < best:
            best, found = cost, FastTurn(tried, step, int(count))
    return found


def choose_limited_sample_times(
    positions: Callable[[float], Sequence[FloatArray]],
    faces: Sequence[IntArray],
    closed: Sequence[bool],
    viewpoint: FloatArray,
    knots: FloatArray,
    frequency: float,
    tolerance: float,
    max_spacing: float,
    limit: Callable[[list[FloatArray]], list[FloatArray]],
    indirect: bool,
    pair: bool,
    cancellation: FloatArray,
) -> tuple[FloatArray, float]:
    """Sample times (time,) [s] and their error by :func:`rfgen_sionna.tracing.moving.sample_times.choose_sample_times`,
    whose arguments these are; with limits of the facets where faces turn fast. `limit` sets the limits of each mesh and
    returns those in use. A large cost is stated before any work.

    Raises
    ------
    ValueError
        More facets and times than `MAX_COST`.
    """
    known = positions, faces, closed, viewpoint, knots, frequency, tolerance
    choice = choose_sample_times(*known, max_spacing, indirect, pair, cancellation)
    if len(knots) == 1:
        return choice.times, choice.error
    places, length = [positions(float(t)) for t in knots], float(knots[-1] - knots[0])
    turns = _typical_rate(places, faces, length) * choice.spacing > LARGE_TURN
    if turns or choice.spacing < FAST_SPACING:
        facets = sum(map(len, faces))
        free = choice.spacing if choice.error <= choice.allowed and not turns else 0.0
        fast = choose_facet_limits(places, faces, length, free, frequency, choice.allowed)
        if fast is not None:
            facets, edges, closer = fast.facets, limit(fast.longest_edges), min(fast.spacing, max_spacing)
            choice = choose_sample_times(*known, closer, indirect, pair, cancellation, edges)
        _state_cost(facets, choice.times)
    choice.warn()
    return choice.times, choice.error


def _state_cost(facets: int, times: FloatArray) -> None:
    """State a large cost of an interval with sample `times` [s] before it is traced.

    Raises
    ------
    ValueError
        Number of `facets` and times beyond the memory and time of any machine.
    """
    cost = float(facets) * len(times)
    cure = "take shorter frames, a larger rtol, smaller or slower blades"
    if cost > MAX_COST:
        raise ValueError(
            f"the motion from {times[0]:.4f} to {times[-1]:.4f} s is so fast that {facets:,} facets at {len(times):,} "
            f"sample times are needed, about {BYTES_PER_FACET * cost / 1e9:.2g} GB; allowed are {MAX_COST:.0e} facets "
            f"times sample times: {cure}"
        )
    if cost > LARGE_COST:
        _LOG.warning(
            "fast motion from %.4f to %.4f s takes %d facets at %d sample times, about %.0f s and %.2g GB: %s",
            times[0], times[-1], facets, len(times), SECONDS_PER_FACET * cost + SECONDS_PER_TIME * len(times),
            1e-9 * BYTES_PER_FACET * cost, cure,
        )  # fmt: skip
