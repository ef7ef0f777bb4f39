"""Indirect paths of moving surfaces: ghosts, planar reflectors, slabs and specular double bounces."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import chain
from typing import NamedTuple

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.records import RadarPaths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.curved.curved_reflections import CurvedReflections, DoubleBounceVisibility
from rfgen_sionna.tracing.gains.band import BandTracer
from rfgen_sionna.tracing.ghosts.ghosts import Ghosts, GhostVisibility
from rfgen_sionna.tracing.ghosts.image_returns import Centroids
from rfgen_sionna.tracing.moving.moving_facets import Positions
from rfgen_sionna.tracing.moving.slab_transmission import SlabTransmission
from rfgen_sionna.tracing.moving.visible_facets import VisibleFacets
from rfgen_sionna.tracing.reflectors.planar_reflections import PlanarReflections, ReflectionVisibility
from rfgen_sionna.tracing.surface.facets import Facets
from rfgen_sionna.tracing.surface.surfaces import Surfaces
from rfgen_sionna.tracing.transmission.transmission import Transmission, TransmittedVisibility


class IndirectVisibility(NamedTuple):
    """Indirect visibility at the sample times, of each kind of path."""

    facets: list[Facets]
    """Facets at each time."""
    mirrored: list[GhostVisibility]
    reflected: list[list[ReflectionVisibility]]
    """Of all planar reflectors, at each time."""
    double_bounces: list[DoubleBounceVisibility]
    transmitted: list[TransmittedVisibility]

    @property
    def views(self) -> list[GhostVisibility | ReflectionVisibility | DoubleBounceVisibility | TransmittedVisibility]:
        """All of them."""
        return [*self.mirrored, *chain(*self.reflected), *self.double_bounces, *self.transmitted]


class IndirectPaths:
    """Traces the indirect paths of moving surfaces: `ghosts` in walls, `planar` reflectors without and with slabs on
    their legs, `curved` double bounces and those of `transmission_tracer` through slabs; None omits a kind."""

    def __init__(
        self,
        surfaces: Surfaces,
        band: BandTracer,
        ghosts: Ghosts | None = None,
        planar: Sequence[PlanarReflections] = (),
        curved: CurvedReflections | None = None,
        transmission_tracer: Transmission | None = None,
    ) -> None:
        self._still = surfaces.static_vertices
        self.ghosts, self._planar, self._curved, self._transmission_tracer = (
            ghosts,
            tuple(planar),
            curved,
            transmission_tracer,
        )
        self._slab_transmission = None if transmission_tracer is None else SlabTransmission(transmission_tracer, band)

    def __bool__(self) -> bool:
        """Whether mirrors or slabs may show faces that face away from the radar."""
        return self.ghosts is not None or bool(self._planar) or self._transmission_tracer is not None

    @property
    def through_slabs(self) -> bool:
        """Whether slabs transmit."""
        return self._transmission_tracer is not None

    @property
    def _active_ghosts(self) -> Ghosts | None:
        return self.ghosts if self.ghosts is not None and self.ghosts.active else None

    def prepare(self, positions: Positions, times: Sequence[float]) -> Positions:
        """Choose the mirrors for `times` [s]; returns the positions of all points whose delays matter, with images."""
        if self.ghosts is not None:
            self.ghosts.prepare([positions(t) for t in times])
        ghosts, planar = self._active_ghosts, self.active_reflections(positions, times[0])
        if ghosts is None and not planar:
            return positions

        def delay_points(t: float) -> list[FloatArray]:
            found = list(positions(t))
            if ghosts is not None:
                found = ghosts.delay_points(found)
            return [*found, *(points for each in planar for points in each.delay_points(positions(t)))]

        return delay_points

    def active_reflections(self, positions: Positions, start: float) -> list[PlanarReflections]:
        """Planar reflectors that matter in an interval from `start` [s]."""
        return [each for each in self._planar if each.follow(positions, start)]

    def weights(
        self, rays: Callable[[], RayScene], vertices: Sequence[FloatArray], facets: Facets, fraction: FloatArray
    ) -> FloatArray:
        """(facet,) visible `fraction` (facet,) plus the weight of paths through slabs, for the choice of facets. `rays`
        gives the ray scene, in which the moving surfaces have `vertices` [m]."""
        if self._transmission_tracer is None:
            return fraction
        transmitted = self._transmission_tracer.trace_visibility(rays(), self._everything(vertices), facets, fraction)
        return np.asarray(fraction + self._transmission_tracer.weights(transmitted, len(fraction)))

    def trace_visibility(
        self,
        planar: Sequence[PlanarReflections],
        sample_times: Sequence[float],
        positions: Positions,
        rays: Callable[[float], RayScene],
        facets: Sequence[Facets],
        visible: Sequence[VisibleFacets],
    ) -> tuple[IndirectVisibility, list[VisibleFacets]]:
        """Indirect visibility of `facets` at each of the `sample_times` [s], and the direct visibility `visible` with
        the transmission of slabs beside shadow boundaries. `rays` updates the ray scene to a time."""
        indirect, direct = IndirectVisibility(list(facets), [], [[] for _ in planar], [], []), list(visible)
        for k, (t, own, there) in enumerate(zip(sample_times, facets, visible, strict=True)):
            if not self:
                break
            scene, everything = rays(t), self._everything(positions(t))
            if (ghosts := self._active_ghosts) is not None:
                indirect.mirrored.append(ghosts.trace_visibility(scene, own, there.fraction))
            for reflectors, any_visible in zip(planar, indirect.reflected, strict=True):
                any_visible.append(reflectors.trace_visibility(t, scene, own, there.fraction))
            if self._curved is not None:
                indirect.double_bounces.append(
                    self._curved.trace_visibility(scene, everything, own.number[there.fraction > 0])
                )
            if self._transmission_tracer is not None:
                indirect.transmitted.append(
                    self._transmission_tracer.trace_visibility(scene, everything, own, there.fraction)
                )
            if self._slab_transmission is not None:
                direct[k] = self._slab_transmission.with_transmission(scene, everything, there)
        return indirect, direct

    def trace(
        self,
        planar: Sequence[PlanarReflections],
        knots: FloatArray,
        sample_times: FloatArray,
        positions: Positions,
        centroids: Centroids,
        visible: IndirectVisibility,
        level: FloatArray,
    ) -> tuple[list[RadarPaths], float]:
        """All indirect paths, with delays at the `knots` [s], and their error relative to the `level` (surface,) of
        direct returns."""
        given = knots, sample_times, visible.facets
        paths, error = list[RadarPaths](), 0.0
        if self._transmission_tracer is not None:
            through, missed, _ = self._transmission_tracer.trace(*given, visible.transmitted, centroids, level)
            paths, error = [] if through is None else [through], missed
        if (ghosts := self._active_ghosts) is not None:
            found, missed = ghosts.trace(*given, visible.mirrored, centroids, level)
            paths, error = paths + found, error + missed
        for reflectors, any_visible in zip(planar, visible.reflected, strict=True):
            found, missed = reflectors.trace(*given, any_visible, centroids, level)
            paths, error = paths + found, error + missed
        if self._curved is not None:
            around, missed = self._curved.trace(knots, sample_times, visible.double_bounces, positions, level)
            paths, error = paths if around is None else [*paths, around], error + missed
        return paths, error

    def _everything(self, vertices: Sequence[FloatArray]) -> list[FloatArray]:
        """(vertex, 3) positions [m] of all surfaces."""
        return [*self._still, *vertices]
