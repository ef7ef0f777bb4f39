"""Specular double bounces between curved static surfaces, found once
(:mod:`~rfgen_sionna.tracing.curved.curved_reflections`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.curved.curved_reflections import CurvedReflections
from rfgen_sionna.tracing.curved.smoothed_surface import SmoothedSurface
from rfgen_sionna.tracing.routes.planar_parts import face_owners, find_planar_parts
from rfgen_sionna.tracing.static.actor_shadows import StaticIndirectPaths
from rfgen_sionna.tracing.static.static_trace import StaticTrace
from rfgen_sionna.tracing.surface.surfaces import Surfaces

MIN_REFLECTOR_WIDTH = 1.0
"""Least width of a planar reflector [wavelengths]; narrower parts count as curved."""


@dataclass(frozen=True)
class StaticCurvedReflections(StaticIndirectPaths):
    """Specular double bounces within the static scene: all in one direction, then in the other."""

    facet: NDArray[np.int64]
    """(double bounce, 2) faces of both points."""
    places: FloatArray
    """(double bounce, 2, 3) points on the mesh [m]."""
    free: NDArray[np.bool_]
    """(double bounce,) whether visibility rays are free without actors; grazing rays may touch the surface itself."""
    viewpoint: FloatArray

    def visible(self, rays: RayScene, actors: Sequence[FloatArray]) -> tuple[FloatArray, int]:
        """(path,) 0 where an actor blocks a leg, else 1, and the number of rays sent. `rays` includes the actors; their
        positions `actors` are not used."""
        hidden = self.free & ~_unobstructed(rays, self.facet, self.places, self.viewpoint)
        return np.tile(1.0 - hidden, 2), 3 * len(hidden)


def _unobstructed(
    rays: RayScene, facet: NDArray[np.int64], places: FloatArray, source: FloatArray
) -> NDArray[np.bool_]:
    """(n,) whether all three legs by `places` (n, 2, 3) on faces (n, 2) are free."""
    (one, other), (first, second) = places.transpose(1, 0, 2), facet.T
    hidden = rays.occluded(source, one, first) | rays.occluded(source, other, second)
    return np.asarray(~(hidden | rays.occluded(one, other, second, first)))


def trace_static_curved(
    surfaces: Surfaces, rays: RayScene, radar: Radar, static: StaticTrace, rtol: float
) -> StaticCurvedReflections | None:
    """Specular double bounces in the static scene; None where they are below the tolerance. `rays` holds static
    surfaces alone."""
    if all(each.smooth is None for each in surfaces.static):
        return None
    points = surfaces.static_vertices
    parts = find_planar_parts(surfaces.static, points, [MIN_REFLECTOR_WIDTH * radar.wavelength] * len(points))
    owner = face_owners(parts, surfaces.static)
    rounds = CurvedReflections(
        replace(surfaces, moving=()), radar, rtol, lambda: owner, lambda: static.unoccluded, still=True
    )
    visible = rounds.trace_visibility(rays, points, np.zeros(0, np.int32))
    (strong,), error = rounds.strong([visible], np.array([static.level]))
    if len(strong) == 0:
        return None
    now = np.zeros(1)
    paths = rounds.paths(now, now, [strong], lambda _: ())
    facet, place = strong.facet, strong.weights.reshape(-1, 3)
    stands = SmoothedSurface.some(surfaces.static, points, facet.reshape(-1))
    places, _ = stands.places(np.arange(len(place)), place)
    view = np.asarray(radar.position)
    free = _unobstructed(rays, facet, places.reshape(-1, 2, 3), view)
    return StaticCurvedReflections(paths, error, visible.rays, facet, places.reshape(-1, 2, 3), free, view)
