"""Visibility of points on facets from one viewpoint, or from several at once, on the device.

The bisection for a shadow edge is one kernel: launches dominate the cost of few rays.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.kernels import upload
from rfgen_sionna.scene.ray_layer import loop_mode

SELF_GAP = 1e-5
"""Relative distance within which a hit counts as the target itself; far above float32's resolution of 1.2e-7."""
NO_PRIMITIVE = 0xFFFFFFFF
"""Mitsuba's face index of a ray without a hit."""
CHUNK = 1 << 21
"""Rays per launch; a ray takes about 100 bytes."""

Nearest = Callable[[Any, Any], tuple[Any, Any]]
"""Rays and their target facets to the first face of each (`NO_PRIMITIVE` for none) and its distance, on the device."""


class PointVisibility:
    """Visibility of points, each given by a piece of a facet and barycentric coordinates on it.

    Args:
        nearest: first hits of rays.
        origin: (3,) origin of the rays' coordinates [m].
        viewpoint: (3,) [m], or (piece, place, 3): several viewpoints per piece, all of which must see a point.
        corners: (piece, 3, 3) corners of the pieces [m].
        facets: (piece,) facet of each piece, which does not occlude it.
        extent: bound of the coordinates [m] of rays and hits, where it exceeds those of points and viewpoint.
        scenes: number of Mitsuba scenes that `nearest` traces.
    """

    def __init__(
        self,
        nearest: Nearest,
        origin: FloatArray,
        viewpoint: FloatArray,
        corners: FloatArray,
        facets: IntArray | NDArray[np.int64],
        extent: float = 0.0,
        scenes: int = 1,
    ) -> None:
        import drjit as dr
        import mitsuba as mi

        self._nearest, self._mode = nearest, loop_mode(scenes)
        self._double: Any = dr.float64_array_t(mi.Float)
        own_places = np.ndim(viewpoint) == 3
        views = np.moveaxis(viewpoint, 1, 0) if own_places else viewpoint[None]
        self._flat = upload(self._double, corners - (views[0][:, None] if own_places else viewpoint))
        self._own = upload(mi.UInt32, facets)
        # One array for all numbers that may change: each array costs a launch.
        shifts = views - origin
        given = upload(self._double, [max(float(np.abs(shifts).max(initial=0.0)), extent), *shifts.ravel()])
        gather: Any = dr.gather
        self._largest = gather(self._double, given, mi.UInt32(0))
        self._given, self._places = given, len(shifts)
        self._count = dr.opaque(mi.UInt32, len(corners))  # a literal would make a kernel for each count
        self._common = None if own_places else [gather(self._double, given, mi.UInt32(1 + i)) for i in range(3)]

    def visible(self, of: NDArray[np.intp], places: FloatArray) -> NDArray[np.bool_]:
        """(ray,) whether points are visible.

        Args:
            of: (ray,) piece of each target.
            places: (ray, 3) barycentric coordinates on it.
        """
        import mitsuba as mi

        found = np.empty(len(of), np.bool_)
        for part in _chunks(len(of)):
            piece = upload(mi.UInt32, of[part])
            blocked, _ = self._occlusion(piece, _vectors(self._double, places[part], len(piece)))
            found[part] = (~blocked).numpy()
        return found

    def edges(
        self, of: NDArray[np.intp], unoccluded: FloatArray, occluded: FloatArray, halvings: ArrayLike
    ) -> tuple[FloatArray, FloatArray]:
        """Shadow edges between visible and occluded points, by bisection.

        Args:
            of: (ray,) piece of both points.
            unoccluded, occluded: (ray, 3) barycentric coordinates of the visible and of the occluded point.
            halvings: (ray,) or scalar number of bisections, one ray each.

        Returns:
            (ray, 3) barycentric coordinates of the edge, and (ray,) distance of its occluder over the point's, 0 … 1.
        """
        import drjit as dr
        import mitsuba as mi

        found, occluder = np.empty((len(of), 3)), np.empty(len(of))
        often = np.broadcast_to(np.asarray(halvings), (len(of),))
        for part in _chunks(len(of)):
            piece = upload(mi.UInt32, of[part])
            near, far = (_vectors(self._double, each[part], len(piece)) for each in (unoccluded, occluded))
            middle, share = self._halved(piece, near, far, upload(mi.UInt32, often[part]))
            dr.eval(*middle, share)
            for axis, values in enumerate(middle):
                found[part, axis] = values.numpy()
            occluder[part] = share.numpy()
        return found, occluder

    def _halved(self, piece: Any, near: list[Any], far: list[Any], count: Any) -> tuple[list[Any], Any]:
        """Shadow edge between visible `near` and `far` after `count` bisections, and its occluder's distance share."""
        import drjit as dr
        import mitsuba as mi

        def halve(*state: Any) -> tuple[Any, ...]:
            unoccluded, occluded = state[1:4], state[4:]
            middle = [0.5 * (a + b) for a, b in zip(unoccluded, occluded, strict=True)]
            visible = ~self._occlusion(piece, middle)[0]
            unoccluded = tuple(dr.select(visible, m, a) for m, a in zip(middle, unoccluded, strict=True))
            occluded = tuple(dr.select(visible, b, m) for m, b in zip(middle, occluded, strict=True))
            return state[0] + 1, *unoccluded, *occluded

        start = dr.zeros(mi.UInt32, len(piece)), *near, *far
        ends = dr.while_loop(start, lambda *state: state[0] < count, halve, mode=self._mode)[1:]
        blocked, share = self._occlusion(piece, ends[3:])
        return [0.5 * (a + b) for a, b in zip(ends[:3], ends[3:], strict=True)], dr.select(blocked, share, 1.0)

    def _occlusion(self, piece: Any, place: Any) -> tuple[Any, Any]:
        """Whether points are occluded, and the occluder's distance over theirs."""
        import drjit as dr

        double = self._double
        corner = [[dr.gather(double, self._flat, 9 * piece + 3 * i + axis) for i in range(3)] for axis in range(3)]
        offset = [sum(place[i] * each[i] for i in range(3)) for each in corner]
        own = dr.gather(dr.uint32_array_t(double), self._own, piece)
        first, *others = self._origins(piece)
        blocked, share = self._before(first, offset, own)
        for other in others:
            way = [there + here - start for there, here, start in zip(offset, first, other, strict=True)]
            also, there_share = self._before(other, way, own)
            blocked, share = blocked | also, dr.select(blocked, share, there_share)
        return blocked, share

    def _origins(self, piece: Any) -> list[list[Any]]:
        """Origins of the rays to `piece`."""
        import drjit as dr

        if self._common is not None:
            return [self._common]
        gather: Any = dr.gather
        return [
            [gather(self._double, self._given, 1 + 3 * (self._count * k + piece) + axis) for axis in range(3)]
            for k in range(self._places)
        ]

    def _before(self, origin: list[Any], offset: list[Any], own: Any) -> tuple[Any, Any]:
        """The same from one `origin`, for points at an `offset` from it on the facets `own`."""
        import drjit as dr
        import mitsuba as mi

        double = self._double
        reach = dr.sqrt(sum(each * each for each in offset))
        direction = mi.Vector3f(*(mi.Float(each / dr.maximum(reach, 1e-300)) for each in offset))
        ray: Any = mi.Ray3f(mi.Point3f(*(mi.Float(each) for each in origin)), direction)
        ray.maxt = mi.Float(reach) * 1.001
        facet, distance = self._nearest(ray, own)
        size = self._largest
        for there, here in zip(offset, origin, strict=True):
            size = dr.maximum(size, dr.abs(there + here))
        limit = dr.minimum((1.0 - SELF_GAP) * reach, reach - 1e-6 * size)
        blocked = (facet != NO_PRIMITIVE) & (double(distance) < limit) & (facet != own)
        return blocked, double(distance) / dr.maximum(reach, 1e-300)


def _vectors(kind: Any, places: FloatArray, count: int) -> list[Any]:
    import drjit as dr
    import mitsuba as mi

    flat, lane = upload(kind, places), dr.arange(mi.UInt32, count)
    return [dr.gather(kind, flat, 3 * lane + i) for i in range(3)]


def _chunks(count: int) -> Iterator[slice]:
    return (slice(start, start + CHUNK) for start in range(0, count, CHUNK))
