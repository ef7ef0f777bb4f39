"""Measures of motions and their variations."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.diffusion.pose_rows import FRAME_RATE, planted_feet
from rfgen_sionna.generative.motion.resampling import resample_motion
from rfgen_sionna.generative.motion.rotations import Z, about, to_matrices
from rfgen_sionna.generative.motion.skeleton import JOINT, NUM_BODY_JOINTS, SIDES, forward_kinematics, global_rotations
from rfgen_sionna.records import Motion

_LAG = 3
"""Poses between which the movement of a pose is seen."""


def joint_paths(motion: Motion) -> FloatArray:
    """(frame, joint, 3) positions [m]."""
    world = global_rotations(to_matrices(motion.rotations), motion.parents)
    return forward_kinematics(world, motion.translation, motion.offsets, motion.parents)


def body_places(motion: Motion) -> FloatArray:
    """(frame, 22, 3) positions of the body's joints from the pelvis, turned to one heading, at 20 Hz [m]; heights are
    from the floor."""
    motion = resample_motion(motion, FRAME_RATE)
    places = joint_paths(motion)[:, :NUM_BODY_JOINTS]
    places = places - motion.translation[:, None] * [1.0, 1.0, 0.0]
    yaw = 2.0 * np.arctan2(motion.rotations[:, 0, 2], motion.rotations[:, 0, 3])
    return np.einsum("fij,fkj->fki", about(Z, -yaw), places)


def aligned_distance(motion: Motion, other: Motion) -> float:
    """Root of the mean square distance of the joints of two motions after aligning them in time [m]: dynamic time
    warping (Sakoe and Chiba 1978), of bodies from the pelvis."""
    a, b = body_places(motion), body_places(other)
    cost = cdist(a.reshape(len(a), -1), b.reshape(len(b), -1), "sqeuclidean") / NUM_BODY_JOINTS
    total = np.full((len(a) + 1, len(b) + 1), np.inf)
    total[0, 0] = 0.0
    steps = np.zeros_like(total)
    for i, row in enumerate(cost, 1):
        for j, here in enumerate(row.tolist(), 1):
            before = min((i - 1, j - 1), (i - 1, j), (i, j - 1), key=lambda at: total[at])
            total[i, j], steps[i, j] = total[before] + here, steps[before] + 1.0
    return float(np.sqrt(total[-1, -1] / steps[-1, -1]))


def foot_slide(motion: Motion, draft: Motion) -> float:
    """Mean horizontal speed of the toes of feet that the draft plants [m/s]; nan if it plants none."""
    places, planted = joint_paths(motion), planted_feet(draft)
    speeds = []
    for i, side in enumerate(SIDES):
        step = np.linalg.norm(np.diff(places[:, JOINT[f"{side}_foot"], :2], axis=0), axis=-1) * motion.frame_rate
        speeds.append(step[planted[1:, i] & planted[:-1, i]])
    every = np.concatenate(speeds)
    return float(every.mean()) if len(every) else float("nan")


def mean_jerk(motion: Motion) -> float:
    """Mean over joints and time of the third derivative of the positions [m/s^3], at 20 Hz."""
    return float(np.linalg.norm(np.diff(body_places(motion), n=3, axis=0), axis=-1).mean() * FRAME_RATE**3)


def nearest_poses(motion: Motion, others: Sequence[Motion]) -> float:
    """Mean distance of the poses of a motion, with their movement, from the nearest ones of others [m]."""
    tree = cKDTree(np.concatenate([_moving(other) for other in others]))
    away, _ = tree.query(_moving(motion))
    return float(away.mean())


def _moving(motion: Motion) -> FloatArray:
    places = body_places(motion)
    now, later = places[:-_LAG], places[_LAG:]
    return np.concatenate([now, later - now], axis=2).reshape(len(now), -1) / np.sqrt(NUM_BODY_JOINTS)
