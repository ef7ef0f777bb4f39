"""Noise of the motion model, and its levels.

The noise has the covariance between columns and the spectrum over time of the differences between clips of one action,
so that at one level the same share of slant, size and timing is lost. White noise would have to bury a motion before
its slow parts change, as neighbouring poses say the same.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rfgen_sionna._types import FloatArray

_SETTLING = 40
"""Rows that are made and left out, so that the noise's end does not continue in its beginning."""


@dataclass(frozen=True)
class MotionNoise:
    """Gaussian noise with a covariance and a spectrum."""

    factor: FloatArray
    """(column, column) factor L of the covariance L Lᵀ of normalised columns."""
    amplitude: FloatArray
    """(frequency,) amplitude from 0 to half the frame rate, evenly spaced, of mean power 1."""

    def draw(self, rng: np.random.Generator, frames: int) -> FloatArray:
        """(frame, column) noise."""
        n = frames + _SETTLING
        spectrum = np.fft.rfft(rng.standard_normal((n, len(self.factor))), axis=0)
        at = np.linspace(0.0, 1.0, len(self.amplitude))
        shape = np.interp(np.fft.rfftfreq(n) / 0.5, at, self.amplitude)
        shape *= np.sqrt(n / (shape[0] ** 2 + 2.0 * np.sum(shape[1:] ** 2)))
        return np.fft.irfft(spectrum * shape[:, None], n, axis=0)[:frames] @ self.factor.T


def measured_noise(stretches: FloatArray) -> MotionNoise:
    """Noise like the (stretch, frame, column) differences of motions from their action's mean."""
    rows = stretches.reshape(-1, stretches.shape[-1])
    covariance = rows.T @ rows / len(rows)
    values, vectors = np.linalg.eigh(covariance)
    factor = vectors * np.sqrt(np.maximum(values, 1e-4 * values[-1]))
    power = np.mean(np.abs(np.fft.rfft(stretches, axis=1)) ** 2, axis=(0, 2))
    return MotionNoise(factor, np.sqrt(power / power.mean()))


def signal_share(level: FloatArray | float) -> FloatArray:
    """Share a of the motion in the power of √a motion + √(1 − a) noise at a level from 0 (none) to 1 (noise alone)."""
    return np.cos(0.5 * np.pi * np.asarray(level, np.float64)) ** 2
