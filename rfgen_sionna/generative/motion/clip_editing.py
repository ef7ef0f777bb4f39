"""Edits of motions: cut, mirrored, at another pace or size, placed, and joined where poses match."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.motion.resampling import resample_motion, runs
from rfgen_sionna.generative.motion.rotations import continuous, to_matrices
from rfgen_sionna.generative.motion.skeleton import JOINT, forward_kinematics, global_rotations
from rfgen_sionna.records import Motion

BLEND = 0.35
"""Time in which a joint motion reaches the second one [s]."""
_MIRROR = np.array([-1.0, 1.0, -1.0, 1.0])
"""Signs of a quaternion's components in a mirror image, left for right."""
_FACING = 0.3
"""Time over which the heading of an end is averaged [s]."""
_VELOCITY = 0.12
"""Weight of velocities against places in the likeness of poses [s]."""
_CONTACT = 0.08
"""What a foot that is down in one of two poses alone adds to their distance [m]."""


def cut(motion: Motion, start: int, stop: int) -> Motion:
    """Frames from `start` to `stop`."""
    contacts = None if motion.contacts is None else motion.contacts[start:stop]
    return replace(
        motion, rotations=motion.rotations[start:stop], translation=motion.translation[start:stop], contacts=contacts
    )


def mirrored(motion: Motion) -> Motion:
    """The mirror image, left for right, of a motion of a symmetric skeleton."""
    names = motion.joint_names
    swap = {"left": "right", "right": "left"}
    other = []
    for name in names:
        side, _, rest = name.partition("_")
        other.append(names.index(f"{swap[side]}_{rest}") if side in swap else names.index(name))
    return replace(
        motion,
        rotations=motion.rotations[:, other] * _MIRROR,
        translation=motion.translation * [1.0, -1.0, 1.0],
        contacts=None if motion.contacts is None else motion.contacts[:, ::-1],
    )


def at_pace(motion: Motion, pace: float) -> Motion:
    """The motion `pace` times as fast, at the same rate."""
    return resample_motion(replace(motion, frame_rate=motion.frame_rate * pace), motion.frame_rate)


def at_times(motion: Motion, times: FloatArray) -> Motion:
    """The poses of a motion at increasing `times` [s], linear between frames, as poses of its rate."""
    at = np.clip(times * motion.frame_rate, 0.0, len(motion.translation) - 1.0)
    low = np.minimum(at.astype(int), len(motion.translation) - 2)
    part = at - low
    quaternions = (1.0 - part)[:, None, None] * motion.rotations[low] + part[:, None, None] * motion.rotations[low + 1]
    return replace(
        motion,
        rotations=quaternions / np.linalg.norm(quaternions, axis=-1, keepdims=True),
        translation=(1.0 - part)[:, None] * motion.translation[low] + part[:, None] * motion.translation[low + 1],
        contacts=None if motion.contacts is None else motion.contacts[np.rint(at).astype(int)],
    )


def joint_places(motion: Motion) -> FloatArray:
    """(frame, joint, 3) positions of the joints [m]."""
    world = global_rotations(to_matrices(motion.rotations), motion.parents)
    return forward_kinematics(world, motion.translation, motion.offsets, motion.parents)


def headings(motion: Motion) -> FloatArray:
    """(frame,) angle to which the pelvis faces, continuous [rad]; of lying bodies that of the line across the hips."""
    across = to_matrices(motion.rotations[:, 0])[..., 1]
    return np.unwrap(np.arctan2(-across[:, 0], across[:, 1]))


def moved(motion: Motion, turn: float, shift: FloatArray) -> Motion:
    """The motion turned about the vertical through the origin by `turn` [rad], then shifted by (2,) `shift` [m]."""
    c, s = np.cos(turn), np.sin(turn)
    x, y, z = motion.translation.T
    rotations = motion.rotations.copy()
    rotations[:, 0] = (Rotation.from_rotvec([0.0, 0.0, turn]) * Rotation.from_quat(rotations[:, 0])).as_quat()
    translation = np.stack([c * x - s * y + shift[0], s * x + c * y + shift[1], z], axis=-1)
    return replace(motion, rotations=continuous(rotations), translation=translation)


def placed(motion: Motion, *, way: bool) -> Motion:
    """The motion facing +x at first, from the origin; of a `way`, facing +x on average, its middle at the origin."""
    facing = headings(motion)
    if way:
        turn = -float(np.arctan2(np.sin(facing).mean(), np.cos(facing).mean()))
    else:
        turn = -float(facing[: max(1, round(_FACING * motion.frame_rate))].mean())
    turned = moved(motion, turn, np.zeros(2))
    level = turned.translation[:, :2]
    centre = 0.5 * (level.min(axis=0) + level.max(axis=0)) if way else level[0]
    return moved(turned, 0.0, -centre)


