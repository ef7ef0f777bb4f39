"""First hits of rays among static and moving triangles.

Static and moving meshes are two Mitsuba scenes: motion never rebuilds the static one. The moving mesh is an instance,
which Embree builds faster than a plain mesh. The CPU traces both scenes in one kernel, CUDA in one kernel each.
Coordinates are shifted to a nearby origin before they become float32; distances follow from the barycentric coordinates
in float64.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rfgen_sionna._deprecation import Renamed
from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.kernels import upload
from rfgen_sionna.scene.mesh import lengths, max_component
from rfgen_sionna.scene.occluders import Occluders
from rfgen_sionna.scene.point_visibility import CHUNK, NO_PRIMITIVE, SELF_GAP, PointVisibility
from rfgen_sionna.scene.ray_layer import MeshArrays, MeshLayer, evaluate_hits

BLIND_GAP = 1e-4
""":data:`SELF_GAP` of targets without a known facet."""


@dataclass(frozen=True)
class Hits:
    """First hits of rays. A ray without a hit has an infinite distance and indices of -1."""

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
        """Hits of a subset of the rays."""
        return Hits(*(getattr(self, item.name)[index] for item in fields(self)))


class RayScene:
    """Static and moving triangle meshes for ray tracing.

    Rays hit faces from both sides. Static objects come first, then moving ones. A *facet* is a face numbered through
    all objects: `facet_offsets[object] + face`.

    Args:
        static: vertices (vertex, 3) [m] and faces (face, 3) of each static object; may be empty.
        moving: vertices at the first time and faces of each moving object; may be empty.
        origin: (3,) point of the best float32 resolution [m], such as the radar; None takes the centre of the first
            moving object, else of the static ones.

    Raises:
        ValueError: an array has a wrong shape or NaN.
        BackendError: Mitsuba cannot run.
    """

    def __init__(
        self, static: Sequence[MeshArrays], moving: Sequence[MeshArrays] = (), origin: ArrayLike | None = None
    ) -> None:
        from rfgen_sionna.scene.mitsuba_backend import ensure_backend  # at run time: it is also a __main__

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
        """Move the moving objects to `vertices`, one (vertex, 3) array [m] per object.

        Raises:
            ValueError: the numbers of objects or vertices changed, or a coordinate is NaN.
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
            directions: (ray, 3), any length above zero.

        Raises:
            ValueError: an array has a wrong shape or NaN, or a direction has length zero.
        """
        o, d = _pairs(origins, directions, "directions")
        length = lengths(d)[:, None]
        if (length == 0.0).any():
            raise ValueError(f"directions: ray {int(np.argmin(length))} has length zero")
        return self._trace(o, d / length)

    def first_facet(self, origins: ArrayLike, directions: ArrayLike) -> NDArray[np.int64]:
        """(ray,) facet that each ray hits first, -1 for none; arguments of :meth:`first_hit`."""
        o, d = _pairs(origins, directions, "directions")
        return self._trace_raw(o, d / np.maximum(lengths(d), 1e-300)[:, None])[0]

    def occluded(
        self,
        origins: ArrayLike,
        targets: ArrayLike,
        facets: ArrayLike | None = None,
        source_facets: ArrayLike | None = None,
    ) -> NDArray[np.bool_]:
        """(ray,) whether a surface lies between each origin and its target.

        The target's own facet does not occlude it, nor does a hit within `SELF_GAP` of the distance before it.

        Args:
            origins: (ray, 3) or (3,) [m].
            targets: (ray, 3) [m].
            facets: (ray,) facet of each target; None takes hits within `BLIND_GAP` for the target's own surface.
            source_facets: (ray,) facet of each origin, which does not occlude; None for origins in free space.

        Raises:
            ValueError: an array has a wrong shape or NaN, a facet does not exist, or a target lies at its origin.
        """
        o, p = _pairs(origins, targets, "targets")
        own = _check_facets(facets, len(p), self.num_facets, "facets")
        left = _check_facets(source_facets, len(p), self.num_facets, "source_facets")
        span = p - o
        reach = lengths(span)
        if (reach == 0.0).any():
            raise ValueError(f"targets: target {int(np.argmin(reach))} lies at its origin")
        direction = span / reach[:, None]
        skip = np.zeros_like(reach)
        if left is not None:
            skip = BLIND_GAP * reach  # start above the origin's surface
            o = o + skip[:, None] * direction
        facet, distance = self._trace_raw(o, direction)
        allowed = 1.0 - (BLIND_GAP if own is None else SELF_GAP)
        # Rounding of the shifted coordinates grows with the distance from the scene's origin.
        noise = 1e-6 * np.maximum(max_component(np.abs(p - self.origin)), max_component(np.abs(o - self.origin)))
        blocked = (facet >= 0) & (distance + skip < np.minimum(allowed * reach, reach - noise))
        if own is not None:
            blocked &= facet != own
        if left is not None:
            blocked &= facet != left
        return np.asarray(blocked)

    def _trace(self, origins: FloatArray, directions: FloatArray) -> Hits:
        facet, _, u, v = self._trace_raw(origins, directions, uv=True)
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

    def _trace_raw(self, origins: FloatArray, directions: FloatArray, uv: bool = False) -> tuple[NDArray[Any], ...]:
        """Facet (int64, -1 for none), distance and, with `uv`, barycentric u and v, float64."""
        parts = [self._launch(o, d, uv) for o, d in _chunks(origins, directions)]
        if not parts:
            return np.empty(0, np.int64), *(np.empty(0) for _ in range(3 if uv else 1))
        return tuple(np.concatenate(part) for part in zip(*parts, strict=True))

    def corners(self, facets: NDArray[np.int64]) -> FloatArray:
        """(facet, corner, 3) present positions of the corners of facets [m]."""
        out = np.empty((len(facets), 3, 3))
        moving = facets >= self._num_static
        for layer, chosen, offset in ((self._static, ~moving, 0), (self._moving, moving, self._num_static)):
            if layer is not None:
                out[chosen] = layer.vertices[layer.faces[facets[chosen] - offset]]
        return out

    def _launch(self, origins: FloatArray, directions: FloatArray, uv: bool) -> tuple[NDArray[Any], ...]:
        """:meth:`_trace_raw` of one chunk."""
        import drjit as dr
        import mitsuba as mi

        start, towards = ([upload(mi.Float, row) for row in rows.T] for rows in (origins - self.origin, directions))
        ray = mi.Ray3f(mi.Point3f(*start), mi.Vector3f(*towards))
        facet, distance, weights = self._nearest(ray, len(origins))
        outputs: list[Any] = [facet, distance, *(weights if uv else [])]
        dr.eval(*outputs)
        index = outputs[0].numpy().astype(np.int64)  # a copy: on the CPU NumPy shares Dr.Jit's memory
        index[index == NO_PRIMITIVE] = -1
        return (index, *(value.numpy().astype(np.float64) for value in outputs[1:]))

    @property
    def moving_faces(self) -> NDArray[np.uint32]:
        """(face, 3) of all moving objects, indices into their concatenated vertices."""
        return np.zeros((0, 3), np.uint32) if self._moving is None else self._moving.faces

    def occluders(
        self,
        viewpoint: FloatArray,
        vertices: Sequence[Sequence[FloatArray]],
        candidates: Sequence[NDArray[np.intp]],
        corners: FloatArray | None = None,
    ) -> Occluders:
        """Occluders of facets from one viewpoint at several times.

        Args:
            viewpoint: (3,) [m].
            vertices: per time, (vertex, 3) [m] of each moving object.
            candidates: per time, indices of the :attr:`moving_faces` that may occlude.
            corners: (time, facet, 3, 3) corners of the target facets [m]; None for targets on the moving faces.
        """

        def static(ray: Any, count: int, bundled: bool) -> tuple[Any, Any]:
            return self._nearest(ray, count, moving=False, bundled=bundled)[:2]

        placed = [np.concatenate([np.zeros((0, 3)), *each]) for each in vertices]
        points = np.zeros((0, 3)) if corners is None else corners.reshape(-1, 3)
        return Occluders(
            static, self.origin, self.moving_faces, self._num_static, viewpoint, placed, candidates, points
        )

    looks = Renamed("occluders")

    def _nearest(
        self, ray: Any, count: int, static: bool = True, moving: bool = True, bundled: bool = False
    ) -> tuple[Any, Any, list[Any]]:
        """Facet, distance and barycentric u and v of the first hits of `count` rays, on the device. `bundled` rays,
        with neighbours side by side, are traced in packets."""
        import drjit as dr
        import mitsuba as mi

        facet = dr.full(mi.UInt32, NO_PRIMITIVE, count)
        distance = dr.full(mi.Float, dr.inf, count)
        weights = [dr.zeros(mi.Float, count), dr.zeros(mi.Float, count)]
        for number, (layer, first) in enumerate(self._layers(static, moving)):
            if number:
                evaluate_hits(facet, distance, *weights)
            found = layer.scene.ray_intersect_preliminary(ray, coherent=bundled)
            nearer = found.is_valid() & (found.t < distance)
            facet = dr.select(nearer, found.prim_index + first, facet)
            distance = dr.select(nearer, found.t, distance)
            weights = [dr.select(nearer, found.prim_uv[i], weights[i]) for i in (0, 1)]
        return facet, distance, weights

    def _layers(self, static: bool, moving: bool) -> list[tuple[MeshLayer, Any]]:
        """The existing ones of the wanted scenes, each with the index of its first facet."""
        layers = zip((self._static, self._moving), self._first, (static, moving), strict=True)
        return [(layer, first) for layer, first, wanted in layers if layer is not None and wanted]

    def targets(
        self, viewpoint: FloatArray, corners: FloatArray, facets: IntArray, moving: bool = False, bundled: bool = False
    ) -> PointVisibility:
        """Visibility of points on facets at the present positions of the objects.

        Args:
            viewpoint: (3,) [m], or (piece, place, 3): several viewpoints per piece, all of which must see a point.
            corners: (piece, 3, 3) corners of the pieces of facets [m].
            facets: (piece,) facet of each piece, which does not occlude it.
            moving: True lets only moving objects occlude.
            bundled: True traces rays in packets: faster for many successive points per piece, slower for others.
        """

        def nearest(ray: Any, own: Any) -> tuple[Any, Any]:
            return self._nearest(ray, len(own), static=not moving, bundled=bundled)[:2]

        scenes = len(self._layers(not moving, True))
        return PointVisibility(nearest, self.origin, viewpoint, corners, facets, scenes=scenes)


def _chunks(*arrays: FloatArray) -> Iterator[tuple[FloatArray, ...]]:
    for start in range(0, len(arrays[0]), CHUNK):
        yield tuple(a[start : start + CHUNK] for a in arrays)


def _pairs(origins: ArrayLike, ends: ArrayLike, what: str) -> tuple[FloatArray, FloatArray]:
    """Checked origins and `ends`, both (ray, 3)."""
    checked = _check_points(ends, what)
    return np.broadcast_to(_check_points(np.atleast_2d(origins), "origins"), checked.shape), checked


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
