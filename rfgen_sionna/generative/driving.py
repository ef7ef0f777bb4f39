"""Trajectories of rigid objects along a path: cars, carts, drones."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from rfgen_sionna._types import FloatArray

_FINE = 400
"""Samples per point of a path for the trapezoidal sum of its arc length."""


@dataclass(frozen=True)
class Drive:
    """Trajectory for :class:`rfgen_sionna.scene.MeshActor`: smooth through points, from standstill to standstill.

    A call with a time [s] returns the position [m] and the orientation (yaw, pitch, roll) [rad] along the path. Curve
    and speed are C², and so is the phase of reflections. The curve swings out at sharp corners.

    Raises:
        ValueError: fewer than two points, equal successive ones, or a speed or ramp out of range.
    """

    points: ArrayLike
    """(point, 3) positions on the path in order [m]; (point, 2) stay at height 0."""
    speed: float
    """Cruising speed [m/s]."""
    ramp: float = 1.5
    """Time from standstill to cruising speed, and back at the end [s]; 0 starts and ends at full speed."""
    _curve: CubicSpline = field(init=False, repr=False, compare=False)
    _arc: FloatArray = field(init=False, repr=False, compare=False)
    _parameter: CubicSpline = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        points = np.asarray(self.points, np.float64)
        if points.ndim != 2 or points.shape[1] not in (2, 3) or len(points) < 2 or not np.isfinite(points).all():
            raise ValueError(f"points: shape {points.shape}; allowed are two or more finite points (x, y) or (x, y, z)")
        if points.shape[1] == 2:
            points = np.column_stack([points, np.zeros(len(points))])
        steps = np.linalg.norm(np.diff(points, axis=0), axis=-1)
        if not (steps > 0.0).all():
            raise ValueError("points: two that follow each other are the same")
        if not (np.isfinite(self.speed) and self.speed > 0.0):
            raise ValueError(f"speed: {self.speed!r} m/s; allowed is more than 0")
        if not (np.isfinite(self.ramp) and self.ramp >= 0.0):
            raise ValueError(f"ramp: {self.ramp!r} s; allowed is 0 or more")
        object.__setattr__(self, "points", points)
        knots = np.concatenate([[0.0], np.cumsum(steps)])
        curve = CubicSpline(knots, points, bc_type="natural" if len(points) > 2 else "not-a-knot")
        # arc length over the spline's parameter, then inverted
        u = np.linspace(0.0, knots[-1], _FINE * len(points))
        rate = np.linalg.norm(curve(u, 1), axis=-1)
        length = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(u))])
        object.__setattr__(self, "_curve", curve)
        object.__setattr__(self, "_arc", length)
        object.__setattr__(self, "_parameter", CubicSpline(length, u))

    @property
    def length(self) -> float:
        """Length of the path [m]."""
        return float(self._arc[-1])

    @property
    def duration(self) -> float:
        """Time from start to end [s]."""
        return self.length / self.speed + self._ramp

    @property
    def _ramp(self) -> float:
        return min(self.ramp, self.length / self.speed)

    def travelled(self, t: float) -> float:
        """Distance along the path [m] at `t` [s]; 0 before the start, :attr:`length` after the end."""
        if self._ramp == 0.0:
            return float(np.clip(t * self.speed, 0.0, self.length))
        return (
            self.speed
            * self._ramp
            * (ramp_integral(t / self._ramp) - ramp_integral((t - self.length / self.speed) / self._ramp))
        )

    def __call__(self, t: float) -> tuple[FloatArray, tuple[float, float, float]]:
        u = float(self._parameter(self.travelled(t)))
        x, y, z = self._curve(u, 1)
        return self._curve(u), (float(np.arctan2(y, x)), float(-np.arctan2(z, np.hypot(x, y))), 0.0)


def ramp_integral(s: float) -> float:
    """Integral of the minimum-jerk profile: 0 before 0, s - 1/2 after 1."""
    if s <= 0.0:
        return 0.0
    if s >= 1.0:
        return s - 0.5
    return s**4 * (2.5 + s * (s - 3.0))
