"""Planted feet that stay where they are: the legs follow by inverse kinematics."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.generative.motion import MEAN_ADULT, Skeleton
from rfgen_sionna.generative.motion.ik import from_rest, two_bone
from rfgen_sionna.generative.motion.rotations import X, normalised, to_matrices, to_quaternions, transpose
from rfgen_sionna.generative.motion.skeleton import JOINT, SIDES, forward_kinematics, global_rotations
from rfgen_sionna.records import FloatArray, Motion

_SHORTEST = 0.13
"""Plants shorter than this are taken for noise [s]."""
_LOW = 0.035
"""Toes are down where they are at most this much over their resting height [m]."""
_FURTHEST = 0.12
"""The most that a planted foot is moved [m]; a plant that drifts further is taken in pieces."""


def lock_feet(motion: Motion, skeleton: Skeleton = MEAN_ADULT) -> Motion:
    """The motion with toes held still while they are planted and no foot under the floor.

    Args:
        motion: on `skeleton`, with contacts; without them only the floor is kept.
        skeleton: whose legs they are.
    """
    world = global_rotations(to_matrices(motion.rotations), motion.parents)
    places = forward_kinematics(world, motion.translation, motion.offsets, motion.parents)
    for i, side in enumerate(SIDES):
        hip, knee, ankle, toe = (JOINT[f"{side}_{j}"] for j in ("hip", "knee", "ankle", "foot"))
        shift = np.zeros((len(places), 3))
        # the heel moves with the foot's own rotation
        heel = places[:, ankle, 2] + (world[:, ankle] @ skeleton.heel[i])[:, 2]
        low = np.minimum(places[:, toe, 2] - skeleton.toe_height, heel)
        if motion.contacts is not None:
            down = motion.contacts[:, i] & (places[:, toe, 2] < skeleton.toe_height + _LOW)
            held, offset = _hold(places[:, toe], down, motion.frame_rate)
            offset[held, 2] = -low[held]
            shift = _between(held, offset)
        shift[:, 2] = np.maximum(shift[:, 2], -low)
        target = places[:, ankle] + shift
        _, thigh, shank = two_bone(
            places[:, hip],
            target,
            world[:, hip] @ X,
            skeleton.length(f"{side}_knee"),
            skeleton.length(f"{side}_ankle"),
        )
        world[:, hip] = from_rest(thigh, normalised(skeleton.offsets[knee]), X)
        world[:, knee] = from_rest(shank, normalised(skeleton.offsets[ankle]), X)
    local = world.copy()
    for j, p in enumerate(motion.parents):
        if p >= 0:
            local[:, j] = transpose(world[:, p]) @ world[:, j]
    return replace(motion, rotations=to_quaternions(local))


def runs(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """(first, past the last) of each stretch of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _hold(toe: FloatArray, down: NDArray[np.bool_], rate: float) -> tuple[NDArray[np.bool_], FloatArray]:
    """Which frames are held, and the (frame, 3) shift that holds them."""
    held = np.zeros(len(toe), bool)
    offset = np.zeros_like(toe)
    for first, last in runs(down):
        if last - first < max(2, round(_SHORTEST * rate)):
            continue
        start = first
        for stop in range(first + 1, last + 1):
            spot = toe[start:stop, :2].mean(axis=0)
            drift = np.abs(toe[start:stop, :2] - spot).max()
            if drift > _FURTHEST or stop == last:
                held[start:stop] = True
                offset[start:stop, :2] = spot - toe[start:stop, :2]
                start = stop
    return held, offset


def _between(held: NDArray[np.bool_], offset: FloatArray) -> FloatArray:
    """Shifts that run smoothly from one held stretch to the next."""
    at = np.flatnonzero(held)
    if not len(at):
        return np.zeros_like(offset)
    out = offset.copy()
    for a, b in pairwise(at):
        if b - a > 1:
            s = np.arange(1, b - a) / (b - a)
            s = (s * s * (3.0 - 2.0 * s))[:, None]
            out[a + 1 : b] = offset[a] + s * (offset[b] - offset[a])
    out[: at[0]], out[at[-1] + 1 :] = offset[at[0]], offset[at[-1]]
    return out
