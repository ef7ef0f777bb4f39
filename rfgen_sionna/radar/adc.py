"""The analogue-to-digital converter of a radar."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Adc:
    """Word length and range of the converters of each receiver: one each for I and Q, or one for real samples.

    Raises
    ------
    ValueError
        A field is out of range.
    """

    bits: int = 16
    """Bits of one word, sign included, 2 … 24."""
    full_scale_dbm: float | None = None
    """Input power of a tone that fills the converter [dBm], -150 … 60; None adapts it to the signal."""
    real: bool = False
    """Whether a receiver has one mixer and one converter. Its samples are real, sqrt(2) Re(s) of the complex ones s:
    the mean square of a beat is the received power [W], as that of |s|. Beat frequencies reach half the sample rate."""
    iq_swap: bool = False
    """Whether Q precedes I in the board's own recordings (TI's `SampleSwap`, `iqSwapSel`); files that this package
    writes have I first."""

    def __post_init__(self) -> None:
        if isinstance(self.bits, bool) or not isinstance(self.bits, int) or not 2 <= self.bits <= 24:
            raise ValueError(f"adc.bits is {self.bits!r}: a whole number in 2 … 24 is needed")
        if not isinstance(self.real, (bool, np.bool_)):
            raise ValueError(f"adc.real is {self.real!r}: True (one converter) or False (I and Q) is needed")
        if not isinstance(self.iq_swap, (bool, np.bool_)):
            raise ValueError(f"adc.iq_swap is {self.iq_swap!r}: True (Q before I) or False is needed")
        level = self.full_scale_dbm
        if level is None:
            return
        number = isinstance(level, (int, float, np.number)) and not isinstance(level, bool)
        if not (number and -150 <= level <= 60):
            raise ValueError(
                f'adc.full_scale_dbm is {level!r}: a value in -150 … 60 dBm, or None (in a file: "auto"), is needed'
            )
