"""Where rays meet the smooth surface under a mesh, its normal there and how it bends.

Mitsuba gives the triangle that a ray hits in single precision. Here the ray meets the quadratic patch over that
triangle (:mod:`rfgen_sionna.tracing.curved.smoothed_surface`) in double precision. Tubes are whole where all of their
rays hit the same sheets.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.tracing.curved.smoothed_surface import SmoothedSurface, corner_curvatures, tangential
from rfgen_sionna.tracing.surface.surfaces import Surface


@dataclass(frozen=True)
class SurfaceIntersections:
    """Where rays meet the smooth surface."""

    point: FloatArray
    """(ray, 3) [m]"""
    normal: FloatArray
    """(ray, 3) unit vector towards where the ray comes from."""
    patch: FloatArray
    """(ray, 3, 3) how the normal turns along the surface [1/m]: positive where it bulges towards the ray's source."""
    weights: FloatArray
    """(ray, 3) barycentric coordinates, which may lie a little outside of the face."""


@dataclass(frozen=True)
class RaySkin(SmoothedSurface):
    """All faces of a scene at an instant, numbered as in the ray scene, for rays."""

    patches: FloatArray
    """(facet, 3, 3, 3) how the normal turns at each corner [1/m]."""
    size: FloatArray
    """(sheet,) its middle extent [m]: the width of what is long, the diameter of what is round."""
    area: FloatArray
    """(sheet,) of its faces [m^2]."""

    @staticmethod
    def of(surfaces: Sequence[Surface], vertices: Sequence[FloatArray]) -> RaySkin:
        """Of `surfaces` whose vertices (vertex, 3) stand at `vertices` [m]."""
        parts = [SmoothedSurface.one(each, points) for each, points in zip(surfaces, vertices, strict=True)]
        patches = [
            corner_curvatures(each, part.corners, part.normals, np.arange(len(each.faces)))
            for each, part in zip(surfaces, parts, strict=True)
        ]
        skin = SmoothedSurface.joined(parts)
        corners, sheet, count = skin.corners, skin.sheet, len(skin.plane)
        low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
        for corner in range(3):
            np.minimum.at(low, sheet, corners[:, corner])
            np.maximum.at(high, sheet, corners[:, corner])
        area = np.zeros(count)
        np.add.at(area, sheet, 0.5 * lengths(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])))
        return RaySkin(
            *(corners, skin.normals, skin.sagittas, sheet, skin.plane),
            patches=np.concatenate(patches),
            size=np.sort(high - low, axis=1)[:, 1],
            area=area,
        )

    def meet(
        self, origins: FloatArray, rays: FloatArray, facet: NDArray[np.int64], weights: FloatArray
    ) -> SurfaceIntersections:
        """Where rays from `origins` (ray, 3) [m] along unit vectors (ray, 3) meet the patches of faces `facet` (ray,),
        which they hit at barycentric coordinates `weights` (ray, 3) in single precision."""
        p, rise = self.corners[facet], self.sagittas[facet]
        w1, w2 = weights[:, 1].copy(), weights[:, 2].copy()
        start = np.einsum("rc,rci->ri", weights, p)
        t = np.einsum("ri,ri->r", start - origins, rays)
        for _ in range(3):
            w0 = 1.0 - w1 - w2
            point = w0[:, None] * p[:, 0] + w1[:, None] * p[:, 1] + w2[:, None] * p[:, 2]
            point += 4.0 * (
                (w1 * w2)[:, None] * rise[:, 0] + (w2 * w0)[:, None] * rise[:, 1] + (w0 * w1)[:, None] * rise[:, 2]
            )
            along = (
                p[:, 1] - p[:, 0] + 4.0 * (w2[:, None] * (rise[:, 0] - rise[:, 1]) + (w0 - w1)[:, None] * rise[:, 2])
            )
            across = (
                p[:, 2] - p[:, 0] + 4.0 * (w1[:, None] * (rise[:, 0] - rise[:, 2]) + (w0 - w2)[:, None] * rise[:, 1])
            )
            miss = origins + t[:, None] * rays - point
            # Cramer's rule for along a + across b - ray c = miss.
            normal = np.cross(along, across)
            facing = np.einsum("ri,ri->r", normal, rays)
            scale = lengths(normal)
            usable = np.abs(facing) > 1e-6 * np.maximum(scale, 1e-300)
            inverse = np.where(usable, 1.0 / np.where(usable, facing, 1.0), 0.0)
            forward = -np.einsum("ri,ri->r", normal, miss) * inverse
            rest = miss + forward[:, None] * rays
            square = np.maximum(scale**2, 1e-300)
            step1 = np.einsum("ri,ri->r", np.cross(rest, across), normal) / square
            step2 = np.einsum("ri,ri->r", np.cross(along, rest), normal) / square
            wild = np.maximum(np.abs(step1), np.abs(step2)) > 0.5  # at grazing incidence patches may not be met at all
            step1, step2, forward = (np.where(wild, 0.0, each) for each in (step1, step2, forward))
            w1, w2, t = w1 + step1, w2 + step2, t + forward
        w = np.stack([1.0 - w1 - w2, w1, w2], axis=1)
        point = origins + t[:, None] * rays
        normal = np.einsum("rc,rci->ri", w, self.normals[facet])
        normal /= np.maximum(lengths(normal), 1e-300)[:, None]
        side = -np.sign(np.einsum("ri,ri->r", normal, rays))
        side[side == 0] = 1.0
        normal = normal * side[:, None]
        return SurfaceIntersections(
            point,
            normal,
            tangential(np.einsum("rc,rcij->rij", w, self.patches[facet]) * side[:, None, None], normal),
            w,
        )
