"""Item buffers around moving surfaces: visible fractions of their facets, and their shadows.

Surfaces whose outlines overlap share a view, one that points at them and is as fine as the smaller of them needs; others
cannot occlude one another. Surfaces around the viewpoint, or far off a view's axis, take the six sides of a cube.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.tracing.visibility.rasterise import (
    bounding_box,
    count_hidden,
    count_items,
    count_within,
    draw,
    project,
    see_points,
    see_small,
    set_fractions,
    widen_outline,
)

MAX_TANGENT = 2.0
"""Largest tangent of the angle off a view's axis; beyond it six views of 90 degrees are taken."""
MAX_PIXELS = 3000 * 3000
"""Most pixels of a view, which bounds memory."""
MARGIN = 2
"""Pixels around the surfaces."""


@dataclass(frozen=True)
class Meshes:
    """Facets of one time or of all: the moving ones, and static ones that occlude."""

    corners: IntArray
    """(facet, 3) index of the vertices."""
    single: NDArray[np.bool_]
    """(facet,) whether only the front is visible."""
    vertex_range: IntArray
    """(surface, 2) first vertex of each surface, and the one after its last."""
    facet_range: IntArray
    """(surface, 2) likewise of its facets."""


def _no_cells(_: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.intp], FloatArray]:
    return np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros((0, 3, 3))


@dataclass(frozen=True)
class StaticItems:
    """Surfaces at rest that occlude and are occluded: facets, and large triangles, divided where a shadow falls."""

    corners: FloatArray = field(default_factory=lambda: np.zeros((0, 3, 3)))
    """(item, 3, 3) [m] relative to the viewpoint, visible without actors; facets first."""
    facets: int | None = None
    """Number of facets; None means all."""
    divide: Callable[[NDArray[np.intp]], tuple[NDArray[np.intp], NDArray[np.intp], FloatArray]] = _no_cells
    """Large triangles, numbered from 0 on, to the numbers of their facets, the triangle of each and its corners."""

    def __len__(self) -> int:
        return len(self.corners)


@dataclass(frozen=True)
class View:
    """One image plane."""

    axes: FloatArray
    """(3, 3) unit vectors forward, left and up."""
    origin: FloatArray
    """(2,) tangents to the left and up of the corner of pixel 0."""
    scale: float
    """Pixels per tangent."""
    shape: tuple[int, int]
    """Rows and columns."""
    surfaces: tuple[int, ...]
    """Surfaces that it shows."""


def choose_views(
    points: Sequence[FloatArray], vertex_range: IntArray, resolution: int, group: IntArray | None = None
) -> list[View]:
    """Views of surfaces over several times, for `points` (vertex, 3) [m] relative to the viewpoint at each; the
    smallest `group` (surface,) of surfaces of a view is `resolution` pixels wide or high. None makes each surface a group."""
    count = len(vertex_range)
    used = [k for k in range(count) if vertex_range[k, 1] > vertex_range[k, 0]]
    if not used:
        return []
    boxes = np.tile(np.array([[np.inf], [-np.inf]]), (count, 1, 3))
    for k in used:
        for each in points:
            bounding_box(each[slice(*vertex_range[k])], boxes[k])
    axes = _axes(boxes[used].mean(axis=(0, 1)))
    windows = {k: _window([each[slice(*vertex_range[k])] for each in points], axes) for k in used}
    if any(each is None for each in windows.values()):
        return _cube(tuple(used), resolution)
    outlines = {k: each for k, each in windows.items() if each is not None}
    views = []
    for cluster in _clusters(outlines):
        low = np.min([outlines[k][0] for k in cluster], axis=0)
        high = np.max([outlines[k][1] for k in cluster], axis=0)
        extent = np.inf
        for number in {k if group is None else int(group[k]) for k in cluster}:
            own = [outlines[k] for k in cluster if (k if group is None else group[k]) == number]
            size = np.max([each[1] for each in own], axis=0) - np.min([each[0] for each in own], axis=0)
            extent = min(extent, max(float(size.max()), 1e-9))
        scale = (resolution - 2 * MARGIN) / extent
        size = (high - low) * scale + 2 * MARGIN
        if size[0] * size[1] > MAX_PIXELS:
            scale *= np.sqrt(MAX_PIXELS / (size[0] * size[1]))
            size = (high - low) * scale + 2 * MARGIN
        rows, columns = int(np.ceil(size[1])), int(np.ceil(size[0]))
        views.append(View(axes, low - MARGIN / scale, float(scale), (rows, columns), tuple(cluster)))
    return views


