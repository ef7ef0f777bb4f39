"""Motions of parts: turns about an axis by angles that are smooth functions of time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.things.articulated import Pose

Curve = Callable[[float], float]
"""A C² function of the time [s]."""


@dataclass(frozen=True)
class Steady:
    """Linear in time: an angle [rad] or a distance [m]."""

    rate: float
    """[rad/s] or [m/s]."""
    start: float = 0.0
    """[rad] or [m]."""

    def __call__(self, t: float) -> float:
        return self.start + self.rate * t


@dataclass(frozen=True)
class Rolling:
    """Angle [rad] of a wheel that rolls without slipping."""

    travelled: Curve
    """Distance of the hub along its way [m]."""
    radius: float
    """[m]"""
    start: float = 0.0
    """[rad]"""

    def __call__(self, t: float) -> float:
        return self.start + self.travelled(t) / self.radius


@dataclass(frozen=True)
class Swing:
    """Angle [rad] from rest to rest by the minimum-jerk profile (Flash and Hogan, J. Neurosci. 5 (1985) 1688).

    The largest rate is 15/8 of the mean one.
    """

    first: float
    """[rad]"""
    last: float
    """[rad]"""
    begin: float
    """Time at which it leaves [s]."""
    length: float
    """Time that it takes [s]."""

    def __call__(self, t: float) -> float:
        s = min(max((t - self.begin) / self.length, 0.0), 1.0)
        return self.first + (self.last - self.first) * s**3 * (10.0 + s * (6.0 * s - 15.0))


@dataclass(frozen=True, eq=False)
class Turning:
    """Pose of a part that turns about an axis, right-handed, after an optional pose of the axis itself."""

    axis: tuple[float, float, float]
    """Direction."""
    point: tuple[float, float, float]
    """A point on the axis [m]."""
    angle: Curve
    """[rad]"""
    carrier: Pose | None = None
    """Motion of the part that carries the axis."""

    def __call__(self, t: float) -> tuple[FloatArray, FloatArray]:
        x, y, z = np.asarray(self.axis, np.float64) / np.linalg.norm(self.axis)
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        angle = self.angle(t)
        turn = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * (cross @ cross)
        point = np.asarray(self.point, np.float64)
        shift = point - turn @ point
        if self.carrier is None:
            return turn, shift
        turn_by, shift_by = self.carrier(t)
        return turn_by @ turn, turn_by @ shift + shift_by


@dataclass(frozen=True, eq=False)
class Drifting:
    """Pose that drifts about its place as a hovering craft does, by two sines along each axis."""

    amplitude: float
    """Root mean square along each axis [m]."""
    rates: FloatArray
    """(2, 3) [rad/s]."""
    phases: FloatArray
    """(2, 3) [rad]."""

    def __call__(self, t: float) -> tuple[FloatArray, FloatArray]:
        return np.eye(3), self.amplitude * np.sin(self.rates * t + self.phases).sum(axis=0)
