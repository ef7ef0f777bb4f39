"""Cells of large flat faces that the radar sees whole.

A face is bisected along its longest edges, as by :mod:`rfgen_sionna.tracing.surface.tessellate`, until each triangle is
wholly visible, wholly hidden, or small.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.tracing.surface.surfaces import Surface

MIN_FACETS, MAX_FACETS = 8.0, 512.0
"""Facets in place of a cell, about: fewer are facets, and more are cut, so that an actor's shadow takes few facets."""
FRESNEL_ZONE = 40.0
"""Phase k rho^2 / h [rad] around the foot point within which facets are integrated."""
COPLANAR = 1e-4
"""Distance [m] up to which a face lies in the plane of another."""
TOUCHING = 1e-7
"""Angle [rad] up to which faces that overlap only touch."""
_MAX_DEPTH = 64
_LENGTH_TOLERANCE = 1e-9


class FlatCells(NamedTuple):
    """Triangles of faces: pieces that are wholly visible, and small ones that may not be."""

    face: IntArray
    """(triangle,) index of the face."""
    weights: FloatArray
    """(triangle, corner, vertex) barycentric coordinates of the corners."""
    corners: FloatArray
    """(triangle, 3, 3) [m] relative to the viewpoint."""
    visible: NDArray[np.bool_]
    """(triangle,) whether it is a wholly visible cell."""

    def take(self, index: NDArray[np.intp]) -> FlatCells:
        """Those of an `index` (triangle,)."""
        return FlatCells(self.face[index], self.weights[index], self.corners[index], self.visible[index])


def is_divided(surface: Surface) -> bool:
    """Whether a surface has cells: flat, and without diffuse returns, which facets have."""
    return surface.smooth is None and not surface.material.scattering_coefficient


def find_cells(
    corners: FloatArray, chosen: NDArray[np.intp], wavenumber: float, swing: float, max_range: float, nearest: float,
    reach: float,
) -> FlatCells:  # fmt: skip
    """Cells of the `chosen` ones of all faces at rest with `corners` (face, 3, 3) [m] relative to the viewpoint.

    `swing` is the phase per distance over half the band that a facet may have [1/m], `nearest` [m] the distance below
    which Tx and Rx count apart, `reach` [m] that of the elements from the viewpoint.
    """
    size = 1024
    while True:
        face, weights = np.empty(size, np.int32), np.empty((size, 3, 3))
        places, visible = np.empty((size, 3, 3)), np.empty(size, np.bool_)
        given = corners, chosen, wavenumber, swing, max_range, nearest, reach
        count = _divide(*given, face, weights, places, visible)
        if count <= size:
            return FlatCells(face[:count], weights[:count], places[:count], visible[:count])
        size = count


@njit(cache=True, error_model="numpy")
def _cross(a: Any, b: Any, found: Any) -> None:
    found[0], found[1], found[2] = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(cache=True, error_model="numpy")
def _set_cone(corners: Any, count: int, directions: Any, planes: Any) -> None:
    """Unit vectors into `directions` (corner, 3) of the `count` corners of a convex polygon, and unit normals into
    `planes` (corner, 3) of the planes through the viewpoint and each edge, inwards; degenerate planes are zero."""
    x, y, z = 0.0, 0.0, 0.0
    for i in range(count):
        size = max(np.sqrt(corners[i, 0] ** 2 + corners[i, 1] ** 2 + corners[i, 2] ** 2), 1e-12)
        for k in range(3):
            directions[i, k] = corners[i, k] / size
        x, y, z = x + directions[i, 0], y + directions[i, 1], z + directions[i, 2]
    for i in range(count):
        _cross(directions[i], directions[(i + 1) % count], planes[i])
        size = np.sqrt(planes[i, 0] ** 2 + planes[i, 1] ** 2 + planes[i, 2] ** 2)
        side = planes[i, 0] * x + planes[i, 1] * y + planes[i, 2] * z
        scale = (1.0 if side >= 0.0 else -1.0) / size if size > 1e-12 else 0.0
        for k in range(3):
            planes[i, k] *= scale


@njit(cache=True, error_model="numpy")
def _least(plane: Any, directions: Any, count: int) -> float:
    """Smallest distance of `count` directions to a `plane` (3,) through the viewpoint."""
    least = np.inf
    for j in range(count):
        least = min(least, plane[0] * directions[j, 0] + plane[1] * directions[j, 1] + plane[2] * directions[j, 2])
    return least


@njit(cache=True, error_model="numpy")
def _most(plane: Any, directions: Any, count: int) -> float:
    """Largest distance of `count` directions to a `plane` (3,) through the viewpoint."""
    most = -np.inf
    for j in range(count):
        most = max(most, plane[0] * directions[j, 0] + plane[1] * directions[j, 1] + plane[2] * directions[j, 2])
    return most


