"""Physical optics of a scene with static and moving parts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray
from rfgen_sionna.parallel import one_blas_thread
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import RadarPaths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tolerance import SIMULATOR_RTOL
from rfgen_sionna.tracing.curved.curved_reflections import CurvedReflections
from rfgen_sionna.tracing.direct.direct_trace import DirectTrace, trace_direct
from rfgen_sionna.tracing.direct.knot_count import count_knots
from rfgen_sionna.tracing.direct.run_scene import RunScene
from rfgen_sionna.tracing.direct.trace_plan import TracePlan
from rfgen_sionna.tracing.gains.band import BandTracer
from rfgen_sionna.tracing.integral.slabs import warn_of_late_reflections
from rfgen_sionna.tracing.legs.slab_scene import SlabScene
from rfgen_sionna.tracing.relative_scene import RelativeObject, by_material, relative_objects, to_world
from rfgen_sionna.tracing.report import Traced, TraceReport
from rfgen_sionna.tracing.routes.route_trace import RouteTracer
from rfgen_sionna.tracing.static.actor_shadows import IndirectShadows, Shadow
from rfgen_sionna.tracing.static.static_curved import StaticCurvedReflections, trace_static_curved
from rfgen_sionna.tracing.static.static_routes import StaticRoutes, trace_static_routes
from rfgen_sionna.tracing.static.static_shadows import StaticShadows
from rfgen_sionna.tracing.static.static_trace import StaticTrace, trace_static
from rfgen_sionna.tracing.surface.facets import RATE_STEP
from rfgen_sionna.tracing.surface.surfaces import Surface, Surfaces, collect_surfaces
from rfgen_sionna.tracing.trace_run import TraceRun

if TYPE_CHECKING:
    from rfgen_sionna.scene import MeshActor, RadarScene

PHASE_PER_RTOL = 0.5
"""Allowed phase error between knots [rad, root mean square over the vertices] and relative error of the antenna gain,
per unit of `rtol`: 0.1° at any time for 1e-3."""
OMITTED_SHARE = 0.5
"""Share of the tolerance below which the amplitude that slabs leave counts as 0."""
VISIBILITY_SPACING, FEWEST_KNOTS = 10e-3, 4
"""Largest gap [s] between knots of given positions, and their least number."""


class Tracer:
    """Traces one radar in one scene with its actors.

    The static scene is tessellated, tested for visibility and integrated once. Each interval of time traces the actors
    and their shadows on the static scene. Surfaces reflect with Fresnel coefficients, as half-spaces or slabs; rough
    ones reflect diffusely as well. Indirect paths are coherent: routes by planar reflectors and through slabs
    (:mod:`rfgen_sionna.tracing.routes`) and specular double bounces between curved surfaces
    (:mod:`rfgen_sionna.tracing.curved.curved_reflections`).

    Not traced: paths by two curved surfaces and a third surface or a slab.

    Parameters
    ----------
    scene
        Static scene; None is free space.
    radar
        Position, elements, band and range window. Directions of a moving radar are in the frame of
        :mod:`rfgen_sionna.tracing.relative_scene`, except those of :meth:`instant`, which are in the world.
    actors
        Moving objects.
    rtol
        Allowed error of each actor's coherent return, relative to itself, and of the static scene's, relative to its
        strongest surface or to its incoherent sum. Facets are refined until the estimate
        (:mod:`rfgen_sionna.tracing.gains.error_estimate`) meets it. Splines in time may err by `PHASE_PER_RTOL` and
        `GAIN_PER_RTOL` times as much.
    seed
        Seed of the phases of diffuse returns.
    max_bounces
        Largest number of surfaces on a path: 1 direct returns only; 2 adds one planar reflector on the way out or back,
        and two curved surfaces; 3 adds planar reflectors on both ways, and two in a row on one. Returns below the
        tolerance, by an upper bound, are omitted.
    transmission
        Whether slabs, surfaces of a material with a thickness, transmit on all legs.
    """

    def __init__(
        self,
        scene: RadarScene | None,
        radar: Radar,
        actors: Sequence[MeshActor | RelativeObject],
        rtol: float = SIMULATOR_RTOL,
        seed: int = 0,
        max_bounces: int = 1,
        transmission: bool = False,
    ) -> None:
        self.radar = radar
        self.actors: tuple[MeshActor | RelativeObject, ...] = by_material(actors)
        if radar.trajectory is not None:
            # In the radar's frame the whole world moves.
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
        """Static scene, traced at first use."""
        given = self.surfaces, self._static_rays, self._band, self._viewpoint, self.rtol, self.radar.max_range
        return trace_static(*given)

    @cached_property
    def static_indirect(self) -> tuple[StaticRoutes | StaticCurvedReflections, ...]:
        """Indirect paths between static surfaces and through them, traced at first use."""
        found: list[StaticRoutes | StaticCurvedReflections | None] = []
        surfaces = self.surfaces
        if self._static_rays is not None:
            if self.max_bounces > 1 or self.transmission:
                # The same surfaces, as those that a run follows.
                alone = replace(surfaces, static=(), static_vertices=(), moving=surfaces.static)
                slabs, followed = self._slabs(alone)
                if self.max_bounces > 1 or slabs is not None:
                    vertices = list(surfaces.static_vertices)
                    known = self._band, self.radar.max_range, self.rtol, lambda _: vertices, np.zeros((0, 3, 3)), slabs
                    scene = RunScene(followed, *known)
                    found.append(trace_static_routes(scene, surfaces, self.static.level, self.max_bounces))
            if self.max_bounces > 1:
                found.append(trace_static_curved(surfaces, self._static_rays, self.radar, self.static, self.rtol))
        return tuple(each for each in found if each is not None)

    def _slabs(self, surfaces: Surfaces) -> tuple[SlabScene | None, tuple[Surface, ...]]:
        """Slabs among the `surfaces`, None without any, and the moving ones, whose slabs count as open: their insides
        return as well."""
        if not self.transmission:
            return None, surfaces.moving
        at_rest = [points - self._viewpoint for points in surfaces.static_vertices]
        # With mirrors a slab may be on one leg alone.
        least = (OMITTED_SHARE * self.rtol) ** (1.0 if self.max_bounces > 1 else 0.5)
        band = self._band.centre, self._band.half_band
        found = SlabScene.of(surfaces.static, surfaces.moving, at_rest, *band, least)
        if not found.occluders.any_slabs:
            return None, surfaces.moving
        pairs = zip(surfaces.moving, found.occluders.transmits, strict=True)
        return found, tuple(replace(each, closed=each.closed and not slab) for each, slab in pairs)

    @cached_property
    def _static_paths(self) -> RadarPaths:
        """All paths of the static scene without actors."""
        more = [each.paths for each in self.static_indirect]
        return RadarPaths.concatenate([self.static.paths, *more]) if more else self.static.paths

    @cached_property
    def _static_rays(self) -> RayScene | None:
        """Ray scene of the static meshes; None without any."""
        return RayScene(self._static_meshes, origin=self._viewpoint) if self._static_meshes else None

    @cached_property
    def _rays(self) -> RayScene:
        """Ray scene of static and moving meshes."""
        moving = [(points, actor.faces) for points, actor in zip(self._vertices(0.0), self.actors, strict=True)]
        return RayScene(self._static_meshes, moving, origin=self._viewpoint)

    @property
    def _static_meshes(self) -> list[tuple[FloatArray, NDArray[np.int32]]]:
        surfaces = self.surfaces
        return [(points, each.faces) for points, each in zip(surfaces.static_vertices, surfaces.static, strict=True)]

    def _vertices(self, t: float) -> list[FloatArray]:
        """Vertices of every actor at `t` [s]; cached for the current interval, as the choice of knots repeats times."""
        if t not in self._positions:
            self._positions[t] = [actor.vertices(t) for actor in self.actors]
        return self._positions[t]

    def follow(self, cull: bool = True, span: tuple[float, float] | None = None) -> TraceRun:
        """A run, whose facets and settings persist from one :meth:`trace` to the next.

        Parameters
        ----------
        cull
            Whether facets that are negligible for the antennas are omitted; False traces all, for images.
        span
            First and last time [s] of the run, which is planned for these; None plans each interval by itself.
        """
        return TraceRun(cull, span)

    def knots(
        self, positions: Callable[[float], Sequence[FloatArray]], start: float, stop: float
    ) -> tuple[FloatArray, float]:
        """(knot,) knots from `start` to `stop` [s] for the delays of meshes with `positions`, time [s] to (vertex, 3)
        [m] of each, and the phase error between them [rad]."""
        if stop <= start:
            return np.array([start]), 0.0
        (tx, rx), wavenumber = self._band.elements, 2 * np.pi * self._band.highest / SPEED_OF_LIGHT
        first = max(FEWEST_KNOTS, 1 + int(np.ceil((stop - start) / VISIBILITY_SPACING)))
        pairs = [(tx[0], rx[0]), (tx[-1], rx[-1])]
        count, error = count_knots(positions, pairs, start, stop - start, wavenumber, PHASE_PER_RTOL * self.rtol, first)
        return np.linspace(start, stop, count), error

    @one_blas_thread()
    def trace(
        self,
        start: float,
        stop: float,
        run: TraceRun | None = None,
        watch: Callable[[float, RayScene], None] | None = None,
    ) -> Traced:
        """Paths from `start` to `stop` [s], with as many knots as the motion demands.

        Parameters
        ----------
        start, stop
            Interval [s].
        run
            Result of :meth:`follow` for the run; None starts a new one.
        watch
            Called with each sample time [s] and the ray scene of that time.
        """
        self._positions.clear()
        return self._trace(start, stop, run or self.follow(), watch)

    @one_blas_thread()
    def instant(self, t: float, indirect: bool = False) -> RadarPaths:
        """All paths at `t` [s] with their rates, static ones first, then the actors'; one knot. `indirect` returns
        those by several surfaces or through slabs only."""
        self._positions.clear()
        traced = self._trace(t, t, self.follow(), None)
        (static, visible), actors = traced.shadowed_static(), traced.moving
        if indirect:
            visible[: self.static.paths.num_paths] = False
            actors = actors.select(np.arange(len(traced.places(t)), actors.num_paths))
        static = static if visible.all() else static.select(visible)
        paths = RadarPaths.concatenate([replace(static, times=np.array([t])), actors])
        if self.radar.trajectory is None:
            return paths
        direction, arrival = (to_world(each, self.radar, t) for each in (paths.direction, paths.arrival))
        return replace(paths, direction=direction, arrival=arrival)

    def _trace(
        self, start: float, stop: float, run: TraceRun, watch: Callable[[float, RayScene], None] | None
    ) -> Traced:
        """Trace of direct paths and those by mirrors."""
        static, names = self.static, (self.surfaces.object_names, self.surfaces.part_names)
        stop = stop if self.actors else start
        plan = run.plan(self._run_scene, start, stop)
        if self.max_bounces > 1 and self.surfaces.moving and run.routes is None:
            self._add_routes(run, plan, start)
        traced = trace_direct(plan, start, stop, names, run.routes)
        times = traced.paths.times
        if watch is not None and self.actors:
            for t in times.tolist():
                watch(t, self.rays_at(t))
        shadows, missed = self._static_shadows(times, traced.shadows)
        hidden = IndirectShadows.of(self.static_indirect, times, self.rays_at, self._vertices) if self.actors else None
        paths, curved_error = traced.paths, 0.0
        if run.curved is not None:
            around, curved_error = self._trace_curved(run.curved, plan, traced)
            paths = paths if around is None else RadarPaths.concatenate([paths, around])
        report = TraceReport(
            facets=len(static.facets) + traced.facets,
            rays=static.rays + sum(each.rays for each in self.static_indirect) + (0 if hidden is None else hidden.rays),
            sample_times=len(times),
            knots=len(times),
            error=max(static.error + sum(each.error for each in self.static_indirect), traced.error + curved_error),
            time_error=max(traced.time_error, missed, 0.0 if hidden is None else hidden.error(static)),
            surface=traced.surface,
        )

        def find_shadows() -> tuple[Shadow, ...]:
            return shadows if hidden is None else (*shadows, *hidden.shadows(static.paths.num_paths))

        return Traced(self._static_paths, find_shadows, paths, report, traced.centroids)

    def _add_routes(self, run: TraceRun, plan: TracePlan, start: float) -> None:
        """Give a `run` the tracers of indirect paths of the actors; `start` [s] is that of its first interval."""
        surfaces, radar = self.surfaces, self.radar
        given = surfaces, self._vertices(run.first(start)), self._viewpoint, radar.wavelength, self.max_bounces
        run.routes = routes = RouteTracer(*given)
        routes.choose_expansion(plan, run.times(start))
        if any(surface.smooth is not None for surface in surfaces.moving):
            run.curved = CurvedReflections(
                surfaces, radar, self.rtol, lambda: routes.reflectors.owner, lambda: self.static.unoccluded
            )

    def _trace_curved(
        self, curved: CurvedReflections, plan: TracePlan, traced: DirectTrace
    ) -> tuple[RadarPaths | None, float]:
        """Specular double bounces at the knots of a trace, and their error relative to the direct returns."""
        mesh, times, visible = plan.mesh, traced.paths.times, []
        first = np.array([each.first_facet for each in self.surfaces.moving])[mesh.facet_surface]
        for t, sample in zip(times.tolist(), traced.samples, strict=True):
            shown = np.unique((first + mesh.face_in_surface)[sample.visible > 0])
            vertices = [*self.surfaces.static_vertices, *self._vertices(t)]
            visible.append(curved.trace_visibility(self.rays_at(t), vertices, shown))
        direct = traced.paths.select(np.flatnonzero(traced.paths.bounces == 1))
        waves = direct.a[0, 0] * np.exp(-2j * np.pi * np.mod(direct.frequency * direct.tau[0, 0], 1.0))
        waves = waves * self._band.pattern_gain(direct.direction)
        level = np.zeros(len(self.surfaces.moving))
        for number, surface in enumerate(self.surfaces.moving):
            level[number] = np.sqrt(np.mean(np.abs(waves[direct.object_id == surface.object_id].sum(axis=0)) ** 2))
        return curved.trace(times, times, visible, self._vertices, level)

    @cached_property
    def _run_scene(self) -> RunScene:
        """Actors, and the facets at rest that occlude them."""
        slabs, surfaces = self._slabs(self.surfaces)
        known = self.radar.max_range, self.rtol, self._vertices, self._static_shadows.corners
        return RunScene(surfaces, self._band, *known, slabs)

    @cached_property
    def _static_shadows(self) -> StaticShadows:
        return StaticShadows(self.static, self._band, self.rtol)

    def geometry(self, t: float) -> tuple[RayScene, list[FloatArray], list[FloatArray | None]]:
        """Ray scene at `t` [s], each object's vertices (vertex, 3) [m] and their velocities [m/s]; None for static
        objects."""
        self._positions.clear()
        moving = self._vertices(t)
        rays = self.rays_at(t)
        before, after = self._vertices(t - RATE_STEP), self._vertices(t + RATE_STEP)
        velocities = [(b - a) / (2 * RATE_STEP) for a, b in zip(before, after, strict=True)]
        static = list(self.surfaces.static_vertices)
        return rays, [*static, *moving], [*([None] * len(static)), *velocities]

    def rays_at(self, t: float, keep: bool = True) -> RayScene:
        """Static and moving meshes at `t` [s], valid until the next call; `keep` caches the vertices for the current
        interval."""
        if self.actors and self._rays_time != t:
            known = keep or t in self._positions
            self._rays.update(self._vertices(t) if known else [actor.vertices(t) for actor in self.actors])
            self._rays_time = t
        return self._rays
