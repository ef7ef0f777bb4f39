"""Visibility of facets along legs: item buffers from the images of the radar, with the slabs that a leg crosses."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.tracing.legs.leg import Leg, Segment
from rfgen_sionna.tracing.visibility.facet_cuts import count_items, set_fractions
from rfgen_sionna.tracing.visibility.item_buffer import (
    MARGIN,
    MAX_PIXELS,
    Cuts,
    ItemView,
    Meshes,
    Resolution,
    choose_views,
    cut_in_view,
    look_at,
    view_scale,
    whole_views,
)
from rfgen_sionna.tracing.visibility.rasterise import (
    EVERYWHERE,
    draw,
    in_window,
    project,
    see_small,
)
from rfgen_sionna.tracing.visibility.slab_layers import MAX_SLABS, add_layers, count_before

MAX_TANGENT = 4.0
"""Largest tangent off a view's axis; what a mirror shows beyond it is omitted."""
MAX_LEG_PIXELS, MAX_SLAB_PIXELS = MAX_PIXELS // 4, MAX_PIXELS // 8
"""Most pixels of a view, without and with slabs, which bounds memory and time."""
_OCCLUDER = -(2**30)
"""First item number of facets that only occlude."""


@dataclass(frozen=True)
class LegOccluders:
    """Surfaces that occlude or, as slabs, transmit; surfaces are numbered from static ones on."""

    opaque: FloatArray
    """(facet, 3, 3) corners [m] at rest, relative to the viewpoint."""
    slabs: FloatArray = field(default_factory=lambda: np.zeros((0, 3, 3)))
    """(facet, 3, 3) of slabs at rest."""
    slab_surface: IntArray = field(default_factory=lambda: np.zeros(0, np.int32))
    """(facet,)"""
    first: int = 0
    """Number of the first moving surface."""
    transmits: tuple[bool, ...] = ()
    """(moving surface,); empty means none."""

    @property
    def any_slabs(self) -> bool:
        """Whether anything transmits."""
        return len(self.slabs) > 0 or any(self.transmits)


@dataclass(frozen=True)
class Crossings:
    """Slabs on a leg to each facet, in order from the radar."""

    surface: IntArray
    """(facet, depth) number of the surface, -1 for none."""
    segment: IntArray
    """(facet, depth) mirrors before it."""
    normals: FloatArray
    """(facet, depth, 3) in the space of the last segment."""
    cover: FloatArray
    """(facet, depth) share of the visible part of the facet."""

    @staticmethod
    def none(count: int) -> Crossings:
        """No slabs before `count` facets."""
        none = np.full((count, 1), -1, np.int32)
        return Crossings(none, none, np.zeros((count, 1, 3)), np.zeros((count, 1)))

    def behind(self) -> Crossings:
        """Of the part of each facet that is behind a slab."""
        return replace(self, cover=np.minimum(self.cover / np.maximum(self.cover[:, :1], 1e-12), 1.0))

    def take(self, index: NDArray[np.intp]) -> Crossings:
        """Those of some facets."""
        return Crossings(self.surface[index], self.segment[index], self.normals[index], self.cover[index])


def see_along(
    leg: Leg,
    meshes: Meshes,
    points: Sequence[FloatArray],
    occluders: LegOccluders,
    resolution: Resolution,
    normals: Callable[[FloatArray, slice], FloatArray],
) -> tuple[FloatArray, list[Crossings], list[Cuts]]:
    """(time, facet) visible share of the part of each facet that the mirrors of a `leg` show, in common views of all
    times, with slabs the crossings at each time, and without mirrors the cuts at each time. `points` (vertex, 3) [m]
    are those of each time; the smallest surface has this `resolution`. Ragged mirrors: of the whole facet. `normals`
    returns those at the corners of some facets, (facet, 3, 3), for the points."""
    there = [each - leg.view for each in points]
    if leg.mirrors:
        view = _view(leg, meshes, there, resolution)
        views = [] if view is None else [view]
    else:
        views = choose_views(there, meshes, resolution)
    if occluders.any_slabs:
        views = [_coarser(each) for each in views]
    buffers = [_Buffer(leg, view, meshes, occluders, normals) for view in views]
    found, crossed, cuts = np.zeros((len(points), len(meshes.corners))), list[Crossings](), list[Cuts]()
    for k, (real, shown) in enumerate(zip(points, there, strict=True)):
        count = _Counts.of(len(meshes.corners))
        for buffer in buffers:
            buffer.count(real, shown, count, found[k])
        set_fractions(count.pixels, count.seen, found[k])
        if occluders.any_slabs:
            crossed.append(count.crossings())
        if not leg.mirrors:
            cuts.append(whole_views(count.cuts, count.seen))
    return found, crossed, cuts