def rotation_vectors(motion: Motion) -> tuple[FloatArray, FloatArray]:
    """(joint, 4) mean local rotations, the pelvis without its heading, and (frame, joint, 3) turns from them [rad]."""
    level = _without_heading(motion)
    frames, joints = level.shape[:2]
    mean = np.linalg.eigh(np.einsum("fji,fjk->jik", level, level))[1][..., -1]
    turns = Rotation.from_quat(np.repeat(mean[None], frames, 0).reshape(-1, 4)).inv() * Rotation.from_quat(
        level.reshape(-1, 4)
    )
    return mean, turns.as_rotvec().reshape(frames, joints, 3)


def scaled(motion: Motion, sizes: FloatArray, rise: float, neutral: FloatArray | None = None) -> Motion:
    """The motion with larger or smaller turns of its joints.

    Args:
        motion: any motion.
        sizes: (joint,) or (frame, joint) factor on the turns from `neutral`.
        rise: factor on the height of the pelvis over or under its median.
        neutral: (joint, 4) local rotations, the pelvis without heading; None takes the mean pose.
    """
    mean, turns = rotation_vectors(motion)
    if neutral is not None:
        level = _without_heading(motion)
        base = Rotation.from_quat(np.repeat(neutral[None], len(level), 0).reshape(-1, 4))
        turns = (base.inv() * Rotation.from_quat(level.reshape(-1, 4))).as_rotvec().reshape(turns.shape)
        mean = neutral
    shape = turns.shape
    base = Rotation.from_quat(np.repeat(mean[None], shape[0], 0).reshape(-1, 4))
    local = (base * Rotation.from_rotvec((turns * sizes[..., None]).reshape(-1, 3))).as_quat().reshape(*shape[:2], 4)
    local[:, 0] = (_headings(motion) * Rotation.from_quat(local[:, 0])).as_quat()
    translation = motion.translation.copy()
    middle = np.median(translation[:, 2])
    translation[:, 2] = middle + rise * (translation[:, 2] - middle)
    return replace(motion, rotations=continuous(local), translation=translation)


def _headings(motion: Motion) -> Rotation:
    return Rotation.from_rotvec(headings(motion)[:, None] * np.array([0.0, 0.0, 1.0]))


def _without_heading(motion: Motion) -> FloatArray:
    level = motion.rotations.copy()
    level[:, 0] = (_headings(motion).inv() * Rotation.from_quat(level[:, 0])).as_quat()
    return continuous(level)


# likeness of poses


def pose_features(motion: Motion) -> FloatArray:
    """(frame, feature) places of the joints in the pelvis' heading, velocities and contacts; distances are in metres of
    a joint."""
    places = joint_places(motion)[:, : JOINT["right_wrist"] + 1]
    c, s = np.cos(headings(motion))[:, None], np.sin(headings(motion))[:, None]
    velocity = np.gradient(places, axis=0) * motion.frame_rate if len(places) > 1 else np.zeros_like(places)
    own = places - places[:, :1] * [1.0, 1.0, 0.0]
    parts = [
        np.stack([c * each[..., 0] + s * each[..., 1], c * each[..., 1] - s * each[..., 0], each[..., 2]], axis=-1)
        for each in (own, _VELOCITY * velocity)
    ]
    contacts = np.zeros((len(places), 2)) if motion.contacts is None else motion.contacts.astype(float)
    scale = 1.0 / np.sqrt(places.shape[1])
    return np.concatenate([*(scale * part.reshape(len(places), -1) for part in parts), _CONTACT * contacts], axis=1)


def likeness(a: FloatArray, b: FloatArray) -> FloatArray:
    """(frame of a, frame of b) rms distances of features [m]."""
    squares = np.sum(a**2, axis=1)[:, None] + np.sum(b**2, axis=1) - 2.0 * a @ b.T
    return np.sqrt(np.maximum(squares, 0.0))


