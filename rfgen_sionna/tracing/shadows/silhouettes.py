"""Silhouette rays: rays that just pass silhouettes of bodies, and the facets on which shadows fall.

A silhouette consists of edges between faces that face the radar and faces that do not, and of open edges. A ray that
passes it hits the facet on which the shadow boundary falls, through gaps down to `RAY_CLEARANCE`.
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
"""Distance of silhouette rays from the silhouette, over its distance."""
RAY_SPACING = 2.5e-3
"""Largest angle between rays along one edge [rad]."""
STATIC_RAY_SPACING = 1.25e-3
"""The same for static bodies, which are sampled once: resolves a pole of a few centimetres."""
_MANY = 32
"""Pieces of a face up to which all are tested for a ray's hit."""
_NEAREST = (8, 64)
"""Pieces tested otherwise, at first and in a second try."""
_AT_ONCE = 1_000_000
"""Ray-facet tests per batch; bounds memory."""
_FEW = 1000
"""Rays up to which one thread finds neighbours faster than several."""
_TOUCHING = 1e-3
"""Relative distance before a silhouette within which a hit touches the occluder."""
_FACE_SEPARATION = 4.0
"""Separation of faces in the tree of directions; directions differ by 2 at most."""


class SilhouetteRays(NamedTuple):
    """Rays that just pass silhouettes."""

    directions: FloatArray
    """(ray, 3) vectors to the silhouette [m]."""
    hit: NDArray[np.int64]
    """(ray,) first face of the ray scene that each hits; -1 for none."""
    span: FloatArray
    """(ray,) silhouette length of each ray, as seen from the viewpoint [rad]."""


