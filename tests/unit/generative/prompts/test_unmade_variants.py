"""Kinds of an action that no motion shows are refused, with the words."""

import numpy as np
import pytest

from rfgen_sionna.generative import perform, read_prompt
from rfgen_sionna.generative.manner import Manner
from rfgen_sionna.generative.motion.clip_editing import joint_places
from rfgen_sionna.generative.prompts.prompt_error import PromptError


@pytest.mark.parametrize(
    ("prompt", "words"),
    [
        ("a man lies down on his stomach", "on his stomach"),
        ("a person sits on the ground", "on the ground"),
        ("a student sits cross-legged", "cross legged"),
        ("a child sits on the wooden floor", "on the wooden floor"),
        ("a man sits in the lotus position", "lotus position"),
        ("a man crawls back", "back"),
        ("a man collapses face down", "face down"),
        ("a man kneels on both knees", "both knees"),
        ("a toddler crawls backwards", "backwards"),
        ("a woman bends backwards", "backwards"),
        ("a man raises his left arm forward", "forward"),
        ("a boy hops on one leg", "on one leg"),
        ("a man claps above his head", "above his head"),
        ("a man is pushed", "is pushed"),
        ("a man waves his legs", "waves his legs"),
        ("a man draws a circle with his foot", "with his foot"),
        ("a boy skips rope", "rope"),
        ("a man raises both legs", "both legs"),
        ("a man with three arms waves", "with three arms"),
        ("a man kicks back and relaxes", "kicks back"),
        ("a woman stands out", "stands out"),
        ("a man does push-ups on one hand", "on one hand"),
        ("a man bends his arm", "bends his arm"),
    ],
)
def test_a_kind_that_no_motion_shows_is_refused(prompt: str, words: str) -> None:
    with pytest.raises(PromptError, match=f"'{words}'"):
        read_prompt(prompt)


@pytest.mark.parametrize(
    ("prompt", "action"),
    [
        ("a patient sleeps on his back", "lie"),
        ("a man sits on a chair with both feet on the floor", "sit"),
        ("a baby crawls forwards", "crawl"),
        ("a man lies down on his back", "lie_down"),
        ("a man crawls back and forth", "crawl"),
        ("a man is sitting on a chair and stands up", "stand_up"),
        ("a man stands and then sits down", "sit_down"),
        ("a man sits down and stands up", "sit_and_stand"),
        ("a man lies curled up", "lie"),
        ("a man bends down", "bend"),
        ("a man raises his left arm", "left_arm_raised"),
        ("a person claps the hands in front of the body", "clap"),
        ("a man slips", "slip"),
        ("a man waves both arms above his head", "wave"),
        ("a man jumps with both feet", "jump"),
        ("a man kicks with his left foot", "left_kick"),
        ("a man lifts a box over his head", "lift"),
        ("a man stumbles forward", "stumble"),
        ("a jogger passes by", "run"),
        ("a jogger walks", "walk"),
    ],
)
def test_the_kind_that_is_made_is_read(prompt: str, action: str) -> None:
    assert read_prompt(prompt).action == action


def test_a_sprint_is_faster_than_a_run_unless_a_speed_is_given() -> None:
    speed = read_prompt("a man sprints").manner.speed
    assert speed is not None
    assert speed > 1.0
    assert read_prompt("a man runs").manner.speed is None
    assert read_prompt("a man sprints at 5 m/s").manner.speed_mps == 5.0


def test_the_way_that_somebody_points_is_named_as_without_effect() -> None:
    assert any("'at the ceiling'" in warning for warning in read_prompt("a man points at the ceiling").warnings)


@pytest.mark.parametrize(("prompt", "words"), [("a man waves twice", "twice"), ("a woman does three squats", "three")])
def test_a_number_of_repetitions_is_named_as_without_effect(prompt: str, words: str) -> None:
    assert any(f"'{words}'" in warning for warning in read_prompt(prompt).warnings)


@pytest.mark.parametrize(
    ("prompt", "lying"),
    [
        ("a man lies face down", "stomach"),
        ("a patient lies on her back", "back"),
        ("a woman lies on her left side", "left_side"),
        ("a man lies on the floor", None),
    ],
)
def test_the_part_of_the_body_that_somebody_lies_on_is_read(prompt: str, lying: str | None) -> None:
    said = read_prompt(prompt)
    assert said.manner.lying == lying
    assert not said.warnings


@pytest.mark.parametrize(
    ("lying", "up"), [("back", (1, 0)), ("stomach", (-1, 0)), ("left_side", (0, -1)), ("right_side", (0, 1))]
)
def test_somebody_lies_on_the_part_of_the_body_that_is_given(lying: str, up: tuple[int, int]) -> None:
    for seed in range(3):
        motion = perform("lie", 2.0, seed, manner=Manner(lying=lying))
        places = joint_places(motion)
        left = places[:, motion.joint_names.index("left_hip")] - places[:, motion.joint_names.index("right_hip")]
        front = np.cross(left, places[:, motion.joint_names.index("spine3")] - places[:, 0])
        chest, side = (np.mean(v[:, 2] / np.linalg.norm(v, axis=-1)) for v in (front, left))
        assert up[0] * chest + up[1] * side > 0.8