@njit(cache=True, error_model="numpy")
def _apart(planes: Any, own: Any, count: int, other: Any, others: int) -> bool:
    """Whether one of the `planes` of the polygon `own` has the polygon `other` on its other side."""
    for i in range(count):
        if planes[i, 0] == 0.0 and planes[i, 1] == 0.0 and planes[i, 2] == 0.0:
            continue
        if _most(planes[i], other, others) <= TOUCHING:
            return True
        # A face seen edge-on has two outer sides.
        if _most(planes[i], own, count) <= TOUCHING and _least(planes[i], other, others) >= -TOUCHING:
            return True
    return False


@njit(cache=True, error_model="numpy")
def _clip(corners: Any, away: Any, found: Any) -> int:
    """Part of a triangle with corners at the distances `away` (3,) of a plane, at distances above 0; returns its number
    of corners."""
    count = 0
    for i in range(3):
        n = (i + 1) % 3
        if away[i] >= 0.0:
            found[count] = corners[i]
            count += 1
        if (away[i] >= 0.0) != (away[n] >= 0.0):
            share = away[i] / (away[i] - away[n])
            found[count] = corners[i] + share * (corners[n] - corners[i])
            count += 1
    return count


@njit(cache=True, error_model="numpy")
def _to_triangle(p: Any, corners: Any, normal: Any) -> float:
    """Distance of the point `p` (3,) of their plane to a triangle."""
    left, right, least = True, True, np.inf
    edge, across, offset = np.empty(3), np.empty(3), np.empty(3)
    for i in range(3):
        a, b = corners[i], corners[(i + 1) % 3]
        for k in range(3):
            edge[k], offset[k] = b[k] - a[k], p[k] - a[k]
        _cross(normal, edge, across)
        side = across[0] * offset[0] + across[1] * offset[1] + across[2] * offset[2]
        left, right = left and side >= 0.0, right and side <= 0.0
        square = edge[0] ** 2 + edge[1] ** 2 + edge[2] ** 2
        t = (edge[0] * offset[0] + edge[1] * offset[1] + edge[2] * offset[2]) / max(square, 1e-30)
        t = min(max(t, 0.0), 1.0)
        away = 0.0
        for k in range(3):
            away += (offset[k] - t * edge[k]) ** 2
        least = min(least, away)
    return 0.0 if left or right else np.sqrt(least)


@njit(cache=True, error_model="numpy")
def _occluders(faces: Any, f: int, normal: Any, cones: Any, found: Any, before: Any, changed: Any) -> int:
    """Indices into `found` of the faces that reach before the plane of face `f`, or lie in it; returns their number.
    `normal` (3,) is towards the viewpoint. `before` (face,) becomes whether one is before the plane. Cones (directions,
    planes, corner counts) become those of the part before the plane, and `changed` (face,) says where."""
    directions, planes, counts = cones
    away, polygon = np.empty(3), np.empty((4, 3))
    n = 0
    for g in range(faces.shape[0]):
        if g == f:
            continue
        for i in range(3):
            away[i] = (
                normal[0] * (faces[g, i, 0] - faces[f, 0, 0])
                + normal[1] * (faces[g, i, 1] - faces[f, 0, 1])
                + normal[2] * (faces[g, i, 2] - faces[f, 0, 2])
            )
        most, least = max(away[0], away[1], away[2]), min(away[0], away[1], away[2])
        before[g] = most > COPLANAR
        if most <= COPLANAR and least < -COPLANAR:
            continue
        if changed[g]:
            counts[g] = 3
            _set_cone(faces[g], 3, directions[g], planes[g])
            changed[g] = False
        if before[g] and least < 0.0:
            counts[g] = _clip(faces[g], away, polygon)
            _set_cone(polygon, counts[g], directions[g], planes[g])
            changed[g] = True
        found[n] = g
        n += 1
    return n


