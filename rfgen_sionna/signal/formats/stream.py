"""Bytes of a recording that lies in several files, with gaps of zeros for bytes that were lost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class ByteStream:
    """Segments of files, one after the other; bytes of no segment are zero."""

    files: tuple[Path, ...]
    sources: NDArray[np.int64]
    """(segment,) index of the file."""
    offsets: NDArray[np.int64]
    """(segment,) first byte in the file."""
    starts: NDArray[np.int64]
    """(segment,) first byte in the stream, ascending."""
    lengths: NDArray[np.int64]
    """(segment,) [bytes]"""

    @classmethod
    def of(cls, files: Sequence[Path]) -> ByteStream:
        """The files in full, in this order."""
        lengths = np.array([file.stat().st_size for file in files], dtype=np.int64)
        starts = np.cumsum(lengths) - lengths
        return cls(tuple(files), np.arange(len(files), dtype=np.int64), np.zeros_like(lengths), starts, lengths)

    @property
    def size(self) -> int:
        """[bytes]"""
        return int(self.starts[-1] + self.lengths[-1]) if len(self.starts) else 0

    @property
    def gaps(self) -> list[tuple[int, int]]:
        """First byte and number of bytes of every gap."""
        ends = np.concatenate([[0], (self.starts + self.lengths)[:-1]])
        found = np.flatnonzero(self.starts > ends)
        return [(int(ends[segment]), int(self.starts[segment] - ends[segment])) for segment in found]

    def read(self, start: int, count: int) -> NDArray[np.uint8]:
        """(count,) bytes from `start` on; zeros in gaps and after the end."""
        out = np.zeros(count, dtype=np.uint8)
        first = int(np.searchsorted(self.starts + self.lengths, start, side="right"))
        last = int(np.searchsorted(self.starts, start + count, side="left"))
        opened: dict[int, NDArray[np.uint8]] = {}
        for segment in range(first, last):
            source = int(self.sources[segment])
            if source not in opened:
                opened[source] = np.memmap(self.files[source], dtype=np.uint8, mode="r")
            begin, length = int(self.starts[segment]), int(self.lengths[segment])
            low, high = max(begin, start), min(begin + length, start + count)
            place = int(self.offsets[segment]) + low - begin
            out[low - start : high - start] = opened[source][place : place + high - low]
        return out

    def with_gap(self, position: int, count: int) -> ByteStream:
        """The stream with `count` bytes of zeros before byte `position`."""
        inside = np.flatnonzero((self.starts < position) & (position < self.starts + self.lengths))
        fields = [self.sources, self.offsets, self.starts, self.lengths]
        if len(inside):
            segment = int(inside[0])
            head = position - int(self.starts[segment])
            fields = [np.insert(values, segment + 1, values[segment]) for values in fields]
            _, offsets, starts, lengths = fields
            offsets[segment + 1] += head
            starts[segment + 1] = position
            lengths[segment + 1] -= head
            lengths[segment] = head
        sources, offsets, starts, lengths = fields
        return replace(
            self, sources=sources, offsets=offsets, starts=starts + count * (starts >= position), lengths=lengths
        )
