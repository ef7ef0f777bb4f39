"""Item buffers around moving surfaces: visible fractions of their facets, and their shadows.

Surfaces whose outlines overlap share a view, one that points at them and is as fine as the smaller of them needs;
others cannot occlude one another. Surfaces around the viewpoint, or far off a view's axis, take the six sides of a
cube.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.tracing.visibility.facet_cuts import count_hidden, count_items, cut_facets, set_fractions
from rfgen_sionna.tracing.visibility.rasterise import (
    EVERYWHERE,
    NO_PLANES,
    bounding_box,
    draw,
    mean_area,
    project,
    see_points,
    see_small,
    widen_window,
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


@dataclass(frozen=True)
class ItemView:
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


@dataclass(frozen=True)
class Resolution:
    """Pixels of a view."""

    facet: float
    """Pixels on a facet of a surface's mean size that faces the viewpoint."""
    outline: int
    """Least number of pixels along the longer side of a surface."""


def choose_views(
    points: Sequence[FloatArray], meshes: Meshes, resolution: Resolution, max_range: float = np.inf
) -> list[ItemView]:
    """Views of surfaces over several times, for `points` (vertex, 3) [m] relative to the viewpoint at each; the
    smallest surface of a view has this `resolution`. Surfaces beyond `max_range` [m] have none."""
    vertex_range = meshes.vertex_range
    count = len(vertex_range)
    used = [k for k in range(count) if vertex_range[k, 1] > vertex_range[k, 0]]
    boxes = np.tile(np.array([[np.inf], [-np.inf]]), (count, 1, 3))
    for k in used:
        for each in points:
            bounding_box(each[slice(*vertex_range[k])], boxes[k])
    used = [k for k in used if np.linalg.norm(np.maximum(np.maximum(boxes[k, 0], -boxes[k, 1]), 0.0)) < max_range]
    if not used:
        return []
    axes = look_at(boxes[used].mean(axis=(0, 1)))
    windows = {k: _window([each[slice(*vertex_range[k])] for each in points], axes) for k in used}
    if any(each is None for each in windows.values()):
        return _cube(tuple(used), 4 * resolution.outline)
    scales = {k: view_scale(points[0], meshes, k, window, axes, resolution) for k, window in windows.items() if window}
    outlines = {k: each for k, each in windows.items() if each is not None}
    views = []
    for cluster in _clusters(outlines):
        low = np.min([outlines[k][0] for k in cluster], axis=0)
        high = np.max([outlines[k][1] for k in cluster], axis=0)
        scale = max(scales[k] for k in cluster)
        size = (high - low) * scale + 2 * MARGIN
        if size[0] * size[1] > MAX_PIXELS:
            scale *= np.sqrt(MAX_PIXELS / (size[0] * size[1]))
            size = (high - low) * scale + 2 * MARGIN
        rows, columns = int(np.ceil(size[1])), int(np.ceil(size[0]))
        views.append(ItemView(axes, low - MARGIN / scale, float(scale), (rows, columns), tuple(cluster)))
    return views


def view_scale(
    points: FloatArray,
    meshes: Meshes,
    k: int,
    window: tuple[FloatArray, FloatArray],
    axes: FloatArray,
    resolution: Resolution,
) -> float:
    """Pixels per tangent that surface `k` needs, with its outline in the `window`."""
    extent = max(float((window[1] - window[0]).max()), 1e-9)
    area = mean_area(points, meshes.corners[slice(*meshes.facet_range[k])], axes)
    by_facets = np.sqrt(resolution.facet / area) if area > 0 else 0.0
    return float(max(resolution.outline / extent, by_facets))


def look_at(forward: FloatArray) -> FloatArray:
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
        if not widen_window(each, axes, outline) or np.abs(outline).max() > MAX_TANGENT:
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


def _cube(surfaces: tuple[int, ...], size: int) -> list[ItemView]:
    """Six sides around the viewpoint, `size` pixels wide."""
    sides = [np.array([s if k == axis else 0.0 for k in range(3)]) for axis in range(3) for s in (1.0, -1.0)]
    size = min(size, int(np.sqrt(MAX_PIXELS)))
    return [ItemView(look_at(each), np.array([-1.0, -1.0]), size / 2.0, (size, size), surfaces) for each in sides]


