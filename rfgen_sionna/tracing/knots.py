"""How many instants describe a motion over a stretch of time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rfgen_sionna.records import SPEED_OF_LIGHT, FloatArray, knot_weights

MAX_SPACING = 10e-3
"""Longest gap between knots of something that moves [s]: visibility is only known at knots."""


def choose_knots(
    positions: Callable[[float], FloatArray],
    viewpoint: FloatArray,
    start: float,
    stop: float,
    frequency: float,
    tolerance: float,
    max_spacing: float = MAX_SPACING,
    max_knots: int = 4097,
) -> FloatArray:
    """Knots between which a spline follows the delay of every vertex.

    The knots are halved until the spline through the coarser ones foretells the two-way phase at the
    new ones to 8 x `tolerance`; a cubic spline's error falls by 16 with each halving.

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

    Returns
    -------
    (knot,) ascending times [s]; a single one where nothing moves.
    """
    wavenumber = 4 * np.pi * frequency / SPEED_OF_LIGHT

    def phase(t: float) -> FloatArray:
        return wavenumber * np.linalg.norm(positions(t) - viewpoint, axis=1)

    if stop <= start:
        return np.array([start])
    times = np.linspace(start, stop, 3)
    values = [phase(float(t)) for t in times]
    if all(np.array_equal(values[0], later) for later in values[1:]):
        return np.array([start])
    coarse, values = times[[0, 2]], np.stack(values)
    while True:
        foretold = knot_weights(coarse, times[1::2]) @ values[::2]
        error = float(np.abs(foretold - values[1::2]).max(initial=0.0))
        spacing = times[1] - times[0]
        if (error <= 8 * tolerance and spacing <= max_spacing) or 2 * len(times) - 1 > max_knots:
            return times
        coarse, times = times, np.linspace(start, stop, 2 * len(times) - 1)
        finer = np.empty((len(times), values.shape[1]))
        finer[::2] = values
        finer[1::2] = [phase(float(t)) for t in times[1::2]]
        values = finer
