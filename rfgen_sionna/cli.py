"""The command line: `rfgen generate`, `rfgen radars`, `rfgen show`, `rfgen export`, `rfgen bench`."""

from __future__ import annotations

import importlib
import logging
import math
import signal
import sys
import threading
import types
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn, cast

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

if TYPE_CHECKING:
    from rfgen_sionna.scene.places import Policy

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

rfgen generate "a person walks towards the radar, at azimuth 20 degrees" --environment "free space"

rfgen generate "action: push, distance: 1 m" --environment "floor wall" --radar-position=-1.5,0,1.2 --look-at 0,0,1.2

rfgen generate "a person stands" --environment "an office" --surroundings furnished --seed 4

rfgen generate "a person doing jumping jacks" --environment "a bedroom" --surroundings diffusion

rfgen generate "a man jumps, 4 m away" --environment Munich --radar-position 205.1,-261.5,1.5 --look-at 200,-261.5,1.5

A prompt names a person and one action; it may name orientation, distance, azimuth, body, hand, speed and surroundings.
What is not understood is said, and nothing is guessed: where words leave a choice, the seed draws it, and the report
says of every value whether it comes from the prompt, an argument, a default or the seed."""
)
def generate(
    prompt: Annotated[str, typer.Argument(help="Who does what, in a sentence or keywords.", show_default=False)],
    negative: Annotated[str, typer.Option(help='What is not wanted: "left arm", "facing away", "child".')] = "",
    environment: Annotated[
        str | None,
        typer.Option(
            help='Where: "a living room", "an office", "free space", a scene of Sionna (default: what the prompt says).'
        ),
    ] = None,
    surroundings: Annotated[
        str,
        typer.Option(
            help='Where surroundings come from: "scene" (of a file), "furnished" (by the seed), "diffusion" (imagined '
            'by a model) or "auto", a scene where there is one, else furnished.'
        ),
    ] = "auto",
    negative_environment: Annotated[str, typer.Option(help='What imagined surroundings are without: "sofa".')] = "",
    refine: Annotated[
        bool | None,
        typer.Option(help="Whether path diffusion completes imagined surroundings (default: yes).", show_default=False),
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
    rtol: Annotated[float, typer.Option(help="Relative tolerance of the traced signal.")] = 1e-3,
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
        typer.Option(metavar="ROWSxCOLUMNS", help="Pixels of the PIR images (default: 128x128; imagined: 64x64)."),
    ] = None,
    max_bounces: Annotated[
        int,
        typer.Option(min=1, max=3, help="Most surfaces on a path; 2 and 3 have ghosts and corners, and take longer."),
    ] = 1,
    transmission: Annotated[
        bool, typer.Option("--transmission", help="See through walls, glass and furniture; takes longer.")
    ] = False,
    motion: Annotated[
        str, typer.Option(help='Where the motion comes from: "kinematic" (rules) or "diffusion" (learned).')
    ] = "kinematic",
    collisions: Annotated[
        str, typer.Option(help='Where the person meets walls or furniture: "error", "warn" or "ignore".')
    ] = "error",
    device: Annotated[
        str, typer.Option(help='What sums the paths: "cpu", "cuda" or "auto", CUDA where there is one.')
    ] = "auto",
    pictures: Annotated[bool, typer.Option(help="Write a sheet of pictures (PNG) and an animation beside.")] = True,
) -> None:
    """Simulate a prompt: radar data, images, meshes and labels in one HDF5 file."""
    from rfgen_sionna.dataset import check_output
    from rfgen_sionna.generative.prompts import parse_prompt

    resolution = None if pir_resolution is None else _resolution(pir_resolution)
    place, target_point = _point("--radar-position", radar_position), _point("--look-at", look_at)
    read = parse_prompt(prompt, negative, seed=seed)
    target = output if output is not None else Path(f"{read.action}.h5")
    _out.print(escape(read.words()), soft_wrap=True)
    check_output(target, overwrite)
    if pictures:
        _check_pictures(target, overwrite)

    from rfgen_sionna.pipeline import generate as run

    with _progress("frames") as progress:
        run(
            prompt,
            negative=negative,
            environment=environment,
            surroundings=surroundings,
            negative_environment=negative_environment,
            refine=refine,
            radar=radar,
            preset=preset,
            duration=duration,
            seed=seed,
            output=target,
            overwrite=overwrite,
            noise=noise,
            receiver=receiver,
            rtol=rtol,
            distance=distance,
            radar_position=place,
            look_at=target_point,
            pir_resolution=resolution,
            max_bounces=max_bounces,
            transmission=transmission,
            motion=motion,
            collisions=cast("Policy", collisions),  # checked there
            device=device,
            progress=progress,
            report=_decided,
        ).close()
    _wrote(target)
    if pictures:
        _draw(target, overwrite)


@app.command()
def radars() -> None:
    """List the radars, their configurations and what follows from them."""
    from rfgen_sionna.radar import Radar

    # Narrow enough for 80 columns; where it is narrower still, names fold and nothing is cut off.
    table = Table(box=None, padding=(0, 1, 0, 0))
    table.add_column("radar, preset", overflow="fold")
    for heading in ("GHz", "Tx×Rx", "frame", "Hz", "range m", "speed m/s"):
        table.add_column(heading, justify="right", no_wrap=True, overflow="fold")
    for name, presets in Radar.available().items():
        table.add_row(f"[bold]{name}[/bold]")
        for preset in presets:
            r = Radar.load(name, preset)
            wave = r.waveform
            low, high = wave.sampled_band
            cell = f"{r.range_resolution:.3f}" if math.isfinite(r.range_resolution) else "-"
            table.add_row(
                f"  {preset}",
                f"{low / 1e9:.2f}–{high / 1e9:.2f}",
                f"{len(r.tx_positions)}×{len(r.rx_positions)}",
                f"{wave.num_loops}×{wave.num_samples}",
                f"{1 / wave.frame_period:g}",
                f"{cell} {r.max_range:.1f}",
                f"{r.velocity_resolution:.3f} ±{r.max_velocity:.2f}",
            )
    _out.print(table)
    _out.print("frame: loops × samples; Hz: frames per second; range, speed: resolution, unambiguous maximum")


@app.command(
    epilog="""[bold]Examples[/bold]

