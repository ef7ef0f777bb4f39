"""Standing, sitting, lying, and the ways between them."""

from __future__ import annotations

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.action_definitions.definition import Definition, Requirements, at_least, at_most, defines
from rfgen_sionna.generative.action_definitions.motion_signals import STANDING, MotionSignals
from rfgen_sionna.generative.action_definitions.sampled_series import (
    Flags,
    longest,
    rate_of,
    share,
    smooth,
    swings,
)

FIRST, LAST = slice(0, 6), slice(-6, None)
"""The first and the last 0.3 s."""


def upright(s: MotionSignals) -> Flags:
    """(sample,) whether the person stands or walks, trunk within 45 degrees of the vertical"""
    return (s.pelvis_height > 0.86 * STANDING) & (s.inclination < 45.0)


def lying(s: MotionSignals) -> Flags:
    """(sample,) whether pelvis and head rest near the floor, the trunk within 35 degrees of level"""
    return (s.pelvis_height < 0.35) & (s.head_height < 0.45) & (s.inclination > 55.0)


def seated(s: MotionSignals) -> Flags:
    """(sample,) whether the person sits on a stool or chair: trunk up, thighs raised, the centre of mass too far behind
    the feet for these to carry it, or the feet off the floor"""
    behind = -s.ahead(s.mass[:, None] - s.pair("ankle"))[..., 0].max(axis=1)
    low = (behind > 0.07) & (s.pelvis_height < 0.92 * STANDING)
    thighs = s.thigh_elevation.mean(axis=1)
    hanging = (s.feet.min(axis=1) > 0.06) & (s.speed < 0.3) & ~s.airborne & (thighs > 55.0)
    return (s.pelvis_height > 0.32) & (s.inclination < 50.0) & (thighs > 35.0) & (low | hanging)


def on_the_floor(s: MotionSignals) -> Flags:
    """(sample,) whether the person sits on the floor, trunk up"""
    return (s.pelvis_height < 0.32) & (s.inclination < 55.0)


def low(s: MotionSignals) -> Flags:
    """(sample,) whether the person is crouched: on the feet, pelvis over them and lower than 0.7 of standing"""
    middle = s.pair("ankle").mean(axis=1)
    off = np.linalg.norm((s.joint("pelvis") - middle)[:, :2], axis=1)
    return (s.legs < 0.72) & (off < 0.45) & (s.pair("knee")[..., 2].max(axis=1) > 0.2) & (s.inclination < 100.0)


def _height_at(s: MotionSignals, moment: slice) -> float:
    return float(s.pelvis_height[moment].mean())


@defines("standing", "Upright on both feet in one place, trunk up, hands low and slow.")
def standing(s: MotionSignals) -> Requirements:
    return [
        at_least("share of time upright on both feet", share(upright(s) & (s.feet < 0.08).all(axis=1)), 0.7),
        at_most("distance of the pelvis from its median place [m]", s.roam, 0.45),
        at_least(
            "share of time with both wrists below the shoulders",
            share(np.all(s.hands_over_shoulders < 0.05, axis=1)),
            0.8,
        ),
        at_most("90th percentile of the wrists' speed [m/s]", np.percentile(s.wrist_speed, 90), 0.9),
        at_most("90th percentile of the trunk's inclination [degrees]", np.percentile(s.inclination, 90), 30.0),
    ]


@defines("sit", "On a seat (thighs raised, the centre of mass behind the feet) or on the floor, trunk up, throughout.")
def sit(s: MotionSignals) -> Requirements:
    return [at_least("share of time seated, on a seat or the floor", share(seated(s) | on_the_floor(s)), 0.9)]


def _sits_down(s: MotionSignals, goal: Flags) -> Requirements:
    return [
        at_least("height of the pelvis at first, share of standing", s.pelvis_height[:10].max() / STANDING, 0.85),
        at_least("share of the last 0.3 s seated", share(goal[LAST]), 0.8),
        at_most("share of the first 0.3 s seated", share(goal[FIRST]), 0.2),
    ]


@defines("sit_down", "Upright at first; seated on a seat or the floor at the end.")
def sit_down(s: MotionSignals) -> Requirements:
    return _sits_down(s, seated(s) | on_the_floor(s))


