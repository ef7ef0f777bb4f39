"""`rfgen view`: a run in Rerun."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rfgen_sionna.cli.console import progress, report_written
from rfgen_sionna.cli.sources import (
    Board,
    Overwrite,
    Partial,
    RadarName,
    RecordingNumber,
    Source,
    one_radar,
    opened_source,
)

EPILOG = """[bold]Examples[/bold]

rfgen view jacks.h5

rfgen view out/ --recording 12

rfgen view jacks.h5 --save jacks.rrd

Rerun comes with [bold]pip install 'rfgen-sionna[view]'[/bold]; `rerun jacks.rrd` opens a saved file. Its viewer
reports use to its makers unless `rerun analytics disable` has been run; `rfgen show --html` needs a browser only."""


def view(
    source: Source,
    recording: RecordingNumber = None,
    save: Annotated[
        Path | None, typer.Option(help="File (.rrd) to write instead of opening a window.", show_default=False)
    ] = None,
    radar: RadarName = None,
    board: Board = None,
    partial: Partial = False,
    overwrite: Overwrite = False,
) -> None:
    """Open a run, a recording of a data set or a capture in Rerun, with everything on one time line."""
    from rfgen_sionna.dataset import Run
    from rfgen_sionna.show import open_in_rerun

    with opened_source(source, radar, board, partial, recording) as whole:
        run = one_radar(whole, radar) if isinstance(whole, Run) else whole
        with progress("frames") as step:
            written = open_in_rerun(run, save=save, overwrite=overwrite, progress=step)
    if written is not None:
        report_written(written)
