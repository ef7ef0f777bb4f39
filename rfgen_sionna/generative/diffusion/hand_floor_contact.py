"""Hands that reach for the floor and not through it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.motion import Skeleton
from rfgen_sionna.generative.motion.ik import two_bone
from rfgen_sionna.generative.motion.rotations import X, Z, to_matrices, to_quaternions, transpose
from rfgen_sionna.generative.motion.skeleton import FINGERS, JOINT, SIDES, forward_kinematics, global_rotations
from rfgen_sionna.records import Motion

_CLEARANCE = 0.02
"""Height [m] over the floor that fingertips keep: half a finger's thickness, and what bodies are grounded to."""
_EASE = 0.1
"""Time [s] over which a hand is lifted and let down again."""


def keep_hands_above_floor(motion: Motion, skeleton: Skeleton) -> Motion:
    """The motion with each arm drawn in as far as its fingertips would be under the floor.

    Args:
        motion: on `skeleton`, with its 52 joints and the floor at z = 0.
        skeleton: whose arms they are.
    """
    world = global_rotations(to_matrices(motion.rotations), motion.parents)
    places = forward_kinematics(world, motion.translation, motion.offsets, motion.parents)
    rotations = motion.rotations.copy()
    for side in SIDES:
        missing = np.maximum(_CLEARANCE - _lowest(places, side), 0.0)
        if not missing.any():
            continue
        width = _EASE * motion.frame_rate
        lift = gaussian_filter1d(maximum_filter1d(missing, 2 * int(2.0 * width) + 1), width, mode="nearest")
        at = np.flatnonzero(lift > 1e-5)
        shoulder, elbow, wrist = (JOINT[f"{side}_{j}"] for j in ("shoulder", "elbow", "wrist"))
        start, end = places[at, shoulder], places[at, wrist]
        lengths = skeleton.length(f"{side}_elbow"), skeleton.length(f"{side}_wrist")
        # where the elbow's hinge lets it bend, which is smooth for straight arms too
        pole = -world[at, shoulder] @ X
        # from the same solution without the lift: what is not lifted is not turned, straight arms neither
        _, *before = two_bone(start, end, pole, *lengths)
        _, *after = two_bone(start, end + lift[at, None] * Z, pole, *lengths)
        upper, fore = (new @ transpose(old) for new, old in zip(after, before, strict=True))
        # the hand keeps its attitude
        turned = {shoulder: upper @ world[at, shoulder], elbow: fore @ world[at, elbow], wrist: world[at, wrist]}
        above = {shoulder: world[at, motion.parents[shoulder]], elbow: turned[shoulder], wrist: turned[elbow]}
        for joint, rotation in turned.items():
            q = to_quaternions(transpose(above[joint]) @ rotation)
            flip = np.sum(q * rotations[at, joint], axis=-1, keepdims=True) < 0.0
            rotations[at, joint] = np.where(flip, -q, q)
    return replace(motion, rotations=rotations)


def _lowest(places: FloatArray, side: str) -> FloatArray:
    """(frame,) height of the lowest fingertip [m]; the last bone is about as long as the one before it."""
    tips = []
    for finger in FINGERS:
        middle, last = (places[:, JOINT[f"{side}_{finger}{k}"]] for k in (2, 3))
        tips += [last[:, 2], (2.0 * last - middle)[:, 2]]
    return np.asarray(np.min(tips, axis=0), np.float64)
