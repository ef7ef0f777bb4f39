"""What a network misses comes back with its own size and pace, and nothing else does."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from rfgen_sionna.generative.diffusion.features import NUM_FEATURES
from rfgen_sionna.generative.diffusion.network import Corrector
from training.motion.calibration import fit_residual

SHARES = np.array([0.05, 0.3, 0.7, 0.95, 0.999])
LEVELS = np.log(SHARES / (1.0 - SHARES))
FRAMES, COUNT = 80, 120


def world(rng: np.random.Generator, count: int, size: float) -> np.ndarray:
    """(count, frame, feature) motion that a lazy network guesses as zero: one slow pattern of a random height."""
    pattern = np.zeros(NUM_FEATURES)
    pattern[:10] = 1.0 / np.sqrt(10.0)
    return size * rng.standard_normal((count, 1, 1)) * np.ones((1, FRAMES, 1)) * pattern


def noised(truth: np.ndarray, share: float, rng: np.random.Generator) -> np.ndarray:
    return np.sqrt(share) * truth + np.sqrt(1.0 - share) * rng.standard_normal(truth.shape)


@pytest.mark.parametrize("share", [0.3, 0.95])
def test_a_lazy_guess_is_corrected_as_wiener_would(share: float) -> None:
    rng = np.random.default_rng(0)
    truth = world(rng, COUNT, 0.5)
    seen = np.stack([noised(truth, s, rng) for s in SHARES])
    residual = fit_residual(LEVELS, SHARES, truth, seen, np.zeros_like(seen))
    fresh = world(rng, 60, 0.5)
    noisy = noised(fresh, share, rng)
    correct = Corrector([residual] * len(fresh), FRAMES)
    made = correct(torch.zeros(noisy.shape), torch.from_numpy(noisy).float(), share).numpy()
    # the pattern's one number is seen in 80 frames: power 0.25 * 80 against the noise
    power = 0.25 * FRAMES
    expected = np.sqrt((1.0 - share) / (share * power + 1.0 - share))
    error = np.sqrt(((made - fresh) ** 2).sum() / (fresh**2).sum())
    # besides, some noise comes through the other directions
    assert 0.5 * expected < error < expected + 0.25


def test_a_perfect_guess_is_left_alone() -> None:
    rng = np.random.default_rng(1)
    truth = world(rng, COUNT, 0.5)
    seen = np.stack([noised(truth, s, rng) for s in SHARES])
    guesses = truth[None] + 1e-4 * rng.standard_normal(seen.shape)
    residual = fit_residual(LEVELS, SHARES, truth, seen, guesses)
    correct = Corrector([residual, None], FRAMES)
    guess = torch.from_numpy(truth[:2]).float()
    made = correct(guess, torch.from_numpy(seen[1, :2]).float(), 0.3)
    assert float((made - guess).abs().max()) < 0.02
    assert torch.equal(made[1], guess[1])
