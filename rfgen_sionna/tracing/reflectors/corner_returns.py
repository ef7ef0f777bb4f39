"""Estimate of the radar's own image by two or three planar parts: the image of the image."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.tracing.integral.obliquity import strongest_reflection
from rfgen_sionna.tracing.reflectors.clipped_footprints import DIRECT
from rfgen_sionna.tracing.reflectors.planar_reflectors import PlanarReflector


class CornerReturnEstimate:
    """Estimated return of the radar by two or three of the `reflectors`, numbered as given; None entries are unused."""

    def __init__(self, reflectors: Sequence[PlanarReflector | None], radar: Radar) -> None:
        self._view, self._wavelength, self._reach = np.asarray(radar.position), radar.wavelength, radar.max_range
        blank = next(each for each in reflectors if each is not None)
        filled = [each or blank for each in reflectors]
        self._normal = np.stack([each.normal for each in filled])
        self._height = np.array([float(each.height(self._view)) for each in filled])
        self._axes = np.stack([each.axes for each in filled])
        middle = [0.5 * (each.low + each.high) for each in filled]
        self._middle = np.stack(middle) - np.einsum("fai,i->fa", self._axes, self._view)
        self._half = np.stack([0.5 * (each.high - each.low) for each in filled])
        self._size = 4.0 * self._half.prod(axis=1)
        signs = np.array([(-1, -1), (-1, 1), (1, -1), (1, 1)])
        places = self._middle[:, None] + signs * self._half[:, None]
        self._corners = places @ self._axes - (self._height[:, None] * self._normal)[:, None]
        materials = [each.material for each in filled]
        every = np.arange(len(filled), dtype=np.int32)
        angles = np.array([1.0, 0.7, 0.4, 0.15])
        self._reflection = np.max(
            [
                strongest_reflection(materials, every, np.full(len(filled), cos), np.array([radar.center_frequency]))
                for cos in angles
            ],
            axis=0,
        )

    def _outside(self, reflector: NDArray[np.intp] | int, points: FloatArray) -> FloatArray:
        """(part, 3) offset [m] of the reflection points from the outline's rectangle."""
        axes = np.broadcast_to(self._axes[reflector], (len(points), 2, 3))
        excess = np.einsum("fai,fi->fa", axes, points) - self._middle[reflector]
        excess -= np.clip(excess, -self._half[reflector], self._half[reflector])
        return np.asarray(np.einsum("fai,fa->fi", axes, excess))

    def _left(self, reflector: NDArray[np.intp] | int, outside: FloatArray, length: FloatArray) -> FloatArray:
        """(part,) share of the wave at an offset `outside` (part, 3) [m] from the rectangle, by Fresnel's asymptote."""
        axes = np.broadcast_to(self._axes[reflector], (len(outside), 2, 3))
        excess = np.abs(np.einsum("fai,fi->fa", axes, outside))
        zone = 0.5 * np.sqrt(self._wavelength * length)
        tail = zone[:, None] / (np.pi * np.sqrt(2.0) * np.maximum(excess, 1e-12))
        return np.asarray(np.minimum(tail, 1.0).prod(axis=1))

    def _face(self, flat: NDArray[np.intp], reflector: int) -> NDArray[np.bool_]:
        """(part,) whether each has points in front of the `reflector` and vice versa; two sides of a box have none."""
        least = 0.1 * self._wavelength
        before = (self._corners[flat] @ self._normal[reflector]).max(axis=1) + self._height[reflector]
        behind_it = (self._corners[reflector] @ self._normal[flat].T).max(axis=0) + self._height[flat]
        return np.asarray((before > least) & (behind_it > least))

    def __call__(self, flat: NDArray[np.intp], first: int, last: int) -> FloatArray:
        """(part,) level of the path radar, reflector `first`, part, reflector `last` or straight, radar."""
        tx = -2.0 * self._height[first] * self._normal[first]
        rx = np.zeros(3) if last == DIRECT else -2.0 * self._height[last] * self._normal[last]
        normal, height = self._normal[flat], self._height[flat]
        to_tx, to_rx = normal @ tx + height, normal @ rx + height
        # Both images are in front of the part.
        sees = (to_tx > 0) & (to_rx > 0)
        for reflector in {first, last} - {DIRECT}:
            sees &= self._face(flat, reflector)
        behind = rx - 2.0 * to_rx[:, None] * normal
        length = np.maximum(np.linalg.norm(behind - tx, axis=1), self._wavelength)
        q = tx + (to_tx / np.maximum(to_tx + to_rx, 1e-9))[:, None] * (behind - tx)
        outside = self._outside(flat, q)
        share = self._left(flat, outside, length)
        for reflector, image in ((first, tx), (last, rx)):
            if reflector == DIRECT:
                continue
            # At a right angle the reflection point is on the edge, up to rounding.
            before = q @ self._normal[reflector] + self._height[reflector] + self._wavelength
            part = self._height[reflector] / np.maximum(before + self._height[reflector], 1e-9)
            crossing = image + part[:, None] * (q - image)
            # Beyond the end of a shared edge the path leaves both reflectors at one place, which counts once.
            edge = np.cross(normal, self._normal[reflector])
            edge /= np.maximum(np.linalg.norm(edge, axis=1), 1e-9)[:, None]
            there = self._outside(reflector, crossing)
            along, own = (np.einsum("fi,fi->f", each, edge) for each in (outside, there))
            same = np.where(along * own > 0, np.copysign(np.minimum(np.abs(along), np.abs(own)), own), 0.0)
            left = self._left(reflector, there - same[:, None] * edge, length)
            share = share * np.where(before > 0, left, 0.0)
            share = share * self._reflection[reflector]
        share = share * self._reflection[flat]
        # A smaller mirror shows no more than its own return.
        size = np.minimum(self._size[flat], self._size[first]) if last == DIRECT else self._size[flat]
        most = np.minimum(self._wavelength / length, 4.0 * size / length**2)
        return np.where(sees & (length < 2 * self._reach), share * most / (4 * np.pi), 0.0)
