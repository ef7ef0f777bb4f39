"""Visibility of facets along legs: item buffers from the images of the radar."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.tracing.routes.legs import Leg
from rfgen_sionna.tracing.visibility.item_buffer import MARGIN, MAX_PIXELS, Meshes, View, towards
from rfgen_sionna.tracing.visibility.rasterise import (
    EVERYWHERE,
    count_items,
    draw,
    in_window,
    project,
    see_small,
    set_fractions,
)

MAX_TANGENT = 4.0
"""Largest tangent off a view's axis; what a mirror shows beyond it is omitted."""
MAX_LEG_PIXELS = MAX_PIXELS // 4
"""Most pixels of a view, which bounds memory and time."""
_OCCLUDER = -(2**30)
"""First item number of facets that only occlude."""


def leg_fractions(
    leg: Leg, meshes: Meshes, points: Sequence[FloatArray], static: FloatArray, resolution: int
) -> FloatArray:
    """(time, facet) visible share of the part of each facet that the mirrors of a `leg` show, in one view of all times.
    `points` (vertex, 3) [m] are those of each time, `static` (facet, 3, 3) [m] occludes; the largest side of the smallest
    surface has `resolution` pixels. Ragged mirrors: of the whole facet."""
    found = np.zeros((len(points), len(meshes.corners)))
    there = [each - leg.view for each in points]
    view = _view(leg, meshes, there, resolution)
    if view is None:
        return found
    window = np.ones(view.shape, np.bool_)
    for polygons in leg.windows:
        own = np.zeros(view.shape, np.bool_)
        for polygon in polygons:
            in_window(polygon, view.axes, view.origin, view.scale, own)
        window &= own
    opened = EVERYWHERE
    if leg.convex:
        opened = np.zeros((view.shape[0], view.shape[1] + 1), np.int32)
        np.cumsum(window, axis=1, out=opened[:, 1:])
    before = np.where(window, np.float32(0.0), np.float32(np.inf))
    corners = np.arange(3 * len(static), dtype=np.int32).reshape(-1, 3)
    both_sides, own = np.zeros(len(static), np.bool_), static.reshape(-1, 3)
    for segment in leg.segments:
        _draw(segment.image(own), corners, both_sides, _OCCLUDER, segment.flipped, segment.planes, view, before)
    last = leg.segments[-1]
    for k, (real, shown) in enumerate(zip(points, there, strict=True)):
        nearest, items = before.copy(), np.full(view.shape, -1, np.int32)
        for segment in leg.segments[:-1]:
            _draw(segment.image(real), meshes.corners, meshes.single, _OCCLUDER, segment.flipped, segment.planes, view, nearest)
        pixels = _draw(shown, meshes.corners, meshes.single, 0, False, last.planes, view, nearest, items, opened)
        seen = np.zeros(len(pixels), np.int32)
        count_items(items, 0, seen)
        small = np.flatnonzero(pixels == 0)
        if len(small):
            centroids = shown[meshes.corners[small]].mean(axis=1)
            behind = (centroids @ last.planes[:, :3].T < last.planes[:, 3]).any(axis=1)
            pixels[small[behind]] = -1
        see_small(shown, view.axes, view.origin, view.scale, nearest, items, meshes.corners, pixels, found[k])
        set_fractions(pixels, seen, found[k])
    return found


def _draw(
    points: FloatArray,
    corners: NDArray[np.int32],
    single: NDArray[np.bool_],
    first: int,
    flipped: bool,
    planes: FloatArray,
    view: View,
    nearest: NDArray[np.float32],
    items: NDArray[np.int32] | None = None,
    opened: NDArray[np.int32] = EVERYWHERE,
) -> NDArray[np.int32]:
    """Draw facets; returns their pixels (facet,)."""
    left, up, inverse = np.empty((3, len(points)))
    project(points, view.axes, left, up, inverse)
    pixels = np.zeros(len(corners), np.int32)
    unused = np.empty(view.shape, np.int32) if items is None else items
    draw(points, left, up, inverse, view.axes, corners, single, first, view.origin, view.scale, nearest, unused, pixels,
         flipped, planes, opened)  # fmt: skip
    return pixels


def _view(leg: Leg, meshes: Meshes, points: Sequence[FloatArray], resolution: int) -> View | None:
    """View of what the leg's mirrors show of all surfaces at all times; None where they show nothing. `points` (vertex, 3)
    are relative to the image of the phase centre."""
    low, high = np.full(2, -MAX_TANGENT), np.full(2, MAX_TANGENT)
    axes = towards(np.concatenate(leg.windows[-1]).mean(axis=0))
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
    extent = min(float((box[1] - box[0]).max()) for box in boxes)
    scale = (resolution - 2 * MARGIN) / max(extent, 1e-9)
    size = (high - low) * scale + 2 * MARGIN
    if size[0] * size[1] > MAX_LEG_PIXELS:
        scale *= np.sqrt(MAX_LEG_PIXELS / (size[0] * size[1]))
        size = (high - low) * scale + 2 * MARGIN
    shape = int(np.ceil(size[1])), int(np.ceil(size[0]))
    return View(axes, low - MARGIN / scale, float(scale), shape, tuple(shown))


def _outline(points: FloatArray, axes: FloatArray) -> tuple[FloatArray, FloatArray] | None:
    """Lowest and highest tangents (2,) of `points` (point, 3); None where one is behind or far aside."""
    ahead, left, up = axes @ points.T
    if ahead.min() <= 1e-3:
        return None
    tangents = np.stack([left / ahead, up / ahead])
    return tangents.min(axis=1), tangents.max(axis=1)