class MeshSilhouette:
    """Edges of a mesh, for its silhouette from any viewpoint."""

    def __init__(self, faces: IntArray) -> None:
        self._faces = faces

    @cached_property
    def _edges(self) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp], NDArray[np.bool_]]:
        """Edges: (edge, 2) vertices, (edge, 2) faces (one twice if open), (edge,) opposite vertex in the first face,
        (edge,) whether both faces run the same way (opposite orientations)."""
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
        # An edge of three or more faces always belongs to the silhouette.
        across = self._faces.T.reshape(-1)[order[first]].astype(np.intp)
        turned = (count == 2) & (forward[first] == forward[after])
        return ends[order[first]], np.stack([own[first], second], axis=1), across, turned

    def facing(self, vertices: FloatArray) -> NDArray[np.bool_]:
        """(face,) whether each faces the viewpoint, for `vertices` (vertex, 3) [m] from there."""
        return faces_toward_viewpoint(vertices, self._faces)

    def silhouette_rays(
        self, vertices: FloatArray, spacing: float = RAY_SPACING, facing: NDArray[np.bool_] | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Points (ray, 3) [m] just outside the silhouette and their length of silhouette (ray,) [rad].

        `vertices` (vertex, 3) [m] are from the viewpoint; `spacing` is the largest angle between rays [rad].
        """
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
        count = np.ceil(angle / spacing).astype(np.intp)  # none edge-on
        edge = np.repeat(np.arange(len(outer)), count)
        share = (np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[edge]
        # Equal angles, by the law of sines.
        near = lengths(start)[edge] * np.sin(share * angle[edge])
        far = lengths(stop)[edge] * np.sin((1.0 - share) * angle[edge])
        points = start[edge] + (near / np.maximum(near + far, 1e-300))[:, None] * (stop - start)[edge]
        return points + RAY_CLEARANCE * lengths(points)[:, None] * out[edge], (angle / np.maximum(count, 1))[edge]


def static_silhouettes(
    surfaces: Surfaces, viewpoint: FloatArray, spacing: float = STATIC_RAY_SPACING
) -> tuple[FloatArray, FloatArray]:
    """Silhouette rays of static surfaces: vectors (ray, 3) [m] and lengths of silhouette (ray,) [rad]."""
    placed = zip(surfaces.static, surfaces.static_vertices, strict=True)
    found = [MeshSilhouette(surface.faces).silhouette_rays(points - viewpoint, spacing) for surface, points in placed]
    rays, span = (np.concatenate(each) for each in zip((np.zeros((0, 3)), np.zeros(0)), *found, strict=True))
    return rays, span


def faces_toward_viewpoint(vertices: FloatArray, faces: IntArray | NDArray[np.uint32]) -> NDArray[np.bool_]:
    """(face,) whether each of `faces` (face, 3) faces the viewpoint, for `vertices` (vertex, 3) [m] from there."""
    a, b, c = np.moveaxis(corner_columns(vertices, faces), 1, 0)
    return np.asarray(sum(a[i] * (b[i - 2] * c[i - 1] - b[i - 1] * c[i - 2]) for i in range(3)) < 0)


class FacetLocator:
    """Finds the facets that rays hit: `corners` (facet, 3, 3) [m] from the viewpoint, on faces `number` (facet,)."""

    def __init__(self, corners: FloatArray, number: IntArray) -> None:
        self._corners, self._number = corners, number
        ordered = bool((number[1:] >= number[:-1]).all())
        self._order = np.arange(len(number)) if ordered else np.argsort(number, kind="stable")
        self._ascending = number if ordered else number[self._order]

    @cached_property
    def _device_corners(self) -> Any:
        """The corners on the device: a static scene is asked often."""
        return upload(drjit_types()[1].Float64, self._corners)

    def silhouette_lengths(self, silhouette_rays: SilhouetteRays) -> FloatArray:
        """(2, facet) silhouette length [rad] that falls on each facet: in all, and behind the silhouette."""
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
        """Add the `rays` (ray,) that hit one of `count` (ray,) facets of `tried`, from number `first` on, to `total`;
        returns them."""
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
            "corners": self._device_corners,
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
        """(ray, nearest) pieces of the hit face around each ray; -1 pads."""
        tree, members, rank = self._tree
        place = np.column_stack([unit(directions), _FACE_SEPARATION * rank[face]])
        near = tree.query(place, min(nearest, len(members)), workers=-1 if len(place) > _FEW else 1)[1]
        there = members[near]
        return np.where(self._number[there] == face[:, None], there, -1)

    @cached_property
    def _tree(self) -> tuple[KDTree, NDArray[np.intp], NDArray[np.intp]]:
        """Tree of the pieces of finely split faces by direction and face, their numbers, and the rank of each face."""
        count = np.bincount(self._number)
        rank = np.cumsum(count > _MANY, dtype=np.intp)
        members = np.flatnonzero(count[self._number] > _MANY)
        places = np.column_stack(
            [unit(triangle_centroids(self._corners[members])), _FACE_SEPARATION * rank[self._number[members]]]
        )
        return KDTree(places, balanced_tree=False), members, rank


def _hit_facets(given: dict[str, Any]) -> None:
    """Kernel of :meth:`FacetLocator._add`: 0 misses, 1 hits before the silhouette, 2 hits at or behind it."""
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
        # Antisymmetric to the last bit: a ray lies on opposite sides of an edge for the two facets that share it.
        sides = [dr.dot(ahead, dr.cross(one, other) - dr.cross(other, one)) for one, other in ((a, b), (b, c), (c, a))]
        low, high = (each(each(sides[0], sides[1]), sides[2]) for each in (dr.minimum, dr.maximum))
        # Distance of the facet's plane over that of the silhouette, times the sum of the sides.
        side = sides[0] + sides[1] + sides[2]
        way = 2.0 * dr.dot(a, dr.cross(b, c))
        beyond = (side == 0) | (way * dr.sign(side) >= (1.0 - _TOUCHING) * abs(side))
        how = dr.select((low >= 0) | (high <= 0), dr.select(beyond, UInt32(2), UInt32(1)), UInt32(0))
        dr.scatter(given["fallen"], how, start + k, mode=dr.ReduceMode.Permute)
        return (k + 1,)

    dr.while_loop((dr.zeros(UInt32, dr.width(lane)),), lambda k: k < count, step)
    dr.eval(given["fallen"])


_HIT_FACETS = FrozenKernel(_hit_facets)
