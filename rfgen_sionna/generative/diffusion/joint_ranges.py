"""Joints of varied motions within people's ranges."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from rfgen_sionna.generative.motion.limits import LIMITS
from rfgen_sionna.generative.motion.rotations import same_sign
from rfgen_sionna.generative.motion.skeleton import JOINT, SIDES, side_sign
from rfgen_sionna.records import Motion

_ANGLES = {
    "knee": ("YXZ", ("knee flexion",), (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)),
    "ankle": ("ZYX", ("ankle toe-out", "ankle dorsiflexion", "ankle eversion"), (1.0, 0.0, 1.0), (0.0, -1.0, 0.0)),
    "elbow": ("ZXY", ("elbow flexion",), (-1.0, 0.0, 0.0), (0.0, 1.0, 1.0)),
    "wrist": (
        "YXZ",
        ("forearm pronation", "wrist flexion", "wrist radial deviation"),
        (0.0, -1.0, -1.0),
        (1.0, 0.0, 0.0),
    ),
}
"""Joint -> order of its three angles, limits of the first ones, and signs: times the side's, and of both sides."""


def within_joint_ranges(motion: Motion, draft: Motion) -> Motion:
    """The motion with knees, ankles, elbows and wrists within their ranges, or within the draft's where it is beyond.

    Args:
        motion: a variation of `draft`.
        draft: of the same poses in time.
    """
    q = motion.rotations.copy()
    for side in SIDES:
        for name, (order, limits, sided, both) in _ANGLES.items():
            joint = JOINT[f"{side}_{name}"]
            signs = side_sign(side) * np.array(sided) + np.array(both)
            own, before = (
                signs * Rotation.from_quat(each[:, joint]).as_euler(order, degrees=True)
                for each in (q, draft.rotations)
            )
            inside = own.copy()
            for k, limit in enumerate(limits):
                low, high = LIMITS[limit].low, LIMITS[limit].high
                inside[:, k] = np.clip(own[:, k], np.minimum(low, before[:, k]), np.maximum(high, before[:, k]))
            fixed = Rotation.from_euler(order, signs * inside, degrees=True).as_quat()
            moved = np.abs(inside - own).max(axis=1) > 1e-9
            q[moved, joint] = same_sign(fixed, q[:, joint])[moved]
    return replace(motion, rotations=q)
