"""Roughly how strong a radar sees itself by two or three flat parts: the image of the image."""

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
    """Roughly how strong the radar sees itself by two or three flat parts."""

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
        """(flat, 3) how far [m] the points of reflection are beside the outline's rectangle."""
        axes = np.broadcast_to(self._axes[reflector], (len(points), 2, 3))
        excess = np.einsum("fai,fi->fa", axes, points) - self._middle[reflector]
        excess -= np.clip(excess, -self._half[reflector], self._half[reflector])
        return np.asarray(np.einsum("fai,fa->fi", axes, excess))

    def _left(self, reflector: NDArray[np.intp] | int, outside: FloatArray, length: FloatArray) -> FloatArray:
        """(flat,) share of the wave that is left so far `outside` (flat, 3) [m] the rectangle."""
        axes = np.broadcast_to(self._axes[reflector], (len(outside), 2, 3))
        excess = np.abs(np.einsum("fai,fi->fa", axes, outside))
        zone = 0.5 * np.sqrt(self._wavelength * length)
        tail = zone[:, None] / (np.pi * np.sqrt(2.0) * np.maximum(excess, 1e-12))
        return np.asarray(np.minimum(tail, 1.0).prod(axis=1))

    def _face(self, flat: NDArray[np.intp], reflector: int) -> NDArray[np.bool_]:
        """(flat,) whether each has points in front of the `reflector`, and that in front of it: two sides of a box have
        not."""
        least = 0.1 * self._wavelength
        before = (self._corners[flat] @ self._normal[reflector]).max(axis=1) + self._height[reflector]
        behind_it = (self._corners[reflector] @ self._normal[flat].T).max(axis=0) + self._height[flat]
        return np.asarray((before > least) & (behind_it > least))

    def __call__(self, flat: NDArray[np.intp], first: int, last: int) -> FloatArray:
        """(flat,) levels of radar, plate `first`, flat parts, plate `last` or straight, radar."""
        tx = -2.0 * self._height[first] * self._normal[first]
        rx = np.zeros(3) if last == DIRECT else -2.0 * self._height[last] * self._normal[last]
        normal, height = self._normal[flat], self._height[flat]
        to_tx, to_rx = normal @ tx + height, normal @ rx + height
        # Both images in front of the flat part, on the same side: else the image does not light it.
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
            # Of a right angle the point of reflection is on its edge, give or take what coordinates are rounded by.
            before = q @ self._normal[reflector] + self._height[reflector] + self._wavelength
            part = self._height[reflector] / np.maximum(before + self._height[reflector], 1e-9)
            crossing = image + part[:, None] * (q - image)
            # Beyond the end of the edge that both share, the way leaves the one where it leaves the other: once.
            edge = np.cross(normal, self._normal[reflector])
            edge /= np.maximum(np.linalg.norm(edge, axis=1), 1e-9)[:, None]
            there = self._outside(reflector, crossing)
            along, own = (np.einsum("fi,fi->f", each, edge) for each in (outside, there))
            same = np.where(along * own > 0, np.copysign(np.minimum(np.abs(along), np.abs(own)), own), 0.0)
            left = self._left(reflector, there - same[:, None] * edge, length)
            share = share * np.where(before > 0, left, 0.0)
            share = share * self._reflection[reflector]
        share = share * self._reflection[flat]
        # Of two, a mirror that is smaller shows no more than it could return.
        size = np.minimum(self._size[flat], self._size[first]) if last == DIRECT else self._size[flat]
        most = np.minimum(self._wavelength / length, 4.0 * size / length**2)
        return np.where(sees & (length < 2 * self._reach), share * most / (4 * np.pi), 0.0)
