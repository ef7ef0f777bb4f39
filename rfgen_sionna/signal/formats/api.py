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
from rfgen_sionna.signal.formats.capture import Capture, CaptureFormatError, CaptureReport, CaptureWarning
from rfgen_sionna.signal.formats.files import read_json
from rfgen_sionna.signal.formats.frames import Scale, WriteRequest
from rfgen_sionna.signal.formats.sidecar import SUFFIX

FORMATS = ("dca1000", "cascade", "position2go", "rfgenesis", "matlab")
_SUFFIXES = {".bin": "dca1000", ".raw": "position2go", ".npy": "rfgenesis", ".mat": "matlab"}


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
        `max_file_size` of "cascade" [bytes], `version` of "matlab" ("auto", "5", "7.3").

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
    return report


def open_capture(
    path: str | os.PathLike[str], format: str | None = None, radar: Radar | None = None, *, partial: bool = False
) -> Capture:
    """Open a simulated or measured capture; frames stay on the disk.

    Parameters
    ----------
    path
        Data file, its `.rfgen.json`, or the folder of the files.
    format
        One of `FORMATS`; None derives it from the names of the files.
    radar
        Hardware of a capture without `.rfgen.json`. A `.mmwave.json` or `.xml` beside the data then gives the waveform
        and the elements in use.
    partial
        Whether the whole frames of a truncated or inconsistent capture are read, with a :class:`CaptureWarning`.
        Truncated MATLAB files are always refused. Of a cascade without one device, the others are read
        (:func:`rfgen_sionna.signal.formats.cascade.read`).

    Raises
    ------
    CaptureFormatError
        The capture is truncated, contradicts itself or its radar; the message names bytes or fields.
    FileNotFoundError
        A file is missing.
    """
    target = Path(path)
    if target.name.endswith(SUFFIX):
        format = format or str(read_json(target).get("capture_format"))
        target = _data_of(target, format)
    capture: Capture = _module(format or _guess(target)).read(target, radar, partial=partial)
    return capture


def read_capture(
    path: str | os.PathLike[str],
    format: str | None = None,
    radar: Radar | None = None,
    *,
    scale: float | None = None,
    partial: bool = False,
) -> AdcCube:
    """All samples of a capture [sqrt(W)]. Parameters and errors are those of :func:`open_capture`.

    `scale` [sqrt(W)/LSB] replaces the declared one. Without either, as in the files of a real board, samples are in
    LSB, with a :class:`CaptureWarning`.
    """
    capture = open_capture(path, format, radar, partial=partial)
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
    return capture.cube()


def _module(format: str) -> ModuleType:
    if format not in FORMATS:
        raise ValueError(f"format is {format!r}; allowed: {', '.join(FORMATS)}")
    return import_module(f"rfgen_sionna.signal.formats.{format}")


def _guess(path: Path) -> str:
    from rfgen_sionna.signal.formats.cascade import DATA_NAME

    if path.is_dir():
        if any(DATA_NAME.fullmatch(entry.name) for entry in path.iterdir()):
            return "cascade"
        found = {_SUFFIXES[entry.suffix] for entry in path.iterdir() if entry.suffix in _SUFFIXES}
        if len(found) == 1:
            return found.pop()
        raise CaptureFormatError(
            f"'{path}' holds {'files of ' + ', '.join(sorted(found)) if found else 'no capture'}: "
            f"name the file, or a format of {', '.join(FORMATS)}"
        )
    if DATA_NAME.fullmatch(path.name):
        return "cascade"
    if path.suffix not in _SUFFIXES:
        if not path.exists():
            raise FileNotFoundError(f"capture '{path}' does not exist")
        raise CaptureFormatError(f"'{path}' has a suffix of no format: name one of {', '.join(FORMATS)}")
    return _SUFFIXES[path.suffix]


def _data_of(sidecar: Path, format: str) -> Path:
    if format == "cascade":
        return sidecar.parent
    suffix = next((suffix for suffix, name in _SUFFIXES.items() if name == format), "")
    return sidecar.with_name(sidecar.name.removesuffix(SUFFIX) + suffix)
