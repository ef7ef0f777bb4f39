"""Static scene through slabs: direct paths to surfaces behind a partition or in a cupboard, and reflections there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import cast

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import RadarPaths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.gains.band import BandTracer
from rfgen_sionna.tracing.ghosts.image_band import ImageBand
from rfgen_sionna.tracing.ghosts.mirrors import Mirror
from rfgen_sionna.tracing.moving.slab_transmission import SlabTransmission
from rfgen_sionna.tracing.reflectors.clipped_footprints import ClippedFootprints, ReflectedFacets
from rfgen_sionna.tracing.reflectors.planar_reflectors import PlanarReflector
from rfgen_sionna.tracing.shadows.adaptive_sampling import SampledVisibility
from rfgen_sionna.tracing.shadows.shadow_cones import bounding_spheres, in_shadow_cones
from rfgen_sionna.tracing.static.actor_shadows import Shadow, cast_shadow
from rfgen_sionna.tracing.static.static_reflections import ReflectionSetup, StaticReflections, trace_reflections
from rfgen_sionna.tracing.static.static_trace import StaticTrace
from rfgen_sionna.tracing.static.static_visibility import SlabEdgeTransmission
from rfgen_sionna.tracing.surface.facets import Facets
from rfgen_sionna.tracing.surface.surfaces import Surfaces
from rfgen_sionna.tracing.transmission.slab_crossings import SlabTracer
from rfgen_sionna.tracing.transmission.slab_footprints import (
    SlabFootprintClipper,
    SlabFootprints,
    SlabReflectedBand,
    SlabReflectedFacets,
)
from rfgen_sionna.tracing.transmission.transmission import OMITTED_SHARE, Transmission


@dataclass(frozen=True)
class StaticTransmission:
    """Direct paths through static slabs without actors, single knot, and the state to find their occlusion."""

    paths: RadarPaths
    error: float
    """Relative to the static reference level."""
    rays: int
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

    def shadows(self, knots: FloatArray, left: FloatArray) -> tuple[Shadow, Shadow]:
        """As :meth:`rfgen_sionna.tracing.static.static_trace.StaticTrace.shadows`; `left` (path, time) is from
        :meth:`visible`."""
        return cast_shadow(self.paths, left, knots)


def find_static_transmission(surfaces: Surfaces, radar: Radar, rtol: float) -> Transmission | None:
    """Tracer of static surfaces through static slabs; None without slabs."""
    names = surfaces.object_names, surfaces.part_names
    transmission_tracer = Transmission((*surfaces.static, *surfaces.moving), surfaces.static, names, radar, rtol)
    return transmission_tracer if transmission_tracer.any_transmission(range(len(surfaces.static))) else None


def static_slab_transmission(
    surfaces: Surfaces, transmission_tracer: Transmission, band: BandTracer
) -> SlabEdgeTransmission:
    """Transmission of static slabs beside shadow boundaries on static facets."""
    edges, every = SlabTransmission(transmission_tracer, band, range(len(surfaces.static))), _all_vertices(surfaces)

    def edge_transmission(rays: RayScene, facets: Facets, found: SampledVisibility) -> tuple[FloatArray, int]:
        return edges(rays, every, facets, found.owner, found.pieces, found.occluder)

    return edge_transmission


def _all_vertices(surfaces: Surfaces) -> list[FloatArray]:
    """(vertex, 3) of all surfaces; moving ones are not in the static ray scene and get placeholders."""
    moving = [np.zeros((int(each.faces.max()) + 1, 3)) for each in surfaces.moving]
    return [*surfaces.static_vertices, *moving]


def trace_static_transmission(
    surfaces: Surfaces, rays: RayScene, transmission_tracer: Transmission, static: StaticTrace
) -> StaticTransmission | None:
    """Paths through static slabs to static surfaces; None without any. `rays` holds static surfaces alone."""
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


class StaticSlabReflections(StaticReflections):
    """Paths of two and three bounces through at least one slab within the static scene, single knot."""

    def _all_pieces(self) -> ClippedFootprints:
        plain, footprint_sets = super()._all_pieces(), cast(Sequence[SlabFootprints], self.footprint_sets)
        return SlabFootprints(
            plain.facet, plain.first, plain.last, plain.pieces, plain.owner, plain.share,
            crossed=np.concatenate([each.crossed for each in footprint_sets]),
            across=np.concatenate([each.across for each in footprint_sets]),
        )  # fmt: skip


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
    every, names = (*surfaces.static, *surfaces.moving), (surfaces.object_names, surfaces.part_names)
    transmission_tracer = Transmission(every, surfaces.static, names, radar, rtol)
    count = len(surfaces.static)
    if not transmission_tracer.any_transmission(range(count), one_way=True):
        return None
    amplitude = np.where(np.arange(len(every)) < count, transmission_tracer.through, 0.0)
    # Nothing of what moves is gone through: any vertices of it will do.
    vertices = [*surfaces.static_vertices, *(np.zeros((int(each.faces.max()) + 1, 3)) for each in surfaces.moving)]
    view, least = np.asarray(radar.position), OMITTED_SHARE * rtol

    def clipper(reflectors: Sequence[PlanarReflector | None], owner: IntArray, facets: Facets) -> SlabFootprintClipper:
        slab_tracer = SlabTracer(rays, vertices, every, amplitude, least**2)
        return SlabFootprintClipper(
            slab_tracer, amplitude, least, rays, reflectors, owner, view, facets, radar.max_range
        )

    def slab_band(radar: Radar, rtol: float, mirrors: Sequence[Mirror], tx: bool, rx: bool) -> ImageBand:
        return SlabReflectedBand(transmission_tracer.table, radar, rtol, mirrors, tx, rx)

    def joined(footprint_sets: Sequence[ClippedFootprints]) -> ClippedFootprints:
        return SlabFootprints.joined(cast(Sequence[SlabFootprints], footprint_sets))

    def clipped(facets: Facets, footprints: ClippedFootprints, swapped: bool) -> ReflectedFacets:
        transmitted = cast(SlabFootprints, footprints)
        (found,) = SlabReflectedFacets.over_time([facets], transmitted.keys, [transmitted], swapped)
        return found

    levels = static.levels if through is None else np.maximum(static.levels, _levels(surfaces, through))
    setup = ReflectionSetup(_whole(static), levels, clipper, slab_band, joined, clipped, StaticSlabReflections)
    return trace_reflections(setup, surfaces, radar, band, static, rtol, max_bounces)


def _whole(static: StaticTrace) -> Facets:
    """All uncut facets that face the radar, visible or occluded."""
    clear = np.flatnonzero(static.fraction[: static.whole] == 1)
    return Facets.joined([static.facets.take(clear), static.hidden])


def _levels(surfaces: Surfaces, paths: RadarPaths) -> FloatArray:
    """(surface,) incoherent sum of the direct paths through slabs."""
    power = np.abs(paths.a[0, 0, :, 0]) ** 2
    return np.sqrt(np.bincount(paths.object_id, power, len(surfaces.static)))
