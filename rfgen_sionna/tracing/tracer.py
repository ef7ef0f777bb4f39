"""Physical optics of a scene with static and moving parts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache, cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.parallel import one_blas_thread
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import RadarPaths
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.curved.curved_reflections import CurvedReflections
from rfgen_sionna.tracing.gains.band import BandTracer
from rfgen_sionna.tracing.ghosts.ghosts import Ghosts
from rfgen_sionna.tracing.ghosts.mirrors import Mirror, find_mirrors
from rfgen_sionna.tracing.integral.slabs import warn_of_late_reflections
from rfgen_sionna.tracing.moving.indirect_paths import IndirectPaths
from rfgen_sionna.tracing.moving.knots import Knots, choose_knots
from rfgen_sionna.tracing.moving.moving_trace import MovingTracer
from rfgen_sionna.tracing.moving.sample_times import choose_sample_times
from rfgen_sionna.tracing.reflectors.planar_reflections import PlanarReflections
from rfgen_sionna.tracing.relative import RelativeObject, relative_objects, to_world
from rfgen_sionna.tracing.report import Traced, TraceReport
from rfgen_sionna.tracing.static.actor_shadows import Shadow
from rfgen_sionna.tracing.static.static_curved import StaticCurvedReflections, trace_static_curved
from rfgen_sionna.tracing.static.static_refinement import interpolation_error, refine_occlusion
from rfgen_sionna.tracing.static.static_reflections import StaticReflections, trace_static_reflections
from rfgen_sionna.tracing.static.static_trace import StaticTrace, trace_static
from rfgen_sionna.tracing.static.static_transmission import (
    StaticTransmission,
    find_static_transmission,
    static_slab_transmission,
    trace_static_slab_reflections,
    trace_static_transmission,
)
from rfgen_sionna.tracing.static.static_visibility import StaticVisibility
from rfgen_sionna.tracing.surface.facets import RATE_STEP
from rfgen_sionna.tracing.surface.surfaces import collect_surfaces
from rfgen_sionna.tracing.transmission.slab_footprints import SlabLegs
from rfgen_sionna.tracing.transmission.transmission import Transmission

if TYPE_CHECKING:
    from rfgen_sionna.scene import MeshActor, RadarScene

PHASE_PER_RTOL = 0.5
"""Phase error between knots [rad, root mean square over the vertices], and relative error of the antennas' gain, per
unit of `rtol`: at 1e-3 no instant is off by 0.1 degrees."""
GAIN_PER_RTOL = 3.0
"""Relative error of the gains between instants [root mean square over time] per unit of `rtol`, as it is stated."""
VISIBILITY_SPACING = 10e-3
"""Longest gap [s] between four instants and more at which gains and visibility are traced; delays may have more."""
_MORE, _AGAIN = 1.1, 3
"""By how much more than was known the return has to cancel for a stretch to be traced anew, with more instants, and how
often it is traced at most."""


class Tracer:
    """Traces one radar in one scene with its actors.

    The static scene is tessellated, tested for visibility and integrated once; per stretch of time only the actors
    and what they hide is traced anew. Every surface reflects with its Fresnel coefficients, as a half-space or a slab,
    and where it is rough diffusely as well. Further returns are coherent: images in walls and floors
    (:mod:`rfgen_sionna.tracing.ghosts.ghosts`), reflections in flat parts of anything
    (:mod:`rfgen_sionna.tracing.reflectors.planar_reflections`, :mod:`~rfgen_sionna.tracing.static.static_reflections`)
    and specular double bounces between bent surfaces (:mod:`rfgen_sionna.tracing.curved.curved_reflections`).

    Not traced are paths by two bent surfaces and a third one or a slab; paths of actors by two different walls one
    after the other, where the radar moves or behind slabs; and, where it stands, by two different walls if one of the
    ways goes through a slab.

    Parameters
    ----------
    scene
        The static scene; None is free space.
    radar
        Position, elements, band and range window. If it moves, what :meth:`trace` and geometry say
        of directions is in the frame of :mod:`rfgen_sionna.tracing.relative`; :meth:`instant` speaks of the world.
    actors
        What moves.
    rtol
        Allowed error of each actor's coherent return, relative to itself, and of the static scene's, relative to its
        strongest surface or to what it returns without interfering; it is measured
        (:mod:`rfgen_sionna.tracing.gains.error_estimate`) and facets are made finer until it is met. Times
        `PHASE_PER_RTOL` and `GAIN_PER_RTOL` it is what splines in time may err by.
    seed
        Seed of the phases of what rough surfaces return diffusely.
    max_bounces
        Most surfaces on a path: 1 has direct returns alone; 2 adds those by one flat part on the way there or back, and
        by two bent surfaces; 3 adds those by flat parts both ways. Returns that are below the tolerance, by an estimate
        from Fresnel coefficients, spreading and antenna pattern, are left out.
    transmission
        Whether slabs, surfaces of a material with a thickness, are seen through, straight ahead and on every leg to
        actors, and between static surfaces, by way of flat parts
        (:mod:`rfgen_sionna.tracing.transmission.slab_footprints`,
        :mod:`rfgen_sionna.tracing.static.static_transmission`).
    """

    def __init__(
        self,
        scene: RadarScene | None,
        radar: Radar,
        actors: Sequence[MeshActor | RelativeObject],
        rtol: float = 1e-3,
        seed: int = 0,
        max_bounces: int = 1,
        transmission: bool = False,
    ) -> None:
        self.radar = radar
        self.actors: tuple[MeshActor | RelativeObject, ...] = tuple(actors)
        if radar.trajectory is not None:
            # Seen from the radar all the world moves, in the frame of t = 0.
            self.actors, scene = relative_objects(radar, scene, actors), None
        self.scene = scene
        self.rtol = rtol
        self.surfaces = collect_surfaces(scene, self.actors)
        self._viewpoint = np.asarray(radar.position)
        self._band = BandTracer(radar, rtol, seed)
        materials = [each.material for each in (*self.surfaces.static, *self.surfaces.moving)]
        warn_of_late_reflections(materials, self._band.centre, self._band.half_band)
        self.max_bounces = max_bounces
        self.transmission = transmission
        self._positions: dict[float, list[FloatArray]] = {}
        self._rays_time: float | None = None

    @cached_property
    def static(self) -> StaticTrace:
        """The static scene, traced at first use."""
        transmission_tracer = self._static_transmission
        slab_edges = (
            None
            if transmission_tracer is None
            else static_slab_transmission(self.surfaces, transmission_tracer, self._band)
        )
        given = self.surfaces, self._static_rays, self._band, self._viewpoint, self.rtol, self.radar.max_range
        return trace_static(*given, slab_edges)

    @cached_property
    def _static_transmission(self) -> Transmission | None:
        """What finds what static slabs show of static surfaces; None where there is none."""
        if not self.transmission or not self.surfaces.static:
            return None
        return find_static_transmission(self.surfaces, self.radar, self.rtol)

    @cached_property
    def static_indirect(self) -> tuple[StaticReflections | StaticCurvedReflections | StaticTransmission, ...]:
        """What static surfaces show of one another, and what is seen through them, traced at first use."""
        found: list[StaticReflections | StaticCurvedReflections | StaticTransmission | None] = []
        if self._static_rays is not None:
            scene = self.surfaces, self._static_rays, self.radar
            transmission_tracer = self._static_transmission
            straight = (
                None
                if transmission_tracer is None
                else trace_static_transmission(*scene[:2], transmission_tracer, self.static)
            )
            found.append(straight)
            if self.max_bounces > 1:
                found.append(trace_static_reflections(*scene, self._band, self.static, self.rtol, self.max_bounces))
                found.append(trace_static_curved(*scene, self.static, self.rtol))
            if self.max_bounces > 1 and self.transmission:
                through = None if straight is None else straight.paths
                found.append(
                    trace_static_slab_reflections(*scene, self._band, self.static, through, self.rtol, self.max_bounces)
                )
        return tuple(each for each in found if each is not None)

    @cached_property
    def _static_paths(self) -> RadarPaths:
        """All paths of the static scene without actors."""
        more = [each.paths for each in self.static_indirect]
        return RadarPaths.concatenate([self.static.paths, *more]) if more else self.static.paths

    @cached_property
    def mirrors(self) -> tuple[Mirror, ...]:
        """Flat parts of the static scene, wide against the Fresnel zone, that the radar sees: ghosts appear in them."""
        surfaces, visible = self.surfaces, self.static.unoccluded
        radar, points = self.radar, surfaces.static_vertices
        return find_mirrors(surfaces.static, points, visible, self._viewpoint, radar.wavelength, radar.max_range)

    @cached_property
    def _static_rays(self) -> RayScene | None:
        """The static meshes alone; None where there are none."""
        return RayScene(self._static_meshes, origin=self._viewpoint) if self._static_meshes else None

    @cached_property
    def _rays(self) -> RayScene:
        """Static and moving meshes together."""
        moving = [(points, actor.faces) for points, actor in zip(self._vertices(0.0), self.actors, strict=True)]
        return RayScene(self._static_meshes, moving, origin=self._viewpoint)

    @property
    def _static_meshes(self) -> list[tuple[FloatArray, NDArray[np.int32]]]:
        surfaces = self.surfaces
        return [(points, each.faces) for points, each in zip(surfaces.static_vertices, surfaces.static, strict=True)]

    def _vertices(self, t: float) -> list[FloatArray]:
        """Vertices of every actor at `t`; kept for the stretch at hand, as knots are chosen by trying."""
        if t not in self._positions:
            self._positions[t] = [actor.vertices(t) for actor in self.actors]
        return self._positions[t]

    def follow(self, cull: bool = True) -> MovingTracer:
        """What keeps the moving facets through a run: with the same one, facets stay the same from one :meth:`trace` to
        the next. Results depend on what it went through before, so that every run begins with its own. Not `cull`, it
        is for images, which have what the antennas hardly see as well."""
        ghosts, reflections, curved = None, list[PlanarReflections](), None
        if self.max_bounces > 1 and self.surfaces.moving:
            if self.surfaces.static:
                ghosts = Ghosts(self.surfaces, self.radar, self.rtol, self.max_bounces, lambda: self.mirrors)
            walls = (lambda: self.mirrors) if self.surfaces.static else tuple
            planar = PlanarReflections(self.surfaces, self.radar, self.rtol, self.max_bounces, walls)
            reflections.append(planar)
            if any(surface.smooth is not None for surface in self.surfaces.moving):
                curved = CurvedReflections(
                    self.surfaces, self.radar, self.rtol, lambda: planar.owner, lambda: self.static.unoccluded
                )
        reach = self.radar.max_range
        transmission_tracer = None
        if self.transmission and self.surfaces.moving:
            found = Transmission(self.surfaces, self.surfaces.moving, self.radar, self.rtol)
            transmission_tracer = found if found.any_transmission() else None
            if self.max_bounces > 1 and found.any_transmission(one_way=True):
                common = self.surfaces, self.radar, self.rtol, self.max_bounces
                reflections.append(PlanarReflections(*common, legs=SlabLegs(found)))
        given = self.surfaces, self._band, self._viewpoint, reach, self.rtol
        indirect = IndirectPaths(self.surfaces, self._band, ghosts, reflections, curved, transmission_tracer)
        return MovingTracer(*given, indirect, cull)

    def knots(self, positions: Callable[[float], Sequence[FloatArray]], start: float, stop: float) -> Knots:
        """Knots from `start` to `stop` [s] between which splines follow what this radar sees of meshes at `positions`,
        (vertex, 3) of each at a time [s]."""
        interval = start, stop, self._band.highest, PHASE_PER_RTOL * self.rtol, VISIBILITY_SPACING
        reach = 0.5 * float(lengths(self.radar.virtual_positions).max())
        return choose_knots(positions, self._viewpoint, *interval, self._band.pattern_gain, reach)

    @one_blas_thread()
    def trace(
        self,
        start: float,
        stop: float,
        moving: MovingTracer | None = None,
        watch: Callable[[float, RayScene], None] | None = None,
    ) -> Traced:
        """Paths from `start` to `stop` [s], with as many knots as the motion asks for.

        `moving` is the run's, None is a new one. `watch` is called with each instant at which visibility is traced and
        the ray scene as it stands then.
        """
        self._positions.clear()
        moving = moving or self.follow()
        if not self.actors:
            return self._traced(np.array([start]), np.array([start]), moving, 0.0, watch)
        highest, faces = self._band.highest, [actor.faces for actor in self.actors]
        gain = GAIN_PER_RTOL * self.rtol
        delay_points = moving.prepare(self._vertices, (start, stop))
        knots, time_error = self.knots(delay_points, start, stop)
        closed = [surface.closed for surface in self.surfaces.moving]
        given = self._vertices, faces, closed, self._viewpoint, knots, highest, gain, VISIBILITY_SPACING
        # What actors hide of what stays, or of what is watched, is told by three times and more.
        pair = not self.surfaces.static and self.radar.trajectory is None and watch is None
        for _ in range(_AGAIN):
            known = moving.relative_cancellation
            sample_times, turned = choose_sample_times(
                *given, indirect=moving.traces_back_faces, pair=pair, cancellation=known
            )
            finest = knots if len(knots) > len(sample_times) else sample_times
            traced = self._traced(finest, sample_times, moving, float(np.hypot(turned, time_error)), watch)
            # How much of the return cancels is known when it was traced.
            more = float((moving.relative_cancellation / known).max())
            if more * turned <= gain or more < _MORE or watch is not None or len(sample_times) == 1:
                break
        if more <= 1.0 or len(sample_times) == 1:
            return traced
        report = replace(traced.report, time_error=max(traced.report.time_error, more * turned))
        return replace(traced, report=report)

    @one_blas_thread()
    def instant(self, t: float, indirect: bool = False) -> RadarPaths:
        """All paths at one instant [s] with their rates: static ones first, then the actors'; a single knot.
        `indirect`, those alone that come by several surfaces or through slabs."""
        self._positions.clear()
        moving = self.follow()
        if self.actors:
            moving.prepare(self._vertices, (t,))
        traced = self._traced(np.array([t]), np.array([t]), moving)
        static, actors = traced.static, traced.moving
        left = np.ones(static.num_paths, np.bool_)
        if traced.shadows:
            a = static.a.copy()
            dispersion = None if static.dispersion is None else static.dispersion.copy()
            for shadow in traced.shadows:
                a[:, :, shadow.index] += shadow.paths.a
                if dispersion is not None and shadow.paths.dispersion is not None:
                    more = shadow.paths.dispersion  # of as many orders as its own paths have
                    dispersion[: len(more), :, :, shadow.index] += more
            static, left = replace(static, a=a, dispersion=dispersion), np.any(a != 0, axis=(0, 1, 3))
        if indirect:
            left[: self.static.paths.num_paths] = False
            actors = actors.select(np.arange(len(traced.places(t)), actors.num_paths))
        static = static if left.all() else static.select(left)
        paths = RadarPaths.concatenate([replace(static, times=np.array([t])), actors])
        if self.radar.trajectory is None:
            return paths
        direction, arrival = (to_world(each, self.radar, t) for each in (paths.direction, paths.arrival))
        return replace(paths, direction=direction, arrival=arrival)

    def geometry(self, t: float) -> tuple[RayScene, list[FloatArray], list[FloatArray | None]]:
        """The ray scene as it stands at `t` [s], each object's vertices [m], and their velocities [m/s] or None."""
        self._positions.clear()
        moving = self._vertices(t)
        rays = self.rays_at(t)
        before, after = self._vertices(t - RATE_STEP), self._vertices(t + RATE_STEP)
        velocities = [(b - a) / (2 * RATE_STEP) for a, b in zip(before, after, strict=True)]
        static = list(self.surfaces.static_vertices)
        return rays, [*static, *moving], [*([None] * len(static)), *velocities]

    def _traced(
        self,
        knots: FloatArray,
        sample_times: FloatArray,
        parts: MovingTracer,
        turned: float = 0.0,
        watch: Callable[[float, RayScene], None] | None = None,
    ) -> Traced:
        """Delays at `knots`, visibility and gains at `sample_times` [s], between which gains that turn are off by
        `turned`,
        and what else splines miss there, relative to the return."""
        static = self.static
        static_indirect = self.static_indirect
        shares: dict[float, StaticVisibility] = {}
        left: list[dict[float, FloatArray]] = [{} for _ in static_indirect]
        sent = [static.rays, *(each.rays for each in static_indirect)]

        @cache
        def occluded() -> NDArray[np.intp]:
            """Static facets that actors may hide at one of the instants."""
            each = zip(*(self._vertices(t) for t in sample_times.tolist()), strict=True)
            return static.behind([np.concatenate(places) for places in each])

        def visibility(t: float) -> RayScene:
            """The ray scene at `t`; what the actors hide of the static scene is found out by the way."""
            rays = self.rays_at(t)
            if t not in shares and self.actors:
                shares[t], count = static.visible(rays, occluded(), parts.silhouette_rays(t))
                sent.append(count)
                for each, by_time in zip(static_indirect, left, strict=True):
                    by_time[t], count = each.visible(rays, self._vertices(t))
                    sent.append(count)
                if watch is not None:
                    watch(t, rays)
            return rays

        moving = parts.trace(knots, sample_times, self._vertices, visibility, self._rays, self.rays_at)
        sample_times = moving.sample_times
        for t in sample_times.tolist():
            if t not in shares and self.actors and (len(static.facets) or watch is not None):
                visibility(t)

        static_visibility = [shares.get(t, static.without_actors) for t in sample_times.tolist()]
        candidates = refine_occlusion(
            static, sample_times, static_visibility, lambda t: self.rays_at(t, keep=False), self.rtol
        )
        indirect = [
            np.stack([by_time[t] for t in sample_times.tolist()], axis=1) if by_time else None for by_time in left
        ]
        pairs = list(zip(static_indirect, indirect, strict=True))
        unseen = [interpolation_error(static, each.paths, share) for each, share in pairs if share is not None]

        def shadows() -> tuple[Shadow, ...]:
            found = list(candidates.shadows(static))
            first = static.paths.num_paths
            for each, share in pairs:
                if share is not None:
                    found += [shadow.of(first) for shadow in each.shadows(sample_times, share)]
                first += each.paths.num_paths
            return tuple(shadow for shadow in found if shadow.paths.num_paths)

        edges = max([candidates.missed, *(each.missed for each in shares.values())])
        report = TraceReport(
            facets=len(static.facets) + moving.facets + candidates.sampled_facets,
            rays=sum(sent) + moving.rays + candidates.rays,
            sample_times=len(sample_times),
            knots=len(knots),
            error=max(float(np.hypot(static.error, edges)) + sum(each.error for each in static_indirect), moving.error),
            time_error=max(
                float(np.hypot(moving.time_error, turned)), float(np.linalg.norm([candidates.error, *unseen]))
            ),
        )
        return Traced(
            self._static_paths, shadows, moving.paths, moving.refined, report, moving.places, moving.refined_places
        )

    def rays_at(self, t: float, keep: bool = True) -> RayScene:
        """Static and moving meshes as they are at `t` [s], until it is asked for another time; `keep`, vertices are
        kept for the stretch at hand."""
        if self.actors and self._rays_time != t:
            known = keep or t in self._positions
            self._rays.update(self._vertices(t) if known else [actor.vertices(t) for actor in self.actors])
            self._rays_time = t
        return self._rays
