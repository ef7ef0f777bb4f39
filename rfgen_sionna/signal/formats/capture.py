"""Results, errors and warnings of reading and writing captures."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._short_repr import ShortRepr, name_list, time_span
from rfgen_sionna._types import FloatArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import AdcCube
from rfgen_sionna.signal.formats.losses import Loss, Order, find_loss, summary


class CaptureFormatError(ValueError):
    """A capture is truncated, contradicts itself, or has another format."""


class CaptureWarning(UserWarning):
    """A capture was read in part, or not in physical units."""


def full_scale_dbm(scale: float, full_scale: int, real: bool = False) -> float:
    """Power [dBm] of a tone whose I and Q, or real samples, just reach `full_scale` LSB at `scale` [sqrt(W)/LSB]."""
    return 20.0 * math.log10(scale * full_scale / (math.sqrt(2.0) if real else 1.0)) + 30.0


@dataclass(frozen=True, repr=False)
class CaptureReport(ShortRepr):
    """Result of writing a capture."""

    format: str
    paths: tuple[Path, ...]
    """Every file, the data first."""
    frames: int
    scale: float | None
    """[sqrt(W)/LSB]; [sqrt(W)] per unit in floating-point formats. None: none was declared."""
    full_scale: int | None
    """Largest magnitude of I and Q, or of real samples, in LSB; None in floating-point formats."""
    clipped: int
    """Number of values beyond full scale, written as full scale."""
    values: int
    """Number of values: I and Q, or real samples."""
    real: bool = False
    """Whether samples are real."""

    @property
    def full_scale_dbm(self) -> float | None:
        """Power of a full-scale tone [dBm]; None without a declared scale or a full scale."""
        if self.scale is None or self.full_scale is None:
            return None
        return full_scale_dbm(self.scale, self.full_scale, self.real)


@dataclass(frozen=True, eq=False, repr=False)
class Capture(ShortRepr):
    """An open capture; each frame is read from the disk on access."""

    format: str
    paths: tuple[Path, ...]
    """The data files."""
    radar: Radar
    frame_times: FloatArray
    """(frame,) start of the first ramp of each frame [s]."""
    scale: float | None
    """[sqrt(W)/LSB]; None where the capture declares none, so that samples are in LSB."""
    seed: int | None
    _read: Callable[[int], NDArray[Any]]
    configs: tuple[Path, ...] = ()
    """Configuration files beside the data that were read; those that do not exist are left out."""
    _order: Order | None = None
    """Order of the words in the file; None for floating-point formats, which have no losses."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "configs", tuple(file for file in self.configs if file.is_file()))

    def _facts(self) -> Iterable[str]:
        yield self.format
        yield name_list([path.name for path in self.paths], 2)
        yield f"{len(self)} frames"
        yield time_span(self.frame_times)
        yield f"radar {self.radar.name!r} ({self.radar.preset})"
        yield " × ".join(map(str, self.radar.frame_shape)) + f" (loops, {self.radar.axis_kind}, Rx, samples)"
        yield self.radar.cell_text
        yield "samples in LSB" if self.scale is None else f"{self.scale:.4g} √W per LSB"

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.frame_times)

    def lsb(self, frame: int) -> NDArray[Any]:
        """(chirp, tx, rx, sample) of frame `frame` in LSB, as in the file: complex64, or float32 with a real ADC."""
        if not -len(self) <= frame < len(self):
            raise IndexError(f"frame {frame} of a capture with {len(self)} frames")
        return np.asarray(self._read(frame % len(self)), dtype=self.radar.sample_type)

    def frame(self, frame: int) -> NDArray[Any]:
        """(chirp, tx, rx, sample) of frame `frame` in sqrt(W), or in LSB where `scale` is None. Lost samples are a
        :class:`CaptureWarning`."""
        samples = self._scaled(frame)
        loss = self._loss(frame % len(self), samples)
        if loss is not None and not (self._is_ours and loss.share == 1.0):
            message = f"'{self.paths[0]}': samples are lost (zeros): {loss}; capture.complete_frames are the others"
            warnings.warn(message, CaptureWarning, stacklevel=2)
        return samples

    def _scaled(self, frame: int) -> NDArray[Any]:
        samples = self.lsb(frame)
        if self.scale is not None and self.scale != 1.0:
            samples = samples * np.float32(self.scale)
        return samples

    @property
    def adc(self) -> Any:
        """(frame, chirp, tx, rx, sample) as in :meth:`cube`, but read on access (:class:`CaptureFrames`):
        `AdcCube(capture.adc, …)` is a cube that is not in memory, for `write_capture`."""
        return CaptureFrames(self, tuple(range(len(self))))

    @cached_property
    def lost(self) -> tuple[Loss, ...]:
        """Frames with lost samples, which are zero: each with its chirps and channels. Reads the whole capture once."""
        found = (self._loss(frame, self.lsb(frame)) for frame in range(len(self)))
        return tuple(loss for loss in found if loss is not None)

    def _loss(self, frame: int, samples: NDArray[Any]) -> Loss | None:
        return None if self._order is None else find_loss(frame, samples, self.radar, self._order)

    @property
    def _is_ours(self) -> bool:
        """Whether a sidecar of this package was read: frames of zeros may be a simulation of nothing."""
        return any(file.name.endswith((".rfgen", ".rfgen.json")) for file in self.configs)

    @property
    def complete_frames(self) -> tuple[int, ...]:
        """Numbers of the frames without lost samples."""
        lost = {loss.frame for loss in self.lost}
        return tuple(frame for frame in range(len(self)) if frame not in lost)

    def cube(self, frames: slice = slice(None), *, skip_lost: bool = False) -> AdcCube:
        """The samples of some frames (all by default), in memory; in LSB where `scale` is None.

        Lost samples (:attr:`lost`) are a :class:`CaptureWarning`; with `skip_lost` their frames are left out.

        Raises
        ------
        CaptureFormatError
            With `skip_lost`, if samples of every frame are lost.
        """
        chosen = range(len(self))[frames]
        data = np.zeros((len(chosen), *self.radar.frame_shape), dtype=self.radar.sample_type)
        kept: list[int] = []
        lost: list[Loss] = []
        for frame in chosen:
            data[len(kept)] = samples = self._scaled(frame)
            loss = self._loss(frame, samples)
            if loss is not None:
                lost.append(loss)
            if loss is None or not skip_lost:
                kept.append(frame)
        if self._is_ours and len(lost) == len(chosen) and all(loss.share == 1.0 for loss in lost):
            lost, kept = [], list(chosen)
        if lost and not kept:
            raise CaptureFormatError(f"'{self.paths[0]}': {summary(lost, len(chosen))}; no frame is complete")
        if lost and not skip_lost:
            message = f"'{self.paths[0]}': {summary(lost, len(chosen))}; skip_lost=True leaves these frames out"
            warnings.warn(message, CaptureWarning, stacklevel=2)
        return AdcCube(data=data[: len(kept)], radar=self.radar, frame_times=self.frame_times[kept], seed=self.seed)


@dataclass(frozen=True, eq=False)
class CaptureFrames:
    """Samples of some frames of a capture, read on access, lost ones as zeros without a warning."""

    capture: Capture
    numbers: tuple[int, ...]
    """Numbers of the frames in the capture."""

    @property
    def shape(self) -> tuple[int, ...]:
        """(frame, chirp, tx, rx, sample)"""
        return (len(self.numbers), *self.capture.radar.frame_shape)

    @property
    def dtype(self) -> np.dtype[Any]:
        """complex64, or float32 with a real ADC."""
        return self.capture.radar.sample_type

    @property
    def size(self) -> int:
        """Number of samples."""
        return math.prod(self.shape)

    def __len__(self) -> int:
        return len(self.numbers)

    def select(self, frames: Sequence[int]) -> CaptureFrames:
        """Some of the frames."""
        return CaptureFrames(self.capture, tuple(self.numbers[frame] for frame in frames))

    def __getitem__(self, frames: int | slice) -> NDArray[Any]:
        """Samples of one frame, or of several, stacked."""
        if isinstance(frames, slice):
            return np.stack([self.capture._scaled(number) for number in self.numbers[frames]])
        return self.capture._scaled(self.numbers[frames])
