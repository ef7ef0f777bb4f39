"""Daily actions of hands: postures of the arms, greetings, work of a hand before the body or at the head."""

from __future__ import annotations

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.action_definitions.definition import (
    Definition,
    Requirements,
    at_least,
    at_most,
    defines,
    either_side,
)
from rfgen_sionna.generative.action_definitions.held_poses import hand_at_head, hanging, horizontal
from rfgen_sionna.generative.action_definitions.motion_signals import MotionSignals
from rfgen_sionna.generative.action_definitions.sampled_series import Flags, longest, share, swings


def _from_pelvis(s: MotionSignals) -> FloatArray:
    """(sample, 2, 3) wrists from the pelvis, ahead, outwards, up [m]"""
    return s.ahead(s.pair("wrist") - s.joint("pelvis")[:, None]) * np.array([[1.0, 1.0, 1.0], [1.0, -1.0, 1.0]])


def _low(s: MotionSignals, side: int) -> Flags:
    """(sample,) whether a hand is lower than the chest"""
    low: Flags = s.hands_over_shoulders[:, side] < -0.2
    return low


def _held(posture: Flags, least: float = 0.7) -> Requirements:
    return [at_least("share of time with both hands there", share(np.all(posture, axis=1)), least)]


@defines("arms_on_hips", "Both hands at the hips, elbows bent and out.")
def arms_on_hips(s: MotionSignals) -> Requirements:
    hands = _from_pelvis(s)
    there = (np.abs(hands[..., 2] - 0.1) < 0.16) & (np.abs(hands[..., 0]) < 0.2)
    return _held(there & (np.abs(hands[..., 1] - 0.21) < 0.1) & (s.elbow_flexion > 65.0))


@defines("arms_folded", "Each hand at the other arm, across the chest, elbows bent.")
def crossed_arms(s: MotionSignals) -> Requirements:
    across = s.wrists[..., 1] * np.array([1.0, -1.0])  # outwards
    there = (across < 0.02) & (s.wrists[..., 0] > 0.08) & (s.wrists[..., 2] > -0.4) & (s.wrists[..., 2] < 0.0)
    return _held(there & (s.elbow_flexion > 60.0))


@defines("hands_behind_back", "Both hands behind the pelvis or the back.")
def hands_behind_back(s: MotionSignals) -> Requirements:
    hands = _from_pelvis(s)
    return _held((hands[..., 0] < -0.08) & (np.abs(hands[..., 1]) < 0.16) & (hands[..., 2] > -0.15))


@defines("hands_in_pockets", "Both hands beside the hips, elbows bent and back.", "whether the hands are in pockets")
def hands_in_pockets(s: MotionSignals) -> Requirements:
    hands = _from_pelvis(s)
    there = (np.abs(hands[..., 2] - 0.03) < 0.1) & (np.abs(hands[..., 0]) < 0.16)
    return _held(there & (np.abs(hands[..., 1] - 0.2) < 0.09) & (s.elbow_flexion > 30.0))


@defines("both_arms_forward", "Both arms level and ahead for 0.8 s or more, on straight legs.")
def both_arms_forward(s: MotionSignals) -> Requirements:
    level = np.all(horizontal(s) & (s.wrists[..., 0] > 0.35), axis=1) & (s.legs > 0.9)
    return [at_least("longest time with both arms level and ahead [s]", longest(level), 0.8)]


@defines("beckon", "A hand before the body, palm up, comes towards it again and again, the elbow bent.")
def beckon(s: MotionSignals) -> Requirements:
    def of(side: int) -> Requirements:
        hand = s.wrists[:, side]
        there = (hand[:, 0] > 0.08) & (hand[:, 2] > -0.3) & (s.elbow_flexion[:, side] > 25.0) & _low(s, 1 - side)
        return [
            at_least("longest time with the hand before the chest, the other one low [s]", longest(there), 0.8),
            at_least("moves of it ahead and back by 5 cm", swings(hand[there, 0], 0.05) if there.any() else 0, 3),
            at_least(
                "way ahead over the way across",
                np.ptp(hand[there, 0]) / max(np.ptp(hand[there, 1]), 1e-9) if there.any() else 0.0,
                0.9,
            ),
        ]

    return either_side(of)


@defines(
    "salute",
    "A hand at the brow for 0.4 s or more, elbow out and up, the other one low.",
    "whether the eyes are shaded from light",
)
def salute(s: MotionSignals) -> Requirements:
    def of(side: int) -> Requirements:
        elbow = s.ahead(s.pair("elbow") - s.pair("shoulder"))[:, side]
        up = (s.hands_over_shoulders[:, side] > 0.03) & (elbow[:, 2] > -0.2) & (s.hand_to_head[:, side] < 0.36)
        outwards = elbow[:, 1] * (1.0, -1.0)[side] > 0.04
        calm = (s.wrist_speed[:, side] < 0.9) & _low(s, 1 - side)
        return [at_least("longest time with a calm hand at the brow [s]", longest(up & outwards & calm), 0.4)]

    return either_side(of)


