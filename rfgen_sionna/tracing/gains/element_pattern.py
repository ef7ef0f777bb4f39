"""Two-way pattern gain of the elements towards points, and its gradient."""

from __future__ import annotations

import math

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.radar.pattern import Pattern
from rfgen_sionna.scene.mesh import lengths

_NEPERS = 0.1 * math.log(10.0)
"""Logarithm of a two-way field gain, which is a power gain, per dB."""


class PatternGain:
    """Two-way field gain of an element relative to its peak; `rotation` (3, 3) is from device to world frame."""

    def __init__(self, pattern: Pattern, rotation: FloatArray) -> None:
        self._pattern, self._rotation = pattern, rotation

    def gains(self, direction: FloatArray) -> FloatArray:
        """(...) gains towards unit vectors `direction` (..., 3), world."""
        level = self._pattern.gain_db(direction @ self._rotation) - self._pattern.peak_gain_dbi
        return np.asarray(10.0 ** (level / 10.0), dtype=np.float64)

    def gradients(self, offset: FloatArray) -> FloatArray | None:
        """(point, 3) gradient of the gain's logarithm [1/m] at `offset` (point, 3) [m] from the antennas, world; None
        if it is zero everywhere."""
        distance = np.maximum(lengths(offset), 1e-9)[:, None]
        slope = self._pattern.slope_db((offset / distance) @ self._rotation) @ self._rotation.T
        pattern_gradient = _NEPERS * slope / distance
        return pattern_gradient if pattern_gradient.any() else None
