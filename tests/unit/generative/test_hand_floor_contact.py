"""Hands stop at the floor, smoothly, and nothing else moves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.motion import MEAN_ADULT, KinematicSource
from rfgen_sionna.generative.motion.floor_contact import keep_hands_above_floor
from rfgen_sionna.generative.motion.rotations import to_matrices
from rfgen_sionna.generative.motion.skeleton import JOINT, forward_kinematics, global_rotations
from rfgen_sionna.records import Motion

REACH = KinematicSource(60.0)("pick_up", 4.0, 2)


def positions(motion: Motion) -> FloatArray:
    world = global_rotations(to_matrices(motion.rotations), motion.parents)
    return forward_kinematics(world, motion.translation, motion.offsets, motion.parents)


def test_hands_stop_at_the_floor() -> None:
    sunk = replace(REACH, translation=REACH.translation - [0.0, 0.0, 0.08])
    fingers = [j for name, j in JOINT.items() if name.endswith("3") and "spine" not in name]
    before, raised = positions(sunk), keep_hands_above_floor(sunk, MEAN_ADULT)
    after = positions(raised)
    assert before[:, fingers, 2].min() < -0.015
    assert after[:, fingers, 2].min() > 0.01
    # arms alone move, only where a hand is low, and as smoothly as before
    rest = [j for name, j in JOINT.items() if not any(part in name for part in ("elbow", "wrist"))]
    rest = [j for j in rest if not any(f in sunk.joint_names[j] for f in ("thumb", "index", "middle", "ring", "pinky"))]
    assert np.allclose(after[:, rest], before[:, rest], atol=1e-9)
    low = np.flatnonzero(before[:, fingers, 2].min(axis=1) < 0.03)
    apart = np.abs(np.arange(len(before))[:, None] - low).min(axis=1)
    # a second away from the floor nothing is left of it
    assert (apart > 60).any()
    assert np.array_equal(raised.rotations[apart > 60], sunk.rotations[apart > 60])
    kink = [np.abs(np.diff(m.rotations, n=3, axis=0)).max() for m in (sunk, raised)]
    assert kink[1] < 2.0 * kink[0]


def test_motion_over_the_floor_stays_as_it_is() -> None:
    assert np.array_equal(keep_hands_above_floor(REACH, MEAN_ADULT).rotations, REACH.rotations)
