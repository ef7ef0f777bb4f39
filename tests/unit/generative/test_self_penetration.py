"""Arms give way to the trunk, and only where they have to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.motion import MEAN_ADULT, KinematicSource
from rfgen_sionna.generative.motion.floor_contact import separate_arms_from_trunk
from rfgen_sionna.generative.motion.rotations import to_matrices
from rfgen_sionna.generative.motion.skeleton import JOINT, SIDES, forward_kinematics, global_rotations, side_sign
from rfgen_sionna.records import Motion

STANDING = KinematicSource(20.0)("standing", 2.0, 1)


def outwards(motion: Motion) -> FloatArray:
    """(frame, 2) how far each wrist is outside of its shoulder, over how far it is below it, seen from the chest."""
    world = global_rotations(to_matrices(motion.rotations), motion.parents)
    places = forward_kinematics(world, motion.translation, motion.offsets, motion.parents)
    chest = world[:, JOINT["spine3"]]
    out = []
    for side in SIDES:
        reach = places[:, JOINT[f"{side}_wrist"]] - places[:, JOINT[f"{side}_shoulder"]]
        seen = np.einsum("nji,nj->ni", chest, reach)
        out.append(side_sign(side) * seen[:, 1] / -seen[:, 2])
    return np.stack(out, axis=-1)


def test_hanging_arms_are_turned_out_of_the_trunk() -> None:
    rotations = STANDING.rotations.copy()
    j = JOINT["left_shoulder"]
    # the left arm is turned inwards by twenty degrees
    inwards = Rotation.from_euler("x", -20.0, degrees=True)
    rotations[:, j] = (Rotation.from_quat(rotations[:, j]) * inwards).as_quat()
    crossed = replace(STANDING, rotations=rotations)
    assert outwards(crossed)[:, 0].max() < 0.0
    freed = separate_arms_from_trunk(crossed, MEAN_ADULT)
    assert outwards(freed)[:, 0].min() > 0.9 * MEAN_ADULT.arm_slope
    others = [k for k in range(len(freed.parents)) if k not in (JOINT["left_shoulder"], JOINT["right_shoulder"])]
    assert np.array_equal(freed.rotations[:, others], STANDING.rotations[:, others])


def test_arms_that_are_clear_stay() -> None:
    for action in ("t_pose", "left_arm_raised"):
        motion = KinematicSource(20.0)(action, 2.0, 1)
        turn = np.abs(np.sum(separate_arms_from_trunk(motion, MEAN_ADULT).rotations * motion.rotations, axis=-1)).min()
        assert np.degrees(2.0 * np.arccos(min(turn, 1.0))) < 1.5
