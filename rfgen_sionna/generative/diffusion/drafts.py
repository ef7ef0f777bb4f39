"""Drafts that motions are made from: where they come from, and the beat that they keep."""

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
from rfgen_sionna.generative.diffusion.motion_sampling import LONGEST as LONGEST_MADE
from rfgen_sionna.generative.diffusion.motion_sampling import MotionRequest, MotionSampler, conditions_of, padded_rows
from rfgen_sionna.generative.diffusion.network import PAIR, STRIDE
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
from rfgen_sionna.generative.diffusion.wording import CAPTURED_LEGS
from rfgen_sionna.generative.motion import ACTIONS, KinematicSource
from rfgen_sionna.generative.motion.actions import with_hand
from rfgen_sionna.generative.motion.skeleton import SIDES

PACES = (0.75, 1.3)
"""Factors on the usual pace between which people differ who are not told one, as in the training clips."""
_TOLD = 0.25
"""Share of that spread (in logarithms) that is left where a pace is asked for."""
_CLEAR = 0.35
"""Autocorrelation from which a draft counts as rhythmic, as for synthesised clips."""
_OFFSETS = 8
"""Phases that are tried."""
_NOISE = 0.93
"""Noise level at which they are: enough to hide the poses, so that the beat tells."""


def canonical_sentence(action: str, hand: str = "") -> str:
    """The plainest sentence for an action."""
    if action not in ACTIONS:
        return "a person " + CAPTURED_LEGS.get(action, "does " + action.replace("_", " "))
    return f"a person {ACTIONS[action].description}" + (with_hand(hand) if hand else "")


def choose_hand(action: str, hand: str, seed: int) -> str:
    """The hand that an action is made with, drawn from the seed where none is named; where both are, the other one
    mirrors it. Empty where the action has none."""
    if action not in ACTIONS or not ACTIONS[action].one_handed:
        return ""
    if hand in SIDES:
        return hand
    return "right" if np.random.default_rng([seed, 3]).uniform() < 0.9 else "left"


def sample_pace(seed: int, speed: float = 1.0) -> float:
    """Factor on the usual pace of one person, drawn from the seed around the one that is asked for."""
    low, high = np.log(PACES)
    drawn = np.random.default_rng([seed, 37]).uniform(low, high)
    return float(speed * np.exp(drawn if speed == 1.0 else _TOLD * (drawn - 0.5 * (low + high))))


def make_draft(
    actions: tuple[str, ...], frames: int, seed: int, hands: HandBasis, *, hand: str = "", speed: float = 1.0
) -> FloatArray:
    """(frame, NUM_FEATURES) synthesised rows that start over the origin facing +x.

    Args:
        actions: one action, or what the legs and what the arms do.
        frames: at 20 Hz.
        seed: of the synthesiser.
        hands: the fingers' components.
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
    """(frame,) phase [rad] of (frame, NUM_FEATURES) rows, up to a constant; None where nothing is repeated."""
    if len(rows) < 24:
        return None
    moving = movement(rows, FRAME_RATE)
    steps = stride(rows, FRAME_RATE)
    signal = moving @ principal_direction(moving) if steps is None else steps
    period, height = find_period(signal, FRAME_RATE, LONGEST if steps is None else LONGEST_STRIDE)
    return find_phase(signal, FRAME_RATE, period) if height >= _CLEAR else None


@torch.no_grad()
def draft_beat(model: MotionModel, request: MotionRequest, rows: FloatArray) -> FloatArray | None:
    """(frame, 3) the beat of a draft as the network knows that of the wish's action; None where there is none.

    A draft shows how fast it is repeated, not which moment the network calls the beginning. That is the phase with
    which the network guesses the draft best.
    """
    phase = motion_phase(rows)
    if phase is None or request.action not in model.beats:
        return None
    shown, seen = phase[:LONGEST_MADE], rows[:LONGEST_MADE]
    n = -(-len(seen) // (PAIR * STRIDE)) * PAIR * STRIDE
    offsets = 2.0 * np.pi * np.arange(_OFFSETS) / _OFFSETS
    requests = [
        MotionRequest(request.prompt, 0, beat=beat_rows(shown + o, len(seen)), source=request.source) for o in offsets
    ]
    clean = torch.from_numpy(padded_rows((seen - model.mean) / model.scale, n)).float()
    noise = torch.randn(n, NUM_FEATURES, generator=torch.Generator().manual_seed(0))
    share = float(signal_shares()[step_at(_NOISE)])
    noisy = (share**0.5 * clean + (1.0 - share) ** 0.5 * noise).expand(_OFFSETS, -1, -1)
    level = torch.tensor(float(log_snr(np.array(share))))
    guess = MotionSampler(guidance=1.0).guess(model, noisy, level, conditions_of(model, requests, n))
    moving = [*range(LOCAL.start, LOCAL.stop), *range(HANDS.start, HANDS.stop)]
    error = ((guess - clean)[:, : len(seen), moving] ** 2).mean(dim=(1, 2)).double().numpy()
    # the error goes once up and down around the circle
    best = float(np.angle(-np.sum(error * np.exp(1j * offsets))))
    return beat_rows(phase + best, len(rows))
