"""Static scene through slabs: direct paths to surfaces behind a partition or in a cupboard, and reflections there."""

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
from rfgen_sionna.tracing.static.actor_shadows import StaticIndirectPaths
from rfgen_sionna.tracing.static.static_facets import SlabEdgeTransmission
from rfgen_sionna.tracing.static.static_reflections import (
    ReflectionSetup,
    StaticReflections,
    all_vertices,
    trace_static_reflections,
)
from rfgen_sionna.tracing.static.static_trace import StaticTrace
from rfgen_sionna.tracing.surface.facets import Facets
from rfgen_sionna.tracing.surface.surfaces import Surfaces
from rfgen_sionna.tracing.transmission.slab_footprints import (
    SlabLegs,
)
from rfgen_sionna.tracing.transmission.transmission import Transmission


@dataclass(frozen=True)
class StaticTransmission(StaticIndirectPaths):
    """Direct paths through static slabs without actors, single knot, and the state to find their occlusion."""

    transmission_tracer: Transmission
    static: StaticTrace
    vertices: tuple[FloatArray, ...]
    """(vertex, 3) of the static surfaces [m]."""
    keys: NDArray[np.int64]
    """(path, 1 + depth) facet of `static.hidden`, and slabs."""
    share: FloatArray
    """(path,) visible share."""

    @cached_property
    def _facet(self) -> tuple[NDArray[np.intp], Facets]:
        """Hidden facets that are visible through slabs, ascending."""
        used = np.unique(self.keys[:, 0]).astype(np.intp)
        return used, self.static.hidden.take(used)

    def visible(self, rays: RayScene, actors: Sequence[FloatArray]) -> tuple[FloatArray, int]:
        """(path,) visible share with the actors in `rays`, relative to the scene without them, and the number of rays
        sent. `actors` are the (vertex, 3) positions [m] of each."""
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


def find_static_transmission(surfaces: Surfaces, radar: Radar, rtol: float) -> Transmission | None:
    """Tracer of static surfaces through static slabs; None without slabs."""
    transmission_tracer = Transmission(surfaces, surfaces.static, radar, rtol)
    return transmission_tracer if transmission_tracer.any_transmission(range(len(surfaces.static))) else None


def static_slab_transmission(
    surfaces: Surfaces, transmission_tracer: Transmission, band: BandTracer
) -> SlabEdgeTransmission:
    """Transmission of static slabs beside shadow boundaries on static facets."""
    edges, every = SlabTransmission(transmission_tracer, band, range(len(surfaces.static))), all_vertices(surfaces)

    def edge_transmission(rays: RayScene, facets: Facets, found: SampledVisibility) -> tuple[FloatArray, int]:
        return edges(rays, every, facets, found.owner, found.pieces, found.occluder)

    return edge_transmission


def trace_static_transmission(
    surfaces: Surfaces, rays: RayScene, transmission_tracer: Transmission, static: StaticTrace
) -> StaticTransmission | None:
    """Paths through static slabs to static surfaces; None without any. `rays` holds static surfaces alone."""
    points, every = surfaces.static_vertices, all_vertices(surfaces)
    only = range(len(points))
    visible = transmission_tracer.trace_visibility(rays, every, static.hidden, static.hidden_fraction, only)
    reference_level, now = np.full(len(points), static.level), np.zeros(1)
    paths, error, keys = transmission_tracer.trace(
        now, now, [static.hidden], [visible], lambda _, chosen: static.hidden.centroids[chosen], reference_level
    )
    if paths is None:
        return None
    return StaticTransmission(paths, error, visible.rays, transmission_tracer, static, points, keys, visible.share)


def trace_static_slab_reflections(
    surfaces: Surfaces,
    rays: RayScene,
    radar: Radar,
    band: BandTracer,
    static: StaticTrace,
    through: RadarPaths | None,
    rtol: float,
    max_bounces: int,
) -> StaticReflections | None:
    """As :func:`~rfgen_sionna.tracing.static.static_reflections.trace_static_reflections`, for legs through static
    slabs; `through` are the direct paths through them."""
    transmission, only = Transmission(surfaces, surfaces.static, radar, rtol), range(len(surfaces.static))
    if not transmission.any_transmission(only, one_way=True):
        return None
    levels = static.levels if through is None else np.maximum(static.levels, _levels(surfaces, through))
    setup = ReflectionSetup(_whole(static), levels, SlabLegs(transmission, only))
    return trace_static_reflections(surfaces, rays, radar, band, static, rtol, max_bounces, setup)


def _whole(static: StaticTrace) -> Facets:
    """All uncut facets that face the radar, visible or occluded."""
    clear = np.flatnonzero(static.fraction[: static.whole] == 1)
    return Facets.joined([static.facets.take(clear), static.hidden])


def _levels(surfaces: Surfaces, paths: RadarPaths) -> FloatArray:
    """(surface,) incoherent sum of the direct paths through slabs."""
    power = np.abs(paths.a[0, 0, :, 0]) ** 2
    return np.sqrt(np.bincount(paths.object_id, power, len(surfaces.static)))
