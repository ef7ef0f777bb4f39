"""Occluders at several times in one ray scene.

Building a scene and launching a kernel cost the same for few rays as for many. The moving faces of all times stand
side by side in one scene, and one launch traces the rays of all times.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.kernels import FrozenKernel, concatenate_aligned, drjit_types, upload
from rfgen_sionna.scene.mesh import bounds, lengths
from rfgen_sionna.scene.point_visibility import NO_PRIMITIVE, PointVisibility
from rfgen_sionna.scene.ray_layer import MeshLayer, evaluate_hits

StaticHits = Callable[[Any, int, bool], tuple[Any, Any]]
"""Rays, their number, and whether neighbouring rays are coherent, to the first face of each (`NO_PRIMITIVE` for none)
and its distance, on the device."""
_MAX_FACES, _MAX_OFFSET = 4_000_000, 30.0
"""Bounds of faces side by side (memory of the tree) and of their offset [m] (float32 coordinates)."""
_SPACING = 1.1
"""Offset from one time's faces to the next, over their width; 0.1 of clearance exceeds rounding."""
_GROUPS = 16
"""Groups of neighbouring facets in the cone test; more cost more than they exclude."""
_MARGIN, _STRAY = 2e-3, 0.05
"""Angular margin [rad] of the cone test, and its share of a face's angular path: limbs move on arcs."""
_MAX_TESTED_TIMES = 8
"""Times of an interval at which the cone test samples the path of a face; faces move smoothly."""


