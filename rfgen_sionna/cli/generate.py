"""`rfgen generate`: options and output of the command."""

from __future__ import annotations

from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape

from rfgen_sionna._deprecation import refuse_workers
from rfgen_sionna.cli.console import check_pictures, draw, out, progress, report_written, warn
from rfgen_sionna.tolerance import DEFAULT_RTOL, RTOL_RANGE

if TYPE_CHECKING:
    from rfgen_sionna.scene.mesh_actor import MeshActor

EPILOG = """[bold]Examples[/bold]

rfgen generate "a person doing jumping jacks, facing forward" --environment "a living room" --output jacks.h5

rfgen generate "a tall man walks back and forth at 3 m" --preset mmmesh --duration 5 --seed 1

rfgen generate "someone raises an arm" --negative "left arm" --environment "free space"

rfgen generate "a person walks while raising the left arm, 5 m away" --motion diffusion --environment "free space"

rfgen generate "a tall woman, 3 m away" --motion walk.bvh --actor "chair.glb wood 2,1,0"

rfgen generate "action: push, distance: 1 m" --environment "floor wall" --radar-position=-1.5,0,1.2 --look-at 0,0,1.2

rfgen generate "a person doing jumping jacks" --environment "a bedroom with a wardrobe" --negative-environment desk

rfgen generate "a man jumps, 4 m away" --environment Munich --radar-position 205.1,-261.5,1.5 --look-at 200,-261.5,1.5

A prompt names a person and one action, or one of the arms over one of the legs ("walks while waving"); orientation,
distance, azimuth, body, surroundings and manner are optional. Manner is pace or speed ("slowly", "at 0.5 m/s"), size
("small steps"), repetitions ("15 times a minute"), way ("in a circle", "back and forth", "around the room"), pauses,
posture of the arms ("with hands on the hips") and tiredness. The seed draws from ranges ("at 2 to 4 m", "facing a
random direction") and among open choices. What cannot be done is refused with the nearest that can; words without
effect are listed; the report gives the origin of every value: prompt, argument, default or seed."""


