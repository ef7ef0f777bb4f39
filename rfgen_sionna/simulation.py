"""A radar, a scene and actors put together: paths, images and samples of any instant."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.pir import render_pir
from rfgen_sionna.pir.render import check_view
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import AdcCube, FloatArray, Pir, RadarPaths
from rfgen_sionna.scene.actor import Actor
from rfgen_sionna.scene.clearance import CLEARANCE, Body, check_radar_clear, check_way_clear
from rfgen_sionna.scene.devices import tabulated
from rfgen_sionna.scene.load import RadarScene, load_scene
from rfgen_sionna.signal import Receiver, receive, synthesize
from rfgen_sionna.tracing.relative import seen_from
from rfgen_sionna.tracing.tracer import Tracer, TraceReport

if TYPE_CHECKING:
    from rfgen_sionna.radar.radar import Vector

Progress = Callable[[int, int], None]
"""Called with the number of frames done and in all."""

CHECK_STEP = 0.05
"""Time [s] between the instants of a run at which the actors' places are checked before the work starts."""
HIDING_INSTANTS = 9
"""Instants of a run, and below them points of an actor, at which it is looked for behind the scene's surfaces."""
HIDING_POINTS = 64
MIN_CHECK_STEP = 1e-4
"""Shortest such time where an actor passes the radar [s]."""


@dataclass(frozen=True)
class Frame:
    """One frame of a run."""

    index: int
    time: float
    """Start of the first ramp [s]."""
    samples: NDArray[np.complex128]
    """(chirp, tx, rx, sample) in square roots of watts."""
    report: TraceReport
    full_scale: float | None = None
    """Largest I or Q of the ADC [sqrt(W)]; None where the samples are not quantised."""
    clipped: float = 0.0
    """Share of the words of I and Q that were beyond the ADC's range."""


