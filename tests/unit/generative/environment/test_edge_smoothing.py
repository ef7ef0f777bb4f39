"""Polishing flattens what noise has roughened, and keeps outlines and the mean."""

from __future__ import annotations

import numpy as np

from rfgen_sionna.generative.environment.edge_smoothing import EdgePreservingSmoothing
from rfgen_sionna.generative.environment.layout_map import CHANNELS


def image(noise: float) -> np.ndarray:
    rng = np.random.default_rng(0)
    x = np.zeros((3, 32, 32))
    x[0], x[1], x[2] = -0.3, -0.6, 1 / 3
    x[:2, 8:20, 8:20] += 0.25
    x[:, :4] = [[[-1.0]], [[1.0]], [[-1.0]]]
    x[:2, 4:] += noise * rng.standard_normal((2, 28, 32))
    return x


def test_noise_on_surfaces_goes_and_edges_stay() -> None:
    clean, rough = image(0.0), image(0.015)
    smoothed = EdgePreservingSmoothing(rounds=20)(rough)
    error = np.abs(smoothed - clean)[:2, 4:]
    assert np.sqrt(np.mean(error**2)) < 0.4 * 0.015
    step = smoothed[0, 8:20, 8].mean() - smoothed[0, 8:20, 7].mean()
    assert abs(step - 0.25) < 0.02
    assert abs((smoothed - rough)[:2].mean()) < 1e-12, "smoothing moves energy in decibels, it makes none"


def test_where_nothing_returns_nothing_is_changed() -> None:
    rough = image(0.015)
    smoothed = EdgePreservingSmoothing(rounds=20)(rough)
    np.testing.assert_array_equal(smoothed[:, :4], rough[:, :4])
    np.testing.assert_array_equal(smoothed[2], rough[2])
    np.testing.assert_array_equal(EdgePreservingSmoothing()(rough), rough)


def test_what_the_sketch_tells_apart_stays_apart() -> None:
    """A door that is hardly darker than its wall, as far away: smoothed over without the sketch, kept with it."""
    rng = np.random.default_rng(1)
    plain = np.zeros((3, 32, 32))
    plain[0], plain[1], plain[2] = -0.3, -0.6, 1 / 3
    plain[0, 8:, 12:18] -= 0.03
    rough = plain.copy()
    rough[0] += 0.01 * rng.standard_normal((32, 32))
    layout_map = np.zeros((CHANNELS, 32, 32))
    layout_map[-1, 8:, 12:18] = 5.0

    def step(x: np.ndarray) -> float:
        return float(x[0, 10:, 11].mean() - x[0, 10:, 12].mean())

    without, barred = EdgePreservingSmoothing(rounds=20)(rough), EdgePreservingSmoothing(rounds=20)(rough, layout_map)
    assert step(without) < 0.01 < 0.026 < step(barred) < 0.034
    for channel, value in ((2, 0.5), (0, 0.3)):  # turned against the wall, before the wall
        other = np.zeros((CHANNELS, 32, 32))
        other[channel, 8:, 12:18] = value
        np.testing.assert_array_equal(EdgePreservingSmoothing(rounds=20)(rough, other), barred)
    np.testing.assert_array_equal(EdgePreservingSmoothing(rounds=20)(rough[None], layout_map[None])[0], barred)
    assert np.std(barred[0, :8]) < 0.3 * np.std(rough[0, :8])
