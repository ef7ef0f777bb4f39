"""Formats by name: one way to write, one to read."""

from __future__ import annotations

import os
import warnings
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from rfgen_sionna.radar import Radar
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
    """Write a cube as the files of a radar's own tools; frames are written one by one.

    Parameters
    ----------
    cube
        The samples. `cube.data` may be anything that gives a frame for an index, such as a dataset on the disk.
    path
        Data file, or folder that shall hold the files under their usual names.
    format
        One of `FORMATS`.
    scale
        [sqrt(W)/LSB]. "auto" is that of the radar's ADC where its full scale is fixed, else the smallest power of two
        that clips nothing (1 in formats of floating-point numbers). None: the samples are in LSB already, and no scale
        is declared.
    full_scale_dbm
        Instead of `scale`: power of a complex tone that just fills the converter [dBm].
    overwrite
        Replace existing files.
    options
        What a format has beyond: `max_file_size` of "cascade", `version` of "matlab".

    Raises
    ------
    CaptureFormatError
        The format cannot hold such frames.
    ValueError
        An unknown format, a scale that is none, a cube that does not fit its radar or is not finite.
    FileExistsError
        A file is there and `overwrite` is false.
    """
    module = _module(format)
    report: CaptureReport = module.write(WriteRequest(cube, Path(path), scale, full_scale_dbm, overwrite), **options)
    return report


def open_capture(
    path: str | os.PathLike[str], format: str | None = None, radar: Radar | None = None, *, partial: bool = False
) -> Capture:
    """Open a capture, ours or a real board's; frames stay on the disk.

    Parameters
    ----------
    path
        Data file, its `.rfgen.json`, or the folder that holds the files.
    format
        One of `FORMATS`; by default what the names of the files say.
    radar
        The hardware that took it, where no `.rfgen.json` says so. A `.mmwave.json` or `.xml` beside the data then
        gives the waveform and the elements in use.
    partial
        Read the whole frames of a capture that is truncated or contradicts itself, with a :class:`CaptureWarning`,
        instead of refusing it. Truncated MATLAB files are always refused. Of a cascade that lacks a device, read those
        of the others (:func:`rfgen_sionna.signal.formats.cascade.read`).

    Raises
    ------
    CaptureFormatError
        The capture is truncated (the message says which bytes are missing), contradicts itself or its radar.
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
    """The whole of a capture in memory, in sqrt(W). Parameters and errors are those of :func:`open_capture`.

    `scale` [sqrt(W)/LSB] replaces the declared one. A real board's file declares none: without one here, the samples
    are in LSB, and a :class:`CaptureWarning` says so.
    """
    from dataclasses import replace

    capture = open_capture(path, format, radar, partial=partial)
    if scale is not None:
        if isinstance(scale, bool) or not isinstance(scale, (int, float)) or not 1e-30 <= scale <= 1e30:
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
        raise CaptureFormatError(f"'{path}': name a format of {', '.join(FORMATS)}; the suffix says none")
    return _SUFFIXES[path.suffix]


def _data_of(sidecar: Path, format: str) -> Path:
    if format == "cascade":
        return sidecar.parent
    suffix = next((suffix for suffix, name in _SUFFIXES.items() if name == format), "")
    return sidecar.with_name(sidecar.name.removesuffix(SUFFIX) + suffix)
