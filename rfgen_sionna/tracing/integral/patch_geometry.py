"""Points of quadratic patches, and sums over the part of a patch inside half-spaces, in scalar kernels."""

from __future__ import annotations

from typing import Any

from numba import njit

from rfgen_sionna.tracing.integral.fresnel import cross, dot, minus, norm, plus, scaled
from rfgen_sionna.tracing.integral.phasor_moments import FAST, mean_phasor

MIN_DISTANCE = 1e-4
"""Distance of an element [m] below which a facet returns nothing."""


@njit(fastmath=FAST, error_model="numpy")
def on_patch(a: Any, b: Any, c: Any, r: Any, s: Any, t: Any, u: float, v: float, w: float) -> tuple[float, float, float]:
    """Point at barycentric coordinates `u`, `v`, `w` of a patch with corners `a`, `b`, `c` and sagittas `r`, `s`,
    `t`."""
    p, q, o = 4.0 * v * w, 4.0 * w * u, 4.0 * u * v
    return (
        u * a[0] + v * b[0] + w * c[0] + p * r[0] + q * s[0] + o * t[0],
        u * a[1] + v * b[1] + w * c[1] + p * r[1] + q * s[1] + o * t[1],
        u * a[2] + v * b[2] + w * c[2] + p * r[2] + q * s[2] + o * t[2],
    )


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
    """Point at barycentric coordinates (1 - x - y, x, y) of a facet with corners at `ends` (3, 3) of a `patch`."""
    z = 1.0 - x - y
    return on_patch(
        patch[0], patch[1], patch[2], patch[3], patch[4], patch[5], z * ends[0][0] + x * ends[1][0] + y * ends[2][0],
        z * ends[0][1] + x * ends[1][1] + y * ends[2][1], z * ends[0][2] + x * ends[1][2] + y * ends[2][2],
    )  # fmt: skip


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
def clipped_sum(
    patch: Any, ends: Any, parts: int, planes: Any, polygon: Any, spare: Any, here: Any, there: Any, apart: bool,
    base: float, wavenumber: float, direction: Any, side: float, tilt: Any, top: Any,
) -> complex:  # fmt: skip
    """Sum over the pieces inside all `planes` of twice the projected area times the mean phasor."""
    total, step = 0j, 1.0 / parts
    for row in range(parts):
        for column in range(parts - row):
            for turned in range(2):
                if turned and column == parts - row - 1:
                    continue
                x, y = row * step, column * step
                polygon[0, 0], polygon[0, 1] = (x + step, y) if turned else (x, y)
                polygon[1, 0], polygon[1, 1] = (x + step, y + step) if turned else (x + step, y)
                polygon[2, 0], polygon[2, 1] = x, y + step
                corners = clip(patch, ends, planes, polygon, spare, 3)
                for k in range(1, corners - 1):
                    x0, y0, x1, y1 = polygon[0, 0], polygon[0, 1], polygon[k, 0], polygon[k, 1]
                    x2, y2 = polygon[k + 1, 0], polygon[k + 1, 1]
                    p0, p1, p2 = patch_point(patch, ends, x0, y0), patch_point(patch, ends, x1, y1), patch_point(patch, ends, x2, y2)
                    projected = -side * dot(cross(minus(p1, p0), minus(p2, p0)), direction)
                    if projected <= 0.0:
                        continue
                    l0 = path_length(p0, here, there, apart) - base
                    l1 = path_length(p1, here, there, apart) - base
                    l2 = path_length(p2, here, there, apart) - base
                    e0 = path_length(patch_point(patch, ends, 0.5 * (x1 + x2), 0.5 * (y1 + y2)), here, there, apart) - base
                    e1 = path_length(patch_point(patch, ends, 0.5 * (x2 + x0), 0.5 * (y2 + y0)), here, there, apart) - base
                    e2 = path_length(patch_point(patch, ends, 0.5 * (x0 + x1), 0.5 * (y0 + y1)), here, there, apart) - base
                    total += projected * mean_phasor(
                        wavenumber * l0, wavenumber * l1, wavenumber * l2, 1.0 + dot(tilt, minus(p0, top)),
                        1.0 + dot(tilt, minus(p1, top)), 1.0 + dot(tilt, minus(p2, top)),
                        wavenumber * (0.5 * (l1 + l2) - e0), wavenumber * (0.5 * (l2 + l0) - e1),
                        wavenumber * (0.5 * (l0 + l1) - e2),
                    )  # fmt: skip
    return total


@njit(fastmath=FAST, error_model="numpy")
def clip_state(patch: Any, ends: Any, planes: Any) -> int:
    """1 where a facet is inside all `planes`, -1 where it is beyond one of them, 0 where one cuts it."""
    whole = 1
    for m in range(planes.shape[0]):
        n, d = (planes[m, 0], planes[m, 1], planes[m, 2]), planes[m, 3]
        count = int(dot(n, patch_point(patch, ends, 0.0, 0.0)) >= d) + int(dot(n, patch_point(patch, ends, 1.0, 0.0)) >= d)
        count += int(dot(n, patch_point(patch, ends, 0.0, 1.0)) >= d)
        if count == 0:
            return -1
        if count < 3:
            whole = 0
    return whole
