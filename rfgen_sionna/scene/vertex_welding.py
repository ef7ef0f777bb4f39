"""Seams of meshes: vertices that a file gives twice, as both sides have other texture coordinates or normals there.

The surface goes on over a seam, and what is smooth is smooth there too.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from rfgen_sionna._types import FloatArray, IntArray

NEAR = 1e-6
"""Vertices no further apart than this share of the extent, along any axis, are at the same place: what turns a mesh in
single precision costs digits."""


def weld_vertices(faces: IntArray, shapes: Iterable[FloatArray]) -> IntArray:
    """(face, 3) the faces, with one number for vertices of rims that are at the same place in all `shapes`.

    Left as they are where sewing would make no surface of them: where more than two faces would meet at an edge, or
    neighbours would look to opposite sides or lie on one another, as both sides of a sheet do, or a face would lose its
    area.

    Parameters
    ----------
    faces
        (face, 3) vertex indices.
    shapes
        (vertex, 3) positions [m], one array of each time that tells; asked for only where there are rims.
    """
    count = int(faces.max()) + 1
    edges = _Edges.of(faces, count)
    rims = edges.ends(edges.uses == 1)
    if not len(rims):
        return faces
    known = [np.asarray(shape, np.float64) for shape in shapes]
    extent = float(np.ptp(known[0][rims], axis=0).max())
    places = np.concatenate([shape[rims] - shape[rims[0]] for shape in known], axis=1)
    near = cKDTree(places).query_pairs(NEAR * extent, p=np.inf, output_type="ndarray")
    if not len(near):
        return faces
    joins = coo_array((np.ones(len(near), np.bool_), (near[:, 0], near[:, 1])), shape=(len(rims), len(rims)))
    number = connected_components(joins, directed=False)[1]
    _, first = np.unique(number, return_index=True)
    one = np.arange(count)
    one[rims] = rims[first[number]]
    together = one[faces]
    edges = _Edges.of(together, count)
    left = np.zeros(count, np.bool_)
    left[edges.ends((edges.uses > 2) | ((edges.uses == 2) & (edges.balance != 0)))] = True
    left[edges.ends(edges.coincident(known[0][faces], NEAR * extent))] = True
    left[together[(together == np.roll(together, 1, axis=1)).any(axis=1)]] = True
    return np.asarray(np.where(left[one], np.arange(count), one)[faces], faces.dtype)


@dataclass(frozen=True)
class _Edges:
    """The edges of a mesh."""

    key: NDArray[np.int64]
    """(edge,) the lower vertex times `count` plus the higher."""
    number: NDArray[np.intp]
    """(face side,) edge of each."""
    uses: NDArray[np.intp]
    """(edge,) faces there."""
    balance: NDArray[np.intp]
    """(edge,) how many more of them run through it upwards than downwards."""
    count: int
    """Vertices."""

    @staticmethod
    def of(faces: NDArray[np.integer[Any]], count: int) -> _Edges:
        start, end = faces.ravel().astype(np.int64), faces[:, [1, 2, 0]].ravel().astype(np.int64)
        key = np.minimum(start, end) * count + np.maximum(start, end)
        key, number, uses = np.unique(key, return_inverse=True, return_counts=True)
        upwards = np.bincount(number[start < end], minlength=len(key))
        return _Edges(key, number, uses, 2 * upwards - uses, count)

    def ends(self, chosen: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Vertices at the ends of the edges `chosen` (edge,)."""
        some = self.key[chosen]
        return np.unique(np.concatenate([some // self.count, some % self.count]))

    def coincident(self, corners: FloatArray, near: float) -> NDArray[np.bool_]:
        """(edge,) whether its two faces, of `corners` (face, 3, 3) [m], lie on one another."""
        side = np.argsort(self.number, kind="stable")
        side = side[self.uses[self.number[side]] == 2]
        apex = corners.reshape(-1, 3)[side // 3 * 3 + (side + 2) % 3].reshape(-1, 2, 3)
        found = np.zeros(len(self.key), np.bool_)
        found[self.number[side[::2]]] = (np.abs(apex[:, 0] - apex[:, 1]) <= near).all(axis=1)
        return found