class Cuts(NamedTuple):
    """Pieces of facets that a shadow boundary crosses, cut along straight lines."""

    facet: NDArray[np.intp]
    """(cut,) ascending."""
    pieces: FloatArray
    """(cut, 2, 3, 3) barycentric coordinates of the corners of one or two triangles."""
    triangles: NDArray[np.int32]
    """(cut,) number of triangles; 0 where no line is known."""

    def of(self, chosen: NDArray[np.intp]) -> NDArray[np.int32]:
        """(chosen,) cut of each of the `chosen` facets; -1 without one."""
        known = self.facet[self.triangles > 0]
        place = np.minimum(np.searchsorted(known, chosen), max(len(known) - 1, 0))
        number = np.flatnonzero(self.triangles > 0).astype(np.int32)
        if not len(known):
            return np.full(len(chosen), -1, np.int32)
        return np.where(known[place] == chosen, number[place], np.int32(-1))


class Shadows(NamedTuple):
    """Shadows on facets at rest."""

    facet: NDArray[np.intp]
    """(facet,) occluded facets, ascending."""
    left: FloatArray
    """(facet,) visible share of each."""
    hidden: Cuts
    """Hidden pieces of those that are occluded in part."""


NO_CUTS = Cuts(np.zeros(0, np.intp), np.zeros((0, 2, 3, 3)), np.zeros(0, np.int32))
NO_SHADOWS = Shadows(np.zeros(0, np.intp), np.zeros(0), NO_CUTS)


class ItemBuffer:
    """Draws `meshes` at one time after another in the same `views`, before facets at rest with corners (facet, 3, 3)
    [m] relative to the viewpoint, visible without the surfaces."""

    def __init__(self, meshes: Meshes, views: Sequence[ItemView], static: FloatArray) -> None:
        self.meshes, self.views = meshes, tuple(views)
        self._first = len(static)
        count = int(meshes.vertex_range.max(initial=0))
        self._left, self._up, self._inverse = np.zeros((3, count))
        self._buffers = [(np.empty(each.shape, np.float32), np.empty(each.shape, np.int32)) for each in self.views]
        self._static: list[tuple[NDArray[np.float32], NDArray[np.int32]]] = []
        self._projected: list[tuple[FloatArray, FloatArray, FloatArray]] = []
        if self._first:
            self._draw_static(static)

    def _draw_static(self, static: FloatArray) -> None:
        points, corners = static.reshape(-1, 3), np.arange(3 * len(static), dtype=np.int32).reshape(-1, 3)
        self._pixels = np.zeros(len(static))  # of each facet, also beyond the views
        self._small = np.zeros(len(static), np.bool_)
        self._centroids = static.mean(axis=1)
        left, up, inverse = np.empty((3, len(points)))
        for view in self.views:
            nearest, items = np.zeros(view.shape, np.float32), np.full(view.shape, -1, np.int32)
            drawn, seen = np.zeros(len(static), np.int32), np.zeros((len(static), 6))
            project(points, view.axes, left, up, inverse)
            draw(points, left, up, inverse, view.axes, corners, np.zeros(len(static), np.bool_), 0, view.origin,
                 view.scale, nearest, items, drawn, False, NO_PLANES, EVERYWHERE)  # fmt: skip
            count_items(items, 0, seen)
            x, y = left.reshape(-1, 3), up.reshape(-1, 3)
            area = np.abs((x[:, 1] - x[:, 0]) * (y[:, 2] - y[:, 0]) - (x[:, 2] - x[:, 0]) * (y[:, 1] - y[:, 0]))
            area *= 0.5 * view.scale**2 * (inverse.reshape(-1, 3) > 0).all(axis=1)
            ends = np.stack([x - view.origin[0], y - view.origin[1]], axis=-1) * view.scale
            beyond = ((ends < 0.0) | (ends > view.shape[::-1])).any(axis=(1, 2))  # else the pixels are all there are
            self._pixels += seen[:, 0] + np.maximum(area - drawn, 0.0) * (beyond & (drawn > 0))
            self._small |= (drawn == 0) & (area > 0)
            self._static.append((nearest, items))
            self._projected.append((left.copy(), up.copy(), inverse.copy()))

    def fractions(self, points: FloatArray, found: FloatArray) -> Cuts:
        """Visible fraction of each facet into `found` (facet,), for `points` (vertex, 3) [m] relative to the
        viewpoint; 0 for those that face away. Returns the visible pieces of facets that are visible in part."""
        meshes = self.meshes
        count = len(meshes.corners)
        pixels, total, cuts = np.zeros(count, np.int32), np.zeros((count, 6)), []
        found[:] = 0.0
        for number, view in enumerate(self.views):
            nearest, items = self._cleared(number)
            drawn, seen = np.zeros(count, np.int32), np.zeros((count, 6))
            for k in view.surfaces:
                vertices, facets = slice(*meshes.vertex_range[k]), slice(*meshes.facet_range[k])
                project(points[vertices], view.axes, self._left[vertices], self._up[vertices], self._inverse[vertices])
                draw(
                    points, self._left, self._up, self._inverse, view.axes, meshes.corners[facets],
                    meshes.single[facets], self._first + int(meshes.facet_range[k, 0]), view.origin, view.scale,
                    nearest, items, drawn[facets], False, NO_PLANES, EVERYWHERE,
                )  # fmt: skip
            count_items(items, self._first, seen)
            for k in view.surfaces:
                facets = slice(*meshes.facet_range[k])
                # Facets too small for pixels of their own are visible where their centroids are.
                see_small(points, view.axes, view.origin, view.scale, nearest, items, meshes.corners[facets],
                          drawn[facets], found[facets])  # fmt: skip
            partial = np.flatnonzero((seen[:, 0] > 0) & (seen[:, 0] < drawn))
            shares = seen[partial, 0] / drawn[partial]
            cuts.append(cut_in_view(view, (self._left, self._up, self._inverse), meshes.corners, partial, shares, seen))
            pixels = np.where(pixels < 0, drawn, pixels + drawn)
            total += seen
        set_fractions(pixels, total, found)
        return whole_views(cuts, total)

    def shadows(self) -> Shadows:
        """Facets at rest, and their parts, that the surfaces of the last :meth:`fractions` occlude."""
        total, cuts = np.zeros((self._first, 6)), []
        corners = np.arange(3 * self._first, dtype=np.int32).reshape(-1, 3)
        for (_, before), (_, items), view, projected in zip(
            self._static, self._buffers, self.views, self._projected, strict=True
        ):
            hidden = np.zeros((self._first, 6))
            count_hidden(before, items, self._first, hidden)
            partial = np.flatnonzero((hidden[:, 0] > 0) & (hidden[:, 0] < self._pixels))
            shares = hidden[partial, 0] / self._pixels[partial]
            cuts.append(cut_in_view(view, projected, corners, partial, shares, hidden))
            total += hidden
        left = 1.0 - np.minimum(total[:, 0] / np.maximum(self._pixels, 1.0), 1.0)
        some = np.flatnonzero(self._small)
        if len(some):
            visible = np.ones(len(some), np.bool_)
            for view, (nearest, items) in zip(self.views, self._buffers, strict=True):
                here = visible.copy()
                see_points(self._centroids[some], view.axes, view.origin, view.scale, nearest, items, self._first, here)
                visible &= here
            left[some[~visible]] = 0.0
        occluded = np.flatnonzero(left < 1.0)
        return Shadows(occluded, left[occluded], whole_views(cuts, total))

    def _cleared(self, number: int) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
        nearest, items = self._buffers[number]
        if self._static:
            np.copyto(nearest, self._static[number][0])
            np.copyto(items, self._static[number][1])
        else:
            nearest.fill(0.0)
            items.fill(-1)
        return nearest, items


