"""Visibility: what a ray hits first among static and moving triangles.

Static and moving meshes live in two Mitsuba scenes, so that a moving mesh never rebuilds the static one; the moving
one sits behind an instance, which Embree builds several times faster than a plain mesh. One kernel asks both on the
CPU; OptiX has one table of shaders for a kernel, so with CUDA there is one for each.
Coordinates are shifted to a nearby origin before they become float32, distances are computed from the barycentric
coordinates in float64.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.kernels import upload
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.scene.occluders import Occluders
from rfgen_sionna.scene.point_visibility import CHUNK, NO_PRIMITIVE, SELF_GAP, PointVisibility
from rfgen_sionna.scene.ray_layer import MeshArrays, MeshLayer, evaluate_hits

BLIND_GAP = 1e-4
""":data:`SELF_GAP` for targets whose facet is not known and whose own hit must not count."""


@dataclass(frozen=True)
class Hits:
    """First intersections of rays; where a ray hits nothing, distance is infinite and the indices are -1."""

    distance: FloatArray
    """(ray,) [m]."""
    object: IntArray
    """(ray,) index of the object: static ones first, then moving ones, in the order given."""
    face: IntArray
    """(ray,) index of the face within its object."""
    facet: NDArray[np.int64]
    """(ray,) index of the face among all objects: `facet_offsets[object] + face`."""
    barycentric: FloatArray
    """(ray, 3) weights of the face's corners, in its own order; NaN where nothing is hit."""

    def take(self, index: NDArray[np.intp] | NDArray[np.bool_]) -> Hits:
        """Those of some rays."""
        return Hits(
            self.distance[index], self.object[index], self.face[index], self.facet[index], self.barycentric[index]
        )


