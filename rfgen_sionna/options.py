"""Checks of the arguments of a run before the prompt is read, for the pipeline and the command line."""

from __future__ import annotations

import math
import shutil
from collections.abc import Iterable, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from rfgen_sionna.dataset import check_run_output
from rfgen_sionna.dataset.disk_space import bytes_text, frame_bytes
from rfgen_sionna.generative.actor import DEFAULT_DURATION
from rfgen_sionna.generative.environment_setup import IMAGE_FOV, IMAGE_PIXELS
from rfgen_sionna.generative.motion.kinematic import MAX_DURATION
from rfgen_sionna.generative.prompts import CLIP, ScenePrompt
from rfgen_sionna.generative.prompts.environment_prompt import split_source
from rfgen_sionna.pir.render import check_view
from rfgen_sionna.radar import Radar
from rfgen_sionna.scene.checks.actors import OutsidePolicy, Policy
from rfgen_sionna.scene.mesh_actor import MeshActor
from rfgen_sionna.signal import Receiver
from rfgen_sionna.signal.receiver.receiver_record import ReceiverSource, chosen_receiver
from rfgen_sionna.signal.synthesis import chosen_device
from rfgen_sionna.simulation import Simulator

RADAR_POSITION = (0.0, 0.0, 1.0)
"""Default position of a radar [m], for which the shipped rooms are made."""
RADAR_TARGET = (3.0, 0.0, 1.0)
"""Default target of its boresight [m]."""


def check_options(
    *,
    radar: str | PathLike[str] | Radar,
    preset: str | None,
    board: str | PathLike[str] | None,
    radar_position: tuple[float, float, float] | None,
    look_at: tuple[float, float, float] | None,
    duration: float | None,
    output: str | PathLike[str] | None,
    overwrite: bool,
    resume: bool,
    noise: bool,
    receiver: ReceiverSource | None,
    rtol: float,
    pir_resolution: tuple[int, int] | None,
    fov_deg: float | tuple[float, float] | None,
    projection: str,
    max_bounces: int | None,
    transmission: bool,
    environment: Any,
    collisions: Policy,
    outside: OutsidePolicy,
    device: str,
) -> tuple[Radar, Receiver]:
    """Placed radar and receiver of the arguments of :func:`rfgen_sionna.pipeline.generate`.

    The check imports no model, reads no scene and builds no body.

    Raises
    ------
    ValueError, TypeError
        Naming the argument, its value and the allowed values.
    """
    for name, value in (("overwrite", overwrite), ("resume", resume), ("noise", noise)):
        if not isinstance(value, bool):
            raise TypeError(f"{name} is {value!r}: True or False is needed")
    chosen_device(device)
    target = Path("run.h5") if output is None else check_run_output(output, overwrite)
    chosen_view(pir_resolution, fov_deg, projection, split_source(environment)[0])
    radar = placed_radar(radar, preset, board, radar_position, look_at)
    radar.to_dict()  # refuses a radar that no file can hold
    empty = Simulator(
        None,
        radar,
        rtol=rtol,
        collisions=collisions,
        outside=outside,
        max_bounces=max_bounces,
        transmission=transmission,
    )
    # The default image size depends on the prompt: the smaller one is checked.
    check_size(duration, radar, IMAGE_PIXELS if pir_resolution is None else pir_resolution, target)
    empty.frame_times(DEFAULT_DURATION if duration is None else duration)
    return radar, chosen_receiver(receiver, radar, noise)


def check_actors(actors: Any) -> tuple[MeshActor, ...]:
    """Actors of an argument; TypeError for anything else."""
    if isinstance(actors, MeshActor):
        return (actors,)
    found = tuple(actors) if isinstance(actors, Iterable) else (actors,)
    if not all(isinstance(each, MeshActor) for each in found):
        raise TypeError(f"actors is {actors!r}: a list of actors is needed (Actor.from_mesh, from_motion, from_prompt)")
    return found


def chosen_duration(duration: float | None, actors: Sequence[MeshActor]) -> float:
    """Length of a run [s]; None is that of the longest motion of `actors`, else :data:`DEFAULT_DURATION`."""
    if duration is not None:
        return duration
    return max((each.duration for each in actors if math.isfinite(each.duration)), default=DEFAULT_DURATION)


def default_output(said: ScenePrompt | None) -> str:
    """File of a run without an argument `output`: the action or the clip."""
    if said is None:
        return "run.h5"
    return f"{'' if said.target == 'person' else f'{said.target}_'}{said.action.removeprefix(CLIP)}.h5"


def chosen_view(
    resolution: tuple[int, int] | None, fov_deg: float | tuple[float, float] | None, projection: str, kind: str
) -> tuple[tuple[int, int], float | tuple[float, float]]:
    """Resolution and field of view [degrees] of the images in the file, checked."""
    default = (IMAGE_PIXELS, IMAGE_FOV) if kind == "diffusion" else ((128, 128), 60.0)
    resolution, fov = default[0] if resolution is None else resolution, default[1] if fov_deg is None else fov_deg
    check_view(resolution, fov, projection)
    return resolution, fov


def placed_radar(
    radar: str | PathLike[str] | Radar,
    preset: str | None,
    board: str | PathLike[str] | None,
    position: Any,
    look_at: Any,
) -> Radar:
    """Radar of a name or file at a position [m], with its boresight to a target [m]; a placed one as it is."""
    if isinstance(radar, Radar):
        for name, value in (("preset", preset), ("board", board)):
            if value is not None:
                raise ValueError(f"{name} is {value!r} but a Radar is given, which has its own ('{radar.preset}')")
        for name, value in (("radar_position", position), ("look_at", look_at)):
            if value is not None:
                raise ValueError(f"{name} is {value!r} but a Radar is given, which is placed: radar.placed(…) moves it")
        return radar
    place = RADAR_POSITION if position is None else _vector("radar_position", position)
    if look_at is not None:
        target = _vector("look_at", look_at)
    else:
        target = RADAR_TARGET if position is None else (place[0] + 1.0, place[1], place[2])
    if target == place:
        raise ValueError(f"look_at is {look_at!r}, the position of the radar: a point away from it is needed")
    return Radar.load(radar, preset, board=board, position=place, look_at=target)


def _vector(name: str, value: Any) -> tuple[float, float, float]:
    try:
        x, y, z = (float(component) for component in value)
    except (TypeError, ValueError):
        x = y = z = math.nan
    if not all(map(math.isfinite, (x, y, z))):
        raise ValueError(f"{name} is {value!r}: three finite coordinates x, y, z [m] are needed")
    return x, y, z


def check_size(duration: Any, radar: Radar, pir_resolution: tuple[int, int], target: Path) -> None:
    """Check that the samples and images of a run of `duration` [s] fit on the disk of `target`."""
    if isinstance(duration, bool) or not isinstance(duration, (int, float, np.number)) or not duration > 0:
        return
    frame = frame_bytes(radar, pir_resolution)
    needed = frame * max(1.0, duration / radar.waveform.frame_period)
    free = shutil.disk_usage(target.parent).free
    fits = min(MAX_DURATION, free / frame * radar.waveform.frame_period)
    if duration > MAX_DURATION or needed > free:
        raise ValueError(
            f"duration is {duration:g} s: samples and images take {bytes_text(needed)}, and '{target.parent}' has "
            f"{bytes_text(free)} free; allowed are at most {math.floor(fits):g} s"
        )
