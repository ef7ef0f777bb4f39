"""Frames to integers and back: checks, scale, quantisation, order of slots and receivers."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.radar import Radar
from rfgen_sionna.radar.board_frames import element_numbers
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
            declared = self._tone_amplitude(level) / full_scale
            return declared, declared
        if scale is None:
            return 1.0, None
        if isinstance(scale, str):
            if scale != "auto":
                raise ValueError(f'scale is {scale!r}: "auto", a number [sqrt(W)/LSB] or None is needed')
            if full_scale is None:
                return 1.0, 1.0
            level = self.cube.radar.adc.full_scale_dbm
            found = _power_of_two(self.cube, full_scale) if level is None else self._tone_amplitude(level) / full_scale
            return found, found
        if not is_number(scale) or not 1e-30 <= scale <= 1e30:
            raise ValueError(f"scale is {scale!r}: a number in 1e-30 … 1e30 sqrt(W)/LSB is needed")
        return float(scale), float(scale)

    def _tone_amplitude(self, level: float) -> float:
        """Largest I, Q or real sample [sqrt(W)] of a tone of `level` [dBm]."""
        return float(10.0 ** ((level - 30.0) / 20.0)) * (math.sqrt(2.0) if self.cube.radar.adc.real else 1.0)


class Quantizer:
    """Frames of a cube as integers in the order of a board, with the count of clipped values."""

    def __init__(self, request: WriteRequest, format: str, full_scale: int) -> None:
        self.cube, self.format, self.full_scale, self.clipped = request.cube, format, full_scale, 0
        self.divisor, self.scale = request.resolve_scale(full_scale)

    def frames(self, receivers: Sequence[int]) -> Iterator[NDArray[np.int16]]:
        """(chirp, slot, receiver, sample, part) of each frame in LSB, as fired and numbered; the parts are I and Q, or
        one of real samples."""
        for frame in frames_of(self.cube):
            levels, clipped = _quantize(frame, self.divisor, self.full_scale)
            self.clipped += clipped
            yield _firing_order(levels, self.cube.radar, receivers)

    def write_sidecar(self, path: Path, **layout: Any) -> None:
        """Write the sidecar of the capture; `layout` is added to it."""
        write_json(path, describe(self.cube, self.format, self.scale, self.full_scale) | layout)

    def report(self, paths: tuple[Path, ...]) -> CaptureReport:
        """Result of the write of `paths`."""
        shape = self.cube.data.shape
        real = self.cube.radar.adc.real
        values = math.prod(shape) * (1 if real else 2)
        return CaptureReport(self.format, paths, shape[0], self.scale, self.full_scale, self.clipped, values, real)


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


def with_receivers(radar: Radar, kept: Sequence[int]) -> Radar:
    """The radar with some of its receivers, by their indices."""
    return replace(
        radar,
        rx_names=tuple(radar.rx_names[index] for index in kept),
        rx_positions=radar.rx_positions[list(kept)],
        rx_phases_deg=tuple(radar.rx_phases_deg[index] for index in kept) if radar.rx_phases_deg else (),
    )


def complex_only(radar: Radar, format: str) -> None:
    """Refuse real samples for a format that has only complex ones."""
    if radar.adc.real:
        raise CaptureFormatError(
            f"radar '{radar.name}' has a real ADC (adc.real); '{format}' has complex samples only: take 'dca1000' for "
            "boards of TI, 'infineon' for those of Infineon, or 'matlab' for any"
        )


def frames_of(cube: AdcCube) -> Iterator[NDArray[Any]]:
    """Each frame (chirp, tx, rx, sample) in turn, complex64, or float32 of a real ADC; `cube.data` may be a dataset on
    the disk.

    Raises
    ------
    ValueError
        At the first frame with a sample that is not finite, or with complex ones of a real ADC.
    """
    for number in range(cube.data.shape[0]):
        stored = np.asarray(cube.data[number])
        if cube.radar.adc.real and np.iscomplexobj(stored):
            raise ValueError(
                f"cube.data is {stored.dtype}; radar '{cube.radar.name}' has a real ADC (adc.real): float32 is needed"
            )
        frame: NDArray[Any] = np.ascontiguousarray(stored, dtype=cube.radar.sample_type)
        if not np.all(np.isfinite(frame)):
            raise ValueError(f"cube.data: frame {number} holds samples that are not finite")
        yield frame


def _power_of_two(cube: AdcCube, full_scale: int) -> float:
    """Smallest power of two [sqrt(W)/LSB] that clips nothing of the cube."""
    largest = max(float(np.abs(frame.view(np.float32)).max()) for frame in frames_of(cube))
    if largest == 0.0:
        return 1.0
    # full_scale is 2^n; its positive end is one LSB short of it.
    exponent = math.ceil(math.log2(largest / full_scale)) - 1
    while np.rint(largest / 2.0**exponent) > full_scale - 1:
        exponent += 1
    return max(2.0**exponent, 2.0**-90)


def _quantize(frame: NDArray[Any], scale: float, full_scale: int) -> tuple[NDArray[np.int16], int]:
    """(…, sample, part) in LSB, I before Q, and the number of values beyond -full_scale … full_scale - 1."""
    levels: NDArray[np.float32] = np.divide(frame.view(np.float32), np.float32(scale))
    np.rint(levels, out=levels)
    clipped = int(np.count_nonzero((levels < -full_scale) | (levels > full_scale - 1)))
    if clipped:
        np.clip(levels, -full_scale, full_scale - 1, out=levels)
    return levels.astype(np.int16).reshape(*frame.shape, -1), clipped


def to_samples(levels: NDArray[Any]) -> NDArray[Any]:
    """(…, sample, part) to (…, sample): complex64 of I and Q, float32 of one part."""
    contiguous: NDArray[np.float32] = np.ascontiguousarray(levels, dtype=np.float32)
    return contiguous[..., 0] if contiguous.shape[-1] == 1 else contiguous.view(np.complex64)[..., 0]


def channel_numbers(names: Sequence[str], prefix: str, most: int, label: str) -> list[int]:
    """Numbers of the hardware's channels, from 1: from names such as "RX3", else from the order of the names.

    Raises
    ------
    CaptureFormatError
        If there are more channels than `most`; `label` names the hardware.
    """
    numbers = element_numbers(names, prefix)
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
