"""Number of knots at which splines follow the delays of a motion, from its vertices alone."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.records import knot_weights
from rfgen_sionna.scene.mesh import lengths

MAX_VERTICES = 512
"""Largest number of vertices per mesh whose phases are compared."""
MIN_SPACING, SMOOTH_GAIN = 0.125e-3, 1.5
"""Gap between knots [s] below which a motion counts as broken, unless more knots reduce the error by this factor."""
MAX_COUNT = 4097
"""Largest number of knots of an interval."""
_GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
_LOG = logging.getLogger(__name__)


def count_knots(
    positions: Callable[[float], Sequence[FloatArray]],
    pairs: Sequence[tuple[FloatArray, FloatArray]],
    start: float,
    length: float,
    wavenumber: float,
    tolerance: float,
    first: int,
) -> int:
    """Smallest number of evenly spaced knots, `first` at least, between which a spline predicts the phase of every mesh
    to `tolerance` [rad, root mean square over its vertices], and to three times that at any time.

    `positions` gives the (vertex, 3) of each mesh [m] at a time from `start` for a `length` [s]; `pairs` are positions
    (3,) [m] of Tx and Rx elements, `wavenumber` is in rad/m. Tests are once per gap, at fractions that no vibration is
    in step with.
    """

    def phases(times: FloatArray) -> FloatArray:
        """(time, pair, vertex) [rad]"""
        found = []
        for t in times.tolist():
            points = np.concatenate([_some(each) for each in positions(t)])
            found.append([lengths(points - tx) + lengths(points - rx) for tx, rx in pairs])
        return wavenumber * np.array(found)

    borders = np.cumsum([len(_some(each)) for each in positions(start)])[:-1]
    count, before = first, np.inf
    while True:
        times = np.linspace(start, start + length, count)
        place = 0.2 + 0.6 * np.mod(_GOLDEN * np.arange(1, count), 1.0)
        between = times[:-1] + place * np.diff(times)
        values, truth = phases(times), phases(between)
        off = np.tensordot(knot_weights(times, between), values, 1) - truth
        rms = np.sqrt(np.array([np.mean(own**2, axis=2).max(axis=1) for own in np.split(off, borders, axis=2)]))
        worst = float(np.sqrt(np.mean(rms**2, axis=1)).max(initial=0.0))
        if worst <= tolerance and rms.max(initial=0.0) <= 3 * tolerance:
            return count
        spacing = length / (count - 1)
        if (spacing < MIN_SPACING and worst * SMOOTH_GAIN > before) or count >= MAX_COUNT:
            _LOG.warning(
                "the motion from %.4f to %.4f s is not smooth: with knots %.2g ms apart the phase error is %.2g rad "
                "(allowed: %.2g); time_error includes it",
                start, start + length, 1e3 * spacing, worst, tolerance,
            )  # fmt: skip
            return count
        count, before = count + max(1, count // 3), worst


def _some(points: FloatArray) -> FloatArray:
    """Positions from all over a mesh (vertex, 3); the same vertices for the same count."""
    return points if len(points) <= MAX_VERTICES else np.take(points, _spread(len(points)), axis=0)


@cache
def _spread(count: int) -> NDArray[np.intp]:
    return np.sort(np.random.default_rng(count).permutation(count)[:MAX_VERTICES])
