"""Movements of arms and hands: gestures, waves, claps, strikes, throws."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from scipy.ndimage import maximum_filter1d

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.action_definitions.definition import (
    Definition,
    Requirements,
    at_least,
    at_most,
    defines,
    easiest,
)
from rfgen_sionna.generative.action_definitions.motion_signals import MotionSignals
from rfgen_sionna.generative.action_definitions.sampled_series import (
    RATE,
    longest,
    period,
    rate_of,
    share,
    smooth,
    stretches,
    swings,
    turning_points,
)


def _either(of: Callable[[MotionSignals, int], Requirements], s: MotionSignals) -> Requirements:
    return easiest([of(s, 0), of(s, 1)])


def _in_place(s: MotionSignals, most: float = 0.4) -> Requirements:
    return [
        at_least("share of time on the feet", share(s.legs > 0.85), 0.9),
        at_most("distance of the pelvis from its median place [m]", s.roam, most),
    ]


def _strokes(values: FloatArray, size: float) -> tuple[float, float, int]:
    """Median time of the moves up and of those down by `size` or more [s], and how many there are."""
    points = turning_points(values, size)
    moves = [(points[k + 1] - points[k], values[points[k + 1]] > values[points[k]]) for k in range(len(points) - 1)]
    up = [n / RATE for n, rising in moves if rising]
    down = [n / RATE for n, rising in moves if not rising]
    return float(np.median(up)) if up else np.inf, float(np.median(down)) if down else np.inf, len(moves)


def _fastest(values: FloatArray) -> tuple[float, float]:
    """Fastest speed up and down of a place over 0.15 s, 90th percentile of the moving time's ends [1/s]."""
    rate = smooth(np.gradient(values) * RATE, 0.1)
    return float(np.percentile(rate, 97)), float(-np.percentile(rate, 3))


def _swipe(sign: float, s: MotionSignals) -> Requirements:
    def of(s: MotionSignals, side: int) -> Requirements:
        across = sign * s.wrists[:, side, 1]
        toward, back = _fastest(across)
        height = s.wrists[:, side, 2]
        return [
            at_least("way of the hand across [m]", np.ptp(across), 0.25),
            at_least("speed of the hand that way [m/s]", toward, 0.8),
            at_least("that speed over the speed back", toward / max(back, 1e-9), 1.1),
            at_least("highest hand from the shoulders [m]", height.max(), -0.35),
            at_least("way across over the way up", np.ptp(across) / max(np.ptp(height), 1e-9), 1.0),
            *_in_place(s),
        ]

    return _either(of, s)


def _thrust(sign: float, s: MotionSignals) -> Requirements:
    def of(s: MotionSignals, side: int) -> Requirements:
        ahead = sign * s.wrists[:, side, 0]
        toward, back = _fastest(ahead)
        return [
            at_least("way of the hand ahead and back [m]", np.ptp(ahead), 0.18),
            at_least("speed of the hand that way [m/s]", toward, 0.6),
            at_least("that speed over the speed back", toward / max(back, 1e-9), 1.1),
            at_least("least place of the hand ahead of the shoulders [m]", s.wrists[:, side, 0].min(), -0.1),
            at_least("way ahead over the way across", np.ptp(ahead) / max(np.ptp(s.wrists[:, side, 1]), 1e-9), 1.0),
            at_least("lowest hand from the shoulders [m]", s.wrists[:, side, 2].min(), -0.5),
            *_in_place(s),
        ]

    return _either(of, s)


def _around(path: FloatArray) -> float:
    """Turns that the velocity of a plane path (sample, 2) makes, counter-clockwise."""
    velocity = smooth(np.gradient(path, axis=0) * RATE, 0.1)
    fast = np.linalg.norm(velocity, axis=1) > 0.25
    angle = np.unwrap(np.arctan2(velocity[fast, 1], velocity[fast, 0]))
    return float((angle[-1] - angle[0]) / (2.0 * np.pi)) if len(angle) else 0.0


def _circle(sign: float, s: MotionSignals) -> Requirements:
    def of(s: MotionSignals, side: int) -> Requirements:
        seen = np.stack([-s.wrists[:, side, 1], s.wrists[:, side, 2]], axis=-1)  # right and up, as the person sees it
        return [
            at_least("turns of the hand in that sense", sign * _around(seen), 0.8),
            at_least("width of the path [m]", np.ptp(seen[:, 0]), 0.12),
            at_least("height of the path [m]", np.ptp(seen[:, 1]), 0.12),
            at_least("hand ahead of the shoulders [m]", np.median(s.wrists[:, side, 0]), 0.15),
            *_in_place(s),
        ]

    return _either(of, s)


