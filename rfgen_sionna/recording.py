"""Runs of one or several radars, written frame by frame."""

from __future__ import annotations

import hashlib
import math
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.dataset import STANDARD_LABELS, ActorInfo, Run, RunInfo, RunWriter, check_run_output, open_run
from rfgen_sionna.dataset.actor_labels import actor_labels
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
        workers: int = 1,
        first_frame: int = 0,
        full_scale: float | None = None,
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
    workers: int = 1,
    pir_resolution: tuple[int, int] | None = None,
    fov_deg: float | tuple[float, float] = 60.0,
    projection: str = "perspective",
    overwrite: bool = False,
    resume: bool = False,
    progress: bool | Progress = False,
) -> Run:
    """Write the frames of simulators to one HDF5 file, with meshes, joints and labels of all actors.

    Parameters
    ----------
    output
        File to write (:mod:`rfgen_sionna.dataset.schema`).
    simulators
        A :class:`~rfgen_sionna.simulation.Simulator`, or those of several radars, as a list or as a dictionary with
        their names in the file. In a list they have the names of their radars, numbered where two are the same.
    duration, start, noise, seed, receiver, device, workers
        As in :meth:`rfgen_sionna.simulation.Simulator.adc`, for each simulator.
    pir_resolution, fov_deg, projection
        Pixels (rows, columns), field of view [degrees] and projection of a PIR image of each frame; None stores none.
    overwrite
        Whether an existing file is replaced.
    resume
        Whether an interrupted call keeps its frames (`.NAME.partial` beside the file) and the same call continues after
        them. Of a file that is complete, the same call returns the run. With two or more workers the samples are the
        same bits as without an interruption; one worker's are within the tolerance.
    progress
        True shows a bar; a function is called with the numbers of finished frames and of all frames.

    Returns
    -------
    The written run, open for a read; of several radars `run[name]` is that of each.

    Raises
    ------
    ValueError, TypeError
        Before any long work, naming the argument, its value and the allowed values.
    """
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
        options: dict[str, Any] = {"start": start, "noise": noise, "seed": seed, "receiver": receiver}
        options |= {"device": device, "workers": workers}
        plans[name] = run_plan(simulation, info, view, duration, **options)
    return write_run(output, plans, overwrite=overwrite, resume=resume, progress=progress)


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


def run_plan(simulation: Simulation, info: RunInfo, view: ImageView | None, duration: float, **options: Any) -> RunPlan:
    """Run of `duration` [s]; `options` are those of :meth:`rfgen_sionna.simulation.Simulator.frames`."""

    def frames(first: int, full_scale: float | None) -> Iterator[Frame]:
        return simulation.frames(duration, **options, first_frame=first, full_scale=full_scale)

    count = len(simulation.frame_times(duration, options.get("start", 0.0)))
    return RunPlan(simulation, info, view, count, frames)


def write_run(
    output: str | PathLike[str],
    plans: Mapping[str, RunPlan],
    *,
    overwrite: bool,
    resume: bool = False,
    progress: bool | Progress | None = False,
) -> Run:
    """Write the frames of all `plans` to a file and open it. The name of the only radar of a file is empty."""
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
    with (
        RunWriter(target, infos, overwrite=overwrite, resume=resume) as writer,
        _shown(progress) as step,
    ):
        for name, plan in plans.items():
            series = writer.radar(name)
            if series.frames >= plan.count:
                continue
            for frame in plan.frames(series.frames, series.full_scale):
                writer.append(**_contents(plan, frame), radar=name)
                step(writer.frames, total)
    return open_run(target)


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
    return {
        "adc": frame.samples,
        "time": frame.time,
        "pir": pir,
        "mesh_time": t,
        "full_scale": frame.full_scale,
        "clipped": frame.clipped,
        "vertices": {actor.name: actor.vertices(t) for actor in simulation.actors},
        "joints": {actor.name: actor.joints(t) for actor in simulation.actors if actor.joint_names},
        "labels": actor_labels(simulation.actors, radar, t),
    }


def frame_bytes(radar: Radar, pir_resolution: tuple[int, int] | None) -> int:
    """Size of the samples and the image of one frame in a file [bytes]."""
    pixels = 0 if pir_resolution is None else math.prod(pir_resolution)
    return np.dtype(radar.sample_type).itemsize * math.prod(radar.frame_shape) + 12 * pixels


def _check_space(target: Path, plans: Mapping[str, RunPlan]) -> None:
    """ValueError if the disk of `target` has no room for the frames."""
    needed = 0
    for plan in plans.values():
        view, actors = plan.view, plan.info.actors
        points = sum(actor.num_vertices + len(actor.joint_names) for actor in actors)
        needed += plan.count * (frame_bytes(plan.info.radar, view.resolution if view else None) + 12 * points)
    free = shutil.disk_usage(target.parent).free
    if needed > free:
        raise ValueError(
            f"output '{target}' takes {bytes_text(needed)}, and '{target.parent}' has {bytes_text(free)} free: take a "
            "shorter duration, or another folder"
        )


def bytes_text(count: float) -> str:
    """A size in words, "3.51 MB"."""
    power = min(int(math.log10(max(count, 1.0)) // 3), 5)
    return f"{count / 1000.0**power:.3g} {('B', 'kB', 'MB', 'GB', 'TB', 'PB')[power]}"
