"""The sidecar of a capture, `<name>.rfgen`: JSON with scale, times, seed and radar.

Its name does not end in `.json`: other programs take every `*.json` of a folder for mmWave Studio's.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import AdcCube
from rfgen_sionna.signal.formats.capture import CaptureFormatError, full_scale_dbm
from rfgen_sionna.signal.formats.files import read_json

SUFFIX = ".rfgen"
FORMER_SUFFIX = ".rfgen.json"
"""Of older files of this package."""
_FORMAT, _VERSION = "rfgen-capture", 1


def periodic_times(frames: int, radar: Radar) -> FloatArray:
    """(frames,) multiples of the frame period, from 0 [s]."""
    return np.asarray(np.arange(frames) * radar.waveform.frame_period, dtype=np.float64)


def sidecar_of(path: Path) -> Path:
    """Sidecar of a data file, of the former name where only that one exists."""
    sidecar, former = (path.with_name(path.stem + suffix) for suffix in (SUFFIX, FORMER_SUFFIX))
    return former if former.is_file() and not sidecar.is_file() else sidecar


def is_sidecar(path: Path) -> bool:
    """Whether the name is that of a sidecar."""
    return path.name.endswith((SUFFIX, FORMER_SUFFIX))


@dataclass(frozen=True)
class Description:
    """Radar, scale and times of a capture."""

    radar: Radar
    scale: float | None = None
    frame_times: FloatArray | None = None
    """(frame,) start of each frame [s]; None where neither times nor number of frames are declared."""
    seed: int | None = None
    iq_swap: bool = False
    """Whether Q precedes I."""
    lanes: int | None = None
    """LVDS lanes of a DCA1000, 2 or 4; None leaves them to the device."""
    interleaved: bool | None = None
    """Whether all receivers of a sample stand side by side (mmWave Studio's chInterleave 0); None leaves that to the
    lanes: so with four, not with two."""

    @property
    def frames(self) -> int | None:
        return None if self.frame_times is None else len(self.frame_times)

    def times(self, frames: int) -> FloatArray:
        """(frames,) start of each frame [s]: as declared, else multiples of the frame period."""
        return periodic_times(frames, self.radar) if self.frame_times is None else self.frame_times[:frames]


def find_description(
    data: Path,
    sidecar: Path,
    radar: Radar | None,
    read_config: Callable[[Radar], Description],
    check_config: Callable[[Description], None] | None = None,
    hint: str = "",
) -> Description:
    """Description of the capture in `data`, from its sidecar, else from `radar` and the tool's own configuration.

    `check_config` compares the tool's configuration with an existing sidecar; `hint` is added to an error.

    Raises
    ------
    CaptureFormatError
        Neither a sidecar nor a `radar` is given; or `radar` has frames of another shape.
    """
    if sidecar.is_file():
        known = from_record(read_json(sidecar), f"'{sidecar}'")
        if check_config is not None:
            check_config(known)
        return with_radar(known, radar, data)
    if radar is None:
        raise CaptureFormatError(
            f"'{data}' has no '{sidecar.name}' beside it with its radar: pass radar={hint} (--radar)"
        )
    known = read_config(radar)
    return replace(known, iq_swap=known.radar.adc.iq_swap)


def describe(cube: AdcCube, capture_format: str, scale: float | None, full_scale: int | None) -> dict[str, Any]:
    """Record of the sidecar of a capture of `cube`."""
    return {
        "format": _FORMAT,
        "version": _VERSION,
        "capture_format": capture_format,
        "scale": scale,
        "scale_units": "sqrt(W)/LSB",
        "full_scale_dbm": None
        if scale is None or full_scale is None
        else full_scale_dbm(scale, full_scale, cube.radar.adc.real),
        "frames": len(cube.frame_times),
        "frame_times_s": [float(time) for time in cube.frame_times],
        "seed": None if cube.seed is None else int(cube.seed),
        "radar": cube.radar.to_dict(),
    }


def from_record(record: dict[str, Any], label: str) -> Description:
    """Inverse of :func:`describe`; `label` names the record in errors.

    Raises
    ------
    CaptureFormatError
        Naming the missing or invalid field.
    """
    if record.get("format") != _FORMAT or record.get("version") != _VERSION:
        raise CaptureFormatError(
            f"{label} is of format {record.get('format')!r} version {record.get('version')!r}; "
            f"'{_FORMAT}' version {_VERSION} is needed"
        )
    missing = {"scale", "frame_times_s", "seed", "radar"} - set(record)
    if missing:
        raise CaptureFormatError(f"{label} lacks '{min(missing)}'")
    try:
        radar = Radar.from_dict(record["radar"])
        times = np.asarray(record["frame_times_s"], dtype=np.float64)
        scale = None if record["scale"] is None else float(record["scale"])
        seed = None if record["seed"] is None else int(record["seed"])
        lanes = None if record.get("lanes") is None else int(record["lanes"])
    except (TypeError, ValueError) as error:
        raise CaptureFormatError(f"{label}: {error}") from error
    if times.ndim != 1 or len(times) == 0 or not np.all(np.isfinite(times)):
        raise CaptureFormatError(f"{label}: 'frame_times_s' is not a list of finite times")
    if np.any(np.diff(times) <= 0):
        later = 1 + int(np.argmax(np.diff(times) <= 0))
        raise CaptureFormatError(f"{label}: 'frame_times_s'[{later}] is {times[later]:g}, not after the time before it")
    if scale is not None and not (np.isfinite(scale) and scale > 0):
        raise CaptureFormatError(f"{label}: 'scale' is {scale!r}; a positive number of sqrt(W)/LSB is needed")
    return Description(radar, scale, times, seed, lanes=lanes)


def with_radar(known: Description, radar: Radar | None, path: Path) -> Description:
    """Description with the caller's radar in place of the declared one; another frame shape is an error."""
    if radar is None:
        return known
    ours, theirs = radar.frame_shape, known.radar.frame_shape
    if ours != theirs or radar.waveform.slot_axis != known.radar.waveform.slot_axis:
        raise CaptureFormatError(
            f"radar '{radar.name}' gives frames (chirp, tx, rx, sample) of {ours}, firing {radar.waveform.slot_axis}; "
            f"'{path}' was taken with {theirs}, firing {known.radar.waveform.slot_axis}: leave `radar` out"
        )
    return replace(known, radar=radar)
