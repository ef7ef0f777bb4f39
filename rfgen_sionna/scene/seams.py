"""Seams of meshes: vertices that a file gives twice, as both sides have other texture coordinates or normals there.

The surface goes on over a seam, and what is smooth is smooth there too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.records import FloatArray, IntArray


def sewn(faces: IntArray, shapes: Sequence[FloatArray]) -> IntArray:
    """(face, 3) the faces, with one number for vertices of rims that are at the same place in all `shapes`.

    Left as they are where sewing would make no surface of them: where more than two faces would meet at an edge, as of
    sheets that lie on one another, or neighbours would look to opposite sides, or a face would lose its area.

    Parameters
    ----------
    faces
        (face, 3) vertex indices.
    shapes
        (vertex, 3) positions [m], one array of each time that tells.
    """
    count = len(shapes[0])
    rims = _ends(faces, count, lambda uses, _: uses == 1)
    if not len(rims):
        return faces
    places = np.concatenate([shape[rims] for shape in shapes], axis=1) + 0.0  # no -0, whose bits are others
    rows = np.ascontiguousarray(places).view(f"V{places.shape[1] * 8}").ravel()
    _, first, number = np.unique(rows, return_index=True, return_inverse=True)
    if len(first) == len(rims):
        return faces
    one = np.arange(count)
    one[rims] = rims[first[number]]
    together = one[faces]
    left = np.zeros(count, np.bool_)
    left[_ends(together, count, lambda uses, balance: (uses > 2) | ((uses == 2) & (balance != 0)))] = True
    lost = (together == np.roll(together, 1, axis=1)).any(axis=1)
    left[together[lost]] = True
    one = np.where(left[one], np.arange(count), one)
    return np.asarray(one[faces], faces.dtype)


def _ends(
    faces: NDArray[np.integer[Any]],
    count: int,
    chosen: Callable[[NDArray[np.intp], NDArray[np.intp]], NDArray[np.bool_]],
) -> NDArray[np.intp]:
    """The vertices, out of so many, at the ends of edges that are `chosen` by how many faces use each, and by how many
    more run through it one way than the other."""
    start, end = faces.ravel().astype(np.int64), faces[:, [1, 2, 0]].ravel().astype(np.int64)
    low, high = np.minimum(start, end), np.maximum(start, end)
    edge, number, uses = np.unique(low * count + high, return_inverse=True, return_counts=True)
    balance = 2 * np.bincount(number[start < end], minlength=len(edge)) - uses
    some = edge[chosen(uses, balance)]
    return np.unique(np.concatenate([some // count, some % count]))
