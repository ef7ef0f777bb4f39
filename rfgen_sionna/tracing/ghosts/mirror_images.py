"""Plane mirrors and mirrors seen by mirrors: image points and unfolded paths."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.scene.materials import Material


@dataclass(frozen=True, eq=False)
class Mirror:
    """Flat, connected part of one static object; compared and hashed by identity."""

    name: str
    """Name of the object."""
    material: Material
    faces: NDArray[np.int64]
    """(face,) numbers among all faces of the ray scene."""
    normal: FloatArray
    """(3,) unit normal towards the radar."""
    offset: float
    """normal . x of its points in the world frame [m]."""
    axes: FloatArray
    """(2, 3) unit vectors in the plane."""
    low: FloatArray
    """(2,) least coordinate along the axes [m]."""
    high: FloatArray
    """(2,) largest coordinate along the axes [m]."""
    bounces: ClassVar[int] = 1
    """Number of reflections on a leg via it."""

    def height(self, points: FloatArray) -> FloatArray:
        """(...) distance of `points` (..., 3) from the plane [m], positive on the radar's side."""
        return np.asarray(points @ self.normal - self.offset)

    def image(self, points: FloatArray) -> FloatArray:
        """Mirror images (..., 3) [m]."""
        return np.asarray(points - 2.0 * self.height(points)[..., None] * self.normal)

    def unfolded(self, points: FloatArray) -> FloatArray:
        """Apparent position (..., 3) of `points` (..., 3) as seen from the radar [m]."""
        return self.image(points)

    def crossings(self, viewpoint: FloatArray, points: FloatArray) -> FloatArray:
        """(point, 3) reflection points between the viewpoint and `points` (point, 3) [m], all on one side."""
        here, there = self.height(viewpoint), self.height(points)[:, None]
        foot_here, foot_there = viewpoint - here * self.normal, points - there * self.normal
        return np.asarray((there * foot_here + here * foot_there) / np.maximum(here + there, 1e-12))

    def spans(self, points: FloatArray, margin: FloatArray | float = 0.0) -> NDArray[np.bool_]:
        """(point,) whether points of the plane lie in the mirror's bounding rectangle, widened by `margin` [m]."""
        place = points @ self.axes.T
        margin = np.broadcast_to(np.asarray(margin), len(points))[:, None]
        return np.asarray(((place > self.low - margin) & (place < self.high + margin)).all(axis=1))


@dataclass(frozen=True, eq=False)
class SecondOrderImage(Mirror):
    """Mirror that the radar sees via another one, `before`."""

    before: Mirror
    bounces: ClassVar[int] = 2

    @staticmethod
    def of(before: Mirror, mirror: Mirror) -> SecondOrderImage:
        """Leg by `before`, then by `mirror`."""
        return SecondOrderImage(**{each.name: getattr(mirror, each.name) for each in fields(Mirror)}, before=before)

    def image(self, points: FloatArray) -> FloatArray:
        """Images (..., 3) of the radar's elements [m]."""
        return super().image(self.before.image(points))

    def unfolded(self, points: FloatArray) -> FloatArray:
        """Apparent position (..., 3) of `points` via both mirrors [m]."""
        return self.before.image(super().image(points))

    def crossings(self, viewpoint: FloatArray, points: FloatArray) -> FloatArray:
        """(point, 3) reflection points on the second mirror [m]."""
        return super().crossings(self.before.image(viewpoint), points)


class Unfolding:
    """Apparent positions via mirrors of one order, relative to an `origin` (3,) [m]."""

    def __init__(self, mirrors: Sequence[Mirror], origin: FloatArray) -> None:
        ways = [[mirror] + ([mirror.before] if isinstance(mirror, SecondOrderImage) else []) for mirror in mirrors]
        self._steps = [_planes(step, origin) for step in zip(*ways, strict=True)]

    def __call__(self, places: FloatArray, mirror: NDArray[np.integer[Any]]) -> FloatArray:
        """(facet, 3) apparent positions [m] of `places` (facet, 3) [m], each via its `mirror` (facet,)."""
        for normals, heights in self._steps:
            height = np.einsum("fi,fi->f", places, normals[mirror]) + heights[mirror]
            places = places - 2.0 * height[:, None] * normals[mirror]
        return places


def _planes(mirrors: Sequence[Mirror], origin: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(mirror, 3) normals and (mirror,) heights of the origin [m]."""
    return np.stack([each.normal for each in mirrors]), np.array([float(each.height(origin)) for each in mirrors])
