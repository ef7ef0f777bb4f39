"""Kernels of slabs in item buffers: the nearest slabs of each pixel, and those before each facet.

A pixel's direction d is inside a triangle a, b, c (relative to the viewpoint) where d . (b x c), d . (c x a) and d . (a
x b) have the sign of a . (b x c); their sum over that volume is the inverse depth.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from rfgen_sionna.tracing.visibility.rasterise import NEAR

MAX_SLABS = 4
"""Most slabs in a row."""
APART = 1e-4
"""Relative difference of inverse depths from which a slab lies before a facet."""


@njit(cache=True, nogil=True)
def _edges(
    points: Any, corners: Any, f: int, view: Any, origin: Any, scale: float, shape: Any, sides: Any, box: Any
) -> bool:
    """Write inverse depth per barycentric part, linear in 1, left and up, to `sides` (3, 3), and the first and last
    column and row to `box` (4,); False where there is nothing to draw."""
    p = points[corners[f]]
    volume = 0.0
    for k in range(3):
        n = np.cross(p[(k + 1) % 3], p[(k + 2) % 3])
        if k == 0:
            volume = n[0] * p[0, 0] + n[1] * p[0, 1] + n[2] * p[0, 2]
        for axis in range(3):
            sides[k, axis] = view[axis, 0] * n[0] + view[axis, 1] * n[1] + view[axis, 2] * n[2]
    if abs(volume) < 1e-30:
        return False
    rows, columns = shape
    low_x, high_x, low_y, high_y = np.inf, -np.inf, np.inf, -np.inf
    behind = 0
    for k in range(3):
        depth = view[0, 0] * p[k, 0] + view[0, 1] * p[k, 1] + view[0, 2] * p[k, 2]
        if depth <= NEAR:
            behind += 1
            continue
        x = ((view[1, 0] * p[k, 0] + view[1, 1] * p[k, 1] + view[1, 2] * p[k, 2]) / depth - origin[0]) * scale
        y = ((view[2, 0] * p[k, 0] + view[2, 1] * p[k, 1] + view[2, 2] * p[k, 2]) / depth - origin[1]) * scale
        low_x, high_x, low_y, high_y = min(low_x, x), max(high_x, x), min(low_y, y), max(high_y, y)
    if behind == 3:
        return False
    if behind:
        low_x, high_x, low_y, high_y = 0.0, float(columns), 0.0, float(rows)
    if high_x < 0.0 or high_y < 0.0 or low_x > columns or low_y > rows:
        return False
    box[0], box[1] = max(int(np.ceil(low_x - 0.5)), 0), min(int(np.floor(high_x - 0.5)), columns - 1)
    box[2], box[3] = max(int(np.ceil(low_y - 0.5)), 0), min(int(np.floor(high_y - 0.5)), rows - 1)
    sides /= volume
    return True


@njit(cache=True, nogil=True, inline="always")
def _depth(sides: Any, x: float, y: float) -> float:
    """Inverse depth at tangents `x` and `y`; 0 outside."""
    total = 0.0
    for k in range(3):
        part = sides[k, 0] + sides[k, 1] * x + sides[k, 2] * y
        if part < 0.0:
            return 0.0
        total += part
    return total


@njit(cache=True, nogil=True)
def add_layers(points: Any, corners: Any, first: int, planes: Any, view: Any, origin: Any, scale: float, layers: Any,
               items: Any) -> None:  # fmt: skip
    """Insert slabs `corners` (facet, 3), numbered from `first` on and clipped to `planes` (plane, 4), into the inverse
    depths `layers` (row, column, layer), nearest first, and their `items`."""
    sides, box = np.empty((3, 3)), np.empty(4, np.int64)
    for f in range(corners.shape[0]):
        if not _edges(points, corners, f, view, origin, scale, layers.shape[:2], sides, box):
            continue
        for j in range(box[2], box[3] + 1):
            y = origin[1] + (j + 0.5) / scale
            for i in range(box[0], box[1] + 1):
                x = origin[0] + (i + 0.5) / scale
                w = _depth(sides, x, y)
                if w <= 0.0:
                    continue
                for m in range(planes.shape[0]):
                    at = 0.0
                    for axis in range(3):
                        at += planes[m, axis] * (view[0, axis] + x * view[1, axis] + y * view[2, axis])
                    if at < planes[m, 3] * w:
                        w = 0.0
                if w <= 0.0:
                    continue
                item = first + f
                for layer in range(layers.shape[2]):
                    if w > layers[j, i, layer]:
                        before, there = layers[j, i, layer], items[j, i, layer]
                        layers[j, i, layer], items[j, i, layer] = w, item
                        w, item = float(before), there


@njit(cache=True, nogil=True)
def _normal(corners: Any, normals: Any, direction: Any) -> Any:
    """Normal (3,), interpolated between those at the `corners` (3, 3) of a triangle, where a `direction` (3,) meets
    it."""
    found, total = np.zeros(3), 0.0
    for k in range(3):
        across = np.cross(corners[(k + 1) % 3], corners[(k + 2) % 3])
        part = across[0] * direction[0] + across[1] * direction[1] + across[2] * direction[2]
        total += part
        found += part * normals[k]
    return found / total


@njit(cache=True, nogil=True)
def count_before(
    points: Any, corners: Any, first: int, view: Any, origin: Any, scale: float, nearest: Any, items: Any, opaque: bool,
    opened: Any, clipped: Any, small: Any, layers: Any, slabs: Any, own: int, there: Any, normals: Any, surface: Any,
    segment: Any, pixels: Any, seen: Any, material: Any, place: Any, cover: Any, across: Any,
) -> None:  # fmt: skip
    """Add the slabs before facets `corners` (facet, 3), numbered from `first` on.

    A pixel shows an `opaque` facet where `items` do; a slab where it is before the `nearest` opaque one, whose `pixels`
    and `seen` pixels are counted. `small` (facet,) facets without pixels count at their centroids. `layers` and `slabs`
    are those of :func:`add_layers`, `there` and `normals` (slab, 3, 3) the corners of its items and the normals at
    these, `surface` and `segment` (slab,); the facets are its items from `own` on. `material`, `place` (facet, layer)
    are the surface and segment, `cover` (facet, layer) counts pixels and `across` (facet, layer, 3) adds normals.
    """
    sides, box = np.empty((3, 3)), np.empty(4, np.int64)
    for f in range(corners.shape[0]):
        if not _edges(points, corners, f, view, origin, scale, nearest.shape, sides, box):
            continue
        if small[f]:
            a, b, c = corners[f, 0], corners[f, 1], corners[f, 2]
            middle = (points[a] + points[b] + points[c]) / 3.0
            depth = view[0, 0] * middle[0] + view[0, 1] * middle[1] + view[0, 2] * middle[2]
            if depth <= NEAR:
                continue
            x = (view[1, 0] * middle[0] + view[1, 1] * middle[1] + view[1, 2] * middle[2]) / depth
            y = (view[2, 0] * middle[0] + view[2, 1] * middle[1] + view[2, 2] * middle[2]) / depth
            box[0] = box[1] = int(np.floor((x - origin[0]) * scale))
            box[2] = box[3] = int(np.floor((y - origin[1]) * scale))
            if not (0 <= box[0] < nearest.shape[1] and 0 <= box[2] < nearest.shape[0]):
                continue
        for j in range(box[2], box[3] + 1):
            y = origin[1] + (j + 0.5) / scale
            for i in range(box[0], box[1] + 1):
                if opened.shape[0] and opened[j, i + 1] == opened[j, i]:
                    continue
                x = origin[0] + (i + 0.5) / scale
                w = (
                    sides[:, 0].sum() + sides[:, 1].sum() * x + sides[:, 2].sum() * y
                    if small[f]
                    else _depth(sides, x, y)
                )
                if w <= 0.0:
                    continue
                if not small[f]:
                    beyond = False
                    for m in range(clipped.shape[0]):
                        at = 0.0
                        for axis in range(3):
                            at += clipped[m, axis] * (view[0, axis] + x * view[1, axis] + y * view[2, axis])
                        beyond = beyond or at < clipped[m, 3] * w
                    if beyond:
                        continue
                    if opaque:
                        if items[j, i] != first + f:
                            continue
                    else:
                        pixels[f] += 1
                        if w <= nearest[j, i]:
                            continue
                elif not opaque and w <= nearest[j, i]:
                    continue
                seen[f] += 1
                layer = 0
                for m in range(layers.shape[2]):
                    slab = slabs[j, i, m]
                    if layers[j, i, m] <= w * (1.0 + APART):
                        break
                    if slab == own + f:
                        continue
                    material[f, layer], place[f, layer] = surface[slab], segment[slab]
                    cover[f, layer] += 1.0
                    n = _normal(there[slab], normals[slab], view[0] + x * view[1] + y * view[2])
                    sign = 1.0
                    if n[0] * across[f, layer, 0] + n[1] * across[f, layer, 1] + n[2] * across[f, layer, 2] < 0.0:
                        sign = -1.0
                    for axis in range(3):
                        across[f, layer, axis] += sign * n[axis]
                    layer += 1
