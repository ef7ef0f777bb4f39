"""Planted feet stand still, swinging ones clear the floor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rfgen_sionna.generative.motion import MEAN_ADULT, KinematicSource
from rfgen_sionna.generative.motion.clip_editing import joint_places
from rfgen_sionna.generative.motion.foot_lock import lock_feet
from rfgen_sionna.generative.motion.resampling import runs
from rfgen_sionna.generative.motion.skeleton import JOINT
from rfgen_sionna.records import Motion

TOES = [JOINT["left_foot"], JOINT["right_foot"]]


def slide(motion: Motion) -> float:
    toes = joint_places(motion)[:, TOES, :2]
    return float(np.linalg.norm(np.diff(toes, axis=0), axis=-1).mean() * motion.frame_rate)


def test_locked_feet_stand_still() -> None:
    standing = KinematicSource(20.0)("standing", 4.0, 3)
    rng = np.random.default_rng(0)
    n = len(standing.translation)
    sway = 0.03 * np.sin(np.arange(n) / 5.0) + 0.002 * rng.standard_normal(n)
    sliding = replace(standing, translation=standing.translation + sway[:, None] * [1.0, 0.0, 0.0])
    locked = lock_feet(sliding)
    assert slide(sliding) > 0.05
    assert slide(locked) < 0.002
    assert locked.contacts is not None
    assert locked.contacts.all()


def test_swinging_feet_clear_the_floor_and_none_is_under_it() -> None:
    walk = KinematicSource(20.0)("walk", 4.0, 3)
    sunk = lock_feet(replace(walk, translation=walk.translation - [0.0, 0.0, 0.05]))
    toes = joint_places(sunk)[:, TOES, 2] - MEAN_ADULT.toe_height
    assert toes.min() > -0.005
    assert np.abs(sunk.translation[:, 2] - walk.translation[:, 2]).max() < 0.02


def test_runs_are_the_stretches_of_true() -> None:
    assert runs(np.array([True, True, False, True])) == [(0, 2), (3, 4)]
    assert runs(np.zeros(3, bool)) == []
