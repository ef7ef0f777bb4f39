"""Jumps, hops and turns upside down."""

from __future__ import annotations

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.action_definitions.definition import Definition, Requirements, at_least, at_most, defines
from rfgen_sionna.generative.action_definitions.motion_signals import MotionSignals
from rfgen_sionna.generative.action_definitions.sampled_series import RATE, longest, swings


def _rise(s: MotionSignals, a: int, b: int) -> float:
    """Rise of the lower foot in a flight [m]."""
    return float(s.feet[a:b].min(axis=1).max())


def _feet_together(s: MotionSignals, a: int, b: int) -> tuple[float, float]:
    """How long before take-off and after landing the later foot follows the other [s]."""
    before, after = max(a - 8, 0), min(b + 8, len(s.time))
    off = [next((a - k for k in range(a - 1, before - 1, -1) if s.planted[k, foot]), 8) for foot in range(2)]
    on = [next((k - b for k in range(b, after) if s.planted[k, foot]), 8) for foot in range(2)]
    return abs(off[0] - off[1]) / RATE, abs(on[0] - on[1]) / RATE


def _high(s: MotionSignals) -> list[tuple[int, int]]:
    """Flights of 0.15 s or more, feet 3 cm or more over the floor, in free fall."""
    return [(a, b) for a, b in s.flights_over(0.03) if b - a >= 3 and s.fall_of_mass[a:b].max() > 7.5]


def _jumps(s: MotionSignals) -> list[tuple[int, int]]:
    """High flights that leave from both feet or land on both."""
    return [(a, b) for a, b in _high(s) if min(_feet_together(s, a, b)) <= 0.1]


@defines("jump", "Both feet off the floor for 0.15 s or more, from both feet or onto both.")
def jump(s: MotionSignals) -> Requirements:
    return [at_least("flights of 0.15 s or more from or onto both feet", len(_jumps(s)), 1)]


def _flown(s: MotionSignals, a: int, b: int) -> float:
    place = s.joint("pelvis")[:, :2]
    return float(np.linalg.norm(place[min(b, len(place) - 1)] - place[max(a - 1, 0)]))


@defines("jump_forward", "A jump that flies 0.3 m or more over the floor.")
def jump_forward(s: MotionSignals) -> Requirements:
    return [
        *jump(s),
        at_least("way over the floor in the air [m]", max((_flown(s, a, b) for a, b in s.flights), default=0.0), 0.3),
    ]


@defines("hop", "Both feet off the floor for 0.15 s or more, up to 0.6 m.")
def hop(s: MotionSignals) -> Requirements:
    return [
        at_least("flights of 0.15 s or more", len(_high(s)), 1),
        at_most("highest rise of the lower foot [m]", max((_rise(s, a, b) for a, b in s.flights), default=0.0), 0.6),
    ]


@defines("leap", "A flight of 0.25 s or more, over 0.45 m or more of floor.")
def leap(s: MotionSignals) -> Requirements:
    return [
        at_least("longest flight [s]", s.longest_flight, 0.25),
        at_least("way over the floor in the air [m]", max((_flown(s, a, b) for a, b in s.flights), default=0.0), 0.45),
    ]


@defines("skip", "On the way with flights that land on the foot that they left.")
def skip(s: MotionSignals) -> Requirements:
    same = 0
    for a, b in s.flights:
        off = [foot for foot in range(2) if s.planted[max(a - 2, 0) : a, foot].any()]
        on = [foot for foot in range(2) if s.planted[b : b + 2, foot].any()]
        same += bool(set(off) & set(on))
    return [
        at_least("flights", len(s.flights), 2),
        at_least("flights that land on the foot that they left", same, 2),
        at_least("way over the floor [m]", s.path, 1.5),
        at_most("mean speed over the floor [m/s]", s.path / s.duration, 3.5),
    ]


@defines("jump_twist", "The pelvis turns by 45 degrees or more in the air.")
def jump_twist(s: MotionSignals) -> Requirements:
    turned = [abs(np.degrees(s.heading[min(b, len(s.time) - 1)] - s.heading[max(a - 2, 0)])) for a, b in s.flights]
    return [at_least("angle turned in the air [degrees]", max(turned, default=0.0), 45.0)]


@defines("jumping_jacks", "Arms go up and down by 60 degrees or more while the feet go apart and together.")
def jumping_jacks(s: MotionSignals) -> Requirements:
    arms, legs = s.arm_elevation, s.feet_apart[:, 1]
    both = arms.mean(axis=1)
    return [
        at_least("moves of both arms by 60 degrees", swings(both, 60.0), 3),
        at_least("moves of the feet apart and together by 0.2 m", swings(legs, 0.2), 3),
        at_least("correlation of the two arms", _correlation(arms[:, 0], arms[:, 1]), 0.8),
        at_least("correlation of arms and legs, unsigned", abs(_correlation(both, legs)), 0.4),
        at_most("distance of the pelvis from its median place [m]", s.roam, 0.75),
    ]


def _correlation(a: FloatArray, b: FloatArray) -> float:
    """Of two signals; 0 where one is constant."""
    return float(np.corrcoef(a, b)[0, 1]) if min(np.ptp(a), np.ptp(b)) > 1e-6 else 0.0


def upside_down(s: MotionSignals) -> np.ndarray:
    """(sample,) whether the trunk is turned over by more than 110 degrees."""
    return s.inclination > 110.0


@defines("cartwheel", "The trunk is turned over on the hands, feet above, on the way.")
def cartwheel(s: MotionSignals) -> Requirements:
    over = upside_down(s) & (s.hand_height.min(axis=1) < 0.3) & (s.pelvis_height > 0.5)
    return [
        at_least("longest time turned over on the hands [s]", longest(over), 0.1),
        at_most("longest time turned over [s]", longest(upside_down(s)), 1.5),
        at_least("way over the floor [m]", s.path, 0.8),
        at_least("height of the higher foot meanwhile [m]", s.feet.max(axis=1)[over].max(initial=0.0), 1.0),
    ]


@defines("handstand", "The trunk is turned over on the hands for 0.4 s or more.")
def handstand(s: MotionSignals) -> Requirements:
    over = upside_down(s) & (s.hand_height.min(axis=1) < 0.3) & (s.pelvis_height > 0.5)
    return [at_least("longest time turned over on the hands [s]", longest(over), 0.4)]


@defines("flip", "The trunk is turned over while neither feet nor hands are at the floor.")
def flip(s: MotionSignals) -> Requirements:
    over = upside_down(s) & (s.feet.min(axis=1) > 0.1) & (s.hand_height.min(axis=1) > 0.1)
    return [at_least("longest time turned over in the air [s]", longest(over), 0.1)]


DEFINITIONS: tuple[Definition, ...] = (
    jump,
    jump_forward,
    hop,
    leap,
    skip,
    jump_twist,
    jumping_jacks,
    cartwheel,
    handstand,
    flip,
)
"""Actions of this module."""
