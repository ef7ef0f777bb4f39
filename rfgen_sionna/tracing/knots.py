"""How many instants describe a motion over a stretch of time."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence

import numpy as np

from rfgen_sionna.records import SPEED_OF_LIGHT, FloatArray, IntArray, knot_weights
from rfgen_sionna.scene.mesh import lengths

MIN_SPACING = 0.125e-3
"""Gap between knots [s] below which a motion counts as broken: a vibration of 0.1 mm at 700 Hz still gets its knots."""
FIRST_COUNT = 4
"""Knots to begin with: a cubic's."""
RIM_ERROR, INNER_ERROR = 0.02, 0.005
"""Errors (root mean square over time) of a not-a-knot cubic spline through a phasor whose phase swings by 1 rad between
knots: of the cubic through four knots, and through more of them. They grow with the swing's fourth power."""
_GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
_LOG = logging.getLogger(__name__)


def choose_knots(
    positions: Callable[[float], Sequence[FloatArray]],
    viewpoint: FloatArray,
    start: float,
    stop: float,
    frequency: float,
    tolerance: float,
    max_spacing: float,
) -> FloatArray:
    """Knots between which a spline follows the delay of every vertex.

    They are doubled until the spline through them foretells the two-way phase between them to `tolerance` in each
    mesh's root mean square, which is the relative error of its sum, at any instant to three times that, as a spline
    errs most at its ends, and any vertex's to ten times that. The phase is tried once between each two knots, at places
    that no vibration keeps step with.

    Parameters
    ----------
    positions
        Time [s] to the (vertex, 3) positions [m] of each mesh; called once per instant that is tried.
    viewpoint
        (3,) phase centre of the radar [m].
    start, stop
        The stretch of time [s].
    frequency
        Highest frequency of the band [Hz].
    tolerance
        Allowed phase error [rad].
    max_spacing
        Longest gap between knots [s].

    Returns
    -------
    (knot,) ascending times [s], 3 2^n + 1 evenly spaced ones; a single one where nothing moves.
    """
    wavenumber = 4 * np.pi * frequency / SPEED_OF_LIGHT
    if stop <= start:
        return np.array([start])
    sizes = [len(points) for points in positions(start)]
    if not sum(sizes):
        return np.array([start])
    borders = np.cumsum(sizes)[:-1]

    def phases(times: FloatArray) -> FloatArray:
        rows = [lengths(np.concatenate(positions(float(t))) - viewpoint) for t in times]
        return wavenumber * np.stack(rows)

    count = FIRST_COUNT
    while True:
        times = np.linspace(start, stop, count)
        # The golden ratio's multiples fall everywhere in 0 … 1, and never into step.
        place = 0.2 + 0.6 * np.mod(_GOLDEN * np.arange(1, count), 1.0)
        between = times[:-1] + place * np.diff(times)
        values, truth = phases(times), phases(between)
        if count == FIRST_COUNT and (values == values[0]).all() and (truth == values[0]).all():
            return np.array([start])
        error = knot_weights(times, between) @ values - truth
        rms = np.sqrt(np.stack([np.mean(part**2, axis=1) for part in np.split(error, borders, axis=1)]))
        typical = float(np.sqrt(np.mean(rms**2, axis=1)).max())
        spacing = times[1] - times[0]
        fine = typical <= tolerance and rms.max() <= 3 * tolerance and np.abs(error).max() <= 10 * tolerance
        if fine and spacing <= max_spacing:
            return times
        if spacing < 2 * MIN_SPACING:
            _LOG.warning(
                "the motion between %.4f and %.4f s is not smooth: at knots %.2g ms apart its phase is still off by "
                "%.2g rad (allowed: %.2g)", start, stop, 1e3 * spacing, typical, tolerance,
            )  # fmt: skip
            return times
        count = 2 * count - 1


def gain_knots(
    positions: Callable[[float], Sequence[FloatArray]],
    faces: Sequence[IntArray],
    viewpoint: FloatArray,
    knots: FloatArray,
    frequency: float,
    tolerance: float,
    max_spacing: float,
) -> FloatArray:
    """Those of `knots`, evenly spaced, between which a spline follows the gains; more than them where it takes more.

    The gain of a facet follows the phases of its corners against their mean. Where they swing by x rad between two
    instants, a spline errs by about `INNER_ERROR` x^4. The error is held to `tolerance` in the root mean square over
    each mesh, faces weighted with the energy that they may return: the square of their solid angle's mean phasor, which
    falls with the spread of the corners' phases.

    Parameters
    ----------
    positions, viewpoint, frequency
        As for :func:`choose_knots`.
    faces
        (face, 3) of each mesh.
    knots
        (knot,) of :func:`choose_knots` [s].
    tolerance
        Allowed error relative to the gains.
    max_spacing
        Longest gap [s].
    """
    wavenumber = 4 * np.pi * frequency / SPEED_OF_LIGHT
    sizes = [_solid_angles(points, mesh, viewpoint) for points, mesh in zip(positions(knots[0]), faces, strict=True)]

    def error(times: FloatArray) -> float:
        worst, before = 0.0, None
        share = RIM_ERROR if len(times) <= FIRST_COUNT else INNER_ERROR
        for t in times:
            now = [
                wavenumber * _corner_distances(p, mesh, viewpoint)
                for p, mesh in zip(positions(float(t)), faces, strict=True)
            ]
            for old, new, size in zip(before or now, now, sizes, strict=True):
                weight = size / (1.0 + 3.0 * (new**2).sum(axis=1)) ** 2
                missed = np.minimum(share * np.abs(new - old).max(axis=1) ** 4, 1.0)
                if weight.any():
                    worst = max(worst, float(np.sqrt((weight * missed**2).sum() / weight.sum())))
            before = now
        return worst

    strides = [
        n for n in (32, 16, 8, 4, 2, 1) if (len(knots) - 1) % n == 0 and (len(knots) - 1) // n >= FIRST_COUNT - 1
    ]
    for stride in strides:
        times = knots[::stride]
        if len(times) == 1 or (times[1] - times[0] <= max_spacing * (1 + 1e-9) and error(times) <= tolerance):
            return times
    times = knots
    while len(times) > 1 and times[1] - times[0] > 2 * MIN_SPACING and error(times) > tolerance:
        times = np.linspace(times[0], times[-1], 2 * len(times) - 1)
    return times


def _corner_distances(vertices: FloatArray, faces: IntArray, viewpoint: FloatArray) -> FloatArray:
    """(face, 3) distances of the corners less their mean [m]."""
    corners = lengths(vertices - viewpoint)[faces]
    return np.asarray(corners - np.einsum("fc->f", corners)[:, None] / 3.0)


def _solid_angles(vertices: FloatArray, faces: IntArray, viewpoint: FloatArray) -> FloatArray:
    """(face,) what each face takes of the view, if it is small [sr]."""
    a, b, c = (vertices[faces[:, i]] - viewpoint for i in range(3))
    volume = np.abs(np.einsum("fi,fi->f", a, np.cross(b - a, c - a)))
    return np.asarray(0.5 * volume / np.maximum(lengths(a), 1e-9) ** 3)
