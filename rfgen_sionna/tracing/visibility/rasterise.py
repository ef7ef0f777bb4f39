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
          items: Any) -> int:  # fmt: skip
    """Draw one triangle; returns its number of pixel centres."""
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
        count += end - begin
    return count


@njit(cache=True, nogil=True)
def draw(
    points: Any, left: Any, up: Any, inverse: Any, view: Any, corners: Any, single: Any, first: int, origin: Any,
    scale: float, nearest: Any, items: Any, pixels: Any,
) -> None:  # fmt: skip
    """Draw facets `corners` (facet, 3) numbered from `first` on into `nearest` inverse depths and `items` (row,
    column), and add the pixel centres of each to `pixels` (facet,); -1 there means that it faces away.

    `left`, `up` and `inverse` (point,) are those of :func:`project`. Facets are `single`-sided (facet,),
    counter-clockwise from the visible side, or seen from both. `origin` (2,) is the tangent of the corner of pixel 0,
    `scale` pixels per tangent.
    """
    polygon, clipped = np.empty((5, 3)), np.empty((5, 3))
    for f in range(corners.shape[0]):
        a, b, c = corners[f, 0], corners[f, 1], corners[f, 2]
        # The side, from the volume with the viewpoint.
        px, py, pz = points[a, 0], points[a, 1], points[a, 2]
        qx, qy, qz = points[b, 0] - px, points[b, 1] - py, points[b, 2] - pz
        rx, ry, rz = points[c, 0] - px, points[c, 1] - py, points[c, 2] - pz
        side = px * (qy * rz - qz * ry) + py * (qz * rx - qx * rz) + pz * (qx * ry - qy * rx)
        if single[f] and side >= 0.0:
            pixels[f] = -1
            continue
        behind = int(inverse[a] == 0.0) + int(inverse[b] == 0.0) + int(inverse[c] == 0.0)
        if behind == 3:
            continue
        if behind == 0:
            ax, ay = (left[a] - origin[0]) * scale, (up[a] - origin[1]) * scale
            bx, by = (left[b] - origin[0]) * scale, (up[b] - origin[1]) * scale
            cx, cy = (left[c] - origin[0]) * scale, (up[c] - origin[1]) * scale
            pixels[f] += _fill(ax, ay, inverse[a], bx, by, inverse[b], cx, cy, inverse[c], first + f, nearest, items)
            continue
        # Clip at the near plane, in view coordinates.
        for k in range(3):
            p = corners[f, k]
            for m in range(3):
                polygon[k, m] = view[m, 0] * points[p, 0] + view[m, 1] * points[p, 1] + view[m, 2] * points[p, 2]
        count = 0
        for k in range(3):
            n = (k + 1) % 3
            if polygon[k, 0] > NEAR:
                clipped[count] = polygon[k]
                count += 1
            if (polygon[k, 0] > NEAR) != (polygon[n, 0] > NEAR):
                share = (NEAR - polygon[k, 0]) / (polygon[n, 0] - polygon[k, 0])
                clipped[count] = polygon[k] + share * (polygon[n] - polygon[k])
                clipped[count, 0] = NEAR
                count += 1
        for k in range(1, count - 1):
            aw, bw, cw = 1.0 / clipped[0, 0], 1.0 / clipped[k, 0], 1.0 / clipped[k + 1, 0]
            ax, ay = (clipped[0, 1] * aw - origin[0]) * scale, (clipped[0, 2] * aw - origin[1]) * scale
            bx, by = (clipped[k, 1] * bw - origin[0]) * scale, (clipped[k, 2] * bw - origin[1]) * scale
            cx, cy = (clipped[k + 1, 1] * cw - origin[0]) * scale, (clipped[k + 1, 2] * cw - origin[1]) * scale
            pixels[f] += _fill(ax, ay, aw, bx, by, bw, cx, cy, cw, first + f, nearest, items)


