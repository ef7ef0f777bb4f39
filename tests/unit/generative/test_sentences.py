"""Prompts beyond the grammar: composed and captured actions, and words that nobody knows."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np
import pytest

from rfgen_sionna.generative import Actor
from rfgen_sionna.generative.motion import ACTIONS, KinematicSource, MotionSource, SentenceSource
from rfgen_sionna.generative.prompts import PromptError, parse_prompt
from rfgen_sionna.generative.prompts.prompt_reader import NEAREST, motion_source, read_prompt

pytest.importorskip("diffusers", reason="the learned source needs it")
COMPOSED = "a person walks while raising the left arm"


@pytest.fixture(scope="module")
def source() -> SentenceSource:
    made = motion_source("diffusion")
    assert isinstance(made, SentenceSource)
    return made


@pytest.fixture(scope="module")
def body() -> Any:
    pytest.importorskip("anny", reason="people need the body model")
    from rfgen_sionna.generative.bodies import Phenotype, person

    return person(Phenotype(), seed=0)


def test_only_the_learned_source_reads_sentences() -> None:
    assert isinstance(KinematicSource(), MotionSource)
    assert not isinstance(KinematicSource(), SentenceSource)


@pytest.mark.parametrize(
    "prompt", ["a person walks", "someone raises an arm, facing left, at 2 m", "a tall woman swipes to the left slowly"]
)
def test_what_the_grammar_reads_is_not_read_anew(source: SentenceSource, prompt: str) -> None:
    for seed in range(3):
        assert read_prompt(prompt, seed=seed, source=source) == parse_prompt(prompt, seed=seed)


def test_arms_and_legs_of_one_sentence(source: SentenceSource) -> None:
    said = read_prompt(COMPOSED, source=source)
    assert (said.action, said.arms, said.sentence, said.warnings) == ("walk", "left_arm_raised", COMPOSED, ())
    said = read_prompt(f"{COMPOSED}, at 6 m, facing left, slowly, in an office", source=source)
    assert (said.action, said.arms, said.sentence) == ("walk", "left_arm_raised", COMPOSED)
    assert (said.distance_m, said.orientation_deg, said.speed, said.surroundings) == (6.0, 90.0, 0.7, "office")
    assert "left_arm_raised: raises the left arm" in said.report()
    there = read_prompt("a person walks towards the radar while holding up the right arm", source=source)
    assert (there.action, there.arms, there.orientation_deg) == ("walk_straight", "right_arm_raised", 0.0)


def test_what_a_sentence_leaves_open_is_drawn_and_forbidden(source: SentenceSource) -> None:
    open_ = "a person walks while raising an arm"
    drawn = {read_prompt(open_, seed=seed, source=source).arms for seed in range(8)}
    assert drawn == {"left_arm_raised", "right_arm_raised"}
    for seed in range(4):
        said = read_prompt(open_, "left arm", seed=seed, source=source)
        assert (said.arms, said.avoid) == ("right_arm_raised", "left arm")
    for negative in ("left arm", "walking"):
        with pytest.raises(PromptError, match=f"negative prompt '{negative}' forbids"):
            read_prompt(COMPOSED, negative, source=source)


def test_captured_actions_are_reached_by_their_words(source: SentenceSource) -> None:
    said = read_prompt("a person dances, 4 m away, facing away", source=source)
    assert (said.action, said.sentence, said.warnings) == ("dance_modern", "a person dances", ())
    assert (said.distance_m, said.orientation_deg) == (4.0, 180.0)
    # walking is the grammar's, but the rest of the words is not
    said = read_prompt("a person walks like a zombie", source=source)
    assert (said.action, said.unused) == ("zombie", ())
    with pytest.raises(PromptError, match="forbids dance_modern"):
        read_prompt("a person dances", "modern dance", source=source)


def test_words_that_nobody_knows_are_the_nearest_action(source: SentenceSource) -> None:
    said = read_prompt("a tall man rides a unicycle, at 2 m", source=source)
    assert said.action in ACTIONS
    assert (said.distance_m, said.body.gender, said.sentence) == (2.0, "male", "")
    assert said.origins["action"] == NEAREST
    assert f"taken for the nearest action that is known, {said.action!r}" in said.warnings[0]
    assert "prompt: 'unicycle' was not understood and has no effect" in said.warnings
    several = read_prompt("a person walks and jumps", source=source)
    assert several.action in ("walk", "jump")
    assert "names several ('walks', 'jumps'); taken for the nearest" in several.warnings[0]


@pytest.mark.parametrize(
    "prompt",
    [
        "",
        "a person",
        "a person at 3 m",
        "two people dance",
        "an elephant runs",
        "asdf",
        "a person dances at 2 m and at 3 m",
        "no jumping",
    ],
)
def test_what_no_source_can_help(source: SentenceSource, prompt: str) -> None:
    with pytest.raises(PromptError):
        read_prompt(prompt, source=source)


def test_rules_of_movement_name_what_they_know_and_who_knows_more() -> None:
    with pytest.raises(PromptError, match=r"names several \('raising the left arm', 'walks'\); name one.*'diffusion'"):
        read_prompt(COMPOSED)
    with pytest.raises(PromptError, match=r"names none that is known.*jumping jacks.*motion 'diffusion'"):
        read_prompt("a person dances")
    said = read_prompt(COMPOSED, source="diffusion")
    with pytest.raises(PromptError, match="needs a motion source that reads sentences"):
        Actor.from_prompt(said)


def test_people_do_what_sentences_say(source: SentenceSource, body: Any, caplog: pytest.LogCaptureFixture) -> None:
    how: dict[str, Any] = {"seed": 1, "duration": 3.0, "body": body, "source": source}
    with caplog.at_level(logging.WARNING):
        person = Actor.from_prompt(f"{COMPOSED}, facing left", **how)
    assert caplog.text == ""
    assert person.motion is not None
    assert person.motion.action == "walk"
    assert np.ptp(person.motion.translation[:, 0]) > 0.3
    names = list(person.joint_names)
    heights = np.median([person.joints(t)[:, 2] for t in np.linspace(0.3, 2.7, 9)], axis=0)
    assert heights[names.index("left_wrist")] > heights[names.index("head")] - 0.1
    assert heights[names.index("right_wrist")] < heights[names.index("right_shoulder")] - 0.2
    assert person.decisions[2].value == "left_arm_raised: raises the left arm"
    made: Any = source
    alone = made.generate(COMPOSED, duration=3.0, seed=1, skeleton=body.skeleton)
    np.testing.assert_array_equal(person.motion.rotations, alone.rotations)
    # another seed is another motion
    other = Actor.from_prompt(COMPOSED, **(how | {"seed": 2}))
    assert other.motion is not None
    assert not np.allclose(other.motion.rotations, person.motion.rotations, atol=1e-3)


def test_an_action_by_its_name_is_as_ever(source: SentenceSource, body: Any) -> None:
    person = Actor.from_prompt("a person jumps", seed=3, duration=1.5, body=body, source=source)
    assert person.motion is not None
    named = source("jump", 1.5, 3, skeleton=body.skeleton)
    np.testing.assert_array_equal(person.motion.rotations, named.rotations)


def test_the_model_is_told_what_words_mean(source: SentenceSource) -> None:
    made: Any = source
    straight = made.generate(COMPOSED, duration=3.0, seed=1, action="walk_straight", arms="right_arm_raised")
    assert straight.action == "walk_straight"
    assert straight.translation[-1, 0] - straight.translation[0, 0] > 1.5
    with pytest.raises(ValueError, match="action: 'fly' is unknown to the motion model; allowed are walk"):
        made.generate(COMPOSED, duration=1.0, action="fly")
    with pytest.raises(ValueError, match="arms: 'jump' is unknown to the motion model; allowed are left_arm_raised"):
        made.generate(COMPOSED, duration=1.0, action="walk", arms="jump")
