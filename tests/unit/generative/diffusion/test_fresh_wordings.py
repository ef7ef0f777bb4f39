"""Sentences written after everything that reads them: nothing was fitted to them, and none may be edited to pass."""

from __future__ import annotations

from rfgen_sionna.generative.diffusion.diffusion_source import DiffusionSource
from rfgen_sionna.generative.diffusion.phrasebook import CLAUSES

FRESH = {
    "walk": (
        "an elderly man paces up and down the hallway",
        "someone is strolling to and fro",
        "the woman keeps walking back and forth",
    ),
    "walk_straight": (
        "a boy walks straight towards the door",
        "the subject strides forward",
        "a person marches straight ahead",
    ),
    "jump": ("a girl hops up and down", "the man leaps into the air again and again", "someone jumping on the spot"),
    "jumping_jacks": (
        "a sportsman performs jumping jacks",
        "the person exercises with star jumps",
        "she does jumping jacks for warm-up",
    ),
    "pick_up": (
        "an adult crouches to pick a coin up from the floor",
        "he bends and lifts a box off the ground",
        "someone collects an object from the ground",
    ),
    "t_pose": (
        "the man stretches both arms sideways",
        "a human standing in T-pose",
        "arms held out horizontally to both sides",
    ),
    "y_pose": (
        "the woman raises both arms to form a Y",
        "a person holds two arms up in a Y shape",
        "both arms lifted up high like a Y",
    ),
    "left_arm_raised": ("the boy holds his left arm up", "a woman lifting the left hand above her head", "left arm up"),
    "right_arm_raised": (
        "the boy holds his right arm up",
        "a woman lifting the right hand above her head",
        "right arm up",
    ),
    "left_leg_raised": ("the girl lifts her left leg", "he keeps the left knee raised", "a man raising his left foot"),
    "right_leg_raised": (
        "the girl lifts her right leg",
        "he keeps the right knee raised",
        "a man raising his right foot",
    ),
    "swipe_left": (
        "he swipes towards the left",
        "swiping a hand leftwards",
        "the user makes a left swipe with the right hand",
    ),
    "swipe_right": (
        "he swipes towards the right",
        "swiping a hand rightwards",
        "the user makes a right swipe with the left hand",
    ),
    "push": (
        "the man pushes his hand away from him",
        "a user pushing forward with an open palm",
        "she makes a push gesture",
    ),
    "pull": ("the man pulls his hand towards his body", "a user pulling the hand back", "she makes a pull gesture"),
    "circle_clockwise": (
        "he draws a circle clockwise in the air",
        "the hand moves clockwise in circles",
        "a user circling the hand clockwise",
    ),
    "circle_counterclockwise": (
        "he draws a circle counterclockwise in the air",
        "the hand moves anticlockwise in circles",
        "a user circling the hand counter-clockwise",
    ),
    "click": (
        "she clicks with her index finger",
        "a user performing a click gesture in the air",
        "the man taps with one finger",
    ),
    "finger_swing": (
        "he swings his index finger from side to side",
        "a user wagging a finger",
        "the woman swings her finger",
    ),
    "standing": ("an old lady stands still", "the man is just standing there", "a person stays motionless"),
}


def test_fresh_wordings_are_read_as_their_action() -> None:
    """98 % were at first sight: crouching for a coin was taken for the captured clip of bending down."""
    assert set(FRESH) == set(CLAUSES)
    source = DiffusionSource()
    right = [source.read(prompt).action == action for action, prompts in FRESH.items() for prompt in prompts]
    assert sum(right) >= 0.95 * len(right)
