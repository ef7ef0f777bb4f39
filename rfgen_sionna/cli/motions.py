"""`rfgen motions`: captured motion that ships with the package."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from rfgen_sionna.cli.console import out as _out
from rfgen_sionna.cli.console import report_written

_MOST_DRAWN = 12
EPILOG = """[bold]Examples[/bold]

rfgen motions

rfgen motions kick

rfgen motions "lies down" --draw lying.png"""


def motions(
    words: Annotated[str, typer.Argument(help="Words of names, actions and captions; none lists the actions.")] = "",
    draw: Annotated[
        Path | None,
        typer.Option(help=f"Picture of stick figures to write, at most {_MOST_DRAWN} clips.", show_default=False),
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace an existing picture.")] = False,
) -> None:
    """List captured motion clips by action or words, and draw them."""
    from rfgen_sionna.generative.motion_library import MotionLibrary

    library = MotionLibrary()
    found = library.search(words)
    if not found:
        raise ValueError(f"no clip has the words {words!r}; actions: {', '.join(library.actions)}")
    if draw is not None and draw.exists() and not overwrite:
        raise FileExistsError(f"'{draw}' exists: name another file, or add --overwrite")
    table = Table(box=None, padding=(0, 2, 0, 0))
    if words:
        for heading in ("clip", "s", "terms", "caption"):
            table.add_column(heading, overflow="fold")
        for clip in found:
            table.add_row(clip.name, f"{clip.duration:.1f}", clip.licence, clip.captions[0] if clip.captions else "")
    else:
        table.add_column("action", overflow="fold")
        for heading in ("clips", "minutes"):
            table.add_column(heading, justify="right")
        for action, clips in library.actions.items():
            table.add_row(action, str(len(clips)), f"{sum(clip.duration for clip in clips) / 60:.1f}")
    _out.print(table)
    _out.print(f"{len(found)} clips, {sum(clip.duration for clip in found) / 60:.1f} minutes")
    if draw is not None:
        from rfgen_sionna.show.stick_figures import draw_stick_figures

        draw_stick_figures({clip.name: library.motion(clip.name) for clip in found[:_MOST_DRAWN]}, draw)
        report_written(draw)