def joined(first: Motion, second: Motion, blend: float = BLEND) -> Motion:
    """`first`, and from its last pose on `second`, whose first pose is turned and moved to it.

    The difference of the two poses and of their velocities decays within `blend` [s] (inertialisation, Bollo 2018).
    """
    rate = first.frame_rate
    facing = headings(first)[-1] - headings(second)[0]
    second = moved(second, float(facing), np.zeros(2))
    # the pelvis goes on with the mean velocity of both
    step = np.zeros(2)
    if len(first.translation) > 1 and len(second.translation) > 1:
        step = 0.5 * (np.diff(first.translation[-2:, :2], axis=0)[0] + np.diff(second.translation[:2, :2], axis=0)[0])
    second = moved(second, 0.0, first.translation[-1, :2] + step - second.translation[0, :2])
    count = len(second.translation)
    t = np.arange(1, count + 1) / rate
    ends = first.rotations[-1]
    offset = (Rotation.from_quat(ends) * Rotation.from_quat(second.rotations[0]).inv()).as_rotvec()
    slope = _rates(first.rotations[-2:], rate) - _rates(second.rotations[:2], rate)
    lift = first.translation[-1, 2] - second.translation[0, 2]
    rise = _slope(first.translation[-2:, 2], rate) - _slope(second.translation[:2, 2], rate)
    away = min(count, round(2.0 * blend * rate))
    keep, push = _decay(t[:away], blend)
    extra = keep[:, None, None] * offset + push[:, None, None] * slope
    rotations = second.rotations.copy()
    turned = Rotation.from_rotvec(extra.reshape(-1, 3)) * Rotation.from_quat(rotations[:away].reshape(-1, 4))
    rotations[:away] = turned.as_quat().reshape(away, -1, 4)
    translation = second.translation.copy()
    translation[:away, 2] += keep * lift + push * rise
    both = None
    if first.contacts is not None and second.contacts is not None:
        both = np.concatenate([first.contacts, second.contacts])
    return replace(
        first,
        rotations=continuous(np.concatenate([first.rotations, rotations])),
        translation=np.concatenate([first.translation, translation]),
        contacts=both,
    )


def _decay(t: FloatArray, blend: float) -> tuple[FloatArray, FloatArray]:
    """Weights of an initial offset and of an initial velocity after `t` [s]: quintics that end at rest at `blend`."""
    s = np.clip(t / blend, 0.0, 1.0)
    keep = 1.0 - s**3 * (10.0 + s * (6.0 * s - 15.0))
    push = blend * s * (1.0 - s) ** 3 * (1.0 + 3.0 * s)
    return keep, push


def _rates(quaternions: FloatArray, rate: float) -> FloatArray:
    """(joint, 3) turn rates between two poses [rad/s]."""
    if len(quaternions) < 2:
        return np.zeros((quaternions.shape[1], 3))
    return (Rotation.from_quat(quaternions[1]) * Rotation.from_quat(quaternions[0]).inv()).as_rotvec() * rate


def _slope(values: FloatArray, rate: float) -> float:
    return float(values[1] - values[0]) * rate if len(values) > 1 else 0.0


# standing, sitting and lying still


def sway(motion: Motion, count: int, start: int = 0) -> FloatArray:
    """(count, joint, 3) small turns of a person who keeps still, from those of `motion` about its slowly moving mean
    [rad], to and fro from frame `start`."""
    _, turns = rotation_vectors(motion)
    slow = gaussian_filter1d(turns, 2.0 * motion.frame_rate, axis=0, mode="nearest")
    small = np.clip(gaussian_filter1d(turns - slow, 0.15 * motion.frame_rate, axis=0, mode="nearest"), -0.06, 0.06)
    there_and_back = np.concatenate([small, small[-2:0:-1]])
    return there_and_back[(start + np.arange(count)) % len(there_and_back)]


def held(motion: Motion, count: int, small: FloatArray) -> Motion:
    """`count` frames after the last pose: its movement dies away, then the person keeps still but for (count, joint, 3)
    turns `small` [rad]."""
    last = cut(motion, len(motion.translation) - 1, len(motion.translation))
    fade = np.minimum(np.arange(count) / (1.0 * motion.frame_rate), 1.0)[:, None, None]
    turns = Rotation.from_rotvec((fade * (small - small[:1])).reshape(-1, 3))
    poses = Rotation.from_quat(np.repeat(last.rotations, count, 0).reshape(-1, 4)) * turns
    still = replace(
        last,
        rotations=poses.as_quat().reshape(count, -1, 4),
        translation=np.repeat(last.translation, count, 0),
        contacts=None if last.contacts is None else np.repeat(last.contacts, count, 0),
    )
    return joined(motion, still)


def reversed_in_time(motion: Motion) -> Motion:
    """The motion from its last pose to its first one."""
    contacts = None if motion.contacts is None else motion.contacts[::-1]
    return replace(
        motion, rotations=motion.rotations[::-1].copy(), translation=motion.translation[::-1].copy(), contacts=contacts
    )


def flights(motion: Motion) -> list[tuple[int, int]]:
    """(first, last + 1) of each time without a planted foot, of 0.1 s to 0.9 s."""
    if motion.contacts is None:
        return []
    low, high = 0.1 * motion.frame_rate, 0.9 * motion.frame_rate
    return [(a, b) for a, b in runs(np.asarray(~motion.contacts.any(axis=1))) if low <= b - a <= high]
