"""Positions between knots."""

import numpy as np
import pytest

from rfgen_sionna.tracing.direct.knots import SPLINE_PHASE_ERROR, SplinedPositions, choose_knots

BODY = np.random.default_rng(0).normal(size=(50, 3)) * 0.2 + [3.0, 0, 0]
LENGTH = 27.6e-3


def swinging(t):
    """An arm, 3 m/s at its end."""
    turn = 0.5 * np.sin(5.0 * t)
    cos, sin = np.cos(turn), np.sin(turn)
    return [BODY @ np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]]).T]


def spinning(t):
    """Around the line of sight: constant distances, so few knots."""
    turn = 2 * np.pi * 25.0 * t
    cos, sin = np.cos(turn), np.sin(turn)
    return [BODY @ np.array([[1, 0, 0], [0, cos, -sin], [0, sin, cos]]).T]


@pytest.mark.parametrize("motion", [swinging, spinning])
def test_positions_between_knots(motion):
    """By the spline, and from the source where distances do not follow a spin."""
    knots, _ = choose_knots(motion, np.zeros(3), 0.0, LENGTH, 77e9, 5e-3, 10e-3, lambda d: np.ones(d.shape[:-1]), 0.0)
    asked = []

    def positions(t):
        asked.append(t)
        return motion(t)

    splined = SplinedPositions(knots, positions)
    times = np.linspace(0.0, LENGTH, 23)
    splined.precompute(times)
    assert (len(asked) > len(times)) == (motion is spinning)
    for t in times.tolist():
        assert np.abs(splined(t)[0] - motion(t)[0]).max() <= SPLINE_PHASE_ERROR
