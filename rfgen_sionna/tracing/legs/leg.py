"""Legs by plane mirrors: images of the radar, the segments between mirrors, and windows.

All positions are relative to the phase centre. Seen from a facet, a leg by mirrors 1 … n starts at the image V of the
phase centre. Segment i lies between mirrors i and i + 1; T_i = M_n … M_(i+1), with the mirror images M, takes it to the
space of the last segment, in which the whole leg is straight.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rfgen_sionna._types import FloatArray

MARGIN = 5e-4
"""Distance [m] from a mirror below which nothing occludes: parts of the mirror itself, and of edges that touch it."""


@dataclass(frozen=True, eq=False)
class Mirror:
    """A plane mirror at one time, seen from one side."""

    part: int
    """Number of the planar part."""
    normal: FloatArray
    """(3,) towards the wave that it reflects."""
    offset: float
    """normal . x of its points [m]."""
    windows: tuple[FloatArray, ...]
    """Convex polygons (corner, 3) [m] of its outline."""

    def height(self, points: FloatArray) -> FloatArray:
        """(...) distance [m] of `points` (..., 3) before it."""
        return np.asarray(points @ self.normal - self.offset)


@dataclass(frozen=True, eq=False)
class Segment:
    """A part of a leg in the space of its last segment, relative to the image of the phase centre."""

    turn: FloatArray
    """(3, 3) rotation or reflection."""
    shift: FloatArray
    """(3,) [m]"""
    planes: FloatArray
    """(plane, 4) n . x >= d of the half-spaces between its mirrors."""

    @property
    def flipped(self) -> bool:
        """Whether it is a mirror image."""
        return bool(np.linalg.det(self.turn) < 0)

    def image(self, points: FloatArray) -> FloatArray:
        """(point, 3) `points` in that space."""
        return points @ self.turn.T + self.shift


@dataclass(frozen=True, eq=False)
class Leg:
    """A leg by `mirrors` in order from the radar, at one time."""

    mirrors: tuple[Mirror, ...]

    @cached_property
    def _images(self) -> list[tuple[FloatArray, FloatArray]]:
        """Rotation (3, 3) and shift (3,) of each T_i."""
        turn, shift = np.eye(3), np.zeros(3)
        found = [(turn, shift)]
        for mirror in reversed(self.mirrors):  # T_(i-1) x = T_i (M_i x)
            n = mirror.normal
            shift = shift + 2.0 * mirror.offset * (turn @ n)
            turn = turn - 2.0 * np.outer(turn @ n, n)
            found.append((turn, shift))
        return found[::-1]

    @property
    def view(self) -> FloatArray:
        """(3,) image of the phase centre [m]."""
        return self._images[0][1]

    def image(self, points: FloatArray) -> FloatArray:
        """(point, 3) images [m] of elements at `points`."""
        turn, shift = self._images[0]
        return np.ascontiguousarray(points @ turn.T + shift)

    def turned(self, directions: FloatArray) -> FloatArray:
        """(..., 3) images of `directions`."""
        return np.asarray(directions @ self._images[0][0].T)

    def departures(self, points: FloatArray) -> FloatArray:
        """(..., 3) unit vectors from the radar along the leg to `points` (..., 3) [m]."""
        offset = (points - self.view) @ self._images[0][0]
        return np.asarray(offset / np.maximum(np.linalg.norm(offset, axis=-1, keepdims=True), 1e-12))

    @cached_property
    def normals(self) -> FloatArray:
        """(mirror, 3) normals in the space of the last segment."""
        found = [turn @ mirror.normal for (turn, _), mirror in zip(self._images[1:], self.mirrors, strict=True)]
        return np.array(found).reshape(-1, 3)

    @cached_property
    def segments(self) -> tuple[Segment, ...]:
        """Segments in order from the radar."""
        found = []
        for number, (turn, shift) in enumerate(self._images):
            planes = []
            for mirror in self.mirrors[max(number - 1, 0) : number + 1]:
                n = turn @ mirror.normal
                planes.append([*n, mirror.offset + MARGIN + n @ (shift - self.view)])
            found.append(Segment(turn, shift - self.view, np.array(planes).reshape(-1, 4)))
        return tuple(found)

    @cached_property
    def windows(self) -> tuple[tuple[FloatArray, ...], ...]:
        """Windows of each mirror relative to `view`, in the space of the last segment."""
        return tuple(
            tuple(np.ascontiguousarray(window @ turn.T + shift - self.view) for window in mirror.windows)
            for (turn, shift), mirror in zip(self._images[1:], self.mirrors, strict=True)
        )

    @property
    def convex(self) -> bool:
        """Whether each mirror is one convex polygon, so that facets are clipped to it."""
        return all(len(each) == 1 for each in self.windows)

    @cached_property
    def planes(self) -> FloatArray:
        """(plane, 4) n . x >= d of half-spaces that the leg reaches, relative to the phase centre: the front of the
        last mirror, and for convex mirrors the sides of the cone from the image through each."""
        if not self.mirrors:
            return np.zeros((0, 4))
        last = self.mirrors[-1]
        found = [np.array([[*last.normal, last.offset]])]
        for (window,) in self.windows if self.convex else ():
            n = cone(window)
            found.append(np.column_stack([n, n @ self.view]))
        return np.ascontiguousarray(np.concatenate(found))


def cone(window: FloatArray) -> FloatArray:
    """(side, 3) unit normals, inwards, of the sides of the cone from the origin through a polygon `window` (corner,
    3)."""
    n = np.cross(window, np.roll(window, -1, axis=0))
    n /= np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-300)
    return n if (n @ window.mean(axis=0)).sum() > 0 else -n
