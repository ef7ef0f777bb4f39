"""Which paths of different element pairs are one and the same path."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray


def match_paths(
    pair: NDArray[np.intp], signature: NDArray[np.int64], vertices: FloatArray, reach: float
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Follow paths from one element pair to the next.

    Two paths are the same where they meet the same things in the same manner, at points no further apart than `reach`;
    among several such, the nearest. In one element pair no two paths are the same. To what path an entry is given
    changes no sum over paths, only what is told about it.

    Parameters
    ----------
    pair
        (entry,) element pair of each entry.
    what
        (entry, …) what it meets and how.
    vertices
        (entry, depth, 3) where [m].
    reach
        [m] per interaction.

    Returns
    -------
    number, first
        (entry,) number of the path of each entry, counted in the order of the entries; (path,) its first entry.
    """
    from scipy.spatial import cKDTree

    if len(pair) == 0:
        return np.zeros(0, np.intp), np.zeros(0, np.intp)
    _, group = np.unique(signature, axis=0, return_inverse=True)
    # What differs in kind is put further away than anything can be.
    extent = 1.0 + 4.0 * float(np.abs(vertices).max(initial=0.0)) + reach
    depth = max(vertices.shape[1], 1)
    points = np.concatenate([vertices.reshape(len(pair), -1), (extent * depth * group.reshape(-1))[:, None]], axis=1)
    number = np.full(len(pair), -1, dtype=np.intp)
    known: list[int] = []
    by_pair = np.argsort(pair, kind="stable")
    starts = np.flatnonzero(np.diff(pair[by_pair], prepend=-1))
    for entries in np.split(by_pair, starts[1:]):
        if known:
            distance, nearest = cKDTree(points[known]).query(points[entries], distance_upper_bound=reach * depth**0.5)
            met = np.flatnonzero(np.isfinite(distance))
            met = met[np.argsort(distance[met], kind="stable")]
            _, chosen = np.unique(nearest[met], return_index=True)
            number[entries[met[chosen]]] = nearest[met[chosen]]
        new = entries[number[entries] < 0]
        number[new] = len(known) + np.arange(len(new))
        known.extend(new.tolist())
    # Count them in the order of the entries, not of the pairs.
    _, first, number = np.unique(number, return_index=True, return_inverse=True)
    rank = np.argsort(np.argsort(first))
    return rank[number.reshape(-1)], np.sort(first)