def _axes(forward: FloatArray) -> FloatArray:
    """(3, 3) forward, left and up for a direction `forward` (3,)."""
    size = float(np.linalg.norm(forward))
    x = forward / size if size > 1e-9 else np.array([1.0, 0.0, 0.0])
    spare = np.array([0.0, 0.0, 1.0]) if abs(x[2]) < 0.9 else np.array([1.0, 0.0, 0.0])
    y = np.cross(spare, x)
    y /= np.linalg.norm(y)
    return np.stack([x, y, np.cross(x, y)])


def _window(points: Sequence[FloatArray], axes: FloatArray) -> tuple[FloatArray, FloatArray] | None:
    """Lowest and highest tangents (2,) of points (vertex, 3) [m]; None where a point is behind or too far aside."""
    outline = np.array([[np.inf, np.inf], [-np.inf, -np.inf]])
    for each in points:
        if not widen_outline(each, axes, outline) or np.abs(outline).max() > MAX_TANGENT:
            return None
    return outline[0], outline[1]


def _clusters(outlines: dict[int, tuple[FloatArray, FloatArray]]) -> list[list[int]]:
    """Surfaces by overlapping outlines."""
    found: list[list[int]] = []
    for k, (low, high) in outlines.items():
        own = [k]
        rest = []
        for cluster in found:
            overlaps = any((outlines[m][0] <= high).all() and (low <= outlines[m][1]).all() for m in cluster)
            if overlaps:
                own += cluster
            else:
                rest.append(cluster)
        found = [*rest, sorted(own)]
    return sorted(found)


def _cube(surfaces: tuple[int, ...], resolution: int) -> list[View]:
    """Six sides around the viewpoint."""
    sides = [np.array([s if k == axis else 0.0 for k in range(3)]) for axis in range(3) for s in (1.0, -1.0)]
    size = min(4 * resolution, int(np.sqrt(MAX_PIXELS)))
    return [View(_axes(each), np.array([-1.0, -1.0]), size / 2.0, (size, size), surfaces) for each in sides]