def _held_up(s: MotionSignals, side: int) -> Requirements:
    return [
        at_least("median hand from the shoulders [m]", np.median(s.wrists[:, side, 2]), -0.4),
        at_least("median hand ahead of the shoulders [m]", np.median(s.wrists[:, side, 0]), 0.12),
        at_most("spread of the wrist about its mean place [m]", s.wrists[:, side].std(axis=0).max(), 0.06),
        *_in_place(s, 0.2),
    ]


@defines(
    "click",
    "A hand held before the body; its index finger bends and stretches.",
    "anything on bodies without fingers: those are refused",
)
def click(s: MotionSignals) -> Requirements:
    if s.index_flexion is None:
        return [at_least("joints of the index fingers", 0, 1)]
    bends = s.index_flexion

    def of(s: MotionSignals, side: int) -> Requirements:
        return [
            *_held_up(s, side),
            at_least("moves of the index finger's knuckle by 20 degrees", swings(bends[:, side], 20.0), 2),
        ]

    return _either(of, s)


@defines(
    "finger_swing", "A hand held before the body swings from side to side in the wrist.", "which finger is stretched"
)
def finger_swing(s: MotionSignals) -> Requirements:
    def of(s: MotionSignals, side: int) -> Requirements:
        hand = s.orientations[f"{('left', 'right')[side]}_wrist"][:, :, 1]
        yaw = np.degrees(np.unwrap(np.arctan2(hand[:, 1], hand[:, 0])))
        tilt = np.degrees(np.arcsin(np.clip(hand[:, 0], -1.0, 1.0)))
        return [
            *_held_up(s, side),
            at_least(
                "swings of the hand by 10 degrees",
                max(
                    swings(yaw, 10.0),
                    swings(tilt, 10.0),
                    swings(np.degrees(np.arcsin(np.clip(hand[:, 1], -1, 1))), 10.0),
                ),
                3,
            ),
        ]

    return _either(of, s)


@defines("wave", "A raised forearm swings from side to side three times or more.")
def wave(s: MotionSignals) -> Requirements:
    def of(s: MotionSignals, side: int) -> Requirements:
        up = (s.hands_over_shoulders[:, side] > -0.1) & (s.pair("wrist")[:, side, 2] > s.pair("elbow")[:, side, 2])
        hand = s.ahead(s.pair("wrist") - s.pair("elbow"))[:, side]
        runs = [slice(a, b) for a, b in stretches(up) if b - a > 4] or [slice(0, 0)]
        best = max(runs, key=lambda run: swings(hand[run, 1], 0.06) if len(hand[run]) else -1)
        moved = hand[best].std(axis=0) if len(hand[best]) else np.zeros(3)
        return [
            at_least(
                "swings from side to side of a raised forearm by 6 cm",
                swings(hand[best, 1], 0.06) if len(hand[best]) else 0,
                3,
            ),
            at_least("way from side to side over the way ahead", moved[1] / max(moved[0], 1e-9), 0.7),
            at_least("share of time on the feet or seated", share(s.inclination < 40.0), 0.9),
            at_most(
                "median of the other hand over its shoulder [m]", np.median(s.hands_over_shoulders[:, 1 - side]), 0.1
            ),
            at_most("longest flight [s]", max((b - a for a, b in s.flights), default=0) / RATE, 0.15),
        ]

    return _either(of, s)


@defines(
    "shake_hands",
    "A hand held out ahead, below the shoulder, goes up and down by 3 cm or more three times or more, in one place.",
    "whether another person holds the hand",
)
def shake_hands(s: MotionSignals) -> Requirements:
    def of(s: MotionSignals, side: int) -> Requirements:
        hand = s.wrists[:, side]
        out = (hand[:, 0] > 0.2) & (hand[:, 2] > -0.5) & (hand[:, 2] < 0.05) & (np.abs(hand[:, 1]) < 0.4)
        runs = [slice(a, b) for a, b in stretches(out)]
        moves = max((swings(hand[run, 2], 0.03) for run in runs), default=0)
        return [
            at_least("moves up and down of a hand held out by 3 cm", moves, 3),
            at_least("longest time with the hand held out [s]", longest(out), 0.6),
            at_most(
                "median of the other hand over its shoulder [m]", np.median(s.hands_over_shoulders[:, 1 - side]), -0.2
            ),
            at_most("fastest hand against the shoulders [m/s]", s.wrist_speed[:, side].max(), 2.5),
            *_in_place(s, 1),
        ]

    return _either(of, s)


