"""Knots: times at which delays are known, so that splines follow a motion; errors of splines between times."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray
from rfgen_sionna.records import knot_weights
from rfgen_sionna.scene.mesh import lengths

MIN_SPACING = 0.125e-3
"""Gap between knots [s] below which a motion counts as broken unless halving the gap has reduced the error: a vibration
of 0.1 mm at 700 Hz still gets its knots."""
SMOOTH_GAIN, LEAST_SPACING = 3.0, 2e-6
"""Factor by which halved gaps below `MIN_SPACING` must reduce the error, and the smallest gap [s]: splines through
smooth motion gain up to 16, through jumps nothing."""
FIRST_COUNT = 4
"""Smallest number of knots, those of one cubic."""
MAX_REPRESENTATIVES = 4096
"""Largest number of vertices per mesh whose phases are compared."""
ENOUGH_POINTS = 40
"""Knots above which more must halve the error of the gain, as a pattern with jumps never converges."""
PATTERN_POINTS = 32
"""Largest number of vertices per mesh whose pattern gain is compared."""
TERMINATOR_ERROR, INNER_ERROR = 0.02, 0.005
"""Errors (root mean square over time) of a not-a-knot cubic spline through a phasor with a phase step of 1 rad between
knots: of one cubic, and of more knots. They grow with the fourth power of the step."""
TERMINATOR_GAPS = 5
"""Gaps up to which a spline errs as at its ends."""
QUIET_GAPS, QUIET_ERROR = 2, 0.046
"""Smallest number of gaps, and error of the parabola through three times for a phase step of 1 rad [root mean square
over time]; it grows with the third power."""
PAIR_ERROR = 0.091
"""Error of a line between two times for a phase step of 1 rad: an eighth of the square at the middle, times √(8/15)."""
SPLINE_PHASE_ERROR = 5e-4
"""Largest error of splined positions [m], a fraction of the accuracy of shadow boundaries."""
_SPREAD = 2.0
"""Standard deviations by which a random sum may exceed its estimate from a few times."""
_MIN_SAMPLES = 2.0
"""Smallest number of independent times for that estimate."""
_GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
_LOG = logging.getLogger(__name__)


class Knots(NamedTuple):
    """Times at which delays and directions are known."""

    times: FloatArray
    """(knot,) ascending [s], 3 · 2^n + 1 evenly spaced ones; a single one without motion."""
    error: float
    """Estimated error of the return between knots, relative to that of the worst mesh [root mean square over time]:
    phase, pattern gain and phases of the elements against one another."""


def choose_knots(
    positions: Callable[[float], Sequence[FloatArray]],
    viewpoint: FloatArray,
    start: float,
    stop: float,
    frequency: float,
    tolerance: float,
    max_spacing: float,
    gain: Callable[[FloatArray], FloatArray],
    reach: float,
) -> Knots:
    """Knots between which a spline follows the delay of every vertex to every element, and the gain in its direction.

    The number of knots doubles until the spline predicts the two-way phase to `tolerance` in each mesh's root mean
    square (the relative error of its sum), to three times that at any time, and to ten times that for any vertex. For a
    turning radar, whose distances stay, the pattern gain and the phases of the elements are compared as well. Tests are
    once per gap, at fractions that no vibration is in step with.

    Parameters
    ----------
    positions
        Time [s] to the (vertex, 3) positions [m] of each mesh.
    viewpoint
        (3,) phase centre of the radar [m].
    start, stop
        Interval [s].
    frequency
        Highest frequency of the band [Hz].
    tolerance
        Allowed phase error [rad] and relative error of gains.
    max_spacing
        Largest gap between knots [s].
    gain
        Unit vectors (..., 3) from the radar to the product of the field gains of a Tx and an Rx element.
    reach
        Largest distance of the middle of a Tx and an Rx element from the phase centre [m].

    Returns
    -------
    The knots and their error.
    """
    wavenumber = 4 * np.pi * frequency / SPEED_OF_LIGHT
    if stop <= start:
        return Knots(np.array([start]), 0.0)
    sizes = [len(points) for points in positions(start)]
    if not sum(sizes):
        return Knots(np.array([start]), 0.0)
    counts = np.minimum(sizes, MAX_REPRESENTATIVES)
    borders = np.cumsum(counts)[:-1]
    pattern_points = [
        np.linspace(0, count, min(count, PATTERN_POINTS), endpoint=False).astype(np.intp) for count in counts.tolist()
    ]
    chosen = np.concatenate([first + own for first, own in zip([0, *borders], pattern_points, strict=True)])
    parts = np.cumsum([len(own) for own in pattern_points])[:-1]

    def known(times: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(time, vertex) phases [rad], and (time, vertex, 3) unit vectors to the pattern points."""
        offsets = [np.concatenate([representative(each) for each in positions(float(t))]) - viewpoint for t in times]
        distances = np.stack([lengths(each) for each in offsets])
        towards = np.stack([np.take(each, chosen, axis=0) for each in offsets])
        return wavenumber * distances, towards / np.maximum(distances[:, chosen], 1e-12)[..., None]

    count, gain_off, phase_off = FIRST_COUNT, np.inf, np.inf
    while True:
        times = np.linspace(start, stop, count)
        # Multiples of the golden ratio modulo 1 are spread evenly and aperiodic.
        place = 0.2 + 0.6 * np.mod(_GOLDEN * np.arange(1, count), 1.0)
        between = times[:-1] + place * np.diff(times)
        (values, towards), (truth, there) = known(times), known(between)
        if count == FIRST_COUNT and (values == values[0]).all() and (truth == values[0]).all():
            places = [positions(float(t)) for t in (*times, *between)]  # exact test for motion
            if all(np.array_equal(now, first) for there in places for now, first in zip(there, places[0], strict=True)):
                return Knots(np.array([start]), 0.0)
        weights = knot_weights(times, between)
        error, level = weights @ values - truth, gain(there)
        rms = _rms(error, borders)
        phase, turn, missed, whole = (
            np.sqrt(np.mean(each**2, axis=1))
            for each in (
                rms,
                _rms(lengths(np.tensordot(weights, towards, 1) - there), parts),
                _rms(weights @ gain(towards) - level, parts),
                _rms(level, parts),
            )
        )
        off = np.stack([phase, wavenumber * reach * turn, missed / np.maximum(whole, 1e-300)])
        spacing = times[1] - times[0]
        # A pattern with jumps never converges.
        stalled = count > ENOUGH_POINTS and off[2].max() > 0.5 * gain_off
        gain_off = float(off[2].max())
        fine = off[:2].max() <= tolerance and (stalled or gain_off <= tolerance)
        fine = fine and rms.max() <= 3 * tolerance and np.abs(error).max() <= 10 * tolerance
        if fine and spacing <= max_spacing:
            return Knots(times, float(lengths(off.T).max()))
        before, phase_off = phase_off, float(np.abs(error).max())
        if spacing < 2 * MIN_SPACING and (spacing < 2 * LEAST_SPACING or phase_off * SMOOTH_GAIN > before):
            _LOG.warning(
                "the motion from %.4f to %.4f s is not smooth: with knots %.2g ms apart the phase error is %.2g rad,"
                " between elements %.2g rad, that of the antenna gain %.2g (allowed: %.2g); time_error includes it",
                start, stop, 1e3 * spacing, *off.max(axis=1), tolerance,
            )  # fmt: skip
            return Knots(times, float(lengths(off.T).max()))
        count = 2 * count - 1


