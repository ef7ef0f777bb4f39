"""Where shadows fall: rays that just pass the outlines of bodies, as the radar sees them.

An outline is the edges between faces that look at the radar and such that look away, and those of open meshes. A ray
that passes one outside hits what the shadow's edge falls on, however narrow the light that gets through, down to
`CLEARANCE`.
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
APART = 2.5e-3
"""Largest angle between rays past one edge [rad]."""
STILL_APART = 1.25e-3
"""The same past edges of what stays, for what stays, which is looked at once: a pole of a few centimetres leaves facets
behind it lit at all their corners, and only such rays tell."""
_MANY = 32
"""Pieces of a face that are all tried for the one that a ray falls on."""
_NEAREST = (8, 64)
"""Those of more that are tried, at first and where none of them is it."""
_AT_ONCE = 100_000
"""Rays that are tried together."""
_TOUCHING = 1e-3
"""How far before an outline, over the way there, what it touches may be."""
_AWAY = 4.0
"""Between the pieces of one face and those of the next in the tree of directions, where 2 is as far as any two are."""


class Passing(NamedTuple):
    """Rays that just pass outlines."""

    directions: FloatArray
    """(ray, 3) as long as the way to the outline that each passes [m]."""
    hit: NDArray[np.int64]
    """(ray,) face of the ray scene that they hit first, -1 for none."""
    span: FloatArray
    """(ray,) length of outline that each stands for, as seen from the viewpoint [rad]."""
    first: int = 0
    """Number of the first ray that passes what moves."""

    @property
    def of_actors(self) -> Passing:
        """Those that pass what moves."""
        return Passing(self.directions[self.first :], self.hit[self.first :], self.span[self.first :])


class Outline:
    """The edges of a mesh."""

    def __init__(self, faces: IntArray) -> None:
        self._faces = faces

    @cached_property
    def _edges(self) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp], NDArray[np.bool_]]:
        """(edge, 2) vertices; (edge, 2) faces, twice the same where there is no second one; (edge,) the vertex across
        the edge in the first, and whether both run through it in the same direction: one is inside out."""
        faces = self._faces.astype(np.int64)
        run = np.concatenate([faces[:, [1, 2]], faces[:, [2, 0]], faces[:, [0, 1]]])
        ends = np.sort(run, axis=1)
        size = int(faces.max(initial=0)) + 1
        order = np.argsort(ends[:, 0] * size + ends[:, 1], kind="stable")
        key = (ends[:, 0] * size + ends[:, 1])[order]
        first = np.flatnonzero(np.concatenate([[True], key[1:] != key[:-1]])[: len(key)])
        count = np.diff(np.append(first, len(key)))
        own = order % max(1, len(faces))
        after = np.minimum(first + 1, len(key) - 1)
        second = np.where(count == 2, own[after], own[first])
        forward = (run[:, 0] == ends[:, 0])[order]
        # Where three faces and more meet, one may hide the others' edge: always an outline.
        across = self._faces.T.reshape(-1)[order[first]].astype(np.intp)
        turned = (count == 2) & (forward[first] == forward[after])
        return ends[order[first]], np.stack([own[first], second], axis=1), across, turned

    def towards(self, vertices: FloatArray) -> NDArray[np.bool_]:
        """(face,) whether each looks at the viewpoint, for `vertices` (vertex, 3) [m] seen from there."""
        return look_at_the_viewpoint(vertices, self._faces)

    def passing(
        self, vertices: FloatArray, apart: float = APART, towards: NDArray[np.bool_] | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Points (ray, 3) [m] just outside the outline of a mesh with its `vertices` (vertex, 3) [m], all of them seen
        from the viewpoint, and the length of outline (ray,) [rad] that each stands for: `apart` at most. `towards` are
        :meth:`towards`, if they are known."""
        if towards is None:
            towards = self.towards(vertices)
        ends, faces, across, turned = self._edges
        differ = towards[faces[:, 0]] != (towards[faces[:, 1]] ^ turned)
        outer = np.flatnonzero((faces[:, 0] == faces[:, 1]) | differ)
        start, stop, other = (vertices[each] for each in (ends[outer, 0], ends[outer, 1], across[outer]))
        out = np.cross(start, stop)
        size = lengths(out)
        out /= np.maximum(size, 1e-300)[:, None]
        inward = np.einsum("ei,ei->e", out, other - start) > 0
        out[inward] *= -1.0
        angle = np.arctan2(size, np.einsum("ei,ei->e", start, stop))
        count = np.ceil(angle / apart).astype(np.intp)  # none where it is seen end on
        edge = np.repeat(np.arange(len(outer)), count)
        share = (np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[edge]
        # At equal angles: the sines' law in the triangle of the viewpoint and the edge.
        near = lengths(start)[edge] * np.sin(share * angle[edge])
        far = lengths(stop)[edge] * np.sin((1.0 - share) * angle[edge])
        points = start[edge] + (near / np.maximum(near + far, 1e-300))[:, None] * (stop - start)[edge]
        return points + CLEARANCE * lengths(points)[:, None] * out[edge], (angle / np.maximum(count, 1))[edge]


def look_at_the_viewpoint(vertices: FloatArray, faces: IntArray | NDArray[np.uint32]) -> NDArray[np.bool_]:
    """(face,) whether each of `faces` (face, 3) does, for `vertices` (vertex, 3) [m] seen from there."""
    a, b, c = np.moveaxis(columns(vertices, faces), 1, 0)
    return np.asarray(sum(a[i] * (b[i - 2] * c[i - 1] - b[i - 1] * c[i - 2]) for i in range(3)) < 0)


class Places:
    """Tells which facets rays fall on.

    The facets have `corners` (facet, 3, 3) [m] from the viewpoint, and are pieces of the faces `number` (facet,).
    """

    def __init__(self, corners: FloatArray, number: IntArray) -> None:
        self._corners, self._number = corners, number
        ordered = bool((number[1:] >= number[:-1]).all())
        self._order = np.arange(len(number)) if ordered else np.argsort(number, kind="stable")
        self._ascending = number if ordered else number[self._order]

    def holding(self, passing: Passing, behind: bool = False) -> FloatArray:
        """(facet,) length of outline [rad] that falls on each, as rays' points tell. Those that are not `behind` the
        outline are hidden from it, and have no shadow of it: it is quicker without them. Of faces in very many pieces
        those around the point are tried."""
        hit, total = passing.hit, np.zeros(len(self._number))
        first = np.searchsorted(self._ascending, hit, "left")
        count = np.searchsorted(self._ascending, hit, "right") - first
        few = np.flatnonzero((count > 0) & (count <= _MANY))
        for some in np.array_split(few, max(1, -(-len(few) // _AT_ONCE))):
            ray = np.repeat(some, count[some])
            start = np.cumsum(count[some]) - count[some]
            facet = self._order[np.arange(len(ray)) + np.repeat(first[some] - start, count[some])]
            self._add(total, passing, ray, facet, behind)
        left = np.flatnonzero(count > _MANY)
        for nearest in _NEAREST:
            if not len(left):
                break
            found = []
            for some in np.array_split(left, -(-len(left) // _AT_ONCE)):
                near = self._around(passing.directions[some], hit[some], nearest)
                ray = np.repeat(some, near.shape[1])[near.ravel() >= 0]
                found.append(self._add(total, passing, ray, near[near >= 0], behind))
            left = np.setdiff1d(left, np.concatenate(found))
        return total

    def _add(
        self, total: FloatArray, passing: Passing, ray: NDArray[np.intp], facet: NDArray[np.intp], behind: bool
    ) -> NDArray[np.intp]:
        """Adds the rays that fall on the facets they are tried with, and returns them."""
        corners = [self._corners[facet, i].T for i in range(3)]
        ahead = passing.directions[ray].T
        sides = np.stack([_volume(ahead, corners[i], corners[(i + 1) % 3]) for i in range(3)])
        on = (np.min(sides, axis=0) >= 0) | (np.max(sides, axis=0) <= 0)
        ray, facet, counted = ray[on], facet[on], np.ones(int(np.count_nonzero(on)), np.bool_)
        if behind:  # how far along the ray the facet's plane is, of the way to the outline, times the sum of the sides
            side = sides[:, on].sum(axis=0)
            way = _volume(*(each[:, on] for each in corners))
            counted = way * np.sign(side) >= (1.0 - _TOUCHING) * np.abs(side)
        np.add.at(total, facet[counted], passing.span[ray[counted]])
        return ray

    def _around(self, directions: FloatArray, face: NDArray[np.int64], nearest: int) -> NDArray[np.intp]:
        """(ray, nearest) pieces of the face that each ray hits, those around where it does; -1 where it has fewer."""
        tree, members, rank = self._tree
        place = np.column_stack([unit(directions), _AWAY * rank[face]])
        near = tree.query(place, min(nearest, len(members)))[1]
        there = members[near]
        return np.where(self._number[there] == face[:, None], there, -1)

    @cached_property
    def _tree(self) -> tuple[KDTree, NDArray[np.intp], NDArray[np.intp]]:
        """Pieces of faces in very many of them, by direction and, far apart, by face; which pieces these are, and the
        rank of each face."""
        count = np.bincount(self._number)
        rank = np.cumsum(count > _MANY, dtype=np.intp)
        members = np.flatnonzero(count[self._number] > _MANY)
        places = np.column_stack([unit(middles(self._corners[members])), _AWAY * rank[self._number[members]]])
        return KDTree(places), members, rank


def _volume(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """(ray,) six times the volume of the tetrahedra that vectors (3, ray) span."""
    return np.asarray(
        a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])
    )


def unit(vectors: FloatArray) -> FloatArray:
    """(..., 3) of length 1, as `vectors` (..., 3) point; those of length 0 stay."""
    return np.asarray(vectors / np.maximum(lengths(vectors), 1e-300)[..., None])
