"""Kicks, exercises, dance."""

from __future__ import annotations

from functools import partial

import numpy as np

from rfgen_sionna.generative.action_definitions.definition import Definition, Requirements, at_least, at_most, defines
from rfgen_sionna.generative.action_definitions.motion_signals import STANDING, MotionSignals
from rfgen_sionna.generative.action_definitions.sampled_series import longest, share, stretches, swings


def _kicks(s: MotionSignals, side: int) -> tuple[float, float]:
    """Fastest ankle of a foot over 0.25 m while the other one is down or near [m/s], and its height then [m]."""
    free = (s.feet[:, side] > 0.2) & (s.feet[:, 1 - side] < 0.2)
    windows = [slice(max(a - 3, 0), b + 1) for a, b in stretches(free)]
    best = max(windows, key=lambda w: s.ankle_speed[w, side].max(), default=None)
    if best is None:
        return 0.0, float(s.feet[:, side].max())
    return float(s.ankle_speed[best, side].max()), float(s.feet[best, side].max())


def _kick(sides: tuple[int, ...], s: MotionSignals) -> Requirements:
    speed, height = max(_kicks(s, side) for side in sides)
    return [
        at_least("fastest ankle of a raised foot [m/s]", speed, 3.65),
        at_least("height of that foot [m]", height, 0.4),
        at_most("90th percentile of the speed over the floor [m/s]", np.percentile(s.speed, 90), 3.0),
    ]


@defines("push_up", "Hands at the floor, face down, hips nearly straight; chest up and down with the elbows.")
def pushup(s: MotionSignals) -> Requirements:
    down = (s.hand_height < 0.25).all(axis=1) & (s.front < -0.3)
    chest = s.joint("neck")[:, 2]
    return [
        at_least("share of time with both hands at the floor, face down", share(down), 0.8),
        at_least("moves of the chest up and down by 0.1 m", swings(chest, 0.1), 2),
        at_most("median bend of the hips [degrees]", np.median(s.hip_flexion.min(axis=1)), 50.0),
        at_least("moves of the elbows by 20 degrees", swings(s.elbow_flexion.mean(axis=1), 20.0), 2),
    ]


@defines("sit_up", "Pelvis at the floor, face up; the trunk comes up and goes down.")
def situp(s: MotionSignals) -> Requirements:
    return [
        at_most("highest pelvis [m]", np.percentile(s.pelvis_height, 95), 0.4),
        at_least("moves of the trunk by 25 degrees", swings(s.inclination, 25.0), 2),
        at_least("face up: median", np.median(s.front), 0.0),
    ]


@defines("lunge", "One foot 0.5 m or more ahead of the other, that knee bent, pelvis lowered.")
def lunge(s: MotionSignals) -> Requirements:
    wide = np.linalg.norm(s.pair("ankle")[:, 0, :2] - s.pair("ankle")[:, 1, :2], axis=1)
    deep = (
        (wide > 0.6)
        & (s.knee_flexion.max(axis=1) > 60.0)
        & (s.legs < 0.86)
        & (s.pelvis_height > 0.3)
        & (s.feet_apart[:, 0] > 0.5)
    )
    return [
        at_least("longest time with one foot far ahead and that knee bent [s]", longest(deep), 0.3),
        at_most("median speed over the floor [m/s]", np.median(s.speed), 0.8),
    ]


@defines("knee_to_elbow", "A knee comes up to the opposite elbow.")
def knee_to_elbow(s: MotionSignals) -> Requirements:
    near = np.linalg.norm(s.pair("knee") - s.pair("elbow")[:, ::-1], axis=-1)
    return [
        at_most("least distance of a knee from the opposite elbow [m]", near.min(), 0.35),
        at_least("highest thigh [degrees]", s.thigh_elevation.max(), 65.0),
        at_least("share of time on the feet", share(s.legs > 0.8), 0.9),
        at_most("highest foot on the floor's side [m]", s.feet.min(axis=1).max(), 0.25),
    ]


@defines("twist", "The shoulders turn from side to side over feet that stay.")
def side_twist(s: MotionSignals) -> Requirements:
    twist = np.degrees(s.chest_heading - s.heading)
    return [
        at_least("turns of the shoulders against the hips by 30 degrees", swings(twist, 30.0), 2),
        at_least("share of time on both feet", share(np.all(s.feet < 0.08, axis=1)), 0.9),
        at_most("distance of the pelvis from its median place [m]", s.roam, 0.25),
    ]


@defines("toe_touch", "A hand comes down to a foot over a nearly straight leg.")
def toe_touch(s: MotionSignals) -> Requirements:
    near = np.linalg.norm(s.pair("wrist")[:, :, None] - s.pair("foot")[:, None], axis=-1).min(axis=(1, 2))
    at = int(np.argmin(near))
    return [
        at_most("least distance of a hand from a foot [m]", near[at], 0.4),
        at_most("knee flexion of the straighter leg then [degrees]", s.knee_flexion[at].min(), 50.0),
        at_least("inclination of the trunk then [degrees]", s.inclination[at], 50.0),
        at_least("highest pelvis [m]", s.pelvis_height.max(), 0.7 * STANDING),
    ]


@defines(
    "dance",
    "Both hands, hips and feet keep moving, together 4.5 moves a second or more, about one place.",
    "music and style: other lively movement of arms and legs looks alike",
)
def dance(s: MotionSignals) -> Requirements:
    hands = sorted(max(swings(s.wrists[:, k, axis], 0.1) for axis in range(3)) for k in range(2))
    sway = s.ahead(s.pair("ankle").mean(axis=1) - s.joint("pelvis"))[:, 1]
    body = len(s.steps) + swings(s.pelvis_height, 0.03) + swings(sway, 0.06)
    turns = swings(np.degrees(s.heading), 15.0) + swings(np.degrees(s.chest_heading - s.heading), 12.0)
    return [
        at_least("length [s]", s.duration, 2.0),
        at_least("moves of the busier hand a second", hands[1] / s.duration, 1.0),
        at_least("steps, bounces, sways and turns a second", (body + turns) / s.duration, 2.0),
        at_least("all moves a second", (body + turns + sum(hands)) / s.duration, 4.5),
        at_least("mean speed of hands, feet, head and pelvis [m/s]", s.activity.mean(), 0.36),
        at_most(
            "distance of the ends over the length of the way", np.hypot(*s.displacement[:2]) / max(s.path, 0.3), 0.93
        ),
        at_most("mean speed over the floor [m/s]", s.path / s.duration, 1.3),
        at_most("share of time with the trunk inclined by 40 degrees", share(s.inclination > 40.0), 0.17),
    ]


DEFINITIONS: tuple[Definition, ...] = (
    Definition(
        "kick",
        "A foot up to 0.4 m or more goes at 3.65 m/s or more against the pelvis while the other one carries.",
        partial(_kick, (0, 1)),
    ),
    Definition("left_kick", "A kick with the left foot.", partial(_kick, (0,))),
    Definition("right_kick", "A kick with the right foot.", partial(_kick, (1,))),
    pushup,
    situp,
    lunge,
    knee_to_elbow,
    side_twist,
    toe_touch,
    dance,
)
"""Actions of this module."""
