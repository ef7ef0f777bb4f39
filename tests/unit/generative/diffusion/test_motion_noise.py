"""Noise of the motion model has the covariance and the spectrum that were measured."""

from __future__ import annotations

import numpy as np
import pytest

from rfgen_sionna.generative.diffusion.motion_noise import measured_noise, signal_share


def test_noise_is_like_what_it_was_measured_on() -> None:
    """Two columns of slow noise, the second half as strong, correlated by 0.8."""
    rng = np.random.default_rng(0)
    steps = rng.standard_normal((400, 64, 2)) @ np.linalg.cholesky([[1.0, 0.4], [0.4, 0.25]]).T
    slow = np.cumsum(steps, axis=1)
    noise = measured_noise(slow)
    drawn = np.concatenate([noise.draw(np.random.default_rng([1, k]), 256) for k in range(200)])
    rows = slow.reshape(-1, 2)
    assert np.cov(drawn.T) == pytest.approx(rows.T @ rows / len(rows), rel=0.15)
    # of a random walk, neighbours differ by a small share
    ratio = [np.mean(np.diff(each, axis=-2) ** 2) / np.mean(each**2) for each in (slow, drawn.reshape(200, 256, 2))]
    # stretches that end elsewhere than they begin have more of high frequencies
    assert ratio[0] < ratio[1] < 3.0 * ratio[0]


def test_levels_go_from_the_motion_to_noise_alone() -> None:
    assert signal_share(0.0) == pytest.approx(1.0)
    assert signal_share(0.5) == pytest.approx(0.5)
    assert signal_share(1.0) == pytest.approx(0.0, abs=1e-12)


def test_any_length_has_the_same_power() -> None:
    noise = measured_noise(np.cumsum(np.random.default_rng(0).standard_normal((100, 64, 3)), axis=1))
    power = [
        np.mean([np.mean(noise.draw(np.random.default_rng(k), frames) ** 2) for k in range(60)]) for frames in (16, 300)
    ]
    assert power[0] == pytest.approx(power[1], rel=0.3)
