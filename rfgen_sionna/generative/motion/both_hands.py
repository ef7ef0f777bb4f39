"""A gesture of one hand made with both: the other arm mirrors it, beside it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.motion.rotations import to_matrices, to_quaternions, transpose
from rfgen_sionna.generative.motion.skeleton import FINGERS, JOINT, forward_kinematics, global_rotations
from rfgen_sionna.records import Motion

_MIRROR = np.diag([1.0, -1.0, 1.0])
_ARM = ("collar", "shoulder", "elbow", "wrist")
_HAND = tuple(f"{finger}{k}" for finger in FINGERS for k in (1, 2, 3))
_TRUNK = ("spine1", "spine2", "spine3", "neck", "head")
_BESIDE = 0.08
"""Distance of each hand's joints from the plane between them, at least [m]."""
_WIDEST = 1.0
"""The most that an arm is opened [rad]."""


def both_hands(motion: Motion, hand: str, *, still: bool = True) -> Motion:
    """The motion with both arms in step: the other one mirrors that of `hand`.

    Both are opened at the shoulders by the least angle that keeps the hands apart.

    Args:
        motion: of the body's 52 joints, that of a gesture with one hand.
        hand: that hand, "left" or "right".
        still: whether the person stands, so that the trunk need not turn after one arm.
    """
    local = to_matrices(motion.rotations)
    if still:
        for name in _TRUNK:
            j = JOINT[name]
            local[:, j] = local[:, j] @ _half(transpose(local[:, j]) @ _MIRROR @ local[:, j] @ _MIRROR)
    shoulder, collar = JOINT[f"{hand}_shoulder"], JOINT[f"{hand}_collar"]
    opening = _opening(motion, local, hand)
    up = transpose(local[:, collar])[:, :, 2]
    local[:, shoulder] = Rotation.from_rotvec(opening * up).as_matrix() @ local[:, shoulder]
    other = "left" if hand == "right" else "right"
    for part in (*_ARM, *_HAND):
        local[:, JOINT[f"{other}_{part}"]] = _MIRROR @ local[:, JOINT[f"{hand}_{part}"]] @ _MIRROR
    return replace(motion, rotations=to_quaternions(local))


def _half(turns: FloatArray) -> FloatArray:
    """(frame, 3, 3) half of each rotation."""
    return Rotation.from_rotvec(0.5 * Rotation.from_matrix(turns).as_rotvec()).as_matrix()


def _opening(motion: Motion, local: FloatArray, hand: str) -> float:
    """Angle about the trunk's length, positive to the left, by which the arm of `hand` has to be opened [rad]."""
    world = global_rotations(local, motion.parents)
    places = forward_kinematics(world, motion.translation, motion.offsets, motion.parents)
    joints = [JOINT[f"{hand}_{part}"] for part in ("wrist", *_HAND)]
    chest, shoulder = JOINT["spine3"], places[:, JOINT[f"{hand}_shoulder"]]
    side = 1.0 if hand == "left" else -1.0
    reach = (places[:, joints] - shoulder[:, None]) @ world[:, chest]
    out = ((shoulder - places[:, chest])[:, None] @ world[:, chest])[:, :, 1] * side
    ahead, beside = reach[..., 0], reach[..., 1] * side
    for angle in np.arange(0.0, _WIDEST, 0.02):
        if (out + ahead * np.sin(angle) + beside * np.cos(angle)).min() >= _BESIDE:
            return side * float(angle)
    return side * _WIDEST
