"""How many instants describe a motion over a stretch of time."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence

import numpy as np

from rfgen_sionna.records import SPEED_OF_LIGHT, FloatArray, knot_weights

MIN_SPACING = 0.4e-3
"""Gap between knots [s] below which a motion counts as broken: a vibration of 0.1 mm at 400 Hz still gets its knots."""
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
    mesh's root mean square, which is the relative error of its sum, and no vertex's to more than ten times that. The
    phase is tried once between each two knots, at places that no vibration keeps step with.

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
    (knot,) ascending times [s], 2^n + 1 evenly spaced ones; a single one where nothing moves.
    """
    wavenumber = 4 * np.pi * frequency / SPEED_OF_LIGHT
    if stop <= start:
        return np.array([start])
    sizes = [len(points) for points in positions(start)]
    if not sum(sizes):
        return np.array([start])
    borders = np.cumsum(sizes)[:-1]

    def phases(times: FloatArray) -> FloatArray:
        rows = [np.linalg.norm(np.concatenate(positions(float(t))) - viewpoint, axis=1) for t in times]
        return wavenumber * np.stack(rows)

    count = 3
    while True:
        times = np.linspace(start, stop, count)
        # The golden ratio's multiples fall everywhere in 0 … 1, and never into step.
        place = 0.2 + 0.6 * np.mod(_GOLDEN * np.arange(1, count), 1.0)
        between = times[:-1] + place * np.diff(times)
        values, truth = phases(times), phases(between)
        if count == 3 and np.array_equal(values[:2], values[1:]) and np.array_equal(truth, values[:2]):
            return np.array([start])
        error = knot_weights(times, between) @ values - truth
        typical = max(float(np.sqrt(np.mean(part**2))) for part in np.split(error, borders, axis=1))
        spacing = times[1] - times[0]
        if typical <= tolerance and np.abs(error).max() <= 10 * tolerance and spacing <= max_spacing:
            return times
        if spacing < 2 * MIN_SPACING:
            _LOG.warning(
                "the motion between %.4f and %.4f s is not smooth: at knots %.2g ms apart its phase is still off by "
                "%.2g rad (allowed: %.2g)", start, stop, 1e3 * spacing, typical, tolerance,
            )  # fmt: skip
            return times
        count = 2 * count - 1
