"""Positions, orientations and polarisations in the device frame: boresight +x, z up, y to the left."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rfgen_sionna._types import FloatArray

Vector = tuple[float, float, float]

POLARIZATIONS: dict[str, Vector] = {
    "V": (0.0, 0.0, 1.0),
    "H": (0.0, 1.0, 0.0),
    "+45": (0.0, float(np.sqrt(0.5)), float(np.sqrt(0.5))),
    "-45": (0.0, -float(np.sqrt(0.5)), float(np.sqrt(0.5))),
}
"""Direction of the element's electric field at boresight, device frame."""


def rotation_matrix(orientation: ArrayLike) -> FloatArray:
    """(3, 3) rotation from the device to the world frame for (yaw, pitch, roll) [rad], Sionna's Rz Ry Rx."""
    angles = np.asarray(orientation, dtype=np.float64)
    (ca, cb, cc), (sa, sb, sc) = np.cos(angles), np.sin(angles)
    return np.array(
        [
            [ca * cb, ca * sb * sc - sa * cc, ca * sb * cc + sa * sc],
            [sa * cb, sa * sb * sc + ca * cc, sa * sb * cc - ca * sc],
            [-sb, cb * sc, cb * cc],
        ]
    )


def vector(name: str, value: Any) -> Vector:
    """Three finite numbers, or an error that names `radar.<name>` and the value."""
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"radar.{name} is {value!r}: three finite numbers are needed") from None
    if array.shape != (3,) or not np.all(np.isfinite(array)):
        raise ValueError(f"radar.{name} is {value!r}: three finite numbers are needed")
    return float(array[0]), float(array[1]), float(array[2])


def look_at_angles(position: Vector, target: Vector) -> Vector:
    """Yaw, pitch and no roll [rad] of a device at `position` whose boresight hits `target` [m, world]."""
    x, y, z = np.subtract(target, position)
    if np.hypot(np.hypot(x, y), z) < 1e-9:
        raise ValueError(f"radar.look_at is the radar's own position {position}: choose another point")
    return float(np.arctan2(y, x)), float(-np.arctan2(z, np.hypot(x, y))), 0.0