@dataclass(frozen=True)
class _Counts:
    """Pixels of facets over all views."""

    pixels: IntArray
    seen: FloatArray
    """(facet, 6) of :func:`rfgen_sionna.tracing.visibility.facet_cuts.count_items`."""
    looked: IntArray
    """(facet,) pixels at which slabs were looked for."""
    surface: IntArray
    segment: IntArray
    cover: FloatArray
    across: FloatArray
    cuts: list[tuple[Cuts, FloatArray]]

    @staticmethod
    def of(count: int) -> _Counts:
        """For `count` facets."""
        pixels, looked = np.zeros((2, count), np.int32)
        none = np.full((count, MAX_SLABS), -1, np.int32)
        return _Counts(
            pixels, np.zeros((count, 6)), looked, none, none.copy(), np.zeros(none.shape), np.zeros((*none.shape, 3)),
            [],
        )  # fmt: skip

    def crossings(self) -> Crossings:
        """Shares and unit normals."""
        normals = self.across / np.maximum(np.linalg.norm(self.across, axis=-1, keepdims=True), 1e-12)
        cover = self.cover / np.maximum(self.looked, 1)[:, None]
        depth = max(int((self.surface >= 0).any(axis=0).sum()), 1)
        return Crossings(
            *(np.ascontiguousarray(each[:, :depth]) for each in (self.surface, self.segment, normals, cover))
        )


