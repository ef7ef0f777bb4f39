"""Arms that hang beside the trunk and not in it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rfgen_sionna.generative.motion import Skeleton
from rfgen_sionna.generative.motion.rotations import between, normalised, to_matrices, to_quaternions, transpose
from rfgen_sionna.generative.motion.skeleton import JOINT, SIDES, forward_kinematics, global_rotations, side_sign
from rfgen_sionna.generative.motion.tracks import clear_of_body
from rfgen_sionna.records import Motion


def separate_arms_from_trunk(motion: Motion, skeleton: Skeleton) -> Motion:
    """The motion with each arm turned outwards at the shoulder until its wrist is as clear of the trunk as this body
    needs it, as synthesised motion has it from the start.

    Args:
        motion: on `skeleton`.
        skeleton: whose `arm_slope` it is.
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
        q = to_quaternions(local)
        # the sign that they had, so that splines through them stay short
        rotations[:, shoulder] = q * np.where(
            np.sum(q * rotations[:, shoulder], axis=-1, keepdims=True) < 0.0, -1.0, 1.0
        )
    return replace(motion, rotations=rotations)
