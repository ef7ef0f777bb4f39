"""Sitting on a chair, sitting down and standing up.

Phases and angles of rising are those of Schenkman et al., Physical Therapy 70 (1990) 638: the trunk leans, the seat is
left while it leans most, legs and trunk stretch together.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.manner import Manner
from rfgen_sionna.generative.motion.balance import fit_height, over_feet
from rfgen_sionna.generative.motion.curves import ease, wander
from rfgen_sionna.generative.motion.postures import quiet, relaxed
from rfgen_sionna.generative.motion.skeleton import JOINT, MEAN_ADULT, SIDES, side_sign
from rfgen_sionna.generative.motion.tracks import ARM_POLE, MotionTracks

SEAT = (0.40, 0.48)
"""Height of seats [m]: chairs of EN 1729-1 for adults; those of children are lower as their legs are shorter."""
_FLESH = 0.1
"""Height of the pelvis joint over the seat [m]."""
_RISE = (1.2, 2.1)
"""Time to stand up or sit down [s]."""
_LEAN = np.radians([30.0, 45.0])
"""Lean of the trunk in rising [rad]."""
_AT_FIRST = 0.4
"""Least time before a first change and after the last one [s]."""


@dataclass(frozen=True)
class _Change:
    """One way between standing and sitting."""

    start: float
    """[s]"""
    length: float
    """[s]"""
    down: bool


def sit(tracks: MotionTracks, rng: np.random.Generator, hand: str, manner: Manner) -> None:
    """Sits on a chair, with small movements of trunk and head."""
    _write(tracks, rng, manner, [], seated=True)


def sit_down(tracks: MotionTracks, rng: np.random.Generator, hand: str, manner: Manner) -> None:
    """Stands, sits down on a chair behind and stays there."""
    _write(tracks, rng, manner, [_change(tracks, rng, manner, down=True)], seated=False)


def stand_up(tracks: MotionTracks, rng: np.random.Generator, hand: str, manner: Manner) -> None:
    """Sits on a chair, stands up and stays there."""
    _write(tracks, rng, manner, [_change(tracks, rng, manner, down=False)], seated=True)


def sit_and_stand(tracks: MotionTracks, rng: np.random.Generator, hand: str, manner: Manner) -> None:
    """Stands up and sits down again and again."""
    seated = bool(rng.uniform() < 0.6)
    changes: list[_Change] = []
    down = not seated
    half = 30.0 / manner.rate if manner.rate is not None else None
    clock = rng.uniform(0.7, 1.2)
    while clock < tracks.t[-1] - _AT_FIRST:
        length = rng.uniform(*_RISE) / manner.pace
        length = min(length, 0.8 * half) if half is not None else length
        if not changes:
            # a short motion holds one change, too
            length = min(length, max(tracks.t[-1] - clock - 0.7, 0.5))
        changes.append(_Change(clock, length, down))
        clock += half if half is not None else length + rng.uniform(0.6, 1.6) / manner.pace
        down = not down
    _write(tracks, rng, manner, changes, seated)


def _change(tracks: MotionTracks, rng: np.random.Generator, manner: Manner, down: bool) -> _Change:
    end = float(tracks.t[-1])
    length = min(rng.uniform(*_RISE) / manner.pace, max(end - 2.0 * _AT_FIRST, 0.6 * end))
    start = rng.uniform(0.3, 0.6) * (end - length)
    return _Change(float(np.clip(start, min(_AT_FIRST, 0.4 * (end - length)), 2.5)), length, down)


def _write(
    tracks: MotionTracks, rng: np.random.Generator, manner: Manner, changes: list[_Change], seated: bool
) -> None:
    t, sk = tracks.t, tracks.skeleton
    size = sk.leg_length() / MEAN_ADULT.leg_length()
    relaxed(tracks, rng)
    quiet(tracks, rng, rng.uniform(0.6, 1.2))
    low, back, lean = _course(t, changes, seated)
    amount = rng.uniform(*_LEAN) * np.clip(manner.size, 0.7, 1.2)
    slump = rng.uniform(-0.3, 0.1)
    tracks.pitch += 0.6 * amount * lean + low * (slump + wander(t, rng, 0.01))
    tracks.bend += (
        0.15 * manner.tired + 0.45 * amount * lean + low * (rng.uniform(0.0, 0.25) - 0.5 * slump + wander(t, rng, 0.02))
    )
    tracks.turn += low * wander(t, rng, 0.03)
    tracks.nod -= 0.5 * amount * lean - low * rng.uniform(-0.1, 0.2)
    tracks.look += low * wander(t, rng, 0.12, 0.05, 0.3)
    wide = rng.uniform(0.0, 0.1) * size
    for side in SIDES:
        tracks.feet[side].place[:, 1] += side_sign(side) * wide
    tracks.knee_out += rng.uniform(0.0, 0.3, 2) * low[:, None]
    over_feet(tracks)
    fit_height(tracks)
    # seat behind the ankles
    height = rng.uniform(*SEAT) * min(size, 1.0) + _FLESH * size
    seat = np.array([-rng.uniform(0.26, 0.36) * size, rng.uniform(-0.02, 0.02) * size, height])
    tracks.pelvis[:, :2] += back[:, None] * (seat[:2] - tracks.pelvis[:, :2])
    tracks.pelvis[:, 2] += low * (seat[2] - tracks.pelvis[:, 2])
    _rest_hands(tracks, rng, low * (1.0 - 0.3 * lean), size)


def _course(t: FloatArray, changes: list[_Change], seated: bool) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(n,) how low and how far back the pelvis is, 0 standing to 1 seated, and how far the trunk leans, 0 to 1."""
    low, lean = np.full_like(t, float(seated)), np.zeros_like(t)
    back = low.copy()
    for change in changes:
        s = (t - change.start) / change.length
        if change.down:
            low += ease((s - 0.08) / 0.85)
            back += ease((s - 0.03) / 0.8)
            lean += ease(s / 0.55) * ease((1.15 - s) / 0.5)
        else:
            low -= ease((s - 0.32) / 0.66)
            back -= ease((s - 0.22) / 0.62)
            lean += ease(s / 0.45) * ease((1.0 - s) / 0.52)
    return low, back, lean


def _rest_hands(tracks: MotionTracks, rng: np.random.Generator, weight: FloatArray, size: float) -> None:
    """Hands on the knees, on the thighs or in the lap, by `weight` (n,); or hanging beside the seat."""
    place = rng.choice(["knees", "thighs", "lap", "hanging"], p=[0.4, 0.25, 0.2, 0.15])
    if place == "hanging":
        return
    _, p = tracks.solve()
    along = {"knees": rng.uniform(0.6, 0.72), "thighs": rng.uniform(0.35, 0.55), "lap": rng.uniform(0.3, 0.45)}[place]
    for side in SIDES:
        s, arm = side_sign(side), tracks.arms[side]
        hip, knee = p[:, JOINT[f"{side}_hip"]], p[:, JOINT[f"{side}_knee"]]
        share = along + rng.uniform(-0.05, 0.05)
        goal = hip + share * (knee - hip)
        goal[:, 2] += size * rng.uniform(0.085, 0.1)
        if place == "lap":
            goal[:, 1] -= s * size * rng.uniform(0.05, 0.08)
        arm.target = goal
        arm.target_weight = weight
        outward = np.array([-0.6, rng.uniform(0.5, 1.0), -0.5])
        arm.pole = arm.pole + weight[:, None] * (outward - ARM_POLE)
        tracks.hands[side].pronation += weight * rng.uniform(0.5, 0.9)
        tracks.hands[side].flexion += weight * rng.uniform(-0.15, 0.25)
