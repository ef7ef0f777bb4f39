"""The motions of RF Genesis (Chen and Zhang, SenSys 2023) are read in its wording, with its ranges and repetitions."""

from __future__ import annotations

import pytest

from rfgen_sionna.generative.prompts import read_prompt

MOTIONS = {
    "walk_to_and_fro": ("walking back and forth",),
    "jump": ("jumping", "jumping up and down"),
    "jumping_jacks": ("doing jumping jacks",),
    "pick_up": ("picking up an item from the ground", "picking up an item"),
    "t_pose": ("in a T pose", "in T pose"),
    "y_pose": ("in a Y pose", "in Y pose"),
    "left_arm_raised": ("with the left arm raised", "with left arm raised"),
    "right_arm_raised": ("with the right arm raised", "with right arm raised"),
    "left_leg_raised": ("with the left leg raised", "with left leg raised"),
    "right_leg_raised": ("with the right leg raised", "with right leg raised"),
    "left_arm_horizontal": ("with only the left hand raised horizontally", "with only left hand raised horizontally"),
    "right_arm_horizontal": ("with only the right hand raised horizontally",),
    "swipe_left": ("swiping left", "swiping the hand to the left"),
    "swipe_right": ("swiping right",),
    "push": ("pushing", "pushing the hand forward"),
    "pull": ("pulling", "pulling the hand back"),
    "circle_clockwise": ("drawing a circle clockwise", "drawing a clockwise circle"),
    "circle_counterclockwise": ("drawing a circle counterclockwise", "drawing a counter-clockwise circle"),
    "click": ("clicking", "clicking with the index finger"),
    "finger_swing": ("swinging a finger", "swinging the index finger"),
    "standing": ("standing", "standing still"),
}
"""Action -> participles after "a person" and "A person is"."""
FRAMES = (
    pytest.param("a person {}", marks=pytest.mark.slow),
    "A person {} in a repetitive manner",
    "a person {}, random orientation range from 0-90 degrees",
    pytest.param("a person {}, facing the radar", marks=pytest.mark.slow),
)


@pytest.mark.parametrize("frame", FRAMES)
@pytest.mark.parametrize("action", MOTIONS)
def test_the_motions_of_the_paper_are_read(action: str, frame: str) -> None:
    for words in MOTIONS[action]:
        said = read_prompt(frame.format(words))
        assert said.choices == (action,), words
        assert not [phrase for phrase in said.unused if phrase != "in a repetitive manner"]


def test_a_random_range_of_orientations_is_drawn_by_the_seed() -> None:
    text = "a person walking back and forth in a repetitive manner, random orientation range from 0-90 degrees"
    angles = [read_prompt(text, seed=seed).orientation_deg for seed in range(40)]
    assert all(angle is not None and 0.0 <= angle <= 90.0 for angle in angles)
    assert len(set(angles)) == 40
    assert min(angle for angle in angles if angle is not None) < 20.0
    assert max(angle for angle in angles if angle is not None) > 70.0
    report = read_prompt(text, seed=3).report()
    assert f"{angles[3]:g}°" in report
    assert "drawn from 0 to 90° (seed 3)" in report
    facing = read_prompt(f"{text}, facing the radar", seed=3)
    assert facing.orientation_deg == angles[3]
