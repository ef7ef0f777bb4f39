"""Output of the commands: text, progress and pictures."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

out = Console()
err = Console(stderr=True)


def draw(file: Path, overwrite: bool, keep: bool = False) -> None:
    """Draw the sheet and the film; `keep` leaves the ones that exist, which is an error otherwise."""
    from rfgen_sionna.show import NoPictureError, animation, sheet

    try:
        _draw_both(file, overwrite, keep, sheet, animation)
    except NoPictureError as reason:  # the data are there, and so are the samples for who wants to look otherwise
        warn(str(reason), UserWarning)


def _draw_both(
    file: Path, overwrite: bool, keep: bool, sheet: Callable[..., Path], animation: Callable[..., Path]
) -> None:
    target = _picture(file, ".png")
    if not (keep and _keeps_existing(target, overwrite)):
        with out.status("drawing"):
            drawn = sheet(file, target, overwrite=overwrite)
        report_written(drawn)
    target = _picture(file, ".gif")
    if not (keep and _keeps_existing(target, overwrite)):
        with progress("film") as step:
            film = animation(file, target, overwrite=overwrite, progress=step)
        report_written(film)


def _keeps_existing(target: Path, overwrite: bool) -> bool:
    """Whether a picture exists and is not to be replaced; says so."""
    if overwrite or not target.exists():
        return False
    out.print(f"{escape(str(target))} exists and is left; --overwrite draws it again", soft_wrap=True)
    return True


def _picture(file: Path, suffix: str) -> Path:
    if file.suffix == suffix:
        raise ValueError(f"output '{file}' is a picture's name; the data go into an HDF5 file, such as 'run.h5'")
    return file.with_suffix(suffix)


def check_pictures(file: Path, overwrite: bool) -> None:
    """Fail before the work and not after it."""
    from rfgen_sionna.dataset import check_output

    for suffix in (".png", ".gif"):
        check_output(_picture(file, suffix), overwrite)


def report_written(path: Path | None) -> None:
    """Say what was written."""
    out.print(f"[green]wrote[/green] {escape(str(path))}", soft_wrap=True)


@contextmanager
def progress(description: str) -> Iterator[Callable[[int, int], None]]:
    """A progress bar; yields what to call with the number of steps done and in all."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, TextColumn("elapsed,"), TimeRemainingColumn(), TextColumn("left"), console=out) as bar:
        task = bar.add_task(description, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)


def warn(message: Warning | str, category: type[Warning], *_: object) -> None:
    """Say what the user should know; stands for `warnings.showwarning`."""
    err.print(f"[yellow]warning:[/yellow] {escape(str(message))}", soft_wrap=True)
