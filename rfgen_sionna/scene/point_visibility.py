"""Points on facets that are looked at from one place, or from several at once, all on the device.

Of few rays at a time most of what they take is setting a kernel up: so what is asked of them again and again, where
between two points a shadow's edge is, is one kernel.
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
"""Relative distance within which a hit counts as the target point itself. float32 resolves 1.2e-7 of the coordinates,
so a point on a surface is found within a few 1e-7 of its distance, or of its distance from the origin of the scene."""
NO_PRIMITIVE = 0xFFFFFFFF
CHUNK = 1 << 21
"""Rays per launch: 2 million of them take about 200 MB."""

Nearest = Callable[[Any, Any], tuple[Any, Any]]
"""Rays and the faces that they go to, to the face that each hits first, `NO_PRIMITIVE` for none, and the distance, all
on the device."""


class PointVisibility:
    """Points on facets, asked for by the piece that they lie on and their barycentric coordinates there.

    Args:
        nearest: what rays hit first.
        origin: (3,) [m] of the coordinates that rays have.
        viewpoint: (3,) [m], or (piece, place, 3): places of its own for each, from all of which points have to be seen.
        corners: (piece, 3, 3) [m] of the pieces of facets that the points lie on.
        facets: (piece,) the facet that each is a piece of, which does not hide it.
        extent: largest coordinate [m] of rays and of what they hit, if it is more than those of points and viewpoint.
        scenes: how many Mitsuba scenes `nearest` asks.
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
        # One array for all numbers that may change: each of its own would be one more launch.
        shifts = views - origin
        given = upload(self._double, [max(float(np.abs(shifts).max(initial=0.0)), extent), *shifts.ravel()])
        gather: Any = dr.gather
        self._largest = gather(self._double, given, mi.UInt32(0))
        self._given, self._places = given, len(shifts)
        self._count = dr.opaque(mi.UInt32, len(corners))  # as a number it would be another kernel for each
        self._common = None if own_places else [gather(self._double, given, mi.UInt32(1 + i)) for i in range(3)]

    def visible(self, of: NDArray[np.intp], places: FloatArray) -> NDArray[np.bool_]:
        """(ray,) whether points are seen: :meth:`rfgen_sionna.scene.rays.RayScene.occluded`, several times faster for
        many.

        Args:
            of: (ray,) the piece that each ray goes to.
            places: (ray, 3) barycentric coordinates on it.
        """
        found = np.empty(len(of), np.bool_)
        for part in _chunks(len(of)):
            piece, place = self._lanes(of[part], places[part])
            found[part] = self._visible(piece, place).numpy()
        return found

    def edges(
        self, of: NDArray[np.intp], unoccluded: FloatArray, occluded: FloatArray, halvings: ArrayLike
    ) -> tuple[FloatArray, FloatArray]:
        """(ray, 3) barycentric coordinates of an edge of the shadow between a point that is seen and one that is not,
        and (ray,) how far it is to what casts it, over the way to it, 0 … 1.

        Args:
            of: (ray,) the piece that both lie on.
            lit, dark: (ray, 3) of the point that is seen, and of the one that is not.
            halvings: (ray,) how often what is between them is halved: one ray each.
        """
        import drjit as dr
        import mitsuba as mi

        found, occluder = np.empty((len(of), 3)), np.empty(len(of))
        often = np.broadcast_to(np.asarray(halvings), (len(of),))
        for part in _chunks(len(of)):
            piece, near = self._lanes(of[part], unoccluded[part])
            far = _vectors(self._double, occluded[part], len(piece))
            middle, share = self._halved(piece, near, far, upload(mi.UInt32, often[part]))
            dr.eval(*middle, share)
            for axis, values in enumerate(middle):
                found[part, axis] = values.numpy()
            occluder[part] = share.numpy()
        return found, occluder

    def _halved(self, piece: Any, near: list[Any], far: list[Any], count: Any) -> tuple[list[Any], Any]:
        """Shadow edge between `near`, which is visible, and `far`, after `count` bisections, and the relative distance
        of its occluder."""
        import drjit as dr
        import mitsuba as mi

        def halve(*state: Any) -> tuple[Any, ...]:
            unoccluded, occluded = state[1:4], state[4:]
            middle = [0.5 * (a + b) for a, b in zip(unoccluded, occluded, strict=True)]
            visible = self._visible(piece, middle)
            unoccluded = tuple(dr.select(visible, m, a) for m, a in zip(middle, unoccluded, strict=True))
            occluded = tuple(dr.select(visible, b, m) for m, b in zip(middle, occluded, strict=True))
            return state[0] + 1, *unoccluded, *occluded

        start = dr.zeros(mi.UInt32, len(piece)), *near, *far
        ends = dr.while_loop(start, lambda *state: state[0] < count, halve, mode=self._mode)[1:]
        blocked, share = self._occlusion(piece, ends[3:])
        return [0.5 * (a + b) for a, b in zip(ends[:3], ends[3:], strict=True)], dr.select(blocked, share, 1.0)

    def _lanes(self, of: NDArray[np.intp], places: FloatArray) -> tuple[Any, list[Any]]:
        import mitsuba as mi

        return upload(mi.UInt32, of), _vectors(self._double, places, len(of))

    def _visible(self, piece: Any, place: list[Any]) -> Any:
        return ~self._occlusion(piece, place)[0]

    def _occlusion(self, piece: Any, place: Any) -> tuple[Any, Any]:
        """Whether something is before points, and at what share of the way to them."""
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
        """Whether something is before points at an `offset` from an `origin`, on the facets `own`, and at what share of
        the way to them."""
        import drjit as dr
        import mitsuba as mi

        double = self._double
        reach = dr.sqrt(sum(each * each for each in offset))
        direction = mi.Vector3f(*(mi.Float(each / dr.maximum(reach, 1e-300)) for each in offset))
        ray: Any = mi.Ray3f(mi.Point3f(*(mi.Float(each) for each in origin)), direction)
        ray.maxt = mi.Float(reach) * 1.001  # what lies behind the point does not matter
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
