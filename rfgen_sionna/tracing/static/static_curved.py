"""What bent surfaces of the static scene show of one another (:mod:`~rfgen_sionna.tracing.curved.curved_reflections`),
once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import RadarPaths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.curved.curved_reflections import CurvedReflections
from rfgen_sionna.tracing.curved.smoothed_surface import SmoothedSurface
from rfgen_sionna.tracing.reflectors.planar_reflectors import find_planar_parts
from rfgen_sionna.tracing.static.actor_shadows import Shadow, cast_shadow
from rfgen_sionna.tracing.static.static_reflections import MIN_PLATE_WIDTH
from rfgen_sionna.tracing.static.static_trace import StaticTrace
from rfgen_sionna.tracing.surface.surfaces import Surfaces


@dataclass(frozen=True)
class StaticCurvedReflections:
    """Glints within the static scene."""

    paths: RadarPaths
    """Of a single knot: of each glint both ways round, one way's after the other's."""
    rays: int
    facet: NDArray[np.int64]
    """(glint, 2) faces of both places."""
    places: FloatArray
    """(glint, 2, 3) places on the mesh [m]."""
    free: NDArray[np.bool_]
    """(glint,) of which rays say so without actors: a ray may just touch what is bent."""
    viewpoint: FloatArray
    error: float
    """What geometrical optics may be off by (:mod:`~rfgen_sionna.tracing.curved.stationary_phase_error`), relative to
    what the static
    scene's own is."""

    def visible(self, rays: RayScene, actors: Sequence[FloatArray]) -> tuple[FloatArray, int]:
        """(path,) 0 where an actor stands in one of a glint's legs, where `rays` has them, else 1; and the number of
        rays sent. The positions of the `actors` have no part in it."""
        hidden = self.free & ~_unobstructed(rays, self.facet, self.places, self.viewpoint)
        return np.tile(1.0 - hidden, 2), 3 * len(hidden)

    def shadows(self, knots: FloatArray, left: FloatArray) -> tuple[Shadow, Shadow]:
        """As :meth:`rfgen_sionna.tracing.static.static_trace.StaticTrace.shadows`, for (path, time) of
        :meth:`visible`."""
        return cast_shadow(self.paths, left, knots)


def _unobstructed(
    rays: RayScene, facet: NDArray[np.int64], places: FloatArray, source: FloatArray
) -> NDArray[np.bool_]:
    """(glint,) whether nothing stands in the three legs by way of both `places` (glint, 2, 3) on faces (glint, 2)."""
    (one, other), (first, second) = places.transpose(1, 0, 2), facet.T
    hidden = rays.occluded(source, one, first) | rays.occluded(source, other, second)
    return np.asarray(~(hidden | rays.occluded(one, other, second, first)))


def trace_static_curved(
    surfaces: Surfaces, rays: RayScene, radar: Radar, static: StaticTrace, rtol: float
) -> StaticCurvedReflections | None:
    """Glints in the static scene, of which `rays` holds nothing else; None where they are below the tolerance."""
    if all(each.smooth is None for each in surfaces.static):
        return None
    points = surfaces.static_vertices
    owner = np.full(sum(len(each.faces) for each in surfaces.static), -1, np.int32)
    for number, flat in enumerate(
        find_planar_parts(surfaces.static, points, [MIN_PLATE_WIDTH * radar.wavelength] * len(points))
    ):
        owner[flat.faces] = number
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
    return StaticCurvedReflections(paths, visible.rays, facet, places.reshape(-1, 2, 3), free, view, error)
