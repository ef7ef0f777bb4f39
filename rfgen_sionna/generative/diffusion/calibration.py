"""Measures what a trained network misses, action by action; see :mod:`rfgen_sionna.generative.diffusion.residual`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import torch

from rfgen_sionna.generative.diffusion.captions import caption
from rfgen_sionna.generative.diffusion.checkpoint import MotionModel
from rfgen_sionna.generative.diffusion.corpus import Corpus, Entry
from rfgen_sionna.generative.diffusion.features import recentred
from rfgen_sionna.generative.diffusion.phrasebook import CLAUSES
from rfgen_sionna.generative.diffusion.residual import Residual, fit_residual
from rfgen_sionna.generative.diffusion.sampling import Sampler, Wish, conditions_of
from rfgen_sionna.generative.diffusion.schedule import log_snr, signal_shares, step_at

TIMES = (0.97, 0.9, 0.8, 0.65, 0.5, 0.35, 0.2, 0.1, 0.05, 0.02)
"""Noise levels, on the unbent cosine."""
_FRAMES = 120


def calibrate(
    model: MotionModel,
    corpus: Corpus,
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
    truths, wishes = [], []
    for entry in chosen:
        start = int(rng.integers(len(entry.features) - _FRAMES + 1))
        stretch = slice(start, start + _FRAMES)
        truths.append((recentred(entry.features[stretch].astype(np.float64)) - model.mean) / model.scale)
        prompt = caption(rng, (action,), hand=entry.hand, speed=entry.speed, doubt=0.0)
        wishes.append(Wish(prompt, 0, beat=entry.beat[stretch].astype(np.float64)))
    truth = np.stack(truths)
    clean = torch.from_numpy(truth).float()
    conditions = conditions_of(model, wishes, _FRAMES)
    shares = np.array([signal_shares()[step_at(t)] for t in TIMES])
    generator = torch.Generator().manual_seed(int(rng.integers(2**31)))
    noisy, guesses = [], []
    sampler = Sampler()
    for share in shares:
        noise = torch.randn(clean.shape, generator=generator)
        x = np.sqrt(share).astype(np.float32) * clean + np.sqrt(1.0 - share).astype(np.float32) * noise
        level = torch.tensor(float(log_snr(share)))
        noisy.append(x.double().numpy())
        guesses.append(sampler.guess(model, x, level, conditions).double().numpy())
    return fit_residual(log_snr(shares), shares, truth, np.stack(noisy), np.stack(guesses))