class _Buffer:
    """Item buffer of one view along a `leg`, in which what is at rest is drawn once."""

    def __init__(
        self,
        leg: Leg,
        view: ItemView,
        meshes: Meshes,
        occluders: LegOccluders,
        normals: Callable[[FloatArray, slice], FloatArray],
    ) -> None:
        self._normals = normals
        self._leg, self._view, self._meshes, self._occluders = leg, view, meshes, occluders
        window = np.ones(view.shape, np.bool_)
        for polygons in leg.windows:
            own = np.zeros(view.shape, np.bool_)
            for polygon in polygons:
                in_window(polygon, view.axes, view.origin, view.scale, own)
            window &= own
        self._opened = EVERYWHERE
        if leg.mirrors and leg.convex:
            self._opened = np.zeros((view.shape[0], view.shape[1] + 1), np.int32)
            np.cumsum(window, axis=1, out=self._opened[:, 1:])
        self._unused = np.empty(view.shape, np.int32)
        self._before = np.where(window, np.float32(0.0), np.float32(np.inf))
        opaque = occluders.opaque.reshape(-1, 3), np.zeros(len(occluders.opaque), np.bool_)
        for segment in leg.segments:
            shown = self._projected(segment.image(opaque[0]))
            self._draw(shown, _triples(len(opaque[1])), opaque[1], _OCCLUDER, segment, self._before)
        transmits = occluders.transmits or (False,) * len(meshes.facet_range)
        ranges = [slice(*each) for each in meshes.facet_range.tolist()]
        self._opaque = [
            each for each, slab in zip(ranges, transmits, strict=True) if not slab and each.stop > each.start
        ]
        self._slabs = [
            (each, number) for number, (each, slab) in enumerate(zip(ranges, transmits, strict=True))
            if slab and each.stop > each.start
        ]  # fmt: skip

    def count(self, real: FloatArray, shown: FloatArray, count: _Counts, found: FloatArray) -> None:
        """Add the pixels of facets at `real` (vertex, 3) [m], `shown` relative to the image of the phase centre; facets
        without pixels of their own are `found` by their centroids."""
        meshes, view, last = self._meshes, self._view, self._leg.segments[-1]
        nearest, items = self._before.copy(), np.full(view.shape, -1, np.int32)
        for segment in self._leg.segments[:-1]:
            image = self._projected(segment.image(real))
            for facets in self._opaque:
                self._draw(image, meshes.corners[facets], meshes.single[facets], _OCCLUDER, segment, nearest)
        own, image = np.zeros(len(meshes.corners), np.int32), self._projected(shown)
        for facets in self._opaque:
            own[facets] = self._draw(
                image, meshes.corners[facets], meshes.single[facets], facets.start, last, nearest, items, self._opened
            )
        seen = np.zeros_like(count.seen)
        count_items(items, 0, seen)
        count.seen[:] += seen
        if not self._leg.mirrors:
            partial = np.flatnonzero((seen[:, 0] > 0) & (seen[:, 0] < own))
            count.cuts.append(
                cut_in_view(view, image[1:], meshes.corners, partial, seen[partial, 0] / own[partial], seen)
            )
        before = count.pixels.copy()
        count.pixels[:] = np.where(own < 0, own, np.maximum(before, 0) + own)
        small = count.pixels == 0
        for facets, _ in self._slabs:
            small[facets] = False
        behind = np.flatnonzero(small)
        if len(behind):
            centroids = shown[meshes.corners[behind]].mean(axis=1)
            hidden = behind[(centroids @ last.planes[:, :3].T < last.planes[:, 3]).any(axis=1)]
            count.pixels[hidden], small[hidden] = -1, False
        for facets in self._opaque:
            see_small(shown, view.axes, view.origin, view.scale, nearest, items, meshes.corners[facets],
                      count.pixels[facets], found[facets])  # fmt: skip
        if self._occluders.any_slabs:
            self._count_slabs(real, shown, nearest, items, small & (found > 0), count)

    def _count_slabs(
        self, real: FloatArray, shown: FloatArray, nearest: NDArray[np.float32], items: NDArray[np.int32],
        small: NDArray[np.bool_], count: _Counts,
    ) -> None:  # fmt: skip
        meshes, view, rest = self._meshes, self._view, self._occluders
        layers = np.zeros((*view.shape, MAX_SLABS), np.float32)
        slabs = np.full(layers.shape, -1, np.int32)
        there, normals = [np.zeros((0, 3, 3))], [np.zeros((0, 3, 3))]
        surface, place = [np.zeros(0, np.int32)], [np.zeros(0, np.int32)]
        own, first = {}, 0
        still = rest.slabs.reshape(-1, 3), _triples(len(rest.slabs))
        edges = rest.slabs[:, 1:] - rest.slabs[:, :1]
        across = np.cross(edges[:, 0], edges[:, 1])
        across = np.repeat(
            (across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-30))[:, None], 3, axis=1
        )
        slabs_moving = [
            (
                meshes.corners[facets], self._normals(real, facets),
                np.full(facets.stop - facets.start, rest.first + k, np.int32), k,
            )
            for facets, k in self._slabs
        ]  # fmt: skip
        for number, segment in enumerate(self._leg.segments):
            for points, corners, turned, surfaces, which in (
                (*still, across, rest.slab_surface, -1), *((real, *each) for each in slabs_moving)
            ):  # fmt: skip
                image = segment.image(points)
                add_layers(image, corners, first, segment.planes, view.axes, view.origin, view.scale, layers, slabs)
                there.append(image[corners])
                normals.append(turned @ segment.turn.T)
                surface.append(surfaces)
                place.append(np.full(len(corners), number, np.int32))
                own[which], first = first, first + len(corners)  # those of the last segment stay
        at, normal, of, places = (np.concatenate(each) for each in (there, normals, surface, place))
        planes = self._leg.segments[-1].planes
        unused = np.zeros(len(meshes.corners), np.int32)
        for facets, moving in [(each, -1) for each in self._opaque] + self._slabs:
            opaque = moving < 0
            count_before(
                shown, meshes.corners[facets], facets.start, view.axes, view.origin, view.scale, nearest, items, opaque,
                self._opened, planes, small[facets], layers, slabs, -(2**30) if opaque else own[moving], at, normal, of,
                places, unused[facets] if opaque else count.pixels[facets], count.looked[facets], count.surface[facets],
                count.segment[facets], count.cover[facets], count.across[facets],
            )  # fmt: skip
            if not opaque:
                count.seen[facets, 0] = count.looked[facets]

    def _projected(self, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """`points` (vertex, 3) [m], their tangents to the left and up, and inverse depth (vertex,)."""
        left, up, inverse = np.empty((3, len(points)))
        project(points, self._view.axes, left, up, inverse)
        return points, left, up, inverse

    def _draw(
        self, points: tuple[FloatArray, FloatArray, FloatArray, FloatArray], corners: IntArray,
        single: NDArray[np.bool_], first: int, segment: Segment, nearest: NDArray[np.float32],
        items: NDArray[np.int32] | None = None, opened: NDArray[np.int32] = EVERYWHERE,
    ) -> NDArray[np.int32]:  # fmt: skip
        """Draw facets; returns their pixels (facet,)."""
        view = self._view
        pixels = np.zeros(len(corners), np.int32)
        unused = self._unused if items is None else items
        draw(*points, view.axes, corners, single, first, view.origin, view.scale, nearest, unused, pixels,
             segment.flipped, segment.planes, opened)  # fmt: skip
        return pixels


def _triples(count: int) -> IntArray:
    return np.arange(3 * count, dtype=np.int32).reshape(-1, 3)


def _coarser(view: ItemView) -> ItemView:
    """The view with at most `MAX_SLAB_PIXELS`."""
    by = min(float(np.sqrt(MAX_SLAB_PIXELS / (view.shape[0] * view.shape[1]))), 1.0)
    return replace(
        view, scale=view.scale * by, shape=(int(np.ceil(view.shape[0] * by)), int(np.ceil(view.shape[1] * by)))
    )


def _view(leg: Leg, meshes: Meshes, points: Sequence[FloatArray], resolution: Resolution) -> ItemView | None:
    """View of all surfaces at all times in the leg's mirrors; None where these show nothing. `points` (vertex, 3) [m]
    are relative to the image of the phase centre."""
    low, high = np.full(2, -MAX_TANGENT), np.full(2, MAX_TANGENT)
    axes = look_at(np.concatenate(leg.windows[-1]).mean(axis=0))
    for polygons in leg.windows:
        outline = _outline(np.concatenate(polygons), axes)
        if outline is not None:
            low, high = np.maximum(low, outline[0]), np.minimum(high, outline[1])
    if (low >= high).any():
        return None
    boxes, shown = [], []
    for number, vertices in enumerate(meshes.vertex_range):
        own = np.concatenate([each[slice(*vertices)] for each in points])
        if not len(own):
            continue
        outline = _outline(own, axes)
        box = (low, high) if outline is None else (np.maximum(low, outline[0]), np.minimum(high, outline[1]))
        if (box[0] < box[1]).all():
            boxes.append(box)
            shown.append(number)
    if not boxes:
        return None
    low, high = np.min([box[0] for box in boxes], axis=0), np.max([box[1] for box in boxes], axis=0)
    scale = max(view_scale(points[0], meshes, k, box, axes, resolution) for k, box in zip(shown, boxes, strict=True))
    size = (high - low) * scale + 2 * MARGIN
    if size[0] * size[1] > MAX_LEG_PIXELS:
        scale *= np.sqrt(MAX_LEG_PIXELS / (size[0] * size[1]))
        size = (high - low) * scale + 2 * MARGIN
    shape = int(np.ceil(size[1])), int(np.ceil(size[0]))
    return ItemView(axes, low - MARGIN / scale, float(scale), shape, tuple(shown))


def _outline(points: FloatArray, axes: FloatArray) -> tuple[FloatArray, FloatArray] | None:
    """Lowest and highest tangents (2,) of `points` (point, 3); None where one is behind or far aside."""
    ahead, left, up = axes @ points.T
    if ahead.min() <= 1e-3:
        return None
    tangents = np.stack([left / ahead, up / ahead])
    return tangents.min(axis=1), tangents.max(axis=1)
