"""Poses that are held with arms, legs, head and hands."""

from __future__ import annotations

from functools import partial

import numpy as np

from rfgen_sionna.generative.action_definitions.definition import (
    Definition,
    Requirements,
    at_least,
    at_most,
    defines,
    either_side,
)
from rfgen_sionna.generative.action_definitions.motion_signals import MotionSignals
from rfgen_sionna.generative.action_definitions.sampled_series import Flags, longest, share, swings

SIDES = {"left": 0, "right": 1}


def _straight(s: MotionSignals) -> Flags:
    """(sample, 2) whether the arm is stretched, within 55 degrees at the elbow"""
    return s.elbow_flexion < 55.0


def horizontal(s: MotionSignals) -> Flags:
    """(sample, 2) whether the arm is stretched within 20 degrees of level"""
    return _straight(s) & (np.abs(s.arm_elevation - 90.0) < 20.0)


def raised(s: MotionSignals) -> Flags:
    """(sample, 2) whether the wrist is over the shoulder and the arm 30 degrees or more above level"""
    return s.arm_elevation > 120.0


def hanging(s: MotionSignals) -> Flags:
    """(sample, 2) whether the wrist is below the elbow's usual height"""
    return s.arm_elevation < 55.0


def _sideways(s: MotionSignals) -> Flags:
    """(sample,) whether both wrists are further out than ahead"""
    out = np.abs(
        s.wrists[..., 1] - s.ahead(s.pair("shoulder") - s.pair("shoulder").mean(axis=1, keepdims=True))[..., 1]
    )
    sideways: Flags = np.all(out > np.abs(s.wrists[..., 0]), axis=1)
    return sideways


@defines("t_pose", "Both arms level to the sides nearly throughout, on the feet.")
def t_pose(s: MotionSignals) -> Requirements:
    level = (_straight(s) & (np.abs(s.arm_elevation - 90.0) < 27.0)).all(axis=1)
    held = level & _sideways(s) & (s.legs > 0.9)
    return [at_least("share of time with both arms level to the sides", share(held), 0.8)]


@defines("y_pose", "Both arms up and out at about 45 degrees nearly throughout, on the feet.")
def y_pose(s: MotionSignals) -> Requirements:
    up = (np.abs(s.arm_elevation - 138.0) < 25.0).all(axis=1) & _straight(s).all(axis=1) & _sideways(s)
    return [at_least("share of time with both arms up and out", share(up & (s.legs > 0.9)), 0.8)]


def _level_part(side: int, s: MotionSignals) -> Requirements:
    one, other = horizontal(s)[:, side], hanging(s)[:, 1 - side]
    return [
        at_least("longest time with the arm level and the other one hanging [s]", longest(one & other), 0.8),
        at_most("share of time with the arm more than 30 degrees above level", share(raised(s)[:, side]), 0.05),
    ]


def arm_raised(side: int, s: MotionSignals) -> Requirements:
    one, other = raised(s)[:, side], s.hands_over_shoulders[:, 1 - side] < -0.1
    return [
        at_least("longest time with the wrist over the shoulder and the other one low [s]", longest(one & other), 0.8),
        at_least("height of the wrist over the shoulder [m]", s.hands_over_shoulders[:, side].max(), 0.2),
        at_most("share of time with the other arm raised", share(raised(s)[:, 1 - side]), 0.05),
        at_least("share of time on the feet", share(s.legs > 0.85), 0.9),
    ]


@defines("both_arms_raised", "Both arms 30 degrees or more above level for 0.15 s or more, trunk up.")
def both_arms_raised(s: MotionSignals) -> Requirements:
    up = raised(s).all(axis=1) & (s.inclination < 45.0)
    return [at_least("longest time with both arms raised, trunk up [s]", longest(up), 0.15)]


