"""Planar parts of any surface as reflectors: sides of corner reflectors, boards, table tops, walls.

A reflector shows the points inside its cone, from the radar's image through the outline. Outlines are kept as convex
windows, so that facets are clipped to the cone exactly (:mod:`rfgen_sionna.tracing.surface.clip`). Of two planar parts
on a path one is the mirror, the other is integrated.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.materials import Material
from rfgen_sionna.tracing.ghosts.mirror_images import Mirror
from rfgen_sionna.tracing.ghosts.mirrors import FLATNESS, coplanar_groups, fresnel_width
from rfgen_sionna.tracing.reflectors.clipped_footprints import DIRECT
from rfgen_sionna.tracing.surface.surfaces import Surface

MIN_WAVELENGTHS = 1.0
"""Least width of a moving reflector [wavelengths]; smaller ones have no distinct cone."""
FRESNEL_DISTANCE = 1.0
"""A static reflector holds at least the first Fresnel zone at this distance [m]; smaller ones, such as backs of books,
show too little of a body."""
CREASE_ANGLE = np.radians(25.0)
"""Angle [rad] below which adjoining faces stand for one curved surface."""
MAX_SMOOTH_SHARE = 0.1
"""Most share of a reflector's outline that may continue in a curved surface."""
WELD_DISTANCE = 1e-4
"""Distance below which corners of reflectors coincide [m]."""
MAX_WINDOWS = 64
"""Most convex parts of an outline; more ragged parts are no reflectors."""


