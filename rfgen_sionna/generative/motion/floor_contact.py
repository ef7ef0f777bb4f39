"""Contact of bodies and hands with the floor, and self-penetration of the arms."""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType

import numpy as np
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.motion.rotations import (
    X,
    Z,
    between,
    normalised,
    same_sign,
    to_matrices,
    to_quaternions,
    transpose,
)
from rfgen_sionna.generative.motion.skeleton import (
    FINGERS,
    JOINT,
    SIDES,
    Skeleton,
    forward_kinematics,
    global_rotations,
    side_sign,
    two_bone,
)
from rfgen_sionna.generative.motion.tracks import clear_of_body
from rfgen_sionna.records import Motion

_LIFT_TIME = 0.1
"""Time over which a body or hand is lifted and lowered [s]; bounds the acceleration."""
_FLESH_THICKNESS = MappingProxyType(
    {
        "pelvis": 0.1, "spine1": 0.1, "spine2": 0.1, "spine3": 0.1, "neck": 0.06, "head": 0.09,
        **{f"{side}_{joint}": size for side in SIDES for joint, size in (
            ("hip", 0.08), ("knee", 0.05), ("shoulder", 0.06), ("elbow", 0.04), ("wrist", 0.025),
            ("ankle", 0.01), ("foot", 0.005),
        )},
    }
)  # fmt: skip
"""Joint -> least thickness of the body around it [m]. Feet are corrected separately."""
_CLEARANCE = 0.02
"""Least height of fingertips over the floor [m]: half a finger's thickness."""


def floor_clearance(places: FloatArray) -> FloatArray:
    """(frame,) height of the body over the floor [m] from (frame, joint, 3) positions, flesh included."""
    joints = [JOINT[name] for name in _FLESH_THICKNESS]
    return np.asarray((places[:, joints, 2] - np.array(list(_FLESH_THICKNESS.values()))).min(axis=1))


def keep_body_above_floor(motion: Motion) -> Motion:
    """The motion with its root raised so that no joint, flesh included, is below the floor z = 0."""
    world = global_rotations(to_matrices(motion.rotations), motion.parents)
    places = forward_kinematics(world, motion.translation, motion.offsets, motion.parents)
    missing = np.maximum(-floor_clearance(places), 0.0)
    if not missing.any():
        return motion
    width = _LIFT_TIME * motion.frame_rate
    # smooth upper envelope
    reach = max(1, round(2.0 * width))
    lift = gaussian_filter1d(maximum_filter1d(missing, 2 * reach + 1), width, mode="nearest", radius=reach)
    translation = motion.translation.copy()
    translation[:, 2] += lift
    return replace(motion, translation=translation)


def separate_arms_from_trunk(motion: Motion, skeleton: Skeleton) -> Motion:
    """The motion with each arm turned outwards at the shoulder until its wrist is clear of the trunk.

    Args:
        motion: on `skeleton`.
        skeleton: gives `arm_slope`.
    """
    world = global_rotations(to_matrices(motion.rotations), motion.parents)
    places = forward_kinematics(world, motion.translation, motion.offsets, motion.parents)
    rotations = motion.rotations.copy()
    chest = world[:, JOINT["spine3"]]
    for side in SIDES:
        mirror = np.array([1.0, side_sign(side), 1.0])
        shoulder = JOINT[f"{side}_shoulder"]
        reach = normalised(places[:, JOINT[f"{side}_wrist"]] - places[:, shoulder])
        seen = np.einsum("nji,nj->ni", chest, reach) * mirror
        wanted = normalised(clear_of_body(seen, skeleton.arm_slope))
        turn = chest @ between(seen * mirror, wanted * mirror) @ transpose(chest)
        local = transpose(world[:, motion.parents[shoulder]]) @ turn @ world[:, shoulder]
        rotations[:, shoulder] = same_sign(to_quaternions(local), rotations[:, shoulder])
    return replace(motion, rotations=rotations)


def keep_hands_above_floor(motion: Motion, skeleton: Skeleton) -> Motion:
    """The motion with each arm drawn in so that no fingertip is below the floor.

    Args:
        motion: on `skeleton`, 52 joints, floor at z = 0.
        skeleton: lengths of the arms.
    """
    world = global_rotations(to_matrices(motion.rotations), motion.parents)
    places = forward_kinematics(world, motion.translation, motion.offsets, motion.parents)
    rotations = motion.rotations.copy()
    for side in SIDES:
        missing = np.maximum(_CLEARANCE - _lowest(places, side), 0.0)
        if not missing.any():
            continue
        width = _LIFT_TIME * motion.frame_rate
        lift = gaussian_filter1d(maximum_filter1d(missing, 2 * int(2.0 * width) + 1), width, mode="nearest")
        at = np.flatnonzero(lift > 1e-5)
        shoulder, elbow, wrist = (JOINT[f"{side}_{j}"] for j in ("shoulder", "elbow", "wrist"))
        start, end = places[at, shoulder], places[at, wrist]
        lengths = skeleton.length(f"{side}_elbow"), skeleton.length(f"{side}_wrist")
        # bend direction of the elbow's hinge, smooth for straight arms too
        pole = -world[at, shoulder] @ X
        # relative to the solution without lift, so that a zero lift turns nothing
        _, *before = two_bone(start, end, pole, *lengths)
        _, *after = two_bone(start, end + lift[at, None] * Z, pole, *lengths)
        upper, fore = (new @ transpose(old) for new, old in zip(after, before, strict=True))
        # the hand keeps its orientation
        turned = {shoulder: upper @ world[at, shoulder], elbow: fore @ world[at, elbow], wrist: world[at, wrist]}
        above = {shoulder: world[at, motion.parents[shoulder]], elbow: turned[shoulder], wrist: turned[elbow]}
        for joint, rotation in turned.items():
            rotations[at, joint] = same_sign(to_quaternions(transpose(above[joint]) @ rotation), rotations[at, joint])
    return replace(motion, rotations=rotations)


def _lowest(places: FloatArray, side: str) -> FloatArray:
    """(frame,) height of the lowest fingertip [m]; the last bone is about as long as the one before."""
    tips = []
    for finger in FINGERS:
        middle, last = (places[:, JOINT[f"{side}_{finger}{k}"]] for k in (2, 3))
        tips += [last[:, 2], (2.0 * last - middle)[:, 2]]
    return np.asarray(np.min(tips, axis=0), np.float64)