def generate(
    prompt: Annotated[
        str, typer.Argument(help="A person and an action, as a sentence or keywords.", show_default=False)
    ] = "",
    actor: Annotated[
        list[str] | None,
        typer.Option(
            metavar="'FILE MATERIAL X,Y,Z'",
            help='A further object at rest, a mesh file: "chair.glb wood 2,1,0"; may be given several times.',
        ),
    ] = None,
    negative: Annotated[str, typer.Option(help='Unwanted choices: "left arm", "facing away", "child".')] = "",
    environment: Annotated[
        str | None,
        typer.Option(
            help='Surroundings: "a living room", "an office", "free space", a scene of Sionna, the path of a scene '
            "(Mitsuba's XML, glTF, OBJ) (default: the place in the prompt). "
            'With a source: "furnished: an office" (furnished at random), "scene: a living room" (a '
            'scene file), "diffusion: a street" (an image from a diffusion model).'
        ),
    ] = None,
    surroundings: Annotated[
        str | None, typer.Option(help='Deprecated: --environment "furnished: an office".', hidden=True)
    ] = None,
    no_environment: Annotated[
        bool, typer.Option("--no-environment", help="Free space, as --environment none; overrides the prompt.")
    ] = False,
    negative_environment: Annotated[
        str, typer.Option(help='Unwanted contents of diffusion surroundings: "sofa".')
    ] = "",
    refine: Annotated[
        bool | None,
        typer.Option(help="Correct diffusion surroundings by path diffusion (default: yes).", show_default=False),
    ] = None,
    strength: Annotated[
        float | None, typer.Option(min=0.0, max=1.0, help="Strength of path diffusion, 0 to 1 (default: 1).")
    ] = None,
    environment_model: Annotated[
        str | None,
        typer.Option(
            help="Model of diffusion surroundings: ours, a Stable Diffusion folder or hub name (default: ours)."
        ),
    ] = None,
    environment_lora: Annotated[
        str | None, typer.Option(help="RF LoRA for that model: a file, folder or hub name.")
    ] = None,
    radar: Annotated[
        str,
        typer.Option(
            help="A radar of `rfgen radars`, or the path of a file: a radar file (TOML), TI's .cfg, mmWave Studio's "
            "JSON or Infineon's config.json."
        ),
    ] = "awr1843",
    preset: Annotated[str | None, typer.Option(help="Preset of that radar (default: set in its file).")] = None,
    board: Annotated[
        str | None, typer.Option(help="Board of a .cfg or JSON that names none: a radar of `rfgen radars` or its file.")
    ] = None,
    duration: Annotated[
        float | None, typer.Option(help="Length of the recording [s] (default: 3, or that of the clip).")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of motion, body, noise and all open choices.")] = 0,
    output: Annotated[
        Path | None, typer.Option(help="HDF5 file to write (default: name of the action).", dir_okay=False)
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace existing files.")] = False,
    resume: Annotated[
        bool, typer.Option("--resume", help="Keep the frames of an interrupted run, and continue after them.")
    ] = False,
    noise: Annotated[bool, typer.Option(help="Thermal noise of the receiver.")] = True,
    receiver: Annotated[
        Path | None,
        typer.Option(help="TOML file of the receiver's impairments: leakage, phase noise, ADC …", dir_okay=False),
    ] = None,
    rtol: Annotated[
        float, typer.Option(help=f"Relative tolerance of the signal, {RTOL_RANGE}; 0.01 is 0.1 dB or 0.6 degrees.")
    ] = DEFAULT_RTOL,
    distance: Annotated[
        float | None, typer.Option(help="Distance from radar to person [m], if the prompt names none.")
    ] = None,
    radar_position: Annotated[
        str | None, typer.Option(metavar="X,Y,Z", help="Position of the radar [m] (default: 0,0,1).")
    ] = None,
    look_at: Annotated[
        str | None,
        typer.Option(metavar="X,Y,Z", help="Point on the boresight [m] (default: 3,0,1; +x of a given position)."),
    ] = None,
    pir_resolution: Annotated[
        str | None,
        typer.Option(metavar="ROWSxCOLUMNS", help="Pixels of the PIR images (default: 128x128, diffusion 64x64)."),
    ] = None,
    fov_deg: Annotated[
        float | None,
        typer.Option(help="Horizontal field of view of the PIR images [degrees] (default: 60, diffusion 90)."),
    ] = None,
    projection: Annotated[
        str, typer.Option(help='Projection of the PIR images: "perspective" or "equirectangular".')
    ] = "perspective",
    max_bounces: Annotated[
        int,
        typer.Option(
            min=1,
            max=3,
            help="Most surfaces on a path; 2 and 3 add ghosts, corners and double bounces, and take longer.",
        ),
    ] = 1,
    transmission: Annotated[
        bool, typer.Option("--transmission", help="Paths through walls, glass and furniture; takes longer.")
    ] = False,
    motion: Annotated[
        str,
        typer.Option(
            help='Source of the motion: "diffusion" (learned), "kinematic" (rules) or "auto"; or the path of a clip '
            "(AMASS, SMPL, BVH, GLB, folder of meshes …), which replaces the action of the prompt."
        ),
    ] = "auto",
    up: Annotated[str | None, typer.Option(help="Up axis of the clip.")] = None,
    frame_rate: Annotated[float | None, typer.Option(help="Frames per second of the clip [Hz].")] = None,
    collisions: Annotated[
        str, typer.Option(help='Reaction to a person in walls or furniture: "error", "warn" or "ignore".')
    ] = "error",
    outside: Annotated[
        str, typer.Option(help='Reaction to actors beyond the range window: "error", or "ignore" their returns.')
    ] = "error",
    device: Annotated[
        str, typer.Option(help='Device of diffusion and synthesis: "cpu", "cuda" or "auto" (CUDA if available).')
    ] = "auto",
    workers: Annotated[int | None, typer.Option(hidden=True)] = None,
    pictures: Annotated[bool, typer.Option(help="Write a sheet of pictures (PNG) and an animation (GIF), too.")] = True,
) -> None:
    """Simulate a prompt: radar data, PIR images, meshes and labels in one HDF5 file."""
    options: dict[str, Any] = dict(locals())
    for name in ("surroundings", "no_environment", "strength", "pictures", "actor", "workers"):
        del options[name]
    refuse_workers(workers)
    from rfgen_sionna.dataset import check_output
    from rfgen_sionna.generative.clip_person import chosen_clip, read_clip_prompt
    from rfgen_sionna.generative.prompts.environment_prompt import with_source
    from rfgen_sionna.generative.several_actors import PromptedActors, read_prompts
    from rfgen_sionna.options import check_options, default_output
    from rfgen_sionna.pipeline import generate as run

    if surroundings is not None:
        warn("--surroundings is deprecated: use --environment 'furnished: …'", DeprecationWarning)
        options["environment"] = with_source(environment, surroundings)
    if no_environment:
        if options["environment"] not in (None, "none"):
            raise ValueError(f"--environment is {options['environment']!r}, but --no-environment is set: leave one out")
        options["environment"] = "none"
    if strength is not None:
        if refine is False:
            raise ValueError(f"--strength is {strength:g}, but --no-refine is set: leave one out")
        options["refine"] = strength
    options["pir_resolution"] = None if pir_resolution is None else _resolution(pir_resolution)
    options["radar_position"], options["look_at"] = (
        _point("--radar-position", radar_position),
        _point("--look-at", look_at),
    )
    check_options(**{name: options[name] for name in signature(check_options).parameters})  # before the slow imports
    clip, options["actors"] = chosen_clip(motion, up, frame_rate), [_actor(text) for text in actor or ()]
    if clip is not None:
        read = PromptedActors((read_clip_prompt(prompt, negative, seed, clip),), "apart")
    elif prompt or not actor:
        read = read_prompts(prompt, negative, seed=seed)
    else:
        read = None
    target = options["output"] = output if output is not None else Path(default_output(read.said[0] if read else None))
    for said in read.said if read else ():
        out.print(escape(said.words()), soft_wrap=True)
    check_output(target, overwrite)
    if pictures:
        check_pictures(target, overwrite)
    with progress("frames") as step:
        run(**options, progress=step, report=_print_decisions).close()
    report_written(target)
    if pictures:
        draw(target, overwrite)


def _print_decisions(report: str) -> None:
    """Print the decisions of a report, without the words before them."""
    from rfgen_sionna.generative.prompts import DECIDED

    _, heading, decisions = report.partition(DECIDED)
    out.print(escape(heading + decisions), soft_wrap=True)


def _actor(text: str) -> MeshActor:
    """Object at rest of an option `--actor`."""
    from rfgen_sionna.generative.actor import Actor

    parts = text.rsplit(maxsplit=2)
    if len(parts) < 3:
        raise ValueError(f"--actor: {text!r} is not 'FILE MATERIAL X,Y,Z', such as 'chair.glb wood 2,1,0'")
    file, material, place = parts
    position = _point("--actor", place)
    return Actor.from_mesh(file, material=material, position=position or (0.0, 0.0, 0.0))


def _point(option: str, text: str | None) -> tuple[float, float, float] | None:
    if text is None:
        return None
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        raise ValueError(f"{option}: {text!r} is not X,Y,Z in metres, such as 0,0,1") from None
    return x, y, z


def _resolution(text: str) -> tuple[int, int]:
    parts = text.lower().replace("×", "x").split("x")
    if len(parts) > 2 or not all(part.strip().isdecimal() and 0 < int(part) <= 4096 for part in parts):
        raise ValueError(f"--pir-resolution: {text!r} is not ROWSxCOLUMNS with 1 to 4096 each, such as 128x128")
    return int(parts[0]), int(parts[-1])
