"""`rfgen show` and `rfgen export`: runs of this package, and captures of radars' own tools."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape

from rfgen_sionna.cli.console import draw, draw_run, out, picture_name, report_written

if TYPE_CHECKING:
    from rfgen_sionna.dataset import Run
    from rfgen_sionna.radar import Radar
    from rfgen_sionna.records import AdcCube
    from rfgen_sionna.signal.formats import Capture

SHOW_EPILOG = """[bold]Examples[/bold]

rfgen show jacks.h5 --overwrite

rfgen show recording/ --radar awr1843

rfgen show recording/ --radar profile.cfg --board iwr6843isk --no-pictures

Pictures of a run lie beside it, those of a capture in the current folder, with the capture's name. Existing pictures
are kept unless --overwrite is given."""
EXPORT_EPILOG = """[bold]Examples[/bold]

rfgen export jacks.h5 --format dca1000 --output captures/

rfgen export jacks.h5 --format dca1000 --output captures/ --scale=-20dBm

rfgen export recording/ --radar awr1843 --format matlab --output recording.mat

The words of a capture without a scale, as a board leaves it, stay what they are; --scale declares a scale for them."""
_RUN_SUFFIXES, _HDF5 = (".h5", ".hdf5"), b"\x89HDF"
_SOURCE = "A run (HDF5) of `rfgen generate`, or a capture: its folder, a data file or a configuration file."
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
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace existing files.")]


def show(
    source: Source,
    radar: RadarName = None,
    board: Board = None,
    pictures: Annotated[bool, typer.Option(help="Write a sheet of pictures (PNG) and an animation (GIF), too.")] = True,
    partial: Partial = False,
    overwrite: Overwrite = False,
) -> None:
    """Summarise a run or a capture, lost packets included, and draw its pictures."""
    from rfgen_sionna.show import summary

    if _is_run(source):
        _of_captures_only(board=board is not None, partial=partial)
        _show_run(source, radar, pictures, overwrite)
        return
    capture = _open(source, radar, board, partial)
    out.print(escape(summary(capture)), soft_wrap=True)
    if pictures:
        name = source.resolve().name if source.is_dir() else source.name.split(".")[0]
        draw_run(capture, Path(f"{name}.capture"), overwrite, keep=True)


def export(
    source: Source,
    format: Annotated[
        str,
        typer.Option(
            "--format", help="dca1000, cascade, position2go, infineon, rfgenesis or matlab.", show_default=False
        ),
    ],
    output: Annotated[Path, typer.Option(help="File or folder to write, by format.", show_default=False)],
    radar: RadarName = None,
    board: Board = None,
    scale: Annotated[
        str, typer.Option(help='"auto", a number in √W per LSB, or the full scale as a power, such as -20dBm.')
    ] = "auto",
    skip_lost: Annotated[bool, typer.Option("--skip-lost", help="Leave out frames with lost packets.")] = False,
    partial: Partial = False,
    overwrite: Overwrite = False,
) -> None:
    """Write the samples of a run or a capture in a capture format of a radar's own tools."""
    from rfgen_sionna.dataset import open_run
    from rfgen_sionna.records import AdcCube
    from rfgen_sionna.signal.formats import write_capture

    options = _scale(scale)
    # lazily: one frame at a time is read and written
    if _is_run(source):
        _of_captures_only(board=board is not None, partial=partial, skip_lost=skip_lost)
        with open_run(source) as whole, out.status("exporting"):
            run = _one_radar(whole, radar)
            cube = AdcCube(run.adc, run.radar, run.frame_times, run.seeds.get("noise"))
            report = write_capture(cube, output, format, overwrite=overwrite, **options)
    else:
        capture = _open(source, radar, board, partial)
        if capture.scale is None:  # the words stay what they are; a scale is declared for them
            scale_of_words = _scale_of_words(capture.radar, options)
            capture, options = replace(capture, scale=scale_of_words), {"scale": scale_of_words}
        with out.status("exporting"):
            cube = _cube(capture, skip_lost)
            report = write_capture(cube, output, format, overwrite=overwrite, **options)
    for path in report.paths:
        report_written(path)
    units = "in LSB" if report.scale is None else f"{report.scale:g} √W per LSB"
    level = "" if report.full_scale_dbm is None else f", full scale {report.full_scale_dbm:.1f} dBm"
    out.print(f"{report.frames} frames, {units}{level}, {report.clipped} values clipped")


def _show_run(source: Path, radar: str | None, pictures: bool, overwrite: bool) -> None:
    """Show the run of the radar `radar`, or of all radars of a file."""
    from rfgen_sionna.dataset import open_run
    from rfgen_sionna.show import summary

    if radar is None:
        out.print(escape(summary(source)), soft_wrap=True)
        if pictures:
            draw(source, overwrite, keep=True)
        return
    with open_run(source) as whole:
        run = _one_radar(whole, radar)
        out.print(escape(summary(run)), soft_wrap=True)
        if pictures:
            draw_run(run, picture_name(source, whole, radar), overwrite, keep=True)


def _of_captures_only(**given: bool) -> None:
    """Refuse options that a run has no use for."""
    for name, is_given in given.items():
        if is_given:
            raise ValueError(f"--{name.replace('_', '-')} is for captures; a run has its radar and all of its samples")


def _is_run(source: Path) -> bool:
    """Whether a path is that of a run, by its suffix or its first bytes."""
    if source.suffix.lower() in _RUN_SUFFIXES or not source.is_file():
        return source.suffix.lower() in _RUN_SUFFIXES
    with source.open("rb") as stream:
        return stream.read(len(_HDF5)) == _HDF5


def _open(source: Path, radar: str | None, board: str | None, partial: bool) -> Capture:
    from rfgen_sionna.radar import Radar
    from rfgen_sionna.signal.formats import open_capture

    if radar is None:
        if board is not None:
            raise ValueError(f"--board is {board!r} without --radar: name the .cfg or JSON of the board as --radar")
        return open_capture(source, partial=partial)
    return open_capture(source, radar=Radar.load(radar, board=board), partial=partial)


def _cube(capture: Capture, skip_lost: bool) -> AdcCube:
    """Cube of the frames of a capture, read on access."""
    from rfgen_sionna.records import AdcCube
    from rfgen_sionna.signal.formats import CaptureFormatError

    if capture.lost and not skip_lost:
        warnings.warn(
            f"samples of {len(capture.lost)} frames are lost (zeros); --skip-lost leaves them out", stacklevel=2
        )
    kept = capture.complete_frames if skip_lost else tuple(range(len(capture)))
    if not kept:
        raise CaptureFormatError(f"'{capture.paths[0]}': samples of every frame are lost; leave --skip-lost out")
    times = capture.frame_times[list(kept)]
    return AdcCube(capture.adc.select(kept), capture.radar, times, capture.seed)


def _scale_of_words(radar: Radar, options: dict[str, Any]) -> float | None:
    """Scale [sqrt(W)/LSB] of the words of a board, as the option --scale gives it."""
    if "full_scale_dbm" in options:
        amplitude = 10.0 ** ((options["full_scale_dbm"] - 30.0) / 20.0) * (math.sqrt(2.0) if radar.adc.real else 1.0)
        return float(amplitude / 2 ** (radar.adc.bits - 1))
    return options.get("scale")


def _one_radar(run: Run, name: str | None) -> Run:
    """Run of the radar `name`, or of the only one."""
    if name is None and len(run.radars) == 1:
        return next(iter(run.radars.values()))
    if name is None or name not in run.radars:
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