@njit(cache=True, nogil=True)
def count_items(items: Any, first: int, seen: Any) -> None:
    """Add to `seen` (facet, 3) the pixels of `items` (row, column) that show each facet, numbered from `first` on, and
    the sums of their columns and rows."""
    for j in range(items.shape[0]):
        for i in range(items.shape[1]):
            f = items[j, i] - first
            if 0 <= f < seen.shape[0]:
                seen[f, 0] += 1.0
                seen[f, 1] += i + 0.5
                seen[f, 2] += j + 0.5


@njit(cache=True, nogil=True)
def count_hidden(before: Any, items: Any, first: int, hidden: Any) -> None:
    """Add to `hidden` (facet, 3) the pixels that showed each facet in `before` and show an item from `first` on in
    `items` (row, column), and the sums of their columns and rows."""
    for j in range(items.shape[0]):
        for i in range(items.shape[1]):
            f = before[j, i]
            if items[j, i] >= first and f >= 0:
                hidden[f, 0] += 1.0
                hidden[f, 1] += i + 0.5
                hidden[f, 2] += j + 0.5


@njit(cache=True, nogil=True, error_model="numpy")
def count_within(
    left: Any, up: Any, inverse: Any, owner: Any, origin: Any, scale: float, before: Any, items: Any, first: int,
    pixels: Any, hidden: Any,
) -> None:  # fmt: skip
    """Add to `pixels` (facet,) those of each facet, also beyond the view, and to `hidden` (facet, 3), as
    :func:`count_hidden`, those where its `owner` (facet,) was visible `before` and an item from `first` on is now.

    `left`, `up` and `inverse` (3 * facet,) are those of the facets' corners by :func:`project`. A facet without pixel
    centres of its own takes the pixel of its centroid.
    """
    rows, columns = items.shape
    for f in range(owner.shape[0]):
        a, b, c = 3 * f, 3 * f + 1, 3 * f + 2
        if inverse[a] == 0.0 or inverse[b] == 0.0 or inverse[c] == 0.0:
            continue  # beside this view
        ax, ay = (left[a] - origin[0]) * scale, (up[a] - origin[1]) * scale
        bx, by = (left[b] - origin[0]) * scale, (up[b] - origin[1]) * scale
        cx, cy = (left[c] - origin[0]) * scale, (up[c] - origin[1]) * scale
        area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        if area < 0.0:
            bx, by, cx, cy, area = cx, cy, bx, by, -area
        x_low, x_high, y_low, y_high = min(ax, bx, cx), max(ax, bx, cx), min(ay, by, cy), max(ay, by, cy)
        if x_high < 0.0 or x_low > columns or y_high < 0.0 or y_low > rows:
            continue
        inside = 0.0
        for j in range(max(int(np.ceil(y_low - 0.5)), 0), min(int(np.floor(y_high - 0.5)), rows - 1) + 1):
            y = j + 0.5
            low, high = x_low, x_high
            for x0, y0, x1, y1 in ((ax, ay, bx, by), (bx, by, cx, cy), (cx, cy, ax, ay)):
                rise = y1 - y0
                if rise > 0.0:
                    high = min(high, x0 + (x1 - x0) * (y - y0) / rise)
                elif rise < 0.0:
                    low = max(low, x0 + (x1 - x0) * (y - y0) / rise)
            for i in range(max(int(np.ceil(low - 0.5)), 0), min(int(np.ceil(high - 0.5)), columns)):
                inside += 1.0
                if before[j, i] == owner[f] and items[j, i] >= first:
                    hidden[f, 0] += 1.0
                    hidden[f, 1] += i + 0.5
                    hidden[f, 2] += y
        if inside == 0.0:
            i, j = int(np.floor((ax + bx + cx) / 3.0)), int(np.floor((ay + by + cy) / 3.0))
            if 0 <= i < columns and 0 <= j < rows and items[j, i] >= first and before[j, i] == owner[f]:
                inside = hidden[f, 0] = 1.0
        shown = x_low >= 0.0 and x_high <= columns and y_low >= 0.0 and y_high <= rows
        pixels[f] += inside if shown else max(0.5 * area, inside)


