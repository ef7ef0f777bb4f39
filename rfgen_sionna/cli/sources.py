"""What commands read: runs, recordings of data sets, captures of radars' own tools."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rfgen_sionna.dataset import Run
    from rfgen_sionna.signal.formats import Capture

_RUN_SUFFIXES, _HDF5 = (".h5", ".hdf5"), b"\x89HDF"
"""Suffixes of run files, and the first bytes of every HDF5 file."""
_INDEX = "index.sqlite"
"""File by which a folder is a data set."""
_SOURCE = (
    "A run (HDF5) of `rfgen generate`, the folder of a data set, or a capture: its folder, a data file or a "
    "configuration file."
)
_RADAR = (
    "Of a capture: its board, a radar of `rfgen radars` or the path of a radar file, TI's .cfg or a JSON; not needed "
    "where a .rfgen or Infineon's config.json lies beside the data. Of a run of several radars: its name."
)

Source = Annotated[Path, typer.Argument(help=_SOURCE, show_default=False)]
RadarName = Annotated[str | None, typer.Option(help=_RADAR, show_default=False)]
Board = Annotated[
    str | None, typer.Option(help="Board of a .cfg or JSON that names none, with --radar.", show_default=False)
]
Partial = Annotated[
    bool, typer.Option("--partial", help="Read the whole frames of a capture that is truncated or contradicts itself.")
]
RecordingNumber = Annotated[
    int | None, typer.Option("--recording", help="Of a data set: the number of the recording.", show_default=False)
]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace existing files.")]


def of_captures_only(**given: bool) -> None:
    """Refuse options that a run has no use for."""
    for name, is_given in given.items():
        if is_given:
            raise ValueError(f"--{name.replace('_', '-')} is for captures; a run has its radar and all of its samples")


def is_run(source: Path) -> bool:
    """Whether a path is that of a run, by its suffix or its first bytes."""
    if source.suffix.lower() in _RUN_SUFFIXES or not source.is_file():
        return source.suffix.lower() in _RUN_SUFFIXES
    with source.open("rb") as stream:
        return stream.read(len(_HDF5)) == _HDF5


def is_recording_set(source: Path) -> bool:
    """Whether a path is the folder of a data set."""
    return (source / _INDEX).is_file()


def open_source_capture(source: Path, radar: str | None, board: str | None, partial: bool) -> Capture:
    """The capture at a path, of the radar and board named."""
    from rfgen_sionna.radar import Radar
    from rfgen_sionna.signal.formats import open_capture

    if is_recording_set(source):
        raise ValueError(
            f"'{source}' is a data set: --recording N takes one of its recordings, `rfgen dataset show` draws a sheet"
        )
    if radar is None:
        if board is not None:
            raise ValueError(f"--board is {board!r} without --radar: name the .cfg or JSON of the board as --radar")
        return open_capture(source, partial=partial)
    return open_capture(source, radar=Radar.load(radar, board=board), partial=partial)


@contextmanager
def opened_source(
    source: Path, radar: str | None, board: str | None, partial: bool, recording: int | None
) -> Iterator[Run | Capture]:
    """Context of the open run, recording or capture; ValueError if a run has no radar of the name `radar`."""
    if recording is None and not is_run(source):
        yield open_source_capture(source, radar, board, partial)
        return
    of_captures_only(board=board is not None, partial=partial)
    with ExitStack() as stack:
        if recording is None:
            from rfgen_sionna.dataset import open_run

            run = stack.enter_context(open_run(source))
        elif is_recording_set(source):
            from rfgen_sionna.dataset import open_dataset

            try:
                run = stack.enter_context(open_dataset(source)).recording(recording)
            except KeyError as error:
                raise ValueError(f"--recording is {recording}: {error.args[0]}") from None
        else:
            raise ValueError(f"--recording is {recording}, and '{source}' is no folder of a data set (no {_INDEX})")
        if radar is not None:
            one_radar(run, radar)
        yield run


def one_radar(run: Run, name: str | None) -> Run:
    """Run of the radar `name`, or of the only one."""
    if name is None and len(run.radars) == 1:
        return next(iter(run.radars.values()))
    if name is None or name not in run.radars:
        given = "is not given" if name is None else f"is {name!r}"
        raise ValueError(f"--radar {given}; '{run.path}' has {', '.join(map(repr, run.radars))}: name one of them")
    return run[name]
