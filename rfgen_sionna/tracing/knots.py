"""How many instants describe a motion over a stretch of time."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

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
RIM_GAPS = 5
"""Gaps up to which a spline errs as at its rim."""
QUIET_GAPS, QUIET_ERROR = 2, 0.046
"""The fewest gaps over which gains are looked at, and what the parabola through three instants errs by for a swing of
1 rad between them [root mean square over time]; it grows with the swing's third power."""
QUIET_SPACING, QUIET_TURN = 14e-3, 4e-3
"""Longest such gap [s], and how far at most any vertex goes across the view in it [rad]: three instants tell little of
shadows that are faster."""
LOOKS = 6
"""Stretches between knots over which gains are looked at; delays may have many more."""
ENOUGH = 8000
"""Faces that tell how gains change."""
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
    quiet: bool = True,
) -> FloatArray:
    """Evenly spaced instants, as many as a spline through them needs to follow the gains.

    The gain of a facet follows the phases of its corners against their mean. Where they swing by x rad between two
    instants, a spline errs by about `INNER_ERROR` x^4, and over a short stretch in which they hardly do three instants
    are enough: the parabola errs by `QUIET_ERROR` x^3. The error is held to `tolerance` in the root mean square over
    each mesh, faces weighted with the energy that they may return: the square of their solid angle's mean phasor, which
    falls with the spread of the corners' phases. Of very many faces the widest tell it.

    Parameters
    ----------
    positions, viewpoint, frequency
        As for :func:`choose_knots`.
    faces
        (face, 3) of each mesh.
    knots
        (knot,) of :func:`choose_knots` [s], at which the swing is looked at.
    tolerance
        Allowed error relative to the gains.
    max_spacing
        Longest gap [s], but of :data:`QUIET_SPACING` where three instants do.
    quiet
        Whether three instants may do. Mirrors and slabs show what is quiet from the viewpoint from elsewhere, and what
        they show is not looked at between instants.
    """
    if len(knots) == 1:
        return knots
    wavenumber = 4 * np.pi * frequency / SPEED_OF_LIGHT
    length = float(knots[-1] - knots[0])
    steps = len(knots) - 1
    times = knots[:: max(steps // LOOKS, 1)]
    places = [positions(float(t)) for t in times]
    swings = [
        _Swings.between([each[i] for each in places], mesh, viewpoint, wavenumber) for i, mesh in enumerate(faces)
    ]
    least = max(FIRST_COUNT - 1, int(np.ceil(length / max_spacing * (1 - 1e-9))))
    most = max(least, int(length / MIN_SPACING))
    gaps = QUIET_GAPS if quiet and length <= QUIET_GAPS * QUIET_SPACING else least
    while gaps < most:
        scale = (len(times) - 1) / gaps
        error = max((each.error(scale, gaps) for each in swings), default=0.0)
        if error <= tolerance and (gaps >= least or _most_turn(places, viewpoint) * scale <= QUIET_TURN):
            break
        gaps = min(max(gaps + 1, least, int(0.7 * gaps * (error / tolerance) ** 0.25)), most)
    return np.linspace(knots[0], knots[-1], gaps + 1)


def _most_turn(places: Sequence[Sequence[FloatArray]], viewpoint: FloatArray) -> float:
    """Largest angle [rad] that any vertex goes across the view from one of the `places` to the next."""
    found = 0.0
    for before, after in pairwise(places):
        for old, new in zip(before, after, strict=True):
            offset, step = old - viewpoint, new - old
            square = np.maximum(np.einsum("vi,vi->v", offset, offset), 1e-12)
            along = np.einsum("vi,vi->v", offset, step) / square
            across = np.einsum("vi,vi->v", step, step) / square - along**2
            found = max(found, float(across.max(initial=0.0)))
    return float(np.sqrt(found))


def spline_error(swing: FloatArray, gaps: int) -> FloatArray:
    """What splines with so many gaps err by between instants, at phasors that swing by so much [rad] over a gap: root
    mean square over time."""
    if gaps <= QUIET_GAPS:
        return np.asarray(QUIET_ERROR * swing**3)
    return np.asarray((RIM_ERROR if gaps <= RIM_GAPS else INNER_ERROR) * swing**4)


def most_swing(tolerance: float, gaps: int) -> float:
    """Phase [rad] by which a phasor may swing from instant to instant for a spline with so many gaps to err by
    `tolerance` at most."""
    if gaps <= QUIET_GAPS:
        return float((tolerance / QUIET_ERROR) ** (1 / 3))
    return float((tolerance / RIM_ERROR) ** 0.25)


@dataclass(frozen=True)
class _Swings:
    """By how much the corners' phases of faces swing from one time to the next."""

    swing: FloatArray
    """(step, face) [rad]."""
    weight: FloatArray
    """(step, face)"""

    @staticmethod
    def between(vertices: Sequence[FloatArray], faces: IntArray, viewpoint: FloatArray, wavenumber: float) -> _Swings:
        size = _solid_angles(vertices[0], faces, viewpoint)
        if len(faces) > ENOUGH:
            widest = np.sort(np.argpartition(-size, ENOUGH)[:ENOUGH])
            faces, size = faces[widest], size[widest]
        phases = [wavenumber * _corner_distances(each, faces, viewpoint) for each in vertices]
        swing = [np.abs(new - old).max(axis=0) for old, new in pairwise(phases)]
        weight = [size / (1.0 + 3.0 * (each**2).sum(axis=0)) ** 2 for each in phases[1:]]
        return _Swings(np.stack(swing), np.stack(weight))

    def error(self, scale: float, gaps: int) -> float:
        """Of a spline with so many `gaps`, each `scale` times as long as the steps."""
        missed = np.minimum(spline_error(scale * self.swing, gaps), 1.0)
        total = self.weight.sum(axis=1)
        found = (self.weight * missed**2).sum(axis=1) / np.where(total > 0, total, 1.0)
        return float(np.sqrt(found.max(initial=0.0)))


def _corner_distances(vertices: FloatArray, faces: IntArray, viewpoint: FloatArray) -> FloatArray:
    """(3, face) distances of the corners less their mean [m]."""
    corners = lengths(vertices - viewpoint)[faces.T]
    return np.asarray(corners - (corners[0] + corners[1] + corners[2]) / 3.0)


def _solid_angles(vertices: FloatArray, faces: IntArray, viewpoint: FloatArray) -> FloatArray:
    """(face,) what each face takes of the view, if it is small [sr]."""
    a, b, c = np.moveaxis(np.ascontiguousarray((vertices - viewpoint).T)[:, faces.T], 1, 0)
    (x, y, z), (u, v, w) = b - a, c - a
    volume = np.abs(a[0] * (y * w - z * v) + a[1] * (z * u - x * w) + a[2] * (x * v - y * u))
    return np.asarray(0.5 * volume / np.maximum(np.sqrt(a[0] ** 2 + a[1] ** 2 + a[2] ** 2), 1e-9) ** 3)
