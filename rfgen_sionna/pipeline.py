"""Radar data from a prompt."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import replace
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from rfgen_sionna._deprecation import warn_renamed
from rfgen_sionna.dataset import check_run_output
from rfgen_sionna.generative.actor import DEFAULT_DURATION, Actor
from rfgen_sionna.generative.clip_person import Clip, chosen_clip, person_with_clip, read_clip_prompt
from rfgen_sionna.generative.decisions import DEFAULT, Decision, argument
from rfgen_sionna.generative.environment_setup import ImageOptions, chosen_source, set_up_environment
from rfgen_sionna.generative.motion_sources import motion_source
from rfgen_sionna.generative.prompts import DEFAULT_DISTANCE, PromptError, check_seed
from rfgen_sionna.generative.prompts.environment_prompt import (
    NOWHERE,
    EnvironmentPrompt,
    in_words,
    parse_environment,
    split_source,
    with_source,
)
from rfgen_sionna.generative.radar_placement import place_before_radar
from rfgen_sionna.generative.several_actors import PromptedActors, actors_from_prompt, actors_report, read_prompts
from rfgen_sionna.generative.things.thing_catalogue import bounces_of
from rfgen_sionna.options import check_actors, check_options, check_size, chosen_duration, chosen_view, default_output
from rfgen_sionna.radar import Radar
from rfgen_sionna.recording import ImageView, Progress, array_digest, run_info, run_plan, write_run
from rfgen_sionna.records import Motion
from rfgen_sionna.scene.checks.actors import OutsidePolicy, Policy
from rfgen_sionna.scene.floor import floor_under
from rfgen_sionna.scene.mesh_actor import MeshActor
from rfgen_sionna.signal.receiver.receiver_record import ReceiverSource
from rfgen_sionna.signal.synthesis import chosen_device
from rfgen_sionna.simulation import Simulator

if TYPE_CHECKING:
    from rfgen_sionna.dataset import Run

_LOG = logging.getLogger(__name__)


def generate(
    prompt: str = "",
    *,
    actors: Sequence[MeshActor] = (),
    negative: str = "",
    environment: Any = None,
    surroundings: str | None = None,
    negative_environment: str = "",
    refine: bool | float | None = None,
    environment_model: str | PathLike[str] | None = None,
    environment_lora: str | PathLike[str] | None = None,
    radar: str | PathLike[str] | Radar = "awr1843",
    preset: str | None = None,
    board: str | PathLike[str] | None = None,
    duration: float | None = None,
    seed: int = 0,
    output: str | PathLike[str] | None = None,
    overwrite: bool = False,
    resume: bool = False,
    noise: bool = True,
    receiver: ReceiverSource | None = None,
    rtol: float = 1e-2,
    distance: float | None = None,
    radar_position: tuple[float, float, float] | None = None,
    look_at: tuple[float, float, float] | None = None,
    pir_resolution: tuple[int, int] | None = None,
    fov_deg: float | tuple[float, float] | None = None,
    projection: str = "perspective",
    max_bounces: int | None = 1,
    transmission: bool = False,
    motion: str | PathLike[str] | Motion = "auto",
    up: str | None = None,
    frame_rate: float | None = None,
    collisions: Policy = "error",
    outside: OutsidePolicy = "error",
    device: str = "auto",
    workers: int = 1,
    progress: bool | Progress | None = None,
    report: Callable[[str], None] | None = None,
) -> Run:
    """Radar data of a prompt, of actors, or of both.

    Parameters
    ----------
    prompt, negative
        Wanted and unwanted features: target, action, orientation, distance, body, surroundings.
    actors
        Further actors, each with its place in the world (:class:`~rfgen_sionna.generative.actor.Actor`). Without a
        prompt they are all.
    environment
        Surroundings in words ("a living room"), name of a scene ("living_room", "Munich"), or path of a scene file or
        scene object, as of :func:`rfgen_sionna.load_scene`; "free space" is none.
        None takes the surroundings of the prompt. A source may precede the words ("furnished: an office"), or be alone,
        for the place of the prompt ("furnished"). Sources: "scene", the scene of a file; "furnished", a place furnished
        by the seed; "diffusion", an image of a diffusion model (:mod:`rfgen_sionna.generative.environment`); "none",
        always alone, free space for any prompt. By default the name of a scene is that scene, and words are an image;
        without diffusers, words are a scene, or a furnished place, with a warning. Only "diffusion" imports a model.
    surroundings
        Deprecated: source of `environment`.
    negative_environment
        Absent objects of an imagined place ("sofa, TV"). An object of `environment` is refused.
    refine
        Whether path diffusion corrects the traced and imagined returns, or its strength, 0 … 1. None corrects imagined
        surroundings of a radar at rest. False does not load the model.
    environment_model, environment_lora
        Environment model or Stable Diffusion base, and RF LoRA of it (files, folders, hub names; see
        :class:`~rfgen_sionna.generative.environment.environment_diffusion.EnvironmentDiffusion`); None is the model
        of the package, without a LoRA.
    radar
        Name or file of a radar (:meth:`~rfgen_sionna.radar.Radar.load`), or a placed Radar.
    preset
        Configuration of the radar; None is its default.
    board
        Board of a vendor's configuration file that names none.
    duration
        Length [s]; the run has all whole frames that fit. None is that of the clip, of the longest motion of the
        actors without a prompt, else 3 s.
    seed
        Seed of body, motion, noise and the speckle of rough surfaces.
    output
        HDF5 file to write (see :mod:`rfgen_sionna.dataset.schema`); None is `<action>.h5` in the working folder.
    overwrite
        Whether an existing file is replaced.
    resume
        Whether an interrupted call keeps its frames, in `.NAME.partial` beside the file, and the same call continues
        after them, as in :func:`rfgen_sionna.record`.
    noise
        Whether thermal noise is added; False removes it from `receiver`, and without one the samples are ideal.
    receiver
        Impairments of the receiver: a Receiver, a table of its parts or a TOML file with such a table
        (:func:`~rfgen_sionna.signal.read_receiver`); None is thermal noise and the radar's ADC. It is stored.
    rtol
        Tolerated relative error of each return: 0.01 is 0.1 dB or 0.6 degrees. The error is as smooth in time as the
        motion, so that it adds no Doppler.
    distance
        Horizontal distance of the person from the radar [m], for a prompt without a distance.
    radar_position, look_at
        Position of a radar of a name or file, and target of its boresight [m]. The defaults are `RADAR_POSITION` and
        `RADAR_TARGET`; with a position alone the boresight is +x. The person is on the boresight, at the distance, on
        the lowest surface of the scene below the radar, else at height 0.
    pir_resolution, fov_deg
        Pixels (rows, columns) and field of view [degrees] of the stored PIR frames, by default (128, 128) and 60.
        Imagined surroundings have 64 x 64 pixels and 90 degrees by default, and end at the field of view.
    projection
        "perspective", or "equirectangular" (azimuth and elevation evenly) for those images.
    max_bounces, transmission
        Largest number of surfaces on a path, and whether walls and glass transmit, as in
        :class:`~rfgen_sionna.simulation.Simulator`. A corner reflector of the catalogue of things raises it to 3.
    motion
        Source of the motion: "kinematic" (rules of movement), "diffusion" (the learned model) or "auto", the learned
        model where its packages are installed. Or a clip that replaces the action of the prompt: a Motion, or a file or
        folder that :meth:`~rfgen_sionna.generative.actor.Actor.from_motion` takes. Its origin is at the prompt's
        distance, and labels say "clip: NAME".
    up, frame_rate
        Up axis and frame rate [Hz] of a clip in a file, as in :meth:`~rfgen_sionna.generative.actor.Actor.from_motion`.
    collisions
        Policy for a person more than 5 cm deep in a wall or a piece of furniture: "error" refuses the run, "warn"
        warns, "ignore" does not check.
    outside
        Policy for an actor beyond the radar's range window: "error" refuses the run, "ignore" leaves out its returns.
    device
        Device that sums the paths: "cpu", "cuda", or "auto", CUDA if available.
    workers
        Number of processes that trace and sum frames, as in :meth:`rfgen_sionna.simulation.Simulator.adc`.
    progress
        True shows a bar; a function is called with the number of finished frames and of all frames.
    report
        Called once, before the first frame, with the interpretation of the prompt and every decision with its origin:
        prompt, argument, default or seed. None logs this text. It is stored (`Run.report`).

    Returns
    -------
    The written run, open for a read; `cube()` has the samples.

    Raises
    ------
    ValueError, TypeError
        Before any long work, naming the argument, its value and the allowed values.
    """
    if surroundings is not None:
        warn_renamed("generate(surroundings=…)", "environment='furnished: …'")
        environment = with_source(environment, surroundings)
    clip, others = chosen_clip(motion, up, frame_rate), check_actors(actors)
    radar, impairments = check_options(
        radar=radar,
        preset=preset,
        board=board,
        radar_position=radar_position,
        look_at=look_at,
        duration=duration,
        output=output,
        overwrite=overwrite,
        resume=resume,
        noise=noise,
        receiver=receiver,
        rtol=rtol,
        pir_resolution=pir_resolution,
        fov_deg=fov_deg,
        projection=projection,
        max_bounces=max_bounces,
        transmission=transmission,
        environment=environment,
        collisions=collisions,
        outside=outside,
        device=device,
        workers=workers,
    )
    image_options = ImageOptions(
        negative_environment, refine, environment_model, environment_lora, None if device == "auto" else device
    )
    device = chosen_device(device)
    origin, place_words = split_source(environment)
    read: PromptedActors | None = None
    if prompt == "" and clip is None and others:
        for name, value, usual in (
            ("negative", negative, ""),
            ("distance", distance, None),
            ("motion", motion, "auto"),
        ):
            if value != usual:
                raise ValueError(f"{name} is {value!r}, which belongs to a prompt, but only actors are given")
        check_seed(seed)
        asked = None if place_words is None else parse_environment(place_words)
    else:
        if isinstance(motion, str) and clip is None:
            motion_source(motion)
        read, asked = _read(prompt, negative, place_words, seed, distance, origin, clip)
    kind = chosen_source(origin, asked, image_options)
    for sentence in asked.warnings(imagined=kind == "diffusion") if asked else ():
        _LOG.warning(sentence)
    resolution, fov = chosen_view(pir_resolution, fov_deg, projection, kind)
    target = check_run_output(default_output(read.said[0] if read else None) if output is None else output, overwrite)
    image_options.check(moves=radar.trajectory is not None)
    for said in read.said if read is not None and outside == "error" else ():
        away = DEFAULT_DISTANCE if said.distance_m is None else said.distance_m
        if away > radar.max_range:
            raise ValueError(
                f"distance is {away:g} m; the range window of radar '{radar.name}' (preset '{radar.preset}') ends at "
                f"{radar.max_range:.2f} m: choose a smaller one, or a preset with a lower slope or a higher sample rate"
            )
    spot = None if read is None else place_before_radar(radar, read.distance_m, read.said[0].bearing_deg or 0.0)[0]
    check_size(duration, radar, resolution, target)
    setting = set_up_environment(
        asked,
        kind,
        radar,
        seed=seed,
        image_options=image_options,
        fov_deg=fov,
        resolution=resolution,
        projection=projection,
    )
    scene = setting.scene
    kinds = [each.thing_record.kind for each in others if isinstance(each, Actor) and each.thing_record]
    needed = max(map(bounces_of, [*kinds, "", *(said.target for said in (read.said if read else ()))]))
    corners = max_bounces is not None and max_bounces < needed
    traced: dict[str, Any] = {
        "rtol": rtol,
        "max_bounces": needed if corners else max_bounces,
        "transmission": transmission,
    }
    traced["outside"] = outside
    Simulator(scene, radar, others, **traced)

    decisions = list(setting.decisions)
    if corners:
        decisions.append(Decision("max_bounces", str(needed), "the corner reflector returns by so many"))
    people: tuple[Actor, ...] = ()
    if read is not None and spot is not None:
        found = floor_under(scene, (*spot, float(radar.position[2])))
        height, why = (0.0, "no surface there, so height 0") if found is None else (found[0], f"'{found[1]}' there")
        decisions.append(Decision("floor", f"{height + 0.0:.2f} m", why))
        if clip is not None:
            said = read.said[0]
            person = person_with_clip(said, clip, seed=seed, radar=radar, floor=height, up=up, frame_rate=frame_rate)
            people = (person,)
        else:
            length = DEFAULT_DURATION if duration is None else duration
            people = actors_from_prompt(read, seed=seed, duration=length, radar=radar, floor=height, motion=str(motion))
        if motion == "auto":
            people = tuple(replace(each, decisions=tuple(map(_by_default, each.decisions))) for each in people)
    everyone = (*people, *others)
    duration = chosen_duration(duration, people or others)
    simulator = Simulator(
        scene,
        radar,
        everyone,
        **traced,
        collisions=collisions,
        seed=seed,
        environment=setting.environment,
        refiner=setting.refiner,
    )
    # Surroundings from an image are opaque.
    opaque = setting.environment is not None or not transmission
    for person in people if opaque else ():
        if not simulator.is_occluded(person, 0.0, duration):
            continue
        if setting.environment is None:
            what, remedy = f"the surfaces of scene '{scene.name}' hide", "choose another distance or environment"
        else:
            what, remedy = f"surroundings of the {setting.name} hide", "choose another distance, seed or environment"
        away = float(np.hypot(*(np.asarray(person.position) - np.asarray(radar.position))[:2]))
        raise ValueError(
            f"distance is {away:.3g} m: {what} the {person.name} from the radar there; {remedy}, or place the radar "
            "elsewhere"
        )
    decisions += [Decision("actor", f"{each.name}: {each.material_names}", argument("actors")) for each in others]
    text = actors_report(people, decisions)
    if report is None:
        _LOG.info("%s", text)
    else:
        report(text)

    info = run_info(
        simulator,
        simulator.frame_times(duration),
        noise=noise,
        seed=seed,
        receiver=impairments,
        prompt=prompt,
        negative_prompt=negative,
        environment=setting.name,
        seeds={
            "body": seed if any(each.body is not None for each in people) else None,
            "motion": seed if people and clip is None else None,
            "surroundings": seed if kind in ("furnished", "diffusion") else None,
            "speckle": seed,
            "noise": seed if noise or receiver is not None else None,
        },
        report=text,
    )
    if setting.environment is not None:
        shown = array_digest([setting.environment.energy, setting.environment.time_of_arrival])
        info = replace(info, settings={**info.settings, "image": shown, "refine": refine})
    view = ImageView(resolution, fov, projection)
    plan = run_plan(
        simulator, info, view, duration, noise=noise, seed=seed, receiver=impairments, device=device, workers=workers
    )
    return write_run(target, {"": plan}, overwrite=overwrite, resume=resume, progress=progress)


def _read(
    prompt: str,
    negative: str,
    environment: Any,
    seed: int,
    distance: float | None,
    kind: str,
    clip: Clip | None,
) -> tuple[PromptedActors, EnvironmentPrompt | None]:
    """Contents of the prompt and of the arguments; words without effect are logged."""
    check_seed(seed)
    if clip is not None:
        read = PromptedActors((read_clip_prompt(prompt, negative, seed, clip),), "apart")
    else:
        read = read_prompts(prompt, negative, seed=seed)
    if distance is not None and not (np.isfinite(distance) and distance > 0):
        raise ValueError(f"distance is {distance!r} m: a positive, finite distance is needed")
    named = in_words(read.surroundings) if read.surroundings else None
    surroundings = named if environment is None else parse_environment(environment)
    place, by_argument = read.surroundings, environment is not None or kind == "none"
    if environment is not None:
        place = NOWHERE if surroundings is None else surroundings.scene
        if read.surroundings not in (None, place):
            raise PromptError(f"environment: {environment!r}, but the prompt says {read.surroundings}: leave one out")
    elif kind == "none":
        place = NOWHERE
    said = []
    for each in read.said:
        if distance is not None and each.distance_m is None:
            origins = {**each.origins, "distance": argument("distance")}
            each = replace(each, distance_m=float(distance), origins=origins)
        if by_argument:
            origins = {**each.origins, "surroundings": argument("environment")}
            each = replace(each, surroundings=place, origins=origins)
        said.append(each)
        for sentence in each.warnings:
            _LOG.warning(sentence)
    return replace(read, said=tuple(said)), surroundings


def _by_default(decision: Decision) -> Decision:
    return replace(decision, origin=DEFAULT) if decision.name == "motion" else decision
