"""What of the static scene is seen through slabs: what stands behind a wall or in a cupboard."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import RadarPaths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.gains.band import BandTracer
from rfgen_sionna.tracing.moving.slab_transmission import SlabTransmission
from rfgen_sionna.tracing.shadows.adaptive_sampling import SampledVisibility
from rfgen_sionna.tracing.shadows.shadow_cones import bounding_spheres, in_shadow_cones
from rfgen_sionna.tracing.static.actor_shadows import Shadow, cast_shadow
from rfgen_sionna.tracing.static.static_trace import SlabEdgeTransmission, StaticTrace
from rfgen_sionna.tracing.surface.facets import Facets
from rfgen_sionna.tracing.surface.surfaces import Surfaces
from rfgen_sionna.tracing.transmission.transmission import Transmission


@dataclass(frozen=True)
class StaticTransmission:
    """Paths through static slabs without actors, a single knot, and what is needed to know what actors hide of them."""

    paths: RadarPaths
    error: float
    """Relative to what the error of :class:`~rfgen_sionna.tracing.static.static_trace.StaticTrace` is relative to."""
    rays: int
    transmission_tracer: Transmission
    static: StaticTrace
    vertices: tuple[FloatArray, ...]
    """(vertex, 3) of the static surfaces [m]."""
    keys: NDArray[np.int64]
    """(path, 1 + depth) facet of `static.hidden`, and slabs."""
    share: FloatArray
    """(path,)"""

    @cached_property
    def _facet(self) -> tuple[NDArray[np.intp], Facets]:
        """Which of the hidden facets are seen at all, in ascending order."""
        used = np.unique(self.keys[:, 0]).astype(np.intp)
        return used, self.static.hidden.take(used)

    def visible(self, rays: RayScene, actors: Sequence[FloatArray]) -> tuple[FloatArray, int]:
        """(path,) what is left of each with the actors where `rays` has them, against what there is without; and the
        number of rays sent. `actors` are the (vertex, 3) positions [m] of each."""
        used, facets = self._facet
        left = np.ones(len(self.keys))
        view = self.static.viewpoint
        near = np.flatnonzero(in_shadow_cones(bounding_spheres(facets, view), view, actors))
        if len(near) == 0:
            return left, 0
        fraction = self.static.hidden_fraction[used[near]]
        every, only = [*self.vertices, *actors], range(len(self.vertices))
        now = self.transmission_tracer.trace_visibility(rays, every, facets.take(near), fraction, only)
        keys = now.keys.copy()
        keys[:, 0] = used[near][now.keys[:, 0]]
        chosen = np.flatnonzero(np.isin(self.keys[:, 0], used[near]))
        both = np.concatenate([self.keys[chosen], keys])
        _, back = np.unique(both, axis=0, return_inverse=True)
        share = np.zeros(int(back.max()) + 1)
        share[back.reshape(-1)[len(chosen) :]] = now.share
        left[chosen] = share[back.reshape(-1)[: len(chosen)]] / self.share[chosen]
        return left, now.rays

    def shadows(self, knots: FloatArray, left: FloatArray) -> tuple[Shadow, Shadow]:
        """As :meth:`rfgen_sionna.tracing.static.static_trace.StaticTrace.shadows`, for (path, time) of
        :meth:`visible`."""
        return cast_shadow(self.paths, left, knots)


def find_static_transmission(surfaces: Surfaces, radar: Radar, rtol: float) -> Transmission | None:
    """What finds what is seen of static surfaces through static slabs; None where there are none."""
    names = surfaces.object_names, surfaces.part_names
    transmission_tracer = Transmission((*surfaces.static, *surfaces.moving), surfaces.static, names, radar, rtol)
    return transmission_tracer if transmission_tracer.any_transmission(range(len(surfaces.static))) else None


def static_slab_transmission(
    surfaces: Surfaces, transmission_tracer: Transmission, band: BandTracer
) -> SlabEdgeTransmission:
    """What static slabs let through beside their shadows' edges on static facets."""
    edges, every = SlabTransmission(transmission_tracer, band, range(len(surfaces.static))), _all_vertices(surfaces)

    def beside(rays: RayScene, facets: Facets, found: SampledVisibility) -> tuple[FloatArray, int]:
        return edges(rays, every, facets, found.owner, found.pieces, found.occluder)

    return beside


def _all_vertices(surfaces: Surfaces) -> list[FloatArray]:
    """(vertex, 3) of all surfaces: nothing of what moves is in rays of the static scene, and any of it will do."""
    moving = [np.zeros((int(each.faces.max()) + 1, 3)) for each in surfaces.moving]
    return [*surfaces.static_vertices, *moving]


def trace_static_transmission(
    surfaces: Surfaces, rays: RayScene, transmission_tracer: Transmission, static: StaticTrace
) -> StaticTransmission | None:
    """Paths through static slabs to static surfaces; None where there are none. `rays` holds the static scene alone."""
    points, every = surfaces.static_vertices, _all_vertices(surfaces)
    only = range(len(points))
    visible = transmission_tracer.trace_visibility(rays, every, static.hidden, static.hidden_fraction, only)
    reference_level, now = np.full(len(points), static.level), np.zeros(1)

    def centroids(_: float, chosen: NDArray[np.intp]) -> FloatArray:
        return static.hidden.centroids[chosen]

    paths, error, keys = transmission_tracer.trace(now, now, [static.hidden], [visible], centroids, reference_level)
    if paths is None:
        return None
    return StaticTransmission(paths, error, visible.rays, transmission_tracer, static, points, keys, visible.share)