@njit(cache=True, nogil=True, error_model="numpy")
def _divide(
    faces: Any, chosen: Any, wavenumber: float, swing: float, max_range: float, nearest: float, reach: float, face: Any,
    weights: Any, places: Any, visible: Any,
) -> int:  # fmt: skip
    """Kernel of :func:`find_cells`; returns the number of triangles, of which those that fit are written."""
    total, count = faces.shape[0], 0
    cones = np.empty((total, 4, 3)), np.empty((total, 4, 3)), np.full(total, 3)
    directions, planes, counts = cones
    for g in range(total):
        _set_cone(faces[g], 3, directions[g], planes[g])
    before, changed = np.zeros(total, np.bool_), np.zeros(total, np.bool_)
    lists, used = np.empty((_MAX_DEPTH + 1, total), np.int32), np.zeros(_MAX_DEPTH + 1, np.int64)
    stack = np.empty((_MAX_DEPTH + 2, 2, 3, 3))
    depths = np.empty(_MAX_DEPTH + 2, np.int64)
    normal, first, second, middle, foot = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    unit, own, sides = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    for q in range(chosen.shape[0]):
        f = chosen[q]
        for k in range(3):
            first[k], second[k] = faces[f, 1, k] - faces[f, 0, k], faces[f, 2, k] - faces[f, 0, k]
        _cross(first, second, normal)
        size = np.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2)
        if size <= 0.0:
            continue
        height = -(normal[0] * faces[f, 0, 0] + normal[1] * faces[f, 0, 1] + normal[2] * faces[f, 0, 2]) / size
        size = size if height >= 0.0 else -size
        height = abs(height)
        for k in range(3):
            normal[k] /= size
            foot[k] = -height * normal[k]
        zone = max(np.sqrt(FRESNEL_ZONE * height / wavenumber), 4.0 * reach)
        used[0] = -1  # occluders are looked for when they matter
        top, depths[0] = 1, 1
        for i in range(3):
            for k in range(3):
                stack[0, 0, i, k] = faces[f, i, k]
                stack[0, 1, i, k] = 1.0 if i == k else 0.0
        while top > 0:
            top -= 1
            depth = depths[top]
            corners, shares = stack[top, 0].copy(), stack[top, 1].copy()
            for k in range(3):
                middle[k] = (corners[0, k] + corners[1, k] + corners[2, k]) / 3.0
            centre = np.sqrt(middle[0] ** 2 + middle[1] ** 2 + middle[2] ** 2)
            radius, near, far, mean = 0.0, np.inf, 0.0, 0.0
            for i in range(3):
                away, apart = 0.0, 0.0
                for k in range(3):
                    away += corners[i, k] ** 2
                    apart += (corners[i, k] - middle[k]) ** 2
                away = np.sqrt(away)
                radius, near, far = max(radius, np.sqrt(apart)), min(near, away), max(far, away)
                mean += away / 3.0
            if centre - radius >= max_range:
                continue
            ratio = swing * (far - min(near, centre))
            facets = max(2.0 * wavenumber * abs(mean - centre), ratio * ratio)
            small = facets <= MIN_FACETS and depth == 1
            mixed = centre + radius >= max_range or height < 1e-6
            hidden = False
            if not small:
                if used[0] < 0:
                    used[0] = _occluders(faces, f, normal, cones, lists[0], before, changed)
                n = 0
                _set_cone(corners, 3, unit, own)
                for m in range(used[depth - 1]):
                    g = lists[depth - 1, m]
                    if _apart(own, unit, 3, directions[g], counts[g]) or _apart(
                        planes[g], directions[g], counts[g], unit, 3
                    ):
                        continue
                    lists[depth, n] = g
                    n += 1
                    if before[g]:
                        inside = True
                        for i in range(counts[g]):
                            inside = inside and _least(planes[g, i], unit, 3) >= TOUCHING
                        if inside:
                            hidden = True
                            break
                used[depth] = n
                mixed = mixed or n > 0
            if hidden:
                continue
            if not mixed and not small:
                away = _to_triangle(foot, corners, normal)
                mixed = away < zone or away * away + height * height < nearest * nearest
            whole = not mixed and not small and MIN_FACETS <= facets <= MAX_FACETS
            if whole or small or depth >= _MAX_DEPTH or facets <= (1.5 if mixed else MIN_FACETS):
                if count < face.shape[0]:
                    face[count], visible[count] = f, whole
                    for i in range(3):
                        for k in range(3):
                            weights[count, i, k], places[count, i, k] = shares[i, k], corners[i, k]
                count += 1
                continue
            # Bisect the longest edge, opposite corner e.
            longest = 0.0
            for i in range(3):
                sides[i] = 0.0
                for k in range(3):
                    sides[i] += (corners[(i + 1) % 3, k] - corners[(i + 2) % 3, k]) ** 2
                sides[i] = np.sqrt(sides[i])
                longest = max(longest, sides[i])
            e = 0
            for i in range(3):
                if sides[i] >= (1.0 - _LENGTH_TOLERANCE) * longest:
                    e = i
            left, right = (e + 1) % 3, (e + 2) % 3
            for part in range(2):
                for m in range(2):
                    source = corners if m == 0 else shares
                    for k in range(3):
                        between = 0.5 * (source[left, k] + source[right, k])
                        stack[top, m, 0, k] = source[e, k]
                        stack[top, m, 1, k] = source[left, k] if part == 0 else between
                        stack[top, m, 2, k] = between if part == 0 else source[right, k]
                depths[top] = depth + 1
                top += 1
    return count
