"""Visible parts of facets, from the pixels that show them.

Pixels have a column and a row; see :mod:`rfgen_sionna.tracing.visibility.rasterise`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

MAX_MISFIT = 0.1
"""Largest misfit, in shares of a facet, of what a line leaves of it to the centroid of its pixels."""
LEAST_PIXELS = 16.0
"""Number of pixels from which their second moments count."""


@njit(cache=True, nogil=True)
def count_items(items: Any, first: int, seen: Any) -> None:
    """Add to `seen` (facet, 6) the pixels of `items` (row, column) that show each facet, numbered from `first` on, and
    the sums of their columns, rows, squared columns, squared rows and columns times rows."""
    for j in range(items.shape[0]):
        for i in range(items.shape[1]):
            f = items[j, i] - first
            if 0 <= f < seen.shape[0]:
                _add(seen, f, i + 0.5, j + 0.5)


@njit(cache=True, nogil=True)
def count_hidden(before: Any, items: Any, first: int, hidden: Any) -> None:
    """Add to `hidden` (facet, 6) the pixels that showed each facet in `before` and show an item from `first` on in
    `items` (row, column), and the sums of :func:`count_items`."""
    for j in range(items.shape[0]):
        for i in range(items.shape[1]):
            f = before[j, i]
            if items[j, i] >= first and f >= 0:
                _add(hidden, f, i + 0.5, j + 0.5)


@njit(error_model="numpy")
def _add(sums: Any, f: int, x: float, y: float) -> None:
    """Add a pixel at column `x` and row `y` to the sums of facet `f`."""
    sums[f, 0] += 1.0
    sums[f, 1] += x
    sums[f, 2] += y
    sums[f, 3] += x * x
    sums[f, 4] += y * y
    sums[f, 5] += x * y


@njit(error_model="numpy")
def _place_rectangle(sums: Any, area: float, x: Any, y: Any, place: Any) -> None:
    """Barycentric coordinates `place` (4, 3), in the image of a triangle with corners `x` and `y` (3,) [pixels], of the
    corners of a rectangle of this `area` with the centroid and the axes of the pixels with these `sums` (6,)."""
    n = sums[0]
    px, py = sums[1] / n, sums[2] / n
    xx, yy = sums[3] / n - px * px + 1.0 / 12.0, sums[4] / n - py * py + 1.0 / 12.0
    xy = sums[5] / n - px * py
    turned = 0.5 * np.arctan2(2.0 * xy, xx - yy)
    c, s = np.cos(turned), np.sin(turned)
    one = np.sqrt(3.0 * max(xx * c * c + 2.0 * xy * c * s + yy * s * s, 1e-3))
    other = np.sqrt(3.0 * max(xx * s * s - 2.0 * xy * c * s + yy * c * c, 1e-3))
    scale = np.sqrt(area / (4.0 * one * other))
    whole = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])
    for i in range(4):
        u, v = scale * one * (1.0 if i in (1, 2) else -1.0), scale * other * (1.0 if i >= 2 else -1.0)
        a, b = px + u * c - v * s, py + u * s + v * c
        for k in range(3):
            m, n = (k + 1) % 3, (k + 2) % 3
            place[i, k] = ((x[m] - a) * (y[n] - b) - (x[n] - a) * (y[m] - b)) / whole


@njit(error_model="numpy")
def _put(place: Any, inverse: Any, count: int, cuts: Any) -> int:
    """Write `count` triangles with corners `place` (4, 3) in the image, whose inverse depths are `inverse` (3,), to
    `cuts` (2, 3, 3) in the facet; their number, 0 beyond the facet's horizon."""
    for m in range(2 + count):
        total = place[m, 0] * inverse[0] + place[m, 1] * inverse[1] + place[m, 2] * inverse[2]
        if total <= 0.25 * inverse.min():
            return 0
        for k in range(3):
            place[m, k] *= inverse[k] / total
    for n in range(count):
        for k in range(3):
            cuts[n, 0, k] = place[0, k]
            cuts[n, 1, k] = place[1 + n, k]
            cuts[n, 2, k] = place[2 + n, k]
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def cut_facets(
    left: Any, up: Any, inverse: Any, corners: Any, chosen: Any, origin: Any, scale: float, shares: Any, seen: Any,
    cuts: Any, found: Any,
) -> None:  # fmt: skip
    """Cut facets to what has the share `shares` (chosen,) of each and its pixels' centroid.

    `corners` (facet, 3) are indices of the points of :func:`rfgen_sionna.tracing.visibility.rasterise.project`; `seen`
    (facet, 6) is that of :func:`count_items`. Barycentric coordinates of one or two triangles go to `cuts` (chosen, 2,
    3, 3), and their number to `found` (chosen,); 0 where the pixels lie in the middle of the facet.

    A line leaves a triangle at a corner, or all but one. If the triangle takes the parts u and v of the edges at its
    corner, its share is u v and its centroid is u / 3 and v / 3 along them. What no line leaves, as between the edges
    of a slit, is a rectangle with the pixels' second moments.
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
        if least > MAX_MISFIT and seen[f, 0] >= LEAST_PIXELS:
            _place_rectangle(seen[f], 0.5 * share * abs(area), x, y, place)
            count = 2
            found[q] = _put(place, inv, count, cuts[q])
            continue
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
        found[q] = _put(place, inv, count, cuts[q])


@njit(cache=True, nogil=True)
def set_fractions(pixels: Any, seen: Any, visible: Any) -> None:
    """Set `visible` (facet,) to the share of `seen` (facet, 3) in `pixels` (facet,) of facets that have any."""
    for f in range(pixels.shape[0]):
        if pixels[f] > 0:
            visible[f] = seen[f, 0] / pixels[f]
