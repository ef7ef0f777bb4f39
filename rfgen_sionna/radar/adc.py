"""The analogue-to-digital converter of a radar."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Adc:
    """Word length and range of the converters for I and Q of each receiver.

    Raises
    ------
    ValueError
        A field is out of range.
    """

    bits: int = 16
    """Bits of one word, sign included, 2 … 24."""
    full_scale_dbm: float | None = None
    """Input power of a complex tone that fills the converter [dBm], -150 … 60; None adapts it to the signal."""

    def __post_init__(self) -> None:
        if isinstance(self.bits, bool) or not isinstance(self.bits, int) or not 2 <= self.bits <= 24:
            raise ValueError(f"adc.bits is {self.bits!r}: a whole number in 2 … 24 is needed")
        level = self.full_scale_dbm
        if level is None:
            return
        number = isinstance(level, (int, float, np.number)) and not isinstance(level, bool)
        if not (number and -150 <= level <= 60):
            raise ValueError(
                f'adc.full_scale_dbm is {level!r}: a value in -150 … 60 dBm, or None (in a file: "auto"), is needed'
            )
