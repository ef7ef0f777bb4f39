"""Limping and marching."""

from __future__ import annotations

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.manner import Manner
from rfgen_sionna.generative.motion.balance import ride_height
from rfgen_sionna.generative.motion.curves import bump, wander
from rfgen_sionna.generative.motion.postures import quiet, relaxed
from rfgen_sionna.generative.motion.skeleton import JOINT, SIDES, side_sign
from rfgen_sionna.generative.motion.tracks import MotionTracks
from rfgen_sionna.generative.motion.walk import LegCycle, gait, own_pace, straight

_LIMPING = (0.5, 0.85)
"""Speed of people who limp [m/s]."""
_QUICK = 1.55
"""Least cadence of a limp [steps/s]: short steps, for a sore leg carries for a short time."""
_MARCHING = (0.7, 1.1)
"""Speed of people who march [m/s]."""
_CADENCE = (1.45, 2.0)
"""Steps in place [1/s]."""
_STOOP = 0.15
"""Bend of the trunk of who is tired [rad]."""
_LOW, _HIGH = np.radians(56.0), np.radians(95.0)
"""Least and greatest lift of a marching thigh from hanging [rad]."""


def limp(tracks: MotionTracks, rng: np.random.Generator, hand: str, manner: Manner) -> None:
    """Straight ahead, one leg sore: it carries for a short time with little push, swings long and stiff, and the trunk
    leans over it (antalgic gait: Perry and Burnfield, Gait Analysis, 2nd ed. 2010, ch. 14)."""
    sore, sound = SIDES if rng.uniform() < 0.5 else SIDES[::-1]
    pace, step = own_pace(tracks, rng, manner, _LIMPING)
    step = step if manner.rate is not None else min(step, pace / _QUICK)
    severe = rng.uniform(0.8, 1.35) * np.clip(manner.size, 0.95, 1.2)
    short, long = 0.62 - 0.085 * severe, 0.62 + 0.065 * severe
    legs = {
        sore: LegCycle(0.0, short, 0.42 * short, rng.uniform(0.45, 0.7)),
        sound: LegCycle(short - rng.uniform(0.09, 0.12), long, 0.42 * long),
    }
    phase = gait(tracks, rng, straight(float(tracks.t[-1]), pace), pace, step, legs)
    share = (phase[sore] / (2.0 * np.pi)) % 1.0
    carried = bump(share / short)
    towards = -side_sign(sore)  # leaning to the right is positive
    lean = rng.uniform(0.06, 0.16) * severe
    tracks.lean += towards * lean * carried
    tracks.pelvis[:, 1] -= towards * rng.uniform(0.01, 0.03) * carried
    tracks.pitch += rng.uniform(0.0, 0.08)
    tracks.bend += rng.uniform(0.0, 0.12) + _STOOP * manner.tired
    tracks.nod += rng.uniform(0.0, 0.2)
    # the stiff leg swings around
    foot, swing = tracks.feet[sore], bump((share - short) / (1.0 - short))
    foot.place[:, 1] += side_sign(sore) * rng.uniform(0.02, 0.06) * severe * swing
    tracks.roll += towards * rng.uniform(0.02, 0.05) * swing * -1.0
    ride_height(tracks)


def march(tracks: MotionTracks, rng: np.random.Generator, hand: str, manner: Manner) -> None:
    """Straight ahead with high knees and swinging arms."""
    pace, step = own_pace(tracks, rng, manner, _MARCHING)
    phase = gait(tracks, rng, straight(float(tracks.t[-1]), pace), pace, step)
    _high_knees(tracks, rng, manner, phase, 0.62, ahead=0.4)
    ride_height(tracks)


