"""The command line: `rfgen generate`, `rfgen radars`, `rfgen show`."""

from __future__ import annotations

import sys
import warnings
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

app = typer.Typer(
    name="rfgen",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    help="Synthetic radar data of people moving in rooms, from a sentence to raw ADC cubes.",
    epilog='Start with: [bold]rfgen generate "a person doing jumping jacks" --environment "a living room"[/bold]',
)
_out = Console()
_err = Console(stderr=True)


@app.command(
    epilog="""[bold]Examples[/bold]

rfgen generate "a person doing jumping jacks, facing forward" --environment "a living room" --output jacks.h5

rfgen generate "a tall man walks back and forth at 3 m" --preset mmmesh --duration 5 --seed 1

rfgen generate "someone raises an arm" --negative "left arm" --environment "free space"

rfgen generate "a woman swipes to the left with the right hand, 1 m away" --preset di_gesture

A prompt names a person and one action; it may name orientation, distance, body, hand, speed and surroundings.
What is not understood is said, and nothing is guessed: where words leave a choice, the seed draws it."""
)
def generate(
    prompt: Annotated[str, typer.Argument(help="Who does what, in a sentence or keywords.", show_default=False)],
    negative: Annotated[str, typer.Option(help='What is not wanted: "left arm", "facing away", "child".')] = "",
    environment: Annotated[
        str | None,
        typer.Option(help='Where: "a living room", "free space", a scene of Sionna (default: what the prompt says).'),
    ] = None,
    radar: Annotated[str, typer.Option(help="A radar of `rfgen radars`, or the path of a TOML file.")] = "awr1843",
    preset: Annotated[str | None, typer.Option(help="Configuration of that radar (default: its own choice).")] = None,
    duration: Annotated[float, typer.Option(help="Length of the recording in seconds.")] = 3.0,
    seed: Annotated[int, typer.Option(help="Seed of motion, body, noise and all that the prompt leaves open.")] = 0,
    output: Annotated[
        Path | None, typer.Option(help="HDF5 file to write (default: the action's name).", dir_okay=False)
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace existing files.")] = False,
    noise: Annotated[bool, typer.Option(help="Thermal noise of the receiver.")] = True,
    rtol: Annotated[float, typer.Option(help="Relative tolerance of the traced signal.")] = 1e-3,
    distance: Annotated[
        float | None, typer.Option(help="Distance of the person from the radar in metres, if the prompt names none.")
    ] = None,
    pir_resolution: Annotated[str, typer.Option(metavar="ROWSxCOLUMNS", help="Pixels of the PIR images.")] = "128x128",
    pictures: Annotated[bool, typer.Option(help="Write a sheet of pictures (PNG) and an animation beside.")] = True,
) -> None:
    """Simulate a prompt: radar data, images, meshes and labels in one HDF5 file."""
    from rfgen_sionna.generative.prompts import parse_prompt

    resolution = _resolution(pir_resolution)
    read = parse_prompt(prompt, negative, seed=seed)
    target = output if output is not None else Path(f"{read.action}.h5")
    _out.print(escape(read.report()), soft_wrap=True)
    if pictures:
        _check_free([_sheet(target), _animation(target)], overwrite)

    from rfgen_sionna.pipeline import generate as run

    with _progress() as progress:
        task = progress.add_task("frames", total=None)
        run(
            prompt,
            negative=negative,
            environment=environment,
            radar=radar,
            preset=preset,
            duration=duration,
            seed=seed,
            output=target,
            overwrite=overwrite,
            noise=noise,
            rtol=rtol,
            distance=distance,
            pir_resolution=resolution,
            progress=lambda done, total: progress.update(task, completed=done, total=total),
        )
    _out.print(f"[green]wrote[/green] {escape(str(target))}")
    if pictures:
        _draw(target)


@app.command()
def radars() -> None:
    """List the radars, their configurations and what follows from them."""
    from rfgen_sionna.radar import Radar

    table = Table(box=None, padding=(0, 2, 0, 0))
    for heading in ("radar", "preset"):
        table.add_column(heading)
    for heading in ("GHz", "Tx×Rx", "frame", "Hz", "range m", "speed m/s"):
        table.add_column(heading, justify="right", no_wrap=True)
    for name, presets in Radar.available().items():
        for preset in presets:
            r = Radar.load(name, preset)
            wave = r.waveform
            low = wave.start_frequency + wave.slope * wave.adc_start_time
            table.add_row(
                name,
                preset,
                f"{low / 1e9:.2f}–{(low + wave.bandwidth) / 1e9:.2f}",
                f"{len(r.tx_positions)}×{len(r.rx_positions)}",
                f"{wave.num_loops}×{wave.num_samples}",
                f"{1 / wave.frame_period:g}",
                f"{r.range_resolution:.3f} {r.max_range:.1f}",
                f"{r.velocity_resolution:.3f} ±{r.max_velocity:.2f}",
            )
    _out.print(table)
    _out.print("frame: loops × samples; Hz: frames per second; range, speed: resolution, unambiguous maximum")


@app.command(epilog="Example: rfgen show jacks.h5")
def show(
    file: Annotated[Path, typer.Argument(help="A file that `rfgen generate` wrote.", show_default=False)],
    pictures: Annotated[bool, typer.Option(help="Write a sheet of pictures (PNG) and an animation beside.")] = True,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace existing pictures.")] = False,
) -> None:
    """Say what a file holds, and draw it."""
    from rfgen_sionna.dataset import open_run

    if pictures:
        _check_free([_sheet(file), _animation(file)], overwrite)
    with open_run(file) as run:
        _out.print(_summary(run))
    if pictures:
        _draw(file)


def _summary(run: Any) -> Table:
    radar, labels = run.radar, run.labels
    table = Table(show_header=False, title=escape(str(run.path)), title_justify="left")
    table.add_column(style="bold")
    table.add_column()
    frames, chirps, tx, rx, samples = run.adc.shape
    rows = {
        "prompt": run.prompt,
        "negative prompt": run.negative_prompt,
        "environment": run.environment or "free space",
        "radar": f"{radar.name}, preset {radar.preset}, at {_triple(radar.position)} m",
        "samples": f"{frames} frames × {chirps} chirps × {tx} Tx × {rx} Rx × {samples} samples",
        "frame rate": f"{1 / radar.waveform.frame_period:g} Hz",
        "actors": ", ".join(f"{a.name} ({a.material}, {len(a.faces)} faces)" for a in run.actors.values()),
        "labels": ", ".join(f"{name} [{label.units}]" if label.units else name for name, label in labels.items()),
        "PIR": "yes" if run.has_pir else "no",
        "seeds": ", ".join(f"{name} {seed}" for name, seed in run.seeds.items()),
        "software": ", ".join(f"{name} {version}" for name, version in run.software.items()),
        "created": run.created,
    }
    for name, value in rows.items():
        if value:
            table.add_row(name, escape(value))
    return table


def _triple(values: Any) -> str:
    return "(" + ", ".join(f"{v:g}" for v in values) + ")"


def _draw(target: Path) -> None:
    from rfgen_sionna.show import save_animation, save_sheet

    for draw, path in ((save_sheet, _sheet(target)), (save_animation, _animation(target))):
        draw(target, path)
        _out.print(f"[green]wrote[/green] {escape(str(path))}")


def _sheet(target: Path) -> Path:
    return target.with_suffix(".png")


def _animation(target: Path) -> Path:
    return target.with_suffix(".gif")


def _check_free(paths: list[Path], overwrite: bool) -> None:
    for path in paths:
        if path.exists() and not overwrite:
            raise FileExistsError(f"{path} exists; choose another name, or pass --overwrite")


def _resolution(text: str) -> tuple[int, int]:
    parts = text.lower().replace("×", "x").split("x")
    if len(parts) > 2 or not all(part.strip().isdecimal() and 0 < int(part) <= 4096 for part in parts):
        raise ValueError(f"--pir-resolution: {text!r} is not ROWSxCOLUMNS with 1 to 4096 each, such as 128x128")
    return int(parts[0]), int(parts[-1])


def _progress() -> Progress:
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        console=_out,
    )


def _warn(message: Warning | str, category: type[Warning], *_: object) -> None:
    _err.print(f"[yellow]warning:[/yellow] {escape(str(message))}", soft_wrap=True)


def main() -> None:
    """Entry point: what the user can mend is one line and exit code 2, anything else is a bug and a traceback."""
    from rfgen_sionna.scene.errors import BackendError

    warnings.showwarning = _warn  # type: ignore[assignment]
    try:
        app()
    except (ValueError, OSError, ImportError, BackendError) as error:
        _err.print(f"[red]error:[/red] {escape(str(error))}", soft_wrap=True)
        sys.exit(2)
    except KeyboardInterrupt:
        _err.print("interrupted")
        sys.exit(130)