class RayScene:
    """Static and moving triangle meshes that rays are sent through.

    Faces are hit from both sides. Objects are numbered static ones first, then moving ones; a *facet* is a face
    numbered through all objects, `facet_offsets[object] + face`.

    Args:
        static: (vertices (vertex, 3) [m], faces (face, 3)) of each object that stays; may be empty.
        moving: the same of each object that moves, at its first place; may be empty.
        origin: (3,) [m] point near which float32 is to resolve best, such as the radar; the centre of the first
            moving object, else of the static ones, where it is not given.

    Raises:
        ValueError: an array of a wrong shape or with NaN in it.
        BackendError: Mitsuba cannot run here.
    """

    def __init__(
        self, static: Sequence[MeshArrays], moving: Sequence[MeshArrays] = (), origin: ArrayLike | None = None
    ) -> None:
        from rfgen_sionna.scene.mitsuba_backend import ensure_backend  # here, so that `python -m …backend` runs it once

        ensure_backend()
        import drjit as dr
        import mitsuba as mi

        meshes = [*static, *moving]
        for i, (vertices, faces) in enumerate(meshes):
            _check_points(vertices, f"vertices of object {i}")
            if np.ndim(faces) != 2 or np.shape(faces)[1] != 3 or len(faces) == 0:
                raise ValueError(f"faces of object {i} have shape {np.shape(faces)}, (face, 3) is needed")
        self.facet_offsets: NDArray[np.int64] = np.cumsum([0] + [len(f) for _, f in meshes])
        self.origin: FloatArray = (
            _choose_origin(static, moving)
            if origin is None
            else _check_points(np.asarray(origin, np.float64)[None], "origin")[0]
        )
        self._static = MeshLayer(static, self.origin, moving=False) if static else None
        self._moving = MeshLayer(moving, self.origin, moving=True) if moving else None
        self._num_static = int(self.facet_offsets[len(static)])
        self._first = [dr.opaque(mi.UInt32, offset) for offset in (0, self._num_static)]

    @property
    def num_facets(self) -> int:
        return int(self.facet_offsets[-1])

    def update(self, vertices: Sequence[FloatArray]) -> None:
        """Move the moving objects to `vertices`, one (vertex, 3) array [m] per object, in the order given.

        Raises:
            ValueError: another number of objects or vertices than at construction, or NaN in them.
        """
        expected = self._moving.counts if self._moving else []
        if [len(v) for v in vertices] != expected:
            raise ValueError(f"vertices: {[len(v) for v in vertices]} given, the moving objects have {expected}")
        if self._moving is None:
            return
        for i, points in enumerate(vertices):
            _check_points(points, f"vertices of moving object {i}")
        self._moving.move(np.concatenate([np.asarray(v, np.float64) for v in vertices]))

    def first_hit(self, origins: ArrayLike, directions: ArrayLike) -> Hits:
        """First hit of each ray.

        Args:
            origins: (ray, 3) or (3,) [m].
            directions: (ray, 3) of any length above zero.
        """
        d = _check_points(directions, "directions")
        o = np.broadcast_to(_check_points(np.atleast_2d(origins), "origins"), d.shape)
        length = lengths(d)[:, None]
        if (length == 0.0).any():
            raise ValueError(f"directions: ray {int(np.argmin(length))} has length zero")
        return self._trace(o, d / length)

    def first_facet(self, origins: ArrayLike, directions: ArrayLike) -> NDArray[np.int64]:
        """(ray,) the facet that each ray hits first, -1 where there is none; the arguments of :meth:`first_hit`."""
        d = _check_points(directions, "directions")
        o = np.broadcast_to(_check_points(np.atleast_2d(origins), "origins"), d.shape)
        return self._trace_raw(o, d / np.maximum(lengths(d), 1e-300)[:, None])[0]

    def occluded(
        self,
        origins: ArrayLike,
        targets: ArrayLike,
        facets: ArrayLike | None = None,
        source_facets: ArrayLike | None = None,
    ) -> NDArray[np.bool_]:
        """(ray,) whether anything stands between each origin and its target.

        The facet a target lies on never hides its own point, neither does what lies within `SELF_GAP` of the
        distance in front of it.

        Args:
            origins: (ray, 3) or (3,) [m].
            targets: (ray, 3) [m].
            facets: (ray,) the facet that each target lies on. Where it is not given, whatever lies within
                `BLIND_GAP` of the distance in front of a target is taken for its own surface.
            source_facets: (ray,) the facet that each origin lies on, where the rays start on a surface; it never
                hides.
        """
        p = _check_points(targets, "targets")
        o = np.broadcast_to(_check_points(np.atleast_2d(origins), "origins"), p.shape)
        own = _check_facets(facets, len(p), self.num_facets, "facets")
        left = _check_facets(source_facets, len(p), self.num_facets, "source_facets")
        span = p - o
        reach = lengths(span)
        if (reach == 0.0).any():
            raise ValueError(f"targets: target {int(np.argmin(reach))} lies at its origin")
        direction = span / reach[:, None]
        skip = np.zeros_like(reach)
        if left is not None:
            # Start a little above the surface left behind; its own facet is excluded by its number as well.
            skip = BLIND_GAP * reach
            o = o + skip[:, None] * direction
        facet, distance = self._trace_raw(o, direction)
        allowed = 1.0 - (BLIND_GAP if own is None else SELF_GAP)
        # Rounding of the shifted coordinates grows with the distance from the origin of the scene.
        noise = 1e-6 * np.maximum(_largest(p - self.origin), _largest(o - self.origin))
        blocked = (facet >= 0) & (distance + skip < np.minimum(allowed * reach, reach - noise))
        if own is not None:
            blocked &= facet != own
        if left is not None:
            blocked &= facet != left
        return np.asarray(blocked)

    def _trace(self, origins: FloatArray, directions: FloatArray) -> Hits:
        parts = [self._launch(o, d, True) for o, d in _chunks(origins, directions)]
        facet = np.concatenate([p[0] for p in parts]) if parts else np.empty(0, np.int64)
        u, v = (np.concatenate([p[i] for p in parts]) if parts else np.empty(0) for i in (2, 3))
        hit = facet >= 0
        weights = np.stack([1.0 - u - v, u, v], axis=1)
        weights[~hit] = np.nan
        distance = np.full(len(facet), np.inf)
        corners = self.corners(facet[hit])
        points = np.einsum("rc,rci->ri", weights[hit], corners)
        distance[hit] = lengths(points - origins[hit])
        index = np.searchsorted(self.facet_offsets, facet, side="right") - 1
        face = facet - self.facet_offsets[np.maximum(index, 0)]
        return Hits(
            distance=distance,
            object=np.where(hit, index, -1).astype(np.int32),
            face=np.where(hit, face, -1).astype(np.int32),
            facet=facet,
            barycentric=weights,
        )

    def _trace_raw(self, origins: FloatArray, directions: FloatArray) -> tuple[NDArray[np.int64], FloatArray]:
        parts = [self._launch(o, d, False) for o, d in _chunks(origins, directions)]
        if not parts:
            return np.empty(0, np.int64), np.empty(0)
        return np.concatenate([p[0] for p in parts]), np.concatenate([p[1] for p in parts])

    def corners(self, facets: NDArray[np.int64]) -> FloatArray:
        """(facet, corner, 3) positions [m] of the corners of facets, as the objects stand now."""
        out = np.empty((len(facets), 3, 3))
        moving = facets >= self._num_static
        for layer, chosen, offset in ((self._static, ~moving, 0), (self._moving, moving, self._num_static)):
            if layer is not None:
                out[chosen] = layer.vertices[layer.faces[facets[chosen] - offset]]
        return out

    def _launch(self, origins: FloatArray, directions: FloatArray, uv: bool) -> tuple[NDArray[Any], ...]:
        """Facet (int64, -1 for none), distance, and barycentric u and v of one chunk, float64."""
        import drjit as dr
        import mitsuba as mi

        start, towards = ([upload(mi.Float, row) for row in rows.T] for rows in (origins - self.origin, directions))
        ray = mi.Ray3f(mi.Point3f(*start), mi.Vector3f(*towards))
        facet, distance, weights = self._nearest(ray, len(origins))
        outputs: list[Any] = [facet, distance, *(weights if uv else [])]
        dr.eval(*outputs)
        # Dr.Jit's arrays share their memory with NumPy on the CPU: converting the type copies it.
        index = outputs[0].numpy().astype(np.int64)
        index[index == NO_PRIMITIVE] = -1
        return (index, *(value.numpy().astype(np.float64) for value in outputs[1:]))

    @property
    def moving_faces(self) -> NDArray[np.uint32]:
        """(face, 3) of all moving objects, which count their vertices one after the other."""
        return np.zeros((0, 3), np.uint32) if self._moving is None else self._moving.faces

    def occluders(
        self,
        viewpoint: FloatArray,
        vertices: Sequence[Sequence[FloatArray]],
        candidates: Sequence[NDArray[np.intp]],
        corners: FloatArray | None = None,
    ) -> Occluders:
        """Occluders of facets as seen from a viewpoint at several times. `vertices` are those of the moving objects, as
        :meth:`update` takes them, for every time.

        Args:
            viewpoint: (3,) [m].
            vertices: of every time, (vertex, 3) [m] of each moving object.
            hiding: of every time, which of the :attr:`moving_faces` may come before the facets.
            corners: (time, facet, 3, 3) [m] of the facets that are looked at; None is some of the moving faces.
        """

        def static(ray: Any, count: int, bundled: bool) -> tuple[Any, Any]:
            return self._nearest(ray, count, moving=False, bundled=bundled)[:2]

        placed = [np.concatenate([np.zeros((0, 3)), *each]) for each in vertices]
        points = np.zeros((0, 3)) if corners is None else corners.reshape(-1, 3)
        return Occluders(
            static, self.origin, self.moving_faces, self._num_static, viewpoint, placed, candidates, points
        )

    def _nearest(
        self, ray: Any, count: int, static: bool = True, moving: bool = True, bundled: bool = False
    ) -> tuple[Any, Any, list[Any]]:
        """Facet, distance and barycentric u and v of the first hits of `count` rays on objects that stay and on such
        that move, as Dr.Jit arrays. What is `bundled`, neighbours side by side, is traced in packets."""
        import drjit as dr
        import mitsuba as mi

        facet = dr.full(mi.UInt32, NO_PRIMITIVE, count)
        distance = dr.full(mi.Float, dr.inf, count)
        weights = [dr.zeros(mi.Float, count), dr.zeros(mi.Float, count)]
        for number, (layer, first) in enumerate(self._asked(static, moving)):
            if number:
                evaluate_hits(facet, distance, *weights)
            found = layer.scene.ray_intersect_preliminary(ray, coherent=bundled)
            nearer = found.is_valid() & (found.t < distance)
            facet = dr.select(nearer, found.prim_index + first, facet)
            distance = dr.select(nearer, found.t, distance)
            weights = [dr.select(nearer, found.prim_uv[i], weights[i]) for i in (0, 1)]
        return facet, distance, weights

    def _asked(self, static: bool, moving: bool) -> list[tuple[MeshLayer, Any]]:
        """Scenes that are there, of those wanted, and the number of the first facet of each."""
        layers = zip((self._static, self._moving), self._first, (static, moving), strict=True)
        return [(layer, first) for layer, first, wanted in layers if layer is not None and wanted]

    def targets(
        self,
        viewpoint: FloatArray,
        corners: FloatArray,
        facets: IntArray,
        moving: bool = False,
        bundled: bool = False,
    ) -> PointVisibility:
        """Points on facets that are to be looked at from one place, as the objects stand now.

        Args:
            viewpoint: (3,) [m], or (piece, place, 3): places of its own for each, from all of which points have to be
                seen.
            corners: (piece, 3, 3) [m] of the pieces of facets that the points lie on.
            facets: (piece,) the facet that each is a piece of, which does not hide it.
            moving: whether nothing but moving objects hides.
            bundled: whether they are many on each piece, one after the other: in packets such rays take a third to two
                thirds of the time, and others more than twice as long.
        """

        def nearest(ray: Any, own: Any) -> tuple[Any, Any]:
            return self._nearest(ray, len(own), static=not moving, bundled=bundled)[:2]

        return PointVisibility(
            nearest, self.origin, viewpoint, corners, facets, scenes=len(self._asked(not moving, True))
        )