def leg_raised(side: int, s: MotionSignals) -> Requirements:
    lifted = (s.feet[:, side] > 0.1) & (s.feet[:, 1 - side] < 0.06) & (s.ankle_speed[:, side] < 1.5)
    return [
        at_least("longest time with the foot off the floor and the other one down [s]", longest(lifted), 0.8),
        at_least("highest thigh [degrees]", s.thigh_elevation[:, side].max(), 30.0),
    ]


def hand_at_head(s: MotionSignals, distance: float = 0.33) -> Flags:
    """(sample, 2) whether the wrist is within `distance` [m] of the head joint, and not over the head"""
    return (s.hand_to_head < distance) & (s.pair("wrist")[..., 2] < s.head_height[:, None] + 0.25)


def _calm_hand_at_head(s: MotionSignals) -> Flags:
    """(sample, 2) whether a slow hand is at the head, trunk up, the other hand lower than the shoulders"""
    other = s.hands_over_shoulders[:, ::-1] < -0.08
    still = np.all((s.ankle_speed < 4.0) & (s.thigh_elevation < 110.0), axis=1) & (s.inclination < 45.0)
    calm = (s.wrist_speed < 0.9) & still[:, None]
    return hand_at_head(s) & other & calm


@defines(
    "drink",
    "A calm hand before the face for 0.4 s or more, the other one low, trunk up.",
    "what the hand holds: eating, smoking or phoning with the hand before the face look alike",
)
def _drinks(s: MotionSignals) -> Requirements:
    ahead = s.ahead(s.pair("wrist") - s.joint("head")[:, None])[..., 0] > 0.0
    near = _calm_hand_at_head(s) & ahead
    held = max(longest(near[:, k]) for k in range(2))
    return [at_least("longest time with a calm hand before the face, the other one low [s]", held, 0.4)]


@defines(
    "phone",
    "A calm hand held at the head for 2 s or more, the other one low, trunk up.",
    "what the hand holds: drinking, shading the eyes or leaning the head on a hand look alike",
)
def phone(s: MotionSignals) -> Requirements:
    near = _calm_hand_at_head(s)
    held = max(longest(near[:, k]) for k in range(2))
    return [at_least("longest time with a calm hand at the head, the other one low [s]", held, 2.0)]


@defines("point", "One arm stretched and still for 0.3 s or more, the other one low.", "which finger is stretched")
def point(s: MotionSignals) -> Requirements:
    out = (s.elbow_flexion < 45.0) & (s.arm_elevation > 50.0) & (s.arm_elevation < 140.0) & (s.wrist_speed < 0.8)
    other = s.arm_elevation[:, ::-1] < 60.0
    return [
        at_least(
            "longest time with one arm stretched and still [s]",
            max(longest((out & other)[:, k]) for k in range(2)),
            0.3,
        )
    ]


@defines(
    "reach",
    "A hand goes out to 0.82 of the arm or more, at waist height or above, on the feet.",
    "whether something is grasped",
)
def reach(s: MotionSignals) -> Requirements:
    def of(side: int) -> Requirements:
        calm = (s.speed < 0.9) & (s.feet.max(axis=1) < 0.25) & (s.inclination < 60.0)
        away = s.reach[:, side] * (s.arm_elevation[:, side] > 55.0) * calm
        at = int(np.argmax(away))
        return [
            at_least("reach of the hand from a calm stand, share of the arm", away[at], 0.82),
            at_least("share of time on the feet", share(s.legs > 0.75), 0.9),
            at_most("speed of the hand then [m/s]", s.wrist_speed[at, side], 1.2),
            at_least("movement of the hand [m]", float(np.ptp(s.wrists[:, side], axis=0).max()), 0.25),
            at_most("other hand over its shoulder then [m]", s.hands_over_shoulders[at, 1 - side], 0.05),
            at_most("highest thigh then [degrees]", s.thigh_elevation[at].max(), 50.0),
        ]

    return either_side(of)


