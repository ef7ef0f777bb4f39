"""Clipping of triangles to half-spaces."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray

_MIN_AREA = 1e-9
"""Least area of a piece relative to its triangle: smaller ones are rounding errors."""


def clip_triangles(
    corners: FloatArray,
    owner: NDArray[np.intp],
    sides: FloatArray,
    offsets: FloatArray,
    spared: NDArray[np.intp] | None = None,
) -> tuple[FloatArray, NDArray[np.intp]]:
    """Parts of triangles `corners` (triangle, 3, 3) where sides . x >= offsets for all `sides` (side, 3), `offsets`
    (side,). `owner` (triangle,) are any numbers, which pieces inherit; `spared` (owner,) is the index of a side that is
    skipped for an owner. Returns corners (piece, 3, 3) and owners (piece,)."""
    size = triangle_areas(corners)
    least = np.zeros(int(owner.max(initial=-1)) + 1)
    np.maximum.at(least, owner, _MIN_AREA * size)
    for number, (side, offset) in enumerate(zip(sides, offsets, strict=True)):
        if len(corners) == 0:
            break
        height = corners @ side - offset
        if spared is not None:
            height[spared[owner] == number] = 1.0
        corners, owner = _halve(corners, owner, height)
    kept = triangle_areas(corners) > least[owner]
    return corners[kept], owner[kept]


def triangle_areas(corners: FloatArray) -> FloatArray:
    """(triangle,) areas [m^2] of triangles `corners` (triangle, 3, 3) [m]."""
    edges = corners[:, 1:] - corners[:, :1]
    return np.asarray(0.5 * np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1))


def _halve(corners: FloatArray, owner: NDArray[np.intp], height: FloatArray) -> tuple[FloatArray, NDArray[np.intp]]:
    """Parts of triangles where `height` (triangle, corner), linear in them, is not negative."""
    inside = height >= 0
    count = inside.sum(axis=1)
    whole = count == 3
    parts, owners = [corners[whole]], [owner[whole]]
    for number in (1, 2):
        index = np.flatnonzero(count == number)
        if len(index) == 0:
            continue
        # The single corner of a side comes first.
        alone = np.argmax(inside[index] == (number == 1), axis=1)
        order = (alone[:, None] + np.arange(3)) % 3
        p = np.take_along_axis(corners[index], order[:, :, None], axis=1)
        h = np.take_along_axis(height[index], order, axis=1)
        share = h[:, :1] / (h[:, :1] - h[:, 1:])  # of the edges from that corner
        crossing = p[:, :1] + share[:, :, None] * (p[:, 1:] - p[:, :1])
        if number == 1:
            parts.append(np.stack([p[:, 0], crossing[:, 0], crossing[:, 1]], axis=1))
            owners.append(owner[index])
        else:
            parts.append(np.stack([crossing[:, 0], p[:, 1], p[:, 2]], axis=1))
            parts.append(np.stack([crossing[:, 0], p[:, 2], crossing[:, 1]], axis=1))
            owners += [owner[index], owner[index]]
    return np.concatenate(parts), np.concatenate(owners)
