"""Directions as whole numbers: a triangle of an octahedron, divided again and again, is a tube of rays.

A direction is v / |v| of whole numbers v with |v_0| + |v_1| + |v_2| = `SIZE`. Straight lines on the octahedron are
planes through the source, so that straight edges of things are straight across a tube; and neighbouring tubes share
corners to the bit, so that no ray is sent twice and no gap opens between them.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray

SIZE = 3 * 2**27
"""Sum of a node's coordinates: 4e-9 rad from one to the next."""
Nodes = NDArray[np.int64]
"""(..., 3)"""


def cells(level: int) -> Nodes:
    """(cell, corner, 3) all triangles of a `level`: every edge of the octahedron in 2^level parts."""
    count = 2**level
    i, j = (each.ravel() for each in np.meshgrid(np.arange(count), np.arange(count), indexing="ij"))
    up, down = i + j <= count - 1, i + j <= count - 2
    found = [_corners(i[up], j[up], count - 1 - i[up] - j[up], True)]
    found.append(_corners(i[down], j[down], count - 2 - i[down] - j[down], False))
    one = np.concatenate(found) * (SIZE // count)
    return np.concatenate([one * np.array(signs) for signs in product((1, -1), repeat=3)])


def _corners(i: NDArray[np.int64], j: NDArray[np.int64], k: NDArray[np.int64], up: bool) -> Nodes:
    low = np.stack([i, j, k], axis=-1)[:, None]
    unit = np.eye(3, dtype=np.int64)
    return np.asarray(low + (unit if up else 1 - unit))


def cells_of(directions: FloatArray, level: int) -> Nodes:
    """(cell, corner, 3) the triangles of a `level` that any of some directions (direction, 3) fall into."""
    count = 2**level
    sign = np.where(directions < 0, -1, 1)
    place = np.abs(directions)
    place = place / place.sum(axis=1, keepdims=True) * count
    low = np.minimum(np.floor(place), count - 1).astype(np.int64)
    rest = count - low.sum(axis=1)
    up = rest <= 1
    short = np.flatnonzero(rest < 1)  # on a corner: any triangle around it will do
    low[short, np.argmax(low[short], axis=1)] -= 1
    corner = np.where(up[:, None, None], np.eye(3, dtype=np.int64), 1 - np.eye(3, dtype=np.int64)) + low[:, None]
    corner *= sign[:, None] * (SIZE // count)
    _, first = np.unique(cell_keys(corner), return_index=True)
    return np.asarray(corner[first])


def middle(a: Nodes, b: Nodes) -> Nodes:
    """(..., 3) half way between nodes of one face."""
    return _node(a + b, (np.abs(a) + np.abs(b)) // 2)


def centre(corners: Nodes) -> Nodes:
    """(cell, 3) of triangles (cell, 3, 3)."""
    return _node(corners.sum(axis=1), np.abs(corners).sum(axis=1) // 3)


def _node(sign: Nodes, size: Nodes) -> Nodes:
    size = size.copy()
    size[..., 2] = SIZE - size[..., 0] - size[..., 1]
    return np.asarray(np.where(sign < 0, -size, size))


def nearest(directions: FloatArray) -> Nodes:
    """(..., 3) the nodes next to directions (..., 3) of any length, in the lattice's frame."""
    size = np.abs(directions)
    size = np.rint(size / size.sum(axis=-1, keepdims=True) * SIZE).astype(np.int64)
    over = np.maximum(size[..., 0] + size[..., 1] - SIZE, 0)
    size[..., 1] -= over
    return _node(np.where(directions < 0, -1, 1), size)


def keys(nodes: Nodes) -> NDArray[np.int64]:
    """(...,) one number for each node."""
    return np.asarray(((nodes[..., 0] + SIZE) * (2 * SIZE + 1) + nodes[..., 1] + SIZE) * 2 + (nodes[..., 2] < 0))


def cell_keys(corners: Nodes) -> NDArray[np.int64]:
    """(cell,) one number for each triangle of a level: its centre's."""
    return keys(centre(corners))


def quarters(corners: Nodes) -> Nodes:
    """(4 cell, 3, 3) the four triangles that triangles (cell, 3, 3) are divided into."""
    a, b, c = (corners[:, each] for each in range(3))
    bc, ca, ab = middle(b, c), middle(c, a), middle(a, b)
    parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (bc, ca, ab)]
    return np.concatenate([np.stack(part, axis=1) for part in parts])


def directions(nodes: Nodes, rotation: FloatArray) -> FloatArray:
    """(..., 3) unit vectors, turned by `rotation` (3, 3)."""
    found = nodes / np.sqrt((nodes.astype(np.float64) ** 2).sum(axis=-1, keepdims=True))
    return np.asarray(found @ rotation.T)
