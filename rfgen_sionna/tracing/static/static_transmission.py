"""What of the static scene is seen through slabs: what stands behind a wall or in a cupboard."""

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

    def edge_transmission(rays: RayScene, facets: Facets, found: SampledVisibility) -> tuple[FloatArray, int]:
        return edges(rays, every, facets, found.owner, found.pieces, found.occluder)

    return edge_transmission


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


class StaticSlabReflections(StaticReflections):
    """Paths of two and three bounces through at least one slab within the static scene, a single knot."""

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
    """As :func:`~rfgen_sionna.tracing.static.static_reflections.trace_static_bounces`, for ways through static slabs;
    `through`
    are the paths that go straight through them."""
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
    """All facets that face the radar, seen or hidden, none of them cut."""
    clear = np.flatnonzero(static.fraction[: static.whole] == 1)
    return Facets.joined([static.facets.take(clear), static.hidden])


def _levels(surfaces: Surfaces, paths: RadarPaths) -> FloatArray:
    """(surface,) what straight ways through slabs bring of each, as if nothing interfered."""
    power = np.abs(paths.a[0, 0, :, 0]) ** 2
    return np.sqrt(np.bincount(paths.object_id, power, len(surfaces.static)))
