"""Figures of what is performed beside the library's clips."""

from __future__ import annotations

import json
import re
from dataclasses import asdict, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from rfgen_sionna.generative.action_definitions import MotionSignals
from rfgen_sionna.generative.motion import KinematicSource
from rfgen_sionna.generative.motion_library import MotionLibrary
from training.motion.action_recogniser import ActionRecogniser
from training.motion.action_report import ClipReference, depth, extremity_speed, measure_action, standing_slide
from training.motion.action_table import performed_lines, table
from training.motion.alignment import aligned_distance, mirrored_poses, poses

KICKS = ("hdm05_bd_kickLFront1Reps_001", "hdm05_bd_kickLFront1Reps_002", "hdm05_dg_kickLFront1Reps_018")


@cache
def signals(name: str) -> MotionSignals:
    return MotionSignals(MotionLibrary().motion(name))


def test_a_delay_and_another_pace_are_aligned_away() -> None:
    rows = poses(signals("hdm05_bd_squat1Reps_007"))
    slow = rows[np.minimum(np.arange(2 * len(rows)) // 2, len(rows) - 1)]
    late = np.concatenate([np.repeat(rows[:1], 7, axis=0), rows])
    for other in (rows, late, slow[::2]):
        assert aligned_distance(rows, other) == pytest.approx(0.0, abs=1e-9)
    assert aligned_distance(slow, rows) == pytest.approx(0.0, abs=1e-9)


def test_the_distance_is_that_of_joints_in_metres() -> None:
    rows = poses(signals("hdm05_bd_squat1Reps_007"))
    moved = rows + np.tile([0.0, 0.03, 0.04], 22)
    assert aligned_distance(rows, moved) <= 0.05
    assert aligned_distance(rows[:1], moved[:1]) == pytest.approx(0.05)
    assert aligned_distance(rows, poses(signals(KICKS[0]))) > 0.1


def test_mirrored_twice_is_as_before() -> None:
    rows = poses(signals(KICKS[0]))
    np.testing.assert_allclose(mirrored_poses(mirrored_poses(rows)), rows)
    assert aligned_distance(rows, mirrored_poses(rows)) > 0.1  # the other leg kicks


def test_speed_slide_and_depth_are_of_the_floor_and_the_limbs() -> None:
    stand = KinematicSource(frame_rate=40.0)("standing", 3.0, 0)
    still = MotionSignals(stand)
    assert extremity_speed(still, 2.0) < 0.1
    assert standing_slide(still) == pytest.approx(0.0, abs=0.01)
    assert depth(still) < 0.01
    gliding = stand.translation + np.linspace(0.0, 0.9, len(stand.translation))[:, None] * [1.0, 0.0, 0.0]
    glide = MotionSignals(replace(stand, translation=gliding, contacts=None))
    assert standing_slide(glide) == pytest.approx(0.3, rel=0.05)
    assert extremity_speed(glide, 2.0) == pytest.approx(0.3, rel=0.3)
    sunk = MotionSignals(replace(stand, translation=stand.translation - [0.0, 0.0, 0.1], contacts=None))
    assert depth(sunk) == pytest.approx(depth(still) + 0.1, abs=0.02)


def test_figures_of_kicks(tmp_path: Path) -> None:
    figures = measure_action("left_kick", 2, 2.0, ClipReference(KICKS))
    assert figures.clips == 3
    assert figures.subjects == 2
    assert figures.true == 1.0
    assert figures.speed_ratio == pytest.approx(1.0, abs=0.5)
    assert figures.variety_ratio is None  # two people are too few
    assert figures.nearest is not None
    assert 0.0 < figures.nearest < 0.5
    lines = table(json.loads(json.dumps({"left_kick": asdict(figures)})))
    assert len(lines) == 3
    assert lines[2].startswith("| `left_kick` | ")
    assert len({line.count("|") for line in lines}) == 1
    metrics = tmp_path / "metrics.json"
    assert performed_lines(metrics) == []
    metrics.write_text(json.dumps({"duration": 2.0, "actions": {"left_kick": asdict(figures)}}))
    assert performed_lines(metrics)[-1] == lines[2]


@pytest.mark.slow
def test_a_recogniser_names_what_other_people_do() -> None:
    chosen = {"squat": "squat1Reps", "lie_down": "lieDownFloor"}
    known = [
        clip
        for action, name in chosen.items()
        for clip in [c for c in MotionLibrary().actions[action] if re.match(f"hdm05_b[dk]_{name}", c.name)][:4]
    ]
    recogniser = ActionRecogniser(known, {c.name: signals(c.name) for c in known})
    assert recogniser.actions == {"squat", "lie_down"}
    assert recogniser.name(signals("hdm05_tr_squat1Reps_050")) == "squat"
    assert recogniser.name(signals("hdm05_tr_lieDownFloor_019")) == "lie_down"
