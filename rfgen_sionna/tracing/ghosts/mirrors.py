"""Search for plane mirrors in the static scene: walls, floor, ceiling, table tops."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from rfgen_sionna._types import FloatArray
from rfgen_sionna.tracing.ghosts.mirror_images import Mirror
from rfgen_sionna.tracing.surface.surfaces import Surface

FLATNESS = 1e-4
"""Largest distance of a mirror's vertices from its plane [m]: 0.3 rad of two-way phase at 77 GHz."""
MAX_FACE_ANGLE = 1e-3
"""Largest angle between neighbouring coplanar triangles [rad]; rounding tilts thin triangles by that much."""
MIN_FRESNEL_RADII = 2.0
"""Least width of a mirror, in radii of the first Fresnel zone: narrower ones diffract."""


def find_mirrors(
    surfaces: Sequence[Surface],
    vertices: Sequence[FloatArray],
    visible: NDArray[np.int64],
    viewpoint: FloatArray,
    wavelength: float,
    max_range: float,
) -> tuple[Mirror, ...]:
    """Flat parts that the radar sees and that are wide against the Fresnel zone.

    `vertices` are (vertex, 3) [m] of each static surface, `visible` the numbers of visible faces among all faces of the
    ray scene, `viewpoint` (3,), `wavelength` and the end `max_range` of the range window in [m].
    """
    least = fresnel_width(vertices, viewpoint, wavelength, max_range)
    found = []
    for surface, points in zip(surfaces, vertices, strict=True):
        numbers = visible[(visible >= surface.first_facet) & (visible < surface.first_facet + len(surface.faces))]
        if len(numbers) == 0:
            continue
        group, _ = coplanar_groups(points, surface)
        for label in np.unique(group[numbers - surface.first_facet]):
            mirror = _mirror(points, surface, np.flatnonzero(group == label), viewpoint, least)
            if mirror is not None:
                found.append(mirror)
    return tuple(found)


def fresnel_width(vertices: Sequence[FloatArray], viewpoint: FloatArray, wavelength: float, max_range: float) -> float:
    """Least width of a mirror [m]: a Fresnel zone half way along the scene's longest path, up to `max_range` [m]."""
    corners = np.concatenate([viewpoint[None], *vertices])
    reach = min(max_range, float(np.linalg.norm(np.ptp(corners, axis=0))))
    return float(MIN_FRESNEL_RADII * 0.5 * np.sqrt(wavelength * reach))


def coplanar_groups(
    points: FloatArray, surface: Surface, crease: float = np.pi
) -> tuple[NDArray[np.int32], FloatArray]:
    """(face,) connected flat part of each face, and (part,) border length [m] with a dihedral angle below `crease`
    [rad]."""
    faces, count = surface.faces, len(surface.faces)
    cross = np.cross(points[faces[:, 1]] - points[faces[:, 0]], points[faces[:, 2]] - points[faces[:, 0]])
    normal = cross / np.maximum(np.linalg.norm(cross, axis=1, keepdims=True), 1e-300)
    # Merge coinciding vertices.
    _, merged = np.unique(np.round(points * 1e6).astype(np.int64), axis=0, return_inverse=True)
    corners = merged.reshape(-1)[faces].astype(np.int64)
    edges = np.sort(np.stack([corners, np.roll(corners, -1, axis=1)], axis=2), axis=2).reshape(-1, 2)
    owner = np.repeat(np.arange(count), 3)
    key = edges[:, 0] * (int(merged.max(initial=0)) + 1) + edges[:, 1]
    order = np.argsort(key, kind="stable")
    same = np.flatnonzero(key[order][1:] == key[order][:-1])
    one, other = owner[order][same], owner[order][same + 1]
    patch = np.linalg.norm(np.cross(normal[one], normal[other]), axis=1)
    flat = patch < MAX_FACE_ANGLE
    graph = coo_matrix((np.ones(int(flat.sum())), (one[flat], other[flat])), shape=(count, count))
    group = np.asarray(connected_components(graph, directed=False)[1], dtype=np.int32)
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)[order][same]
    length = np.linalg.norm(points[ends[:, 0]] - points[ends[:, 1]], axis=1)
    # Overlapping faces of opposite orientation form no crease.
    smooth = (patch >= MAX_FACE_ANGLE) & (patch < np.sin(min(crease, 0.5 * np.pi)))
    smooth &= np.einsum("fi,fi->f", normal[one], normal[other]) > 0
    bent = np.bincount(group[one[smooth]], length[smooth], int(group.max(initial=-1)) + 1)
    bent += np.bincount(group[other[smooth]], length[smooth], len(bent))
    return group, np.asarray(bent, np.float64)


def _mirror(
    points: FloatArray, surface: Surface, faces: NDArray[np.intp], viewpoint: FloatArray, least: float
) -> Mirror | None:
    """Mirror of the `faces`; None for curved, narrow or edge-on parts."""
    corners = points[surface.faces[faces]]
    used = points[np.unique(surface.faces[faces])]
    centre = used.mean(axis=0)
    _, _, axes = np.linalg.svd(used - centre, full_matrices=False)
    normal, axes = axes[2], axes[:2]
    if np.abs((used - centre) @ normal).max() > FLATNESS:
        return None
    place = used @ axes.T
    low, high = place.min(axis=0), place.max(axis=0)
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()
    if area < least * float((high - low).max()) or float((high - low).min()) < least:
        return None
    offset = float(centre @ normal)
    height = float(viewpoint @ normal) - offset
    if abs(height) < FLATNESS:
        return None
    side = 1.0 if height > 0 else -1.0
    numbers = faces.astype(np.int64) + surface.first_facet
    return Mirror(surface.name, surface.material, numbers, side * normal, side * offset, axes, low, high)
