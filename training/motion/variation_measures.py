"""Measures of motions and of their variations."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.distance import cdist

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.action_definitions import MotionSignals
from rfgen_sionna.generative.diffusion.pose_rows import FRAME_RATE, planted_feet
from rfgen_sionna.generative.motion.clip_editing import joint_places
from rfgen_sionna.generative.motion.resampling import resample_motion
from rfgen_sionna.generative.motion.skeleton import JOINT, NUM_BODY_JOINTS, SIDES
from rfgen_sionna.records import Motion
from training.motion.alignment import mirrored_poses, poses

_LAG = 2
"""Poses between which the movement of a pose is seen."""


def pose_places(motion: Motion) -> FloatArray:
    """(pose, 66) positions of the body's joints as :func:`training.motion.alignment.poses` has them."""
    return poses(MotionSignals(motion))[:, : 3 * NUM_BODY_JOINTS]


def body_places(motion: Motion) -> FloatArray:
    """(frame, 22, 3) positions of the body's joints at 20 Hz [m]."""
    return joint_places(resample_motion(motion, FRAME_RATE))[:, :NUM_BODY_JOINTS]


def distance(motion: Motion, draft: Motion) -> float:
    """Root mean square distance of the joints from the same joints of a draft at the same time [m]."""
    return float(np.sqrt(np.mean(np.sum((body_places(motion) - body_places(draft)) ** 2, axis=-1))))


def foot_slide(motion: Motion, draft: Motion) -> float:
    """Mean horizontal speed of the toes of feet that the draft plants [m/s]; nan if it plants none."""
    places, planted = joint_places(motion), planted_feet(draft)
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
    """Mean distance of the poses of a motion, with their movement, from the nearest ones of others or of their mirror
    images: rms over joints [m]."""
    rows = [pose_places(other) for other in others]
    bank = np.concatenate([_moving(each) for row in rows for each in (row, mirrored_poses(row))])
    return float(cdist(_moving(pose_places(motion)), bank).min(axis=1).mean() / np.sqrt(NUM_BODY_JOINTS))


def _moving(rows: FloatArray) -> FloatArray:
    return np.concatenate([rows[:-_LAG], rows[_LAG:] - rows[:-_LAG]], axis=1)
