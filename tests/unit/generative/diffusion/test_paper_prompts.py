"""The actions that RF Genesis asks for, said as one would type them: from a sentence to a person who does it."""

from __future__ import annotations

from collections.abc import Iterable

import pytest

pytest.importorskip("anny")
pytest.importorskip("diffusers")

from rfgen_sionna.generative.actor import Actor, motion_source
from rfgen_sionna.generative.bodies import Rig, person
from rfgen_sionna.generative.diffusion.understanding import Understanding
from rfgen_sionna.generative.motion import ACTIONS
from rfgen_sionna.generative.prompts import parse_prompt
from training.motion.exam_prompts import OUTSIDE

PROMPTS = {
    "walk": ("a person walking back and forth", "a person walks back and forth in a repetitive manner"),
    "jump": ("a person jumping", "jump"),
    "jumping_jacks": ("a person doing jumping jacks", "jumping jacks in a repetitive manner"),
    "pick_up": ("a person picking up an item from the ground", "pick up"),
    "t_pose": ("a person in a T pose", "T-pose"),
    "y_pose": ("a person in a Y pose", "Y-pose"),
    "left_arm_raised": ("a person with the left arm raised", "left arm raised"),
    "right_arm_raised": ("a person with the right arm raised", "right arm raised"),
    "left_leg_raised": ("a person with the left leg raised", "left leg raised"),
    "right_leg_raised": ("a person with the right leg raised", "right leg raised"),
    "swipe_left": ("a person swiping left", "swipe left in a repetitive manner"),
    "swipe_right": ("a person swiping right", "swipe right"),
    "push": ("a person pushing", "push in a repetitive manner"),
    "pull": ("a person pulling", "pull"),
    "circle_clockwise": ("a person drawing a circle clockwise", "circle clockwise"),
    "circle_counterclockwise": ("a person drawing a circle counter-clockwise", "circle counter-clockwise"),
    "click": ("a person clicking", "click"),
    "finger_swing": ("a person swinging a finger", "finger swing"),
    "standing": ("a person standing", "standing"),
}


QUICK = ("walk", "push", "t_pose", OUTSIDE[1])


def quick_first(names: Iterable[str]) -> list[object]:
    """Parameters of which all but a few are slow."""
    return [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in names]


@pytest.fixture(scope="module")
def rig() -> Rig:
    return person(seed=0)


@pytest.mark.parametrize("action", quick_first(PROMPTS))
def test_prompts_give_their_action_whoever_moves_them(rig: Rig, action: str) -> None:
    for motion in ("kinematic", "diffusion"):
        actor = Actor.from_prompt(PROMPTS[action][0], motion=motion, body=rig, duration=1.6, seed=1)
        assert actor.motion is not None
        assert actor.motion.action == action


@pytest.mark.parametrize("action", PROMPTS)
def test_words_are_read_the_same_with_and_without_the_model(action: str) -> None:
    said = parse_prompt(PROMPTS[action][1])
    assert said.action == action
    assert not said.warnings
    read = motion_source("diffusion").read  # type: ignore[attr-defined]
    for prompt in PROMPTS[action]:
        understood: Understanding = read(prompt)
        assert understood.action == action
        assert understood.known


@pytest.mark.parametrize("prompt", quick_first([*OUTSIDE[:4], "a person dancing tango"]))
def test_prompts_outside_get_the_nearest_action_and_are_told(
    rig: Rig, prompt: str, caplog: pytest.LogCaptureFixture
) -> None:
    actor = Actor.from_prompt(prompt, motion="diffusion", body=rig, duration=1.6)
    assert actor.motion is not None
    assert actor.motion.action in ACTIONS
    assert f"taken for the nearest action that is known, '{actor.motion.action}'" in caplog.text
