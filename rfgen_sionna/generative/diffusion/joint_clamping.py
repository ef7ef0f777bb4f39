"""Joints kept within what people can do, where an angle is a single joint's own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.motion.limits import LIMITS
from rfgen_sionna.generative.motion.rotations import Z, about
from rfgen_sionna.generative.motion.skeleton import FINGERS, JOINT, SIDES, side_sign
from rfgen_sionna.records import Motion

_MARGIN = 0.5
"""Kept from the limits [degrees]."""
_FINGERS = ((1, "knuckle"), (2, "middle joint"), (3, "end joint"))


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
            # the same sign as before, so that splines through the quaternions stay short
            flip = np.sign(np.sum(fixed * q[moved, j], axis=-1, keepdims=True))
            q[moved, j] = fixed * np.where(flip == 0.0, 1.0, flip)

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
        # a turn about the rest pose's vertical: flexion is the angle by which the forearm's axis turns about it
        turned = about(Z, -sign * np.radians(over)) @ matrix
        fixed = Rotation.from_matrix(turned).as_quat()
        q[:, j] = fixed * np.where(np.sum(fixed * q[:, j], axis=-1, keepdims=True) < 0.0, -1.0, 1.0)


def _clipped(values: FloatArray, name: str) -> FloatArray:
    limit = LIMITS[name]
    return np.clip(values, limit.low + _MARGIN, limit.high - _MARGIN)
