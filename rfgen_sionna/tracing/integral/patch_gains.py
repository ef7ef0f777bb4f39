"""Physical optics of quadratic patches, one facet after the other.

With the Tx element at distance R_t, the Rx element at R_r and k = 2 pi f / c the gain of a facet is

    a = (j / 4 pi) F A / (R_t R_r) <exp(-j k (R_t + R_r))>

A is the area, <.> the mean over the facet, and F the obliquity (:mod:`rfgen_sionna.tracing.integral.fresnel`). At
normal incidence on metal F = -1: an infinite mirror at distance d has the image-theory gain -lambda / (4 pi 2 d) exp(-j
2 k d).

The middle of an edge between corners with normals n_i, n_k is displaced by a circle's sagitta, a facet by the quadratic
of its three edges (:mod:`rfgen_sionna.tracing.surface.smoothing`). A facet is divided until the quadratic part of the
phase on each piece is small (:func:`rfgen_sionna.tracing.integral.phasor_moments.mean_phasor`).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from rfgen_sionna.tracing.integral.fresnel import cross, dot, minus, norm, obliquity, plus, scaled, unit
from rfgen_sionna.tracing.integral.leg_fields import leg_obliquity, slab_length
from rfgen_sionna.tracing.integral.patch_geometry import (
    MIN_DISTANCE,
    bisector,
    clip_state,
    clipped_sum,
    on_patch,
    path_length,
)
from rfgen_sionna.tracing.integral.phasor_moments import FAST, mean_phasor

MAX_PARTS = 8
"""Largest number of pieces along an edge."""
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
def _store(lattice: Any, m: int, point: Any) -> None:
    """Write a `point` to row `m`."""
    lattice[m, 0], lattice[m, 1], lattice[m, 2] = point


@njit(fastmath=FAST, error_model="numpy")
def _slab_path(legs: Any, q: int, point: Any, t: Any, r: Any) -> float:
    """Delay [m] of the slabs on both legs between a `point` of facet `q` and the images `t` and `r` of the elements."""
    return slab_length(legs, 0, q, unit(minus(point, t))) + slab_length(legs, 1, q, unit(minus(r, point)))


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def patch_gains(
    points: Any, faces: Any, group: Any, normals: Any, face_of: Any, weights: Any, chosen: Any, visible: Any,
    material: Any, single: Any, nodes: Any, fields: Any, media: Any, bistatic: bool, most_rise: float, gradient: Any,
    legs: Any, gains: Any, centroids: Any,
) -> None:  # fmt: skip
    """Gains (node, chosen) without the propagation phase of the `centroids` (chosen, 3) [m] of the flat facets.

    Parameters
    ----------
    points, faces, group, normals
        (vertex, 3) [m] relative to the viewpoint, (face, 3), (face, 3) index of the normal of each corner, -1 on flat
        faces, and (normal, 3).
    face_of, weights
        (facet,) face of each facet, and (facet, 3, 3) barycentric coordinates of its corners; no weights mean whole
        faces.
    chosen, visible
        (chosen,) facets to integrate, and (chosen,) visible fraction of each.
    material, single
        (face,) index of the material, and whether only the front of the face returns.
    nodes, fields
        (node, 7) Tx and Rx position [m] relative to the viewpoint and wavenumber [rad/m], nodes of one pair in turn;
        (2, 3) electric field of Tx and Rx.
    media
        (node, material, 7) of :func:`rfgen_sionna.tracing.integral.fresnel.media_table`.
    bistatic
        Whether the obliquity is that of separate elements; else that of an element half way.
    most_rise
        Largest quadratic part of the path [m] in the middle of an edge of a piece.
    gradient
        (chosen, 3) gradient of the logarithm of the pattern gain [1/m]; empty means none.
    legs
        :class:`rfgen_sionna.tracing.integral.leg_fields.LegTables` of both legs: `nodes` and `fields` are then those of
        images. Facets are clipped to its `planes`.
    """
    lattice, path = np.empty((_POINTS, 3)), np.empty(_POINTS)
    tx_field, rx_field = (fields[0, 0], fields[0, 1], fields[0, 2]), (fields[1, 0], fields[1, 1], fields[1, 2])
    mirrored, planes = legs.mirrors[0] + legs.mirrors[1] > 0, legs.planes
    views = (
        (legs.views[0, 0], legs.views[0, 1], legs.views[0, 2]), (legs.views[1, 0], legs.views[1, 1], legs.views[1, 2])
    )  # fmt: skip
    polygon, spare = np.empty((4 + planes.shape[0], 2)), np.empty((4 + planes.shape[0], 2))
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
        middle = on_patch(a, b, c, zero, zero, zero, um, vm, wm)  # of the flat facet
        centroids[q, 0], centroids[q, 1], centroids[q, 2] = middle
        for n in range(nodes.shape[0]):
            gains[n, q] = 0.0
        if visible[q] <= 0.0:
            continue
        routed = mirrored
        for leg in range(2):
            for depth in range(legs.slab.shape[2]):
                routed = routed or legs.slab[leg, q, depth] >= 0
        patch, bary = (a, b, c, r, s, t), ((u0, v0, w0), (u1, v1, w1), (u2, v2, w2))
        inside = clip_state(patch, bary, planes) if planes.shape[0] else 1
        if inside < 0:
            continue
        # Vector area of the face's front, turned to the radar.
        front = cross(minus(b, a), minus(c, a))
        eye = bisector(middle, views[0], views[1]) if mirrored else zero
        inward = dot(front, minus(middle, eye)) > 0.0
        if inward and single[face]:
            continue
        side = -1.0 if inward else 1.0
        top = middle if flat else on_patch(a, b, c, r, s, t, um, vm, wm)
        facing = scaled(front, side)
        ends = (
            on_patch(a, b, c, r, s, t, u0, v0, w0), on_patch(a, b, c, r, s, t, u1, v1, w1),
            on_patch(a, b, c, r, s, t, u2, v2, w2),
        )  # fmt: skip
        if not flat:  # vector area of the patch in the middle
            facing = scaled(cross(minus(ends[1], ends[0]), minus(ends[2], ends[0])), side)
        size = norm(facing)
        if size <= 0.0:
            continue
        facing = scaled(facing, 1.0 / size)
        # Pieces along an edge, by the quadratic phase in the middle of the facet's edges; the same for all nodes, so
        # that gains are smooth over band and array.
        middles = (
            on_patch(a, b, c, r, s, t, 0.5 * (u1 + u2), 0.5 * (v1 + v2), 0.5 * (w1 + w2)),
            on_patch(a, b, c, r, s, t, 0.5 * (u2 + u0), 0.5 * (v2 + v0), 0.5 * (w2 + w0)),
            on_patch(a, b, c, r, s, t, 0.5 * (u0 + u1), 0.5 * (v0 + v1), 0.5 * (w0 + w1)),
        )  # fmt: skip
        rise = 0.0
        for m in range(3):
            one = path_length(ends[(m + 1) % 3], views[0], views[1], mirrored)
            other = path_length(ends[(m + 2) % 3], views[0], views[1], mirrored)
            rise = max(rise, abs(0.5 * (one + other) - path_length(middles[m], views[0], views[1], mirrored)))
        parts = min(max(int(np.ceil(np.sqrt(rise / most_rise))), 1), MAX_PARTS)
        base, before, apart, element = 0.0, -1, False, zero
        direction, tilt = zero, zero
        for n in range(nodes.shape[0]):
            here, there = (nodes[n, 0], nodes[n, 1], nodes[n, 2]), (nodes[n, 3], nodes[n, 4], nodes[n, 5])
            wavenumber = nodes[n, 6]
            same = before >= 0
            if same:
                for m in range(6):
                    same = same and nodes[n, m] == nodes[before, m]
            if not same:
                element = bisector(top, here, there) if mirrored else scaled(plus(here, there), 0.5)
                apart = bistatic or routed
                if not apart:
                    here = there = element
                base = path_length(middle, here, there, apart)
                direction = minus(top, element)
                distance = norm(direction)
                direction = scaled(direction, 1.0 / max(distance, MIN_DISTANCE))
                cosine = -dot(direction, facing)
                tilt = zero
                if gradient.shape[0]:
                    tilt = (gradient[q, 0], gradient[q, 1], gradient[q, 2])
                if flat and mirrored:  # of cos / (R_t R_r)
                    to_tx, to_rx = minus(top, here), minus(top, there)
                    square, other = max(dot(to_tx, to_tx), MIN_DISTANCE**2), max(dot(to_rx, to_rx), MIN_DISTANCE**2)
                    tilt = plus(tilt, scaled(plus(scaled(to_tx, 1.0 / square), scaled(to_rx, 1.0 / other)), -1.5))
                    tilt = plus(tilt, scaled(facing, 0.5 / min(dot(to_tx, facing), -MIN_COSINE)))
                    tilt = plus(tilt, scaled(facing, 0.5 / min(dot(to_rx, facing), -MIN_COSINE)))
                elif flat:  # of cos / R^2
                    tilt = plus(tilt, scaled(direction, -3.0 / max(distance, MIN_DISTANCE)))
                    tilt = plus(tilt, scaled(facing, -1.0 / (max(cosine, MIN_COSINE) * max(distance, MIN_DISTANCE))))
                if parts == 1:
                    for m in range(3):
                        _store(lattice, m, ends[m])
                        path[m] = path_length(ends[m], here, there, apart) - base
                        path[3 + m] = path_length(middles[m], here, there, apart) - base
                else:
                    m = 0
                    for row in range(2 * parts + 1):
                        for column in range(2 * parts + 1 - row):
                            x, y = row / (2.0 * parts), column / (2.0 * parts)
                            z = 1.0 - x - y
                            p = on_patch(
                                a, b, c, r, s, t, z * u0 + x * u1 + y * u2, z * v0 + x * v1 + y * v2, z * w0 + x * w1 + y * w2
                            )
                            _store(lattice, m, p)
                            path[m] = path_length(p, here, there, apart) - base
                            m += 1
                if routed:  # slabs by their delay at each point; their coefficients are those in the middle
                    slabs = _slab_path(legs, q, top, here, there)
                    for m in range(3 if parts == 1 else (2 * parts + 1) * (parts + 1)):
                        point = (lattice[m, 0], lattice[m, 1], lattice[m, 2])
                        path[m] += _slab_path(legs, q, point, here, there) - slabs
                        if parts == 1:
                            path[3 + m] += _slab_path(legs, q, middles[m], here, there) - slabs
                before = n
            start, end = (nodes[n, 0], nodes[n, 1], nodes[n, 2]), (nodes[n, 3], nodes[n, 4], nodes[n, 5])
            if routed:
                strength = leg_obliquity(
                    media[n, material[face]], wavenumber, facing, top, start, end, direction, tx_field, rx_field, legs, n, q
                )
            else:
                strength = obliquity(
                    media[n, material[face]], wavenumber, facing, top, start, end, tx_field, rx_field, bistatic
                )
            total = 0j
            if inside == 0:
                total = clipped_sum(
                    patch, bary, parts, planes, polygon, spare, here, there, apart, base, wavenumber, direction, side, tilt,
                    top,
                )  # fmt: skip
            elif parts == 1:
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
