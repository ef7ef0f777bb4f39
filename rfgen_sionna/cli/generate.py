"""`rfgen generate`: its options, and what it says while it works."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape

from rfgen_sionna.cli.console import check_pictures, draw, out, progress, report_written, warn

EPILOG = """[bold]Examples[/bold]

rfgen generate "a person doing jumping jacks, facing forward" --environment "a living room" --output jacks.h5

rfgen generate "a tall man walks back and forth at 3 m" --preset mmmesh --duration 5 --seed 1

rfgen generate "someone raises an arm" --negative "left arm" --environment "free space"

rfgen generate "a woman swipes to the left with the right hand, 1 m away" --preset di_gesture

rfgen generate "a person walks towards the radar, at azimuth 20 degrees" --environment "free space"

rfgen generate "a person walks while raising the left arm, 5 m away" --motion diffusion --environment "free space"

rfgen generate "action: push, distance: 1 m" --environment "floor wall" --radar-position=-1.5,0,1.2 --look-at 0,0,1.2

rfgen generate "a person stands" --environment "furnished: an office" --seed 4

rfgen generate "a person doing jumping jacks" --environment "a bedroom with a wardrobe" --negative-environment desk

rfgen generate "a person doing jumping jacks" --environment "scene: a living room"

rfgen generate "a man jumps, 4 m away" --environment Munich --radar-position 205.1,-261.5,1.5 --look-at 200,-261.5,1.5

