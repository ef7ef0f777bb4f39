"""What the static scene's flat parts show through slabs: furniture behind a partition, and corners there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import RadarPaths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.gains.band import BandTracer
from rfgen_sionna.tracing.ghosts.image_band import ImageBand
from rfgen_sionna.tracing.ghosts.mirrors import Mirror
from rfgen_sionna.tracing.reflectors.clipped_footprints import ClippedFootprints, ReflectedFacets
from rfgen_sionna.tracing.reflectors.planar_reflectors import PlanarReflector
from rfgen_sionna.tracing.static.static_reflections import ReflectionSetup, StaticReflections, trace_reflections
from rfgen_sionna.tracing.static.static_trace import StaticTrace
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
    most: int,
) -> StaticReflections | None:
    """As :func:`~rfgen_sionna.tracing.static.static_reflections.trace_static_bounces`, for ways through static slabs;
    `through`
    are the paths that go straight through them."""
    every, names = (*surfaces.static, *surfaces.moving), (surfaces.object_names, surfaces.part_names)
    transmission_tracer = Transmission(every, surfaces.static, names, radar, rtol)
    count = len(surfaces.static)
    if not transmission_tracer.any_transmission(range(count), one_way=True):
        return None
    gone_through = np.where(np.arange(len(every)) < count, transmission_tracer.through, 0.0)
    # Nothing of what moves is gone through: any vertices of it will do.
    vertices = [*surfaces.static_vertices, *(np.zeros((int(each.faces.max()) + 1, 3)) for each in surfaces.moving)]
    view, least = np.asarray(radar.position), OMITTED_SHARE * rtol

    def clipper(reflectors: Sequence[PlanarReflector | None], owner: IntArray, facets: Facets) -> SlabFootprintClipper:
        slab_tracer = SlabTracer(rays, vertices, every, gone_through, least**2)
        return SlabFootprintClipper(
            slab_tracer, gone_through, least, rays, reflectors, owner, view, facets, radar.max_range
        )

    def made_of(radar: Radar, rtol: float, mirrors: Sequence[Mirror], tx: bool, rx: bool) -> ImageBand:
        return SlabReflectedBand(transmission_tracer.table, radar, rtol, mirrors, tx, rx)

    def joined(footprint_sets: Sequence[ClippedFootprints]) -> ClippedFootprints:
        return SlabFootprints.joined(cast(Sequence[SlabFootprints], footprint_sets))

    def clipped(facets: Facets, footprints: ClippedFootprints, swapped: bool) -> ReflectedFacets:
        transmitted = cast(SlabFootprints, footprints)
        (found,) = SlabReflectedFacets.over_time([facets], transmitted.keys, [transmitted], swapped)
        return found

    levels = static.levels if through is None else np.maximum(static.levels, _levels(surfaces, through))
    showing = ReflectionSetup(_whole(static), levels, clipper, made_of, joined, clipped, StaticSlabReflections)
    return trace_reflections(showing, surfaces, radar, band, static, rtol, most)


def _whole(static: StaticTrace) -> Facets:
    """All facets that face the radar, seen or hidden, none of them cut."""
    clear = np.flatnonzero(static.fraction[: static.whole] == 1)
    return Facets.joined([static.facets.take(clear), static.hidden])


def _levels(surfaces: Surfaces, paths: RadarPaths) -> FloatArray:
    """(surface,) what straight ways through slabs bring of each, as if nothing interfered."""
    power = np.abs(paths.a[0, 0, :, 0]) ** 2
    return np.sqrt(np.bincount(paths.object_id, power, len(surfaces.static)))
