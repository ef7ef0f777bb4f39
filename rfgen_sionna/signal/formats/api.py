"""Formats of captures by name: write and read."""

from __future__ import annotations

import os
import warnings
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from rfgen_sionna.radar import Radar
from rfgen_sionna.radar.profile import is_number
from rfgen_sionna.records import AdcCube
from rfgen_sionna.signal.formats.capture import Capture, CaptureReport, CaptureWarning
from rfgen_sionna.signal.formats.frames import Scale, WriteRequest
from rfgen_sionna.signal.formats.recognition import DATA_SUFFIXES, FORMATS, recognise
from rfgen_sionna.signal.formats.sidecar import FORMER_SUFFIX, SUFFIX, is_sidecar


def write_capture(
    cube: AdcCube,
    path: str | os.PathLike[str],
    format: str = "dca1000",
    *,
    scale: Scale = "auto",
    full_scale_dbm: float | None = None,
    overwrite: bool = False,
    **options: Any,
) -> CaptureReport:
    """Write a cube as the files of a radar's own tools, frame by frame.

    Parameters
    ----------
    cube
        Samples; `cube.data` is an array, or a dataset on the disk with one frame per index.
    path
        Data file, or folder for files of standard names.
    format
        One of `FORMATS`.
    scale
        [sqrt(W)/LSB]. "auto" is the scale of a fixed full scale of the radar's ADC, else the smallest power of two that
        clips nothing (1 in floating-point formats). None takes samples in LSB and declares no scale.
    full_scale_dbm
        Power of a complex tone at full scale [dBm], instead of `scale`.
    overwrite
        Whether existing files are replaced.
    options
        `max_file_size` of "cascade" [bytes], `version` of "matlab" ("auto", "5", "7.3"), `lanes` of "dca1000" (2, 4;
        by default those of the board).

    Raises
    ------
    CaptureFormatError
        The format cannot hold such frames.
    ValueError
        Unknown format, invalid scale, or a cube that does not fit its radar or is not finite.
    FileExistsError
        A file exists and `overwrite` is false.
    """
    module = _module(format)
    report: CaptureReport = module.write(WriteRequest(cube, Path(path), scale, full_scale_dbm, overwrite), **options)
    for written in report.paths:
        if written.name.endswith(SUFFIX):  # one of the former name would contradict it
            written.with_name(written.name.removesuffix(SUFFIX) + FORMER_SUFFIX).unlink(missing_ok=True)
    return report


def open_capture(
    path: str | os.PathLike[str],
    format: str | None = None,
    radar: Radar | str | os.PathLike[str] | None = None,
    *,
    board: str | os.PathLike[str] | None = None,
    partial: bool = False,
    **options: Any,
) -> Capture:
    """Open a simulated or measured capture; frames stay on the disk.

    Parameters
    ----------
    path
        A data file, a configuration file of the capture, its sidecar, or the folder of the files.
    format
        One of `FORMATS`; None derives it from the names and the content of the files.
    radar
        Hardware of a capture without a sidecar: a radar, or what :meth:`~rfgen_sionna.radar.Radar.load` takes (the name
        of a board, the path of a radar file or of a board's configuration). A configuration beside the data then gives
        the waveform and the elements in use.
    board
        Name or file of the board of a configuration given as `radar`.
    partial
        Whether the whole frames of a truncated or inconsistent capture are read, with a :class:`CaptureWarning`.
        Truncated MATLAB files are always refused. Of a cascade without one device, the others are read
        (:func:`rfgen_sionna.signal.formats.cascade.read`).
    options
        `lanes` of "dca1000", 2 or 4: LVDS lanes, where neither a JSON nor the board's name gives them; `iq_swap`:
        whether Q precedes I, as in recordings by TI's demonstrations (else `adc.iq_swap` of the radar).

    Raises
    ------
    CaptureFormatError
        The capture is truncated, contradicts itself or its radar, or the folder holds several; the message names bytes,
        fields or files.
    FileNotFoundError
        A file is missing.
    """
    target = Path(path)
    if board is not None and not isinstance(radar, str | os.PathLike):
        raise ValueError(f"board is {str(board)!r}: it goes with the path of a configuration as radar")
    known = radar if radar is None or isinstance(radar, Radar) else Radar.load(radar, board=board)
    if format is None or is_sidecar(target):
        target, format = recognise(target)
    capture: Capture = _module(format).read(target, known, partial=partial, **options)
    _name_unused(capture, radar)
    if not capture.configs and capture.format in ("dca1000", "cascade") and known is not radar:
        _name_preset(capture, radar)
    return capture