A prompt names a person and one action; it may name orientation, distance, azimuth, body, hand, speed and surroundings.
The learned motion also knows captured actions ("dances"), and arms that do something while somebody walks; an action
that it does not know is taken for the nearest, with a warning. What else is not understood is said, and nothing is
guessed: where words leave a choice, the seed draws it, and the report
says of every value whether it comes from the prompt, an argument, a default or the seed."""


def generate(
    prompt: Annotated[str, typer.Argument(help="Who does what, in a sentence or keywords.", show_default=False)],
    negative: Annotated[str, typer.Option(help='What is not wanted: "left arm", "facing away", "child".')] = "",
    environment: Annotated[
        str | None,
        typer.Option(
            help='Where: "a living room", "an office", "free space", a scene of Sionna (default: the place in the '
            'prompt). With a source: "furnished: an office" (by the seed), "scene: a living room" (of a file), '
            '"diffusion: a street" (imagined by a model).'
        ),
    ] = None,
    surroundings: Annotated[
        str | None, typer.Option(help='Deprecated: --environment "furnished: an office".', hidden=True)
    ] = None,
    no_environment: Annotated[
        bool, typer.Option("--no-environment", help="Free space, whatever the prompt says: --environment none.")
    ] = False,
    negative_environment: Annotated[str, typer.Option(help='What imagined surroundings are without: "sofa".')] = "",
    refine: Annotated[
        bool | None,
        typer.Option(help="Whether path diffusion completes imagined surroundings (default: yes).", show_default=False),
    ] = None,
    strength: Annotated[
        float | None, typer.Option(min=0.0, max=1.0, help="How far path diffusion goes, 0 to 1 (default: 1).")
    ] = None,
    environment_model: Annotated[
        str | None,
        typer.Option(help="What imagines: a trained model, a Stable Diffusion folder or hub name (default: ours)."),
    ] = None,
    environment_lora: Annotated[
        str | None, typer.Option(help="RF LoRA of that model: a file, folder or hub name.")
    ] = None,
    radar: Annotated[str, typer.Option(help="A radar of `rfgen radars`, or the path of a TOML file.")] = "awr1843",
    preset: Annotated[str | None, typer.Option(help="Configuration of that radar (default: its own choice).")] = None,
    duration: Annotated[float, typer.Option(help="Length of the recording in seconds.")] = 3.0,
    seed: Annotated[
        int, typer.Option(min=0, help="Seed of motion, body, noise and all that the prompt leaves open.")
    ] = 0,
    output: Annotated[
        Path | None, typer.Option(help="HDF5 file to write (default: the action's name).", dir_okay=False)
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace existing files.")] = False,
    noise: Annotated[bool, typer.Option(help="Thermal noise of the receiver.")] = True,
    receiver: Annotated[
        Path | None,
        typer.Option(help="TOML file of the receiver's impairments: leakage, phase noise, ADC …", dir_okay=False),
    ] = None,
    rtol: Annotated[
        float, typer.Option(help="Relative tolerance of the traced signal; 0.01 is 0.1 dB or 0.6 degrees.")
    ] = 1e-2,
    distance: Annotated[
        float | None, typer.Option(help="Distance of the person from the radar in metres, if the prompt names none.")
    ] = None,
    radar_position: Annotated[
        str | None,
        typer.Option(metavar="X,Y,Z", help="Where the radar stands, in metres (default: 0,0,1, as in our rooms)."),
    ] = None,
    look_at: Annotated[
        str | None,
        typer.Option(metavar="X,Y,Z", help="At what it looks (default: 3,0,1; along +x from a given position)."),
    ] = None,
    pir_resolution: Annotated[
        str | None,
        typer.Option(metavar="ROWSxCOLUMNS", help="Pixels of the PIR images (default: 128x128, imagined 64x64)."),
    ] = None,
    fov_deg: Annotated[
        float | None,
        typer.Option(help="Horizontal field of view of the images in degrees (default: 60, imagined 90)."),
    ] = None,
    projection: Annotated[
        str, typer.Option(help='Of the images: "perspective", or "equirectangular", azimuth and elevation evenly.')
    ] = "perspective",
    max_bounces: Annotated[
        int,
        typer.Option(
            min=1,
            max=3,
            help="Most surfaces on a path; 2 and 3 have ghosts, corners and limbs by limbs, and take longer.",
        ),
    ] = 1,
    transmission: Annotated[
        bool, typer.Option("--transmission", help="See through walls, glass and furniture; takes longer.")
    ] = False,
    motion: Annotated[
        str, typer.Option(help='Where the motion comes from: "diffusion" (learned), "kinematic" (rules) or "auto".')
    ] = "auto",
    collisions: Annotated[
        str, typer.Option(help='Where the person meets walls or furniture: "error", "warn" or "ignore".')
    ] = "error",
    device: Annotated[
        str, typer.Option(help='What imagines and sums the paths: "cpu", "cuda" or "auto", CUDA where there is one.')
    ] = "auto",
    workers: Annotated[
        int, typer.Option(min=1, help="Processes that trace and sum frames, each on one core (Linux, without CUDA).")
    ] = 1,
    pictures: Annotated[bool, typer.Option(help="Write a sheet of pictures (PNG) and an animation beside.")] = True,
) -> None:
    """Simulate a prompt: radar data, images, meshes and labels in one HDF5 file."""
    from rfgen_sionna.dataset import check_output
    from rfgen_sionna.generative.environment_prompt import with_source
    from rfgen_sionna.generative.sentences import read_prompt
    from rfgen_sionna.options import check_options
    from rfgen_sionna.pipeline import generate as run

    if surroundings is not None:
        warn("--surroundings is deprecated: use --environment 'furnished: …'", DeprecationWarning)
        environment = with_source(environment, surroundings)
    if no_environment:
        if environment not in (None, "none"):
            raise ValueError(f"--environment is {environment!r}, but --no-environment wants none: leave one out")
        environment = "none"
    if strength is not None and refine is False:
        raise ValueError(f"--strength is {strength:g}, but --no-refine wants no path diffusion: leave one out")
    resolution = None if pir_resolution is None else _resolution(pir_resolution)
    place, target_point = _point("--radar-position", radar_position), _point("--look-at", look_at)
    options: dict[str, Any] = {
        "radar": radar,
        "preset": preset,
        "radar_position": place,
        "look_at": target_point,
        "duration": duration,
        "output": output,
        "overwrite": overwrite,
        "noise": noise,
        "receiver": receiver,
        "rtol": rtol,
        "pir_resolution": resolution,
        "fov_deg": fov_deg,
        "projection": projection,
        "max_bounces": max_bounces,
        "transmission": transmission,
        "environment": environment,
        "collisions": collisions,
        "device": device,
        "workers": workers,
    }
    check_options(**options)  # to read the prompt takes seconds, which nobody should wait for a word that is mistyped
    read = read_prompt(prompt, negative, seed=seed, source=motion)
    target = output if output is not None else Path(f"{read.action}.h5")
    out.print(escape(read.words()), soft_wrap=True)
    check_output(target, overwrite)
    if pictures:
        check_pictures(target, overwrite)

    with progress("frames") as step:
        run(
            prompt,
            negative=negative,
            negative_environment=negative_environment,
            refine=refine if strength is None else strength,
            environment_model=environment_model,
            environment_lora=environment_lora,
            seed=seed,
            distance=distance,
            motion=motion,
            **options | {"output": target},
            progress=step,
            report=_print_decisions,
        ).close()
    report_written(target)
    if pictures:
        draw(target, overwrite)


def _print_decisions(report: str) -> None:
    """Print what the report adds to the words, which are shown already; a warning names those without effect."""
    from rfgen_sionna.generative.prompts import DECIDED

    _, heading, decisions = report.partition(DECIDED)
    out.print(escape(heading + decisions), soft_wrap=True)


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
