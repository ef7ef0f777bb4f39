"""Kernels of item buffers: the nearest facet of each pixel, by inverse depth.

A pixel's inverse depth is linear over a flat facet. Points are relative to the viewpoint; a view has rows of unit
vectors (forward, left, up) and a pixel is at (left / forward, up / forward).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

NEAR = 1e-3
"""Distance [m] of the plane at which facets are clipped."""
SURFACE_MARGIN = 2e-3
"""Relative difference of inverse depths below which two points count as one surface."""
EVERYWHERE = np.zeros((0, 0), np.int32)
"""`opened` of views without a window."""
NO_PLANES = np.zeros((0, 4))


@njit(cache=True, nogil=True)
def bounding_box(points: Any, box: Any) -> None:
    """Widen `box` (2, 3), lowest and highest coordinates, to `points` (point, 3)."""
    for i in range(points.shape[0]):
        for k in range(3):
            box[0, k] = min(box[0, k], points[i, k])
            box[1, k] = max(box[1, k], points[i, k])


@njit(cache=True, nogil=True)
def widen_window(points: Any, view: Any, outline: Any) -> bool:
    """Widen `outline` (2, 2), lowest and highest tangents to the left and up, to `points` (point, 3) in a `view`; False
    where a point is behind or nearly beside the viewpoint."""
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        depth = view[0, 0] * x + view[0, 1] * y + view[0, 2] * z
        if depth <= NEAR:
            return False
        left = (view[1, 0] * x + view[1, 1] * y + view[1, 2] * z) / depth
        up = (view[2, 0] * x + view[2, 1] * y + view[2, 2] * z) / depth
        outline[0, 0], outline[1, 0] = min(outline[0, 0], left), max(outline[1, 0], left)
        outline[0, 1], outline[1, 1] = min(outline[0, 1], up), max(outline[1, 1], up)
    return True


@njit(cache=True, nogil=True)
def mean_area(points: Any, corners: Any, view: Any) -> float:
    """Mean projected area [tangent^2] of facets `corners` (facet, 3) that face away or towards, whichever are more."""
    total, count = np.zeros(2), np.zeros(2)
    x, y = np.empty(3), np.empty(3)
    for f in range(corners.shape[0]):
        before = True
        for k in range(3):
            p = corners[f, k]
            depth = view[0, 0] * points[p, 0] + view[0, 1] * points[p, 1] + view[0, 2] * points[p, 2]
            before = before and depth > NEAR
            depth = max(depth, NEAR)
            x[k] = (view[1, 0] * points[p, 0] + view[1, 1] * points[p, 1] + view[1, 2] * points[p, 2]) / depth
            y[k] = (view[2, 0] * points[p, 0] + view[2, 1] * points[p, 1] + view[2, 2] * points[p, 2]) / depth
        area = 0.5 * ((x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]))
        side = 1 if area > 0.0 else 0
        if before:
            total[side] += abs(area)
            count[side] += 1.0
    side = 1 if count[1] > count[0] else 0
    return total[side] / max(count[side], 1.0)


@njit(cache=True, nogil=True)
def project(points: Any, view: Any, left: Any, up: Any, inverse: Any) -> None:
    """Tangents `left`, `up` and `inverse` depth (point,) of `points` (point, 3) in a `view` (3, 3); inverse depth is 0
    for points behind the near plane."""
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        depth = view[0, 0] * x + view[0, 1] * y + view[0, 2] * z
        if depth > NEAR:
            inverse[i] = 1.0 / depth
            left[i] = (view[1, 0] * x + view[1, 1] * y + view[1, 2] * z) / depth
            up[i] = (view[2, 0] * x + view[2, 1] * y + view[2, 2] * z) / depth
        else:
            inverse[i] = left[i] = up[i] = 0.0


@njit(cache=True, nogil=True, inline="always")
def _fill(ax: Any, ay: Any, aw: Any, bx: Any, by: Any, bw: Any, cx: Any, cy: Any, cw: Any, item: Any, nearest: Any,
          items: Any, opened: Any) -> int:  # fmt: skip
    """Draw one triangle; returns its number of pixel centres in the window."""
    rows, columns = nearest.shape
    area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
    if area == 0.0:
        return 0
    if area < 0.0:  # clockwise
        area, bx, by, bw, cx, cy, cw = -area, cx, cy, cw, bx, by, bw
    first_row, last_row = (
        max(int(np.ceil(min(ay, by, cy) - 0.5)), 0),
        min(int(np.floor(max(ay, by, cy) - 0.5)), rows - 1),
    )
    left, right = min(ax, bx, cx), max(ax, bx, cx)
    if right < 0.0 or left > columns:
        return 0
    scale = 1.0 / area
    # Edge functions e = e_0 + e_x x + e_y y, positive inside; the weight of the opposite corner.
    e0x, e0y, e1x, e1y, e2x, e2y = by - cy, cx - bx, cy - ay, ax - cx, ay - by, bx - ax
    wx = (e0x * aw + e1x * bw + e2x * cw) * scale
    count = 0
    for j in range(first_row, last_row + 1):
        y = j + 0.5
        low, high = left, right
        # Interval of x inside all three edges on this row.
        f0, f1, f2 = e0y * (y - by) - e0x * bx, e1y * (y - cy) - e1x * cx, e2y * (y - ay) - e2x * ax
        empty = False
        for f, g in ((f0, e0x), (f1, e1x), (f2, e2x)):
            if g > 0.0:
                low = max(low, -f / g)
            elif g < 0.0:
                high = min(high, -f / g)
            elif f < 0.0:
                empty = True
        if empty or low > high:
            continue
        begin, end = max(int(np.ceil(low - 0.5)), 0), min(int(np.ceil(high - 0.5)), columns)
        if begin >= end:
            continue
        x = begin + 0.5
        w = ((f0 + e0x * x) * aw + (f1 + e1x * x) * bw + (f2 + e2x * x) * cw) * scale
        for i in range(begin, end):
            if w > nearest[j, i]:
                nearest[j, i] = np.float32(w)
                items[j, i] = item
            w += wx
        count += opened[j, end] - opened[j, begin] if opened.shape[0] else end - begin
    return count


@njit(cache=True, nogil=True)
def draw(
    points: Any, left: Any, up: Any, inverse: Any, view: Any, corners: Any, single: Any, first: int, origin: Any,
    scale: float, nearest: Any, items: Any, pixels: Any, flipped: bool, planes: Any, opened: Any,
) -> None:  # fmt: skip
    """Draw facets `corners` (facet, 3) numbered from `first` on into `nearest` inverse depths and `items` (row,
    column), and add the pixel centres of each to `pixels` (facet,); -1 there means that it faces away.

    `left`, `up` and `inverse` (point,) are those of :func:`project`. Facets are `single`-sided (facet,),
    counter-clockwise from the visible side, or seen from both. `origin` (2,) is the tangent of the corner of pixel 0,
    `scale` pixels per tangent. `flipped` points are mirror images, of the other orientation. Facets are clipped to the
    half-spaces `planes` (plane, 4), n . x >= d. `opened` (row, column + 1) counts the pixels of a window to the left;
    empty means all.
    """
    polygon, clipped = np.empty((5 + planes.shape[0], 3)), np.empty((5 + planes.shape[0], 3))
    # The planes in view coordinates, the near one last.
    bounds = np.empty((planes.shape[0] + 1, 4))
    bounds[-1] = (1.0, 0.0, 0.0, NEAR)
    for m in range(planes.shape[0]):
        bounds[m, 3] = planes[m, 3]
        for axis in range(3):
            bounds[m, axis] = view[axis, 0] * planes[m, 0] + view[axis, 1] * planes[m, 1] + view[axis, 2] * planes[m, 2]
    for f in range(corners.shape[0]):
        a, b, c = corners[f, 0], corners[f, 1], corners[f, 2]
        # The side, from the volume with the viewpoint.
        px, py, pz = points[a, 0], points[a, 1], points[a, 2]
        qx, qy, qz = points[b, 0] - px, points[b, 1] - py, points[b, 2] - pz
        rx, ry, rz = points[c, 0] - px, points[c, 1] - py, points[c, 2] - pz
        side = px * (qy * rz - qz * ry) + py * (qz * rx - qx * rz) + pz * (qx * ry - qy * rx)
        if single[f] and (side <= 0.0 if flipped else side >= 0.0):
            pixels[f] = -1
            continue
        behind = int(inverse[a] == 0.0) + int(inverse[b] == 0.0) + int(inverse[c] == 0.0)
        if behind == 3:
            continue
        whole = behind == 0
        for m in range(planes.shape[0]):
            beyond = 0
            for k in range(3):
                p = corners[f, k]
                at = planes[m, 0] * points[p, 0] + planes[m, 1] * points[p, 1] + planes[m, 2] * points[p, 2]
                beyond += int(at < planes[m, 3])
            whole = whole and beyond == 0
            if beyond == 3:
                behind = 3
        if behind == 3:
            continue
        if whole:
            ax, ay = (left[a] - origin[0]) * scale, (up[a] - origin[1]) * scale
            bx, by = (left[b] - origin[0]) * scale, (up[b] - origin[1]) * scale
            cx, cy = (left[c] - origin[0]) * scale, (up[c] - origin[1]) * scale
            pixels[f] += _fill(ax, ay, inverse[a], bx, by, inverse[b], cx, cy, inverse[c], first + f, nearest, items,
                               opened)  # fmt: skip
            continue
        # Clip in view coordinates.
        for k in range(3):
            p = corners[f, k]
            for m in range(3):
                polygon[k, m] = view[m, 0] * points[p, 0] + view[m, 1] * points[p, 1] + view[m, 2] * points[p, 2]
        count = 3
        for m in range(bounds.shape[0]):
            kept = 0
            for k in range(count):
                n = (k + 1) % count
                here, there = -bounds[m, 3], -bounds[m, 3]
                for axis in range(3):
                    here += bounds[m, axis] * polygon[k, axis]
                    there += bounds[m, axis] * polygon[n, axis]
                if here > 0.0:
                    clipped[kept] = polygon[k]
                    kept += 1
                if (here > 0.0) != (there > 0.0):
                    share = here / (here - there)
                    clipped[kept] = polygon[k] + share * (polygon[n] - polygon[k])
                    kept += 1
            count = kept
            for k in range(count):
                polygon[k] = clipped[k]
        for k in range(1, count - 1):
            aw, bw = 1.0 / max(polygon[0, 0], NEAR), 1.0 / max(polygon[k, 0], NEAR)
            cw = 1.0 / max(polygon[k + 1, 0], NEAR)
            ax, ay = (polygon[0, 1] * aw - origin[0]) * scale, (polygon[0, 2] * aw - origin[1]) * scale
            bx, by = (polygon[k, 1] * bw - origin[0]) * scale, (polygon[k, 2] * bw - origin[1]) * scale
            cx, cy = (polygon[k + 1, 1] * cw - origin[0]) * scale, (polygon[k + 1, 2] * cw - origin[1]) * scale
            pixels[f] += _fill(ax, ay, aw, bx, by, bw, cx, cy, cw, first + f, nearest, items, opened)


@njit(cache=True, nogil=True)
def in_window(corners: Any, view: Any, origin: Any, scale: float, window: Any) -> None:
    """Set the pixels of a `window` (row, column) that show a convex polygon `corners` (corner, 3)."""
    count = corners.shape[0]
    # Inside is where all sides, planes through the viewpoint, have the sign of the polygon's middle.
    sides, middle = np.empty((count, 3)), np.zeros(3)
    for k in range(count):
        middle += corners[k]
    for k in range(count):
        n = np.cross(corners[k], corners[(k + 1) % count])
        if n[0] * middle[0] + n[1] * middle[1] + n[2] * middle[2] < 0.0:
            n = -n
        for axis in range(3):
            sides[k, axis] = view[axis, 0] * n[0] + view[axis, 1] * n[1] + view[axis, 2] * n[2]
    for j in range(window.shape[0]):
        y = origin[1] + (j + 0.5) / scale
        for i in range(window.shape[1]):
            x, inside = origin[0] + (i + 0.5) / scale, True
            for k in range(count):
                inside = inside and sides[k, 0] + sides[k, 1] * x + sides[k, 2] * y >= 0.0
            if inside:
                window[j, i] = True


@njit(cache=True, nogil=True)
def see_points(
    points: Any, view: Any, origin: Any, scale: float, nearest: Any, items: Any, first: int, visible: Any
) -> None:
    """Set `visible` (point,) to whether no item from `first` on lies before each of `points` (point, 3), where the view
    shows it; others keep their value."""
    rows, columns = nearest.shape
    for p in range(points.shape[0]):
        x, y, z = points[p, 0], points[p, 1], points[p, 2]
        depth = view[0, 0] * x + view[0, 1] * y + view[0, 2] * z
        if depth <= NEAR:
            continue
        i = int(np.floor(((view[1, 0] * x + view[1, 1] * y + view[1, 2] * z) / depth - origin[0]) * scale))
        j = int(np.floor(((view[2, 0] * x + view[2, 1] * y + view[2, 2] * z) / depth - origin[1]) * scale))
        if 0 <= i < columns and 0 <= j < rows:
            visible[p] = items[j, i] < first or nearest[j, i] * depth <= 1.0 + SURFACE_MARGIN


@njit(cache=True, nogil=True)
def see_small(
    points: Any, view: Any, origin: Any, scale: float, nearest: Any, items: Any, corners: Any, pixels: Any, visible: Any
) -> None:
    """Set `visible` (facet,) to 1 for facets `corners` (facet, 3) without `pixels` whose centroid nothing hides."""
    rows, columns = nearest.shape
    for f in range(corners.shape[0]):
        if pixels[f] != 0:
            continue
        a, b, c = corners[f, 0], corners[f, 1], corners[f, 2]
        x = (points[a, 0] + points[b, 0] + points[c, 0]) / 3.0
        y = (points[a, 1] + points[b, 1] + points[c, 1]) / 3.0
        z = (points[a, 2] + points[b, 2] + points[c, 2]) / 3.0
        depth = view[0, 0] * x + view[0, 1] * y + view[0, 2] * z
        if depth <= NEAR:
            continue
        i = int(np.floor(((view[1, 0] * x + view[1, 1] * y + view[1, 2] * z) / depth - origin[0]) * scale))
        j = int(np.floor(((view[2, 0] * x + view[2, 1] * y + view[2, 2] * z) / depth - origin[1]) * scale))
        if 0 <= i < columns and 0 <= j < rows and nearest[j, i] * depth <= 1.0 + SURFACE_MARGIN:
            visible[f] = 1.0