@defines(
    "type",
    "Both hands held before the body, elbows bent, in one place.",
    "whether there are keys: holding something before the body looks alike",
)
def type_on_keys(s: MotionSignals) -> Requirements:
    hands = s.wrists
    held = (hands[..., 0] > 0.12).all(axis=1) & (s.hands_apart < 0.5) & (s.elbow_flexion > 40.0).all(axis=1)
    held &= (hands[..., 2] < 0.0).all(axis=1)
    return [
        at_least("share of time with both hands before the body, elbows bent", share(held), 0.8),
        at_most("spread of the wrists about their mean place [m]", hands.std(axis=0).max(), 0.08),
        at_most("distance of the pelvis from its median place [m]", s.roam, 0.2),
    ]


def _head(axis: int, s: MotionSignals, size: float, times: int, words: str) -> Requirements:
    turns = s.head_turns
    return [
        at_least(f"{words} by {size:g} degrees", swings(turns[:, axis], size), times),
        at_least("that axis over the other one", np.ptp(turns[:, axis]) / max(np.ptp(turns[:, 1 - axis]), 1e-9), 1.0),
        at_most("distance of the pelvis from its median place [m]", s.roam, 0.25),
        at_most("change of the trunk's inclination [degrees]", np.ptp(s.inclination), 15.0),
        at_most("change of the pelvis' height [m]", np.ptp(s.pelvis_height), 0.1),
        at_most("90th percentile of the wrists' speed [m/s]", np.percentile(s.wrist_speed, 90), 1.0),
    ]


@defines("nod", "The head goes up and down on the chest by 8 degrees or more, twice or more.")
def nod(s: MotionSignals) -> Requirements:
    return _head(1, s, 8.0, 2, "moves of the head up and down")


@defines("shake_head", "The head turns from side to side on the chest by 15 degrees or more, three times or more.")
def shake_head(s: MotionSignals) -> Requirements:
    return _head(0, s, 15.0, 3, "turns of the head from side to side")


@defines("look_around", "The gaze turns from side to side by 40 degrees or more, in about one place.")
def look_around(s: MotionSignals) -> Requirements:
    gaze = np.degrees(s.chest_heading) - np.degrees(s.chest_heading[0]) + s.head_turns[:, 0]
    return [
        at_least("turns of the gaze from side to side by 40 degrees", swings(gaze, 40.0), 2),
        at_most("distance of the pelvis from its median place [m]", s.roam, 0.75),
        at_most("change of the pelvis' height [m]", np.ptp(s.pelvis_height), 0.2),
        at_most("90th percentile of the trunk's inclination [degrees]", np.percentile(s.inclination, 90), 30.0),
    ]


@defines("stretch", "Both arms stretched up or out for 0.4 s or more, in one place.")
def stretches_arms(s: MotionSignals) -> Requirements:
    up = (s.hands_over_shoulders > 0.25).all(axis=1) & _straight(s).all(axis=1)
    wide = horizontal(s).all(axis=1) & _sideways(s)
    return [
        at_least("longest time with both arms stretched up or out [s]", longest(up | wide), 0.4),
        at_most("median speed over the floor [m/s]", np.median(s.speed), 0.3),
    ]


DEFINITIONS: tuple[Definition, ...] = (
    t_pose,
    y_pose,
    *(
        Definition(
            f"{side}_arm_raised",
            f"The {side} wrist held over the shoulder for 0.8 s or more, the other arm low.",
            partial(arm_raised, k),
        )
        for side, k in SIDES.items()
    ),
    *(
        Definition(
            f"{side}_arm_horizontal",
            f"The {side} arm held within 20 degrees of level for 0.8 s or more, the other one hanging.",
            partial(_level_part, k),
        )
        for side, k in SIDES.items()
    ),
    both_arms_raised,
    *(
        Definition(
            f"{side}_leg_raised",
            f"The {side} foot held off the floor for 0.8 s or more, the other one down.",
            partial(leg_raised, k),
        )
        for side, k in SIDES.items()
    ),
    _drinks,
    phone,
    point,
    reach,
    type_on_keys,
    nod,
    shake_head,
    look_around,
    stretches_arms,
)
"""Actions of this module."""
