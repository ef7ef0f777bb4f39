"""Physical optics of quadratic patches, one facet after the other.

With the Tx element at distance R_t, the Rx element at R_r and k = 2 pi f / c the gain of a facet is

    a = (j / 4 pi) F A / (R_t R_r) <exp(-j k (R_t + R_r))>

A is the area, <.> the mean over the facet, and F the obliquity (:mod:`rfgen_sionna.tracing.integral.fresnel`). At
normal incidence on metal F = -1: an infinite mirror at distance d has the image-theory gain -lambda / (4 pi 2 d)
exp(-j 2 k d).

The middle of an edge between corners with normals n_i, n_k is displaced by a circle's sagitta, a facet by the
quadratic of its three edges (:mod:`rfgen_sionna.tracing.surface.smoothing`). A facet is divided until the quadratic
part of the phase on each piece is small (:func:`rfgen_sionna.tracing.integral.phasor_moments.mean_phasor`).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from rfgen_sionna.tracing.integral.fresnel import cross, dot, minus, norm, obliquity, plus, scaled, unit
from rfgen_sionna.tracing.integral.leg_fields import leg_obliquity, slab_length
from rfgen_sionna.tracing.integral.patch_geometry import (
    MIN_DISTANCE,
    area_element,
    bisector,
    clip_state,
    on_patch,
    path_length,
    visible_triangles,
    within,
)
from rfgen_sionna.tracing.integral.phasor_moments import FAST, mean_phasor

MAX_PARTS = 8
"""Largest number of pieces along an edge."""
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
def _slab_path(legs: Any, q: int, point: Any, t: Any, r: Any) -> float:
    """Delay [m] of the slabs on both legs between a `point` of facet `q` and the images `t` and `r` of the elements."""
    return slab_length(legs, 0, q, unit(minus(point, t))) + slab_length(legs, 1, q, unit(minus(r, point)))


@njit(fastmath=FAST, error_model="numpy")
def _facing_area(area: Any, point: Any, here: Any, there: Any) -> float:
    """Vector `area` at a `point`, projected to half way between the directions to `here` and `there` (not divided by
    the length of their mean), over the product of the distances."""
    to, fro = minus(point, here), minus(point, there)
    one, other = max(norm(to), MIN_DISTANCE), max(norm(fro), MIN_DISTANCE)
    return (dot(area, to) / one + dot(area, fro) / other) / (one * other)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def patch_gains(
    points: Any, faces: Any, group: Any, normals: Any, face_of: Any, weights: Any, chosen: Any, visible: Any,
    cut_of: Any, cuts: Any, cut_count: Any, material: Any, single: Any, nodes: Any, fields: Any, media: Any, bistatic:
    bool, most_sagitta: float, most_turn: float, gradient: Any, legs: Any, gains: Any, centroids: Any,
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
    cut_of, cuts, cut_count
        (chosen,) index of the cut of each facet, -1 without one, (cut, 2, 3, 3) barycentric coordinates of the visible
        triangles in the facet, and (cut,) their number.
    material, single
        (face,) index of the material, and whether only the front of the face returns.
    nodes, fields
        (node, 7) Tx and Rx position [m] relative to the viewpoint and wavenumber [rad/m], nodes of one pair in turn;
        (2, 3) electric field of Tx and Rx.
    media
        (node, material, 7) of :func:`rfgen_sionna.tracing.integral.fresnel.media_table`.
    bistatic
        Whether the obliquity is that of separate elements; else that of an element half way.
    most_sagitta
        Largest quadratic phase [rad] in the middle of an edge of a piece.
    most_turn
        Largest turn of the normal against the line of sight over a piece [rad]; the obliquity is linear on each piece.
        0 takes that of the middle for the whole facet.
    gradient
        (chosen, 3) gradient of the logarithm of the pattern gain [1/m]; empty means none.
    legs
        :class:`rfgen_sionna.tracing.integral.leg_fields.LegTables` of both legs: `nodes` and `fields` are then those of
        images. Facets are clipped to its `planes`.
    """
    path, weight, strengths = np.empty(_POINTS), np.empty(_POINTS), np.empty(_POINTS, np.complex128)
    mirrored, planes = legs.mirrors[0] + legs.mirrors[1] > 0, legs.planes
    views = (
        (legs.views[0, 0], legs.views[0, 1], legs.views[0, 2]), (legs.views[1, 0], legs.views[1, 1], legs.views[1, 2])
    )  # fmt: skip
    most = 2 * (planes.shape[0] + 1)
    triangles, polygon, spare = np.empty((most, 3, 3)), np.empty((most + 2, 2)), np.empty((most + 2, 2))
    tx_field, rx_field = (fields[0, 0], fields[0, 1], fields[0, 2]), (fields[1, 0], fields[1, 1], fields[1, 2])
    zero, tilt = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for q in range(chosen.shape[0]):
        f = chosen[q]
        face = face_of[f]
        i, j, k = faces[face, 0], faces[face, 1], faces[face, 2]
        a, b, c = (
            (points[i, 0], points[i, 1], points[i, 2]), (points[j, 0], points[j, 1], points[j, 2]),
            (points[k, 0], points[k, 1], points[k, 2]),
        )  # fmt: skip
        g, h, o = group[face, 0], group[face, 1], group[face, 2]
        r, s, t = (
            _edge_sagitta(normals, h, o, minus(c, b)), _edge_sagitta(normals, o, g, minus(a, c)),
            _edge_sagitta(normals, g, h, minus(b, a)),
        )  # fmt: skip
        # Barycentric coordinates of the facet's corners in its face, and its share of the face.
        one, two, three = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
        share = 1.0
        if weights.shape[0]:
            one = (weights[f, 0, 0], weights[f, 0, 1], weights[f, 0, 2])
            two = (weights[f, 1, 0], weights[f, 1, 1], weights[f, 1, 2])
            three = (weights[f, 2, 0], weights[f, 2, 1], weights[f, 2, 2])
            share = abs(dot(one, cross(two, three)))
        whole = (one, two, three)
        centre = scaled(plus(plus(one, two), three), 1.0 / 3.0)
        middle = on_patch(a, b, c, zero, zero, zero, centre)  # of the flat facet
        centroids[q, 0], centroids[q, 1], centroids[q, 2] = middle
        for n in range(nodes.shape[0]):
            gains[n, q] = 0.0
        if visible[q] <= 0.0:
            continue
        inside = clip_state((a, b, c, r, s, t), whole, planes) if planes.shape[0] else 1
        if inside < 0:
            continue
        routed = mirrored
        for leg in range(2):
            for depth in range(legs.slab.shape[2]):
                routed = routed or legs.slab[leg, q, depth] >= 0
        eye = bisector(middle, views[0], views[1]) if mirrored else zero
        inward = dot(cross(minus(b, a), minus(c, a)), minus(middle, eye)) > 0.0
        if inward and single[face]:
            continue
        side = -1.0 if inward else 1.0
        element, distance, base, apart = zero, 1.0, 0.0, bistatic
        top, facing = on_patch(a, b, c, r, s, t, centre), scaled(area_element(a, b, c, r, s, t, centre), side)
        size = norm(facing)
        if size <= 0.0:
            continue
        facing = scaled(facing, 1.0 / size)
        if gradient.shape[0]:
            tilt = (gradient[q, 0], gradient[q, 1], gradient[q, 2])
        # Shadow weight: the visible fraction of the facet, or its visible pieces.
        cut = cut_of[q]
        # Turn of the normal and of the line of sight over the facet.
        turn = 0.0
        if most_turn > 0.0:
            first, last = on_patch(a, b, c, r, s, t, one), area_element(a, b, c, r, s, t, one)
            for corner in (two, three):
                bend = minus(unit(area_element(a, b, c, r, s, t, corner)), unit(last))
                across = minus(on_patch(a, b, c, r, s, t, corner), first)
                turn = max(turn, norm(bend) + norm(across) / norm(minus(middle, eye)))
        pieces, factor = 1, 0.5j / (4.0 * np.pi) * visible[q]
        if cut >= 0 or inside == 0:
            if cut >= 0:
                factor = 0.5j / (4.0 * np.pi)
            pieces = visible_triangles(
                (a, b, c, r, s, t), whole, cut, cuts, cut_count, planes, polygon, spare, triangles
            )
        for piece in range(pieces):
            if cut >= 0 or inside == 0:
                one, two, three = within(triangles, piece, 0, whole), within(triangles, piece, 1, whole), within(
                    triangles, piece, 2, whole)  # fmt: skip
                share = abs(dot(one, cross(two, three)))
            parts, before = 1, -1
            for n in range(nodes.shape[0]):
                here, there = (nodes[n, 0], nodes[n, 1], nodes[n, 2]), (nodes[n, 3], nodes[n, 4], nodes[n, 5])
                wavenumber = nodes[n, 6]
                same = before >= 0
                if same:
                    for m in range(6):
                        same = same and nodes[n, m] == nodes[before, m]
                if not same:
                    before = n
                    apart = bistatic or routed
                    element = bisector(top, here, there) if mirrored else scaled(plus(here, there), 0.5)
                    if not apart:
                        here = there = element
                    base = path_length(middle, here, there, apart)
                    distance = max(norm(minus(top, element)), MIN_DISTANCE)
                    spread = distance * distance
                    if mirrored:
                        spread = norm(minus(top, here)) * norm(minus(top, there))
                        spread = spread / max(norm(plus(unit(minus(top, here)), unit(minus(top, there)))), MIN_DISTANCE)
                    slabs = _slab_path(legs, q, top, here, there) if routed else 0.0
                    parts = 1
                    own = most_turn > 0.0 and not routed
                    for attempt in range(2):
                        m, scale = 0, -side * share * spread / parts**2
                        for row in range(2 * parts + 1):
                            for column in range(2 * parts + 1 - row):
                                x, y = 0.5 * row / parts, 0.5 * column / parts
                                place = plus(plus(scaled(one, 1.0 - x - y), scaled(two, x)), scaled(three, y))
                                point = on_patch(a, b, c, r, s, t, place)
                                path[m] = path_length(point, here, there, apart) - base
                                if routed:  # slabs by their delay at each point, with the coefficients of the middle
                                    path[m] += _slab_path(legs, q, point, here, there) - slabs
                                if row % 2 == 0 and column % 2 == 0:
                                    # Projected area over the squared distance, relative to that of the middle.
                                    area = area_element(a, b, c, r, s, t, place)
                                    if mirrored:
                                        projected = _facing_area(area, point, here, there)
                                    else:
                                        offset = minus(point, element)
                                        projected = dot(area, offset) / max(norm(offset), MIN_DISTANCE) ** 3
                                    weight[m] = max(scale * projected, 0.0) * (1.0 + dot(tilt, minus(point, top)))
                                m += 1
                        if attempt == 0:
                            # Pieces along an edge, by the quadratic phase in the middle of the facet's edges.
                            rise = max(
                                abs(0.5 * (path[0] + path[2]) - path[1]), abs(0.5 * (path[0] + path[5]) - path[3]),
                                abs(0.5 * (path[2] + path[5]) - path[4]),
                            )  # fmt: skip
                            parts = int(np.ceil(np.sqrt(wavenumber * rise / most_sagitta)))
                            if most_turn > 0.0:
                                parts = max(parts, int(np.ceil(turn / most_turn)))
                            parts = min(max(parts, 1), MAX_PARTS)
                            if parts == 1:
                                break
                strength = 1.0 + 0j
                if routed:
                    strength = leg_obliquity(
                        media[n, material[face]], wavenumber, facing, top, (nodes[n, 0], nodes[n, 1], nodes[n, 2]),
                        (nodes[n, 3], nodes[n, 4], nodes[n, 5]), unit(minus(top, element)), tx_field, rx_field, legs,
                        n, q,
                    )  # fmt: skip
                elif not own:
                    strength = obliquity(
                        media[n, material[face]], wavenumber, facing, top, (nodes[n, 0], nodes[n, 1], nodes[n, 2]),
                        (nodes[n, 3], nodes[n, 4], nodes[n, 5]), tx_field, rx_field, bistatic,
                    )  # fmt: skip
                if own:  # at the corners, at the distance of the facet's middle
                    for row in range(parts + 1):
                        for column in range(parts + 1 - row):
                            x, y, m = row / parts, column / parts, _place(2 * parts, 2 * row, 2 * column)
                            place = plus(plus(scaled(one, 1.0 - x - y), scaled(two, x)), scaled(three, y))
                            offset = minus(on_patch(a, b, c, r, s, t, place), element)
                            strengths[m] = weight[m] * obliquity(
                                media[n, material[face]], wavenumber,
                                unit(scaled(area_element(a, b, c, r, s, t, place), side)),
                                plus(element, scaled(offset, distance / max(norm(offset), MIN_DISTANCE))),
                                (nodes[n, 0], nodes[n, 1], nodes[n, 2]), (nodes[n, 3], nodes[n, 4], nodes[n, 5]),
                                tx_field, rx_field, bistatic,
                            )  # fmt: skip
                total = 0j
                double = 2 * parts
                for row in range(0, double, 2):
                    for column in range(0, double - row, 2):
                        for turned in range(2):
                            if turned and column == double - row - 2:
                                continue
                            # Corners and edge middles on the lattice of half steps.
                            x0, y0, x1, y1, x2, y2 = row, column, row + 2, column, row, column + 2
                            if turned:
                                x0, y0, x1, y1 = row + 2, column, row + 2, column + 2
                            i0, i1, i2 = _place(double, x0, y0), _place(double, x1, y1), _place(double, x2, y2)
                            if weight[i0] + weight[i1] + weight[i2] <= 0.0:
                                continue
                            m0 = _place(double, (x1 + x2) // 2, (y1 + y2) // 2)
                            m1 = _place(double, (x2 + x0) // 2, (y2 + y0) // 2)
                            m2 = _place(double, (x0 + x1) // 2, (y0 + y1) // 2)
                            if own:
                                total += mean_phasor(
                                    wavenumber * path[i0], wavenumber * path[i1], wavenumber * path[i2],
                                    strengths[i0], strengths[i1], strengths[i2],
                                    wavenumber * (0.5 * (path[i1] + path[i2]) - path[m0]),
                                    wavenumber * (0.5 * (path[i2] + path[i0]) - path[m1]),
                                    wavenumber * (0.5 * (path[i0] + path[i1]) - path[m2]),
                                )  # fmt: skip
                                continue
                            total += mean_phasor(
                                wavenumber * path[i0], wavenumber * path[i1], wavenumber * path[i2],
                                weight[i0], weight[i1], weight[i2],
                                wavenumber * (0.5 * (path[i1] + path[i2]) - path[m0]),
                                wavenumber * (0.5 * (path[i2] + path[i0]) - path[m1]),
                                wavenumber * (0.5 * (path[i0] + path[i1]) - path[m2]),
                            )  # fmt: skip
                gains[n, q] += factor * strength * total


@njit(fastmath=FAST, error_model="numpy")
def _place(double: int, row: int, column: int) -> int:
    """Index of a lattice point in its row; row k holds `double` + 1 - k points."""
    return row * (double + 1) - row * (row - 1) // 2 + column