@defines("wipe", "A hand ahead and under the chest moves from side to side three times or more.")
def wipe(s: MotionSignals) -> Requirements:
    def of(side: int) -> Requirements:
        hand = s.wrists[:, side]
        there = (hand[:, 0] > 0.1) & (hand[:, 2] < 0.0)
        return [
            at_least("share of time with the hand ahead and under the chest", share(there), 0.7),
            at_least("moves of it from side to side by 0.1 m", swings(hand[:, 1], 0.1), 3),
            at_least(
                "movement of the other hand, at most a share of its [1]",
                -s.wrist_speed[:, 1 - side].mean() / max(s.wrist_speed[:, side].mean(), 1e-9),
                -0.6,
            ),
            at_most("distance of the pelvis from its median place [m]", s.roam, 0.75),
        ]

    return either_side(of)


@defines("stir", "A hand before the waist goes round in small circles.", "whether there is a pot")
def stir(s: MotionSignals) -> Requirements:
    def of(side: int) -> Requirements:
        hand = s.wrists[:, side]
        there = (hand[:, 0] > 0.12) & (hand[:, 2] < -0.02) & (hand[:, 2] > -0.5)
        round_it = np.unwrap(np.arctan2(*np.gradient(hand[:, :2], axis=0).T[::-1]))
        return [
            at_least("share of time with the hand before the waist", share(there), 0.8),
            at_least("turns of the hand in a level circle", abs(round_it[-1] - round_it[0]) / (2.0 * np.pi), 1.0),
            at_most("size of the path [m]", float(np.ptp(hand[:, :2], axis=0).max()), 0.35),
            at_most("distance of the pelvis from its median place [m]", s.roam, 0.4),
        ]

    return either_side(of)


def _at_the_head(s: MotionSignals, distance: float = 0.33) -> Flags:
    """(sample, 2) whether the hand is at the head, the other one lower than the chest"""
    return hand_at_head(s, distance) & np.stack([_low(s, 1), _low(s, 0)], axis=1)


@defines("brush_teeth", "A hand before the face goes to and fro, twice a second or more often, by little.")
def brush_teeth(s: MotionSignals) -> Requirements:
    def of(side: int) -> Requirements:
        there = _at_the_head(s)[:, side]
        hand = s.ahead(s.pair("wrist") - s.joint("head")[:, None])[:, side]
        moves = max(swings(hand[there, axis], 0.008) for axis in range(3)) if there.any() else 0
        return [
            at_least("share of time with the hand before the face", share(there & (hand[:, 0] > 0.0)), 0.6),
            at_least("moves of it a second", moves / max(there.sum() / 20.0, 1e-9), 3.0),
            at_most("spread of the hand [m]", float(hand[there].std(axis=0).max()) if there.any() else 1.0, 0.06),
        ]

    return either_side(of)


@defines("comb", "A hand over the head goes back over it, twice or more, the other one low.")
def comb(s: MotionSignals) -> Requirements:
    def of(side: int) -> Requirements:
        hand = s.ahead(s.pair("wrist") - s.joint("head")[:, None])[:, side]
        there = (hand[:, 2] > 0.0) & (s.hand_to_head[:, side] < 0.36) & _low(s, 1 - side)
        return [
            at_least("share of time with the hand over the head", share(there), 0.6),
            at_least("moves of it ahead and back by 6 cm", swings(hand[there, 0], 0.06) if there.any() else 0, 2),
        ]

    return either_side(of)


@defines("cough", "A hand at the mouth while the trunk jerks forward, twice or more.", "whether it is a sneeze")
def cough(s: MotionSignals) -> Requirements:
    def of(side: int) -> Requirements:
        there = _at_the_head(s)[:, side]
        bent = s.inclination[there] if there.any() else np.zeros(1)
        return [
            at_least("longest time with the hand before the mouth [s]", longest(there), 0.8),
            at_least("moves of the trunk by 3.5 degrees", swings(bent, 3.5), 2),
            at_most("highest inclination of the trunk [degrees]", s.inclination.max(), 60.0),
        ]

    return either_side(of)


@defines("knock", "A bent arm's hand ahead strikes forward by little, three times within 0.4 s of one another.")
def knock(s: MotionSignals) -> Requirements:
    def of(side: int) -> Requirements:
        hand = s.wrists[:, side]
        there = (hand[:, 0] > 0.2) & (hand[:, 2] > -0.3) & (s.elbow_flexion[:, side] > 20.0) & hanging(s)[:, 1 - side]
        ahead = np.where(there, hand[:, 0], np.median(hand[:, 0]))
        return [
            at_least("share of time with a bent arm's hand ahead, the other arm hanging", share(there), 0.5),
            at_least("moves of it ahead and back by 2 cm", swings(ahead, 0.02), 4),
            at_most("spread of the hand across [m]", float(hand[there, 1].std()) if there.any() else 1.0, 0.06),
        ]

    return either_side(of)


DEFINITIONS = tuple(each for each in list(globals().values()) if isinstance(each, Definition))
"""Actions of this module."""
