"""Runs of one or several radars, written frame by frame."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._deprecation import refuse_workers
from rfgen_sionna.dataset import STANDARD_LABELS, ActorInfo, Run, RunInfo, RunWriter, check_run_output, open_run
from rfgen_sionna.dataset.actor_bodies import ActorBody
from rfgen_sionna.dataset.actor_labels import actor_labels
from rfgen_sionna.dataset.disk_space import check_free, frame_bytes, image_bytes
from rfgen_sionna.dataset.frame_writer import FrameWriter
from rfgen_sionna.dataset.representations import checked_keep, representation_arrays, representation_values
from rfgen_sionna.dataset.stored_paths import write_frame_paths, write_static_paths
from rfgen_sionna.frame_loop import Frame
from rfgen_sionna.pir import View, image
from rfgen_sionna.pir.projection import check_projection
from rfgen_sionna.pir.render import check_view
from rfgen_sionna.progress_bar import progress_bar
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import Pir
from rfgen_sionna.scene.mesh_actor import MeshActor
from rfgen_sionna.scene.scene import RadarScene
from rfgen_sionna.signal import receiver_record
from rfgen_sionna.signal.receiver.receiver_record import ReceiverSource, chosen_receiver

Progress = Callable[[int, int], None]
"""Function of the number of finished frames and of all frames."""


class Simulation(Protocol):
    """Simulation of one radar: a :class:`rfgen_sionna.simulation.Simulator`."""

    scene: RadarScene
    radar: Radar
    actors: tuple[MeshActor, ...]
    rtol: float
    seed: int
    max_bounces: int
    transmission: bool

    def frame_times(self, duration: float, start: float = 0.0) -> NDArray[np.float64]: ...

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
    ) -> Iterator[Frame]: ...

    def pir(
        self, t: float, resolution: tuple[int, int], fov_deg: float | tuple[float, float], *, projection: str
    ) -> Pir: ...


@dataclass(frozen=True)
class ImageView:
    """Pixels (rows, columns), field of view [degrees] and projection of the images of a run."""

    resolution: tuple[int, int]
    fov_deg: float | tuple[float, float]
    projection: str


@dataclass(frozen=True)
class RunPlan:
    """Run of one radar before its first frame."""

    simulation: Simulation
    info: RunInfo
    view: ImageView | None
    """None for a run without images."""
    count: int
    """Number of frames."""
    frames: Callable[[int, float | None], Iterator[Frame]]
    """Frames from a number on; the second argument is the full scale of those before [sqrt(W)]."""
    keep: tuple[str, ...] | None = None
    """What is stored, of :data:`rfgen_sionna.dataset.representations.KEPT`; None stores samples, meshes, joints, labels
    and images."""
    bodies: tuple[ActorBody, ...] = ()
    """Actors that are stored as parameters."""

    def stores(self, name: str) -> bool:
        """Whether something is stored."""
        return name in self.keep if self.keep is not None else name in ("adc", "vertices", "joints", "labels", "pir")


def record(
    output: str | PathLike[str],
    simulators: Simulation | Sequence[Simulation] | Mapping[str, Simulation],
    duration: float,
    *,
    start: float = 0.0,
    noise: bool = True,
    seed: int = 0,
    receiver: ReceiverSource | None = None,
    device: str = "auto",
    pir_resolution: tuple[int, int] | None = None,
    fov_deg: float | tuple[float, float] = 60.0,
    projection: str = "perspective",
    keep: Collection[str] | None = None,
    words: bool = False,
    overwrite: bool = False,
    resume: bool = False,
    progress: bool | Progress = False,
    workers: None = None,
) -> Run:
    """Write the frames of simulators to one HDF5 file, with meshes, joints and labels of all actors.

    Parameters
    ----------
    output
        File to write (:mod:`rfgen_sionna.dataset.schema`).
    simulators
        A :class:`~rfgen_sionna.simulation.Simulator`, or those of several radars, as a list or as a dictionary with
        their names in the file. In a list they have the names of their radars, numbered where two are the same.
    duration, start, noise, seed, receiver, device
        As in :meth:`rfgen_sionna.simulation.Simulator.adc`, for each simulator.
    pir_resolution, fov_deg, projection
        Pixels (rows, columns), field of view [degrees] and projection of a PIR image of each frame; None stores none.
    keep
        What is stored, names of :data:`rfgen_sionna.dataset.representations.KEPT`: "adc", "range_doppler", "drai",
        "micro_doppler", "point_cloud", "pir", "vertices", "body" (parameters that rebuild the meshes), "joints",
        "labels", "paths". None stores samples, vertices, joints and labels, and images with `pir_resolution`.
    words
        Whether quantised samples of up to 16 bits are stored as the words of the ADC, without a loss, in half the
        space.
    overwrite
        Whether an existing file is replaced.
    resume
        Whether an interrupted call keeps its frames (`.NAME.partial` beside the file) and the same call continues after
        them. Of a file that is complete, the same call returns the run. Samples are within the tolerance of those
        without an interruption.
    progress
        True shows a bar; a function is called with the numbers of finished frames and of all frames.
    workers
        Removed, as in :meth:`rfgen_sionna.simulation.Simulator.adc`.

    Returns
    -------
    The written run, open for a read; of several radars `run[name]` is that of each.

    Raises
    ------
    ValueError, TypeError
        Before any long work, naming the argument, its value and the allowed values.
    """
    refuse_workers(workers)
    for name, value in (("overwrite", overwrite), ("resume", resume)):
        if not isinstance(value, bool):
            raise TypeError(f"{name} is {value!r}: True or False is needed")
    named = _by_name(simulators)
    view = None if pir_resolution is None else ImageView(pir_resolution, fov_deg, projection)
    if view is not None:
        check_view(view.resolution, view.fov_deg, view.projection)
    plans = {}
    for name, simulation in named.items():
        info = run_info(
            simulation, simulation.frame_times(duration, start), noise=noise, seed=seed, receiver=receiver,
        )  # fmt: skip
        options: dict[str, Any] = {"start": start, "noise": noise, "seed": seed, "receiver": receiver, "device": device}
        plans[name] = run_plan(simulation, info, view, duration, keep=keep, **options)
    return write_run(output, plans, overwrite=overwrite, resume=resume, progress=progress, words=words)


def _by_name(simulators: Any) -> dict[str, Any]:
    """Simulators by their names in the file, which is empty for a single one; TypeError or ValueError else."""
    if isinstance(simulators, Sequence) and len(simulators) == 1:
        simulators = simulators[0]
    if isinstance(simulators, Mapping):
        named = dict(simulators)
    elif isinstance(simulators, Sequence):
        names = [getattr(getattr(each, "radar", None), "name", "") for each in simulators]
        named = {
            f"{name} {names[: place + 1].count(name)}" if names.count(name) > 1 else name: each
            for place, (name, each) in enumerate(zip(names, simulators, strict=True))
        }
    else:
        named = {"": simulators}
    if not named:
        raise ValueError("simulators is empty: at least one Simulator is needed")
    for name, each in named.items():
        if not callable(getattr(each, "frames", None)) or not isinstance(getattr(each, "radar", None), Radar):
            raise TypeError(f"simulators holds a {type(each).__name__}: a Simulator is needed")
        if not isinstance(name, str) or "/" in name or name in (".", "..") or (not name and each is not simulators):
            raise ValueError(f"simulators has the name {name!r}: a text without '/' is needed")
    return named


def run_info(
    simulation: Simulation, times: NDArray[np.float64], *, noise: bool, seed: int, receiver: ReceiverSource | None,
    **more: Any,
) -> RunInfo:  # fmt: skip
    """Properties of a run with frames at `times` [s]; `more` are further ones, or replace those of the actors.

    Raises
    ------
    TypeError, ValueError
        If no file can hold the radar, or the receiver does not fit.
    """
    radar, actors, scene = simulation.radar, simulation.actors, simulation.scene
    radar.to_dict()
    said: list[Any] = [actor for actor in actors if getattr(actor, "prompt", None) is not None]
    known: dict[str, Any] = {
        "prompt": "; ".join(actor.prompt.text for actor in said),
        "report": "\n\n".join(actor.report() for actor in said),
        "environment": "" if scene.is_free_space else scene.name,
        "seeds": {"speckle": simulation.seed, "noise": seed if noise or receiver is not None else None},
    }
    moments = (float(times[0]), float(times.mean()), float(times[-1]))
    return RunInfo(
        radar=radar,
        actors=tuple(map(ActorInfo.of, actors)),
        labels=STANDARD_LABELS if actors else {},
        receiver=receiver_record(chosen_receiver(receiver, radar, noise)),
        settings={
            "rtol": simulation.rtol,
            "max_bounces": simulation.max_bounces,
            "transmission": simulation.transmission,
            "frames": len(times),
            "start": float(times[0]),
            "scene": array_digest(each for item in scene.objects for each in (item.vertices, item.faces)),
            "actors": {actor.name: array_digest([actor.faces, *map(actor.vertices, moments)]) for actor in actors},
            "materials": {actor.name: actor.material_names for actor in actors},
        },
        **known | more,
    )


def array_digest(arrays: Iterable[Any]) -> str:
    """Digest of arrays, equal for equal ones."""
    found = hashlib.sha256()
    for array in arrays:
        found.update(np.ascontiguousarray(array).tobytes())
    return found.hexdigest()[:16]


def run_plan(
    simulation: Simulation, info: RunInfo, view: ImageView | None, duration: float, *,
    keep: Collection[str] | None = None, **options: Any,
) -> RunPlan:  # fmt: skip
    """Run of `duration` [s] that stores what `keep` names, as of :func:`record`; `options` are those of
    :meth:`rfgen_sionna.simulation.Simulator.frames`.

    Raises
    ------
    TypeError, ValueError
        If `keep` has an unknown name, or something that this radar or an actor has not.
    """
    names = None if keep is None else checked_keep(keep, view is not None)
    bodies: tuple[ActorBody, ...] = ()
    if names is not None:
        bodies = tuple(map(ActorBody, simulation.actors)) if "body" in names else ()
        arrays = representation_arrays(names, simulation.radar)
        for body in bodies:
            arrays |= body.arrays
        info = replace(
            info, arrays={**info.arrays, **arrays}, settings={**info.settings, "keep": list(names)},
            labels=info.labels if "labels" in names else {},
        )  # fmt: skip
        view = view if "pir" in names else None
        options |= {"keep_paths": True} if "paths" in names else {}

    def frames(first: int, full_scale: float | None) -> Iterator[Frame]:
        return simulation.frames(duration, **options, first_frame=first, full_scale=full_scale)

    count = len(simulation.frame_times(duration, options.get("start", 0.0)))
    return RunPlan(simulation, info, view, count, frames, names, bodies)


def write_run(
    output: str | PathLike[str],
    plans: Mapping[str, RunPlan],
    *,
    overwrite: bool,
    resume: bool = False,
    progress: bool | Progress | None = False,
    words: bool = False,
    compressed: bool = False,
    dated: bool = True,
) -> Run:
    """Write the frames of all `plans` to a file and open it. The name of the only radar of a file is empty; `words`,
    `compressed` and `dated` are those of :class:`rfgen_sionna.dataset.RunWriter`."""
    target = Path(output)
    infos: Any = plans[""].info if "" in plans else {name: plan.info for name, plan in plans.items()}
    if resume and target.is_file() and not overwrite:
        with open_run(target) as run:
            same = run.is_same(infos)
        if same:
            return open_run(target)
    target = check_run_output(output, overwrite)
    _check_space(target, plans)
    total = sum(plan.count for plan in plans.values())
    stored: dict[str, Any] = {"keep": next(iter(plans.values())).keep, "words": words}
    stored |= {"compressed": compressed, "dated": dated}
    with (
        RunWriter(target, infos, overwrite=overwrite, resume=resume, **stored) as writer,
        _shown(progress) as step,
    ):
        for name, plan in plans.items():
            series = writer.radar(name)
            for body in plan.bodies:
                body.describe(series.group)
                for path, (values, array) in body.constants.items():
                    if path not in series.group:
                        writer.add_array(path, values, array, radar=name)
            if series.frames >= plan.count:
                continue
            for frame in plan.frames(series.frames, series.full_scale):
                _write_paths(series, frame)
                writer.append(**_contents(plan, frame), radar=name)
                step(writer.frames, total)
    return open_run(target)


def _write_paths(series: FrameWriter, frame: Frame) -> None:
    """Write the paths of a frame that has them, those of the static scene once."""
    if frame.traced is not None:
        write_static_paths(series.group, frame.traced.static, frame.traced.num_static)
        write_frame_paths(series.group, frame.index, frame.traced.parts())


def _shown(progress: bool | Progress | None) -> AbstractContextManager[Progress]:
    if progress is True:
        return progress_bar("frames")
    if progress is None or progress is False:
        return nullcontext(lambda done, total: None)
    if not callable(progress):
        raise TypeError(f"progress is {progress!r}: True, False or a function of two numbers of frames is needed")
    return nullcontext(progress)


def _contents(plan: RunPlan, frame: Frame) -> dict[str, Any]:
    """Arguments of :meth:`rfgen_sionna.dataset.RunWriter.append`: meshes, labels and image of the middle of a frame."""
    simulation, radar = plan.simulation, plan.simulation.radar
    t = frame.time + 0.5 * radar.waveform.frame_length
    pir = None
    if plan.view is not None:
        shape = check_projection(plan.view.projection)
        if frame.paths:
            angles = check_view(plan.view.resolution, plan.view.fov_deg, shape)[2]
            own = View(plan.view.resolution, angles, radar.position, radar.orientation, shape)
            pir = image(frame.paths, own, t)
        else:
            pir = simulation.pir(t, plan.view.resolution, plan.view.fov_deg, projection=shape)
    actors, arrays = simulation.actors, dict[str, Any]()
    if plan.keep is not None:
        arrays |= representation_values(plan.keep, frame.samples, radar)
    for body in plan.bodies:
        arrays |= body.values(t)
    return {
        "adc": frame.samples if plan.stores("adc") else None,
        "time": frame.time,
        "pir": pir,
        "mesh_time": t,
        "full_scale": frame.full_scale,
        "clipped": frame.clipped,
        "vertices": {actor.name: actor.vertices(t) for actor in actors} if plan.stores("vertices") else {},
        "joints": {each.name: each.joints(t) for each in actors if each.joint_names} if plan.stores("joints") else {},
        "labels": actor_labels(actors, radar, t) if plan.stores("labels") else {},
        "arrays": arrays,
    }


def _check_space(target: Path, plans: Mapping[str, RunPlan]) -> None:
    """DiskSpaceError if the disk of `target` has no room for the frames; paths and representations are left out."""
    needed = 0
    for plan in plans.values():
        radar, actors = plan.info.radar, plan.info.actors
        points = sum(actor.num_vertices for actor in actors) if plan.stores("vertices") else 0
        points += sum(len(actor.joint_names) for actor in actors) if plan.stores("joints") else 0
        image = image_bytes(plan.view.resolution if plan.view else None)
        needed += plan.count * (image + 12 * points + (frame_bytes(radar) if plan.stores("adc") else 0))
    check_free(target, needed)