class Occluders:
    """Occluders of points at several times: all static objects, and moving candidate faces.

    Args:
        static: first hits on the static objects.
        origin: (3,) origin of the ray scene's coordinates [m].
        faces: (face, 3) of the moving objects, indices into the vertices of all.
        first: number of static faces, which is the index of the first moving facet.
        viewpoint: (3,) origin of the rays [m].
        vertices: per time, (vertex, 3) positions [m] of all moving objects, concatenated.
        candidates: per time, indices of the moving faces that may occlude.
        points: (point, 3) possible targets [m] outside the bounds of those faces.
    """

    def __init__(
        self,
        static: StaticHits,
        origin: FloatArray,
        faces: NDArray[np.uint32],
        first: int,
        viewpoint: FloatArray,
        vertices: Sequence[FloatArray],
        candidates: Sequence[NDArray[np.intp]],
        points: FloatArray,
    ) -> None:
        self._static, self._origin, self._viewpoint = static, origin, viewpoint
        self._any_static = first > 0
        self._count = first + len(faces)
        chosen = np.concatenate([np.zeros(0, np.intp), *candidates])
        ends = np.take(faces, chosen, axis=0)
        used = np.zeros(1 + int(ends.max(initial=0)), np.bool_)
        used[ends.ravel()] = True
        kept = np.flatnonzero(used)
        placed = np.stack([np.take(each, kept, axis=0) for each in vertices]) - viewpoint
        every = np.concatenate([np.zeros((1, 3)), placed.reshape(-1, 3), points - viewpoint])
        self._box = bounds(every)
        width = self._box[1] - self._box[0]
        self._axis = axis = int(np.argmin(width))
        step = _SPACING * max(float(width[axis]), 1e-3)
        unit = 2.0 ** np.floor(np.log2(step) - 6)  # single precision holds its multiples exactly
        self._step = np.zeros(3)
        self._step[axis] = unit * np.ceil(step / unit)
        placed += np.arange(len(vertices))[:, None, None] * self._step
        time = np.repeat(np.arange(len(candidates)), [len(each) for each in candidates])
        local = (np.cumsum(used) - 1)[ends] + len(kept) * time[:, None]
        self._layer = MeshLayer([(placed.reshape(-1, 3), local)], np.zeros(3), moving=True) if len(chosen) else None
        self._number = chosen + first + time * self._count
        self._extent = float(np.abs(self._box).max() + len(vertices) * self._step.max())

    def numbered(self, facets: IntArray | NDArray[np.int64], count: int) -> NDArray[np.int64]:
        """(time facet,) numbers of `facets` (facet,) at each of `count` times."""
        return (self._count * np.arange(count)[:, None] + facets).ravel()

    def targets(
        self,
        viewpoint: FloatArray,
        corners: FloatArray,
        facets: NDArray[np.int64],
        moving: bool = False,
        bundled: bool = False,
    ) -> PointVisibility:
        """:meth:`rfgen_sionna.scene.rays.RayScene.targets` at any of the times; `facets` are numbers of
        :meth:`numbered`.

        Raises:
            ValueError: `viewpoint` differs from that of the occluders.
        """
        if not np.array_equal(viewpoint, self._viewpoint):
            raise ValueError(f"viewpoint: {viewpoint} given, the viewpoint of the occluders is {self._viewpoint}")
        first = self._first_hits(bundled)

        def nearest(ray: Any, own: Any) -> tuple[Any, Any]:
            return first(ray, own, None if moving else ray)

        scenes = 1 + (self._layer is not None and self._any_static and not moving)
        return PointVisibility(nearest, self._origin, viewpoint, corners, facets, self._extent, scenes)

    def first_facet(self, directions: FloatArray, time: NDArray[np.integer[Any]]) -> NDArray[np.int64]:
        """(ray,) facet of the ray scene that each ray from the viewpoint hits first; -1 for none.

        Args:
            directions: (ray, 3), any length above zero.
            time: (ray,) index of each ray's time.
        """
        if not len(directions):
            return np.zeros(0, np.int64)
        import drjit as dr
        import mitsuba as mi

        towards = directions / np.maximum(lengths(directions), 1e-300)[:, None]
        # Behind the faces of its own time a ray would reach those of the next.
        clear = 0.4 * (1.0 - 1.0 / _SPACING) * self._step[self._axis]
        along, ends = towards[:, self._axis], self._box[:, self._axis] + [-clear, clear]
        reach = ends[(along > 0).astype(np.intp)] / np.where(np.abs(along) > 1e-9, along, 1e-9)
        start = mi.Point3f(*(dr.opaque(mi.Float, float(each)) for each in self._viewpoint - self._origin))
        along_rays = mi.Vector3f(*(upload(mi.Float, row) for row in towards.T))
        rays = [mi.Ray3f(start, along_rays) for _ in range(2)]
        rays[0].maxt = upload(mi.Float, np.abs(reach))
        facet, _ = self._first_hits(False)(rays[0], upload(mi.UInt32, self._count * time), rays[1])
        found = facet.numpy().astype(np.int64)
        return np.where(found == NO_PRIMITIVE, -1, found - self._count * time)

    @cached_property
    def _numbers(self) -> tuple[Any, list[Any], Any]:
        """On the device: faces of a time, offset [m] from one time to the next, and number of each face."""
        import drjit as dr
        import mitsuba as mi

        # One array for all numbers that change: each array costs a launch.
        step, gather = upload(mi.Float, self._step), dr.gather
        steps: list[Any] = [gather(mi.Float, step, mi.UInt32(axis)) for axis in range(3)]
        return dr.opaque(mi.UInt32, self._count), steps, upload(mi.UInt32, self._number)

    def _first_hits(self, bundled: bool) -> Callable[[Any, Any, Any | None], tuple[Any, Any]]:
        """Function of rays, their target facets and the rays for static objects: first facet and distance."""
        import drjit as dr
        import mitsuba as mi

        layer, (count, step, number) = self._layer, self._numbers

        def nearest(ray: Any, own: Any, static: Any | None) -> tuple[Any, Any]:
            time = own // count
            lanes = dr.width(own)
            facet, distance = dr.full(mi.UInt32, NO_PRIMITIVE, lanes), dr.full(mi.Float, dr.inf, lanes)
            if static is not None:
                facet, distance = self._static(static, lanes, bundled)
                facet = dr.select(facet == NO_PRIMITIVE, facet, facet + time * count)
            if layer is None:
                return facet, distance
            if static is not None and self._any_static:
                evaluate_hits(facet, distance)
            shifted = mi.Ray3f(mi.Point3f(*(mi.Float(time) * each for each in step)), ray.d)
            shifted.maxt = ray.maxt
            found = layer.scene.ray_intersect_preliminary(shifted, coherent=bundled)
            nearer = found.is_valid() & (found.t < distance)
            there = dr.gather(mi.UInt32, number, found.prim_index, nearer)
            return dr.select(nearer, there, facet), dr.select(nearer, found.t, distance)

        return nearest


