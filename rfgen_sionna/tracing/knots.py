"""How many instants describe a motion over a stretch of time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rfgen_sionna.records import SPEED_OF_LIGHT, FloatArray, knot_weights


def choose_knots(
    positions: Callable[[float], FloatArray],
    viewpoint: FloatArray,
    start: float,
    stop: float,
    frequency: float,
    tolerance: float,
    max_spacing: float,
    max_knots: int = 4097,
) -> FloatArray:
    """Knots between which a spline follows the delay of every vertex.

    They are doubled until the spline through them foretells the two-way phase half way between them to `tolerance` in
    the root mean square, which is the relative error of the sum, and no vertex's to more than ten times that.

    Parameters
    ----------
    positions
        Time [s] to (vertex, 3) positions [m]; called once per instant that is tried.
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

    def phase(t: float) -> FloatArray:
        return np.asarray(wavenumber * np.linalg.norm(positions(t) - viewpoint, axis=1), dtype=np.float64)

    if stop <= start:
        return np.array([start])
    times = np.linspace(start, stop, 3)
    values = np.stack([phase(float(t)) for t in times])
    if np.array_equal(values[0], values[1]) and np.array_equal(values[0], values[2]):
        return np.array([start])
    while True:
        between = 0.5 * (times[1:] + times[:-1])
        truth = np.stack([phase(float(t)) for t in between])
        error = knot_weights(times, between) @ values - truth
        close = np.sqrt(np.mean(error**2)) <= tolerance and np.abs(error).max(initial=0.0) <= 10 * tolerance
        if (close and times[1] - times[0] <= max_spacing) or 2 * len(times) - 1 > max_knots:
            return times
        merged = np.empty((len(times) + len(between), values.shape[1]))
        merged[::2], merged[1::2] = values, truth
        times, values = np.linspace(start, stop, len(merged)), merged
