"""How far two motions are apart as they are aligned in time."""

from __future__ import annotations

import numpy as np
from scipy.spatial.distance import cdist

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.action_definitions import MotionSignals
from rfgen_sionna.generative.action_definitions.sampled_series import RATE
from rfgen_sionna.generative.motion.skeleton import JOINT_NAMES, NUM_BODY_JOINTS

POSE_RATE = 10.0
"""Poses per second that are compared [Hz]."""
_TWINS = [
    JOINT_NAMES.index(n.replace("left", "right") if "left" in n else n.replace("right", "left"))
    for n in JOINT_NAMES[:NUM_BODY_JOINTS]
]


def poses(signals: MotionSignals) -> FloatArray:
    """(pose, 66) joints from the pelvis in the person's axes, with the height of the pelvis [m]."""
    joints = signals.joints[:, :NUM_BODY_JOINTS]
    local = signals.ahead(joints - joints[:, :1])
    local[:, 0, 2] = signals.pelvis_height
    chosen = local[:: round(RATE / POSE_RATE)]
    return chosen.reshape(len(chosen), -1)


def mirrored_poses(rows: FloatArray) -> FloatArray:
    """(pose, 66) with left and right exchanged."""
    swapped = rows.reshape(len(rows), -1, 3)[:, _TWINS] * [1.0, -1.0, 1.0]
    return swapped.reshape(len(rows), -1)


def aligned_distance(part: FloatArray, other: FloatArray) -> float:
    """Distance of the poses of `part` (m, 66) from those of the stretch of `other` (n, 66) that is nearest: rms over
    joints and time [m].

    Time is warped: the other motion runs at 0 to 2 times its pace, forwards (H. Sakoe and S. Chiba, IEEE Trans. ASSP 26
    (1978) 43, with free ends and one step a pose of `part`).
    """
    cost = cdist(part, other, "sqeuclidean")
    total = cost[0]
    for row in cost[1:]:
        before = np.concatenate([[np.inf, np.inf], total])
        total = row + np.minimum(np.minimum(before[2:], before[1:-1]), before[:-2])
    return float(np.sqrt(total.min() / cost.shape[0] / NUM_BODY_JOINTS))
