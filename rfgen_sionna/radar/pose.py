"""Poses, trajectories and polarisations of radars. Device frame: boresight +x, y to the left, z up."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import make_interp_spline
from scipy.spatial.transform import Rotation, RotationSpline

from rfgen_sionna._short_repr import ShortRepr
from rfgen_sionna._types import FloatArray

Vector = tuple[float, float, float]

POLARIZATIONS: dict[str, Vector] = {
    "V": (0.0, 0.0, 1.0),
    "H": (0.0, 1.0, 0.0),
    "+45": (0.0, float(np.sqrt(0.5)), float(np.sqrt(0.5))),
    "-45": (0.0, -float(np.sqrt(0.5)), float(np.sqrt(0.5))),
}
"""Direction of an element's electric field at boresight, device frame."""


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


def vector(name: str, value: Any, owner: str = "radar.") -> Vector:
    """Three finite numbers; ValueError that names `owner` and `name` for anything else."""
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        array = np.zeros(0)
    if array.shape != (3,) or not np.all(np.isfinite(array)):
        raise ValueError(f"{owner}{name} is {value!r}: three finite numbers are needed")
    return float(array[0]), float(array[1]), float(array[2])


def pose_at(trajectory: Callable[[float], Any], t: float, orientation: Vector, owner: str) -> tuple[Vector, Vector]:
    """Position and orientation of a trajectory at time `t` [s]; `orientation` for one that returns a position alone."""
    place = trajectory(float(t))
    if isinstance(place, (tuple, list)) and len(place) == 2:
        place, orientation = place
    position = vector(f"trajectory: position at t = {t} s", place, owner)
    return position, vector(f"trajectory: orientation at t = {t} s", orientation, owner)


def look_at_angles(position: Vector, target: Vector) -> Vector:
    """Yaw, pitch and zero roll [rad] of a device at `position` with its boresight through `target` (world) [m];
    ValueError if both points coincide."""
    x, y, z = np.subtract(target, position)
    if np.hypot(np.hypot(x, y), z) < 1e-9:
        raise ValueError(f"radar.look_at is the radar's own position {position}: choose another point")
    return float(np.arctan2(y, x)), float(-np.arctan2(z, np.hypot(x, y))), 0.0


@dataclass(frozen=True, repr=False)
class Trajectory(ShortRepr):
    """A C² curve through positions and, if given, orientations, for storage in files.

    Outside its times the position continues straight on and the orientation is constant.

    Raises
    ------
    ValueError
        Times are not ascending, or a field has the wrong shape.
    """

    times: tuple[float, ...]
    """At least two ascending times [s]."""
    positions: tuple[Vector, ...]
    """World positions at `times` [m]."""
    orientations: tuple[Vector, ...] | None = None
    """Yaw, pitch, roll at `times` [rad]; None keeps the radar's orientation."""

    def __post_init__(self) -> None:
        times = np.asarray(self.times, dtype=np.float64)
        if times.ndim != 1 or len(times) < 2 or not np.all(np.isfinite(times)) or not np.all(np.diff(times) > 0):
            raise ValueError(f"trajectory.times is {self.times!r}: at least two finite, ascending times [s] are needed")
        object.__setattr__(self, "times", tuple(times.tolist()))
        for name in ("positions", "orientations"):
            value = getattr(self, name)
            if value is None and name == "orientations":
                continue
            array = np.asarray(value, dtype=np.float64)
            if array.shape != (len(times), 3) or not np.all(np.isfinite(array)):
                raise ValueError(
                    f"trajectory.{name} has shape {array.shape}: three finite numbers for each of {len(times)} times "
                    "are needed"
                )
            object.__setattr__(self, name, tuple(map(tuple, array.tolist())))

    @cached_property
    def _place(self) -> Any:
        return make_interp_spline(self.times, np.asarray(self.positions), k=min(3, len(self.times) - 1))

    @cached_property
    def _turn(self) -> RotationSpline:
        matrices = np.stack([rotation_matrix(angles) for angles in self.orientations or ()])
        return RotationSpline(self.times, Rotation.from_matrix(matrices))

    def __call__(self, t: float) -> Any:
        """Position [m], or a pair of position and orientation [rad], at time `t` [s]."""
        inside = min(max(float(t), self.times[0]), self.times[-1])
        position = self._place(inside) + (float(t) - inside) * self._place(inside, nu=1)
        if self.orientations is None:
            return tuple(position.tolist())
        yaw, pitch, roll = self._turn(inside).as_euler("ZYX").tolist()
        return tuple(position.tolist()), (yaw, pitch, roll)

    def to_dict(self) -> dict[str, Any]:
        """Record for JSON."""
        turned = self.orientations
        return {
            "times": list(self.times),
            "positions": [list(position) for position in self.positions],
            "orientations": None if turned is None else [list(angles) for angles in turned],
        }