def times_at_once(faces: int, viewpoint: FloatArray, vertices: Sequence[FloatArray]) -> int:
    """Number of times that one :class:`Occluders` can hold, for `faces` moving faces of objects with `vertices`
    (vertex, 3) [m] each, seen from `viewpoint` (3,) [m]."""
    ends = np.concatenate([np.zeros((1, 3)), *(bounds(points) - viewpoint for points in vertices if len(points))])
    step = _SPACING * max(float(np.ptp(ends, axis=0).min()), 1e-3)
    return max(1, min(_MAX_FACES // max(faces, 1), int(_MAX_OFFSET / step)))


def possible_occluders(
    faces: NDArray[np.uint32], vertices: Sequence[FloatArray], corners: FloatArray
) -> NDArray[np.intp]:
    """Indices of the `faces` (face, 3) that may come between the origin and facets at some time: a cone test.

    Args:
        vertices: per time, (vertex, 3) positions [m]; their motion is smooth.
        corners: (time, facet, 3, 3) of the facets [m].
    """
    if not len(faces) or not corners.size:
        return np.zeros(0, np.intp)
    dr, types = drjit_types()
    Float, UInt32 = types.Float64, types.UInt32
    tested = np.linspace(0, len(vertices) - 1, min(len(vertices), _MAX_TESTED_TIMES))
    tested_times = np.unique(tested.astype(np.intp))
    least, most, far = _boxes(corners.reshape(len(corners), -1, 3))
    least, most = (each.reshape(-1, 3, 3) for each in (least, most))
    least, most, far = least.min(axis=1), most.max(axis=1), far.reshape(-1, 3).max(axis=1)
    groups = []
    for group in _neighbours(0.5 * (least + most)):
        bottom, top = least[group].min(axis=0), most[group].max(axis=0)
        square = float(((top - bottom) ** 2).sum())
        rim = _MARGIN + square / 4.0 + _STRAY * np.sqrt(square)
        groups.append([*(bottom - rim), *(top + rim), far[group].max()])
    found = dr.empty(UInt32, len(faces))
    _BEFORE(
        {
            "lanes": dr.arange(UInt32, len(faces)),
            "faces": upload(UInt32, faces),
            "vertices": upload(Float, concatenate_aligned([vertices[each] for each in tested_times])),
            "points": dr.opaque(UInt32, len(vertices[0])),
            "times": dr.opaque(UInt32, len(tested_times)),
            "groups": upload(Float, groups),
            "count": dr.opaque(UInt32, len(groups)),
            "found": found,
        }
    )
    return np.flatnonzero(found.numpy())


def _may_come_before(given: dict[str, Any]) -> None:
    """Kernel of :func:`possible_occluders`: box of a face's corner directions over time against those of the groups."""
    dr, types = drjit_types()
    Float, lane = types.Float64, given["lanes"]
    ends = [dr.gather(types.UInt32, given["faces"], 3 * lane + corner) for corner in range(3)]

    def visible(time: Any, near: Any, *box: Any) -> tuple[Any, ...]:
        low, high = box[:3], box[3:]
        for vertex in ends:
            first = 3 * (time * given["points"] + vertex)
            place = [dr.gather(Float, given["vertices"], first + axis) for axis in range(3)]
            distance = dr.sqrt(sum(each * each for each in place))
            towards = [each / dr.maximum(distance, 1e-12) for each in place]
            low = tuple(dr.minimum(a, b) for a, b in zip(low, towards, strict=True))
            high = tuple(dr.maximum(a, b) for a, b in zip(high, towards, strict=True))
            near = dr.minimum(near, distance)
        return time + 1, near, *low, *high

    begun = [dr.full(Float, value, dr.width(lane)) for value in (dr.inf, 2, 2, 2, -2, -2, -2)]
    first = dr.zeros(types.UInt32, dr.width(lane))
    _, near, *box = dr.while_loop((first, *begun), lambda time, *_: time < given["times"], visible)
    low, high = box[:3], box[3:]
    # Sagitta of an arc: an eighth of its square, twice that over a triangle; the face is nearer by half that share.
    square = sum((b - a) * (b - a) for a, b in zip(low, high, strict=True))
    margin = square / 4.0 + _STRAY * dr.sqrt(square)
    near = near * dr.maximum(1.0 - 0.5 * square, 0.0)

    def or_before(group: Any, found: Any) -> tuple[Any, Any]:
        bottom, top = ([dr.gather(Float, given["groups"], 7 * group + k + i) for i in range(3)] for k in (0, 3))
        there = near < dr.gather(Float, given["groups"], 7 * group + 6)
        for axis in range(3):
            there &= (low[axis] - margin < top[axis]) & (high[axis] + margin > bottom[axis])
        return group + 1, found | there

    nowhere = first, dr.zeros(types.Bool, dr.width(lane))
    found = dr.while_loop(nowhere, lambda group, _: group < given["count"], or_before)[1]
    dr.scatter(given["found"], dr.select(found, types.UInt32(1), types.UInt32(0)), lane, mode=dr.ReduceMode.Permute)
    dr.eval(given["found"])


_BEFORE = FrozenKernel(_may_come_before)


def _boxes(points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Bounds over time of the directions to `points` (time, point, 3) [m], each (point, 3), and largest distance."""
    distance = np.stack([lengths(each) for each in points])
    directions = points / np.maximum(distance, 1e-12)[..., None]
    return directions.min(axis=0), directions.max(axis=0), distance.max(axis=0)


def _neighbours(places: FloatArray) -> list[NDArray[np.intp]]:
    """Groups of neighbouring `places` (place, 3): the widest is halved until there are :data:`_GROUPS`."""
    groups = [np.arange(len(places))] if len(places) else []
    while groups and len(groups) < _GROUPS:
        widths = [np.ptp(places[each], axis=0) for each in groups]
        widest = int(np.argmax([each.max() for each in widths]))
        if widths[widest].max() == 0.0:
            break
        group, axis = groups.pop(widest), int(np.argmax(widths[widest]))
        middle = 0.5 * (places[group, axis].min() + places[group, axis].max())
        groups += [group[places[group, axis] <= middle], group[places[group, axis] > middle]]
    return groups
