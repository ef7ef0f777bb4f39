"""Choices of how a run is stored: which parts, as words or floats, compressed or not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import hdf5plugin
import numpy as np

from rfgen_sionna.dataset.schema import RunInfo
from rfgen_sionna.signal.receiver.receiver_record import receiver_from_record

WORD_BITS = 16
"""Bits of the words of a stored ADC; samples of one with more bits are stored as floating-point numbers."""
LEAST_COMPRESSED = 4096
"""Size of a chunk [bytes] from which on it is compressed."""


@dataclass(frozen=True)
class Storage:
    """How a run is stored."""

    keep: frozenset[str] | None = None
    """Parts that are stored, of "adc", "vertices", "joints", "labels" and further ones; None stores all."""
    words: bool = False
    """Whether quantised samples are stored as the ADC's words."""
    compressed: bool = False
    """Whether arrays are compressed without loss (bitshuffle and LZ4), and chunks have checksums (Fletcher-32)."""
    dated: bool = True
    """Whether the file has the time of its creation."""

    @property
    def libver(self) -> tuple[str, str]:
        """Versions of HDF5 for the file's structures; those from 1.10 on have checksums."""
        return ("v110" if self.compressed else "earliest", "v110")

    def stores(self, part: str) -> bool:
        """Whether `part` is stored."""
        return self.keep is None or part in self.keep

    def filters(self, shape: tuple[int, ...], kind: np.dtype[Any]) -> dict[str, Any]:
        """Arguments of `create_dataset` for chunks of `shape`; empty without compression."""
        if not self.compressed or kind.hasobject or int(np.prod(shape)) * kind.itemsize < LEAST_COMPRESSED:
            return {}
        return {"fletcher32": True, "chunks": shape, **hdf5plugin.Bitshuffle(cname="lz4")}

    def word_bits(self, info: RunInfo) -> int | None:
        """Bits of the words that samples are stored as; None for floating-point numbers."""
        record = info.receiver
        if not self.words or record is None:
            return None
        source: Mapping[str, Any] = {"adc": record.get("adc", "radar")}
        adc = receiver_from_record(source, info.radar).adc
        bits = info.radar.adc.bits if adc == "radar" else getattr(adc, "bits", WORD_BITS + 1)
        return bits if bits <= WORD_BITS else None


PLAIN = Storage()
"""Everything, as floating-point numbers, without compression."""