@defines("clap", "The hands meet before the body three times or more.")
def clap(s: MotionSignals) -> Requirements:
    near = np.minimum(s.hands_apart, 1.0)
    points = turning_points(near, 0.08)
    closed = [k for k in points if near[k] < 0.26]
    return [
        at_least("times that the hands meet", len(closed), 3),
        at_least("median hands ahead of the shoulders [m]", np.median(s.wrists[..., 0]), 0.1),
        at_most("highest foot [m]", s.feet.max(), 0.4),
        at_most("time between them [s]", float(np.median(np.diff(closed))) / RATE if len(closed) > 1 else 9.0, 1.2),
    ]


def _punches(s: MotionSignals, least: float = 2.1) -> list[int]:
    """Samples of fast strikes of a hand away from the trunk that end between waist and head height: a standing body,
    no leg raised or as fast as the hand."""
    found = []
    for side in range(2):
        for a, b in stretches(s.wrist_speed[:, side] > least):
            window = slice(max(a - 3, 0), b + 3)
            at = int(np.argmax(s.wrist_speed[a:b, side])) + a
            out, reached = s.wrists[window, side], s.reach[window, side]
            end = out[at - window.start :][int(np.argmax(reached[at - window.start :]))]
            legs = s.ankle_speed[max(at - 4, 0) : at + 5].max() / s.wrist_speed[at, side]
            low = s.thigh_elevation[max(at - 7, 0) : at + 8].max() < 55.0 or np.ptp(reached) > 0.4
            struck = np.ptp(reached) > 0.13 and -0.4 < end[2] < 0.35 and np.hypot(end[0], end[1]) > 0.25
            if struck and low and legs < 1.4 and s.speed[at] < 1.5:
                found.append(at)
    return sorted(found)


@defines(
    "punch",
    "A hand strikes out, at 2.1 m/s or more, from a bent elbow, faster than the feet, in about one place.",
)
def punch(s: MotionSignals) -> Requirements:
    return [
        at_least("fast strikes of a hand", len(_punches(s)), 1),
        at_least("share of time on the feet", share(s.legs > 0.75), 0.9),
        at_most("median speed over the floor [m/s]", np.median(s.speed), 0.8),
        at_least("most bent elbow [degrees]", s.elbow_flexion.max(), 70.0),
    ]


@defines("boxing", "Three punches or more, one in three seconds or more often.")
def boxing(s: MotionSignals) -> Requirements:
    strikes = len(_punches(s))
    return [
        *punch(s),
        at_least("strikes", strikes, 3),
        at_least("strikes a second", strikes / s.duration, 0.3),
    ]


@defines(
    "throw",
    "A hand goes out from a bent arm, ahead or up, at 1.75 m/s or more, over the shoulder; or both arms stretch "
    "together over the shoulders.",
    "whether something is thrown",
)
def throw(s: MotionSignals) -> Requirements:
    before = -maximum_filter1d(-s.reach, 15, axis=0, origin=7)
    after = maximum_filter1d(s.reach, 9, axis=0, origin=-4)
    high = maximum_filter1d(s.hands_over_shoulders, 13, axis=0) > 0.0
    extends = (before < 0.85) & (after > 0.78) & high & (s.wrist_velocity[..., [0, 2]].sum(axis=-1) > 0.0)
    one = float(np.max(s.wrist_speed * extends))
    together = (s.hands_over_shoulders > 0.1).all(axis=1) & (s.hands_apart < 0.45)
    both = float(np.max(rate_of(s.reach).min(axis=1) * together))
    return [
        *easiest(
            [
                [at_least("fastest hand ahead or up, from a bent arm to a stretched one [m/s]", one, 1.75)],
                [at_least("both arms together stretch over the shoulders, shares of their length a second", both, 0.8)],
            ]
        ),
        at_least("share of time on the feet", share(s.legs > 0.7), 0.9),
        at_most("highest thigh [degrees]", s.thigh_elevation.max(), 75.0),
        at_most("median speed over the floor [m/s]", np.median(s.speed), 1.0),
    ]


