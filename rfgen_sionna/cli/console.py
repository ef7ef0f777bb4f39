"""Output of the commands: text, progress, pictures."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.markup import escape

from rfgen_sionna.progress_bar import progress_bar

if TYPE_CHECKING:
    from rfgen_sionna.dataset import Run
    from rfgen_sionna.signal.formats import Capture

out = Console()
err = Console(stderr=True)


def draw(file: Path, overwrite: bool, keep: bool = False) -> None:
    """Draw sheet and film; `keep` keeps existing files instead of an error."""
    from rfgen_sionna.dataset import open_run

    with open_run(file) as run:
        for name, each in run.radars.items():
            draw_run(each, picture_name(file, run, name), overwrite, keep)


def picture_name(file: Path, run: Run, radar: str) -> Path:
    """Name of the pictures of one radar, before their suffix: with the radar's in a file of several."""
    return file if run[radar] is run else file.with_stem(f"{file.stem}-{radar.replace(' ', '-')}")


def draw_run(run: Run | Capture, file: Path, overwrite: bool, keep: bool) -> None:
    """Draw sheet and film of one radar's run, or of a capture, with the name of `file`."""
    from rfgen_sionna.show import NoPictureError, animation, sheet

    try:
        for suffix in (".png", ".gif"):
            target = _picture(file, suffix)
            if keep and not overwrite and target.exists():
                out.print(f"{escape(str(target))} exists and is kept; --overwrite draws it again", soft_wrap=True)
            elif suffix == ".png":
                with out.status("drawing"):
                    sheet(run, target, overwrite=overwrite)
                report_written(target)
            else:
                with progress("film") as step:
                    animation(run, target, overwrite=overwrite, progress=step)
                report_written(target)
    except NoPictureError as reason:  # the data are complete without pictures
        warn(str(reason), UserWarning)


def _picture(file: Path, suffix: str) -> Path:
    if file.suffix == suffix:
        raise ValueError(f"output '{file}' is a picture's name; an HDF5 file, such as 'run.h5', is needed")
    return file.with_suffix(suffix)


def check_pictures(file: Path, overwrite: bool) -> None:
    """Check before the work that the pictures can be written."""
    from rfgen_sionna.dataset import check_output

    for suffix in (".png", ".gif"):
        check_output(_picture(file, suffix), overwrite)


def report_written(path: Path | None) -> None:
    """Print the path of a written file."""
    out.print(f"[green]wrote[/green] {escape(str(path))}", soft_wrap=True)


def progress(description: str) -> AbstractContextManager[Callable[[int, int], None]]:
    """Progress bar; gives a callback for the numbers of finished steps and of all steps."""
    return progress_bar(description, out)


def warn(message: Warning | str, category: type[Warning], *_: object) -> None:
    """Print a warning; replaces `warnings.showwarning`."""
    err.print(f"[yellow]warning:[/yellow] {escape(str(message))}", soft_wrap=True)