def _chunks(*arrays: FloatArray) -> Iterator[tuple[FloatArray, ...]]:
    for start in range(0, len(arrays[0]), CHUNK):
        yield tuple(a[start : start + CHUNK] for a in arrays)


def _largest(points: FloatArray) -> FloatArray:
    """(point,) largest absolute coordinate; several times faster than `max(axis=1)`."""
    x, y, z = np.abs(points).T
    return np.asarray(np.maximum(np.maximum(x, y), z))


def _choose_origin(static: Sequence[MeshArrays], moving: Sequence[MeshArrays]) -> FloatArray:
    if moving:
        points = np.asarray(moving[0][0], np.float64)
    elif static:
        points = np.concatenate([np.asarray(v, np.float64) for v, _ in static])
    else:
        return np.zeros(3)
    return np.asarray(0.5 * (points.min(axis=0) + points.max(axis=0)))


def _check_points(value: ArrayLike, what: str) -> FloatArray:
    points = np.asarray(value, np.float64)
    if points.ndim != 2 or points.shape[1] != 3:
        raise ValueError(f"{what}: shape {points.shape} given, (…, 3) is needed")
    if not np.isfinite(points).all():
        raise ValueError(
            f"{what}: NaN or infinite values, the first in row {int(np.argmin(np.isfinite(points).all(axis=1)))}"
        )
    return points


def _check_facets(value: ArrayLike | None, rays: int, facets: int, what: str) -> NDArray[np.int64] | None:
    if value is None:
        return None
    index = np.broadcast_to(np.asarray(value, np.int64), (rays,))
    if rays and (index.min() < -1 or index.max() >= facets):
        raise ValueError(f"{what}: {int(index.min())} … {int(index.max())} given, allowed are -1 … {facets - 1}")
    return index