@defines("arm_circles", "A nearly straight arm goes once round the shoulder.")
def arm_circles(s: MotionSignals) -> Requirements:
    def of(s: MotionSignals, side: int) -> Requirements:
        hand = s.ahead(s.pair("wrist") - s.pair("shoulder"))[:, side]
        planes = [hand[:, [0, 2]], hand[:, [1, 2]]]
        turned = max(abs(np.ptp(np.unwrap(np.arctan2(each[:, 1], each[:, 0])))) / (2.0 * np.pi) for each in planes)
        return [
            at_least("turns of the hand around the shoulder", turned, 0.8),
            at_least("highest and lowest hand from the shoulder, apart [m]", np.ptp(hand[:, 2]), 0.6),
            at_most("median elbow flexion [degrees]", np.median(s.elbow_flexion[:, side]), 70.0),
            *_in_place(s),
        ]

    return _either(of, s)


@defines("swing_arms", "Both arms swing to and fro in one place.")
def swing_arms(s: MotionSignals) -> Requirements:
    hands = s.ahead(s.pair("wrist") - s.pair("shoulder"))
    moves = [max(swings(hands[:, k, axis], 0.2) for axis in range(2)) for k in range(2)]
    return [
        at_least("swings of each hand by 0.2 m", min(moves), 3),
        at_least(
            "share of time with both hands below the shoulders",
            share(np.all(s.hands_over_shoulders < 0.1, axis=1)),
            0.6,
        ),
        at_most("highest foot [m]", s.feet.max(), 0.25),
        *_in_place(s, 0.6),
    ]


@defines(
    "sweep",
    "Both hands, together before the body and low, swing in step to and fro.",
    "whether the hands hold a broom, a mop or a rake",
)
def sweep(s: MotionSignals) -> Requirements:
    hands = s.wrists.mean(axis=1)
    length, match = period(hands)
    return [
        at_most("median distance between the wrists [m]", np.median(s.hands_apart), 0.7),
        at_least("median hands ahead of the shoulders [m]", np.median(s.wrists[..., 0]), 0.1),
        at_most("median hands from the shoulders [m]", np.median(s.wrists[..., 2]), -0.1),
        at_least("swings of both hands by 0.15 m", max(swings(hands[:, 1], 0.15), swings(hands[:, 0], 0.15)), 3),
        at_least(
            "correlation of the two hands",
            min(
                np.corrcoef(s.wrists[:, 0, k], s.wrists[:, 1, k])[0, 1]
                for k in (int(np.ptp(hands[:, 1]) > np.ptp(hands[:, 0])),)
            ),
            0.5,
        ),
        at_least("repetition: autocorrelation at the period", match if length else 0.0, 0.3),
    ]


@defines(
    "wash_window", "A hand ahead and over the waist moves to and fro six times or more.", "whether there is a window"
)
def wash_window(s: MotionSignals) -> Requirements:
    def of(s: MotionSignals, side: int) -> Requirements:
        seen = np.stack([-s.wrists[:, side, 1], s.wrists[:, side, 2]], axis=-1)
        return [
            at_least(
                "share of time with the hand ahead and over the waist",
                share((s.wrists[:, side, 0] > 0.15) & (s.wrists[:, side, 2] > -0.35)),
                0.7,
            ),
            at_least(
                "moves of the hand up and down or across by 0.15 m",
                max(swings(seen[:, 0], 0.15), swings(seen[:, 1], 0.15)),
                6,
            ),
            at_least("median speed of the hand [m/s]", np.median(s.wrist_speed[:, side]), 0.3),
            *_in_place(s, 1),
        ]

    return _either(of, s)


DEFINITIONS: tuple[Definition, ...] = (
    Definition(
        "swipe_left",
        "A hand before the body goes to the person's left fast and comes back slower.",
        partial(_swipe, 1.0),
    ),
    Definition(
        "swipe_right",
        "A hand before the body goes to the person's right fast and comes back slower.",
        partial(_swipe, -1.0),
    ),
    Definition("push", "A hand goes ahead from the body faster than it comes back.", partial(_thrust, 1.0)),
    Definition("pull", "A hand comes back to the body faster than it goes ahead.", partial(_thrust, -1.0)),
    Definition(
        "circle_clockwise", "A hand before the body goes round clockwise as the person sees it.", partial(_circle, -1.0)
    ),
    Definition(
        "circle_counterclockwise",
        "A hand before the body goes round counter-clockwise as the person sees it.",
        partial(_circle, 1.0),
    ),
    click,
    finger_swing,
    wave,
    shake_hands,
    clap,
    punch,
    boxing,
    throw,
    arm_circles,
    swing_arms,
    sweep,
    wash_window,
)
"""Actions of this module."""
