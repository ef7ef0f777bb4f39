"""Welding of seams: vertices that a file stores twice for texture coordinates or normals of both sides."""

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
"""Largest distance along any axis between vertices at one place, over the extent: rounding of single precision."""


def weld_vertices(faces: IntArray, shapes: Iterable[FloatArray]) -> IntArray:
    """(face, 3) faces in which boundary vertices at the same place in all `shapes` have one index.

    Vertices stay apart where welding would join more than two faces at an edge, neighbours of opposite orientation, two
    coincident faces (the sides of a sheet), or remove the area of a face.

    Parameters
    ----------
    faces
        (face, 3) vertex indices.
    shapes
        (vertex, 3) positions [m] at several times; read only for meshes with a boundary.
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
    """(edge,) lower vertex times `count` plus the higher."""
    number: NDArray[np.intp]
    """(face side,) index of its edge."""
    uses: NDArray[np.intp]
    """(edge,) number of faces."""
    balance: NDArray[np.intp]
    """(edge,) number of faces that run through it upwards, minus those downwards."""
    count: int
    """Number of vertices."""

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
        """(edge,) whether its two faces, of `corners` (face, 3, 3) [m], coincide."""
        side = np.argsort(self.number, kind="stable")
        side = side[self.uses[self.number[side]] == 2]
        apex = corners.reshape(-1, 3)[side // 3 * 3 + (side + 2) % 3].reshape(-1, 2, 3)
        found = np.zeros(len(self.key), np.bool_)
        found[self.number[side[::2]]] = (np.abs(apex[:, 0] - apex[:, 1]) <= near).all(axis=1)
        return found