rfgen show jacks.h5

rfgen show jacks.h5 --overwrite

Pictures that exist already, such as those of `rfgen generate`, are left unless --overwrite is given."""
)
def show(
    file: Annotated[Path, typer.Argument(help="A file that `rfgen generate` wrote.", show_default=False)],
    pictures: Annotated[bool, typer.Option(help="Write a sheet of pictures (PNG) and an animation beside.")] = True,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace existing pictures.")] = False,
) -> None:
    """Say what a file holds, and draw it."""
    from rfgen_sionna.show import summary

    _out.print(escape(summary(file)), soft_wrap=True)
    if pictures:
        _draw(file, overwrite, keep=True)


@app.command(
    epilog="""[bold]Examples[/bold]

rfgen export jacks.h5 --format dca1000 --output captures/

rfgen export jacks.h5 --format matlab --output jacks.mat

rfgen export jacks.h5 --format dca1000 --output captures/ --scale=-20dBm"""
)
def export(
    file: Annotated[Path, typer.Argument(help="A file that `rfgen generate` wrote.", show_default=False)],
    format: Annotated[
        str, typer.Option("--format", help="dca1000, cascade, position2go, rfgenesis or matlab.", show_default=False)
    ],
    output: Annotated[Path, typer.Option(help="Data file, or folder for the files.", show_default=False)],
    scale: Annotated[
        str,
        typer.Option(help='"auto", a number in √W per LSB, or the full scale as a power, such as -20dBm.'),
    ] = "auto",
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace existing files.")] = False,
) -> None:
    """Write the samples as the files that a radar's own tools write."""
    from rfgen_sionna.dataset import open_run
    from rfgen_sionna.records import AdcCube
    from rfgen_sionna.signal.formats import write_capture

    options = _scale(scale)
    with open_run(file) as run, _out.status("exporting"):
        # The samples stay on the disk: a frame at a time is read, scaled and written.
        cube = AdcCube(run.adc, run.radar, run.frame_times, run.seeds.get("noise"))
        report = write_capture(cube, output, format, overwrite=overwrite, **options)
    for path in report.paths:
        _wrote(path)
    level = "" if report.full_scale_dbm is None else f", full scale {report.full_scale_dbm:.1f} dBm"
    _out.print(f"{report.frames} frames, {report.scale:g} √W per LSB{level}, {report.clipped} values clipped")


