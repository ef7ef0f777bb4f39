"""Physical optics of a scene with static and moving parts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.parallel import one_blas_thread
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import RadarPaths
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tolerance import SIMULATOR_RTOL
from rfgen_sionna.tracing.curved.curved_reflections import CurvedReflections
from rfgen_sionna.tracing.direct.direct_trace import trace_direct
from rfgen_sionna.tracing.direct.trace_plan import RunScene
from rfgen_sionna.tracing.gains.band import BandTracer
from rfgen_sionna.tracing.ghosts.ghosts import Ghosts
from rfgen_sionna.tracing.ghosts.mirror_images import Mirror
from rfgen_sionna.tracing.ghosts.mirrors import find_mirrors
from rfgen_sionna.tracing.integral.slabs import warn_of_late_reflections
from rfgen_sionna.tracing.joint_trace import JointScene, trace_jointly
from rfgen_sionna.tracing.moving.fast_turns import choose_limited_sample_times
from rfgen_sionna.tracing.moving.indirect_paths import IndirectPaths
from rfgen_sionna.tracing.moving.knots import Knots, choose_knots
from rfgen_sionna.tracing.moving.moving_trace import MovingTracer
from rfgen_sionna.tracing.reflectors.planar_reflections import PlanarReflections
from rfgen_sionna.tracing.relative_scene import RelativeObject, by_material, relative_objects, to_world
from rfgen_sionna.tracing.report import Traced, TraceReport
from rfgen_sionna.tracing.static.static_indirect import StaticIndirect, trace_static_indirect
from rfgen_sionna.tracing.static.static_shadows import StaticShadows
from rfgen_sionna.tracing.static.static_trace import StaticTrace, trace_static
from rfgen_sionna.tracing.static.static_transmission import find_static_transmission, static_slab_transmission
from rfgen_sionna.tracing.surface.facets import RATE_STEP
from rfgen_sionna.tracing.surface.surfaces import collect_surfaces
from rfgen_sionna.tracing.trace_run import TraceRun
from rfgen_sionna.tracing.transmission.slab_footprints import SlabLegs
from rfgen_sionna.tracing.transmission.transmission import Transmission

if TYPE_CHECKING:
    from rfgen_sionna.scene import MeshActor, RadarScene

PHASE_PER_RTOL = 0.5
"""Allowed phase error between knots [rad, root mean square over the vertices] and relative error of the antenna gain,
per unit of `rtol`: 0.1° at any time for 1e-3."""
GAIN_PER_RTOL = 3.0
"""Allowed relative error of gains between sample times [root mean square over time] per unit of `rtol`; part of the
stated `time_error`."""
VISIBILITY_SPACING = 10e-3
"""Largest gap [s] between four or more sample times of gains and visibility; knots of delays may be closer."""
LEAST_RTOL = 0.02
"""Tolerance below which direct returns alone are traced by element pair as well, as cuts of shadows are coarser."""
_FEW_KNOTS, _MISSED, _WRONG = 48, 3.0, 0.3
"""Number of knots, time error per `rtol`, and time error above which a motion, such as a rotor's, is traced by element
pair."""
_MORE, _AGAIN = 1.1, 3
"""Growth of the cancellation above which an interval is traced anew with more sample times, and the largest number of
traces."""


class Tracer:
    """Traces one radar in one scene with its actors.

    The static scene is tessellated, tested for visibility and integrated once. Each interval of time traces the actors
    and their shadows on the static scene. Surfaces reflect with Fresnel coefficients, as half-spaces or slabs; rough
    ones reflect diffusely as well. Indirect paths are coherent: ghosts in walls and floors
    (:mod:`rfgen_sionna.tracing.ghosts.ghosts`), planar reflectors
    (:mod:`rfgen_sionna.tracing.reflectors.planar_reflections`, :mod:`rfgen_sionna.tracing.static.static_reflections`)
    and specular double bounces between curved surfaces (:mod:`rfgen_sionna.tracing.curved.curved_reflections`).

    Not traced: paths by two curved surfaces and a third surface or a slab; paths of actors by two different walls in
    succession if the radar moves or slabs are in between.

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
        and two curved surfaces; 3 adds planar reflectors on both ways. Returns below the tolerance, by an upper bound,
        are omitted.
    transmission
        Whether slabs (surfaces of a material with a thickness) transmit: on direct paths, on every leg to actors, and
        between static surfaces by way of planar reflectors (:mod:`rfgen_sionna.tracing.transmission.transmission`,
        :mod:`rfgen_sionna.tracing.static.static_transmission`).
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
        """Static scene, traced at first use; large flat faces by their edges where direct returns alone are traced."""
        return self._trace_static(by_cells=not self._is_joint)

    @cached_property
    def _static_facets(self) -> StaticTrace:
        """The same by facets alone."""
        return self.static if self.static.cells is None else self._trace_static(by_cells=False)

    def _trace_static(self, by_cells: bool) -> StaticTrace:
        slabs = self._static_transmission
        slab_edges = None if slabs is None else static_slab_transmission(self.surfaces, slabs, self._band)
        given = self.surfaces, self._static_rays, self._band, self._viewpoint, self.rtol, self.radar.max_range
        return trace_static(*given, slab_edges, by_cells)

    @cached_property
    def _static_transmission(self) -> Transmission | None:
        """Transmission between static surfaces; None without slabs."""
        if not self.transmission or not self.surfaces.static:
            return None
        return find_static_transmission(self.surfaces, self.radar, self.rtol)

    @cached_property
    def static_indirect(self) -> tuple[StaticIndirect, ...]:
        """Indirect paths between static surfaces and through them, traced at first use."""
        rays, transmission = self._static_rays, self._static_transmission
        if rays is None:
            return ()
        scene = self.surfaces, rays, self.radar, self._band, self.static, transmission
        return trace_static_indirect(*scene, self.rtol, self.max_bounces, self.transmission)

    @cached_property
    def _static_paths(self) -> RadarPaths:
        """All paths of the static scene without actors, by facets."""
        more, direct = [each.paths for each in self.static_indirect], self._static_facets.paths
        return RadarPaths.concatenate([direct, *more]) if more else direct

    @cached_property
    def mirrors(self) -> tuple[Mirror, ...]:
        """Planar surfaces of the static scene in view, wider than the Fresnel zone: candidates for ghosts."""
        surfaces, visible = self.surfaces, self.static.unoccluded
        radar, points = self.radar, surfaces.static_vertices
        return find_mirrors(surfaces.static, points, visible, self._viewpoint, radar.wavelength, radar.max_range)

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
        return TraceRun(self._follow(cull) if self._is_joint else None, cull, span)

    @property
    def _is_joint(self) -> bool:
        """Whether static and moving surfaces are traced at common sample times, with indirect paths."""
        return self.max_bounces > 1 or self.transmission or self.rtol < LEAST_RTOL

    def _follow(self, cull: bool) -> MovingTracer:
        """Tracer of the actors with indirect paths."""
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
        transmission: Transmission | None = None
        if self.transmission and self.surfaces.moving:
            found = Transmission(self.surfaces, self.surfaces.moving, self.radar, self.rtol)
            transmission = found if found.any_transmission() else None
            if self.max_bounces > 1 and found.any_transmission(one_way=True):
                common = self.surfaces, self.radar, self.rtol, self.max_bounces
                reflections.append(PlanarReflections(*common, legs=SlabLegs(found)))
        given = self.surfaces, self._band, self._viewpoint, self.radar.max_range, self.rtol
        indirect = IndirectPaths(self.surfaces, self._band, ghosts, reflections, curved, transmission)
        return MovingTracer(*given, indirect, cull)

    def knots(self, positions: Callable[[float], Sequence[FloatArray]], start: float, stop: float) -> Knots:
        """Knots from `start` to `stop` [s] for the delays of meshes with `positions`, time [s] to (vertex, 3) [m] of
        each."""
        interval = start, stop, self._band.highest, PHASE_PER_RTOL * self.rtol, VISIBILITY_SPACING
        reach = 0.5 * float(lengths(self.radar.virtual_positions).max())
        return choose_knots(positions, self._viewpoint, *interval, self._band.pattern_gain, reach)

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
        run = run or self.follow()
        if run.indirect is None:
            return self._trace_direct(start, stop, run, watch)
        moving = run.indirect
        if not self.actors:
            return self._traced(np.array([start]), np.array([start]), moving, 0.0, watch)
        highest, faces = self._band.highest, [actor.faces for actor in self.actors]
        gain = GAIN_PER_RTOL * self.rtol
        delay_points = moving.prepare(self._vertices, (start, stop))
        knots, time_error = self.knots(delay_points, start, stop)
        closed = [surface.closed for surface in self.surfaces.moving]
        given = self._vertices, faces, closed, self._viewpoint, knots, highest, gain, VISIBILITY_SPACING
        # Shadows on static surfaces and watched scenes need three sample times or more.
        pair = not self.surfaces.static and self.radar.trajectory is None and watch is None
        for _ in range(_AGAIN):
            known = moving.relative_cancellation
            own = moving.limit_facets, moving.traces_back_faces, pair, known
            sample_times, turned = choose_limited_sample_times(*given, *own)
            finest = knots if len(knots) > len(sample_times) else sample_times
            traced = self._traced(finest, sample_times, moving, float(np.hypot(turned, time_error)), watch)
            # The cancellation of the return is known only after the trace.
            more = float((moving.relative_cancellation / known).max())
            if more * turned <= gain or more < _MORE or watch is not None or len(sample_times) == 1:
                break
        if more <= 1.0 or len(sample_times) == 1:
            return traced
        report = replace(traced.report, time_error=max(traced.report.time_error, more * turned))
        return replace(traced, report=report)

    @one_blas_thread()
    def instant(self, t: float, indirect: bool = False) -> RadarPaths:
        """All paths at `t` [s] with their rates, static ones first, then the actors'; one knot. `indirect` returns
        those by several surfaces or through slabs only."""
        self._positions.clear()
        moving = self.follow().indirect
        if moving is None:
            traced = self._trace_direct(t, t, TraceRun(None, True, None), None)
            own, shadows = self._static_shadows.facets.in_place(traced.shadows)
            traced = replace(traced, static=own, find_shadows=lambda: shadows)
        else:
            if self.actors:
                moving.prepare(self._vertices, (t,))
            traced = self._traced(np.array([t]), np.array([t]), moving)
        (static, visible), actors = traced.shadowed_static(), traced.moving
        if indirect:
            visible[: static.num_paths if moving is None else self.static.paths.num_paths] = False
            actors = actors.select(np.arange(len(traced.places(t)), actors.num_paths))
        static = static if visible.all() else static.select(visible)
        paths = RadarPaths.concatenate([replace(static, times=np.array([t])), actors])
        if self.radar.trajectory is None:
            return paths
        direction, arrival = (to_world(each, self.radar, t) for each in (paths.direction, paths.arrival))
        return replace(paths, direction=direction, arrival=arrival)

    def _trace_direct(
        self, start: float, stop: float, run: TraceRun, watch: Callable[[float, RayScene], None] | None
    ) -> Traced:
        """Trace of direct paths alone."""
        static, names = self.static, (self.surfaces.object_names, self.surfaces.part_names)
        stop = stop if self.actors else start
        plan = run.plan(self._run_scene, start, stop)
        if plan.knots > _FEW_KNOTS or plan.time_error > min(_MISSED * self.rtol, _WRONG):
            run.indirect = self._follow(run.cull)
            return self.trace(start, stop, run, watch)
        traced = trace_direct(plan, start, stop, names)
        times = traced.paths.times
        if watch is not None and self.actors:
            for t in times.tolist():
                watch(t, self.rays_at(t))
        shadows, missed = self._static_shadows(times, traced.shadows)
        report = TraceReport(
            facets=len(static.facets) + traced.facets,
            rays=static.rays,
            sample_times=len(times),
            knots=len(times),
            error=max(static.error, traced.error),
            time_error=max(traced.time_error, missed),
            surface=traced.surface,
        )

        def none(_: float) -> FloatArray:
            return np.zeros((0, 3))

        return Traced(static.paths, lambda: shadows, traced.paths, None, report, traced.centroids, none)

    @cached_property
    def _run_scene(self) -> RunScene:
        """Actors, and the facets at rest that occlude them."""
        known = self.radar.max_range, self.rtol, self._vertices, self._static_shadows.facets.items
        return RunScene(self.surfaces.moving, self._band, *known)

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

    def _traced(
        self,
        knots: FloatArray,
        sample_times: FloatArray,
        parts: MovingTracer,
        turned: float = 0.0,
        watch: Callable[[float, RayScene], None] | None = None,
    ) -> Traced:
        """Trace with delays at `knots` and gains at `sample_times` [s]; `turned` is the time error so far."""
        scene = JointScene(
            self._static_facets, self.static_indirect, self._static_paths, self._vertices, self.rays_at, self._rays,
            bool(self.actors), self.rtol,
        )  # fmt: skip
        return trace_jointly(scene, knots, sample_times, parts, turned, watch)

    def rays_at(self, t: float, keep: bool = True) -> RayScene:
        """Static and moving meshes at `t` [s], valid until the next call; `keep` caches the vertices for the current
        interval."""
        if self.actors and self._rays_time != t:
            known = keep or t in self._positions
            self._rays.update(self._vertices(t) if known else [actor.vertices(t) for actor in self.actors])
            self._rays_time = t
        return self._rays
