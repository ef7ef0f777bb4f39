"""Planar parts of surfaces: walls, boards, table tops, sides of corner reflectors. Of two planar parts on a path one is
the mirror, the other is integrated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.materials import Material
from rfgen_sionna.tracing.surface.surfaces import Surface

FLATNESS = 1e-4
"""Largest distance of a mirror's vertices from its plane [m]: 0.3 rad of two-way phase at 77 GHz."""
MAX_FACE_ANGLE = 1e-3
"""Largest angle between neighbouring coplanar triangles [rad]; rounding tilts thin triangles by that much."""
MIN_WAVELENGTHS = 1.0
"""Least width of a moving reflector [wavelengths]; smaller ones have no distinct cone."""
FRESNEL_DISTANCE = 1.0
"""A static reflector holds at least the first Fresnel zone at this distance [m]; smaller ones, such as backs of books,
show too little of a body."""
CREASE_ANGLE = np.radians(25.0)
"""Angle [rad] below which adjoining faces stand for one curved surface."""
MAX_SMOOTH_SHARE = 0.1
"""Most share of a reflector's outline that may continue in a curved surface."""
MAX_WINDOWS = 64
"""Most convex parts of an outline; more ragged parts are no reflectors."""
MAIN_SHARE = 0.9
"""Least share of an outline's area in one piece that stands for all: edges of other plates are coplanar strips."""
SIMILAR_AREA = 8.0
"""Ratio of areas up to which each of two planar parts is the mirror by half."""
DISSIMILAR_AREA = 32.0
"""Ratio of areas from which the larger one alone is the mirror; a gradual change avoids jumps."""
UNBOUNDED = 1e12
"""Area [m^2] of a part that is always the mirror."""


@dataclass(frozen=True)
class PlanarPart:
    """Faces of a surface that form a reflector, regardless of time."""

    surface: int
    """Number among all surfaces of the scene, static ones first."""
    name: str
    material: Material
    faces: NDArray[np.int64]
    """(face,) numbers among all faces of the ray scene."""
    vertices: NDArray[np.intp]
    """Vertices in use."""
    windows: tuple[NDArray[np.intp], ...]
    """Vertices of each window, in order."""
    area: float
    """[m^2]"""
    outside: NDArray[np.intp] | None
    """Corners of a face of a closed surface, whose inside reflects nothing; None for open ones."""


def find_planar_parts(
    surfaces: Sequence[Surface], vertices: Sequence[FloatArray], least: Sequence[float]
) -> tuple[PlanarPart, ...]:
    """Planar parts of the surfaces that end in edges and whose mean width is at least `least` (surface,) [m];
    `vertices` are (vertex, 3) [m] of each."""
    found = []
    for position, (surface, points, width) in enumerate(zip(surfaces, vertices, least, strict=True)):
        faces = surface.faces
        cross = np.cross(points[faces[:, 1]] - points[faces[:, 0]], points[faces[:, 2]] - points[faces[:, 0]])
        group, patches = coplanar_groups(points, surface, CREASE_ANGLE)
        area = np.bincount(group, 0.5 * np.linalg.norm(cross, axis=1))
        for label in np.flatnonzero(area > width**2):
            chosen = np.flatnonzero(group == label)
            used = np.unique(faces[chosen]).astype(np.intp)
            centre = points[used].mean(axis=0)
            _, _, axes = np.linalg.svd(points[used] - centre, full_matrices=False)
            place = (points[used] - centre) @ axes[:2].T
            extent = np.ptp(place, axis=0)
            if area[label] < width * extent.max() or np.abs((points[used] - centre) @ axes[2]).max() > FLATNESS:
                continue
            if patches[label] > MAX_SMOOTH_SHARE * 2.0 * extent.sum():
                continue
            windows = _outline_polygons(place, used, faces[chosen], float(area[label]))
            if windows:
                outside = faces[chosen[0]].astype(np.intp) if surface.closed else None
                numbers, given = chosen.astype(np.int64) + surface.first_facet, (surface.name, surface.material)
                found.append(PlanarPart(position, *given, numbers, used, windows, float(area[label]), outside))
    return tuple(found)


def face_owners(planar_parts: Sequence[PlanarPart], surfaces: Sequence[Surface]) -> IntArray:
    """(face,) number of the planar part of each face of the `surfaces`, -1 for none."""
    owner = np.full(sum(len(each.faces) for each in surfaces), -1, np.int32)
    for number, part in enumerate(planar_parts):
        owner[part.faces] = number
    return owner


def min_widths(static: int, moving: int, wavelength: float) -> list[float]:
    """Least widths [m] for :func:`find_planar_parts` of so many static and moving surfaces."""
    return [2.0 * float(np.sqrt(wavelength * FRESNEL_DISTANCE))] * static + [MIN_WAVELENGTHS * wavelength] * moving


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


def _outline_polygons(
    place: FloatArray, used: NDArray[np.intp], faces: IntArray, area: float
) -> tuple[NDArray[np.intp], ...]:
    """The hull of the outline, or of the piece that is nearly all of it, where it has that area; else the outline's
    triangles; none where they are too many."""
    from scipy.spatial import ConvexHull

    corners = np.searchsorted(used, faces)
    ends = np.concatenate([corners[:, :2], corners[:, 1:]])
    graph = coo_matrix((np.ones(len(ends)), ends.T), shape=(len(used), len(used)))
    piece = np.asarray(connected_components(graph, directed=False)[1])
    for chosen in (np.arange(len(used)), np.flatnonzero(piece == np.bincount(piece[corners[:, 0]]).argmax())):
        if len(chosen) > 2:
            hull = ConvexHull(place[chosen])
            # Of a flat hull `volume` is the area.
            if MAIN_SHARE * area < hull.volume < area * (1.0 + 1e-6):
                return (used[chosen[hull.vertices]],)
    return tuple(np.asarray(each, np.intp) for each in faces) if len(faces) <= MAX_WINDOWS else ()


def mirror_weight(mirror: FloatArray, integrated: FloatArray) -> FloatArray:
    """(...,) weight of paths with a mirror of area `mirror` and an integrated part of area `integrated` (...,) [m^2];
    it adds to 1 with the roles swapped."""
    ratio = np.log(mirror) - np.log(integrated)
    return np.asarray(
        np.interp(
            ratio, np.log([1 / DISSIMILAR_AREA, 1 / SIMILAR_AREA, SIMILAR_AREA, DISSIMILAR_AREA]), [0.0, 0.5, 0.5, 1.0]
        )
    )
