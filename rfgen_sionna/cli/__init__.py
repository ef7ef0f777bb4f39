"""Command line: `rfgen generate`, `rfgen radars`, `rfgen show`, `rfgen view`, `rfgen export`, `rfgen motions`,
`rfgen things`, `rfgen bench`, `rfgen dataset`."""

from __future__ import annotations

import logging
import math
import signal
import sys
import threading
import warnings
from typing import NoReturn

import typer
from rich.markup import escape
from rich.table import Table

from rfgen_sionna.cli.benchmark import EPILOG as BENCH_EPILOG
from rfgen_sionna.cli.benchmark import bench
from rfgen_sionna.cli.console import err as _err
from rfgen_sionna.cli.console import out as _out
from rfgen_sionna.cli.console import warn
from rfgen_sionna.cli.datasets import datasets
from rfgen_sionna.cli.generate import EPILOG, generate
from rfgen_sionna.cli.motions import EPILOG as MOTIONS_EPILOG
from rfgen_sionna.cli.motions import motions
from rfgen_sionna.cli.recorded import EXPORT_EPILOG, SHOW_EPILOG, export, show
from rfgen_sionna.cli.things import EPILOG as THINGS_EPILOG
from rfgen_sionna.cli.things import things
from rfgen_sionna.cli.viewing import EPILOG as VIEW_EPILOG
from rfgen_sionna.cli.viewing import view

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


app.command(epilog=SHOW_EPILOG)(show)
app.command(epilog=VIEW_EPILOG)(view)
app.command(epilog=EXPORT_EPILOG)(export)
app.command(epilog=MOTIONS_EPILOG)(motions)
app.command(epilog=THINGS_EPILOG)(things)
app.command(epilog=BENCH_EPILOG)(bench)
app.add_typer(datasets, name="dataset")


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
