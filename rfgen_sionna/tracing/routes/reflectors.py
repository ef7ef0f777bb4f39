"""Planar parts of static and moving surfaces, and the mirrors that they are at one time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.tracing.legs.leg import Mirror
from rfgen_sionna.tracing.routes.planar_parts import (
    FLATNESS,
    UNBOUNDED,
    PlanarPart,
    face_owners,
    find_planar_parts,
    min_widths,
    mirror_weight,
)
from rfgen_sionna.tracing.surface.surfaces import Surface


@dataclass(frozen=True, eq=False)
class Plate:
    """A planar part at one time, regardless of the side from which it is seen."""

    part: int
    normal: FloatArray
    """(3,)"""
    offset: float
    """normal . x of its points [m]."""
    windows: tuple[FloatArray, ...]
    """Convex polygons (corner, 3) [m] of its outline."""
    single: bool
    """Whether only the side of the normal reflects."""

    @property
    def front(self) -> Mirror:
        """The mirror for points before it."""
        return Mirror(self.part, self.normal, self.offset, self.windows)

    def seen_from(self, point: FloatArray) -> Mirror | None:
        """The mirror for a `point` (3,) [m]; None for one that is in the plane or behind a single-sided plate."""
        height = float(self.normal @ point) - self.offset
        if abs(height) < FLATNESS or (self.single and height < 0):
            return None
        side = 1.0 if height > 0 else -1.0
        return Mirror(self.part, side * self.normal, side * self.offset, self.windows)


@dataclass(frozen=True)
class Reflectors:
    """Planar parts of all surfaces, static ones first."""

    parts: tuple[PlanarPart, ...]
    static: int
    """Number of static surfaces."""
    owner: IntArray
    """(face,) part of each face of the ray scene, -1 for none."""

    @staticmethod
    def of(
        static: Sequence[Surface],
        moving: Sequence[Surface],
        vertices: Sequence[FloatArray],
        wavelength: float,
    ) -> Reflectors:
        """Planar parts wide enough to reflect at the `wavelength` [m], with (vertex, 3) `vertices` [m] of each
        surface."""
        every = (*static, *moving)
        parts = find_planar_parts(every, vertices, min_widths(len(static), len(moving), wavelength))
        return Reflectors(parts, len(static), face_owners(parts, every))

    def is_static(self, part: int) -> bool:
        """Whether a part is at rest."""
        return self.parts[part].surface < self.static

    def plates(self, vertices: Sequence[FloatArray]) -> list[Plate | None]:
        """Plates of all parts with (vertex, 3) `vertices` [m] of each surface; None for bent ones."""
        return [_plate(number, part, vertices[part.surface]) for number, part in enumerate(self.parts)]

    def role_weights(self, own: IntArray, out: tuple[int, ...], back: tuple[int, ...]) -> FloatArray:
        """(facet,) weight of facets on the parts `own` (facet,), -1 for none, by legs of these mirrors. Of two planar
        parts on a path each is the mirror once, of three the middle one is integrated; static parts have no facets."""
        found = np.ones(len(own))
        planar = own >= 0
        if len(out) + len(back) == 1:
            (mirror,) = out + back
            area = UNBOUNDED if self.is_static(mirror) else self.parts[mirror].area
            areas = np.array([each.area for each in self.parts])
            found[planar] = mirror_weight(np.array(area), areas[own[planar]])
        elif max(len(out), len(back)) > 1:
            found[planar] = float(self.is_static(max(out, back, key=len)[-1]))
        for mirror in {*out, *back}:
            found[own == mirror] = 0.0
        return found


def _plate(number: int, part: PlanarPart, points: FloatArray) -> Plate | None:
    used = points[part.vertices]
    centre = used.mean(axis=0)
    _, _, axes = np.linalg.svd(used - centre, full_matrices=False)
    normal = axes[2]
    if np.abs((used - centre) @ normal).max() > FLATNESS:
        return None
    if part.outside is not None:
        a, b, c = points[part.outside]
        normal = normal if np.cross(b - a, c - a) @ normal > 0 else -normal
    windows = tuple(points[each] for each in part.windows)
    return Plate(number, normal, float(centre @ normal), windows, part.outside is not None)
