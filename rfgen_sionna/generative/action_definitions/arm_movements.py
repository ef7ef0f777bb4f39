"""Movements of the arms: waves, claps, strikes, throws, work with both hands."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import maximum_filter1d

from rfgen_sionna.generative.action_definitions.definition import (
    Definition,
    Requirements,
    at_least,
    at_most,
    defines,
    easiest,
    either_side,
    in_place,
)
from rfgen_sionna.generative.action_definitions.motion_signals import MotionSignals
from rfgen_sionna.generative.action_definitions.sampled_series import (
    RATE,
    longest,
    period,
    rate_of,
    share,
    stretches,
    swings,
    turning_points,
)


@defines("wave", "A raised forearm swings from side to side three times or more.")
def wave(s: MotionSignals) -> Requirements:
    def of(side: int) -> Requirements:
        up = (s.hands_over_shoulders[:, side] > -0.1) & (s.pair("wrist")[:, side, 2] > s.pair("elbow")[:, side, 2])
        hand = s.ahead(s.pair("wrist") - s.pair("elbow"))[:, side]
        runs = [slice(a, b) for a, b in stretches(up) if b - a > 4] or [slice(0, 0)]
        best = max(runs, key=lambda run: swings(hand[run, 1], 0.06) if len(hand[run]) else -1)
        moved = hand[best].std(axis=0) if len(hand[best]) else np.zeros(3)
        other = s.ahead(s.pair("wrist") - s.pair("elbow"))[best, 1 - side]
        waves_too = len(other) > 0 and other[:, 2].min() > 0.0 and swings(other[:, 1], 0.06) >= 3
        return [
            at_least(
                "swings from side to side of a raised forearm by 6 cm",
                swings(hand[best, 1], 0.06) if len(hand[best]) else 0,
                3,
            ),
            at_least("way from side to side over the way ahead", moved[1] / max(moved[0], 1e-9), 0.7),
            at_least("share of time on the feet or seated", share(s.inclination < 40.0), 0.9),
            at_most(
                "median of the other hand, unless it waves too, over its shoulder [m]",
                -1.0 if waves_too else np.median(s.hands_over_shoulders[:, 1 - side]),
                0.1,
            ),
            at_most("longest flight [s]", s.longest_flight, 0.15),
        ]

    return either_side(of)


@defines(
    "shake_hands",
    "A hand held out ahead, below the shoulder, goes up and down by 3 cm or more three times or more, in one place.",
    "whether another person holds the hand",
)
def shake_hands(s: MotionSignals) -> Requirements:
    def of(side: int) -> Requirements:
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
            *in_place(s, 1),
        ]

    return either_side(of)


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
    def of(side: int) -> Requirements:
        hand = s.ahead(s.pair("wrist") - s.pair("shoulder"))[:, side]
        planes = [hand[:, [0, 2]], hand[:, [1, 2]]]
        turned = max(abs(np.ptp(np.unwrap(np.arctan2(each[:, 1], each[:, 0])))) / (2.0 * np.pi) for each in planes)
        return [
            at_least("turns of the hand around the shoulder", turned, 0.8),
            at_least("highest and lowest hand from the shoulder, apart [m]", np.ptp(hand[:, 2]), 0.6),
            at_most("median elbow flexion [degrees]", np.median(s.elbow_flexion[:, side]), 70.0),
            *in_place(s),
        ]

    return either_side(of)


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
        *in_place(s, 0.6),
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
    def of(side: int) -> Requirements:
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
            *in_place(s, 1),
        ]

    return either_side(of)


DEFINITIONS: tuple[Definition, ...] = (
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
