"""Where shadows fall: rays that just pass the outlines of bodies, as the radar sees them.

An outline is the edges between faces that look at the radar and such that look away, and those of open meshes. A ray
that passes one outside hits what the shadow's edge falls on, however narrow the light that gets through, down to
`RAY_CLEARANCE`.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.kernels import FrozenKernel, drjit_types, upload
from rfgen_sionna.scene.mesh import corner_columns, lengths, triangle_centroids, unit
from rfgen_sionna.tracing.surface.surfaces import Surfaces

RAY_CLEARANCE = 1e-4
"""How far outside rays pass, times the distance."""
RAY_SPACING = 2.5e-3
"""Largest angle between rays past one edge [rad]."""
STATIC_RAY_SPACING = 1.25e-3
"""The same past edges of what stays, for what stays, which is looked at once: a pole of a few centimetres leaves facets
behind it lit at all their corners, and only such rays tell."""
_MANY = 32
"""Pieces of a face that are all tried for the one that a ray falls on."""
_NEAREST = (8, 64)
"""Those of more that are tried, at first and where none of them is it."""
_AT_ONCE = 1_000_000
"""Facets that rays are tried with together."""
_FEW = 1000
"""Rays that one thread looks up the neighbours of."""
_TOUCHING = 1e-3
"""How far before an outline, over the way there, what it touches may be."""
_FACE_SEPARATION = 4.0
"""Between the pieces of one face and those of the next in the tree of directions, where 2 is as far as any two are."""


class SilhouetteRays(NamedTuple):
    """Rays that just pass outlines."""

    directions: FloatArray
    """(ray, 3) as long as the way to the outline that each passes [m]."""
    hit: NDArray[np.int64]
    """(ray,) face of the ray scene that they hit first, -1 for none."""
    span: FloatArray
    """(ray,) length of outline that each stands for, as seen from the viewpoint [rad]."""
    first: int = 0
    """Number of the first ray that passes what moves."""
    owner: NDArray[np.intp] | None = None
    """(ray,) the moving surface that each passes, -1 for what stays; None where nobody asks."""

    @property
    def of_actors(self) -> SilhouetteRays:
        """Those that pass what moves."""
        return SilhouetteRays(self.directions[self.first :], self.hit[self.first :], self.span[self.first :])


class MeshSilhouette:
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

    def facing(self, vertices: FloatArray) -> NDArray[np.bool_]:
        """(face,) whether each looks at the viewpoint, for `vertices` (vertex, 3) [m] seen from there."""
        return faces_toward_viewpoint(vertices, self._faces)

    def silhouette_rays(
        self, vertices: FloatArray, spacing: float = RAY_SPACING, facing: NDArray[np.bool_] | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Points (ray, 3) [m] just outside the outline of a mesh with its `vertices` (vertex, 3) [m], all of them seen
        from the viewpoint, and the length of outline (ray,) [rad] that each stands for: `spacing` at most. `facing` are
        :meth:`facing`, if they are known."""
        if facing is None:
            facing = self.facing(vertices)
        ends, faces, across, turned = self._edges
        differ = facing[faces[:, 0]] != (facing[faces[:, 1]] ^ turned)
        outer = np.flatnonzero((faces[:, 0] == faces[:, 1]) | differ)
        start, stop, other = (vertices[each] for each in (ends[outer, 0], ends[outer, 1], across[outer]))
        out = np.cross(start, stop)
        size = lengths(out)
        out /= np.maximum(size, 1e-300)[:, None]
        inward = np.einsum("ei,ei->e", out, other - start) > 0
        out[inward] *= -1.0
        angle = np.arctan2(size, np.einsum("ei,ei->e", start, stop))
        count = np.ceil(angle / spacing).astype(np.intp)  # none where it is seen end on
        edge = np.repeat(np.arange(len(outer)), count)
        share = (np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[edge]
        # At equal angles: the sines' law in the triangle of the viewpoint and the edge.
        near = lengths(start)[edge] * np.sin(share * angle[edge])
        far = lengths(stop)[edge] * np.sin((1.0 - share) * angle[edge])
        points = start[edge] + (near / np.maximum(near + far, 1e-300))[:, None] * (stop - start)[edge]
        return points + RAY_CLEARANCE * lengths(points)[:, None] * out[edge], (angle / np.maximum(count, 1))[edge]


def static_silhouettes(
    surfaces: Surfaces, viewpoint: FloatArray, spacing: float = STATIC_RAY_SPACING
) -> tuple[FloatArray, FloatArray]:
    """Directions (ray, 3) that just pass the outlines of what stays, as long as the way there [m], and the length of
    outline (ray,) [rad] that each stands for, `spacing` at most."""
    placed = zip(surfaces.static, surfaces.static_vertices, strict=True)
    found = [MeshSilhouette(surface.faces).silhouette_rays(points - viewpoint, spacing) for surface, points in placed]
    rays, span = (np.concatenate(each) for each in zip((np.zeros((0, 3)), np.zeros(0)), *found, strict=True))
    return rays, span


def faces_toward_viewpoint(vertices: FloatArray, faces: IntArray | NDArray[np.uint32]) -> NDArray[np.bool_]:
    """(face,) whether each of `faces` (face, 3) does, for `vertices` (vertex, 3) [m] seen from there."""
    a, b, c = np.moveaxis(corner_columns(vertices, faces), 1, 0)
    return np.asarray(sum(a[i] * (b[i - 2] * c[i - 1] - b[i - 1] * c[i - 2]) for i in range(3)) < 0)


class FacetLocator:
    """Tells which facets rays fall on.

    The facets have `corners` (facet, 3, 3) [m] from the viewpoint, and are pieces of the faces `number` (facet,).
    """

    def __init__(self, corners: FloatArray, number: IntArray) -> None:
        self._corners, self._number = corners, number
        ordered = bool((number[1:] >= number[:-1]).all())
        self._order = np.arange(len(number)) if ordered else np.argsort(number, kind="stable")
        self._ascending = number if ordered else number[self._order]

    def silhouette_lengths(self, silhouette_rays: SilhouetteRays) -> FloatArray:
        """(2, facet) length of outline [rad] that falls on each, as rays' points tell, and of that what has a shadow
        there: facets before the outline that a ray passes hide it. Of faces in very many pieces those around the point
        are tried."""
        hit, total = silhouette_rays.hit, np.zeros((2, len(self._number)))
        first = np.searchsorted(self._ascending, hit, "left")
        count = np.searchsorted(self._ascending, hit, "right") - first
        few = np.flatnonzero((count > 0) & (count <= _MANY))
        for some in np.split(few, np.flatnonzero(np.diff(np.cumsum(count[few]) // _AT_ONCE)) + 1):
            self._add(total, silhouette_rays, some, self._order, first[some], count[some])
        left = np.flatnonzero(count > _MANY)
        for nearest in _NEAREST:
            if not len(left):
                break
            found = []
            for some in np.array_split(left, -(-len(left) * nearest // _AT_ONCE)):
                near = self._around(silhouette_rays.directions[some], hit[some], nearest)
                own = near >= 0
                count = own.sum(axis=1)
                found.append(self._add(total, silhouette_rays, some, near[own], np.cumsum(count) - count, count))
            left = np.setdiff1d(left, np.concatenate(found))
        return total

    def _add(
        self,
        total: FloatArray,
        silhouette_rays: SilhouetteRays,
        rays: NDArray[np.intp],
        tried: NDArray[np.intp],
        first: NDArray[np.intp],
        count: NDArray[np.intp],
    ) -> NDArray[np.intp]:
        """Adds those of the `rays` (ray,) that fall on the facets they are tried with, and returns them: each with so
        many, `count` (ray,), of `tried`, the `first` (ray,) of them and those that come after it."""
        starts, size = np.cumsum(count) - count, int(count.sum())
        if not size:
            return rays[:0]
        dr, types = drjit_types()
        fallen = dr.empty(types.UInt32, size)
        given = {
            "lanes": dr.arange(types.UInt32, len(rays)),
            "rays": upload(types.UInt32, rays),
            "directions": upload(types.Float64, silhouette_rays.directions),
            "tried": upload(types.UInt32, tried),
            "first": upload(types.UInt32, first),
            "count": upload(types.UInt32, count),
            "starts": upload(types.UInt32, starts),
            "corners": upload(types.Float64, self._corners),
            "fallen": fallen,
        }
        _HIT_FACETS(given)
        how = fallen.numpy()
        on = np.flatnonzero(how)
        of = np.searchsorted(starts, on, "right") - 1  # the last of those that begin there, which is not empty
        for part, counted in zip(total, (slice(None), how[on] > 1), strict=True):
            own = of[counted]
            np.add.at(part, tried[first[own] + on[counted] - starts[own]], silhouette_rays.span[rays[own]])
        return rays[of]

    def _around(self, directions: FloatArray, face: NDArray[np.int64], nearest: int) -> NDArray[np.intp]:
        """(ray, nearest) pieces of the face that each ray hits, those around where it does; -1 where it has fewer."""
        tree, members, rank = self._tree
        place = np.column_stack([unit(directions), _FACE_SEPARATION * rank[face]])
        near = tree.query(place, min(nearest, len(members)), workers=-1 if len(place) > _FEW else 1)[1]
        there = members[near]
        return np.where(self._number[there] == face[:, None], there, -1)

    @cached_property
    def _tree(self) -> tuple[KDTree, NDArray[np.intp], NDArray[np.intp]]:
        """Pieces of faces in very many of them, by direction and, far apart, by face; which pieces these are, and the
        rank of each face."""
        count = np.bincount(self._number)
        rank = np.cumsum(count > _MANY, dtype=np.intp)
        members = np.flatnonzero(count[self._number] > _MANY)
        places = np.column_stack(
            [unit(triangle_centroids(self._corners[members])), _FACE_SEPARATION * rank[self._number[members]]]
        )
        return KDTree(places, balanced_tree=False), members, rank


def _hit_facets(given: dict[str, Any]) -> None:
    """The kernel of :meth:`FacetLocator._add`: how each ray falls on each facet that it is tried with, not at all (0),
    on it
    where it is before the outline (1), or where it touches it or is behind it (2)."""
    dr, types = drjit_types()
    Float, UInt32, Array3, lane = types.Float64, types.UInt32, types.Array3f64, given["lanes"]
    ray, start, first, count = (dr.gather(UInt32, given[name], lane) for name in ("rays", "starts", "first", "count"))
    ahead = Array3(*(dr.gather(Float, given["directions"], 3 * ray + axis) for axis in range(3)))

    def step(k: Any) -> tuple[Any]:
        facet = dr.gather(UInt32, given["tried"], first + k)
        a, b, c = (
            Array3(*(dr.gather(Float, given["corners"], 9 * facet + 3 * corner + axis) for axis in range(3)))
            for corner in range(3)
        )
        # Twice that: the other way round it is the opposite to the last bit, so that a ray falls on one side of an edge
        # that two facets share and on the other of the other.
        sides = [dr.dot(ahead, dr.cross(one, other) - dr.cross(other, one)) for one, other in ((a, b), (b, c), (c, a))]
        low, high = (each(each(sides[0], sides[1]), sides[2]) for each in (dr.minimum, dr.maximum))
        # How far along the ray the facet's plane is, of the way to the outline, times the sum of the sides.
        side = sides[0] + sides[1] + sides[2]
        way = 2.0 * dr.dot(a, dr.cross(b, c))
        beyond = (side == 0) | (way * dr.sign(side) >= (1.0 - _TOUCHING) * abs(side))
        how = dr.select((low >= 0) | (high <= 0), dr.select(beyond, UInt32(2), UInt32(1)), UInt32(0))
        dr.scatter(given["fallen"], how, start + k, mode=dr.ReduceMode.Permute)
        return (k + 1,)

    dr.while_loop((dr.zeros(UInt32, dr.width(lane)),), lambda k: k < count, step)
    dr.eval(given["fallen"])


_HIT_FACETS = FrozenKernel(_hit_facets)
