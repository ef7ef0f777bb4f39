"""Polishing flattens what noise has roughened, and keeps outlines and the mean."""

from __future__ import annotations

import numpy as np

from rfgen_sionna.generative.environment.polish import Polish


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
    polished = Polish(rounds=20)(rough)
    error = np.abs(polished - clean)[:2, 4:]
    assert np.sqrt(np.mean(error**2)) < 0.4 * 0.015
    step = polished[0, 8:20, 8].mean() - polished[0, 8:20, 7].mean()
    assert abs(step - 0.25) < 0.02
    assert abs((polished - rough)[:2].mean()) < 1e-12, "smoothing moves energy in decibels, it makes none"


def test_where_nothing_returns_nothing_is_changed() -> None:
    rough = image(0.015)
    polished = Polish(rounds=20)(rough)
    np.testing.assert_array_equal(polished[:, :4], rough[:, :4])
    np.testing.assert_array_equal(polished[2], rough[2])
    np.testing.assert_array_equal(Polish()(rough), rough)
