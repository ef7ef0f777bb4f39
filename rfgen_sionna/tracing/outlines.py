"""Where shadows fall: rays that just pass the outlines of bodies, as the radar sees them.

An outline is the edges between faces that look at the radar and such that look away, and those of open meshes. A ray
that passes one outside hits what the shadow's edge falls on, be the light that gets through ever so narrow.
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from rfgen_sionna.records import FloatArray, IntArray
from rfgen_sionna.scene.mesh import columns, lengths, middles

CLEARANCE = 1e-4
"""How far outside rays pass, times the distance."""
_APART = 5e-3
"""Angle between rays past one edge [rad]."""
_MOST = 256
"""Rays past one edge, at most."""
_MANY = 32
"""Pieces of a face that are all tried for the one that a ray falls on."""
_NEAREST = 8
"""Those of more that are tried."""


class Passing(NamedTuple):
    """Rays that just pass outlines."""

    directions: FloatArray
    """(ray, 3) of any length above zero."""
    hit: NDArray[np.int64]
    """(ray,) face of the ray scene that they hit first, -1 for none."""


class Outline:
    """The edges of a mesh."""

    def __init__(self, faces: IntArray) -> None:
        self._faces = faces

    @cached_property
    def _edges(self) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
        """(edge, 2) vertices; (edge, 2) faces, twice the same where there is no second one; (edge,) the vertex across
        the edge in the first."""
        faces = self._faces.astype(np.int64)
        ends = np.sort(np.concatenate([faces[:, [1, 2]], faces[:, [2, 0]], faces[:, [0, 1]]]), axis=1)
        size = int(faces.max(initial=0)) + 1
        order = np.argsort(ends[:, 0] * size + ends[:, 1], kind="stable")
        key = (ends[:, 0] * size + ends[:, 1])[order]
        first = np.flatnonzero(np.concatenate([[True], key[1:] != key[:-1]])[: len(key)])
        count = np.diff(np.append(first, len(key)))
        own = order % max(1, len(faces))
        second = np.where(count == 2, own[np.minimum(first + 1, len(key) - 1)], own[first])
        # Where three faces and more meet, one may hide the others' edge: always an outline.
        across = self._faces.T.reshape(-1)[order[first]].astype(np.intp)
        return ends[order[first]], np.stack([own[first], second], axis=1), across

    def passing(self, vertices: FloatArray) -> FloatArray:
        """(ray, 3) points [m] just outside the outline of a mesh with its `vertices` (vertex, 3) [m], all of them seen
        from the viewpoint."""
        a, b, c = np.moveaxis(columns(vertices, self._faces), 1, 0)
        towards = sum(a[i] * (b[i - 2] * c[i - 1] - b[i - 1] * c[i - 2]) for i in range(3)) < 0
        ends, faces, across = self._edges
        outer = np.flatnonzero((faces[:, 0] == faces[:, 1]) | (towards[faces[:, 0]] != towards[faces[:, 1]]))
        start, stop, other = (vertices[each] for each in (ends[outer, 0], ends[outer, 1], across[outer]))
        out = np.cross(start, stop - start)
        size = lengths(out)
        out /= np.maximum(size, 1e-300)[:, None]
        inward = np.einsum("ei,ei->e", out, other - start) > 0
        out[inward] *= -1.0
        nearer = np.minimum(lengths(start), lengths(stop))
        count = np.ceil(np.clip(size / np.maximum(nearer, 1e-9) ** 2 / _APART, 1, _MOST)).astype(np.intp)
        count[size == 0] = 0  # seen end on
        edge = np.repeat(np.arange(len(outer)), count)
        along = (np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[edge]
        points = start[edge] + along[:, None] * (stop - start)[edge]
        return np.asarray(points + CLEARANCE * lengths(points)[:, None] * out[edge])


class Places:
    """Tells which facets rays fall on.

    The facets have `corners` (facet, 3, 3) [m] from the viewpoint, and are pieces of the faces `number` (facet,).
    """

    def __init__(self, corners: FloatArray, number: IntArray) -> None:
        self._corners, self._number = corners, number
        self._order = np.argsort(number, kind="stable")
        self._trees: dict[int, KDTree] = {}

    def holding(self, passing: Passing) -> NDArray[np.bool_]:
        """(facet,) whether a ray's point is on it. Of faces in very many pieces those around the point are tried."""
        hit = passing.hit
        first = np.searchsorted(self._number, hit, "left", self._order)
        count = np.searchsorted(self._number, hit, "right", self._order) - first
        few = np.flatnonzero((count > 0) & (count <= _MANY))
        ray = np.repeat(few, count[few])
        start = np.cumsum(count[few]) - count[few]
        facet = self._order[np.arange(len(ray)) + np.repeat(first[few] - start, count[few])]
        rays, facets = [ray], [facet]
        many = np.flatnonzero(count > _MANY)
        for face in np.unique(hit[many]):
            some = many[hit[many] == face]
            members = self._order[first[some[0]] : first[some[0]] + count[some[0]]]
            near = self._tree(int(face), members).query(unit(passing.directions[some]), _NEAREST)[1]
            rays.append(np.repeat(some, _NEAREST))
            facets.append(members[near.ravel()])
        ray, facet = np.concatenate(rays), np.concatenate(facets)
        a, b, c = np.moveaxis(self._corners[facet], 1, 0)
        ahead = passing.directions[ray]
        sides = [np.einsum("ri,ri->r", ahead, np.cross(*pair)) for pair in ((a, b), (b, c), (c, a))]
        held = np.zeros(len(self._number), np.bool_)
        held[facet[(np.min(sides, axis=0) >= 0) | (np.max(sides, axis=0) <= 0)]] = True
        return held

    def _tree(self, face: int, members: NDArray[np.intp]) -> KDTree:
        if face not in self._trees:
            self._trees[face] = KDTree(unit(middles(self._corners[members])))
        return self._trees[face]


def unit(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors / np.maximum(lengths(vectors), 1e-300)[:, None])
