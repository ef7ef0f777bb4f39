"""`rfgen show` and `rfgen export`: runs of this package, and captures of radars' own tools."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape

from rfgen_sionna.cli.console import draw_run, out, progress, report_written
from rfgen_sionna.cli.sources import (
    Board,
    Overwrite,
    Partial,
    RadarName,
    RecordingNumber,
    Source,
    is_run,
    of_captures_only,
    one_radar,
    open_source_capture,
    opened_source,
)

if TYPE_CHECKING:
    from rfgen_sionna.dataset import Run
    from rfgen_sionna.radar import Radar
    from rfgen_sionna.records import AdcCube
    from rfgen_sionna.signal.formats import Capture

SHOW_EPILOG = """[bold]Examples[/bold]

rfgen show jacks.h5 --overwrite

rfgen show jacks.h5 --html jacks.html

rfgen show out/ --recording 12 --html 12.html

rfgen show recording/ --radar awr1843

rfgen show recording/ --radar profile.cfg --board iwr6843isk --no-pictures

Pictures of a run lie beside it, those of a capture in the current folder, with the capture's name. Existing pictures
are kept unless --overwrite is given."""
EXPORT_EPILOG = """[bold]Examples[/bold]

rfgen export jacks.h5 --format dca1000 --output captures/

rfgen export jacks.h5 --format dca1000 --output captures/ --scale=-20dBm

rfgen export recording/ --radar awr1843 --format matlab --output recording.mat

The words of a capture without a scale, as a board leaves it, stay what they are; --scale declares a scale for them."""


def show(
    source: Source,
    radar: RadarName = None,
    board: Board = None,
    pictures: Annotated[bool, typer.Option(help="Write a sheet of pictures (PNG) and an animation (GIF), too.")] = True,
    html: Annotated[
        Path | None,
        typer.Option(
            help="Page to write instead of pictures: the run in a browser, without a network.", show_default=False
        ),
    ] = None,
    recording: RecordingNumber = None,
    partial: Partial = False,
    overwrite: Overwrite = False,
) -> None:
    """Summarise a run, a recording of a data set or a capture, lost packets included, and draw its pictures."""
    from rfgen_sionna.dataset import Run
    from rfgen_sionna.show import summary

    with opened_source(source, radar, board, partial, recording) as whole:
        chosen: dict[str, Run | Capture] = {"": whole}
        if isinstance(whole, Run):
            chosen = {name: whole[name] for name in whole.radars if radar in (None, name)}
        several = isinstance(whole, Run) and len(whole.radars) > 1
        if html is None:
            for number, each in enumerate(chosen.values()):
                out.print("\n" * (number > 0) + escape(summary(each)), soft_wrap=True)
        if html is None and not pictures:
            return
        for name, each in chosen.items():
            target = html or _pictures_of(source, recording)
            target = target.with_stem(f"{target.stem}-{name.replace(' ', '-')}") if several else target
            if html is None:
                draw_run(each, target, overwrite, keep=True)
            else:
                _write_page(each, target, overwrite)


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
    if is_run(source):
        of_captures_only(board=board is not None, partial=partial, skip_lost=skip_lost)
        with open_run(source) as whole, out.status("exporting"):
            run = one_radar(whole, radar)
            samples: Any = run.adc
            cube = AdcCube(samples, run.radar, run.frame_times, run.seeds.get("noise"))
            report = write_capture(cube, output, format, overwrite=overwrite, **options)
    else:
        capture = open_source_capture(source, radar, board, partial)
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


def _pictures_of(source: Path, recording: int | None) -> Path:
    """Name of the pictures, before their suffix: beside a run, in the current folder of what is read only."""
    if recording is not None:
        return Path(f"{source.resolve().name}-{recording:06d}")
    if is_run(source):
        return source
    return Path(f"{source.resolve().name if source.is_dir() else source.name.split('.')[0]}.capture")


def _write_page(run: Run | Capture, page: Path, overwrite: bool) -> None:
    from rfgen_sionna.show import html_page

    with progress("page") as step:
        html_page(run, page, overwrite=overwrite, progress=step)
    report_written(page)


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
