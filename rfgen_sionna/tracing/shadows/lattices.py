"""Lattices of points on facets."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray

SPACINGS = (1, 2, 4, 8, 16, 32)
"""Cells along a facet's edge, level by level."""
INSET = 5e-4
_INSET_CENTRE = np.array([0.36, 0.31, 0.33])
"""Rays go to points that much nearer to this one of the facet, barycentric: a ray in the very plane of an edge before
it may get through between the two faces that meet there, as rays to corners of symmetric bodies do."""


class Lattice(NamedTuple):
    points: FloatArray
    """(point, 3) barycentric."""
    cells: NDArray[np.intp]
    """(cell, 3) points at the corners, in the facet's sense; four by four they make up a cell of the level above."""
    edges: NDArray[np.intp]
    """(edge, 2) points."""
    sides: NDArray[np.intp]
    """(cell, 3) edge from each corner to the next."""
    beside: NDArray[np.intp]
    """(cell, 3) the cell across each of these edges, -1 beside the facet."""
    rim: NDArray[np.intp]
    """(edge,) corner of the facet opposite the side that an edge lies on, -1 within the facet."""
    tips: NDArray[np.intp]
    """(3,) points in the facet's corners."""


@cache
def inset_lattice(level: int, share: float) -> FloatArray:
    """(point, 3) where rays go that look at the points of the lattice of a `level`, by that share nearer to the
    middle."""
    return inset_points(lattice_of(level).points, share)


@cache
def lattice_of(level: int) -> Lattice:
    cells = np.eye(3)[None]
    for _ in range(level):
        a, b, c = (cells[:, i] for i in range(3))
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        four = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (bc, ca, ab))
        cells = np.stack([np.stack(each, axis=1) for each in four], axis=1).reshape(-1, 3, 3)
    n = SPACINGS[level]
    points, index = np.unique(np.rint(n * cells.reshape(-1, 3)), axis=0, return_inverse=True)
    index = index.reshape(-1, 3)
    pairs = np.sort(np.stack([index, np.roll(index, -1, axis=1)], axis=2), axis=2).reshape(-1, 2)
    edges, sides = np.unique(pairs, axis=0, return_inverse=True)
    rim = np.full(len(edges), -1)
    for corner in range(3):
        rim[(points[edges, corner] == 0).all(axis=1)] = corner
    sides = sides.reshape(-1, 3)
    both = np.full((len(edges), 2), -1)
    order = np.argsort(sides.ravel(), kind="stable")
    edge, cell = sides.ravel()[order], order // 3
    first = np.concatenate([[True], edge[1:] != edge[:-1]])
    both[edge[first], 0], both[edge[~first], 1] = cell[first], cell[~first]
    beside = np.where(both[sides, 0] == np.arange(len(sides))[:, None], both[sides, 1], both[sides, 0])
    return Lattice(points / n, index, edges, sides, beside, rim, points.argmax(axis=0))


class LatticeGroup(NamedTuple):
    """Facets of one level that are seen in part."""

    facets: NDArray[np.intp]
    lattice: Lattice
    level: int
    unoccluded: NDArray[np.bool_]
    """(facet, point)"""
    corners: tuple[NDArray[np.bool_], ...]
    """(facet, cell) whether the first, the second and the third corner of each cell is seen."""
    row: NDArray[np.intp]
    """(crossing,) facet of the group, and the edge that the shadow's edge crosses."""
    edge: NDArray[np.intp]

    @staticmethod
    def of(facets: NDArray[np.intp], level: int, unoccluded: NDArray[np.bool_]) -> LatticeGroup:
        lattice = lattice_of(level)
        corners = tuple(np.take(unoccluded, each, axis=1) for each in lattice.cells.T)
        first, second = (np.take(unoccluded, each, axis=1) for each in lattice.edges.T)
        return LatticeGroup(facets, lattice, level, unoccluded, corners, *np.nonzero(first != second))


def inset_points(places: FloatArray, share: float = INSET) -> FloatArray:
    """Barycentric coordinates of where rays go that look at `places` (ray, 3)."""
    return np.asarray(places + share * (_INSET_CENTRE - places))


def points_of(level: NDArray[np.intp]) -> NDArray[np.intp]:
    """How many points lattices of the `level` have."""
    cells = np.array(SPACINGS)[level]
    return np.asarray((cells + 1) * (cells + 2) // 2, np.intp)
