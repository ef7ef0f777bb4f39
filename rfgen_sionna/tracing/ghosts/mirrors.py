"""Plane mirrors of the static scene: walls, floor, ceiling, table tops."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from rfgen_sionna._types import FloatArray
from rfgen_sionna.scene.materials import Material
from rfgen_sionna.tracing.surface.surfaces import Surface

FLATNESS = 1e-4
"""Largest distance of a mirror's vertices from its plane [m]: 0.3 rad of two-way phase at 77 GHz."""
MAX_FACE_ANGLE = 1e-3
"""Largest angle between neighbouring coplanar triangles [rad]; rounding tilts thin triangles by that much."""
MIN_FRESNEL_RADII = 2.0
"""Least width of a mirror, in radii of the first Fresnel zone: narrower ones diffract."""


@dataclass(frozen=True, eq=False)
class Mirror:
    """Flat, connected part of one static object; compared and hashed by identity."""

    name: str
    """Name of the object."""
    material: Material
    faces: NDArray[np.int64]
    """(face,) numbers among all faces of the ray scene."""
    normal: FloatArray
    """(3,) unit normal towards the radar."""
    offset: float
    """normal . x of its points in the world frame [m]."""
    axes: FloatArray
    """(2, 3) unit vectors in the plane."""
    low: FloatArray
    """(2,) least coordinate along the axes [m]."""
    high: FloatArray
    """(2,) largest coordinate along the axes [m]."""
    bounces: ClassVar[int] = 1
    """Number of reflections on a leg via it."""

    def height(self, points: FloatArray) -> FloatArray:
        """(...) distance of `points` (..., 3) from the plane [m], positive on the radar's side."""
        return np.asarray(points @ self.normal - self.offset)

    def image(self, points: FloatArray) -> FloatArray:
        """Mirror images (..., 3) [m]."""
        return np.asarray(points - 2.0 * self.height(points)[..., None] * self.normal)

    def unfolded(self, points: FloatArray) -> FloatArray:
        """Apparent position (..., 3) of `points` (..., 3) as seen from the radar [m]."""
        return self.image(points)

    def crossings(self, viewpoint: FloatArray, points: FloatArray) -> FloatArray:
        """(point, 3) reflection points between the viewpoint and `points` (point, 3) [m], all on one side."""
        here, there = self.height(viewpoint), self.height(points)[:, None]
        foot_here, foot_there = viewpoint - here * self.normal, points - there * self.normal
        return np.asarray((there * foot_here + here * foot_there) / np.maximum(here + there, 1e-12))

    def spans(self, points: FloatArray, margin: FloatArray | float = 0.0) -> NDArray[np.bool_]:
        """(point,) whether points of the plane lie in the mirror's bounding rectangle, widened by `margin` [m]."""
        place = points @ self.axes.T
        margin = np.broadcast_to(np.asarray(margin), len(points))[:, None]
        return np.asarray(((place > self.low - margin) & (place < self.high + margin)).all(axis=1))


@dataclass(frozen=True, eq=False)
class SecondOrderImage(Mirror):
    """Mirror that the radar sees via another one, `before`."""

    before: Mirror
    bounces: ClassVar[int] = 2

    @staticmethod
    def of(before: Mirror, mirror: Mirror) -> SecondOrderImage:
        """Leg by `before`, then by `mirror`."""
        return SecondOrderImage(**{each.name: getattr(mirror, each.name) for each in fields(Mirror)}, before=before)

    def image(self, points: FloatArray) -> FloatArray:
        """Images (..., 3) of the radar's elements [m]."""
        return super().image(self.before.image(points))

    def unfolded(self, points: FloatArray) -> FloatArray:
        """Apparent position (..., 3) of `points` via both mirrors [m]."""
        return self.before.image(super().image(points))

    def crossings(self, viewpoint: FloatArray, points: FloatArray) -> FloatArray:
        """(point, 3) reflection points on the second mirror [m]."""
        return super().crossings(self.before.image(viewpoint), points)


class Unfolding:
    """Apparent positions via mirrors of one order, relative to an `origin` (3,) [m]."""

    def __init__(self, mirrors: Sequence[Mirror], origin: FloatArray) -> None:
        ways = [[mirror] + ([mirror.before] if isinstance(mirror, SecondOrderImage) else []) for mirror in mirrors]
        self._steps = [_planes(step, origin) for step in zip(*ways, strict=True)]

    def __call__(self, places: FloatArray, mirror: NDArray[np.integer[Any]]) -> FloatArray:
        """(facet, 3) apparent positions [m] of `places` (facet, 3) [m], each via its `mirror` (facet,)."""
        for normals, heights in self._steps:
            height = np.einsum("fi,fi->f", places, normals[mirror]) + heights[mirror]
            places = places - 2.0 * height[:, None] * normals[mirror]
        return places


def _planes(mirrors: Sequence[Mirror], origin: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(mirror, 3) normals and (mirror,) heights of the origin [m]."""
    return np.stack([each.normal for each in mirrors]), np.array([float(each.height(origin)) for each in mirrors])


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
