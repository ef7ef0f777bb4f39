"""Quantisation and clipping."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import ComplexArray
from rfgen_sionna.radar import Adc, Radar
from rfgen_sionna.signal.noise import noise_power

AUTOMATIC_HEADROOM = 2.0
"""Least ratio of an automatic full scale to the largest I or Q that it is set from."""


@dataclass(frozen=True)
class ReceivedFrame:
    """Samples of one frame behind the receiver."""

    samples: ComplexArray
    """(chirp, tx, rx, sample) in square roots of watts at the receiver input."""
    adc: Adc | None = None
    """None: not quantised."""
    full_scale: float | None = None
    """Largest I or Q of the converters [sqrt(W)]; None where not quantised."""
    clipped: float = 0.0
    """Share of the words of I and Q that were beyond the range."""

    @property
    def lsb(self) -> float | None:
        """Step of the converters [sqrt(W)]; None where not quantised."""
        return None if self.adc is None or self.full_scale is None else self.full_scale / 2 ** (self.adc.bits - 1)

    @property
    def words(self) -> NDArray[np.int16] | NDArray[np.int32]:
        """(chirp, tx, rx, sample, 2) signed words of I and Q: `samples` in units of `lsb`, exactly.

        Raises
        ------
        ValueError
            If the samples were not quantised.
        """
        if self.adc is None or self.lsb is None:
            raise ValueError("capture.words: the receiver had no ADC (Receiver(adc=...))")
        parts = np.stack([self.samples.real, self.samples.imag], axis=-1) / self.lsb
        words = np.rint(parts)
        return words.astype(np.int16) if self.adc.bits <= 16 else words.astype(np.int32)


def convert(samples: ComplexArray, radar: Radar, adc: Adc, full_scale: float | None = None) -> ReceivedFrame:
    """Round I and Q to the nearest of 2^bits steps and clip them to -2^(bits-1) … 2^(bits-1) - 1 of them.

    The range is that of `adc.full_scale_dbm`. Where that is automatic it is `full_scale` [sqrt(W)], and without one the
    power of two that leaves 6 to 12 dB above the largest I or Q of these samples (or the noise): set from the first
    frame of a run it has room for what comes, the scale stays the same, and a sample is exact in float32.
    """
    if adc.full_scale_dbm is not None:
        full_scale = 10.0 ** ((adc.full_scale_dbm - 30) / 20)
    elif full_scale is None:
        peak = max(float(np.abs(samples.real).max(initial=0.0)), float(np.abs(samples.imag).max(initial=0.0)))
        least = AUTOMATIC_HEADROOM * max(peak, noise_power(radar) ** 0.5, 1e-20)
        full_scale = 2.0 ** math.ceil(math.log2(least))
    half = 2 ** (adc.bits - 1)
    lsb = full_scale / half
    out, beyond = np.empty_like(samples), 0
    for part, target in ((samples.real, out.real), (samples.imag, out.imag)):
        words = np.rint(part / lsb)
        beyond += int(np.count_nonzero((words < -half) | (words > half - 1)))
        target[...] = np.clip(words, -half, half - 1) * lsb
    return ReceivedFrame(out, adc, full_scale, beyond / max(2 * samples.size, 1))