def read_capture(
    path: str | os.PathLike[str],
    format: str | None = None,
    radar: Radar | str | os.PathLike[str] | None = None,
    *,
    board: str | os.PathLike[str] | None = None,
    scale: float | None = None,
    partial: bool = False,
    skip_lost: bool = False,
    **options: Any,
) -> AdcCube:
    """All samples of a capture [sqrt(W)]. Parameters and errors are those of :func:`open_capture`.

    `scale` [sqrt(W)/LSB] replaces the declared one. Without either, as in the files of a real board, samples are in
    LSB, with a :class:`CaptureWarning`. Lost samples are zero, with a :class:`CaptureWarning`; `skip_lost` leaves their
    frames out.
    """
    capture = open_capture(path, format, radar, board=board, partial=partial, **options)
    if scale is not None:
        if not is_number(scale) or not 1e-30 <= scale <= 1e30:
            raise ValueError(f"scale is {scale!r}: a number in 1e-30 … 1e30 sqrt(W)/LSB is needed")
        capture = replace(capture, scale=float(scale))
    if capture.scale is None:
        warnings.warn(
            f"'{capture.paths[0]}' declares no scale: samples are in LSB, not in sqrt(W); pass scale= for units",
            CaptureWarning,
            stacklevel=2,
        )
    return capture.cube(skip_lost=skip_lost)


def _module(format: str) -> ModuleType:
    if format not in FORMATS:
        raise ValueError(f"format is {format!r}; allowed: {', '.join(FORMATS)}")
    return import_module(f"rfgen_sionna.signal.formats.{format}")


def _name_preset(capture: Capture, radar: Any) -> None:
    """Warn of frames as in the preset of a board by name: files of samples alone do not hold their length."""
    if radar is None or Path(radar).is_file():
        return
    taken = capture.radar
    warnings.warn(
        f"'{capture.paths[0]}' has no configuration beside it: frames are those of preset '{taken.preset}' of "
        f"'{taken.name}', {taken.waveform.num_loops} loops of {taken.waveform.num_samples} samples; for others pass "
        f"radar=Radar.load({taken.name!r}, preset=…), or a .cfg and board={taken.name!r}",
        CaptureWarning,
        stacklevel=3,
    )


def _name_unused(capture: Capture, radar: Radar | str | os.PathLike[str] | None) -> None:
    """Warn of configuration files beside the data that were not read and belong to no other data there; a `.cfg` may
    be that of a radar object."""
    folder = capture.paths[0].parent
    entries = [entry for entry in sorted(folder.iterdir()) if entry.is_file()]
    others = {entry.stem for entry in entries if entry.suffix.lower() in DATA_SUFFIXES} - {
        file.stem for file in capture.paths
    }
    unused = [
        entry.name
        for entry in entries
        if entry.suffix.lower() in ((".json",) if isinstance(radar, Radar) else (".json", ".cfg"))
        and entry not in capture.configs
        and not (isinstance(radar, str | os.PathLike) and Path(radar).is_file() and entry.samefile(radar))
        and not is_sidecar(entry)
        and entry.name.split(".")[0].removesuffix("_config") not in others
    ]
    if unused:
        used = ", ".join(file.name for file in capture.configs) or "the argument radar"
        warnings.warn(
            f"'{folder}': {', '.join(unused)} {'is' if len(unused) == 1 else 'are'} not used; the radar is that of "
            f"{used}",
            CaptureWarning,
            stacklevel=3,
        )
