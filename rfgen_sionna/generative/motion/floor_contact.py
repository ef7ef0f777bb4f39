"""Contact of bodies with the floor."""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType

import numpy as np
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.motion.rotations import (
    to_matrices,
)
from rfgen_sionna.generative.motion.skeleton import (
    JOINT,
    SIDES,
    forward_kinematics,
    global_rotations,
)
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
