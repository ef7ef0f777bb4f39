"""Flat parts of any surface, moving or not, that mirror what stands before them: sides of corner reflectors, boards,
table tops, walls.

A plate shows what lies in the shadow that its outline would throw if the radar's image behind it were a lamp. Outlines
are kept as convex windows, so that facets can be cut to that shadow exactly (:mod:`rfgen_sionna.tracing.surface.clip`).
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
from rfgen_sionna.tracing.ghosts.mirrors import FLATNESS, Mirror, coplanar_groups, fresnel_width
from rfgen_sionna.tracing.reflectors.clipped_footprints import DIRECT
from rfgen_sionna.tracing.surface.surfaces import Surface

MIN_WAVELENGTHS = 1.0
"""How many wavelengths a plate that moves is wide at least: what is smaller has no shadow to speak of."""
FRESNEL_DISTANCE = 1.0
"""Of a plate that stays the first Fresnel zone at such a distance [m] must fit in: what is smaller, such as the backs
of books, shows too little of a body."""
CREASE_ANGLE = np.radians(25.0)
"""Faces that meet at a smaller angle stand for one bent surface, which is no mirror."""
MAX_SMOOTH_SHARE = 0.1
"""Share of a plate's outline that may go over into a bent surface."""
WELD_DISTANCE = 1e-4
"""Corners of plates are in one place when they are so near to each other [m]."""
MAX_WINDOWS = 64
"""Convex parts of an outline; what is more ragged is no plate."""


@dataclass(frozen=True)
class PlanarReflector(Mirror):
    """A mirror at an instant, with its outline."""

    windows: tuple[FloatArray, ...]
    """Convex polygons (corner, 3) [m] that make it up."""

    def shadow(self, viewpoint: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
        """Half-spaces (side, 3), (side,), for each window, in which n . (x - viewpoint) >= offset where the window
        shows a point x: the sides of the cone from the image of `viewpoint`, and the plate itself."""
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
    """Which faces of a surface make a plate, whatever its place."""

    surface: int
    """Position among all surfaces of the scene, static ones first."""
    name: str
    material: Material
    faces: NDArray[np.int64]
    """(face,) numbers among all faces of the ray scene."""
    vertices: NDArray[np.intp]
    """Vertices that it uses."""
    windows: tuple[NDArray[np.intp], ...]
    """Vertices of each window, in turn."""
    area: float
    """[m^2]"""
    outside: NDArray[np.intp] | None
    """Vertices of a face, counter-clockwise seen from outside, where the surface is closed."""

    def at(self, points: FloatArray, viewpoint: FloatArray) -> PlanarReflector | None:
        """The plate where the surface's vertices are `points` (vertex, 3) [m]; None where it is bent, seen edge on, or
        from the inside of a closed surface."""
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
            self.name,
            self.material,
            self.faces,
            normal,
            float(centre @ normal),
            axes,
            place.min(axis=0),
            place.max(axis=0),
            tuple(points[each] for each in self.windows),
        )

    def triangles(self, points: FloatArray) -> FloatArray:
        """(triangle, 3, 3) [m] that its windows are made of."""
        fans = [np.stack([np.broadcast_to(w[0], len(w) - 2), w[1:-1], w[2:]], axis=1) for w in self.windows]
        return np.asarray(points[np.concatenate(fans)])

    def image(self, points: FloatArray, of: FloatArray) -> FloatArray:
        """Mirror images (point, 3) of points `of` [m] in its plane, from whatever side, where the surface's vertices
        are `points` (vertex, 3) [m]."""
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
    """Flat parts of the surfaces that end in edges, not in a bend, and are at least as wide, on the average over their
    length, as `least` (surface,) [m] says."""
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
                found.append(
                    PlanarPart(
                        position,
                        surface.name,
                        surface.material,
                        chosen.astype(np.int64) + surface.first_facet,
                        used,
                        windows,
                        float(area[label]),
                        faces[chosen[0]].astype(np.intp) if surface.closed else None,
                    )
                )
    return tuple(found)


def face_owners(planar_parts: Sequence[PlanarPart], surfaces: Sequence[Surface]) -> IntArray:
    """(face,) number of the planar part of each face of the `surfaces`, -1 for none."""
    owner = np.full(sum(len(each.faces) for each in surfaces), -1, np.int32)
    for number, part in enumerate(planar_parts):
        owner[part.faces] = number
    return owner


def min_widths(static: int, moving: int, wavelength: float) -> list[float]:
    """Widths [m] for :func:`find_planar_parts` of so many surfaces that stay and that move."""
    return [2.0 * float(np.sqrt(wavelength * FRESNEL_DISTANCE))] * static + [MIN_WAVELENGTHS * wavelength] * moving


def adjacent_parts(planar_parts: Sequence[PlanarPart], points: Sequence[FloatArray]) -> list[set[int]]:
    """(flat,) which others have two corners or more in common with each."""
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
    """Which of the `reflectors`, those of `planar_parts`, are wide against the Fresnel zone half way through a scene
    of vertices
    `points` (vertex, 3) [m] of each surface."""
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
    """The outline's hull where that is all it is, else its triangles; none where they are too many."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(place)
    if hull.volume < area * (1.0 + 1e-6):  # of a flat hull `volume` is the area
        return (used[hull.vertices],)
    return tuple(np.asarray(each, np.intp) for each in faces) if len(faces) <= MAX_WINDOWS else ()


SIMILAR_AREA = 8.0
"""Flat parts whose areas are in a smaller ratio have either role by half ..."""
DISSIMILAR_AREA = 32.0
"""... and of those in a larger one the larger is the mirror. What is in between goes over from the one to the other, so
that nothing jumps where a size changes a little."""
UNBOUNDED = 1e12
"""Area [m^2] of what is always the mirror."""


def mirror_weights(
    area: FloatArray, own: NDArray[np.integer], first: NDArray[np.integer] | int, last: NDArray[np.integer] | int
) -> FloatArray:
    """(entry,) how much facets count of which plates `first` and `last`, or `DIRECT`, show each.

    `area` (plate,) are those of the plates [m^2], `own` (entry,) is the plate that each facet lies on, -1 for none.
    What is bent, and what plates show on both ways, has no other role.
    """
    return np.where((own < 0) | (np.asarray(last) != DIRECT), 1.0, mirror_weight(area[first], area[own]))


def mirror_weight(mirror: FloatArray, integrated: FloatArray) -> FloatArray:
    """(...,) how much ways count of which a flat part of area `mirror` (...,) is the mirror and one of area
    `integrated` (...,) the one that is integrated [m^2]; with their roles changed over the rest to 1."""
    ratio = np.log(mirror) - np.log(integrated)
    return np.asarray(
        np.interp(
            ratio, np.log([1 / DISSIMILAR_AREA, 1 / SIMILAR_AREA, SIMILAR_AREA, DISSIMILAR_AREA]), [0.0, 0.5, 0.5, 1.0]
        )
    )
