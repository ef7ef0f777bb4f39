"""Sample times: times at which gains and visibility are traced, so that splines follow an interval.

The error of splines is estimated with the faces of the meshes before any trace. Without the phase of its centre, a flat
face returns the mean phasor over its area, in closed form.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray, IntArray
from rfgen_sionna.records import knot_weights
from rfgen_sionna.scene.kernels import FrozenKernel, drjit_types, upload
from rfgen_sionna.scene.mesh import lengths, triangle_centroids
from rfgen_sionna.tracing.moving.knots import FIRST_COUNT, MIN_SPACING, QUIET_GAPS, representative
from rfgen_sionna.tracing.surface.facet_positions import mean_phasor, solid_angles, width_and_distance
from rfgen_sionna.tracing.surface.resolution import FACET_BULGE, phase_bulge

QUIET_SPACING, QUIET_TURN = 14e-3, 20e-3
"""Largest gap between three times [s], and largest angle of any vertex across the line of sight per gap [rad]: the
width of an arm at 4 m."""
PAIR_SPACING, PAIR_TURN, STRAIGHT = 28e-3, 10e-3, 1e-4
"""The same of two times, and largest departure of any vertex from a straight way between them [rad], as a return motion
would hide shadows from both."""
STRONGEST, OTHERS = 500, 250
"""Faces of a mesh whose gains are compared: the strongest ones, and representatives of all others."""
MANY_FACES = 10_000
"""Faces of a mesh above which a single pose decides which faces are strong, to save time."""
MARGIN = 1.5
"""Stated error over that of the faces: the measured error of people is 0.4 to 2.1 times the latter."""
CANCELLING_SHARE = 0.25
"""Share of the tolerance with indirect paths, from whose aspect bodies may turn faster."""
_TRIED, _MOST_TRIED = 4, 400
"""Test times per gap and largest number of them, more with more gaps and knots."""
_GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
_LOG = logging.getLogger(__name__)


class SampleTimes(NamedTuple):
    """Sample times and their error."""

    times: FloatArray
    """(time,) evenly spaced [s]."""
    error: float
    """Estimated error of the return between them for turning faces, relative to that of the worst mesh [root mean
    square over time]."""


def choose_sample_times(
    positions: Callable[[float], Sequence[FloatArray]],
    faces: Sequence[IntArray],
    closed: Sequence[bool],
    viewpoint: FloatArray,
    knots: FloatArray,
    frequency: float,
    tolerance: float,
    max_spacing: float,
    indirect: bool = False,
    pair: bool = False,
    cancellation: FloatArray | None = None,
) -> SampleTimes:
    """The smallest number of evenly spaced times for which splines follow the gains.

    Parameters
    ----------
    positions, faces, closed
        Time [s] to the (vertex, 3) positions [m] of each mesh, its (face, 3), and whether its back faces do not count.
    viewpoint
        (3,) phase centre of the radar [m].
    knots
        (knot,) of :func:`rfgen_sionna.tracing.moving.knots.choose_knots` [s].
    frequency, tolerance
        Highest frequency of the band [Hz]; allowed error relative to the return [root mean square over time].
    max_spacing
        Largest gap [s] of four times or more; that of three and two is :data:`QUIET_SPACING` and :data:`PAIR_SPACING`.
    indirect
        Whether mirrors or slabs show the meshes: then four times at least, as indirect paths have no temporal
        refinement.
    pair
        Whether two times may suffice, from which no time can be left out to test moving shadows.
    cancellation
        (mesh,) factor on each mesh's error; None is 1.
    """
    if len(knots) == 1:
        return SampleTimes(knots, 0.0)
    length = float(knots[-1] - knots[0])
    places = [positions(float(t)) for t in knots]
    meshes = [
        _RepresentativeFaces([each[k] for each in places], own, shut, viewpoint, frequency)
        for k, (own, shut) in enumerate(zip(faces, closed, strict=True))
    ]
    least = max(FIRST_COUNT - 1, int(np.ceil(length / max_spacing * (1 - 1e-9))))
    most = max(least, int(length / MIN_SPACING))
    allowed, gaps = CANCELLING_SHARE * tolerance if indirect else tolerance, least

    more = np.ones(len(meshes)) if cancellation is None else cancellation

    def missed(gaps: int) -> float:
        return MARGIN * max(
            (own * each.missed(gaps) for each, own in zip(meshes, more.tolist(), strict=True)), default=0.0
        )

    representatives = [[representative(each) for each in there] for there in places]
    turn = _most_turn(representatives, viewpoint) * (len(knots) - 1) if not indirect else np.inf
    few = (1, PAIR_SPACING, PAIR_TURN), (QUIET_GAPS, QUIET_SPACING, QUIET_TURN)
    for some, spacing, most_turn in few if pair else few[1:]:
        straight = some > 1 or _most_departure(representatives, viewpoint) <= STRAIGHT
        if length <= some * spacing and turn <= some * most_turn and straight and (error := missed(some)) <= allowed:
            gaps = some
            break
    else:
        error = missed(gaps)
    while error > allowed and gaps < most:
        # Small errors fall with the fourth power of the gap.
        gaps = min(max(gaps + 1, int(np.ceil(gaps * (error / allowed) ** 0.25))), most)
        error = missed(gaps)
    if error > allowed:
        _LOG.warning(
            "gains between %.4f and %.4f s turn too fast: with sample times %.2g ms apart their error is %.2g "
            "(allowed: %.2g); time_error includes it", knots[0], knots[-1], 1e3 * length / gaps, error, allowed,
        )  # fmt: skip
    return SampleTimes(np.linspace(knots[0], knots[-1], gaps + 1), error)


class _RepresentativeFaces:
    """Representative faces of a mesh with `vertices` (vertex, 3) [m] at evenly spaced times."""

    def __init__(
        self, vertices: Sequence[FloatArray], faces: IntArray, closed: bool, viewpoint: FloatArray, frequency: float
    ) -> None:
        wavenumber, size, strength = 4 * np.pi * frequency / SPEED_OF_LIGHT, np.zeros(len(faces)), np.zeros(len(faces))
        # Faces that are strong at one end only count as well.
        poses = (vertices[0], vertices[-1]) if len(faces) < MANY_FACES else (vertices[len(vertices) // 2],)
        for points in poses:
            found, angle = _estimated_returns(points, faces, viewpoint, wavenumber)
            if closed:
                found, angle = np.where(angle > 0, found, 0.0), np.maximum(angle, 0.0)
            strength, size = np.maximum(strength, found), np.maximum(size, np.abs(angle))
        some = np.flatnonzero(strength)
        order = some[np.argsort(-strength[some])]
        rest = order[STRONGEST:]
        step = max(1, -(-len(rest) // OTHERS))
        chosen = np.concatenate([order[:STRONGEST], rest[::step]])
        ends, counted = faces[chosen], np.where(np.arange(len(chosen)) < STRONGEST, 1.0, step)
        # The middle piece represents a large face, and one weak face several others.
        bulge = phase_bulge(vertices[len(vertices) // 2][ends], viewpoint, frequency)
        self._share = np.sqrt(FACET_BULGE / np.maximum(bulge, FACET_BULGE))
        self._size = size[chosen] * self._share * np.sqrt(counted)
        self._phases = wavenumber * np.stack([self._away(each[ends] - viewpoint) for each in vertices])

    def _away(self, corners: FloatArray) -> FloatArray:
        """(corner, face) distances [m] of the corners of the faces' middle pieces, of faces with `corners` (face, 3, 3)
        [m]."""
        inner = triangle_centroids(corners)[:, None]
        return lengths(inner + self._share[:, None, None] * (corners - inner)).T

    def missed(self, gaps: int) -> float:
        """Error of a spline with `gaps` gaps, of the incoherent sum of the faces."""
        if not len(self._size):
            return 0.0
        # At more times than knots and gaps, aperiodic as vibrations may be in step.
        finest = max(gaps, len(self._phases) - 1)
        tried = max(min(max(_TRIED * gaps, 2 * finest), _MOST_TRIED), finest + 1)
        sample_times = np.linspace(0.0, 1.0, gaps + 1)
        times = (np.arange(tried) + np.mod(_GOLDEN * np.arange(1, tried + 1), 1.0)) / tried
        truth = self._gains(times)
        missed = knot_weights(sample_times, times) @ self._gains(sample_times) - truth
        energy, error = (float((each.real**2 + each.imag**2).sum()) for each in (truth, missed))
        return float(np.sqrt(error / energy)) if energy > 0 else 0.0

    def _gains(self, times: FloatArray) -> ComplexArray:
        """(time, face) gains at `times`, 0 … 1 over the interval."""
        weights = knot_weights(np.linspace(0.0, 1.0, len(self._phases)), times)
        phases = np.moveaxis(np.tensordot(weights, self._phases, 1), 1, 0)
        return np.asarray(self._size * _mean_phasor(_turned(phases)))


def _estimated_returns(
    vertices: FloatArray, faces: IntArray, viewpoint: FloatArray, wavenumber: float
) -> tuple[FloatArray, FloatArray]:
    """(face,) estimated return of each face, up to a common factor, and its solid angle [sr], negative where it faces
    away."""
    if not len(faces):
        return np.zeros(0), np.zeros(0)
    dr, types = drjit_types()
    found = [dr.empty(types.Float64, len(faces)) for _ in range(2)]
    given = {
        "lanes": dr.arange(types.UInt32, len(faces)),
        "vertices": upload(types.Float64, vertices),
        "faces": upload(types.UInt32, faces),
        "radar": upload(types.Float64, [*viewpoint, wavenumber]),
        "found": found,
    }
    _ESTIMATED_RETURNS(given)
    strength, angle = (each.numpy() for each in found)
    return strength, angle


def _estimate_returns(given: dict[str, Any]) -> None:
    """Kernel of :func:`_estimated_returns`."""
    dr, types = drjit_types()
    Float, UInt32, lane = types.Float64, types.UInt32, given["lanes"]
    radar = [dr.gather(Float, given["radar"], UInt32(k)) for k in range(4)]
    ends = [dr.gather(UInt32, given["faces"], 3 * lane + k) for k in range(3)]
    corners = [
        [dr.gather(Float, given["vertices"], 3 * each + axis) - radar[axis] for each in ends] for axis in range(3)
    ]
    angle, wavenumber = solid_angles(corners), radar[3]
    # Large faces are traced in pieces; the bulge of the phase is about k width^2 / (4 distance).
    width, near = width_and_distance(corners)
    share = dr.sqrt(dr.minimum(8.0 * FACET_BULGE * near / dr.maximum(wavenumber * width * width, 1e-300), 1.0))
    strength = abs(angle) * share * mean_phasor(corners, 0.5 * wavenumber * share)
    for values, where in zip((strength, angle), given["found"], strict=True):
        dr.scatter(where, values, lane, mode=dr.ReduceMode.Permute)
    dr.eval(*given["found"])


_ESTIMATED_RETURNS = FrozenKernel(_estimate_returns)


def _turned(phases: FloatArray) -> FloatArray:
    """(corner, ..., face) `phases` [rad] relative to those of the centre."""
    return np.asarray(phases - (phases[0] + phases[1] + phases[2]) / 3.0)


def _mean_phasor(phases: FloatArray) -> ComplexArray:
    """(..., face) mean of exp(-jφ) over faces with a linear phase φ and corner `phases` (corner, ..., face) [rad]:
    twice a divided difference (:mod:`rfgen_sionna.tracing.integral.simplex`)."""
    a, b, c = np.sort(phases, axis=0)
    first, last = (np.exp(-0.5j * (x + y)) * np.sinc((y - x) / (2 * np.pi)) for x, y in ((a, b), (b, c)))
    spread = c - a
    # Below, cancellation exceeds the error of the mean phase, the square over 36.
    narrow = spread < 1e-5
    return np.asarray(np.where(narrow, np.exp(-1j * b), 2j * (last - first) / np.where(narrow, 1.0, spread)))


def _most_departure(places: Sequence[Sequence[FloatArray]], viewpoint: FloatArray) -> float:
    """Largest angle [rad] across the line of sight between any vertex and the straight way from the first to the last
    of the evenly spaced `places`."""
    found, count = 0.0, len(places) - 1
    for number, there in enumerate(places[1:-1], 1):
        share = number / count
        for first, now, last in zip(places[0], there, places[-1], strict=True):
            found = max(found, _across(now - viewpoint, now - first - share * (last - first)))
    return found


def _across(offset: FloatArray, step: FloatArray) -> float:
    """Largest angle [rad] of a `step` (vertex, 3) across the line of sight, at `offset` (vertex, 3)."""
    square = np.maximum(np.einsum("vi,vi->v", offset, offset), 1e-12)
    along = np.einsum("vi,vi->v", offset, step) / square
    across = np.einsum("vi,vi->v", step, step) / square - along**2
    return float(np.sqrt(max(across.max(initial=0.0), 0.0)))


def _most_turn(places: Sequence[Sequence[FloatArray]], viewpoint: FloatArray) -> float:
    """Largest angle [rad] of any vertex across the line of sight from one of the `places` to the next."""
    found = 0.0
    for before, after in pairwise(places):
        for old, new in zip(before, after, strict=True):
            found = max(found, _across(old - viewpoint, new - old))
    return found
