"""A varied motion on the floor of its draft: what the draft rests on stays where it is, limbs follow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, gaussian_filter1d, maximum_filter1d
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.diffusion.pose_rows import planted_feet
from rfgen_sionna.generative.motion.floor_contact import floor_clearance, keep_body_above_floor
from rfgen_sionna.generative.motion.foot_lock import pole_direction, within_reach
from rfgen_sionna.generative.motion.rotations import X, same_sign, to_matrices, to_quaternions, transpose
from rfgen_sionna.generative.motion.skeleton import JOINT, SIDES, forward_kinematics, global_rotations, two_bone
from rfgen_sionna.records import Motion

_TRANSITION = 0.15
"""Time within which a planted limb is let go [s]; bounds the jump of velocities."""
_RISE = 0.08
"""Width of the smoothing of the pelvis' height [s]."""
_ROUNDS = 2
"""Limbs that follow change the lowest point; then both are done again."""
_STRETCHED = 0.99
"""Share of a leg's length to which it is stretched at most."""
_PLANTED_HAND = 0.12
"""Height of a wrist over the floor under which the hand rests on it [m]."""
_LIMBS = {"leg": ("hip", "knee", "ankle"), "arm": ("shoulder", "elbow", "wrist")}
"""Joints of a limb from the trunk to its end."""
_BENDS = {"leg": 1.0, "arm": -1.0}
"""Sense of a limb's bend along the x axis of its first joint."""


def anchored(motion: Motion, draft: Motion) -> Motion:
    """The motion with its lowest point as high as the draft's, and feet and hands where the draft plants them.

    Args:
        motion: a variation of `draft`, of the same poses in time and the same path.
        draft: any motion; feet are planted by its contacts, hands by their height.
    """
    before = _posed(draft)[1]
    feet = planted_feet(draft)
    rate = motion.frame_rate
    for _ in range(_ROUNDS):
        places = _posed(motion)[1]
        shift = gaussian_filter1d(floor_clearance(before) - floor_clearance(places), _RISE * rate, mode="nearest")
        places[..., 2] += shift[:, None]
        root = motion.translation.copy()
        root[:, 2] += shift - _drop(motion, places, before, feet)
        motion = replace(motion, translation=root)
        for i, side in enumerate(SIDES):
            motion = _follow(motion, draft, side, "leg", _eased(feet[:, i], rate))
            hand = before[:, JOINT[f"{side}_wrist"], 2] < _PLANTED_HAND
            if hand.any():
                motion = _follow(motion, draft, side, "arm", _eased(hand, rate))
    return keep_body_above_floor(motion) if floor_clearance(before).min() >= 0.0 else motion


def _drop(motion: Motion, places: FloatArray, before: FloatArray, feet: NDArray[np.bool_]) -> FloatArray:
    """(frame,) by how much the pelvis is lowered so that planted feet are within reach [m]."""
    missing = np.zeros(len(places))
    for i, side in enumerate(SIDES):
        hip, knee, ankle = (JOINT[f"{side}_{joint}"] for joint in ("hip", "knee", "ankle"))
        length = float(np.linalg.norm(motion.offsets[knee]) + np.linalg.norm(motion.offsets[ankle]))
        aside = np.linalg.norm(before[:, ankle, :2] - places[:, hip, :2], axis=-1)
        reach = np.sqrt(np.maximum((_STRETCHED * length) ** 2 - aside**2, 0.0))
        # no farther than the draft's own reach
        own = before[:, hip, 2] - before[:, ankle, 2]
        over = places[:, hip, 2] - before[:, ankle, 2] - np.maximum(reach, own)
        missing = np.maximum(missing, np.where(feet[:, i], over, 0.0))
    if not missing.any():
        return missing
    width = _RISE * motion.frame_rate
    reach = max(1, round(2.0 * width))
    return gaussian_filter1d(maximum_filter1d(missing, 2 * reach + 1), width, mode="nearest", radius=reach)


def _follow(motion: Motion, draft: Motion, side: str, limb: str, weight: FloatArray) -> Motion:
    """The motion with the end of a limb where the draft has it, by (frame,) `weight`; feet stay over their lowest
    place in the draft."""
    upper, middle, end = (JOINT[f"{side}_{name}"] for name in _LIMBS[limb])
    toe = JOINT[f"{side}_foot"]
    own, before = _posed(draft)
    world, places = _posed(motion)
    shift = weight[:, None] * (before[:, end] - places[:, end])
    if limb == "leg":
        for joint in (end, toe):
            missing = before[:, joint, 2].min() - places[:, joint, 2] - shift[:, 2]
            shift[:, 2] += np.maximum(missing, 0.0)
    lengths = [float(np.linalg.norm(motion.offsets[joint])) for joint in (middle, end)]
    start, now = places[:, upper], places[:, end]
    pole = pole_direction(places[:, middle] - start, now - start, _BENDS[limb] * (world[:, upper] @ X))
    _, *old = two_bone(start, now, pole, *lengths)
    _, *new = two_bone(start, within_reach(start, now, now + shift, sum(lengths)), pole, *lengths)
    first, second = (after @ transpose(prior) for after, prior in zip(new, old, strict=True))
    turned = {upper: first @ world[:, upper], middle: second @ world[:, middle]}
    turned[end] = _towards(world[:, end], own[:, end], weight)
    parents = motion.parents
    rotations = motion.rotations.copy()
    for joint, rotation in turned.items():
        parent = parents[joint]
        above = turned[parent] if parent in turned else world[:, parent]
        rotations[:, joint] = same_sign(to_quaternions(transpose(above) @ rotation), rotations[:, joint])
    if limb == "leg":
        local = _towards(to_matrices(rotations[:, toe]), to_matrices(draft.rotations[:, toe]), weight)
        rotations[:, toe] = same_sign(to_quaternions(local), rotations[:, toe])
    return replace(motion, rotations=rotations)


def _posed(motion: Motion) -> tuple[FloatArray, FloatArray]:
    """(frame, joint, 3, 3) world rotations and (frame, joint, 3) positions."""
    world = global_rotations(to_matrices(motion.rotations), motion.parents)
    return world, forward_kinematics(world, motion.translation, motion.offsets, motion.parents)


def _towards(rotations: FloatArray, others: FloatArray, weight: FloatArray) -> FloatArray:
    """(frame, 3, 3) rotations turned to others by (frame,) `weight`."""
    turn = Rotation.from_matrix(others @ transpose(rotations)).as_rotvec()
    return Rotation.from_rotvec(weight[:, None] * turn).as_matrix() @ rotations


def _eased(planted: NDArray[np.bool_], rate: float) -> FloatArray:
    """(frame,) 1 where planted, falling smoothly to 0 within `_TRANSITION`."""
    if not planted.any():
        return np.zeros(len(planted))
    s = np.maximum(1.0 - distance_transform_edt(~planted) / (_TRANSITION * rate), 0.0)
    return np.asarray(s * s * (3.0 - 2.0 * s), np.float64)
