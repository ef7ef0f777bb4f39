"""Physical optics of quadratic patches, one facet after the other.

With the Tx element at distance R_t, the Rx element at R_r and k = 2 pi f / c the gain of a facet is

    a = (j / 4 pi) F A / (R_t R_r) <exp(-j k (R_t + R_r))>

A is the area, <.> the mean over the facet, and F the obliquity (:mod:`rfgen_sionna.tracing.integral.fresnel`). At normal
incidence on metal F = -1: an infinite mirror at distance d has the image-theory gain -lambda / (4 pi 2 d) exp(-j 2 k d).

The middle of an edge between corners with normals n_i, n_k is displaced by a circle's sagitta, a facet by the quadratic of
its three edges (:mod:`rfgen_sionna.tracing.surface.smoothing`). A facet is divided until the quadratic part of the phase
on each piece is small (:func:`rfgen_sionna.tracing.integral.phasor_moments.mean_phasor`).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from rfgen_sionna.tracing.integral.fresnel import cross, dot, minus, norm, obliquity, plus, scaled
from rfgen_sionna.tracing.integral.phasor_moments import FAST, mean_phasor

MAX_PARTS = 8
"""Largest number of pieces along an edge."""
MIN_DISTANCE = 1e-4
"""Distance of an element [m] below which a facet returns nothing."""
MIN_COSINE = 1e-3
"""Cosine of incidence below which the strength stays that of this angle."""
_POINTS = (2 * MAX_PARTS + 1) * (MAX_PARTS + 1)


@njit(fastmath=FAST, error_model="numpy")
def _edge_sagitta(normals: Any, g: int, h: int, chord: Any) -> tuple[float, float, float]:
    """Displacement [m] of the middle of an edge with this `chord` between corners of the normals `g` and `h`."""
    if g < 0 or h < 0 or g == h:
        return 0.0, 0.0, 0.0
    one, other = (normals[g, 0], normals[g, 1], normals[g, 2]), (normals[h, 0], normals[h, 1], normals[h, 2])
    mean = plus(one, other)
    length = max(norm(mean), 1e-9)
    return scaled(mean, dot(minus(other, one), chord) / (2.0 * length * (2.0 + length)))


@njit(fastmath=FAST, error_model="numpy")
def _on_patch(a: Any, b: Any, c: Any, r: Any, s: Any, t: Any, u: float, v: float, w: float) -> tuple[float, float, float]:
    """Point at barycentric coordinates `u`, `v`, `w` of a patch with corners `a`, `b`, `c` and sagittas `r`, `s`, `t`."""
    p, q, o = 4.0 * v * w, 4.0 * w * u, 4.0 * u * v
    return (
        u * a[0] + v * b[0] + w * c[0] + p * r[0] + q * s[0] + o * t[0],
        u * a[1] + v * b[1] + w * c[1] + p * r[1] + q * s[1] + o * t[1],
        u * a[2] + v * b[2] + w * c[2] + p * r[2] + q * s[2] + o * t[2],
    )


@njit(fastmath=FAST, error_model="numpy")
def _store(lattice: Any, m: int, point: Any) -> None:
    """Write a `point` to row `m`."""
    lattice[m, 0], lattice[m, 1], lattice[m, 2] = point


@njit(fastmath=FAST, error_model="numpy")
def _path_length(point: Any, t: Any, r: Any, apart: bool) -> float:
    """Length [m] of the path from `t` by a `point` to `r`, or twice the distance of `t` where both are one."""
    if apart:
        return norm(minus(point, t)) + norm(minus(point, r))
    return 2.0 * norm(minus(point, t))


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def patch_gains(
    points: Any, faces: Any, group: Any, normals: Any, face_of: Any, weights: Any, chosen: Any, visible: Any,
    material: Any, single: Any, nodes: Any, fields: Any, media: Any, bistatic: bool, most_rise: float, gradient: Any,
    gains: Any, centroids: Any,
) -> None:  # fmt: skip
    """Gains (node, chosen) without the propagation phase of the `centroids` (chosen, 3) [m] of the flat facets.

    Parameters
    ----------
    points, faces, group, normals
        (vertex, 3) [m] relative to the viewpoint, (face, 3), (face, 3) index of the normal of each corner, -1 on flat
        faces, and (normal, 3).
    face_of, weights
        (facet,) face of each facet, and (facet, 3, 3) barycentric coordinates of its corners; no weights mean whole faces.
    chosen, visible
        (chosen,) facets to integrate, and (chosen,) visible fraction of each.
    material, single
        (face,) index of the material, and whether only the front of the face returns.
    nodes, fields
        (node, 7) Tx and Rx position [m] relative to the viewpoint and wavenumber [rad/m], nodes of one pair in turn; (2, 3)
        electric field of Tx and Rx.
    media
        (node, material, 7) of :func:`rfgen_sionna.tracing.integral.fresnel.media_table`.
    bistatic
        Whether the obliquity is that of separate elements; else that of an element half way.
    most_rise
        Largest quadratic part of the distance [m] in the middle of an edge of a piece: the same pieces at all frequencies.
    gradient
        (chosen, 3) gradient of the logarithm of the pattern gain [1/m]; empty means none.
    """
    lattice, path = np.empty((_POINTS, 3)), np.empty(_POINTS)
    tx_field, rx_field = (fields[0, 0], fields[0, 1], fields[0, 2]), (fields[1, 0], fields[1, 1], fields[1, 2])
    for q in range(chosen.shape[0]):
        f = chosen[q]
        face = face_of[f]
        i, j, k = faces[face, 0], faces[face, 1], faces[face, 2]
        a, b, c = (points[i, 0], points[i, 1], points[i, 2]), (points[j, 0], points[j, 1], points[j, 2]), (
            points[k, 0], points[k, 1], points[k, 2])  # fmt: skip
        g, h, o = group[face, 0], group[face, 1], group[face, 2]
        flat = g < 0
        r, s, t = (
            _edge_sagitta(normals, h, o, minus(c, b)), _edge_sagitta(normals, o, g, minus(a, c)),
            _edge_sagitta(normals, g, h, minus(b, a)),
        )  # fmt: skip
        u0, v0, w0, u1, v1, w1, u2, v2, w2 = 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0
        if weights.shape[0]:
            u0, v0, w0 = weights[f, 0, 0], weights[f, 0, 1], weights[f, 0, 2]
            u1, v1, w1 = weights[f, 1, 0], weights[f, 1, 1], weights[f, 1, 2]
            u2, v2, w2 = weights[f, 2, 0], weights[f, 2, 1], weights[f, 2, 2]
        um, vm, wm = (u0 + u1 + u2) / 3.0, (v0 + v1 + v2) / 3.0, (w0 + w1 + w2) / 3.0
        zero = (0.0, 0.0, 0.0)
        middle = _on_patch(a, b, c, zero, zero, zero, um, vm, wm)  # of the flat facet
        centroids[q, 0], centroids[q, 1], centroids[q, 2] = middle
        for n in range(nodes.shape[0]):
            gains[n, q] = 0.0
        if visible[q] <= 0.0:
            continue
        # Vector area of the face's front, turned to the radar.
        front = cross(minus(b, a), minus(c, a))
        inward = dot(front, middle) > 0.0
        if inward and single[face]:
            continue
        side = -1.0 if inward else 1.0
        top = middle if flat else _on_patch(a, b, c, r, s, t, um, vm, wm)
        facing = scaled(front, side)
        if not flat:  # vector area of the patch in the middle
            along = minus(_on_patch(a, b, c, r, s, t, u1, v1, w1), _on_patch(a, b, c, r, s, t, u0, v0, w0))
            across = minus(_on_patch(a, b, c, r, s, t, u2, v2, w2), _on_patch(a, b, c, r, s, t, u0, v0, w0))
            facing = scaled(cross(along, across), side)
        size = norm(facing)
        if size <= 0.0:
            continue
        facing = scaled(facing, 1.0 / size)
        parts, base, before, apart, element = 0, 0.0, -1, False, zero
        direction, tilt = zero, zero
        for n in range(nodes.shape[0]):
            here, there = (nodes[n, 0], nodes[n, 1], nodes[n, 2]), (nodes[n, 3], nodes[n, 4], nodes[n, 5])
            wavenumber = nodes[n, 6]
            same = before >= 0
            if same:
                for m in range(6):
                    same = same and nodes[n, m] == nodes[before, m]
            if not same:
                element = scaled(plus(here, there), 0.5)
                apart = bistatic
                if not bistatic:
                    here = there = element
                base = _path_length(middle, here, there, apart)
                direction = minus(top, element)
                distance = norm(direction)
                direction = scaled(direction, 1.0 / max(distance, MIN_DISTANCE))
                cosine = -dot(direction, facing)
                tilt = zero
                if gradient.shape[0]:
                    tilt = (gradient[q, 0], gradient[q, 1], gradient[q, 2])
                if flat:  # of cos / R^2
                    tilt = plus(tilt, scaled(direction, -3.0 / max(distance, MIN_DISTANCE)))
                    tilt = plus(tilt, scaled(facing, -1.0 / (max(cosine, MIN_COSINE) * max(distance, MIN_DISTANCE))))
                # Pieces along an edge, by the quadratic phase in the middle of the facet's edges.
                ends = (
                    _on_patch(a, b, c, r, s, t, u0, v0, w0), _on_patch(a, b, c, r, s, t, u1, v1, w1),
                    _on_patch(a, b, c, r, s, t, u2, v2, w2),
                )  # fmt: skip
                l0 = _path_length(ends[0], here, there, apart)
                l1 = _path_length(ends[1], here, there, apart)
                l2 = _path_length(ends[2], here, there, apart)
                p0 = _on_patch(a, b, c, r, s, t, 0.5 * (u1 + u2), 0.5 * (v1 + v2), 0.5 * (w1 + w2))
                p1 = _on_patch(a, b, c, r, s, t, 0.5 * (u2 + u0), 0.5 * (v2 + v0), 0.5 * (w2 + w0))
                p2 = _on_patch(a, b, c, r, s, t, 0.5 * (u0 + u1), 0.5 * (v0 + v1), 0.5 * (w0 + w1))
                e0 = _path_length(p0, here, there, apart)
                e1 = _path_length(p1, here, there, apart)
                e2 = _path_length(p2, here, there, apart)
                rise = max(abs(0.5 * (l1 + l2) - e0), abs(0.5 * (l2 + l0) - e1), abs(0.5 * (l0 + l1) - e2))
                parts = min(max(int(np.ceil(np.sqrt(rise / most_rise))), 1), MAX_PARTS)
                if parts == 1:
                    for m in range(3):
                        _store(lattice, m, ends[m])
                    for m, length in enumerate((l0, l1, l2, e0, e1, e2)):
                        path[m] = length - base
                else:
                    m = 0
                    for row in range(2 * parts + 1):
                        for column in range(2 * parts + 1 - row):
                            x, y = row / (2.0 * parts), column / (2.0 * parts)
                            z = 1.0 - x - y
                            p = _on_patch(
                                a, b, c, r, s, t, z * u0 + x * u1 + y * u2, z * v0 + x * v1 + y * v2, z * w0 + x * w1 + y * w2
                            )
                            _store(lattice, m, p)
                            path[m] = _path_length(p, here, there, apart) - base
                            m += 1
                before = n
            strength = obliquity(
                media[n, material[face]], wavenumber, facing, top, (nodes[n, 0], nodes[n, 1], nodes[n, 2]),
                (nodes[n, 3], nodes[n, 4], nodes[n, 5]), tx_field, rx_field, bistatic,
            )  # fmt: skip
            total = 0j
            if parts == 1:
                p0, p1, p2 = (
                    (lattice[0, 0], lattice[0, 1], lattice[0, 2]), (lattice[1, 0], lattice[1, 1], lattice[1, 2]),
                    (lattice[2, 0], lattice[2, 1], lattice[2, 2]),
                )  # fmt: skip
                projected = -side * dot(cross(minus(p1, p0), minus(p2, p0)), direction)
                if projected > 0.0:
                    total = projected * mean_phasor(
                        wavenumber * path[0], wavenumber * path[1], wavenumber * path[2],
                        1.0 + dot(tilt, minus(p0, top)), 1.0 + dot(tilt, minus(p1, top)), 1.0 + dot(tilt, minus(p2, top)),
                        wavenumber * (0.5 * (path[1] + path[2]) - path[3]), wavenumber * (0.5 * (path[2] + path[0]) - path[4]),
                        wavenumber * (0.5 * (path[0] + path[1]) - path[5]),
                    )  # fmt: skip
            else:
                double = 2 * parts
                for row in range(parts):
                    for column in range(parts - row):
                        for turned in range(2):
                            if turned and column == parts - row - 1:
                                continue
                            # Corners and edge middles on the lattice of half steps.
                            x0, y0, x1, y1, x2, y2 = 2 * row, 2 * column, 2 * row + 2, 2 * column, 2 * row, 2 * column + 2
                            if turned:
                                x0, y0 = 2 * row + 2, 2 * column
                                x1, y1 = 2 * row + 2, 2 * column + 2
                                x2, y2 = 2 * row, 2 * column + 2
                            i0, i1, i2 = _place(double, x0, y0), _place(double, x1, y1), _place(double, x2, y2)
                            m0 = _place(double, (x1 + x2) // 2, (y1 + y2) // 2)
                            m1 = _place(double, (x2 + x0) // 2, (y2 + y0) // 2)
                            m2 = _place(double, (x0 + x1) // 2, (y0 + y1) // 2)
                            p0 = (lattice[i0, 0], lattice[i0, 1], lattice[i0, 2])
                            p1 = (lattice[i1, 0], lattice[i1, 1], lattice[i1, 2])
                            p2 = (lattice[i2, 0], lattice[i2, 1], lattice[i2, 2])
                            projected = -side * dot(cross(minus(p1, p0), minus(p2, p0)), direction)
                            if projected <= 0.0:
                                continue
                            total += projected * mean_phasor(
                                wavenumber * path[i0], wavenumber * path[i1], wavenumber * path[i2],
                                1.0 + dot(tilt, minus(p0, top)), 1.0 + dot(tilt, minus(p1, top)),
                                1.0 + dot(tilt, minus(p2, top)),
                                wavenumber * (0.5 * (path[i1] + path[i2]) - path[m0]),
                                wavenumber * (0.5 * (path[i2] + path[i0]) - path[m1]),
                                wavenumber * (0.5 * (path[i0] + path[i1]) - path[m2]),
                            )  # fmt: skip
            # Shadow weight: the visible fraction of the facet.
            gains[n, q] = visible[q] * (0.5j / (4.0 * np.pi)) * strength * total


@njit(fastmath=FAST, error_model="numpy")
def _place(double: int, row: int, column: int) -> int:
    """Index of a lattice point in its row; row k holds `double` + 1 - k points."""
    return row * (double + 1) - row * (row - 1) // 2 + column