def march_in_place(tracks: MotionTracks, rng: np.random.Generator, hand: str, manner: Manner) -> None:
    """High knees in turn on the spot, the arms swinging against them."""
    t = tracks.t
    relaxed(tracks, rng)
    quiet(tracks, rng, 0.7)
    cadence = manner.rate / 60.0 if manner.rate is not None else rng.uniform(*_CADENCE) * manner.pace
    begin, uneven = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(-0.06, 0.06)
    # steps are not all of the same length
    cycle = np.pi * cadence * t + begin + 0.25 * wander(t, rng, 1.0, 0.05, 0.4) * rng.uniform(0.2, 1.0)
    phase = {"left": cycle, "right": cycle + np.pi * (1.0 + uneven)}
    stance = float(np.clip(0.5 + 0.08 / cadence**0.5 + rng.uniform(-0.02, 0.03), 0.52, 0.62))
    middle = phase["left"] - np.pi * stance
    hip = abs(tracks.skeleton.offsets[JOINT["left_hip"], 1])
    tracks.pelvis[:, 1] += rng.uniform(0.25, 0.5) * hip * np.cos(middle)
    tracks.pelvis[:, 0] -= 0.02 - rng.uniform(0.0, 0.02)
    tracks.roll += np.radians(rng.uniform(1.0, 3.0)) * np.cos(middle)
    tracks.lean -= 0.8 * tracks.roll
    turn = np.radians(rng.uniform(3.0, 9.0)) * np.cos(middle - np.pi)
    tracks.turn += turn
    tracks.look -= turn
    _high_knees(tracks, rng, manner, phase, stance)
    ride_height(tracks)


def _high_knees(
    tracks: MotionTracks,
    rng: np.random.Generator,
    manner: Manner,
    phase: dict[str, FloatArray],
    stance: float,
    ahead: float = 1.0,
) -> None:
    """Lift the knees in the swings of `phase` (by side, (n,) [rad]), and swing the arms against them."""
    sk, t = tracks.skeleton, tracks.t
    height = np.clip(np.radians(rng.uniform(60.0, 88.0)) * manner.size, _LOW, _HIGH)
    tracks.bend += _STOOP * manner.tired
    tilt, drop = rng.uniform(-0.15, 0.25), rng.uniform(0.1, 0.6)
    swing_arm, bent = rng.uniform(0.35, 0.9) * np.clip(manner.size, 0.5, 1.3), rng.uniform(0.15, 1.4)
    wide = rng.uniform(0.08, 0.2)
    for i, (side, other) in enumerate(zip(SIDES, SIDES[::-1], strict=True)):
        foot = tracks.feet[side]
        cycle = phase[side] / (2.0 * np.pi)
        share, count = cycle % 1.0, np.floor(cycle).astype(int)
        each = np.clip(height * rng.normal(1.0, 0.05, count.max() - count.min() + 1), _LOW, _HIGH)
        size = each[count - count.min()] * rng.uniform(0.96, 1.04)
        up = np.sqrt(bump((share - stance) / (1.0 - stance)))
        hip = np.clip(size, _LOW, _HIGH) * up * (0.4 + 0.6 * up)
        shank = tilt * up
        thigh, below = sk.length(f"{side}_knee"), sk.length(f"{side}_ankle")
        forward = ahead * (thigh * np.sin(hip) + below * np.sin(shank))
        heading = tracks.yaw
        foot.place[:, 0] += forward * np.cos(heading)
        foot.place[:, 1] += forward * np.sin(heading)
        foot.lift += thigh * (1.0 - np.cos(hip)) + below * (1.0 - np.cos(shank))
        foot.pitch -= drop * up
        foot.loose = np.maximum(foot.loose, up)
        tracks.contacts[:, i] = share <= stance
        arm = tracks.arms[side]
        swung = swing_arm * np.cos(phase[other] - 2.0 * np.pi * (0.5 * stance + 0.5) - rng.uniform(-0.2, 0.2)) + 0.1
        outward = np.full_like(t, wide * rng.uniform(0.8, 1.2))
        arm.direction = np.stack([np.sin(swung), outward, -np.cos(swung)], axis=-1)
        arm.elbow = bent * rng.uniform(0.9, 1.1) + 0.15 * (1.0 + np.sin(swung))