def _rms(values: FloatArray, borders: NDArray[np.intp]) -> FloatArray:
    """(mesh, time) root mean squares of `values` (time, vertex) over each mesh's vertices."""
    return np.sqrt(np.stack([np.mean(part**2, axis=1) for part in np.split(values, borders, axis=1)]))


def representative(points: FloatArray) -> FloatArray:
    """(some, 3) positions from all over a mesh (vertex, 3); the same vertices for the same count."""
    return points if len(points) <= MAX_REPRESENTATIVES else np.take(points, _spread_indices(len(points)), axis=0)


@cache
def _spread_indices(count: int) -> NDArray[np.intp]:
    return np.sort(np.random.default_rng(count).permutation(count)[:MAX_REPRESENTATIVES])


class SplinedPositions:
    """Positions [m] of meshes between `knots` [s] by splines, several times faster than poses of bodies. Falls back to
    `positions` where the splines err too much, as for a body that spins across the line of sight."""

    def __init__(self, knots: FloatArray, positions: Callable[[float], Sequence[FloatArray]]) -> None:
        self._knots, self._positions = knots, positions
        self._known = {float(t): positions(float(t)) for t in knots}
        self._right = True
        tried = float(knots[0] + 0.4 * (knots[1] - knots[0])) if len(knots) > 1 else float(knots[0])
        if tried not in self._known:
            truth = positions(tried)
            self.precompute(np.array([tried]))
            missed = [lengths(each - own).max(initial=0.0) for each, own in zip(self._known[tried], truth, strict=True)]
            self._right = max(missed, default=0.0) <= SPLINE_PHASE_ERROR

    def __call__(self, t: float) -> Sequence[FloatArray]:
        """(vertex, 3) of each mesh at a time [s], cached."""
        if t not in self._known:
            self.precompute(np.array([t]))
        return self._known[t]

    def precompute(self, times: FloatArray) -> None:
        """Cache the positions at `times` [s]."""
        fresh = np.array([t for t in times.tolist() if t not in self._known])
        if not self._right:
            self._known |= {t: self._positions(t) for t in fresh.tolist()}
            return
        if not len(fresh):
            return
        weights = knot_weights(self._knots, fresh)
        at_knots = zip(*(self._known[float(t)] for t in self._knots), strict=True)
        meshes = [np.tensordot(weights, np.stack(each), 1) for each in at_knots]
        for number, t in enumerate(fresh.tolist()):
            self._known[t] = [each[number] for each in meshes]


def spline_error(swing: FloatArray, gaps: int) -> FloatArray:
    """Errors of splines with `gaps` gaps at phasors with a phase step `swing` [rad] per gap [root mean square over
    time]."""
    if gaps <= QUIET_GAPS:
        return np.asarray(QUIET_ERROR * swing**3)
    return np.asarray((TERMINATOR_ERROR if gaps <= TERMINATOR_GAPS else INNER_ERROR) * swing**4)


def max_phase_step(tolerance: float, gaps: int) -> float:
    """Largest phase step [rad] per gap for which a spline with `gaps` gaps errs by `tolerance` at most."""
    if gaps == 1:
        return float((tolerance / PAIR_ERROR) ** 0.5)
    if gaps <= QUIET_GAPS:
        return float((tolerance / QUIET_ERROR) ** (1 / 3))
    return float((tolerance / TERMINATOR_ERROR) ** 0.25)