def cut_in_view(
    view: ItemView,
    projected: tuple[FloatArray, FloatArray, FloatArray],
    corners: IntArray,
    partial: NDArray[np.intp],
    shares: FloatArray,
    seen: FloatArray,
) -> tuple[Cuts, FloatArray]:
    """Pieces of the `partial` facets with these `shares`, and (partial,) their pixels in a `view` of `projected` points
    (:func:`rfgen_sionna.tracing.visibility.rasterise.project`); `seen` (facet, 6) is that of
    :func:`rfgen_sionna.tracing.visibility.facet_cuts.count_items`."""
    pieces, count = np.zeros((len(partial), 2, 3, 3)), np.zeros(len(partial), np.int32)
    cut_facets(*projected, corners, partial, view.origin, view.scale, shares, seen, pieces, count)
    return Cuts(partial, pieces, count), seen[partial, 0]


def whole_views(parts: Sequence[tuple[Cuts, FloatArray]], total: FloatArray) -> Cuts:
    """Cuts of all views, without facets that several views show; `total` (facet, 6) are their pixels in all of them."""
    facet = np.concatenate([np.zeros(0, np.intp), *(cuts.facet for cuts, _ in parts)])
    pieces = np.concatenate([np.zeros((0, 2, 3, 3)), *(cuts.pieces for cuts, _ in parts)])
    count = np.concatenate([np.zeros(0, np.int32), *(cuts.triangles for cuts, _ in parts)])
    here = np.concatenate([np.zeros(0), *(pixels for _, pixels in parts)])
    order = np.argsort(facet, kind="stable")
    order = order[here[order] == total[facet[order], 0]]
    return Cuts(facet[order], pieces[order], count[order])
