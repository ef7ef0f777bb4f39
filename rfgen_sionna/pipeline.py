"""From a prompt to radar data: the whole way on one page."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace
from os import PathLike
from typing import TYPE_CHECKING

import numpy as np

from rfgen_sionna.dataset import ActorInfo, RunInfo, RunWriter, check_output, open_run
from rfgen_sionna.dataset.schema import STANDARD_LABELS
from rfgen_sionna.generative.actor import DEFAULT_DISTANCE, Actor
from rfgen_sionna.generative.prompts import ScenePrompt, parse_environment, parse_prompt
from rfgen_sionna.pir.render import check_view
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import FloatArray
from rfgen_sionna.scene.load import load_scene
from rfgen_sionna.simulation import Simulator

if TYPE_CHECKING:
    from rfgen_sionna.dataset import Run

RADAR_POSITION = (0.0, 0.0, 1.0)
"""Where the radar stands unless one that is placed is given [m]; our rooms are laid out around it."""
RADAR_TARGET = (3.0, 0.0, 1.0)
"""Where it looks [m]."""
LABEL_STEP = 1e-3
"""Half the stretch over which label velocities are differenced [s]."""

_LOG = logging.getLogger(__name__)


def generate(
    prompt: str,
    *,
    negative: str = "",
    environment: str | None = None,
    radar: str | PathLike[str] | Radar = "awr1843",
    preset: str | None = None,
    duration: float = 3.0,
    seed: int = 0,
    output: str | PathLike[str] | None = None,
    overwrite: bool = False,
    noise: bool = True,
    rtol: float = 1e-3,
    distance: float | None = None,
    pir_resolution: tuple[int, int] = (128, 128),
    fov_deg: float | tuple[float, float] = 60.0,
    progress: Callable[[int, int], None] | None = None,
) -> Run:
    """Radar data of what a prompt describes.

    Parameters
    ----------
    prompt, negative
        What is wanted and what is not: target, action, orientation, distance, body, surroundings.
    environment
        Surroundings in words ("a living room") or the name of a scene; None takes what the prompt says, "free space"
        is none.
    radar
        Name or TOML file of a radar, placed at `RADAR_POSITION` looking at `RADAR_TARGET`, or a placed Radar.
    preset
        Configuration of the radar; its default if None.
    duration
        Length [s]; as many whole frames as fit.
    seed
        Seed of body, motion and noise.
    output
        HDF5 file to write (see :mod:`rfgen_sionna.dataset.schema`); None is the action's name, here.
    overwrite
        Whether an existing file is replaced.
    noise
        Whether thermal noise is added.
    rtol
        Relative error that the tracer may make.
    distance
        Distance of the person from the radar [m] where the prompt names none.
    pir_resolution, fov_deg
        Pixels (rows, columns) and field of view [degrees] of the PIR frames in the file.
    progress
        Called with the frames done and in all.

    Returns
    -------
    The written run, open for reading; `cube()` has the samples.

    Raises
    ------
    ValueError, TypeError
        Before any long work, naming the argument, its value and what is allowed.
    """
    check_view(pir_resolution, fov_deg)
    said = _read(prompt, negative, seed, distance)
    target = check_output(f"{said.action}.h5" if output is None else output, overwrite)
    surroundings = parse_environment(said.surroundings if environment is None else environment)
    if surroundings is not None:
        for sentence in surroundings.warnings:
            _LOG.warning(sentence)
    if isinstance(radar, Radar):
        if preset is not None:
            raise ValueError(f"preset is {preset!r} but a Radar is given, which has its own ('{radar.preset}')")
    else:
        radar = Radar.load(radar, preset, position=RADAR_POSITION, look_at=RADAR_TARGET)
    place = said.distance_m or DEFAULT_DISTANCE
    if place > radar.max_range:
        raise ValueError(
            f"distance is {place:g} m; the range window of radar '{radar.name}' (preset '{radar.preset}') ends at "
            f"{radar.max_range:.2f} m: come closer, or take a preset with a lower slope or a higher sample rate"
        )
    # What they refuse is refused before a scene is read, and before a body is built.
    count = len(Simulator(None, radar, rtol=rtol).frame_times(duration))
    scene = load_scene(None if surroundings is None else surroundings.scene)
    Simulator(scene, radar, rtol=rtol)

    person = Actor.from_prompt(said, seed=seed, duration=duration, radar=radar)
    simulator = Simulator(scene, radar, [person], rtol=rtol)
    if simulator.hidden(person, 0.0, duration):
        raise ValueError(
            f"distance is {place:g} m: the surfaces of scene '{scene.name}' hide the person from the radar there; "
            "choose another distance or environment"
        )

    info = RunInfo(
        radar=radar,
        prompt=prompt,
        negative_prompt=negative,
        environment="" if surroundings is None else surroundings.scene,
        seeds={"body": seed, "motion": seed, "noise": seed if noise else None},
        actors=(ActorInfo.of(person),),
        labels=STANDARD_LABELS,
    )
    middle = 0.5 * radar.waveform.frame_length
    frames = simulator.frames(duration, noise=noise, seed=seed)
    with RunWriter(target, info, overwrite=overwrite) as writer:
        for frame in frames:
            t = frame.time + middle
            writer.append(
                frame.samples,
                time=frame.time,
                pir=simulator.pir(t, pir_resolution, fov_deg),
                mesh_time=t,
                vertices={person.name: person.vertices(t)},
                joints={person.name: person.joints(t)},
                labels={"action": [said.action], **_labels(person, radar, t)},
            )
            if progress is not None:
                progress(frame.index + 1, count)
    return open_run(target)


def _read(prompt: str, negative: str, seed: int, distance: float | None) -> ScenePrompt:
    if isinstance(seed, bool) or not isinstance(seed, (int, np.integer)) or seed < 0:
        raise ValueError(f"seed is {seed!r}: a whole number of at least 0 is needed")
    said = parse_prompt(prompt, negative, seed=seed)
    if distance is not None and not (np.isfinite(distance) and distance > 0):
        raise ValueError(f"distance is {distance!r} m: a positive, finite distance is needed")
    if distance is not None and said.distance_m is None:
        said = replace(said, distance_m=float(distance))
    return said


def _labels(actor: Actor, radar: Radar, t: float) -> dict[str, FloatArray]:
    """Where the centre of an actor's vertices is at `t` [s], and how it moves; one row per actor."""
    before, centre, after = (actor.vertices(t + step).mean(axis=0) for step in (-LABEL_STEP, 0.0, LABEL_STEP))
    velocity = (after - before) / (2 * LABEL_STEP)
    offset = centre - np.asarray(radar.position)
    distance = float(np.linalg.norm(offset))
    device = offset @ radar.rotation / distance
    facing = _facing(actor, t)
    return {
        "position": centre[None],
        "velocity": velocity[None],
        "orientation": np.array([facing]),
        "distance": np.array([distance]),
        "radial_velocity": np.array([velocity @ offset / distance]),
        "azimuth": np.array([np.arctan2(device[1], device[0])]),
        "elevation": np.array([np.arcsin(device[2])]),
    }


def _facing(actor: Actor, t: float) -> float:
    """Yaw [rad] of the direction an actor faces: square to the hips, which turn with the motion, where it has any."""
    names = actor.joint_names
    if "left_hip" in names and "right_hip" in names:
        joints = actor.joints(t)
        left = joints[names.index("left_hip")] - joints[names.index("right_hip")]
        return float(np.arctan2(-left[0], left[1]))
    forward = actor.pose(t)[1][:, 0]
    return float(np.arctan2(forward[1], forward[0]))