@defines("stand_up", "Seated at first; upright on the feet at the end.")
def stand_up(s: MotionSignals) -> Requirements:
    goal = seated(s) | on_the_floor(s)
    return [
        at_least("share of the first 0.3 s seated", share(goal[FIRST]), 0.8),
        at_least("height of the pelvis at the end, share of standing", _height_at(s, LAST) / STANDING, 0.86),
        at_most("inclination of the trunk at the end [degrees]", s.inclination[LAST].mean(), 40.0),
    ]


@defines("sit_and_stand", "Seated for a time and upright for a time.")
def sit_and_stand(s: MotionSignals) -> Requirements:
    return [
        at_least("longest time seated [s]", longest(seated(s) | on_the_floor(s)), 0.3),
        at_least("longest time upright [s]", longest(upright(s)), 0.5),
    ]


@defines("lie", "Pelvis under 0.35 m and head under 0.45 m, trunk level, calm, throughout.")
def lie(s: MotionSignals) -> Requirements:
    return [
        at_least("share of time with pelvis and head at the floor", share(lying(s)), 0.9),
        at_most("mean speed of hands, feet, head and pelvis [m/s]", s.activity.mean(), 0.12),
    ]


def fastest_descent(s: MotionSignals) -> tuple[int, float]:
    """Sample of the fastest descent of the head over 0.2 s, and its speed [m/s]."""
    speed = -smooth(rate_of(s.head_height), 0.2)
    fastest = int(np.argmax(speed))
    return fastest, float(speed[fastest])