@app.command(
    epilog="""[bold]Examples[/bold]

rfgen bench --quick

rfgen bench --scene sphere --scene hand --out bench/

It needs a checkout of the repository: the benchmark is no part of the installed package. docs/benchmarks.md tells how
to read what it writes."""
)
def bench(
    scene: Annotated[list[str] | None, typer.Option(help="A scene alone, without the rest; may be repeated.")] = None,
    part: Annotated[list[str] | None, typer.Option(help="A part of the benchmark alone; may be repeated.")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Fewer scenes and points.")] = False,
    out: Annotated[Path, typer.Option(help="Folder for JSON, tables and pictures.", file_okay=False)] = Path("bench"),
    seed: Annotated[int, typer.Option(min=0, help="Seed of all that is drawn.")] = 0,
) -> None:
    """Measure time, memory and error against other methods and independent truth, on this machine."""
    benchmark = _benchmark()
    with _out.status("starting") as status:
        result = benchmark.run(out, scene or (), quick, seed, status.update, part or ())
    for name in ("bench.json", "bench.md"):
        _wrote(out / name)
    _out.print(f"{result['seconds']:.0f} s; pictures in {escape(str(out))}")


def _benchmark() -> Any:
    """The benchmark's module, from the checkout that this package is installed from."""
    root = Path(__file__).resolve().parents[1]
    if not (root / "tests" / "benchmarks" / "bench.py").is_file():
        raise FileNotFoundError(
            "the benchmark is in tests/benchmarks of the repository, and this package is not installed from a checkout "
            "of it: clone the repository and install it with `pip install -e .[dev]`"
        )
    if "tests" not in sys.modules:  # by its path: another package of that name may be installed
        tests = types.ModuleType("tests")
        tests.__path__ = [str(root / "tests")]
        sys.modules["tests"] = tests
    return importlib.import_module("tests.benchmarks.bench")


def _scale(text: str) -> dict[str, Any]:
    number, decibels = text.strip().lower(), False
    if number == "auto":
        return {}
    if number.endswith("dbm"):
        number, decibels = number.removesuffix("dbm"), True
    try:
        return {"full_scale_dbm" if decibels else "scale": float(number)}
    except ValueError:
        raise ValueError(f"--scale: {text!r} is not auto, a number of √W per LSB, or a power such as -20dBm") from None


def _draw(file: Path, overwrite: bool, keep: bool = False) -> None:
    """Draw the sheet and the film; `keep` leaves the ones that exist, which is an error otherwise."""
    from rfgen_sionna.show import NoPictureError, animation, sheet

    try:
        _draw_both(file, overwrite, keep, sheet, animation)
    except NoPictureError as reason:  # the data are there, and so are the samples for who wants to look otherwise
        _warn(str(reason), UserWarning)


def _draw_both(
    file: Path, overwrite: bool, keep: bool, sheet: Callable[..., Path], animation: Callable[..., Path]
) -> None:
    target = _picture(file, ".png")
    if not (keep and _left(target, overwrite)):
        with _out.status("drawing"):
            picture = sheet(file, target, overwrite=overwrite)
        _wrote(picture)
    target = _picture(file, ".gif")
    if not (keep and _left(target, overwrite)):
        with _progress("film") as progress:
            film = animation(file, target, overwrite=overwrite, progress=progress)
        _wrote(film)


def _left(target: Path, overwrite: bool) -> bool:
    """Whether a picture exists and is not to be replaced; says so."""
    if overwrite or not target.exists():
        return False
    _out.print(f"{escape(str(target))} exists and is left; --overwrite draws it again", soft_wrap=True)
    return True


def _picture(file: Path, suffix: str) -> Path:
    if file.suffix == suffix:
        raise ValueError(f"output '{file}' is a picture's name; the data go into an HDF5 file, such as 'run.h5'")
    return file.with_suffix(suffix)


def _check_pictures(file: Path, overwrite: bool) -> None:
    """Fail before the work and not after it."""
    from rfgen_sionna.dataset import check_output

    for suffix in (".png", ".gif"):
        check_output(_picture(file, suffix), overwrite)


def _wrote(path: Path | None) -> None:
    _out.print(f"[green]wrote[/green] {escape(str(path))}", soft_wrap=True)


def _decided(report: str) -> None:
    """Print what the report adds to the words, which are shown already; a warning names those without effect."""
    from rfgen_sionna.generative.prompts import DECIDED

    _, heading, decisions = report.partition(DECIDED)
    _out.print(escape(heading + decisions), soft_wrap=True)


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


@contextmanager
def _progress(description: str) -> Iterator[Callable[[int, int], None]]:
    """A progress bar; yields what to call with the number of steps done and in all."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, TextColumn("elapsed,"), TimeRemainingColumn(), TextColumn("left"), console=_out) as bar:
        task = bar.add_task(description, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)


def _warn(message: Warning | str, category: type[Warning], *_: object) -> None:
    _err.print(f"[yellow]warning:[/yellow] {escape(str(message))}", soft_wrap=True)


class _LogLines(logging.Handler):
    """What the package logs, as warnings are shown."""

    def emit(self, record: logging.LogRecord) -> None:
        _err.print(f"[yellow]{record.levelname.lower()}:[/yellow] {escape(record.getMessage())}", soft_wrap=True)


_ENDINGS = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))
"""Signals that end a program without a word; here what is half done is cleaned up first."""


def _end(number: int, _: object) -> NoReturn:
    """Unwind as an interruption from the keyboard does, so that no partial file stays behind."""
    sys.exit(128 + number)


def main() -> None:
    """Entry point: what the user can mend is one line and exit code 2, anything else is a bug and a traceback."""
    from rfgen_sionna.scene.errors import BackendError

    warnings.showwarning = _warn  # type: ignore[assignment]
    logging.getLogger("rfgen_sionna").addHandler(_LogLines(logging.WARNING))
    if threading.current_thread() is threading.main_thread():  # no other one may
        for number in _ENDINGS:
            signal.signal(number, _end)
    try:
        app()
    except (ValueError, OSError, ImportError, BackendError) as error:
        _err.print(f"[red]error:[/red] {escape(str(error))}", soft_wrap=True)
        sys.exit(2)
