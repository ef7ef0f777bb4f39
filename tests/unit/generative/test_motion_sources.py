"""Sources of motion by name, and what rules alone cannot do."""

from __future__ import annotations

import pytest

from rfgen_sionna.generative.decisions import DEFAULT
from rfgen_sionna.generative.manner import Manner
from rfgen_sionna.generative.motion import MEAN_ADULT, KinematicSource
from rfgen_sionna.generative.motion_sources import check_source, motion_source, performed_motion
from rfgen_sionna.generative.performing import PerformingSource
from rfgen_sionna.generative.person_decisions import motion_decision
from rfgen_sionna.generative.prompts.prompt_error import PromptError
from rfgen_sionna.generative.prompts.scene_prompt import ScenePrompt


def prompt(action: str, manner: Manner | None = None, arms: str = "") -> ScenePrompt:
    return ScenePrompt(text=action, negative="", seed=0, action=action, manner=manner or Manner(), arms=arms)


def test_sources_have_names() -> None:
    assert isinstance(motion_source("auto"), PerformingSource)
    assert isinstance(motion_source("kinematic"), KinematicSource)
    with pytest.raises(ValueError, match="'magic'; allowed are 'kinematic', 'diffusion' and 'auto'"):
        motion_source("magic")


@pytest.mark.parametrize(
    ("said", "words"),
    [
        (prompt("cartwheel"), "cannot do 'cartwheel'"),
        (prompt("walk", arms="wave"), "cannot do 'walk' with the arms of 'wave'"),
        (prompt("walk", Manner(path="circle")), "cannot do 'walk' along the path 'circle'"),
        (prompt("walk", Manner(pauses=True)), "cannot do 'walk' with pauses"),
        (prompt("standing", Manner(arm_posture="folded")), "cannot do 'standing' with arms held 'folded'"),
    ],
)
def test_rules_alone_refuse_what_they_lack_and_clips_do_it(said: ScenePrompt, words: str) -> None:
    with pytest.raises(PromptError, match=words):
        check_source(said, 3.0, KinematicSource())
    check_source(said, 3.0, PerformingSource())


def test_rules_walk_to_and_fro_under_that_name() -> None:
    said = prompt("walk_to_and_fro", Manner(path="to_and_fro"))
    check_source(said, 4.0, KinematicSource())
    assert performed_motion(said, 4.0, 0, MEAN_ADULT, KinematicSource()).action == "walk_to_and_fro"


def test_manner_and_arms_reach_the_source() -> None:
    said = prompt("walk", Manner(path="straight", speed_mps=0.8), arms="wave")
    motion = performed_motion(said, 4.0, 0, MEAN_ADULT, PerformingSource())
    way = motion.translation[-1] - motion.translation[0]
    assert abs(way[0]) / 4.0 == pytest.approx(0.8, rel=0.15)
    assert abs(way[1]) < 0.2


def test_a_report_names_the_strength_of_a_source() -> None:
    for strength, words in ((None, "auto, clips"), (0.0, "auto, strength 0, clips")):
        source = PerformingSource(strength)
        decision = motion_decision(source, source("squat", 2.0, 0))
        assert decision.value.startswith(words)
        assert (decision.origin == DEFAULT) == (strength is None)
