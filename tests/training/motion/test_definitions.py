"""Measurement of the definitions of actions, and their page."""

from __future__ import annotations

from pathlib import Path

import pytest

from rfgen_sionna.generative.action_definitions import DEFINED_ACTIONS, MotionSignals
from rfgen_sionna.generative.motion_library import MotionLibrary
from training.motion.definitions import half_of_subjects, measure, page, read_clips


def test_a_few_clips_are_measured_and_put_on_the_page() -> None:
    library = MotionLibrary()
    names = ("cmu_02_01", "cmu_09_01", "hdm05_bd_squat1Reps_001", "cmu_140_01_dm", "kaykit_Death_A")
    rates = measure(library, {name: MotionSignals(library.motion(name)) for name in names}, ["walk", "fall"])
    walk = rates["walk"]
    assert walk.true[0] + walk.true_before[0] == walk.true[1] + walk.true_before[1] == 1
    assert (
        walk.refused[0] + walk.refused_before[0] == walk.refused[1] + walk.refused_before[1] == 3
    )  # run, squat, get up
    fall = rates["fall"]
    assert fall.true[1] + fall.true_before[1] == 0  # a wrong caption counts neither way
    assert not walk.reliable  # one clip is too few
    text = page(library, rates)
    assert all(f"| `{action}` |" in text for action in DEFINED_ACTIONS)
    assert "`kaykit_Death_A`: falls, but" in text


def test_no_subject_is_in_both_halves() -> None:
    library = MotionLibrary()
    half = half_of_subjects(library)
    share = sum(clip.subject in half for clip in library) / len(library)
    assert 0.4 < share < 0.6


def test_unknown_actions_and_fields_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "clips.toml"
    path.write_text("[groups]\nmixed = []\n[actions.moonwalk]\nshown = []\ncompatible = []\n")
    with pytest.raises(ValueError, match="action 'moonwalk' has no definition"):
        read_clips(path)
    path.write_text("[groups]\nmixed = []\n[actions.walk]\nshown = []\ncompatible = []\nshwon = []\n")
    with pytest.raises(ValueError, match=r"walk\.shwon is unknown; allowed are"):
        read_clips(path)


def test_the_page_holds_every_definition_as_it_is() -> None:
    text = (Path(__file__).parents[3] / "docs" / "actions.md").read_text(encoding="utf-8")
    for action, definition in DEFINED_ACTIONS.items():
        assert f"| `{action}` | {definition.sentence}" in text, "run python -m training.motion.definitions"
