"""Two-way pattern gain of the elements towards points, and its gradient."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.radar.pattern import ElementPattern, Pattern
from rfgen_sionna.scene.kernels import FrozenKernel, drjit_types, upload
from rfgen_sionna.scene.mesh import lengths

_NEPERS = 0.1 * math.log(10.0)
"""Logarithm of a two-way field gain, which is a power gain, per dB."""


class PatternGain:
    """Two-way field gain of an element relative to its peak; `rotation` (3, 3) is from device to world frame."""

    def __init__(self, pattern: Pattern, rotation: FloatArray) -> None:
        self._pattern, self._rotation = pattern, rotation
        self._cuts = pattern.cubics if isinstance(pattern, ElementPattern) else None

    def gains(self, direction: FloatArray) -> FloatArray:
        """(...) gains towards unit vectors `direction` (..., 3), world."""
        if self._cuts is None:
            level = self._pattern.gain_db(direction @ self._rotation) - self._pattern.peak_gain_dbi
            return np.asarray(10.0 ** (level / 10.0), dtype=np.float64)
        return self._at(direction, 1).reshape(direction.shape[:-1])

    def gradients(self, offset: FloatArray) -> FloatArray | None:
        """(point, 3) gradient of the gain's logarithm [1/m] at `offset` (point, 3) [m] from the antennas, world; None
        if it is zero everywhere."""
        distance = np.maximum(lengths(offset), 1e-9)[:, None]
        if self._cuts is None:
            slope = self._pattern.slope_db((offset / distance) @ self._rotation) @ self._rotation.T
            pattern_gradient = _NEPERS * slope / distance
        else:
            pattern_gradient = self._at(offset / distance, 3).reshape(-1, 3) / distance
        return pattern_gradient if pattern_gradient.any() else None

    def _at(self, direction: FloatArray, columns: int) -> FloatArray:
        """(direction, columns) the gain, or in three columns the gradient of its logarithm [1/rad]."""
        count = direction.size // 3
        if not count or self._cuts is None:
            return np.zeros((0, columns))
        dr, types = drjit_types()
        found = dr.empty(types.Float64, count * columns)
        given = {
            "lanes": dr.arange(types.UInt32, count),
            "directions": upload(types.Float64, direction),
            "rotation": upload(types.Float64, self._rotation),
            "ends": [upload(types.Float64, angle) for angle, _ in self._cuts],
            "cubics": [upload(types.Float64, cubics) for _, cubics in self._cuts],
            "pieces": [dr.opaque(types.UInt32, cubics.shape[1]) for _, cubics in self._cuts],
            "found": found,
        }
        _EVALUATED_GAIN(given, columns)
        return np.asarray(found.numpy()).reshape(count, columns)


def _evaluate_gain(given: dict[str, Any], columns: int) -> None:
    """Kernel of :meth:`PatternGain._at`: gain for one column, gradient for three."""
    dr, types = drjit_types()
    Float, UInt32, lane = types.Float64, types.UInt32, given["lanes"]
    world = [dr.gather(Float, given["directions"], 3 * lane + axis) for axis in range(3)]
    turn = [[dr.gather(Float, given["rotation"], UInt32(3 * row + column)) for column in range(3)] for row in range(3)]
    x, y, z = (sum(world[row] * turn[row][column] for row in range(3)) for column in range(3))
    degrees = 180.0 / math.pi
    angles = dr.atan2(y, x) * degrees, dr.asin(dr.clip(z, -1.0, 1.0)) * degrees

    def cut(number: int) -> tuple[Any, Any]:
        """Level [dB] and slope [dB per degree], constant beyond the table's ends."""
        ends, cubics, pieces = (given[name][number] for name in ("ends", "cubics", "pieces"))
        low, high = dr.gather(Float, ends, UInt32(0)), dr.gather(Float, ends, pieces)
        angle = dr.clip(angles[number], low, high)

        def step(k: Any, piece: Any) -> tuple[Any, Any]:
            return k + 1, dr.select(angle >= dr.gather(Float, ends, k), k, piece)

        begun = dr.full(UInt32, 1, dr.width(lane)), dr.zeros(UInt32, dr.width(lane))
        piece = dr.while_loop(begun, lambda k, _: k < pieces, step)[1]
        along = angle - dr.gather(Float, ends, piece)
        a, b, c, d = (dr.gather(Float, cubics, power * pieces + piece) for power in range(4))
        level = ((a * along + b) * along + c) * along + d
        slope = (3.0 * a * along + 2.0 * b) * along + c
        within = (angles[number] > low) & (angles[number] < high)
        return level, dr.select(within, slope, 0.0)

    (around, turning), (up, rising) = (cut(number) for number in range(2))
    if columns == 1:
        values = [dr.exp(_NEPERS * (around + up))]
    else:
        # Bounded at the poles.
        level = dr.sqrt(dr.maximum(x * x + y * y, 1e-6))
        turning, rising = turning * degrees / (level * level), rising * degrees / level
        local = -turning * y - rising * z * x, turning * x - rising * z * y, rising * level * level
        values = [_NEPERS * sum(turn[axis][k] * local[k] for k in range(3)) for axis in range(3)]
    for k, each in enumerate(values):
        dr.scatter(given["found"], each, columns * lane + k, mode=dr.ReduceMode.Permute)
    dr.eval(given["found"])


_EVALUATED_GAIN = FrozenKernel(_evaluate_gain)
