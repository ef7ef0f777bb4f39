"""Retargeting of a motion to a rigged body: bone rotations from joint rotations, root path scaled to the legs."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.bodies.rig import Rig
from rfgen_sionna.generative.motion.rotations import about, normalised, to_matrices, transpose, twist_angle
from rfgen_sionna.generative.motion.skeleton import (
    JOINT,
    JOINT_NAMES,
    NUM_BODY_JOINTS,
    PARENTS,
    SIDES,
    Skeleton,
    global_rotations,
)
from rfgen_sionna.records import Motion

RELAXED_CURL = 0.3
"""Flexion of each finger joint of a motion without fingers [rad]: a relaxed hand."""


def same_proportions(motion: Motion, skeleton: Skeleton) -> bool:
    """Whether the motion has exactly this skeleton, or its 22 joints of the body."""
    count = len(motion.offsets)
    same = count in (NUM_BODY_JOINTS, len(skeleton.offsets)) and motion.joint_names == skeleton.joint_names[:count]
    return same and bool(np.allclose(motion.offsets, skeleton.offsets[:count], atol=1e-6))


def joint_rotations(motion: Motion) -> FloatArray:
    """(frame, 52, 3, 3) world rotations of all joints relative to the T-pose.

    Missing joints follow their parents; missing fingers are relaxed.

    Raises:
        ValueError: unknown joint names, or no pelvis.
    """
    unknown = [name for name in motion.joint_names if name not in JOINT]
    if unknown or "pelvis" not in motion.joint_names:
        raise ValueError(
            f"motion.joint_names: {unknown or 'pelvis missing'}; allowed are SMPL-H's names: {', '.join(JOINT_NAMES)}"
        )
    world = global_rotations(to_matrices(motion.rotations), motion.parents)
    out = np.empty((len(world), len(JOINT_NAMES), 3, 3))
    have = {name: i for i, name in enumerate(motion.joint_names)}
    for j, name in enumerate(JOINT_NAMES):
        if name in have:
            out[:, j] = world[:, have[name]]
            continue
        out[:, j] = out[:, PARENTS[j]]
        side, _, rest = name.partition("_")
        if rest[:-1] in ("index", "middle", "ring", "pinky"):
            axis = np.array([-1.0 if side == "left" else 1.0, 0.0, 0.0])
            out[:, j] = out[:, j] @ about(axis, RELAXED_CURL)
    return out


def root_translation(motion: Motion, skeleton: Skeleton) -> FloatArray:
    """(frame, 3) pelvis positions [m], heights and distances from the start in proportion to the legs."""
    if same_proportions(motion, skeleton):
        return motion.translation.copy()
    names = motion.joint_names
    legs = [
        np.linalg.norm(motion.offsets[names.index(f"{s}_{j}")])
        for s in SIDES
        for j in ("knee", "ankle")
        if f"{s}_{j}" in names
    ]
    if len(legs) < 4:
        return motion.translation.copy()
    start = motion.translation[0] * [1.0, 1.0, 0.0]
    return np.asarray(start + (motion.translation - start) * (skeleton.leg_length() / (0.5 * float(np.sum(legs)))))


def bone_rotations(rig: Rig, joints: FloatArray) -> FloatArray:
    """(frame, bone, 3, 3) world rotations relative to the mesh's rest pose, from (frame, 52, 3, 3) joint rotations.

    Bones between two joints share their rotation: along the spine, and the twist of forearm and upper arm.
    """
    out = joints[:, rig.bone_joints] @ rig.to_t_pose
    index = {name: b for b, name in enumerate(rig.bone_names)}
    if "spine04" not in index:
        return out
    for bone, lower, upper in (("spine04", "spine1", "spine2"), ("neck02", "neck", "head")):
        out[:, index[bone]] = _halfway(joints[:, JOINT[lower]], joints[:, JOINT[upper]]) @ rig.to_t_pose[index[bone]]
    for side in SIDES:
        d = {"left": ".L", "right": ".R"}[side]
        axis = normalised(rig.heads[index["wrist" + d]] - rig.heads[index["lowerarm01" + d]])
        fore, hand = out[:, index["lowerarm01" + d]], out[:, index["wrist" + d]]
        turn = twist_angle(transpose(fore) @ hand, axis)
        out[:, index["lowerarm02" + d]] = fore @ about(axis, 0.6 * turn)
        axis = normalised(rig.heads[index["lowerarm01" + d]] - rig.heads[index["upperarm01" + d]])
        collar, arm = out[:, index["shoulder01" + d]], out[:, index["upperarm01" + d]]
        turn = twist_angle(transpose(collar) @ arm, axis)
        out[:, index["upperarm01" + d]] = arm @ about(axis, -0.5 * turn)
    return out


def _halfway(a: FloatArray, b: FloatArray) -> FloatArray:
    step = Rotation.from_matrix(transpose(a) @ b).as_rotvec()
    return a @ Rotation.from_rotvec(0.5 * step).as_matrix()
