"""Arms of one motion over the legs and the trunk of another one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.motion.clip_editing import at_times, headings
from rfgen_sionna.generative.motion.rotations import continuous, to_matrices
from rfgen_sionna.generative.motion.skeleton import (
    FINGERS,
    JOINT,
    JOINT_NAMES,
    NUM_BODY_JOINTS,
    PARENTS,
    SIDES,
    Skeleton,
    global_rotations,
)
from rfgen_sionna.records import Motion

_ARM = ("collar", "shoulder", "elbow", "wrist")
_CURL = 0.3
"""Flexion of each joint of a relaxed finger [rad]."""
_LEGS = tuple(JOINT[f"{side}_{name}"] for side in SIDES for name in ("hip", "knee", "ankle", "foot"))


def with_fingers(motion: Motion, skeleton: Skeleton) -> Motion:
    """The motion with the 52 joints of `skeleton`; fingers that it lacks are relaxed."""
    if len(motion.joint_names) == len(JOINT_NAMES):
        return motion
    rotations = np.zeros((len(motion.translation), len(JOINT_NAMES), 4))
    rotations[..., 3] = 1.0
    rotations[:, : motion.rotations.shape[1]] = motion.rotations
    for side, sign in zip(SIDES, (-1.0, 1.0), strict=True):
        for finger in FINGERS:
            if finger != "thumb":
                curl = Rotation.from_rotvec([sign * _CURL, 0.0, 0.0]).as_quat()
                rotations[:, [JOINT[f"{side}_{finger}{k}"] for k in (1, 2, 3)]] = curl
    return replace(motion, rotations=rotations, joint_names=JOINT_NAMES, parents=PARENTS, offsets=skeleton.offsets)


def with_arms(motion: Motion, arms: Motion, skeleton: Skeleton) -> Motion:
    """The motion with the arms and hands of another one, turned with the chest, as upright as there.

    Args:
        motion: legs and trunk.
        arms: as long or longer; of any rate.
        skeleton: of the result, 52 joints.
    """
    base, other = with_fingers(motion, skeleton), with_fingers(arms, skeleton)
    other = at_times(other, np.arange(len(base.translation)) / base.frame_rate)
    lean = [_mean(_upright_chest(each)) for each in (base, other)]
    turn = Rotation.from_matrix(lean[0].T @ lean[1])
    rotations = base.rotations.copy()
    for side in SIDES:
        taken = [JOINT[f"{side}_{name}"] for name in _ARM] + [
            k for k, name in enumerate(JOINT_NAMES) if k >= NUM_BODY_JOINTS and name.startswith(side)
        ]
        rotations[:, taken] = other.rotations[:, taken]
        collar = JOINT[f"{side}_collar"]
        rotations[:, collar] = (turn * Rotation.from_quat(rotations[:, collar])).as_quat()
    return replace(base, rotations=continuous(rotations))


def _upright_chest(motion: Motion) -> FloatArray:
    """(frame, 3, 3) orientations of the chest, without the heading of the pelvis."""
    chest = global_rotations(to_matrices(motion.rotations), motion.parents)[:, JOINT["spine3"]]
    facing = Rotation.from_rotvec(-headings(motion)[:, None] * np.array([0.0, 0.0, 1.0])).as_matrix()
    return facing @ chest


def _mean(rotations: FloatArray) -> FloatArray:
    u, _, v = np.linalg.svd(rotations.mean(axis=0))
    return u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v


def standing_still(motion: Motion, skeleton: Skeleton) -> Motion:
    """The arms, trunk and head of a motion over legs that stand: what its arms do, whatever the legs do."""
    rotations = motion.rotations.copy()
    rotations[:, _LEGS] = [0.0, 0.0, 0.0, 1.0]
    rotations[:, 0] = [0.0, 0.0, 0.0, 1.0]
    translation = np.tile([0.0, 0.0, skeleton.standing_height()], (len(rotations), 1))
    return replace(motion, rotations=rotations, translation=translation, contacts=np.ones((len(rotations), 2), bool))


def stooped(motion: Motion, trunk: float, head: float) -> Motion:
    """The motion with the trunk bent by `trunk` and the head by `head` [rad] further."""
    rotations = motion.rotations.copy()
    for names, angle in ((("spine1", "spine2", "spine3"), trunk / 3.0), (("neck", "head"), head / 2.0)):
        bend = Rotation.from_rotvec([0.0, angle, 0.0])
        for name in names:
            rotations[:, JOINT[name]] = (Rotation.from_quat(rotations[:, JOINT[name]]) * bend).as_quat()
    return replace(motion, rotations=continuous(rotations))
