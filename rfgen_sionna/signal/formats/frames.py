"""Frames to integers and back: checks, scale, quantisation, order of slots and receivers."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.radar import Radar
from rfgen_sionna.radar.profile import is_number
from rfgen_sionna.records import AdcCube
from rfgen_sionna.signal.formats.capture import CaptureFormatError, CaptureReport
from rfgen_sionna.signal.formats.files import write_json
from rfgen_sionna.signal.formats.sidecar import describe

Scale = float | Literal["auto"] | None


@dataclass(frozen=True)
class WriteRequest:
    """Arguments of :func:`~rfgen_sionna.signal.formats.write_capture` that all formats share."""

    cube: AdcCube
    path: Path
    scale: Scale
    full_scale_dbm: float | None
    overwrite: bool

    def __post_init__(self) -> None:
        _check_cube(self.cube)

    def resolve_scale(self, full_scale: int | None) -> tuple[float, float | None]:
        """Divisor of the samples [sqrt(W)/LSB], and the scale to declare.

        "auto" fills the converter at the radar's own full scale, `radar.adc.full_scale_dbm`. Where that is automatic
        too, it is the smallest power of two that clips nothing: LSB times such a scale is exact in float32, so that
        units come back exactly, and a second write gives the same bytes. Floating-point formats (`full_scale` None)
        need no scale: there "auto" is 1.
        """
        scale = self.scale
        if (level := self.full_scale_dbm) is not None:
            if scale != "auto":
                raise ValueError(f"scale is {scale!r} and full_scale_dbm is {level!r}: give one of them")
            if full_scale is None:
                raise ValueError(f"full_scale_dbm is {level!r}: this format holds floating-point numbers, leave it out")
            if not is_number(level) or not -200.0 <= level <= 200.0:
                raise ValueError(f"full_scale_dbm is {level!r}: a value in -200 … 200 dBm is needed")
            declared = _tone_amplitude(level) / full_scale
            return declared, declared
        if scale is None:
            return 1.0, None
        if isinstance(scale, str):
            if scale != "auto":
                raise ValueError(f'scale is {scale!r}: "auto", a number [sqrt(W)/LSB] or None is needed')
            if full_scale is None:
                return 1.0, 1.0
            level = self.cube.radar.adc.full_scale_dbm
            found = _power_of_two(self.cube, full_scale) if level is None else _tone_amplitude(level) / full_scale
            return found, found
        if not is_number(scale) or not 1e-30 <= scale <= 1e30:
            raise ValueError(f"scale is {scale!r}: a number in 1e-30 … 1e30 sqrt(W)/LSB is needed")
        return float(scale), float(scale)


class Quantizer:
    """Frames of a cube as integers in the order of a board, with the count of clipped values."""

    def __init__(self, request: WriteRequest, format: str, full_scale: int) -> None:
        self.cube, self.format, self.full_scale, self.clipped = request.cube, format, full_scale, 0
        self.divisor, self.scale = request.resolve_scale(full_scale)

    def frames(self, receivers: Sequence[int]) -> Iterator[NDArray[np.int16]]:
        """(chirp, slot, receiver, sample, 2) of each frame in LSB, I before Q, as fired and numbered."""
        for frame in frames_of(self.cube):
            levels, clipped = _quantize(frame, self.divisor, self.full_scale)
            self.clipped += clipped
            yield _firing_order(levels, self.cube.radar, receivers)

    def write_sidecar(self, path: Path) -> None:
        """Write the `.rfgen.json` of the capture."""
        write_json(path, describe(self.cube, self.format, self.scale, self.full_scale))

    def report(self, paths: tuple[Path, ...]) -> CaptureReport:
        """Result of the write of `paths`."""
        shape = self.cube.data.shape
        values = 2 * math.prod(shape)
        return CaptureReport(self.format, paths, shape[0], self.scale, self.full_scale, self.clipped, values)


def _check_cube(cube: AdcCube) -> None:
    """Refuse a cube that does not fit its radar."""
    shape, wanted = tuple(cube.data.shape), cube.radar.frame_shape
    if len(shape) != 5 or shape[1:] != wanted:
        raise ValueError(
            f"cube.data has shape {shape}; (frame, chirp, tx, rx, sample) with {wanted} after the frames is needed "
            f"for radar '{cube.radar.name}', preset '{cube.radar.preset}'"
        )
    if shape[0] == 0:
        raise ValueError("cube.data holds no frame: at least one is needed")
    if np.shape(cube.frame_times) != shape[:1] or not np.all(np.isfinite(cube.frame_times)):
        raise ValueError(
            f"cube.frame_times has shape {np.shape(cube.frame_times)}: {shape[0]} finite times [s] are needed"
        )


def frames_of(cube: AdcCube) -> Iterator[NDArray[np.complex64]]:
    """Each frame (chirp, tx, rx, sample) in turn; `cube.data` may be a dataset on the disk.

    Raises
    ------
    ValueError
        At the first frame with a sample that is not finite.
    """
    for number in range(cube.data.shape[0]):
        frame: NDArray[np.complex64] = np.ascontiguousarray(cube.data[number], dtype=np.complex64)
        if not np.all(np.isfinite(frame)):
            raise ValueError(f"cube.data: frame {number} holds samples that are not finite")
        yield frame


def _tone_amplitude(level: float) -> float:
    """Amplitude [sqrt(W)] of a complex tone of `level` [dBm]."""
    return float(10.0 ** ((level - 30.0) / 20.0))


def _power_of_two(cube: AdcCube, full_scale: int) -> float:
    """Smallest power of two [sqrt(W)/LSB] that clips no I or Q of the cube."""
    largest = max(float(np.abs(frame.view(np.float32)).max()) for frame in frames_of(cube))
    if largest == 0.0:
        return 1.0
    # full_scale is 2^n; its positive end is one LSB short of it.
    exponent = math.ceil(math.log2(largest / full_scale)) - 1
    while np.rint(largest / 2.0**exponent) > full_scale - 1:
        exponent += 1
    return max(2.0**exponent, 2.0**-90)


def _quantize(frame: NDArray[np.complex64], scale: float, full_scale: int) -> tuple[NDArray[np.int16], int]:
    """(…, sample, 2) in LSB, I before Q, and the number of values beyond -full_scale … full_scale - 1."""
    levels: NDArray[np.float32] = np.divide(frame.view(np.float32), np.float32(scale))
    np.rint(levels, out=levels)
    clipped = int(np.count_nonzero((levels < -full_scale) | (levels > full_scale - 1)))
    if clipped:
        np.clip(levels, -full_scale, full_scale - 1, out=levels)
    return levels.astype(np.int16).reshape(*frame.shape, 2), clipped


def complex_lsb(levels: NDArray[Any]) -> NDArray[np.complex64]:
    """(…, sample, 2) to complex (…, sample)."""
    contiguous: NDArray[np.float32] = np.ascontiguousarray(levels, dtype=np.float32)
    return contiguous.view(np.complex64)[..., 0]


def channel_numbers(names: Sequence[str], prefix: str, most: int, label: str) -> list[int]:
    """Numbers of the hardware's channels, from 1: from names such as "RX3", else from the order of the names.

    Raises
    ------
    CaptureFormatError
        If there are more channels than `most`; `label` names the hardware.
    """
    found = [re.fullmatch(rf"{prefix}[_ ]?(\d+)", name, re.IGNORECASE) for name in names]
    numbers = [int(match[1]) for match in found if match]
    if len(numbers) < len(names) or len(set(numbers)) < len(names) or min(numbers) < 1:
        numbers = list(range(1, len(names) + 1))
    if max(numbers) > most:
        raise CaptureFormatError(f"{label} has {prefix}1 … {prefix}{most}; the radar has {', '.join(names)}")
    return numbers


def _firing_order(frame: NDArray[Any], radar: Radar, receivers: Sequence[int]) -> NDArray[Any]:
    """(chirp, tx, rx, …) to (chirp, slot, receiver, …); no copy where that is the order."""
    slots = list(radar.waveform.slot_axis)
    if slots != sorted(slots):
        frame = frame[:, slots]
    order = np.argsort(receivers)
    return frame if np.all(np.diff(order) == 1) else frame[:, :, order]


def element_order(frame: NDArray[Any], radar: Radar, receivers: Sequence[int]) -> NDArray[Any]:
    """(chirp, slot, receiver, …), as fired and numbered, to (chirp, tx, rx, …)."""
    tx = np.argsort(radar.waveform.slot_axis)
    rx = np.argsort(np.argsort(receivers))
    if np.all(np.diff(tx) == 1) and np.all(np.diff(rx) == 1):
        return frame
    return frame[:, tx][:, :, rx]
