"""Two-bone inverse kinematics for arms and legs."""

from __future__ import annotations

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.motion.rotations import basis, normalised, perpendicular, transpose


def soft_limit(distance: FloatArray, longest: float, margin: float = 0.01) -> FloatArray:
    """`distance` kept under `longest` by a smooth knee that starts `margin` (relative) before it."""
    start = longest * (1.0 - margin)
    over = np.maximum(distance - start, 0.0) / (longest - start)
    return np.where(distance <= start, distance, start + (longest - start) * np.tanh(over))


def two_bone(
    start: FloatArray, target: FloatArray, pole: FloatArray, first: float, second: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Middle joint and bone frames of a limb that reaches from `start` towards `target`.

    Args:
        start, target: (n, 3) positions [m]; a target out of reach is approached as far as 99.9 % of the length.
        pole: (n, 3) direction towards which the middle joint bends.
        first, second: bone lengths [m].

    Returns:
        (n, 3) middle joint position [m] and the (n, 3, 3) frames of the two bones: columns along the bone, towards
        the bend, and their cross product (the hinge).
    """
    reach = target - start
    distance = np.linalg.norm(reach, axis=-1)
    u = reach / distance[:, None]
    d = soft_limit(distance, 0.999 * (first + second))
    d = np.maximum(d, 1.02 * abs(first - second) + 1e-3)
    along = (first**2 - second**2 + d**2) / (2.0 * d)
    aside = np.sqrt(np.maximum(first**2 - along**2, 0.0))
    m = perpendicular(pole, u)
    middle = start + along[:, None] * u + aside[:, None] * m
    end = start + d[:, None] * u
    hinge = np.cross(u, m)
    frames = []
    for a, b in ((start, middle), (middle, end)):
        e = normalised(b - a)
        frames.append(np.stack([e, np.cross(hinge, e), hinge], axis=-1))
    return middle, frames[0], frames[1]


def from_rest(frames: FloatArray, u0: FloatArray, m0: FloatArray) -> FloatArray:
    """(n, 3, 3) rotations that take a bone from its rest direction `u0` and bend direction `m0` to `frames`."""
    return frames @ transpose(basis(u0, m0))
