"""Errors of the chirp generator: ramp non-linearity and phase noise.

The mixer compares the transmitted phase with that of the echo sent tau earlier, so a phase error phi(t) of the
generator leaves phi(t) - phi(t - tau) on a path of delay tau ("range correlation"), little for close paths such as
leakage. :mod:`rfgen_sionna.signal.receiver.delay_phase_errors` applies it to samples, with its limits.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from rfgen_sionna._types import ComplexArray, FloatArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.signal.receiver.value_checks import check_number, check_numbers


@dataclass(frozen=True)
class RampError:
    """Deviation of the ramp's frequency from a straight line: a polynomial plus a sine, the same in every chirp.

    A path of delay tau gets the phase phi(t) - phi(t - tau), where phi is the integral of 2 pi times the deviation.
    """

    polynomial_hz: tuple[float, ...] = ()
    """Coefficients [Hz] of (t / ramp_end_time)^n, n = 0, 1, …, with t from the start of the ramp."""
    sine_hz: float = 0.0
    """Amplitude of the sine [Hz]."""
    sine_frequency_hz: float = 0.0
    """Frequency of the sine [Hz]."""
    sine_phase_deg: float = 0.0
    """Phase of the sine at the start of the ramp."""

    def __post_init__(self) -> None:
        coefficients = check_numbers("ramp_error.polynomial_hz", self.polynomial_hz, -1e9, 1e9, "Hz")
        object.__setattr__(self, "polynomial_hz", coefficients)
        check_number("ramp_error.sine_hz", self.sine_hz, -1e9, 1e9, "Hz")
        check_number("ramp_error.sine_frequency_hz", self.sine_frequency_hz, 0, 1e8, "Hz")
        check_number("ramp_error.sine_phase_deg", self.sine_phase_deg, -360, 360, "degrees")
        if self.sine_hz and not self.sine_frequency_hz:
            raise ValueError("ramp_error.sine_frequency_hz is 0: a sine needs a positive frequency [Hz]")

    def frequency(self, radar: Radar, times: FloatArray) -> FloatArray:
        """Error of the frequency [Hz] at `times` after the start of the ramp [s]."""
        share = times / radar.waveform.ramp_end_time
        smooth = np.polynomial.polynomial.polyval(share, self.polynomial_hz or (0.0,))
        angle = 2 * math.pi * self.sine_frequency_hz * times + math.radians(self.sine_phase_deg)
        return np.asarray(smooth + self.sine_hz * np.sin(angle))

    def phase(self, radar: Radar, times: FloatArray) -> FloatArray:
        """Phase error phi [rad] at `times` after the start of the ramp [s], also for negative times."""
        span = radar.waveform.ramp_end_time
        integral = np.polynomial.polynomial.polyint(self.polynomial_hz or (0.0,))
        phase = 2 * math.pi * span * np.polynomial.polynomial.polyval(times / span, integral)
        if self.sine_hz:
            start = math.radians(self.sine_phase_deg)
            angle = 2 * math.pi * self.sine_frequency_hz * times + start
            phase = phase + self.sine_hz / self.sine_frequency_hz * (math.cos(start) - np.cos(angle))
        return np.asarray(phase)

    def variation(self, radar: Radar) -> float:
        """Frequency scale of the phase error over the ramp [Hz]."""
        return max(self.sine_frequency_hz, len(self.polynomial_hz) / radar.waveform.ramp_end_time)


@dataclass(frozen=True)
class PhaseNoise:
    """Phase noise of the chirp generator, common to all Tx and Rx elements.

    Draws of chirps are independent: range correlation removes noise slower than a chirp.
    """

    points: tuple[tuple[float, float], ...]
    """(offset from the carrier [Hz], single-sideband level [dBc/Hz]), offsets ascending. Levels are linear in
    log(offset) in between and constant outside."""

    def __post_init__(self) -> None:
        try:
            points = tuple((float(offset), float(level)) for offset, level in self.points)
        except (TypeError, ValueError):
            points = ()
        if not points:
            raise ValueError(f"phase_noise.points is {self.points!r}: pairs (offset [Hz], level [dBc/Hz]) are needed")
        for index, (offset, level) in enumerate(points):
            check_number(f"phase_noise.points[{index}] offset", offset, 1e-3, 1e12, "Hz")
            check_number(f"phase_noise.points[{index}] level", level, -250, 0, "dBc/Hz")
        offsets = [offset for offset, _ in points]
        if any(later <= earlier for earlier, later in itertools.pairwise(offsets)):
            raise ValueError(f"phase_noise.points has the offsets {offsets} Hz: they must ascend")
        object.__setattr__(self, "points", points)

    def density(self, offset: FloatArray) -> FloatArray:
        """Two-sided power spectral density of phi [rad^2/Hz] at `offset` [Hz]: the single-sideband level L(f)."""
        known, levels = np.transpose(self.points)
        at = np.log10(np.maximum(np.abs(offset), known[0]))
        return np.asarray(10.0 ** (np.interp(at, np.log10(known), levels) / 10))

    def draw(self, rng: np.random.Generator, chirps: int, period: float, count: int) -> ComplexArray:
        """(chirp, frequency) Fourier coefficients of phi, of frequencies m / period with m = 0 … count / 2 [rad].

        `phi(t) = Re sum_m c_m exp(j 2 pi m t / period)`, periodic, without its mean.
        """
        offset = np.arange(count // 2 + 1) / period
        parts = rng.standard_normal((chirps, len(offset), 2))
        # Both sidebands: a real cosine of random amplitude and phase in each bin of 1 / period.
        coefficients = (parts[..., 0] + 1j * parts[..., 1]) * np.sqrt(2 * self.density(offset) / period)
        coefficients[:, 0] = 0.0
        return coefficients
