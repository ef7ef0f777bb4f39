"""How much of a body's skin lies inside the body: limbs in the trunk, hands in thighs, folds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray, IntArray

_CELL = 0.004
"""Cells of the grid in which triangles are looked for [m]."""
_OFF = 1e-3
"""How far off the skin it is asked what lies there [m]."""


def buried_faces(vertices: FloatArray, faces: IntArray) -> NDArray[np.bool_]:
    """(face,) whether the point 1 mm before the middle of a face is inside the mesh.

    A closed surface that nowhere passes through itself has none. The winding number of the point is the sum of signed
    crossings of the surface by the ray from it along +z.

    Args:
        vertices: (vertex, 3) [m].
        faces: (face, 3) vertex indices of a closed surface, counter-clockwise seen from outside.
    """
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    points = corners.mean(axis=1) + _OFF * normals / np.maximum(length, 1e-18)
    low = corners[..., :2].min(axis=(0, 1))
    first, last = (
        np.floor((x - low) / _CELL).astype(int) for x in (corners.min(axis=1)[:, :2], corners.max(axis=1)[:, :2])
    )
    wide = int(last[:, 1].max()) + 2
    # each triangle in every cell that its shadow's box touches
    span = last - first + 1
    count = span.prod(axis=1)
    owner = np.repeat(np.arange(len(faces)), count)
    at = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
    cell = (first[owner, 0] + at // span[owner, 1]) * wide + first[owner, 1] + at % span[owner, 1]
    order = np.argsort(cell, kind="stable")
    cell, owner = cell[order], owner[order]
    place = np.floor((points[:, :2] - low) / _CELL).astype(int)
    inside = (place >= 0).all(axis=1) & (place[:, 1] < wide)
    asked = np.where(inside, place[:, 0] * wide + place[:, 1], -1)
    start, stop = np.searchsorted(cell, asked), np.searchsorted(cell, asked, side="right")
    many = stop - start
    point = np.repeat(np.arange(len(points)), many)
    triangle = owner[np.repeat(start, many) + np.arange(len(point)) - np.repeat(np.cumsum(many) - many, many)]
    crossing = _crossings(points[point], corners[triangle])
    return np.bincount(point, crossing, minlength=len(points)) > 0.5


def buried_share(vertices: FloatArray, faces: IntArray) -> float:
    """Share of the surface's area that is inside the body."""
    corners = vertices[faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return float(area[buried_faces(vertices, faces)].sum() / area.sum())


def _crossings(points: FloatArray, corners: FloatArray) -> FloatArray:
    """(pair,) +1 where the ray from a point along +z leaves through a triangle, -1 where it enters, else 0."""
    a, b, c = (corners[:, k] - points for k in range(3))

    def side(p: FloatArray, q: FloatArray) -> FloatArray:
        # the same number with the other sign for both triangles of an edge, so that no ray slips between them
        return np.asarray(p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0], np.float64)

    u, v, w = side(b, c), side(c, a), side(a, b)
    up = (u > 0.0) & (v > 0.0) & (w > 0.0)
    down = (u < 0.0) & (v < 0.0) & (w < 0.0)
    total = u + v + w
    height = np.divide(u * a[:, 2] + v * b[:, 2] + w * c[:, 2], total, out=np.zeros_like(total), where=total != 0.0)
    return np.where(height > 0.0, up.astype(float) - down.astype(float), 0.0)
