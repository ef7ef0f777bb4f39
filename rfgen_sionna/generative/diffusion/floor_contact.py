"""Bodies that fall, roll and stand on their hands over the floor, and not through it."""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType

import numpy as np
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from rfgen_sionna.generative.motion.rotations import to_matrices
from rfgen_sionna.generative.motion.skeleton import JOINT, SIDES, forward_kinematics, global_rotations
from rfgen_sionna.records import Motion

_EASE = 0.1
"""Time [s] over which a body is lifted and let down again."""
_FLESH_THICKNESS = MappingProxyType(
    {
        "pelvis": 0.1, "spine1": 0.1, "spine2": 0.1, "spine3": 0.1, "neck": 0.06, "head": 0.09,
        **{f"{side}_{joint}": size for side in SIDES for joint, size in (
            ("hip", 0.08), ("knee", 0.05), ("shoulder", 0.06), ("elbow", 0.04), ("wrist", 0.025),
            ("ankle", 0.01), ("foot", 0.005),
        )},
    }
)  # fmt: skip
"""Joint -> how far the body reaches around it, at least [m]. Feet have their own way to the floor, as far as legs
that lie on it can bend."""


def keep_body_above_floor(motion: Motion) -> Motion:
    """The motion with its root raised as far as its joints, flesh included, would be under the floor z = 0."""
    world = global_rotations(to_matrices(motion.rotations), motion.parents)
    places = forward_kinematics(world, motion.translation, motion.offsets, motion.parents)
    joints = [JOINT[name] for name in _FLESH_THICKNESS]
    missing = np.maximum((np.array(list(_FLESH_THICKNESS.values())) - places[:, joints, 2]).max(axis=1), 0.0)
    if not missing.any():
        return motion
    width = _EASE * motion.frame_rate
    # at least what is missing everywhere, and smooth
    reach = max(1, round(2.0 * width))
    lift = gaussian_filter1d(maximum_filter1d(missing, 2 * reach + 1), width, mode="nearest", radius=reach)
    translation = motion.translation.copy()
    translation[:, 2] += lift
    return replace(motion, translation=translation)