class Simulator:
    """Traces a radar in a scene with actors and synthesises what its ADC takes.

    Parameters
    ----------
    scene
        A scene of :func:`~rfgen_sionna.scene.load.load_scene` or anything that it takes; None is free space.
    radar
        The radar, placed in the scene.
    actors
        What moves; names must differ.
    rtol
        Relative error that the tracer may make: a smaller value means more facets, knots and time.

    Raises
    ------
    TypeError, ValueError
        Naming what was given and what is allowed; among them a radar inside of an object.
    """

    def __init__(
        self, scene: RadarScene | Any | None, radar: Radar, actors: Sequence[Actor] = (), *, rtol: float = 1e-3
    ) -> None:
        if not isinstance(radar, Radar):
            raise TypeError(f"radar is a {type(radar).__name__}: a Radar is needed (Radar.load('awr1843'))")
        if isinstance(actors, Actor):
            actors = (actors,)
        if not isinstance(actors, Iterable):
            raise TypeError(f"actors is {actors!r}: a list of actors is needed, () for none")
        actors = tuple(actors)
        for actor in actors:
            if not isinstance(actor, Actor):
                raise TypeError(f"actors holds a {type(actor).__name__}: Actor.from_mesh and from_prompt make actors")
        if not (isinstance(rtol, (int, float, np.number)) and 1e-8 <= rtol <= 0.1):
            raise ValueError(f"rtol is {rtol!r}: a value in 1e-8 … 0.1 is needed")
        self.scene = load_scene(scene)
        self.radar = tabulated(radar)
        self.actors = _with_unique_names(actors)
        self.rtol = float(rtol)
        self.scene.tune(radar.center_frequency)
        check_radar_clear(radar.position, self.scene, self.actors)

    @cached_property
    def tracer(self) -> Tracer:
        """The tracer behind the simulation."""
        return Tracer(self.scene, self.radar, self.actors, self.rtol)

    def paths(self, t: float = 0.0) -> RadarPaths:
        """All paths at instant `t` [s]: gains, delays, rates and labels; a single knot."""
        self._check_places(_time("t", t), t)
        return self.tracer.instant(float(t))

    def pir(
        self,
        t: float = 0.0,
        resolution: tuple[int, int] = (128, 128),
        fov_deg: float | tuple[float, float] = 60.0,
        position: Vector | None = None,
        orientation: Vector | None = None,
    ) -> Pir:
        """Energy, time of arrival and velocity per pixel at instant `t` [s]: :func:`~rfgen_sionna.pir.render_pir`."""
        check_view(resolution, fov_deg)
        instant = _time("t", t)
        view = self.radar.placed(position=position, orientation=orientation)
        pir = render_pir(self.tracer, instant, resolution, fov_deg, view.position, view.orientation)
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
        receiver: Receiver | None = None,
        progress: Progress | None = None,
    ) -> AdcCube:
        """Samples of all frames that fit into `duration` [s].

        Parameters
        ----------
        duration
            [s]; at least one frame must fit.
        start
            Start of the first frame [s] on the actors' clock.
        noise
            Whether the receiver is noisy. False takes the thermal noise out of `receiver`; without a `receiver` the
            samples are those of an ideal one, neither noisy nor quantised.
        seed
            Seed of all that the receiver draws; the same seed gives the same samples to the bit.
        receiver
            The receiver's impairments; None is `Receiver()`: thermal noise and the radar's ADC. An automatic full scale
            is set from the first frame and kept.
        progress
            Called after each frame.
        """
        times = self.frame_times(duration, start)
        data = np.empty((len(times), *self.radar.frame_shape), dtype=np.complex64)
        for frame in self.frames(duration, start=start, noise=noise, seed=seed, receiver=receiver):
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
        receiver: Receiver | None = None,
    ) -> Iterator[Frame]:
        """The frames of :meth:`adc` one by one; memory does not grow with their number."""
        if isinstance(seed, bool) or not isinstance(seed, (int, np.integer)) or seed < 0:
            raise ValueError(f"seed is {seed!r}: a whole number of at least 0 is needed")
        if receiver is not None and not isinstance(receiver, Receiver):
            raise TypeError(f"receiver is a {type(receiver).__name__}: a Receiver or None is needed")
        if receiver is None:
            receiver = Receiver() if noise else Receiver.ideal()
        elif not noise:
            receiver = receiver.without_noise()
        receiver.check(self.radar)
        times = self.frame_times(duration, start)
        begin, end = float(times[0]), float(times[-1]) + self.radar.waveform.frame_length
        self._check_places(begin, end)
        self._warn_frozen(begin, end)
        for actor in self.actors:
            if self.hidden(actor, begin, end):
                warnings.warn(
                    f"actor '{actor.name}' is behind the scene's surfaces all along: the radar receives nothing of it",
                    stacklevel=2,
                )
        return self._frames(times, receiver, int(seed))

    def _frames(self, times: NDArray[np.float64], receiver: Receiver, seed: int) -> Iterator[Frame]:
        eps = max(0.3 * self.rtol, 1e-9)
        full_scale = None
        for index, begin in enumerate(times):
            traced = self.tracer.trace(float(begin), float(begin) + self.radar.waveform.frame_length)
            if index == 0:
                # Nothing in it changes: one synthesis serves every frame.
                still = synthesize(self.radar, traced.static, 0.0, eps=eps)
            samples = still + synthesize(self.radar, traced.moving, float(begin), eps=eps)
            if traced.shadow.num_paths:
                samples += synthesize(self.radar, traced.shadow, float(begin), eps=eps)
            capture = receive(samples, self.radar, receiver, seed=seed, frame=index, full_scale=full_scale)
            full_scale = capture.full_scale
            yield Frame(index, float(begin), capture.samples, traced.report, full_scale, capture.clipped)

    def hidden(self, actor: Actor, start: float, stop: float) -> bool:
        """Whether static surfaces hide `actor` from the radar from `start` to `stop` [s], at every instant tried."""
        for t in np.linspace(start, stop, HIDING_INSTANTS):
            vertices = actor.vertices(float(t))
            points = vertices[:: max(1, len(vertices) // HIDING_POINTS)]
            if not self.tracer.behind_scene(points).all():
                return False
        return True

    def frame_times(self, duration: float, start: float = 0.0) -> NDArray[np.float64]:
        """(frame,) starts of the frames that fit into `duration` [s]."""
        waveform = self.radar.waveform
        if not (_is_number(duration) and duration > 0):
            raise ValueError(f"duration is {duration!r} s: a positive, finite time is needed")
        if duration < waveform.frame_length * (1 - 1e-9):
            raise ValueError(
                f"duration is {duration:g} s but one frame of radar '{self.radar.name}' (preset '{self.radar.preset}') "
                f"takes {waveform.frame_length:.6g} s: give at least that"
            )
        count = max(1, int(np.floor(duration / waveform.frame_period + 1e-9)))
        return np.asarray(_time("start", start) + np.arange(count) * waveform.frame_period, dtype=np.float64)

    def _check_places(self, start: float, stop: float) -> None:
        """Every actor within the range window, and none of them around the radar or through it, all along."""
        check_way_clear(self.radar, self.scene, self.actors, start, stop)
        moves = self.radar.trajectory is not None
        for actor in seen_from(self.radar, None, self.actors) if moves else self.actors:
            steps = max(1, math.ceil((stop - start) / CHECK_STEP))
            earlier = (start, self._placed_vertices(actor, start))
            check_radar_clear(self.radar.position, None, [actor], start)
            for t in np.linspace(start, stop, steps + 1)[1:] if stop > start else ():
                later = (float(t), self._placed_vertices(actor, float(t)))
                self._check_passage(actor, earlier, later)
                earlier = later

    def _warn_frozen(self, start: float, stop: float) -> None:
        """Actors hold their first and last pose outside of their motion: a stop that nobody meant, most often."""
        for actor in self.actors:
            if np.isfinite(actor.duration) and (start < -1e-9 or stop > actor.duration + 1e-9):
                warnings.warn(
                    f"actor '{actor.name}' moves from 0 to {actor.duration:.3f} s and holds its pose before and after; "
                    f"the run lasts from {start:.3f} to {stop:.3f} s",
                    stacklevel=3,
                )

    def _placed_vertices(self, actor: Body, t: float) -> FloatArray:
        """(vertex, 3) world positions [m], all of them within the range window."""
        points = actor.vertices(t)
        reach = float(np.linalg.norm(points - np.asarray(self.radar.position), axis=1).max())
        if not np.isfinite(reach):
            raise ValueError(f"actor '{actor.name}' has vertices that are not finite at t = {t:.3f} s")
        if reach > self.radar.max_range:
            raise ValueError(
                f"actor '{actor.name}' reaches {reach:.2f} m from the radar at t = {t:.3f} s; the ADC's range window "
                f"ends at {self.radar.max_range:.2f} m: move it closer, or take a preset with a lower slope or a "
                "higher sample rate"
            )
        return points

    def _check_passage(self, actor: Body, earlier: tuple[float, FloatArray], later: tuple[float, FloatArray]) -> None:
        """The actor does not meet the radar between two instants; looked at in steps of less than the clearance."""
        place = np.asarray(self.radar.position)
        (t0, before), (t1, after) = earlier, later
        low, high = np.minimum(before, after).min(axis=0), np.maximum(before, after).max(axis=0)
        if (place < low - CLEARANCE).any() or (place > high + CLEARANCE).any():
            return
        if t1 - t0 > MIN_CHECK_STEP and np.linalg.norm(after - before, axis=1).max() > CLEARANCE:
            t = 0.5 * (t0 + t1)
            middle = (t, actor.vertices(t))
            self._check_passage(actor, earlier, middle)
            self._check_passage(actor, middle, later)
        else:
            check_radar_clear(self.radar.position, None, [actor], t1)


def _with_unique_names(actors: Sequence[Actor]) -> tuple[Actor, ...]:
    names = [actor.name for actor in actors]
    doubled = {name for name in names if names.count(name) > 1}
    if doubled:
        raise ValueError(f"actors share the name '{min(doubled)}': give each a name of its own (name=…)")
    return tuple(actors)


def _time(name: str, value: Any) -> float:
    if not _is_number(value):
        raise ValueError(f"{name} is {value!r}: a finite time [s] is needed")
    return float(value)


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float, np.number)) and not isinstance(value, bool) and bool(np.isfinite(value))
