"""Command line: `rfgen generate`, `rfgen radars`, `rfgen show`, `rfgen export`, `rfgen motions`, `rfgen bench`."""

from __future__ import annotations

import logging
import math
import signal
import sys
import threading
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer
from rich.markup import escape
from rich.table import Table

from rfgen_sionna.cli.benchmark import EPILOG as BENCH_EPILOG
from rfgen_sionna.cli.benchmark import bench
from rfgen_sionna.cli.console import draw, report_written, warn
from rfgen_sionna.cli.console import err as _err
from rfgen_sionna.cli.console import out as _out
from rfgen_sionna.cli.generate import EPILOG, generate
from rfgen_sionna.cli.motions import EPILOG as MOTIONS_EPILOG
from rfgen_sionna.cli.motions import motions

if TYPE_CHECKING:
    from rfgen_sionna.dataset import Run

app = typer.Typer(
    name="rfgen",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    help="Simulated FMCW radar data of people in rooms: from a sentence to raw ADC samples.",
    epilog='Start with: [bold]rfgen generate "a person doing jumping jacks" --environment "a living room"[/bold]',
)
app.command(epilog=EPILOG)(generate)


@app.command()
def radars() -> None:
    """List the radars and their presets, with resolutions and ranges."""
    from rfgen_sionna.radar import Radar

    # Fits 80 columns; names fold on narrower terminals.
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
                f"{1 / wave.frame_period:.3g}",
                f"{cell} {r.max_range:.1f}",
                f"{r.velocity_resolution:.3f} ±{r.max_velocity:.2f}",
            )
    _out.print(table)
    _out.print("frame: loops × samples; Hz: frames per second; range, speed: resolution, unambiguous maximum")


@app.command(
    epilog="""[bold]Examples[/bold]

rfgen show jacks.h5

rfgen show jacks.h5 --overwrite

Existing pictures are kept unless --overwrite is given."""
)
def show(
    file: Annotated[Path, typer.Argument(help="HDF5 file of `rfgen generate`.", show_default=False)],
    pictures: Annotated[bool, typer.Option(help="Write a sheet of pictures (PNG) and an animation (GIF), too.")] = True,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace existing pictures.")] = False,
) -> None:
    """Summarise a run file and draw its pictures."""
    from rfgen_sionna.show import summary

    _out.print(escape(summary(file)), soft_wrap=True)
    if pictures:
        draw(file, overwrite, keep=True)


@app.command(
    epilog="""[bold]Examples[/bold]

rfgen export jacks.h5 --format dca1000 --output captures/

rfgen export jacks.h5 --format matlab --output jacks.mat

rfgen export jacks.h5 --format dca1000 --output captures/ --scale=-20dBm"""
)
def export(
    file: Annotated[Path, typer.Argument(help="HDF5 file of `rfgen generate`.", show_default=False)],
    format: Annotated[
        str, typer.Option("--format", help="dca1000, cascade, position2go, rfgenesis or matlab.", show_default=False)
    ],
    output: Annotated[Path, typer.Option(help="File or folder to write, by format.", show_default=False)],
    radar: Annotated[str | None, typer.Option(help="Name of the radar, in a file of several.")] = None,
    scale: Annotated[
        str, typer.Option(help='"auto", a number in √W per LSB, or the full scale as a power, such as -20dBm.')
    ] = "auto",
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace existing files.")] = False,
) -> None:
    """Export the samples to a capture format of a radar's own tools."""
    from rfgen_sionna.dataset import open_run
    from rfgen_sionna.records import AdcCube
    from rfgen_sionna.signal.formats import write_capture

    options = _scale(scale)
    with open_run(file) as whole, _out.status("exporting"):
        run = _one_radar(whole, radar)
        # lazily: one frame at a time is read and written
        cube = AdcCube(run.adc, run.radar, run.frame_times, run.seeds.get("noise"))
        report = write_capture(cube, output, format, overwrite=overwrite, **options)
    for path in report.paths:
        report_written(path)
    level = "" if report.full_scale_dbm is None else f", full scale {report.full_scale_dbm:.1f} dBm"
    _out.print(f"{report.frames} frames, {report.scale:g} √W per LSB{level}, {report.clipped} values clipped")


app.command(epilog=MOTIONS_EPILOG)(motions)
app.command(epilog=BENCH_EPILOG)(bench)


def _one_radar(run: Run, name: str | None) -> Run:
    """Run of the radar `name`, or of the only one."""
    if name is None and len(run.radars) == 1:
        return next(iter(run.radars.values()))
    if name not in run.radars:
        given = "is not given" if name is None else f"is {name!r}"
        raise ValueError(f"--radar {given}; '{run.path}' has {', '.join(map(repr, run.radars))}: name one of them")
    return run[name]


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


class _LogLines(logging.Handler):
    """Log handler with the format of warnings."""

    def emit(self, record: logging.LogRecord) -> None:
        _err.print(f"[yellow]{record.levelname.lower()}:[/yellow] {escape(record.getMessage())}", soft_wrap=True)


_ENDINGS = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))
"""Signals that end a process at once by default."""


def _end(number: int, _: object) -> NoReturn:
    """Unwind the stack, so that partial files are removed."""
    sys.exit(128 + number)


def main() -> None:
    """Entry point; errors of the user are one line and exit code 2, others a traceback."""
    from rfgen_sionna.scene.scene_errors import BackendError

    warnings.showwarning = warn  # type: ignore[assignment]
    logging.getLogger("rfgen_sionna").addHandler(_LogLines(logging.WARNING))
    if threading.current_thread() is threading.main_thread():  # signal.signal needs it
        for number in _ENDINGS:
            signal.signal(number, _end)
    try:
        app()
    except (ValueError, OSError, ImportError, BackendError) as error:
        _err.print(f"[red]error:[/red] {escape(str(error))}", soft_wrap=True)
        sys.exit(2)
