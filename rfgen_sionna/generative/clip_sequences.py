"""Clips as long as an action is wanted: once, again and again, or at a rate."""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType

import numpy as np
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.action_definitions.sampled_series import period
from rfgen_sionna.generative.clip_choice import RATE, clip_record, edited, plain_clip, span_at
from rfgen_sionna.generative.motion.clip_editing import (
    at_pace,
    cut,
    held,
    joined,
    likeness,
    pose_features,
    reversed_in_time,
    sway,
)
from rfgen_sionna.generative.motion.floor_ways import steady_part
from rfgen_sionna.generative.motion.rotations import continuous
from rfgen_sionna.generative.motion.skeleton import JOINT, JOINT_NAMES, NUM_BODY_JOINTS
from rfgen_sionna.generative.prompts.prompt_error import PromptError
from rfgen_sionna.generative.repertoire import HELD, WAYS, Window, windows
from rfgen_sionna.records import Motion

_TAIL = 3.0
"""Longest time before the end of a motion in which another clip may go on [s]."""
_DROPPED = 0.03
"""What a second that a join leaves out adds to the distance of its poses [m]."""
_ALIKE = 0.09
"""Distance of poses up to which a clip goes on as itself [m]; beyond, other clips are tried."""
_LEAST = 0.4
"""Shortest part that a joined clip adds [s]."""
_STILL = 0.35
"""Mean speed of joints up to which a person may stay in a pose [m/s]."""
_PERIODIC = 0.6
"""Autocorrelation from which a movement is one that goes on, such as waving, and not one after the other."""
_PACE_LIMITS = (0.5, 1.8)
"""Factors on the pace of a clip for a rate."""
_LEGS = ("hip", "knee", "ankle", "foot")
_HELD_OTHERWISE = MappingProxyType({"spine1": 0.025, "spine2": 0.025, "spine3": 0.025, "neck": 0.04, "head": 0.05})
"""Joint -> standard deviation of its turn about each axis between two times that a person stands [rad]."""
_ARM_OFF = 0.06
"""The same of a shoulder, outwards and ahead [rad]."""


def once(clip: Motion, span: tuple[int, int], count: int, rng: np.random.Generator) -> Motion:
    """The action once, the person keeping still before and after it."""
    start, stop = span
    spare = max(count - (stop - start), 0)
    start = max(0, start - int(spare * rng.uniform(0.2, 0.6)))
    stop = min(len(clip.translation), start + max(count, stop - start))
    motion = cut(clip, start, min(stop, len(clip.translation)))
    missing = count - len(motion.translation)
    if missing <= 0:
        return motion
    before = int(missing * rng.uniform(0.15, 0.45)) if _speed_at(motion, 0) < _STILL else 0
    if before:
        motion = reversed_in_time(held_pose(reversed_in_time(motion), before, rng))
    return held_pose(motion, missing - before, rng) if missing > before else motion


def _speed_at(motion: Motion, frame: int) -> float:
    """Mean speed of places and turns of joints about a frame, as metres of a joint [m/s]."""
    features = pose_features(cut(motion, max(frame - 2, 0), frame + 3))
    third = (features.shape[1] - 2) // 2
    return float(np.linalg.norm(features[:, third : 2 * third], axis=1).mean() / 0.12)


def held_pose(motion: Motion, count: int, rng: np.random.Generator) -> Motion:
    """The motion, then `count` frames of its last pose with the sway of someone who stands or sits still."""
    small = sway_of_standing(count, rng)
    if motion.translation[-1, 2] < 0.7:
        small[:, 0] = 0.0
    return held(motion, count, small)


def sway_of_standing(count: int, rng: np.random.Generator) -> FloatArray:
    """(count, joint, 3) small turns over still legs of one of the people who stand [rad]."""
    still = [each for each in windows()["standing"] if clip_record(each.clip).duration > 10.0]
    clip = plain_clip(still[int(rng.integers(len(still)))].clip)
    small = sway(clip, count, int(rng.integers(len(clip.translation))))
    small[:, [k for k, name in enumerate(JOINT_NAMES[:NUM_BODY_JOINTS]) if name.endswith(_LEGS)]] = 0.0
    return small


def restless(motion: Motion, rng: np.random.Generator, strength: float) -> Motion:
    """The motion of who keeps about still with the trunk, head and arms held a little otherwise, and with more sway.

    Args:
        motion: on the feet.
        rng: of the posture and the sway.
        strength: 1 for a usual difference between two times that a person stands.
    """
    turns = strength * sway_of_standing(len(motion.translation), rng)
    turns[:, 0] = 0.0
    for name, size in _HELD_OTHERWISE.items():
        turns[:, JOINT[name]] += strength * np.clip(rng.normal(0.0, size, 3), -2.0 * size, 2.0 * size)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        # arms go out and ahead, never into the body
        away, ahead = np.abs(rng.normal(0.0, _ARM_OFF, 2))
        turns[:, JOINT[f"{side}_shoulder"]] += strength * np.array([sign * away, -ahead, 0.0])
    rotations = Rotation.from_rotvec(turns.reshape(-1, 3)) * Rotation.from_quat(motion.rotations.reshape(-1, 4))
    return replace(motion, rotations=continuous(rotations.as_quat().reshape(motion.rotations.shape)))


