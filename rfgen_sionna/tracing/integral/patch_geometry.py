"""Points of quadratic patches, and their parts inside half-spaces, in scalar kernels."""

from __future__ import annotations

from typing import Any

from numba import njit

from rfgen_sionna.tracing.integral.fresnel import cross, dot, minus, norm, plus, scaled
from rfgen_sionna.tracing.integral.phasor_moments import FAST

MIN_DISTANCE = 1e-4
"""Distance of an element [m] below which a facet returns nothing."""


@njit(fastmath=FAST, error_model="numpy")
def on_patch(a: Any, b: Any, c: Any, r: Any, s: Any, t: Any, place: Any) -> tuple[float, float, float]:
    """Point at barycentric coordinates `place` of a patch with corners `a`, `b`, `c` and sagittas `r`, `s`, `t`."""
    u, v, w = place
    p, q, o = 4.0 * v * w, 4.0 * w * u, 4.0 * u * v
    return (
        u * a[0] + v * b[0] + w * c[0] + p * r[0] + q * s[0] + o * t[0],
        u * a[1] + v * b[1] + w * c[1] + p * r[1] + q * s[1] + o * t[1],
        u * a[2] + v * b[2] + w * c[2] + p * r[2] + q * s[2] + o * t[2],
    )


@njit(fastmath=FAST, error_model="numpy")
def area_element(a: Any, b: Any, c: Any, r: Any, s: Any, t: Any, place: Any) -> tuple[float, float, float]:
    """Vector area element there, of twice the area's length."""
    u, v, w = scaled(place, 4.0)
    of_u = plus(a, plus(scaled(s, w), scaled(t, v)))
    of_v, of_w = plus(b, plus(scaled(r, w), scaled(t, u))), plus(c, plus(scaled(r, v), scaled(s, u)))
    return cross(minus(of_v, of_u), minus(of_w, of_u))


@njit(fastmath=FAST, error_model="numpy")
def within(triangles: Any, k: int, corner: int, whole: Any) -> tuple[float, float, float]:
    """Barycentric coordinates in the face of a `corner` of triangle `k` of a facet with corners `whole` there."""
    u, v, w = triangles[k, corner, 0], triangles[k, corner, 1], triangles[k, corner, 2]
    return plus(plus(scaled(whole[0], u), scaled(whole[1], v)), scaled(whole[2], w))


@njit(fastmath=FAST, error_model="numpy")
def path_length(point: Any, t: Any, r: Any, apart: bool) -> float:
    """Length [m] of the path from `t` by a `point` to `r`, or twice the distance of `t` where both are one."""
    if apart:
        return norm(minus(point, t)) + norm(minus(point, r))
    return 2.0 * norm(minus(point, t))


@njit(fastmath=FAST, error_model="numpy")
def bisector(point: Any, tx: Any, rx: Any) -> tuple[float, float, float]:
    """Point between `tx` and `rx` that halves the angle at a `point`."""
    to_tx, to_rx = norm(minus(point, tx)), norm(minus(point, rx))
    return plus(tx, scaled(minus(rx, tx), to_tx / max(to_tx + to_rx, MIN_DISTANCE)))


@njit(fastmath=FAST, error_model="numpy")
def patch_point(patch: Any, ends: Any, x: float, y: float) -> tuple[float, float, float]:
    """Point at barycentric coordinates (1 - x - y, x, y) of a facet with corners at `ends` of a `patch`."""
    place = plus(plus(scaled(ends[0], 1.0 - x - y), scaled(ends[1], x)), scaled(ends[2], y))
    return on_patch(patch[0], patch[1], patch[2], patch[3], patch[4], patch[5], place)


@njit(fastmath=FAST, error_model="numpy")
def clip(patch: Any, ends: Any, planes: Any, polygon: Any, spare: Any, corners: int) -> int:
    """Clip a `polygon` (corner, 2), of which so many `corners` are in use, to all half-spaces `planes` (plane, 4), n .
    x >= d; returns its number of corners. `spare` is of the same shape."""
    for m in range(planes.shape[0]):
        n, d = (planes[m, 0], planes[m, 1], planes[m, 2]), planes[m, 3]
        kept = 0
        for k in range(corners):
            j = (k + 1) % corners
            here = dot(n, patch_point(patch, ends, polygon[k, 0], polygon[k, 1])) - d
            there = dot(n, patch_point(patch, ends, polygon[j, 0], polygon[j, 1])) - d
            if here >= 0.0:
                spare[kept, 0], spare[kept, 1] = polygon[k, 0], polygon[k, 1]
                kept += 1
            if (here >= 0.0) != (there >= 0.0):
                share = here / (here - there)
                for axis in range(2):
                    spare[kept, axis] = polygon[k, axis] + share * (polygon[j, axis] - polygon[k, axis])
                kept += 1
        for k in range(kept):
            polygon[k, 0], polygon[k, 1] = spare[k, 0], spare[k, 1]
        corners = kept
        if corners < 3:
            return 0
    return corners


@njit(fastmath=FAST, error_model="numpy")
def clip_state(patch: Any, ends: Any, planes: Any) -> int:
    """1 where a facet is inside all `planes`, -1 where it is beyond one of them, 0 where one cuts it."""
    whole = 1
    for m in range(planes.shape[0]):
        n, d = (planes[m, 0], planes[m, 1], planes[m, 2]), planes[m, 3]
        count = int(dot(n, patch_point(patch, ends, 0.0, 0.0)) >= d) + int(
            dot(n, patch_point(patch, ends, 1.0, 0.0)) >= d
        )
        count += int(dot(n, patch_point(patch, ends, 0.0, 1.0)) >= d)
        if count == 0:
            return -1
        if count < 3:
            whole = 0
    return whole


@njit(fastmath=FAST, error_model="numpy")
def visible_triangles(
    patch: Any, ends: Any, cut: int, cuts: Any, cut_count: Any, planes: Any, polygon: Any, spare: Any, triangles: Any
) -> int:
    """Write barycentric coordinates in a facet of the `triangles` (triangle, 3, 3) that a `cut` (-1 for none) and the
    half-spaces `planes` leave of it; returns their number."""
    found = 0
    for piece in range(cut_count[cut] if cut >= 0 else 1):
        for k in range(3):
            polygon[k, 0] = cuts[cut, piece, k, 1] if cut >= 0 else (1.0 if k == 1 else 0.0)
            polygon[k, 1] = cuts[cut, piece, k, 2] if cut >= 0 else (1.0 if k == 2 else 0.0)
        corners = clip(patch, ends, planes, polygon, spare, 3)
        for k in range(1, corners - 1):
            for place, corner in enumerate((0, k, k + 1)):
                x, y = polygon[corner, 0], polygon[corner, 1]
                triangles[found, place, 0], triangles[found, place, 1], triangles[found, place, 2] = 1.0 - x - y, x, y
            found += 1
    return found
