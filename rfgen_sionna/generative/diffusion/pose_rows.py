"""Poses as the motion model sees them: rows of rotations at 20 Hz, turned to one heading, and their context.

A row holds the pelvis' rotation without its turn about the vertical, and the rotations of the other 21 body joints
relative to their parents, each by its first two columns (Zhou et al. 2019). The context stays as it is in a variation:
way over the floor, height and contacts.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.motion.rotations import Z, about, continuous, to_matrices, transpose
from rfgen_sionna.generative.motion.skeleton import (
    JOINT,
    JOINT_NAMES,
    NUM_BODY_JOINTS,
    SIDES,
    forward_kinematics,
    global_rotations,
)
from rfgen_sionna.records import Motion

FRAME_RATE = 20.0
"""Rows per second [Hz]."""
NUM_COLUMNS = 6 * NUM_BODY_JOINTS
NUM_CONTEXT = 6
"""Speed ahead and to the left [m/s], turn rate [rad/s], height of the pelvis [m], contacts of left and right foot."""
_LOW, _SLOW = 0.06, 0.35
"""A planted foot's joints are below that over their lowest [m], and slower than that [m/s]."""


def pose_rows(motion: Motion) -> tuple[FloatArray, FloatArray]:
    """(frame, NUM_COLUMNS) rows and (frame, NUM_CONTEXT) context of a motion, at 20 Hz.

    Raises:
        ValueError: the first 22 joints are not SMPL's body joints, or there are fewer than two poses.
    """
    if motion.joint_names[:NUM_BODY_JOINTS] != JOINT_NAMES[:NUM_BODY_JOINTS]:
        raise ValueError(f"motion.joint_names: {motion.joint_names}; the first 22 must be SMPL's body joints, in order")
    n = len(motion.translation)
    if n < 2:
        raise ValueError(f"motion: {n} poses; at least 2 are needed")
    quaternions = continuous(motion.rotations[:, :NUM_BODY_JOINTS])
    contacts = planted_feet(motion).astype(np.float64)
    t, at = np.arange(n) / motion.frame_rate, row_times(motion)
    quaternions = CubicSpline(t, quaternions)(at)
    place, height = np.split(CubicSpline(t, motion.translation)(at), [2], axis=1)
    nearest = np.minimum(np.round(at * motion.frame_rate).astype(int), n - 1)
    root = quaternions[:, 0] / np.linalg.norm(quaternions[:, 0], axis=-1, keepdims=True)
    # twist of the swing-twist decomposition: steady for people who lie
    yaw = np.unwrap(2.0 * np.arctan2(root[:, 2], root[:, 3]))
    local = to_matrices(quaternions)
    local[:, 0] = about(Z, -yaw) @ local[:, 0]
    velocity = np.gradient(place, axis=0) * FRAME_RATE
    c, s = np.cos(yaw), np.sin(yaw)
    ahead, aside = c * velocity[:, 0] + s * velocity[:, 1], c * velocity[:, 1] - s * velocity[:, 0]
    context = np.column_stack([ahead, aside, np.gradient(yaw) * FRAME_RATE, height, contacts[nearest]])
    return _six(local), context


def row_times(motion: Motion) -> FloatArray:
    """(row,) times of the rows of a motion [s], at least two."""
    return np.arange(max(2, int(np.floor(motion.duration * FRAME_RATE + 1e-6)) + 1)) / FRAME_RATE


def joint_rotations(rows: FloatArray) -> FloatArray:
    """(frame, 22, 3, 3) rotations of rows of any scale, by Gram-Schmidt."""
    six = rows.reshape(len(rows), NUM_BODY_JOINTS, 6)
    a, b = six[..., :3], six[..., 3:]
    x = a / np.maximum(np.linalg.norm(a, axis=-1, keepdims=True), 1e-9)
    b = b - np.sum(x * b, axis=-1, keepdims=True) * x
    y = b / np.maximum(np.linalg.norm(b, axis=-1, keepdims=True), 1e-9)
    return np.stack([x, y, np.cross(x, y)], axis=-1)


def turned_by(motion: Motion, rows: FloatArray, other: FloatArray) -> Motion:
    """The motion with its body joints turned as from `rows` to `other`, at its own rate; all else stays.

    Args:
        motion: with the rows `rows`.
        rows: (frame, NUM_COLUMNS) its rows.
        other: (frame, NUM_COLUMNS) rows that it is to have.
    """
    turns = transpose(joint_rotations(rows)) @ joint_rotations(other)
    vectors = Rotation.from_matrix(turns.reshape(-1, 3, 3)).as_rotvec().reshape(len(rows), -1)
    t = np.arange(len(motion.translation)) / motion.frame_rate
    at = row_times(motion)
    fine = CubicSpline(at, vectors)(np.minimum(t, at[-1])).reshape(-1, 3)
    rotations = motion.rotations.copy()
    body = Rotation.from_quat(rotations[:, :NUM_BODY_JOINTS].reshape(-1, 4)) * Rotation.from_rotvec(fine)
    rotations[:, :NUM_BODY_JOINTS] = body.as_quat().reshape(len(t), NUM_BODY_JOINTS, 4)
    return replace(motion, rotations=continuous(rotations))


def planted_feet(motion: Motion) -> NDArray[np.bool_]:
    """(frame, 2) contacts of the left and the right foot; found by height and speed where the motion has none."""
    if motion.contacts is not None:
        return motion.contacts
    world = global_rotations(to_matrices(motion.rotations), motion.parents)
    places = forward_kinematics(world, motion.translation, motion.offsets, motion.parents)
    out = np.zeros((len(places), len(SIDES)), bool)
    for i, side in enumerate(SIDES):
        for joint in ("ankle", "foot"):
            path = places[:, JOINT[f"{side}_{joint}"]]
            speed = np.linalg.norm(np.gradient(path, axis=0), axis=-1) * motion.frame_rate
            out[:, i] |= (path[:, 2] < path[:, 2].min() + _LOW) & (speed < _SLOW)
    return out


def _six(local: FloatArray) -> FloatArray:
    return np.swapaxes(local[..., :2], -1, -2).reshape(len(local), -1)
