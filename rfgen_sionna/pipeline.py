"""Radar data from a prompt."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from os import PathLike
from typing import TYPE_CHECKING, Any

from rfgen_sionna._deprecation import refuse_workers, warn_renamed
from rfgen_sionna.composition import Reception, TraceOptions, compose
from rfgen_sionna.dataset import check_run_output
from rfgen_sionna.generative.clip_person import chosen_clip
from rfgen_sionna.generative.environment_setup import ImageOptions
from rfgen_sionna.generative.prompts.environment_prompt import with_source
from rfgen_sionna.options import check_actors, check_options, check_size, chosen_view, default_output
from rfgen_sionna.radar import Radar
from rfgen_sionna.recording import ImageView, Progress, write_run
from rfgen_sionna.records import Motion
from rfgen_sionna.scene.checks.actors import OutsidePolicy, Policy
from rfgen_sionna.scene.mesh_actor import MeshActor
from rfgen_sionna.scene_request import Placement, RunSeeds, check_distances, read_request
from rfgen_sionna.signal.receiver.receiver_record import ReceiverSource
from rfgen_sionna.signal.synthesis import chosen_device
from rfgen_sionna.tolerance import DEFAULT_RTOL

if TYPE_CHECKING:
    from rfgen_sionna.dataset import Run


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
    rtol: float = DEFAULT_RTOL,
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
    progress: bool | Progress | None = None,
    report: Callable[[str], None] | None = None,
    workers: None = None,
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
        Tolerated relative error of each return (:mod:`rfgen_sionna.tolerance`).
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
    progress
        True shows a bar; a function is called with the number of finished frames and of all frames.
    report
        Called once, before the first frame, with the interpretation of the prompt and every decision with its origin:
        prompt, argument, default or seed. None logs this text. It is stored (`Run.report`).
    workers
        Removed, as in :meth:`rfgen_sionna.simulation.Simulator.adc`.

    Returns
    -------
    The written run, open for a read; `cube()` has the samples.

    Raises
    ------
    ValueError, TypeError
        Before any long work, naming the argument, its value and the allowed values.
    """
    refuse_workers(workers)
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
    )
    image_options = ImageOptions(
        negative_environment, refine, environment_model, environment_lora, None if device == "auto" else device
    )
    device = chosen_device(device)
    prompts = [] if prompt == "" and clip is None and others else [prompt]
    if not prompts:
        for name, value, usual in (
            ("negative", negative, ""),
            ("distance", distance, None),
            ("motion", motion, "auto"),
        ):
            if value != usual:
                raise ValueError(f"{name} is {value!r}, which belongs to a prompt, but only actors are given")
    request = read_request(
        prompts,
        negative=negative,
        environment=environment,
        seeds=RunSeeds.same(seed),
        placement=Placement(distance_m=distance),
        motion=str(motion) if clip is None else "",
        clip=clip,
        up=up,
        frame_rate=frame_rate,
        others=others,
        image_options=image_options,
    )
    resolution, fov = chosen_view(pir_resolution, fov_deg, projection, request.source)
    named = default_output(request.said[0] if request.said else None)
    target = check_run_output(named if output is None else output, overwrite)
    image_options.check(moves=radar.trajectory is not None)
    check_distances(request, radar, outside)
    check_size(duration, radar, resolution, target)
    plans = compose(
        request,
        {"": radar},
        duration=duration,
        view=ImageView(resolution, fov, projection),
        trace=TraceOptions(rtol, max_bounces, transmission, outside, collisions),
        reception=Reception(noise, impairments, noise or receiver is not None, device),
        report=report,
    )
    return write_run(target, plans, overwrite=overwrite, resume=resume, progress=progress)
