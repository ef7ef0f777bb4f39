"""Measures what a trained network misses, action by action; see :mod:`rfgen_sionna.generative.diffusion.network`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import torch
from scipy.fft import dct
from scipy.ndimage import uniform_filter1d

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.diffusion.checkpoint import MotionModel
from rfgen_sionna.generative.diffusion.features import FRAME_RATE, recentred
from rfgen_sionna.generative.diffusion.motion_sampling import MotionRequest, MotionSampler, conditions_of
from rfgen_sionna.generative.diffusion.network import BANDS, Residual
from rfgen_sionna.generative.diffusion.phrasebook import CLAUSES
from rfgen_sionna.generative.diffusion.schedule import log_snr, signal_shares, step_at
from training.motion.motion_captions import caption
from training.motion.motion_corpus import Entry, MotionCorpus

TIMES = (0.97, 0.9, 0.8, 0.65, 0.5, 0.35, 0.2, 0.1, 0.05, 0.02)
"""Noise levels, on the unbent cosine."""
_FRAMES = 120
_SIGMAS = 3.0
_FASTEST = 2.5
"""[Hz]."""

DIRECTIONS = 40
"""Principal directions of the error that are regressed."""


def calibrate(
    model: MotionModel,
    corpus: MotionCorpus,
    *,
    clips: int = 32,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> MotionModel:
    """The model with its residuals measured on training clips of each action.

    Args:
        model: as trained.
        corpus: its training set.
        clips: of each action.
        seed: of stretches, sentences and noise.
        progress: called with (actions done, actions).
    """
    rng = np.random.default_rng([seed, 57])
    groups: dict[str, list[Entry]] = {a: [] for a in CLAUSES}
    for entry in corpus.entries:
        if entry.source == "kinematic" and len(entry.actions) == 1 and not entry.held_out:
            groups[entry.actions[0]].append(entry)
    residuals = {}
    for k, (action, group) in enumerate(groups.items()):
        if group:
            residuals[action] = _of_action(model, action, group, clips, rng)
        if progress is not None:
            progress(k + 1, len(groups))
    return replace(model, residuals=residuals)


@torch.no_grad()
def _of_action(model: MotionModel, action: str, group: list[Entry], clips: int, rng: np.random.Generator) -> Residual:
    chosen = [group[int(k)] for k in rng.choice(len(group), min(clips, len(group)), replace=False)]
    truths, requests = [], []
    for entry in chosen:
        start = int(rng.integers(len(entry.features) - _FRAMES + 1))
        stretch = slice(start, start + _FRAMES)
        truths.append((recentred(entry.features[stretch].astype(np.float64)) - model.mean) / model.scale)
        prompt = caption(rng, (action,), hand=entry.hand, speed=entry.speed, doubt=0.0)
        requests.append(MotionRequest(prompt, 0, beat=entry.beat[stretch].astype(np.float64)))
    truth = np.stack(truths)
    clean = torch.from_numpy(truth).float()
    conditions = conditions_of(model, requests, _FRAMES)
    shares = np.array([signal_shares()[step_at(t)] for t in TIMES])
    generator = torch.Generator().manual_seed(int(rng.integers(2**31)))
    noisy, guesses = [], []
    sampler = MotionSampler()
    for share in shares:
        noise = torch.randn(clean.shape, generator=generator)
        x = np.sqrt(share).astype(np.float32) * clean + np.sqrt(1.0 - share).astype(np.float32) * noise
        level = torch.tensor(float(log_snr(share)))
        noisy.append(x.double().numpy())
        guesses.append(sampler.guess(model, x, level, conditions).double().numpy())
    return fit_residual(log_snr(shares), shares, truth, np.stack(noisy), np.stack(guesses))


def fit_residual(
    levels: FloatArray, shares: FloatArray, truths: FloatArray, noisy: FloatArray, guesses: FloatArray
) -> Residual:
    """The regression from one action's motions.

    Args:
        levels: (level,) ln of signal over noise power, ascending.
        shares: (level,) the signal's share of the power.
        truths: (motion, frame, feature) normalised motion.
        noisy: (level, motion, frame, feature) with noise.
        guesses: (level, motion, frame, feature) the network's guesses.
    """
    errors = truths[None] - guesses
    rows = errors.reshape(-1, truths.shape[-1])
    _, vectors = np.linalg.eigh(rows.T @ rows / len(rows))
    directions = vectors[:, ::-1][:, :DIRECTIONS].T
    seen = noisy - np.sqrt(shares)[:, None, None, None] * guesses
    left, right = (dct(a @ directions.T, type=2, norm="ortho", axis=2) for a in (errors, seen))
    above, below = (left * right).mean(axis=1), (right * right).mean(axis=1)
    # neighbouring frequencies are alike: averaged over three, so that few motions are enough
    above, below = (uniform_filter1d(a, 3, axis=1, mode="nearest") for a in (above, below))
    gains = np.clip(above / np.maximum(below, 1e-9), 0.0, 1.0 / np.sqrt(shares)[:, None, None])
    # what chance alone would show is taken off, and what is faster than people repeat themselves
    chance = _SIGMAS / np.sqrt(3.0 * len(truths))
    gains *= np.maximum(0.0, 1.0 - (chance / np.maximum(gains, 1e-6)) ** 2)
    frequency = np.linspace(0.0, 0.5 * FRAME_RATE, truths.shape[1])
    gains /= 1.0 + (frequency[:, None] / _FASTEST) ** 8
    at, places = np.linspace(0.0, 1.0, BANDS), np.linspace(0.0, 1.0, truths.shape[1])
    kept = np.stack([[np.interp(at, places, column) for column in gain.T] for gain in gains]).swapaxes(1, 2)
    return Residual(directions, levels, kept)