@defines("lie_down", "Pelvis raised at first, pelvis and head at the floor at the end, without a fall between.")
def lie_down(s: MotionSignals) -> Requirements:
    down = lying(s)
    return [
        at_least("highest pelvis in the first half [m]", s.pelvis_height[: len(s.time) // 2 + 1].max(), 0.42),
        at_least("longest time with pelvis and head at the floor in the last second [s]", longest(down[-20:]), 0.25),
        at_most("share of the first 0.3 s with pelvis and head at the floor", share(down[FIRST]), 0.2),
        at_most("fastest descent of the head over 0.2 s [m/s]", fastest_descent(s)[1], 2.5),
    ]


@defines("fall", "On the feet at first; the head drops at 2.5 m/s or more; pelvis and head under 0.35 m at the end.")
def fall(s: MotionSignals) -> Requirements:
    when, speed = fastest_descent(s)
    before = slice(0, when + 1)
    return [
        at_least(
            "highest pelvis before the descent, share of standing", s.pelvis_height[before].max() / STANDING, 0.75
        ),
        at_least("fastest descent of the head over 0.2 s [m/s]", speed, 2.5),
        at_most("height of the pelvis at the end [m]", _height_at(s, LAST), 0.35),
        at_most("height of the head at the end [m]", s.head_height[LAST].mean(), 0.35),
    ]


def _toward(s: MotionSignals) -> FloatArray:
    """(2,) level direction from pelvis to head as the body lands, ahead and to the left of where it faced before."""
    when, _ = fastest_descent(s)
    before = max(when - 10, 0)
    landed = int(np.argmin(s.head_height[when : when + 20])) + when
    trunk = (s.joint("neck") - s.joint("pelvis"))[landed]
    c, n = np.cos(s.heading[before]), np.sin(s.heading[before])
    return np.array([c * trunk[0] + n * trunk[1], c * trunk[1] - n * trunk[0]])


@defines("fall_forward", "A fall that lands with the head ahead of the pelvis.")
def fall_forward(s: MotionSignals) -> Requirements:
    ahead, left = _toward(s)
    angle = float(np.degrees(np.arctan2(abs(left), ahead)))
    return [*fall(s), at_most("angle of the fall from straight ahead [degrees]", angle, 50.0)]


@defines("fall_backward", "A fall that lands with the head behind the pelvis.")
def fall_backward(s: MotionSignals) -> Requirements:
    ahead, left = _toward(s)
    angle = float(np.degrees(np.arctan2(abs(left), -ahead)))
    return [*fall(s), at_most("angle of the fall from straight back [degrees]", angle, 50.0)]


@defines("fall_sideways", "A fall that lands with the head to a side of the pelvis.")
def fall_sideways(s: MotionSignals) -> Requirements:
    ahead, left = _toward(s)
    angle = float(np.degrees(np.arctan2(abs(ahead), abs(left))))
    return [*fall(s), at_most("angle of the fall from straight sideways [degrees]", angle, 50.0)]


@defines(
    "fall_from_chair", "On a seat at first; the head drops at 1.7 m/s or more; pelvis and head under 0.35 m at the end."
)
def fall_from_chair(s: MotionSignals) -> Requirements:
    return [
        at_least("share of the first 0.3 s on a seat", share(seated(s)[FIRST]), 0.8),
        at_least("fastest descent of the head over 0.2 s [m/s]", fastest_descent(s)[1], 1.7),
        at_most("height of the pelvis at the end [m]", _height_at(s, LAST), 0.35),
        at_most("height of the head at the end [m]", s.head_height[LAST].mean(), 0.35),
    ]


@defines("get_up", "Pelvis at the floor and head low at first; upright on the feet at the end.")
def get_up(s: MotionSignals) -> Requirements:
    return [
        at_most("height of the pelvis at first [m]", s.pelvis_height[:10].min(), 0.4),
        at_most("height of the head at first [m]", s.head_height[:10].min(), 0.75),
        at_least("height of the pelvis at the end, share of standing", _height_at(s, LAST) / STANDING, 0.82),
        at_least("height of the head at the end [m]", s.head_height[LAST].mean(), 1.1),
        at_most("inclination of the trunk at the end [degrees]", s.inclination[LAST].mean(), 60.0),
    ]


@defines("crouch", "On the feet with the pelvis over them under 0.72 of standing, for 0.4 s or more.")
def crouch(s: MotionSignals) -> Requirements:
    return [
        at_least("longest time on the feet with a pelvis under 0.72 of standing [s]", longest(low(s)), 0.4),
        at_least(
            "least height of the knees meanwhile [m]", s.pair("knee")[..., 2].max(axis=1)[low(s)].min(initial=9.0), 0.2
        ),
    ]


@defines(
    "squat", "From standing down to a pelvis under 0.72 of standing on bent knees, trunk up, and back, in one place."
)
def squat(s: MotionSignals) -> Requirements:
    down = int(np.argmin(s.legs))
    return [
        at_most("lowest pelvis over the feet, share of standing", s.legs.min(), 0.72),
        at_least("pelvis before, share of standing", s.legs[: down + 1].max(), 0.88),
        at_least("pelvis afterwards, share of standing", s.legs[down:].max(), 0.88),
        at_least("both knees bent then [degrees]", s.knee_flexion[down].min(), 60.0),
        at_most("height of a foot then [m]", s.feet[down].max(), 0.16),
        at_most("inclination of the trunk then [degrees]", s.inclination[down], 62.0),
        at_most("distance between the ankles ahead then [m]", s.feet_apart[down, 0], 0.35),
        at_most("distance of the pelvis from its median place [m]", s.roam, 0.5),
        at_most("longest time off the floor [s]", longest(s.airborne), 0.3),
    ]


@defines("kneel", "On a knee most of the time and at the end, trunk up, pelvis over the floor.")
def kneel(s: MotionSignals) -> Requirements:
    down = (s.pair("knee")[..., 2].min(axis=1) < 0.14) & (s.pelvis_height > 0.25) & (s.pelvis_height < 0.65)
    on_a_knee = down & (s.inclination < 85.0)
    return [
        at_least("longest time on a knee, trunk up [s]", longest(on_a_knee), 0.7),
        at_least("share of time on a knee, trunk up", share(on_a_knee), 0.6),
        at_least("share of the last 0.3 s on a knee, trunk up", share(on_a_knee[LAST]), 0.8),
    ]


@defines("bend", "From upright the trunk goes down by 40 degrees or more, on the feet, in about one place.")
def trunk_flexion(s: MotionSignals) -> Requirements:
    bent = (s.inclination > 40.0) & (s.legs > 0.45) & (s.feet.max(axis=1) < 0.2)
    return [
        at_least("longest time bent by 40 degrees or more on the feet [s]", longest(bent), 0.3),
        at_least("highest pelvis, share of standing", s.legs.max(), 0.85),
        at_most("inclination of the trunk at the straightest [degrees]", s.inclination.min(), 25.0),
        at_most("median speed over the floor then [m/s]", np.median(s.speed[bent]) if bent.any() else 0.0, 0.5),
    ]


@defines("bow", "Trunk inclined by 22 degrees or more on nearly straight legs and back up, hands not at the floor.")
def bows_down(s: MotionSignals) -> Requirements:
    still = smooth(s.speed, 0.8) < 0.35
    deepest = int(np.argmax(np.where(still & (s.feet.max(axis=1) < 0.1), s.inclination, 0.0)))
    return [
        at_least(
            "inclination of the trunk where the person stays [degrees]", s.inclination[deepest] * still[deepest], 22.0
        ),
        at_least("pelvis over the feet then, share of standing", s.legs[deepest], 0.84),
        at_most("inclination at the straightest before [degrees]", s.inclination[: deepest + 1].min(), 20.0),
        at_most("inclination at the straightest afterwards [degrees]", s.inclination[deepest:].min(), 25.0),
        at_least("height of the wrists then [m]", s.hand_height[deepest].min(), 0.3),
        at_most("higher foot then [m]", s.feet[deepest].max(), 0.1),
        at_most("speed of the wrists against the shoulders then [m/s]", s.wrist_speed[deepest].max(), 1.2),
    ]


def _hand_down(s: MotionSignals) -> Requirements:
    hand = s.hand_height.min(axis=1)
    lowest = int(np.argmin(hand))
    return [
        at_most("lowest wrist [m]", hand[lowest], 0.45),
        at_most("higher foot then [m]", s.feet[lowest].max(), 0.25),
        at_least("height of the pelvis then [m]", s.pelvis_height[lowest], 0.2),
        at_least("change of the trunk's inclination [degrees]", np.ptp(s.inclination), 15.0),
        at_least("highest pelvis, share of standing", s.legs.max(), 0.85),
    ]


@defines(
    "pick_up",
    "A hand goes down to 0.45 m or less from the feet and comes up again.",
    "whether the hand holds something: picking up and putting down look alike",
)
def pick_up(s: MotionSignals) -> Requirements:
    hand = s.hand_height.min(axis=1)
    later = np.maximum.accumulate(hand[::-1])[::-1] - hand
    return [*_hand_down(s), at_least("rise of the hand from there [m]", later[hand < 0.45].max(initial=0.0), 0.3)]


@defines(
    "put_down",
    "A hand comes down to 0.45 m or less from the feet.",
    "whether the hand holds something: picking up and putting down look alike",
)
def put_down(s: MotionSignals) -> Requirements:
    hand = s.hand_height.min(axis=1)
    before = np.maximum.accumulate(hand) - hand
    return [*_hand_down(s), at_least("way of the hand down there [m]", before[hand < 0.45].max(initial=0.0), 0.3)]


@defines(
    "lift", "Both wrists from waist height or less to over the shoulders, together.", "whether the hands hold something"
)
def lift(s: MotionSignals) -> Requirements:
    before = np.minimum.accumulate(s.hand_height.max(axis=1))
    over = (s.hands_over_shoulders.min(axis=1) > 0.1) & (s.hands_apart < 0.65)
    return [
        at_least("longest time with both hands over the shoulders [s]", longest(over), 0.3),
        at_most("lowest height of both wrists before [m]", before[over].min(initial=9.0), 1.2),
        at_least("share of time on the feet", share(s.legs > 0.5), 0.7),
        at_most("longest flight [s]", s.longest_flight, 0.1),
    ]


@defines("crawl", "Hands at the floor and face down most of the time, on the way, the hands in turn.")
def crawl(s: MotionSignals) -> Requirements:
    four = (
        (s.hand_height.min(axis=1) < 0.25)
        & (s.inclination > 45.0)
        & (np.abs(s.pelvis_height - 0.47) < 0.28)
        & (s.front < 0.2)
    )
    return [
        at_least("share of time with hands at the floor, face down", share(four), 0.6),
        at_least("way over the floor [m]", s.path, 0.4),
        at_least(
            "moves of the hands ahead and back of each other", swings(s.wrists[:, 0, 0] - s.wrists[:, 1, 0], 0.15), 1
        ),
    ]


DEFINITIONS: tuple[Definition, ...] = (
    standing,
    sit,
    sit_down,
    stand_up,
    sit_and_stand,
    lie,
    lie_down,
    fall,
    fall_forward,
    fall_backward,
    fall_sideways,
    fall_from_chair,
    get_up,
    crouch,
    squat,
    kneel,
    trunk_flexion,
    bows_down,
    pick_up,
    put_down,
    lift,
    crawl,
)
"""Actions of this module."""
