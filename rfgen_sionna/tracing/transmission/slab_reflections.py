"""Ghosts and corners behind slabs: what plates show of moving surfaces where a leg of the way goes through a wall, a
window or clothing. What is seen without them is left to :mod:`~rfgen_sionna.tracing.ghosts.ghosts` and
:mod:`~rfgen_sionna.tracing.reflectors.planar_reflections`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.ghosts.image_band import ImageBand
from rfgen_sionna.tracing.ghosts.mirrors import Mirror
from rfgen_sionna.tracing.reflectors.clipped_footprints import ClippedFootprints, ReflectedFacets
from rfgen_sionna.tracing.reflectors.footprint_clipper import FootprintClipper
from rfgen_sionna.tracing.reflectors.planar_reflections import MAX_IMAGES, PlanarReflections
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


class SlabReflections(PlanarReflections):
    """As :class:`~rfgen_sionna.tracing.reflectors.planar_reflections.PlanarReflections`, through at least one slab,
    walls being plates as any other.

    Parameters
    ----------
    surfaces, radar, rtol, max_bounces
        As there.
    veils
        What can be seen through.
    """

    def __init__(
        self, surfaces: Surfaces, radar: Radar, rtol: float, max_bounces: int, transmission_tracer: Transmission
    ) -> None:
        self._transmission_tracer = transmission_tracer
        super().__init__(surfaces, radar, rtol, max_bounces, tuple)

    def _imaging_reflectors(self, t: float) -> list[int]:
        """Plates in which images are followed: the largest, walls among them."""
        there = [number for number, reflector in enumerate(self.at(t)) if reflector is not None]
        return sorted(there, key=lambda number: -self.planar_parts[number].area)[:MAX_IMAGES]

    def _clipper(self, t: float, rays: RayScene, facets: Facets) -> FootprintClipper:
        every = (*self._surfaces.static, *self._surfaces.moving)
        vertices = [*self._surfaces.static_vertices, *self._positions(t)]
        least = OMITTED_SHARE * self._rtol
        # A ghost may go through a slab on one of its ways alone.
        slab_tracer = SlabTracer(rays, vertices, every, self._transmission_tracer.through, least**2)
        given = rays, self.at(t), self.owner, self._viewpoint, facets, self._radar.max_range
        return SlabFootprintClipper(slab_tracer, self._transmission_tracer.through, least, *given)

    def _directly_visible(self, facets: Facets, fraction: FloatArray) -> NDArray[np.bool_]:
        return self._transmission_tracer.possibly_visible(facets, self._transmission_tracer.penetrable)

    def _joined(self, footprint_sets: Sequence[ClippedFootprints]) -> ClippedFootprints:
        return SlabFootprints.joined(cast(Sequence[SlabFootprints], footprint_sets))

    def _facets_over_time(
        self,
        facets: Sequence[Facets],
        keys: NDArray[np.int64],
        footprint_sets: Sequence[ClippedFootprints],
        swapped: bool,
    ) -> Sequence[ReflectedFacets]:
        return SlabReflectedFacets.over_time(facets, keys, cast(Sequence[SlabFootprints], footprint_sets), swapped)

    def _band(self, radar: Radar, rtol: float, mirrors: Sequence[Mirror], tx: bool, rx: bool) -> ImageBand:
        return SlabReflectedBand(self._transmission_tracer.table, radar, rtol, mirrors, tx, rx)
