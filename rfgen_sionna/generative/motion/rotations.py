"""Rotations as arrays: (..., 3, 3) matrices, and unit quaternions (x, y, z, w) in records."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import FloatArray

X, Y, Z = np.eye(3)


def about(axis: FloatArray, angle: FloatArray | float) -> FloatArray:
    """(..., 3, 3) rotation by `angle` [rad] about the unit vector `axis` (..., 3)."""
    angle = np.asarray(angle, float)
    vector = np.asarray(axis, float) * angle[..., None]
    return Rotation.from_rotvec(vector.reshape(-1, 3)).as_matrix().reshape(*vector.shape[:-1], 3, 3)


def normalised(v: FloatArray) -> FloatArray:
    """Unit vectors of `v` (..., 3)."""
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def perpendicular(v: FloatArray, u: FloatArray) -> FloatArray:
    """Unit vector of the part of `v` (..., 3) perpendicular to the unit vector `u` (..., 3)."""
    return normalised(v - np.sum(v * u, axis=-1, keepdims=True) * u)


def basis(u: FloatArray, m: FloatArray) -> FloatArray:
    """(..., 3, 3) right-handed frame with columns u, m (made perpendicular to u) and u × m."""
    u = normalised(u)
    m = perpendicular(m, u)
    return np.stack([u, m, np.cross(u, m)], axis=-1)


def between(a: FloatArray, b: FloatArray) -> FloatArray:
    """(..., 3, 3) smallest rotation from unit vector `a` to unit vector `b` (not opposite)."""
    a, b = np.broadcast_arrays(a, b)
    v = np.cross(a, b)
    c = np.sum(a * b, axis=-1)[..., None, None]
    zero = np.zeros(v.shape[:-1])
    k = np.stack(
        [zero, -v[..., 2], v[..., 1], v[..., 2], zero, -v[..., 0], -v[..., 1], v[..., 0], zero], axis=-1
    ).reshape(*v.shape[:-1], 3, 3)
    return np.eye(3) + k + k @ k / (1.0 + c)


def transpose(r: FloatArray) -> FloatArray:
    """Inverse of (..., 3, 3) rotations."""
    return np.swapaxes(r, -1, -2)


def to_quaternions(r: FloatArray) -> FloatArray:
    """(..., 4) unit quaternions (x, y, z, w) of (frame, ..., 3, 3) rotations; signs are continuous along axis 0."""
    q = Rotation.from_matrix(r.reshape(-1, 3, 3)).as_quat().reshape(*r.shape[:-2], 4)
    return continuous(q)


def continuous(q: FloatArray) -> FloatArray:
    """Quaternions (frame, ..., 4) with signs that are continuous along axis 0."""
    if len(q) < 2:
        return q
    flips = np.where(np.sum(q[1:] * q[:-1], axis=-1) < 0.0, -1.0, 1.0)
    signs = np.concatenate([np.ones_like(flips[:1]), np.cumprod(flips, axis=0)])
    return q * signs[..., None]


def same_sign(q: FloatArray, other: FloatArray) -> FloatArray:
    """Quaternions `q` (..., 4) with the sign that is nearer to `other` (..., 4)."""
    return q * np.where(np.sum(q * other, axis=-1, keepdims=True) < 0.0, -1.0, 1.0)


def to_matrices(q: FloatArray) -> FloatArray:
    """(..., 3, 3) rotations of (..., 4) quaternions (x, y, z, w) of any length."""
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    x, y, z, w = np.moveaxis(q, -1, 0)
    return np.stack(
        [
            1 - 2 * (y * y + z * z),
            2 * (x * y - z * w),
            2 * (x * z + y * w),
            2 * (x * y + z * w),
            1 - 2 * (x * x + z * z),
            2 * (y * z - x * w),
            2 * (x * z - y * w),
            2 * (y * z + x * w),
            1 - 2 * (x * x + y * y),
        ],
        axis=-1,
    ).reshape(*q.shape[:-1], 3, 3)


def twist_angle(r: FloatArray, axis: FloatArray) -> FloatArray:
    """(...) angle [rad] of rotations `r` (..., 3, 3) about the fixed unit vector `axis` (3,)."""
    q = Rotation.from_matrix(r.reshape(-1, 3, 3)).as_quat().reshape(*r.shape[:-2], 4)
    return 2.0 * np.arctan2(q[..., :3] @ axis * np.sign(q[..., 3] + 1e-300), np.abs(q[..., 3]))
