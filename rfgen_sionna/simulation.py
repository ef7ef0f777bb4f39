"""Simulation of a radar in a scene with actors: paths, images and ADC samples."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._deprecation import Renamed, refuse_workers
from rfgen_sionna._short_repr import ShortRepr, name_list
from rfgen_sionna.dataset import Run
from rfgen_sionna.frame_loop import Frame, frame_samples, frame_tracer
from rfgen_sionna.pir import render_pir
from rfgen_sionna.pir.fused_tracer import FusedTracer, Refiner
from rfgen_sionna.pir.fusion import concatenate_paths, image
from rfgen_sionna.pir.projection import check_projection
from rfgen_sionna.pir.render import check_bounces, check_view
from rfgen_sionna.pir.view import View
from rfgen_sionna.radar import Radar
from rfgen_sionna.radar.profile import is_number
from rfgen_sionna.recording import Progress, record
from rfgen_sionna.records import AdcCube, Pir, RadarPaths
from rfgen_sionna.scene.checks.actor_overlap import check_actor_overlaps
from rfgen_sionna.scene.checks.actors import (
    POLICIES,
    OutsidePolicy,
    Policy,
    check_collisions,
    check_outside,
    check_places,
    warn_frozen,
    with_unique_names,
)
from rfgen_sionna.scene.checks.occlusion import is_occluded, warn_occluded
from rfgen_sionna.scene.checks.radar_distance import check_path_clear, check_radar_clear, nearest_surface
from rfgen_sionna.scene.checks.radar_interior import check_radar_placed
from rfgen_sionna.scene.devices import tabulated
from rfgen_sionna.scene.faceting import warn_coarse
from rfgen_sionna.scene.load import load_scene
from rfgen_sionna.scene.materials import warn_uncovered
from rfgen_sionna.scene.mesh_actor import MeshActor
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.scene.scene import RadarScene
from rfgen_sionna.signal import Receiver, receive
from rfgen_sionna.signal.noise import check_whole
from rfgen_sionna.signal.receiver.receiver_record import ReceiverSource, chosen_receiver
from rfgen_sionna.signal.synthesis import check_time, chosen_device
from rfgen_sionna.tolerance import SIMULATOR_RTOL, check_rtol
from rfgen_sionna.tracing.max_bounces import check_max_bounces
from rfgen_sionna.tracing.relative_scene import relative_objects

if TYPE_CHECKING:
    from rfgen_sionna.radar.radar import Vector
    from rfgen_sionna.tracing.tracer import Tracer


class Simulator(ShortRepr):
    """Traces a radar in a scene with actors and synthesises the samples of its ADC.

    Parameters
    ----------
    scene
        Scene of :func:`~rfgen_sionna.scene.load.load_scene`, or an argument of it; None is free space.
    radar
        Radar with its position in the scene.
    actors
        Moving objects; names must differ.
    rtol
        Tolerated relative error of each return (:mod:`rfgen_sionna.tolerance`).
    collisions
        Policy for an actor more than 5 cm deep in a wall, a piece of furniture or another actor: "error" refuses the
        run, "warn" warns, "ignore" does not check.
    outside
        Policy for an actor beyond the radar's `max_range`: "error" refuses the run; "ignore" leaves out its returns
        from there, at each time, as a receiver's filter does, so that actors may come into range or leave it.
    seed
        Seed of the phases of diffuse returns, from rough surfaces (`scattering_coefficient` above 0).
    max_bounces
        Largest number of surfaces on a path. 1: direct returns. 2: adds ghosts of actors by one reflection at a plane
        surface, before or after the actor, and specular double bounces between curved surfaces. 3: adds ghosts with
        two reflections. None is 3. Returns below `rtol` are left out.
    environment
        Image of surroundings, such as a diffusion model's, instead of a `scene`. It becomes diffuse paths, which
        occlude the actors and are occluded by them (:mod:`rfgen_sionna.pir.fusion`).
    refiner
        Model that corrects images of actors and `environment` together, such as path diffusion. Paths take energies
        from its images, never phases or delays.
    transmission
        Whether slabs, surfaces of a material with a thickness (walls, glass, clothing), transmit, with their loss and
        delay, up to four in a row, on every leg to actors. Metal and bodies stay opaque. False makes all surfaces
        opaque and is faster.

    Raises
    ------
    TypeError, ValueError
        Naming the argument, its value and the allowed values, also for a radar inside an object or below the ground.
    """

    def __init__(
        self,
        scene: RadarScene | Any | None,
        radar: Radar,
        actors: Sequence[MeshActor] = (),
        *,
        rtol: float = SIMULATOR_RTOL,
        collisions: Policy = "error",
        outside: OutsidePolicy = "error",
        seed: int = 0,
        max_bounces: int | None = 1,
        transmission: bool = False,
        environment: Pir | None = None,
        refiner: Refiner | None = None,
    ) -> None:
        if not isinstance(radar, Radar):
            raise TypeError(f"radar is a {type(radar).__name__}: a Radar is needed (Radar.load('awr1843'))")
        if isinstance(actors, MeshActor):
            actors = (actors,)
        if not isinstance(actors, Iterable) or getattr(actors, "ndim", 1) == 0:  # arrays of no axis are Iterable
            raise TypeError(f"actors is {actors!r}: a list of actors is needed, () for none")
        actors = tuple(actors)
        for actor in actors:
            if not isinstance(actor, MeshActor):
                raise TypeError(f"actors holds a {type(actor).__name__}: Actor.from_mesh and from_prompt make actors")
        self.rtol = check_rtol(rtol)
        if not isinstance(collisions, str) or collisions not in POLICIES:
            raise ValueError(f"collisions is {collisions!r}: allowed are {', '.join(map(repr, POLICIES))}")
        self.max_bounces = check_max_bounces(max_bounces)
        self.transmission = _switch("transmission", transmission)
        self.scene = load_scene(scene)
        self.radar = tabulated(radar)
        self.actors = with_unique_names(actors)
        self.collisions: Policy = collisions
        self.outside = check_outside(outside)
        self.seed = check_whole("seed", seed)
        self._warned_silent = False
        self._fusion: FusedTracer | None = None
        self.scene.tune(radar.center_frequency)
        self.scene.warn_unfollowed()
        for actor in self.actors:
            for properties in actor.materials:
                if properties.outside == "raise":
                    properties.check(radar.center_frequency, actor.name)
        warn_uncovered([each for actor in self.actors for each in actor.materials], radar.center_frequency)
        check_radar_clear(radar.position, self.scene, self.actors)
        runs = [(actor, actor.duration if np.isfinite(actor.duration) else 0.0) for actor in self.actors]
        check_radar_placed(
            radar.position, self.scene, lambda: not all(self.is_occluded(actor, 0.0, end) for actor, end in runs)
        )
        for actor in self.actors:
            warn_coarse(actor, stacklevel=2)
        if environment is None and refiner is not None:
            raise ValueError("refiner needs an environment, an image of the surroundings: give one or leave it out")
        if environment is not None:
            self._fusion = FusedTracer(self.tracer, environment, self.seed, refiner)

    def _facts(self) -> Iterable[str]:
        yield "free space" if self.scene.is_free_space else f"scene {self.scene.name!r}"
        yield f"radar {self.radar.name!r} ({self.radar.preset})"
        yield self.radar.cell_text
        yield f"actors {name_list(actor.name for actor in self.actors)}" if self.actors else "no actors"
        yield f"rtol {self.rtol:g}"
        yield f"max_bounces {self.max_bounces}"
        yield "transmission" if self.transmission else ""

    @cached_property
    def tracer(self) -> Tracer:
        """Tracer of the simulation."""
        from rfgen_sionna.tracing.tracer import Tracer  # loads numba

        return Tracer(self.scene, self.radar, self.actors, self.rtol, self.seed, self.max_bounces, self.transmission)

    @cached_property
    def _surroundings(self) -> RayScene | None:
        """Ray scene of the scene's surfaces; None for a scene without surfaces."""
        meshes = [(item.vertices, item.faces) for item in self.scene.objects]
        return RayScene(meshes, origin=self.radar.position) if meshes else None

    def paths(self, t: float = 0.0) -> RadarPaths:
        """All paths at time `t` [s], with a single knot.

        Gains are those of isotropic elements; their tolerance is relative to gains with the element patterns.
        """
        self._check_places(check_time("t", t), t)
        self._warn_silent()
        if self._fusion is not None:
            return concatenate_paths(self._fusion.instant(float(t)))
        return self.tracer.instant(float(t))

    def pir(
        self,
        t: float = 0.0,
        resolution: tuple[int, int] = (128, 128),
        fov_deg: float | tuple[float, float] = 60.0,
        position: Vector | None = None,
        orientation: Vector | None = None,
        bounces: int = 1,
        projection: str = "perspective",
    ) -> Pir:
        """Energy, time of arrival and velocity per pixel at time `t` [s], of paths by up to `bounces` (1 … 3) surfaces.

        See :func:`~rfgen_sionna.pir.render_pir`. Surroundings from an image are rasterised together with the actors'
        paths, best at the resolution and the field of view of that image.
        """
        shape = check_projection(projection)
        rows, columns, angles = check_view(resolution, fov_deg, shape)
        check_bounces(bounces)
        instant = check_time("t", t)
        view = self.radar.placed(position=position, orientation=orientation)
        if self._fusion is not None:
            if position is not None or self.radar.trajectory is not None:
                raise ValueError("position: surroundings from an image have the position of the radar: None is needed")
            if bounces != 1:
                raise ValueError(f"bounces is {bounces!r}: surroundings from an image have no reflections: 1 is needed")
            own = View((rows, columns), angles, view.position, view.orientation, shape)
            return image(self._fusion.instant(instant), own, instant)
        pose = view.position, view.orientation
        pir = render_pir(self.tracer, instant, resolution, angles, *pose, bounces=bounces, projection=shape)
        if self.radar.trajectory is None:
            return pir
        here = self.radar.at(instant)
        return replace(pir, position=here.position, orientation=here.orientation)

    def adc(
        self,
        duration: float,
        *,
        start: float = 0.0,
        noise: bool = True,
        seed: int = 0,
        receiver: ReceiverSource | None = None,
        device: str = "auto",
        progress: Progress | None = None,
        workers: None = None,
    ) -> AdcCube:
        """Samples of all frames that fit into `duration` [s].

        Parameters
        ----------
        duration
            [s]; at least one frame must fit.
        start
            Start of the first frame [s] on the actors' clock.
        noise
            Whether thermal noise is added. False removes it from `receiver`; without a `receiver` the samples are
            ideal, neither noisy nor quantised.
        seed
            Seed of all draws of the receiver; the same seed gives the same bits.
        receiver
            Impairments of the receiver: a Receiver, a table of its parts or a TOML file with such a table
            (:func:`~rfgen_sionna.signal.read_receiver`); None is `Receiver()`: thermal noise and the radar's ADC. The
            first frame sets an automatic full scale.
        device
            Device that sums the paths: "cpu", "cuda" (the first CUDA device), or "auto", CUDA if available. Each gives
            the same bits again; both are within the tolerance.
        progress
            Called after each frame.
        workers
            Removed, anything else than None is refused: a data set has processes that make its recordings.

        Raises
        ------
        TypeError, ValueError
            Before any frame is traced, naming the argument, its value and the allowed values.
        """
        if progress is not None and not callable(progress):
            raise TypeError(f"progress is {progress!r}: a function of two numbers of frames, or None, is needed")
        times = self.frame_times(duration, start)
        data = np.empty((len(times), *self.radar.frame_shape), dtype=self.radar.sample_type)
        refuse_workers(workers)
        for frame in self.frames(duration, start=start, noise=noise, seed=seed, receiver=receiver, device=device):
            data[frame.index] = frame.samples
            if progress is not None:
                progress(frame.index + 1, len(times))
        return AdcCube(data, self.radar, times, seed if noise or receiver is not None else None)

    def frames(
        self,
        duration: float,
        *,
        start: float = 0.0,
        noise: bool = True,
        seed: int = 0,
        receiver: ReceiverSource | None = None,
        device: str = "auto",
        first_frame: int = 0,
        full_scale: float | None = None,
        keep_paths: bool = False,
        workers: None = None,
    ) -> Iterator[Frame]:
        """Iterator over the frames of :meth:`adc`, with constant memory; it traces the next frame meanwhile.

        Frames before number `first_frame` are left out; `full_scale` [sqrt(W)] is then theirs, for an automatic ADC.
        With `keep_paths` frames have their paths (`Frame.traced`).
        """
        refuse_workers(workers)
        seed, noise = check_whole("seed", seed), _switch("noise", noise)
        first_frame = check_whole("first_frame", first_frame)
        known = chosen_receiver(receiver, self.radar, noise)
        device = chosen_device(device)
        times = self.frame_times(duration, start)
        begin, end = float(times[0]), float(times[-1]) + self.radar.waveform.frame_length
        self._check_places(begin, end)
        warn_frozen(self.actors, begin, end, stacklevel=2)
        if self._fusion is not None:
            what, occluder = "surroundings that the image shows", self._fusion.surroundings
            warn_occluded(self.radar, occluder, self.actors, begin, end, what, much=True, stacklevel=2)
        elif not self.transmission and self._surroundings is not None:
            what, rays = "scene's surfaces", self._surroundings
            warn_occluded(self.radar, rays, self.actors, begin, end, what, much=False, stacklevel=2)
        return self._frames(times, known, seed, device, first_frame, full_scale, keep_paths)

    def _frames(
        self, times: NDArray[np.float64], receiver: Receiver, seed: int, device: str, first: int,
        full_scale: float | None, keep_paths: bool,
    ) -> Iterator[Frame]:  # fmt: skip
        trace, gains = frame_tracer(self.tracer, self._fusion, times), receiver.tx_gains(self.radar, seed)
        given = self.radar, trace, times, self.rtol, gains, device, self._warn_silent, first, keep_paths
        for index, (samples, traced) in enumerate(frame_samples(*given), first):
            capture = receive(samples, self.radar, receiver, seed=seed, frame=index, full_scale=full_scale)
            full_scale, paths = capture.full_scale, traced.image_paths
            found = capture.samples, traced.report, full_scale, capture.clipped, paths, traced if keep_paths else None
            yield Frame(index, traced.begin, *found)

    def record(self, output: str | PathLike[str], duration: float, **options: Any) -> Run:
        """Write the frames of :meth:`adc` to an HDF5 file, with meshes, joints and labels of the actors, and open it.

        `options` are those of :func:`rfgen_sionna.record`, which writes several radars to one file: `start`, `noise`,
        `seed`, `receiver`, `device`, `pir_resolution`, `fov_deg`, `projection`, `keep`, `words`,
        `overwrite`, `resume`, `progress`.
        """
        return record(output, self, duration, **options)

    def is_occluded(self, actor: MeshActor, start: float, stop: float) -> bool:
        """Whether static surfaces, or surroundings from an image, occlude all of `actor` from the radar from `start` to
        `stop` [s], at sampled times."""
        occluder = self._surroundings if self._fusion is None else self._fusion.surroundings
        return is_occluded(self.radar, occluder, actor, start, stop)

    hidden = Renamed("is_occluded")

    @property
    def rays(self) -> NoReturn:
        raise AttributeError("Simulator.rays was removed: its ray mode is a test reference, tests/reference/sbr")

    def frame_times(self, duration: float, start: float = 0.0) -> NDArray[np.float64]:
        """(frame,) starts of the frames that fit into `duration` [s]; ValueError where none fits."""
        waveform = self.radar.waveform
        if not (is_number(duration) and duration > 0):
            raise ValueError(f"duration is {duration!r} s: a positive, finite time is needed")
        if duration < waveform.frame_length * (1 - 1e-9):
            raise ValueError(
                f"duration is {duration:g} s but one frame of radar '{self.radar.name}' (preset '{self.radar.preset}') "
                f"takes {waveform.frame_length:.6g} s: give at least that"
            )
        count = max(1, int(np.floor(duration / waveform.frame_period + 1e-9)))
        return np.asarray(check_time("start", start) + np.arange(count) * waveform.frame_period, dtype=np.float64)

    def _check_places(self, start: float, stop: float) -> None:
        """Check positions of radar and actors from `start` to `stop` [s]: distances, range window, collisions."""
        check_path_clear(self.radar, self.scene, self.actors, start, stop)
        moves = self.radar.trajectory is not None
        placed = relative_objects(self.radar, None, self.actors) if moves else self.actors
        check_places(self.radar, placed, start, stop, self.outside, stacklevel=3)
        check_collisions(self.scene, self._surroundings, self.actors, start, stop, self.collisions, stacklevel=3)
        check_actor_overlaps(self.actors, start, stop, self.collisions, 3, self.radar.pose(start)[0])

    def _warn_silent(self) -> None:
        """Warn once about a scene without any return."""
        if self._warned_silent or self.scene.is_free_space or self.radar.trajectory is not None:
            return
        self._warned_silent = True
        if self.tracer.static.paths.a.any():
            return
        name, reach = nearest_surface(self.radar.position, self.scene)
        limit = self.radar.max_range
        why = f"its nearest surface, {name!r}, is {reach:.2f} m away and the range window ends at {limit:.2f} m"
        if reach <= limit:
            why += ", but no surface within it is visible"
        warnings.warn(f"the radar receives nothing of scene '{self.scene.name}': {why}", stacklevel=3)


def _switch(name: str, value: Any) -> bool:
    if not isinstance(value, (bool, np.bool_)):
        raise TypeError(f"{name} is {value!r}: True or False is needed")
    return bool(value)