@dataclass(frozen=True, eq=False)
class PlanarReflector(Mirror):
    """A mirror at one time, with its outline."""

    windows: tuple[FloatArray, ...]
    """Convex polygons (corner, 3) [m] of the outline."""

    def shadow(self, viewpoint: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
        """Half-spaces (side, 3), (side,) of each window: n . (x - viewpoint) >= offset for all points x that it shows.
        The sides of the cone from the image of `viewpoint` (3,) [m], and the reflector itself."""
        height = float(self.height(viewpoint))
        image = -2.0 * height * self.normal
        found = []
        for window in self.windows:
            corners = window - viewpoint - image
            normals = np.cross(corners, np.roll(corners, -1, axis=0))
            normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
            inside = np.sign(normals @ corners.mean(axis=0)).sum()
            normals *= 1.0 if inside > 0 else -1.0
            sides = np.concatenate([normals, self.normal[None]])
            found.append((sides, np.append(normals @ image, -height)))
        return found


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

    def at(self, points: FloatArray, viewpoint: FloatArray) -> PlanarReflector | None:
        """The reflector with the surface's vertices at `points` (vertex, 3) [m]; None where it is bent, seen edge on,
        or from the inside of a closed surface."""
        used, centre, axes, normal = self._plane(points)
        if np.abs((used - centre) @ normal).max() > FLATNESS:
            return None
        height = float((viewpoint - centre) @ normal)
        if abs(height) < FLATNESS:
            return None
        if self.outside is not None:
            a, b, c = points[self.outside]
            if np.cross(b - a, c - a) @ (viewpoint - a) <= 0:
                return None
        normal = normal if height > 0 else -normal
        place = used @ axes.T
        return PlanarReflector(
            self.name, self.material, self.faces, normal, float(centre @ normal), axes, place.min(axis=0),
            place.max(axis=0), tuple(points[each] for each in self.windows),
        )  # fmt: skip

    def triangles(self, points: FloatArray) -> FloatArray:
        """(triangle, 3, 3) [m] of its windows, with the surface's vertices at `points` (vertex, 3) [m]."""
        fans = [np.stack([np.broadcast_to(w[0], len(w) - 2), w[1:-1], w[2:]], axis=1) for w in self.windows]
        return np.asarray(points[np.concatenate(fans)])

    def image(self, points: FloatArray, of: FloatArray) -> FloatArray:
        """Images (point, 3) of points `of` [m] in its plane, from either side, with the surface's vertices at `points`
        (vertex, 3) [m]."""
        _, centre, _, normal = self._plane(points)
        return np.asarray(of - 2.0 * ((of - centre) @ normal)[:, None] * normal)

    def _plane(self, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Its vertices (vertex, 3), their mean (3,), axes (2, 3) of its plane and the normal (3,)."""
        used = points[self.vertices]
        centre = used.mean(axis=0)
        _, _, axes = np.linalg.svd(used - centre, full_matrices=False)
        return used, centre, axes[:2], axes[2]


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


def adjacent_parts(planar_parts: Sequence[PlanarPart], points: Sequence[FloatArray]) -> list[set[int]]:
    """(part,) other parts with at least two common corners."""
    at: dict[tuple[int, ...], list[int]] = defaultdict(list)
    for number, flat in enumerate(planar_parts):
        for place in {
            tuple(each) for each in np.rint(points[flat.surface][flat.vertices] / WELD_DISTANCE).astype(int).tolist()
        }:
            at[place].append(number)
    shared = Counter(pair for each in at.values() for pair in permutations(each, 2))
    found: list[set[int]] = [set() for _ in planar_parts]
    for (one, other), count in shared.items():
        if count > 1:
            found[one].add(other)
    return found


def wide_reflectors(
    planar_parts: Sequence[PlanarPart],
    reflectors: Sequence[PlanarReflector | None],
    points: Sequence[FloatArray],
    viewpoint: FloatArray,
    wavelength: float,
    max_range: float,
) -> list[int]:
    """Numbers of the `reflectors` that are wide against the Fresnel zone half way through a scene of vertices `points`
    (vertex, 3) [m] of each surface."""
    least = fresnel_width(points, viewpoint, wavelength, max_range)
    return [
        number
        for number, (flat, reflector) in enumerate(zip(planar_parts, reflectors, strict=True))
        if reflector is not None
        and float((reflector.high - reflector.low).min()) >= least
        and flat.area >= least * float((reflector.high - reflector.low).max())
    ]


def _outline_polygons(
    place: FloatArray, used: NDArray[np.intp], faces: IntArray, area: float
) -> tuple[NDArray[np.intp], ...]:
    """The outline's hull where that is all of it, else its triangles; none where they are too many."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(place)
    if hull.volume < area * (1.0 + 1e-6):  # of a flat hull `volume` is the area
        return (used[hull.vertices],)
    return tuple(np.asarray(each, np.intp) for each in faces) if len(faces) <= MAX_WINDOWS else ()


SIMILAR_AREA = 8.0
"""Ratio of areas up to which each of two planar parts is the mirror by half."""
DISSIMILAR_AREA = 32.0
"""Ratio of areas from which the larger one alone is the mirror; a gradual change avoids jumps."""
UNBOUNDED = 1e12
"""Area [m^2] of a part that is always the mirror."""


def mirror_weights(
    area: FloatArray, own: NDArray[np.integer], first: NDArray[np.integer] | int, last: NDArray[np.integer] | int
) -> FloatArray:
    """(entry,) weights of facets on parts `own` (entry,), -1 for none, by the reflectors `first` and `last`, or
    `DIRECT`.

    `area` (part,) [m^2]. Curved surfaces and paths with two reflected legs have weight 1. Both roles of two planar
    parts are used, for reciprocity; a small part in front of a large one is integrated alone.
    """
    return np.where((own < 0) | (np.asarray(last) != DIRECT), 1.0, mirror_weight(area[first], area[own]))


def mirror_weight(mirror: FloatArray, integrated: FloatArray) -> FloatArray:
    """(...,) weight of paths with a mirror of area `mirror` and an integrated part of area `integrated` (...,) [m^2];
    it adds to 1 with the roles swapped."""
    ratio = np.log(mirror) - np.log(integrated)
    return np.asarray(
        np.interp(
            ratio, np.log([1 / DISSIMILAR_AREA, 1 / SIMILAR_AREA, SIMILAR_AREA, DISSIMILAR_AREA]), [0.0, 0.5, 0.5, 1.0]
        )
    )