def repeated(
    action: str, window: Window, mirror: bool, pace: float, count: int, rng: np.random.Generator, names: list[str],
    *, steady: bool = False,
) -> Motion:  # fmt: skip
    """The action from a window on, again and again, by clips that go on where poses are alike."""
    clip = edited(window, mirror, pace)
    start, stop = span_at(window, pace)
    stop = min(stop, len(clip.translation))
    if steady:
        clip = motion = cut(clip, *steady_part(clip, start, stop))
    else:
        spare = max(count - (stop - start), 0)
        first = max(0, start - int(rng.uniform(0.0, 1.0) * spare), min(stop - count, start))
        motion = cut(clip, first, min(len(clip.translation), max(stop, first + count)))
    others = [each for each in windows()[action] if each.clip != window.clip]
    kin = [each for each in others if clip_record(each.clip).subject == clip_record(window.clip).subject]
    while len(motion.translation) < count:
        tried = [(clip, "")]
        _, distance = _join(motion, clip)
        if distance > _ALIKE and (kin or others):
            pool = kin or others
            for k in rng.permutation(len(pool))[:3]:
                turned = bool(rng.integers(2)) if pool[k].mirror is None else bool(pool[k].mirror)
                if pool[k].side not in ("both",) and window.side != "both":
                    turned = (pool[k].side != window.side) != mirror
                other = edited(pool[k], turned, pace)
                if steady:
                    other = cut(other, *steady_part(other, *span_at(pool[k], pace)))
                tried.append((other, pool[k].clip))
        best = min(tried, key=lambda each: _join(motion, each[0])[1])
        (here, there), distance = _join(motion, best[0])
        if best[1]:
            names.append(best[1])
        before = len(motion.translation)
        motion = joined(cut(motion, 0, here + 1), cut(best[0], there, len(best[0].translation)))
        if len(motion.translation) <= before:
            motion = held_pose(motion, count - len(motion.translation), rng)
    return cut(motion, 0, max(count, 2)) if action in WAYS or action in HELD else cut(motion, 0, count)


def at_rate(
    action: str, window: Window, mirror: bool, interval: float, count: int, rng: np.random.Generator, names: list[str]
) -> Motion:
    """The action again and again, `interval` [s] from one time to the next."""
    clip = edited(window, mirror, 1.0)
    start, stop = span_at(window, 1.0)
    core = cut(clip, start, stop)
    features = pose_features(core)[:, :-2]
    time, match = period(features, longest_one=0.6 * core.duration)
    rate = 60.0 / interval
    if match > _PERIODIC:
        pace = time / interval
        if pace > _PACE_LIMITS[0]:
            check_pace(pace, rate, action)
            return repeated(action, window, mirror, pace, count, rng, names)
    spare = min(max(interval - core.duration, 0.0), 1.2)
    once = cut(clip, max(0, start - int(0.4 * spare * RATE)), stop + int(0.4 * spare * RATE))
    pace = max(float(rng.uniform(0.95, 1.05)), 1.02 * once.duration / interval)
    check_pace(pace, rate, action)
    once = at_pace(once, pace)
    motion, times = once, 1
    while len(motion.translation) < count:
        wanted = round(times * interval * RATE)
        if wanted > len(motion.translation):
            motion = held_pose(motion, wanted - len(motion.translation), rng)
        motion = joined(cut(motion, 0, wanted), once)
        times += 1
    return cut(motion, 0, count)


def check_pace(pace: float, rate: float, action: str) -> None:
    low, high = _PACE_LIMITS
    if not low <= pace <= high:
        raise PromptError(
            f"rate: {rate:g} a minute with {action!r}; people whose clips show it reach {rate / pace * low:.2g} to "
            f"{rate / pace * high:.2g}"
        )


def _join(motion: Motion, other: Motion) -> tuple[tuple[int, int], float]:
    """Frames at which `other` may go on, (last of `motion`, first of `other`), and the distance of the poses [m]."""
    total, length = len(motion.translation), len(other.translation)
    tail = max(0, total - max(round(_TAIL * RATE), 2), total // 2 if total > 2 else 0)
    head = max(1, min(length - round(_LEAST * RATE), length // 2))
    away = likeness(pose_features(cut(motion, tail, total)), pose_features(cut(other, 0, head)))
    lost = (np.arange(tail, total)[::-1] - tail)[:, None] + np.arange(head)
    gain = length - lost
    cost = away + _DROPPED / RATE * lost
    cost[gain < _LEAST * RATE] += 10.0
    here, there = np.unravel_index(int(np.argmin(cost)), cost.shape)
    return (tail + int(here), int(there)), float(cost[here, there])
