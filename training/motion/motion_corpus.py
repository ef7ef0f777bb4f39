"""The training set in memory: synthesised and captured clips as features, with what is said about them."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.diffusion import rhythm
from rfgen_sionna.generative.diffusion.features import (
    CONTACTS,
    FRAME_RATE,
    HAND_COMPONENTS,
    HAND_JOINTS,
    HANDS,
    LOCAL,
    MIRROR_ROTVEC,
    ROOT,
    TRACKED_POSITIONS,
    TURN,
    HandBasis,
    arms_of,
    encode,
    replace_parts,
)
from rfgen_sionna.generative.diffusion.phrasebook import UPPER
from rfgen_sionna.generative.diffusion.rhythm import Beat
from rfgen_sionna.generative.motion import ACTIONS
from rfgen_sionna.generative.motion.foot_lock import lock_feet
from rfgen_sionna.generative.motion.skeleton import JOINT, JOINT_NAMES, NUM_BODY_JOINTS
from rfgen_sionna.records import Motion
from training.motion.kinematic_clips import Clip, read_clips
from training.motion.mocap import MocapClip

_CLEAR = {"kinematic": 0.35, "mocap": 0.6}
"""Autocorrelation from which a clip counts as rhythmic."""


@dataclass(frozen=True)
class Entry:
    """One clip of the training set."""

    features: NDArray[np.float16]
    """(frame, NUM_FEATURES)."""
    beat: NDArray[np.float16]
    """(frame, 3) as :func:`rfgen_sionna.generative.diffusion.rhythm.beat_rows`."""
    actions: tuple[str, ...]
    """The action; for composed clips what the legs and what the arms do."""
    source: str
    """"kinematic" or "mocap"."""
    name: str
    hand: str = ""
    speed: float = 1.0
    captions: tuple[str, ...] = ()
    """Sentences of a captured clip; others are drawn from the phrase book."""
    held_out: bool = False


@dataclass(frozen=True)
class MotionCorpus:
    """All clips, and what was measured on the kinematic ones."""

    entries: tuple[Entry, ...]
    hands: HandBasis
    beats: dict[str, Beat]
    mean: FloatArray
    """(NUM_FEATURES,)."""
    scale: FloatArray
    """(NUM_FEATURES,)."""


def held_out(name: str, share: float = 0.12) -> bool:
    """Whether a clip is kept from training; decided by its name alone."""
    return int(hashlib.sha256(name.encode()).hexdigest()[:8], 16) < share * 2**32


def build(
    files: Sequence[Path],
    captures: Sequence[MocapClip],
    *,
    composed: int = 600,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> MotionCorpus:
    """The training set.

    Args:
        files: of :func:`training.motion.kinematic_clips.synthesise`.
        captures: of the mocap pack.
        composed: clips made of one clip's legs and another's arms.
        seed: of their choice.
        progress: called with (clips done, clips).
    """
    clips: dict[str, list[Clip]] = {}
    for path in files:
        for clip in read_clips(path):
            clips.setdefault(clip.action, []).append(clip)
    some = [clip.motion for group in clips.values() for clip in group[:20]]
    hands = fit_hands([clip.motion for clip in clips["standing"][:40]], some)
    total = sum(map(len, clips.values())) + len(captures) + composed
    done = 0
    entries: list[Entry] = []
    for action, group in clips.items():
        rows = [encode(clip.motion, hands) for clip in group]
        phases = _phases(rows, [clip.hand for clip in group], ACTIONS[action].periodic, _CLEAR["kinematic"])
        for clip, features, phase in zip(group, rows, phases, strict=True):
            name = f"{action}/{clip.seed}"
            entries.append(
                Entry(
                    features.astype(np.float16),
                    rhythm.beat_rows(phase, len(features)).astype(np.float16),
                    (action,),
                    "kinematic",
                    name,
                    clip.hand,
                    clip.speed,
                    held_out=held_out(name),
                )
            )
        done += len(group)
        if progress is not None:
            progress(done, total)
    entries += compose(entries, composed, seed)
    entries += captured(captures, hands)
    if progress is not None:
        progress(total, total)
    mean, scale = _statistics(entries)
    return MotionCorpus(tuple(entries), hands, beats_of(entries), mean, scale)


def captured(captures: Sequence[MocapClip], hands: HandBasis) -> list[Entry]:
    """Entries of captured clips, each also mirrored; their planted feet are held still first."""
    by_action: dict[str, list[tuple[MocapClip, FloatArray, bool]]] = {}
    for capture in captures:
        features = encode(lock_feet(capture.motion), hands)
        by_action.setdefault(capture.action, []).append((capture, features, False))
        by_action[capture.action].append((capture, mirrored(features), True))
    out = []
    for action, group in by_action.items():
        phases = _phases([f for _, f, _ in group], [""] * len(group), True, _CLEAR["mocap"])
        for (capture, features, flipped), phase in zip(group, phases, strict=True):
            sentences = tuple(_flip_words(c) for c in capture.captions) if flipped else capture.captions
            out.append(
                Entry(
                    features.astype(np.float16),
                    rhythm.beat_rows(phase, len(features)).astype(np.float16),
                    (_flip_words(action) if flipped else action,),
                    "mocap",
                    capture.name + ("/mirrored" if flipped else ""),
                    captions=sentences,
                    # both sides of a clip are held out together
                    held_out=held_out(capture.name),
                )
            )
    return out


def compose(entries: Sequence[Entry], count: int, seed: int) -> list[Entry]:
    """Clips of a walker whose arms do something else."""
    rng = np.random.default_rng([seed, 5])
    by_action: dict[str, list[Entry]] = {}
    for entry in entries:
        if not entry.held_out:
            by_action.setdefault(entry.actions[0], []).append(entry)
    out = []
    for k in range(count):
        legs = by_action["walk"][int(rng.integers(len(by_action["walk"])))]
        arms_action = UPPER[k % len(UPPER)]
        arms = by_action[arms_action][int(rng.integers(len(by_action[arms_action])))]
        sides = arms_of(arms_action, arms.hand)
        features = replace_parts(legs.features.astype(np.float64), arms.features.astype(np.float64), sides)
        out.append(
            Entry(
                features.astype(np.float16),
                legs.beat,
                ("walk", arms_action),
                "kinematic",
                f"composed/{seed}/{k}",
                arms.hand,
                legs.speed,
            )
        )
    return out


def _phases(rows: Sequence[FloatArray], hands: Sequence[str], periodic: bool, clear: float) -> list[FloatArray | None]:
    """Phase of each clip of one action; the same phase is the same moment in every clip."""
    if not periodic:
        return [None] * len(rows)
    moving = [rhythm.movement(f, FRAME_RATE) for f in rows]
    directions = {
        hand: rhythm.principal_direction(np.concatenate([m for m, h in zip(moving, hands, strict=True) if h == hand]))
        for hand in set(hands)
    }
    phases: list[FloatArray | None] = []
    for features, m, hand in zip(rows, moving, hands, strict=True):
        steps = rhythm.stride(features, FRAME_RATE)
        signal = m @ directions[hand] if steps is None else steps
        longest = rhythm.LONGEST if steps is None else rhythm.LONGEST_STRIDE
        period, height = rhythm.find_period(signal, FRAME_RATE, longest)
        phases.append(rhythm.find_phase(signal, FRAME_RATE, period) if height >= clear else None)
    return phases


def beats_of(entries: Sequence[Entry]) -> dict[str, Beat]:
    """How each action is repeated, from the clips that have a beat; actions with fewer than four of them have none."""
    measured: dict[str, list[tuple[float, float, float]]] = {}
    for entry in entries:
        beat = entry.beat.astype(np.float64)
        if len(entry.actions) > 1 or len(beat) < 24 or not beat[0, 2]:
            continue
        rate = np.gradient(np.unwrap(np.arctan2(beat[:, 1], beat[:, 0]))) * FRAME_RATE / (2.0 * np.pi)
        middle = rate[len(rate) // 8 : -len(rate) // 8]
        if middle.mean() > 0.0:
            measured.setdefault(entry.actions[0], []).append(
                (np.log(middle.mean()), middle.std() / middle.mean(), np.log(entry.speed))
            )
    out = {}
    for action, rows in measured.items():
        if len(rows) >= 4:
            rate, jitter, factor = np.array(rows).T
            # the clips' speed factors are taken out: a drawn beat has the usual speed
            spread = float(np.clip(np.std(rate - factor), 0.03, 0.25))
            out[action] = Beat(float(np.median(rate - factor)), spread, float(np.clip(np.median(jitter), 0.01, 0.08)))
    return out


def _statistics(entries: Sequence[Entry]) -> tuple[FloatArray, FloatArray]:
    """Mean and scale of each feature; columns of a kind share at least a quarter of their kind's scale."""
    from rfgen_sionna.generative.diffusion.features import CONTACTS, HANDS, LOCAL, ROOT, TRACKED_POSITIONS, TURN

    sample = np.concatenate([e.features[::7].astype(np.float32) for e in entries if not e.held_out])
    mean, scale = sample.mean(axis=0).astype(np.float64), sample.std(axis=0).astype(np.float64)
    for kind in (ROOT, TURN, LOCAL, TRACKED_POSITIONS, CONTACTS, HANDS):
        scale[kind] = np.maximum(scale[kind], 0.35 * np.sqrt(np.mean(scale[kind] ** 2)))
    # left and right, to and fro are alike
    mean[ROOT.start : ROOT.start + 2] = 0.0
    mean[TURN] = 0.0
    scale[ROOT.start : ROOT.start + 2] = scale[ROOT.start : ROOT.start + 2].max()
    return mean, scale


