"""Gestures of one hand before the body."""

from __future__ import annotations

from functools import partial

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.action_definitions.definition import (
    Definition,
    Requirements,
    at_least,
    at_most,
    defines,
    either_side,
    in_place,
)
from rfgen_sionna.generative.action_definitions.motion_signals import MotionSignals
from rfgen_sionna.generative.action_definitions.sampled_series import RATE, smooth, swings


def _fastest(values: FloatArray) -> tuple[float, float]:
    """Fastest speed up and down of a place over 0.15 s, 90th percentile of the moving time's ends [1/s]."""
    rate = smooth(np.gradient(values) * RATE, 0.1)
    return float(np.percentile(rate, 97)), float(-np.percentile(rate, 3))


def _swipe(sign: float, s: MotionSignals) -> Requirements:
    def of(side: int) -> Requirements:
        across = sign * s.wrists[:, side, 1]
        toward, back = _fastest(across)
        height = s.wrists[:, side, 2]
        return [
            at_least("way of the hand across [m]", np.ptp(across), 0.25),
            at_least("speed of the hand that way [m/s]", toward, 0.8),
            at_least("that speed over the speed back", toward / max(back, 1e-9), 1.1),
            at_least("highest hand from the shoulders [m]", height.max(), -0.35),
            at_least("way across over the way up", np.ptp(across) / max(np.ptp(height), 1e-9), 1.0),
            *in_place(s),
        ]

    return either_side(of)


def _thrust(sign: float, s: MotionSignals) -> Requirements:
    def of(side: int) -> Requirements:
        ahead = sign * s.wrists[:, side, 0]
        toward, back = _fastest(ahead)
        return [
            at_least("way of the hand ahead and back [m]", np.ptp(ahead), 0.18),
            at_least("speed of the hand that way [m/s]", toward, 0.6),
            at_least("that speed over the speed back", toward / max(back, 1e-9), 1.1),
            at_least("least place of the hand ahead of the shoulders [m]", s.wrists[:, side, 0].min(), -0.1),
            at_least("way ahead over the way across", np.ptp(ahead) / max(np.ptp(s.wrists[:, side, 1]), 1e-9), 1.0),
            at_least("lowest hand from the shoulders [m]", s.wrists[:, side, 2].min(), -0.5),
            *in_place(s),
        ]

    return either_side(of)


def _around(path: FloatArray) -> float:
    """Turns that the velocity of a plane path (sample, 2) makes, counter-clockwise."""
    velocity = smooth(np.gradient(path, axis=0) * RATE, 0.1)
    fast = np.linalg.norm(velocity, axis=1) > 0.25
    angle = np.unwrap(np.arctan2(velocity[fast, 1], velocity[fast, 0]))
    return float((angle[-1] - angle[0]) / (2.0 * np.pi)) if len(angle) else 0.0


def _circle(sign: float, s: MotionSignals) -> Requirements:
    def of(side: int) -> Requirements:
        seen = np.stack([-s.wrists[:, side, 1], s.wrists[:, side, 2]], axis=-1)  # right and up, as the person sees it
        return [
            at_least("turns of the hand in that sense", sign * _around(seen), 0.8),
            at_least("width of the path [m]", np.ptp(seen[:, 0]), 0.12),
            at_least("height of the path [m]", np.ptp(seen[:, 1]), 0.12),
            at_least("hand ahead of the shoulders [m]", np.median(s.wrists[:, side, 0]), 0.15),
            *in_place(s),
        ]

    return either_side(of)


def _held_up(s: MotionSignals, side: int) -> Requirements:
    return [
        at_least("median hand from the shoulders [m]", np.median(s.wrists[:, side, 2]), -0.4),
        at_least("median hand ahead of the shoulders [m]", np.median(s.wrists[:, side, 0]), 0.12),
        at_most("spread of the wrist about its mean place [m]", s.wrists[:, side].std(axis=0).max(), 0.06),
        *in_place(s, 0.2),
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

    def of(side: int) -> Requirements:
        return [
            *_held_up(s, side),
            at_least("moves of the index finger's knuckle by 20 degrees", swings(bends[:, side], 20.0), 2),
        ]

    return either_side(of)


@defines(
    "finger_swing", "A hand held before the body swings from side to side in the wrist.", "which finger is stretched"
)
def finger_swing(s: MotionSignals) -> Requirements:
    def of(side: int) -> Requirements:
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

    return either_side(of)


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
)
"""Actions of this module."""