class ItemBuffer:
    """Draws `meshes` at one time after another in the same `views`, before `static` items."""

    def __init__(self, meshes: Meshes, views: Sequence[View], static: StaticItems) -> None:
        self.meshes, self.views, self._items = meshes, tuple(views), static
        self._first = len(static)
        count = int(meshes.vertex_range.max(initial=0))
        self._left, self._up, self._inverse = np.zeros((3, count))
        self._buffers = [(np.empty(each.shape, np.float32), np.empty(each.shape, np.int32)) for each in self.views]
        self._static: list[tuple[NDArray[np.float32], NDArray[np.int32]]] = []
        if self._first:
            self._draw_static(static.corners)

    def _draw_static(self, static: FloatArray) -> None:
        points, corners = static.reshape(-1, 3), np.arange(3 * len(static), dtype=np.int32).reshape(-1, 3)
        self._pixels = np.zeros(len(static))  # of each facet, also beyond the views
        self._small = np.zeros(len(static), np.bool_)
        self._centroids = static.mean(axis=1)
        left, up, inverse = np.empty((3, len(points)))
        for view in self.views:
            nearest, items = np.zeros(view.shape, np.float32), np.full(view.shape, -1, np.int32)
            drawn, seen = np.zeros(len(static), np.int32), np.zeros(len(static), np.int32)
            project(points, view.axes, left, up, inverse)
            draw(points, left, up, inverse, view.axes, corners, np.zeros(len(static), np.bool_), 0, view.origin,
                 view.scale, nearest, items, drawn)  # fmt: skip
            count_items(items, 0, seen)
            x, y = left.reshape(-1, 3), up.reshape(-1, 3)
            area = np.abs((x[:, 1] - x[:, 0]) * (y[:, 2] - y[:, 0]) - (x[:, 2] - x[:, 0]) * (y[:, 1] - y[:, 0]))
            area *= 0.5 * view.scale**2 * (inverse.reshape(-1, 3) > 0).all(axis=1)
            self._pixels += seen + np.maximum(area - drawn, 0.0) * (drawn > 0)
            self._small |= (drawn == 0) & (area > 0)
            self._static.append((nearest, items))

    def fractions(self, points: FloatArray, found: FloatArray) -> None:
        """Visible fraction of each facet into `found` (facet,), for `points` (vertex, 3) [m] relative to the viewpoint;
        0 for those that face away."""
        meshes = self.meshes
        pixels, seen = np.zeros((2, len(meshes.corners)), np.int32)
        found[:] = 0.0
        for number, view in enumerate(self.views):
            nearest, items = self._cleared(number)
            for k in view.surfaces:
                vertices, facets = slice(*meshes.vertex_range[k]), slice(*meshes.facet_range[k])
                project(points[vertices], view.axes, self._left[vertices], self._up[vertices], self._inverse[vertices])
                draw(points, self._left, self._up, self._inverse, view.axes, meshes.corners[facets], meshes.single[facets],
                     self._first + int(meshes.facet_range[k, 0]), view.origin, view.scale, nearest, items,
                     pixels[facets])  # fmt: skip
            count_items(items, self._first, seen)
            for k in view.surfaces:
                facets = slice(*meshes.facet_range[k])
                # Facets too small for pixels of their own are visible where their centroids are.
                see_small(points, view.axes, view.origin, view.scale, nearest, items, meshes.corners[facets],
                          pixels[facets], found[facets])  # fmt: skip
        set_fractions(pixels, seen, found)

    def shadows(self) -> tuple[NDArray[np.intp], FloatArray]:
        """Facets at rest, ascending, that the surfaces of the last :meth:`fractions` occlude, and the visible share of
        each. The facets of large triangles are numbered from the number of items on."""
        hidden = np.zeros(self._first, np.int32)
        for (_, before), (_, items) in zip(self._static, self._buffers, strict=True):
            count_hidden(before, items, self._first, hidden)
        left = 1.0 - np.minimum(hidden / np.maximum(self._pixels, 1.0), 1.0)
        some = np.flatnonzero(self._small)
        if len(some):
            visible = np.ones(len(some), np.bool_)
            for view, (nearest, items) in zip(self.views, self._buffers, strict=True):
                here = visible.copy()
                see_points(self._centroids[some], view.axes, view.origin, view.scale, nearest, items, self._first, here)
                visible &= here
            left[some[~visible]] = 0.0
        occluded = np.flatnonzero(left < 1.0)
        whole = len(left) if self._items.facets is None else self._items.facets
        index, share = self._within(occluded[occluded >= whole])
        facets = occluded[occluded < whole]
        return np.concatenate([facets, index]), np.concatenate([left[facets], share])

    def _within(self, triangles: NDArray[np.intp]) -> tuple[NDArray[np.intp], FloatArray]:
        """The same of the facets of large `triangles`, by their item."""
        first = 0 if self._items.facets is None else self._items.facets
        index, owner, corners = self._items.divide(triangles - first)
        if not len(index):
            return index, np.zeros(0)
        points = corners.reshape(-1, 3)
        left, up, inverse = np.empty((3, len(points)))
        hidden = np.zeros(len(index))
        for view, (_, before), (_, items) in zip(self.views, self._static, self._buffers, strict=True):
            project(points, view.axes, left, up, inverse)
            count_within(left, up, inverse, first + owner, view.origin, view.scale, before, items, self._first, hidden)
        share = 1.0 - hidden
        order = np.argsort(index, kind="stable")
        order = order[share[order] < 1.0]
        return self._first + index[order], share[order]

    def _cleared(self, number: int) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
        nearest, items = self._buffers[number]
        if self._static:
            np.copyto(nearest, self._static[number][0])
            np.copyto(items, self._static[number][1])
        else:
            nearest.fill(0.0)
            items.fill(-1)
        return nearest, items
