"""Moving objects as they stand at several times, looked at together.

To build the tree of a ray scene and to launch a kernel takes milliseconds, however few the rays. Where a few facets are
looked at again and again, what may come before them is built once for all times, one beside the other, and rays of all
times are traced together.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.records import FloatArray, IntArray
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.scene.ray_layer import Layer
from rfgen_sionna.scene.targets import NO_PRIMITIVE, Targets
from rfgen_sionna.scene.transfer import upload

FirstHits = Callable[[Any, int, bool], tuple[Any, Any]]
"""So many rays, and whether neighbours are side by side, to the face that each hits first, `NO_PRIMITIVE` for none, and
the distance, on the device."""
_APART = 1.1
"""Distance from the objects of one time to those of the next, over their width."""
_GROUPS = 16
"""Groups of neighbouring facets before which objects are looked for."""
_MARGIN, _STRAY = 2e-3, 0.05
"""How far beside them, too: so much [rad], and that share of how far a face gets."""
_TOLD = 8
"""Times that tell where faces get to, at most."""


class Looks:
    """What hides facets at several times: all static objects, and of the moving ones what may come before these facets.

    Args:
        static: what rays hit of static objects.
        origin: (3,) [m] of the coordinates that these rays have.
        faces: (face, 3) of the moving objects, as they count the vertices of all.
        first: number of the first of them in the ray scene, and of static faces.
        viewpoint: (3,) [m] from which rays start.
        vertices: of every time, (vertex, 3) positions [m] of all moving objects, one after the other.
        corners: (time, facet, 3, 3) [m] of the facets that are looked at.
    """

    def __init__(
        self,
        static: FirstHits,
        origin: FloatArray,
        faces: NDArray[np.uint32],
        first: int,
        viewpoint: FloatArray,
        vertices: Sequence[FloatArray],
        corners: FloatArray,
    ) -> None:
        self._static, self._origin, self._viewpoint = static, origin, viewpoint
        self._first, self._count = first, first + len(faces)
        self._chosen = before(faces, [each - viewpoint for each in vertices], corners - viewpoint)
        used, local = np.unique(faces[self._chosen], return_inverse=True)
        placed = np.stack([np.take(each, used, axis=0) for each in vertices]) - viewpoint
        points = np.concatenate([np.zeros((1, 3)), placed.reshape(-1, 3), (corners - viewpoint).reshape(-1, 3)])
        width = np.ptp(points, axis=0)
        axis = int(np.argmin(width))
        step = _APART * max(float(width[axis]), 1e-3)
        unit = 2.0 ** np.floor(np.log2(step) - 6)  # single precision holds its multiples exactly
        self._step = np.zeros(3)
        self._step[axis] = unit * np.ceil(step / unit)
        placed += np.arange(len(vertices))[:, None, None] * self._step
        every = local.reshape(-1, 3) + len(used) * np.arange(len(vertices))[:, None, None]
        mesh = placed.reshape(-1, 3), every.reshape(-1, 3)
        self._layer = Layer([mesh], np.zeros(3), moving=True) if len(self._chosen) else None
        self._extent = float(np.abs(points).max() + len(vertices) * self._step.max())

    def numbered(self, facets: IntArray, count: int) -> NDArray[np.int64]:
        """(time facet,) numbers by which :meth:`targets` knows `facets` (facet,) of the ray scene at each of so many
        times."""
        return (self._count * np.arange(count)[:, None] + facets).ravel()

    def targets(
        self,
        viewpoint: FloatArray,
        corners: FloatArray,
        facets: NDArray[np.int64],
        moving: bool = False,
        bundled: bool = False,
    ) -> Targets:
        """:meth:`rfgen_sionna.scene.rays.RayScene.targets` of pieces of facets at any of the times, `facets` being
        their numbers by :meth:`numbered`.

        Raises:
            ValueError: another viewpoint than these looks are from.
        """
        if not np.array_equal(viewpoint, self._viewpoint):
            raise ValueError(f"viewpoint: {viewpoint} given, these looks are from {self._viewpoint}")
        import drjit as dr
        import mitsuba as mi

        layer, count = self._layer, dr.opaque(mi.UInt32, self._count)
        step: list[Any] = [dr.opaque(mi.Float, float(each)) for each in self._step]
        first = dr.opaque(mi.UInt32, self._first)
        if layer is not None:
            chosen, size = upload(mi.UInt32, self._chosen), dr.opaque(mi.UInt32, len(self._chosen))

        def nearest(ray: Any, own: Any) -> tuple[Any, Any]:
            look = own // count
            lanes = dr.width(own)
            facet, distance = dr.full(mi.UInt32, NO_PRIMITIVE, lanes), dr.full(mi.Float, dr.inf, lanes)
            if not moving:
                facet, distance = self._static(ray, lanes, bundled)
                facet = dr.select(facet == NO_PRIMITIVE, facet, facet + look * count)
            if layer is None:
                return facet, distance
            shifted = mi.Ray3f(mi.Point3f(*(mi.Float(look) * each for each in step)), ray.d)
            shifted.maxt = ray.maxt
            found = layer.scene.ray_intersect_preliminary(shifted, coherent=bundled)
            nearer = found.is_valid() & (found.t < distance)
            there = dr.gather(mi.UInt32, chosen, found.prim_index % size, nearer) + first + look * count
            return dr.select(nearer, there, facet), dr.select(nearer, found.t, distance)

        return Targets(nearest, self._origin, viewpoint, corners, facets, self._extent)


def before(faces: NDArray[np.uint32], vertices: Sequence[FloatArray], corners: FloatArray) -> NDArray[np.intp]:
    """Which of the `faces` (face, 3) may come between the origin and facets, at any time.

    Args:
        vertices: of every time, (vertex, 3) positions [m]; they move on smoothly.
        corners: (time, facet, 3, 3) [m] of the facets.
    """
    told = np.unique(np.linspace(0, len(vertices) - 1, min(len(vertices), _TOLD)).astype(np.intp))
    low, high, near, _ = _boxes(np.stack([vertices[each] for each in told]))
    low, high = (np.take(each, faces.T, axis=0) for each in (low, high))
    low, high = low.min(axis=0), high.max(axis=0)
    margin = _margin(low, high)
    # A face comes nearer than its corners, the more the wider it is.
    near = np.take(near, faces.T).min(axis=0) * np.maximum(1.0 - 0.5 * ((high - low) ** 2).sum(axis=1), 0.0)
    low, high = (low - margin).T, (high + margin).T
    least, most, _, far = _boxes(corners.reshape(len(corners), -1, 3))
    least, most = (each.reshape(-1, 3, 3) for each in (least, most))
    least, most, far = least.min(axis=1), most.max(axis=1), far.reshape(-1, 3).max(axis=1)
    found = np.zeros(len(faces), np.bool_)
    for group in _neighbours(0.5 * (least + most)):
        bottom, top = least[group].min(axis=0), most[group].max(axis=0)
        rim = _margin(bottom[None], top[None])[0] + _MARGIN
        there = near < far[group].max()
        for axis in range(3):
            there &= (low[axis] < top[axis] + rim) & (high[axis] > bottom[axis] - rim)
        found |= there
    return np.flatnonzero(found)


def _boxes(points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Of `points` (time, point, 3) [m] the least and the largest coordinates (point, 3) of their directions, over time,
    and the least and the largest distance (point,) [m]."""
    distance = np.stack([lengths(each) for each in points])
    directions = points / np.maximum(distance, 1e-12)[..., None]
    return directions.min(axis=0), directions.max(axis=0), distance.min(axis=0), distance.max(axis=0)


def _margin(low: FloatArray, high: FloatArray) -> FloatArray:
    """(box, 1) how far beyond the directions of corners, in a box from `low` to `high` (box, 3), those between them may
    be: an arc's sagitta is an eighth of its square, and twice that over a triangle."""
    square = ((high - low) ** 2).sum(axis=1, keepdims=True)
    return np.asarray(square / 4.0 + _STRAY * np.sqrt(square))


def _neighbours(places: FloatArray) -> list[NDArray[np.intp]]:
    """Groups of neighbouring `places` (place, 3): the widest is halved until there are enough."""
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
