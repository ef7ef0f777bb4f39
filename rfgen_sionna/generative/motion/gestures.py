"""Gestures of one hand in front of the body whose way depends on the hand: swipes, circles, finger swing."""

from __future__ import annotations

import numpy as np

from rfgen_sionna.generative.manner import Manner
from rfgen_sionna.generative.motion.arm_actions import CIRCLES, FINGER_SWING, SWIPES
from rfgen_sionna.generative.motion.keyed_gesture import perform
from rfgen_sionna.generative.motion.skeleton import FINGERS, side_sign
from rfgen_sionna.generative.motion.tracks import MotionTracks


def swipe(tracks: MotionTracks, rng: np.random.Generator, hand: str, manner: Manner, towards: int) -> None:
    """A quick stroke of the open hand across the body; `towards` is +1 for the person's left."""
    perform(tracks, rng, hand, manner, SWIPES[side_sign(hand) * towards])


def circle(tracks: MotionTracks, rng: np.random.Generator, hand: str, manner: Manner, clockwise: bool) -> None:
    """Circles of the hand in a plane in front of the body; the sense is from the person's view."""
    perform(tracks, rng, hand, manner, CIRCLES[-side_sign(hand) * (1 if clockwise else -1)])


def finger_swing(tracks: MotionTracks, rng: np.random.Generator, hand: str, manner: Manner) -> None:
    """The raised index finger swings from side to side, from wrist and knuckle."""
    perform(tracks, rng, hand, manner, FINGER_SWING)
    wrist = tracks.hands[hand]
    if wrist.aim is not None:
        wrist.spread[:, FINGERS.index("index")] = -0.9 * wrist.aim[:, 0, 1]