@njit(cache=True, nogil=True, error_model="numpy")
def cut_facets(
    left: Any, up: Any, inverse: Any, corners: Any, chosen: Any, origin: Any, scale: float, shares: Any, seen: Any,
    cuts: Any, found: Any,
) -> None:  # fmt: skip
    """Cut facets by the straight lines that leave the share `shares` (chosen,) of each with its pixels' centroid.

    `corners` (facet, 3) are indices of the points of :func:`project`; `seen` (facet, 3) is that of
    :func:`count_items`. Barycentric coordinates of one or two triangles go to `cuts` (chosen, 2, 3, 3), and their
    number to `found` (chosen,); 0 where the pixels lie in the middle of the facet.

    A line leaves a triangle at a corner, or all but one. If the triangle takes the parts u and v of the edges at its
    corner, its share is u v and its centroid is u / 3 and v / 3 along them.
    """
    x, y, inv, weight = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    place = np.empty((4, 3))
    for q in range(chosen.shape[0]):
        f = chosen[q]
        found[q] = 0
        for k in range(3):
            p = corners[f, k]
            inv[k] = inverse[p]
            x[k], y[k] = (left[p] - origin[0]) * scale, (up[p] - origin[1]) * scale
        if inv.min() <= 0.0 or seen[f, 0] < 1.0:
            continue
        area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])
        if area == 0.0:
            continue
        px, py, share = seen[f, 1] / seen[f, 0], seen[f, 2] / seen[f, 0], shares[q]
        if (px - x.mean()) ** 2 + (py - y.mean()) ** 2 < 1e-6 * abs(area):
            continue
        for k in range(3):
            m, n = (k + 1) % 3, (k + 2) % 3
            weight[k] = ((x[m] - px) * (y[n] - py) - (x[n] - px) * (y[m] - py)) / area
        corner, complement, least, u, v = 0, False, np.inf, 1.0, 1.0
        for k in range(3):
            m, n = (k + 1) % 3, (k + 2) % 3
            for other in (False, True):
                part = 1.0 - share if other else share
                # Centroid of the triangle along both edges: of the part itself, or of the rest.
                a = (1.0 - 3.0 * share * weight[m]) / part if other else 3.0 * weight[m]
                b = (1.0 - 3.0 * share * weight[n]) / part if other else 3.0 * weight[n]
                a, b = max(a, 1e-9), max(b, 1e-9)
                off = abs(a * b - part) + max(a - 1.0, 0.0) + max(b - 1.0, 0.0)
                if off < least:
                    a = min(max(np.sqrt(part * a / b), part), 1.0)  # the share counts, and both lie on the edges
                    corner, complement, least, u, v = k, other, off, a, part / a
        m, n = (corner + 1) % 3, (corner + 2) % 3
        for i in range(4):
            for k in range(3):
                place[i, k] = 0.0
        if not complement:
            place[0, corner] = 1.0
            place[1, corner], place[1, m] = 1.0 - u, u
            place[2, corner], place[2, n] = 1.0 - v, v
            count = 1
        else:
            place[0, n], place[1, m] = 1.0, 1.0
            place[2, corner], place[2, m] = 1.0 - u, u
            place[3, corner], place[3, n] = 1.0 - v, v
            count = 2
        for m in range(4):  # from the image to the facet
            total = place[m, 0] * inv[0] + place[m, 1] * inv[1] + place[m, 2] * inv[2]
            for k in range(3):
                place[m, k] *= inv[k] / max(total, 1e-300)
        for n in range(count):
            for k in range(3):
                cuts[q, n, 0, k] = place[0, k]
                cuts[q, n, 1, k] = place[1 + n, k]
                cuts[q, n, 2, k] = place[2 + n, k]
        found[q] = count


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


@njit(cache=True, nogil=True)
def set_fractions(pixels: Any, seen: Any, visible: Any) -> None:
    """Set `visible` (facet,) to the share of `seen` (facet, 3) in `pixels` (facet,) of facets that have any."""
    for f in range(pixels.shape[0]):
        if pixels[f] > 0:
            visible[f] = seen[f, 0] / pixels[f]