def _flip_words(text: str) -> str:
    return text.replace("left", "\0").replace("right", "left").replace("\0", "right")


def fit_hands(relaxed: list[Motion], motions: list[Motion]) -> HandBasis:
    """Components of the fingers of `motions`, around the mean hand of the `relaxed` ones; all have 52 joints."""

    def vectors(motion: Motion) -> FloatArray:
        rows = []
        for side, joints in HAND_JOINTS.items():
            v = Rotation.from_quat(motion.rotations[:, joints].reshape(-1, 4)).as_rotvec().reshape(-1, 15, 3)
            rows.append((v * MIRROR_ROTVEC if side == "right" else v).reshape(-1, 45))
        return np.concatenate(rows)

    mean = np.concatenate([vectors(m) for m in relaxed]).mean(axis=0)
    spread = np.concatenate([vectors(m) for m in motions]) - mean
    _, _, rows = np.linalg.svd(spread.T @ spread)
    return HandBasis(mean, rows[:HAND_COMPONENTS])


def mirrored(features: FloatArray) -> FloatArray:
    """Feature rows of the mirrored motion, left for right."""
    flip = np.array([1.0, -1.0, 1.0])
    # a rotation R becomes M R M
    flip_six = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
    n = len(features)
    out = features.copy()
    out[:, ROOT] = features[:, ROOT] * flip
    out[:, TURN] = features[:, TURN] * flip_six
    local = features[:, LOCAL].reshape(n, -1, 6)[:, _SWAPPED] * flip_six
    out[:, LOCAL] = local.reshape(n, -1)
    places = features[:, TRACKED_POSITIONS].reshape(n, -1, 2, 3)[:, :, ::-1] * flip
    out[:, TRACKED_POSITIONS] = places.reshape(n, -1)
    out[:, CONTACTS] = features[:, CONTACTS][:, ::-1]
    out[:, HANDS] = features[:, HANDS].reshape(n, 2, -1)[:, ::-1].reshape(n, -1)
    return out


def _swapped() -> list[int]:
    def other(name: str) -> str:
        side, _, rest = name.partition("_")
        return {"left": f"right_{rest}", "right": f"left_{rest}"}.get(side, name)

    return [JOINT[other(name)] - 1 for name in JOINT_NAMES[1:NUM_BODY_JOINTS]]


_SWAPPED = _swapped()
