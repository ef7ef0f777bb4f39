"""Drafts of motions from the kinematic synthesiser, and their beat."""

from __future__ import annotations

import numpy as np
import torch

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.diffusion.checkpoint import MotionModel
from rfgen_sionna.generative.diffusion.features import (
    FRAME_RATE,
    HANDS,
    LOCAL,
    NUM_FEATURES,
    HandBasis,
    arms_of,
    encode,
    recentred,
    replace_parts,
)
from rfgen_sionna.generative.diffusion.motion_sampling import LONGEST as LONGEST_SAMPLED
from rfgen_sionna.generative.diffusion.motion_sampling import MotionRequest, MotionSampler, conditions_of, padded_rows
from rfgen_sionna.generative.diffusion.network import PAIR, STRIDE
from rfgen_sionna.generative.diffusion.phrasebook import CAPTURED_LEGS
from rfgen_sionna.generative.diffusion.rhythm import (
    LONGEST,
    LONGEST_STRIDE,
    beat_rows,
    find_period,
    find_phase,
    movement,
    principal_direction,
    stride,
)
from rfgen_sionna.generative.diffusion.schedule import log_snr, signal_shares, step_at
from rfgen_sionna.generative.motion import ACTIONS, KinematicSource
from rfgen_sionna.generative.motion.actions import with_hand
from rfgen_sionna.generative.motion.skeleton import SIDES

PACES = (0.75, 1.3)
"""Range of factors on the usual pace, as in the training clips."""
_REQUESTED_SHARE = 0.25
"""Share of that range (in logarithms) for a requested pace; keeps some variation between people."""
_RHYTHMIC = 0.35
"""Least autocorrelation of a rhythmic draft, as for training clips."""
_OFFSETS = 8
"""Phases that are tried: enough for a cosine over the circle."""
_NOISE = 0.93
"""Noise level of the trials; it hides the poses, so that the beat decides."""


def canonical_sentence(action: str, hand: str = "") -> str:
    """Plainest sentence for an action."""
    if action not in ACTIONS:
        return "a person " + CAPTURED_LEGS.get(action, "does " + action.replace("_", " "))
    return f"a person {ACTIONS[action].description}" + (with_hand(hand) if hand else "")


def choose_hand(action: str, hand: str, seed: int) -> str:
    """Hand of an action, drawn from the seed unless `hand` is "left" or "right"; empty where the action has none."""
    if action not in ACTIONS or not ACTIONS[action].one_handed:
        return ""
    if hand in SIDES:
        return hand
    return "right" if np.random.default_rng([seed, 3]).uniform() < 0.9 else "left"


def sample_pace(seed: int, speed: float = 1.0) -> float:
    """Factor on the usual pace of one person, drawn from the seed around `speed`."""
    low, high = np.log(PACES)
    drawn = np.random.default_rng([seed, 37]).uniform(low, high)
    return float(speed * np.exp(drawn if speed == 1.0 else _REQUESTED_SHARE * (drawn - 0.5 * (low + high))))


def make_draft(
    actions: tuple[str, ...], frames: int, seed: int, hands: HandBasis, *, hand: str = "", speed: float = 1.0
) -> FloatArray:
    """(frame, NUM_FEATURES) synthesised rows that start over the origin facing +x.

    Args:
        actions: one action, or one of the legs and one of the arms.
        frames: at 20 Hz.
        seed: of the synthesiser.
        hands: principal components of the fingers.
        hand: working hand, or empty.
        speed: factor on the usual speed.
    """
    source = KinematicSource(FRAME_RATE)
    duration = (frames - 1) / FRAME_RATE
    parts = []
    for k, action in enumerate(actions):
        used = choose_hand(action, hand, seed)
        low, high = 0.5, 2.0
        motion = source(action, duration, seed + k, hand=used or None, speed=float(np.clip(speed, low, high)))
        parts.append((encode(motion, hands)[:frames], action, used))
    rows = parts[0][0]
    for other, action, used in parts[1:]:
        rows = replace_parts(rows, other, arms_of(action, used))
    return recentred(rows)


def motion_phase(rows: FloatArray) -> FloatArray | None:
    """(frame,) phase [rad] of (frame, NUM_FEATURES) rows, up to a constant; None without repetition."""
    if len(rows) < 24:
        return None
    moving = movement(rows, FRAME_RATE)
    steps = stride(rows, FRAME_RATE)
    signal = moving @ principal_direction(moving) if steps is None else steps
    period, height = find_period(signal, FRAME_RATE, LONGEST if steps is None else LONGEST_STRIDE)
    return find_phase(signal, FRAME_RATE, period) if height >= _RHYTHMIC else None


@torch.no_grad()
def draft_beat(model: MotionModel, request: MotionRequest, rows: FloatArray) -> FloatArray | None:
    """(frame, 3) beat of a draft with the network's phase convention; None without one.

    The draft gives the period. The phase is the one with which the network's guess of the draft is best.
    """
    phase = motion_phase(rows)
    if phase is None or request.action not in model.beats:
        return None
    phases, short = phase[:LONGEST_SAMPLED], rows[:LONGEST_SAMPLED]
    n = -(-len(short) // (PAIR * STRIDE)) * PAIR * STRIDE
    offsets = 2.0 * np.pi * np.arange(_OFFSETS) / _OFFSETS
    requests = [
        MotionRequest(request.prompt, 0, beat=beat_rows(phases + o, len(short)), source=request.source) for o in offsets
    ]
    clean = torch.from_numpy(padded_rows((short - model.mean) / model.scale, n)).float()
    noise = torch.randn(n, NUM_FEATURES, generator=torch.Generator().manual_seed(0))
    share = float(signal_shares()[step_at(_NOISE)])
    noisy = (share**0.5 * clean + (1.0 - share) ** 0.5 * noise).expand(_OFFSETS, -1, -1)
    level = torch.tensor(float(log_snr(np.array(share))))
    guess = MotionSampler(guidance=1.0).guess(model, noisy, level, conditions_of(model, requests, n))
    moving = [*range(LOCAL.start, LOCAL.stop), *range(HANDS.start, HANDS.stop)]
    error = ((guess - clean)[:, : len(short), moving] ** 2).mean(dim=(1, 2)).double().numpy()
    # phase of the error's first harmonic
    best = float(np.angle(-np.sum(error * np.exp(1j * offsets))))
    return beat_rows(phase + best, len(rows))
