"""Order of the words in the files of a DCA1000, by LVDS lanes (TI SWRA581B; `rawDataReader` of mmWave Studio).

====================================== =============================================================================
two lanes, complex                      a receiver after the other: `I0 I1 Q0 Q1 I2 I3 Q2 Q3 …`
four lanes, complex (xWR12xx, xWR14xx)  a sample after the other: I of all receivers, then their Q
real                                    the same without Q: a receiver after the other, or a sample after the other
====================================== =============================================================================
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.radar import Radar
from rfgen_sionna.signal.formats.capture import CaptureFormatError

_FOUR_LANES = re.compile(r"1[24]\d3|x?wr1[24]xx", re.IGNORECASE)
"""Names of boards of the first generation: xWR1243, xWR1443."""


def lanes_of(radar: Radar) -> int:
    """LVDS lanes of a board, by its name: 4 of the first generation, 2 of others."""
    return 4 if _FOUR_LANES.search(radar.name) else 2


@dataclass(frozen=True)
class LaneLayout:
    """Order of the words of a frame."""

    loops: int
    slots: int
    channels: int
    """Receivers in the file."""
    samples: int
    parts: int
    """2 of complex samples (I, Q), 1 of real ones."""
    lanes: int
    interleaved: bool
    """Whether all receivers of a sample stand side by side."""

    def __post_init__(self) -> None:
        if self.lanes not in (2, 4):
            raise CaptureFormatError(f"lanes is {self.lanes!r}; 2 or 4 LVDS lanes are supported")
        block = self.channels * self.samples if self.interleaved else self.samples
        if self.parts == 2 and block % self.lanes:
            raise CaptureFormatError(
                f"waveform.num_samples is {self.samples}: {self.lanes} lanes carry samples in groups of {self.lanes}, "
                f"{'an even number' if self.lanes == 2 else 'a multiple of 4 with the receivers'} is needed"
            )

    @property
    def frame_size(self) -> int:
        """[bytes]"""
        return self.loops * self.loop_size

    @property
    def loop_size(self) -> int:
        """[bytes]"""
        return 2 * math.prod((self.slots, self.channels, self.samples, self.parts))

    def pack(self, levels: NDArray[Any]) -> NDArray[np.int16]:
        """(loop, slot, receiver, sample, part) as words of a file."""
        ordered = levels.swapaxes(2, 3) if self.interleaved else levels
        if self.parts == 2:
            ordered = ordered.reshape(self.loops, self.slots, -1, self.lanes, 2).swapaxes(-1, -2)
        return np.ascontiguousarray(ordered, dtype="<i2")

    def unpack(self, content: NDArray[np.uint8]) -> NDArray[np.int16]:
        """(loop, slot, receiver, sample, part) from the bytes of a frame."""
        words: NDArray[np.int16] = content.view("<i2")
        if self.parts == 2:
            words = words.reshape(-1, 2, self.lanes).swapaxes(-1, -2)
        rows = (self.samples, self.channels) if self.interleaved else (self.channels, self.samples)
        ordered = words.reshape(self.loops, self.slots, *rows, self.parts)
        return ordered.swapaxes(2, 3) if self.interleaved else ordered
