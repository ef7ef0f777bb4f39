"""Runs as pictures need them, and a capture in that form."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.dataset import ActorRecord, LabelRecord, open_run
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import Pir
from rfgen_sionna.signal.formats import Capture

FULL_SCALE_UNIT, POWER_UNIT = "dBFS", "dBm"


class Displayable(Protocol):
    """Samples with a radar; a :class:`~rfgen_sionna.dataset.Run` is one."""

    @property
    def path(self) -> Path: ...

    @property
    def radar(self) -> Radar: ...

    @property
    def adc(self) -> Any: ...

    @property
    def frame_times(self) -> FloatArray: ...

    @property
    def mesh_times(self) -> FloatArray: ...

    @property
    def prompt(self) -> str: ...

    @property
    def environment(self) -> str: ...

    @property
    def has_pir(self) -> bool: ...

    @property
    def actors(self) -> Mapping[str, ActorRecord]: ...

    @property
    def labels(self) -> Mapping[str, LabelRecord]: ...

    def pir(self, frame: int) -> Pir: ...

    def __len__(self) -> int: ...


@dataclass(frozen=True, eq=False)
class CapturedRun:
    """A capture as a run without actors, labels and images."""

    capture: Capture

    @property
    def path(self) -> Path:
        return self.capture.paths[0]

    @property
    def radar(self) -> Radar:
        return self.capture.radar

    @property
    def adc(self) -> CapturedRun:
        return self

    @property
    def frame_times(self) -> FloatArray:
        return self.capture.frame_times

    @property
    def mesh_times(self) -> FloatArray:
        return self.capture.frame_times

    @property
    def prompt(self) -> str:
        return f"{self.path.parent.name}/{self.path.name}"

    @property
    def environment(self) -> str:
        return ""

    @property
    def has_pir(self) -> bool:
        return False

    @property
    def actors(self) -> Mapping[str, ActorRecord]:
        return {}

    @property
    def labels(self) -> Mapping[str, LabelRecord]:
        return {}

    def pir(self, frame: int) -> Pir:
        raise ValueError(f"'{self.path}', frame {frame}: a capture has no PIR")

    def __len__(self) -> int:
        return len(self.capture)

    def __getitem__(self, frames: int | slice) -> NDArray[Any]:
        """(frame, chirp, tx, rx, sample), or those of one frame: in sqrt(W), or, where the capture declares no scale,
        so that a tone at full scale has 1 mW."""
        if isinstance(frames, slice):
            return np.stack([self[int(frame)] for frame in range(len(self))[frames]])
        samples = self.capture.adc[int(frames)]
        if self.capture.scale is not None:
            return samples
        peak = np.sqrt(2.0) if self.radar.adc.real else 1.0
        return samples * np.float32(np.sqrt(1e-3) * peak / 2 ** (self.radar.adc.bits - 1))


def power_unit(run: Displayable) -> str:
    """Unit of levels: dBm, or dB below a tone at the ADC's full scale where a capture declares no scale."""
    return FULL_SCALE_UNIT if isinstance(run, CapturedRun) and run.capture.scale is None else POWER_UNIT


@contextmanager
def displayed(run: Displayable | Capture | str | os.PathLike[str]) -> Iterator[Displayable]:
    """Context of an open run or capture, or of the run at a path, which is closed at the end."""
    if isinstance(run, Capture):
        yield CapturedRun(run)
    elif isinstance(run, str | os.PathLike):
        with open_run(run) as own:
            yield own
    else:
        yield run
