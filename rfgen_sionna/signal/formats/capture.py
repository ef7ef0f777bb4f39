"""Results, errors and warnings of reading and writing captures."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import AdcCube


class CaptureFormatError(ValueError):
    """A capture is truncated, contradicts itself, or has another format."""


class CaptureWarning(UserWarning):
    """A capture was read in part, or not in physical units."""


def full_scale_dbm(scale: float, full_scale: int) -> float:
    """Power [dBm] of a complex tone whose I and Q just reach `full_scale` LSB at `scale` [sqrt(W)/LSB]."""
    return 20.0 * math.log10(scale * full_scale) + 30.0


@dataclass(frozen=True)
class CaptureReport:
    """Result of writing a capture."""

    format: str
    paths: tuple[Path, ...]
    """Every file, the data first."""
    frames: int
    scale: float | None
    """[sqrt(W)/LSB]; [sqrt(W)] per unit in floating-point formats. None: none was declared."""
    full_scale: int | None
    """Largest magnitude of I and Q in LSB; None in floating-point formats."""
    clipped: int
    """Number of I and Q values beyond full scale, written as full scale."""
    values: int
    """Number of I and Q values."""

    @property
    def full_scale_dbm(self) -> float | None:
        """Power of a full-scale tone [dBm]; None without a declared scale or a full scale."""
        if self.scale is None or self.full_scale is None:
            return None
        return full_scale_dbm(self.scale, self.full_scale)


@dataclass(frozen=True, eq=False)
class Capture:
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

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.frame_times)

    def lsb(self, frame: int) -> NDArray[np.complex64]:
        """(chirp, tx, rx, sample) of frame `frame` in LSB, as in the file."""
        if not -len(self) <= frame < len(self):
            raise IndexError(f"frame {frame} of a capture with {len(self)} frames")
        return np.asarray(self._read(frame % len(self)), dtype=np.complex64)

    def frame(self, frame: int) -> NDArray[np.complex64]:
        """(chirp, tx, rx, sample) of frame `frame` in sqrt(W), or in LSB where `scale` is None."""
        samples = self.lsb(frame)
        if self.scale is not None and self.scale != 1.0:
            samples = samples * np.float32(self.scale)
        return samples

    def cube(self, frames: slice = slice(None)) -> AdcCube:
        """The samples of some frames (all by default), in memory; in LSB where `scale` is None."""
        chosen = range(len(self))[frames]
        data = np.empty((len(chosen), *self.radar.frame_shape), dtype=np.complex64)
        for row, frame in enumerate(chosen):
            data[row] = self.frame(frame)
        return AdcCube(data=data, radar=self.radar, frame_times=self.frame_times[frames], seed=self.seed)
