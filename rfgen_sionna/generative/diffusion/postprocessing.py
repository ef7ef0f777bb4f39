"""From feature rows to a motion on a skeleton: higher rate, that skeleton's legs, planted feet, joint limits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.diffusion.features import FRAME_RATE, HandBasis, decode
from rfgen_sionna.generative.motion import MEAN_ADULT, Skeleton
from rfgen_sionna.generative.motion.floor_contact import (
    keep_body_above_floor,
    keep_hands_above_floor,
    separate_arms_from_trunk,
)
from rfgen_sionna.generative.motion.foot_lock import lock_feet, root_from_feet
from rfgen_sionna.generative.motion.limits import LIMITS
from rfgen_sionna.generative.motion.resampling import resample_motion
from rfgen_sionna.generative.motion.rotations import Z, about, same_sign
from rfgen_sionna.generative.motion.skeleton import FINGERS, JOINT, SIDES, side_sign
from rfgen_sionna.records import Motion

RATE = 60.0
"""Poses per second of a finished motion [Hz]."""
_MARGIN = 0.5
"""Distance from the limits [degrees]; absorbs rounding and resampling."""
_FINGERS = ((1, "knuckle"), (2, "middle joint"), (3, "end joint"))


def to_motion(
    features: FloatArray,
    hands: HandBasis,
    skeleton: Skeleton | None = None,
    rate: float = RATE,
    *,
    free: bool = True,
    legs: NDArray[np.bool_] | None = None,
    follow: Callable[[Motion], Motion] | None = None,
) -> Motion:
    """The motion of (frame, NUM_FEATURES) rows at 20 Hz on a skeleton.

    Args:
        features: rows in their own units.
        hands: principal components of the fingers.
        skeleton: of the person; None takes a mean adult. The path scales with the legs.
        rate: poses per second of the result [Hz].
        free: whether pelvis and arms may be corrected; False for motions with given parts.
        legs: (frame,) rows whose legs stay unchanged, if not `free`; None fixes none.
        follow: transformation onto another path, applied after the feet; None applies none.
    """
    skeleton = skeleton or MEAN_ADULT
    # corrections need at least RATE
    motion = clamp_joint_angles(resample_motion(decode(features, hands, FRAME_RATE), max(rate, RATE)))
    scale = skeleton.leg_length() / MEAN_ADULT.leg_length()
    height = skeleton.standing_height() - scale * MEAN_ADULT.standing_height()
    translation = motion.translation * scale
    translation[:, 2] += height
    motion = replace(motion, translation=translation, offsets=skeleton.offsets)
    if not free:
        motion = motion if follow is None else follow(motion)
        fixed_legs = None if legs is None else _at_rate(legs, motion)
        return resample_motion(lock_feet(motion, skeleton, ride=False, fixed_legs=fixed_legs), rate)
    carried = root_from_feet(separate_arms_from_trunk(motion, skeleton), skeleton)
    planted = lock_feet(carried if follow is None else follow(carried), skeleton)
    # clamped limbs may be below the floor again
    return resample_motion(
        keep_body_above_floor(clamp_joint_angles(keep_hands_above_floor(keep_body_above_floor(planted), skeleton))),
        rate,
    )


def _at_rate(rows: NDArray[np.bool_], motion: Motion) -> NDArray[np.bool_]:
    """(pose,) whether the rows at 20 Hz on both sides of a pose are marked."""
    at = np.arange(len(motion.translation)) * FRAME_RATE / motion.frame_rate
    last = len(rows) - 1
    before, after = (np.clip(near.astype(int), 0, last) for near in (np.floor(at + 1e-9), np.ceil(at - 1e-9)))
    return np.asarray(rows[before] & rows[after])


def clamp_joint_angles(motion: Motion) -> Motion:
    """The motion with elbows, wrists, ankles and fingers within their ranges."""
    q = motion.rotations.copy()

    def limited(joint: str, order: str, names: tuple[str | None, ...], signs: tuple[int, ...]) -> None:
        j = JOINT[joint]
        angles = Rotation.from_quat(q[:, j]).as_euler(order, degrees=True)
        inside = angles.copy()
        for k, (name, sign) in enumerate(zip(names, signs, strict=True)):
            if name is not None:
                inside[:, k] = sign * _clipped(sign * angles[:, k], name)
        moved = np.abs(inside - angles).max(axis=1) > 1e-9
        if moved.any():
            fixed = Rotation.from_euler(order, inside[moved], degrees=True).as_quat()
            q[moved, j] = same_sign(fixed, q[moved, j])

    for side in SIDES:
        s = side_sign(side)
        ankle = ("ankle toe-out", "ankle dorsiflexion", "ankle eversion")
        limited(f"{side}_ankle", "ZYX", ankle, (s, -1, s))
        wrist = ("forearm pronation", "wrist flexion", "wrist radial deviation")
        limited(f"{side}_wrist", "YXZ", wrist, (1, -s, -s))
        _hinge(q, f"{side}_elbow", s)
        for finger in FINGERS:
            if finger != "thumb":
                for k, name in _FINGERS:
                    spread = "finger spread" if k == 1 else None
                    limited(f"{side}_{finger}{k}", "ZXY", (spread, f"finger {name} flexion", None), (-s, -s, 1))
    return replace(motion, rotations=q)


def _hinge(q: FloatArray, joint: str, sign: int) -> None:
    """Clip an elbow's flexion in place."""
    j = JOINT[joint]
    matrix = Rotation.from_quat(q[:, j]).as_matrix()
    flexion = np.degrees(np.arctan2(sign * matrix[:, 0, 1], matrix[:, 1, 1]))
    over = _clipped(flexion, "elbow flexion") - flexion
    if np.abs(over).max() > 1e-9:
        turned = about(Z, -sign * np.radians(over)) @ matrix
        fixed = Rotation.from_matrix(turned).as_quat()
        q[:, j] = same_sign(fixed, q[:, j])


def _clipped(values: FloatArray, name: str) -> FloatArray:
    limit = LIMITS[name]
    return np.clip(values, limit.low + _MARGIN, limit.high - _MARGIN)
