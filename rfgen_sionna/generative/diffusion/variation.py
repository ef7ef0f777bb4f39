"""Variation of a motion by the motion model: noised to a level and denoised again (SDEdit, Meng et al. 2022)."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import torch
from scipy.ndimage import gaussian_filter1d

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.diffusion.anchored_limbs import anchored
from rfgen_sionna.generative.diffusion.joint_ranges import within_joint_ranges
from rfgen_sionna.generative.diffusion.motion_noise import signal_share
from rfgen_sionna.generative.diffusion.pose_rows import FRAME_RATE, pose_rows, turned_by
from rfgen_sionna.generative.diffusion.variation_model import SHIPPED, VariationModel, read_model
from rfgen_sionna.generative.diffusion.variation_net import word_indices
from rfgen_sionna.parallel import one_blas_thread
from rfgen_sionna.records import Motion

STRENGTH = 0.3
"""Usual strength."""
SHORTEST = 0.5
"""Shortest motion that is varied [s]."""
_HIGHEST = 0.9
"""Noise level of strength 1: a draft always shows."""
_STEPS = 8
"""Evaluations of the network."""
_CUTOFF, _POSTURE = 2.5, 0.3
"""Frequencies up to which the draft is changed, and up to which a change is one of posture [Hz]."""
_MOVEMENT = 0.5
"""Movement of a joint that a change adds at most, over the joint's own ..."""
_NEAR = 0.4
"""... as seen within that time [s]."""


def vary(draft: Motion, text: str, *, strength: float = STRENGTH, seed: int = 0, weights: Path | None = None) -> Motion:
    """A motion like a draft, as somebody else might do it.

    Rotations of the body's joints differ; way over the floor, timing, contacts, fingers and the rest stay the draft's.

    Args:
        draft: a motion with SMPL's body joints, of at least `SHORTEST`.
        text: what the person does, such as "a person kicks"; empty for any movement.
        strength: 0, the draft itself, to 1; the share of the differences between people that is drawn anew grows as
            sin² of it.
        seed: of the variation.
        weights: model file; None takes the one that ships.

    Raises:
        ValueError: strength or seed are out of range, or the draft is too short or has other joints.
    """
    if not 0.0 <= strength <= 1.0:
        raise ValueError(f"strength: {strength!r}; allowed are 0, the draft itself, to 1")
    if isinstance(seed, bool) or not isinstance(seed, (int, np.integer)) or seed < 0:
        raise ValueError(f"seed: {seed!r}; a whole number of at least 0 is needed")
    if draft.duration < SHORTEST:
        raise ValueError(f"draft: {draft.duration:.2f} s long; allowed are {SHORTEST:g} s and more")
    if strength == 0.0:
        return draft
    rows, context = pose_rows(draft)
    change = denoised(loaded(weights or SHIPPED), rows, context, text, strength, seed) - rows
    return replace(changed(draft, rows, change), prompt=text, seed=seed)


def changed(draft: Motion, rows: FloatArray, change: FloatArray) -> Motion:
    """The draft with a (frame, column) change of its rows, smooth in time, within people's joints and on its floor.

    Movement that the change adds to a joint is at most `_MOVEMENT` of the joint's own, so that who stands still does.
    """
    slow, own = _low_pass(change, _POSTURE), rows - _low_pass(rows, _POSTURE)
    fast = _low_pass(change, _CUTOFF) - slow
    power = [
        gaussian_filter1d(np.mean(each.reshape(len(rows), -1, 6) ** 2, axis=-1), _NEAR * FRAME_RATE, axis=0)
        for each in (own, fast)
    ]
    share = np.minimum(_MOVEMENT * np.sqrt(power[0] / np.maximum(power[1], 1e-12)), 1.0)
    smooth = slow + np.repeat(share, 6, axis=1) * fast
    return anchored(within_joint_ranges(turned_by(draft, rows, rows + smooth), draft), draft)


def _low_pass(rows: FloatArray, cutoff: float) -> FloatArray:
    """(frame, column) rows without what is faster than `cutoff` [Hz], without delay."""
    return gaussian_filter1d(rows, FRAME_RATE * 0.1325 / cutoff, axis=0, mode="nearest")


@torch.no_grad()
def denoised(
    model: VariationModel, rows: FloatArray, context: FloatArray, text: str, strength: float, seed: int
) -> FloatArray:
    """(frame, column) rows that were noised and denoised, by DDIM (Song et al. 2021).

    Args:
        model: the trained model.
        rows: (frame, column) of the draft.
        context: (frame, NUM_CONTEXT) of the draft.
        text: what the person does, or empty.
        strength: 0 to 1.
        seed: of the noise.
    """
    block = model.net.shape.block
    n = len(rows)
    pad = [(block, block + (-n) % block), (0, 0)]
    (mean, scale), (context_mean, context_scale) = model.scaling.rows, model.scaling.context
    clean = np.pad((rows - mean) / scale, pad, mode="edge")
    given = np.pad((context - context_mean) / context_scale, pad, mode="edge")
    words, context_ = word_indices([text], model.vocabulary), torch.from_numpy(given).float()[None]
    levels = _HIGHEST * strength * np.linspace(1.0, 0.0, _STEPS + 1)
    shares = signal_share(levels)
    x = np.sqrt(shares[0]) * clean
    x += np.sqrt(1.0 - shares[0]) * model.noise.draw(np.random.default_rng([seed, 31]), len(clean))
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        with one_blas_thread():
            for level, share, after in zip(levels, shares, shares[1:], strict=False):
                noisy = torch.from_numpy(x).float()[None]
                v = model.net(noisy, context_, torch.tensor([level]).float(), words)[0].double().numpy()
                guess = np.sqrt(share) * x - np.sqrt(1.0 - share) * v
                noise = np.sqrt(1.0 - share) * x + np.sqrt(share) * v
                x = np.sqrt(after) * guess + np.sqrt(1.0 - after) * noise
    finally:
        torch.set_num_threads(threads)
    return mean + scale * x[block : block + n]


@cache
def loaded(path: Path) -> VariationModel:
    """The model of a file, read once."""
    return read_model(path)
