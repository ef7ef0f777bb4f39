"""What a path's delay and gain make of its samples, as smooth curves over the frame.

Around the middle t_m of the ADC window, u = (t - t_m) / half, the delay is tau + rate t + curve t^2 / 2, which makes
the phase a constant, a term in u (the beat frequency) and a small one in u^2. All three are as smooth in time as the
delay.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rfgen_sionna.radar import Radar
from rfgen_sionna.records import ComplexArray, FloatArray, RadarPaths, knot_weights


@dataclass(frozen=True)
class Window:
    """The ADC window: its samples count from -1 to 1 in u about the transform's mode 0."""

    count: int
    step: float
    """[s]"""
    middle: float
    """After the start of the ramp [s]."""
    half: float
    """[s]"""
    u: FloatArray

    @classmethod
    def of(cls, radar: Radar) -> Window:
        waveform = radar.waveform
        count, step = waveform.num_samples, 1.0 / waveform.sample_rate
        modes = np.arange(count) - count // 2
        middle = waveform.adc_start_time + (count // 2) * step
        return cls(count, step, middle, 0.5 * count * step, np.asarray(modes / (0.5 * count)))


def element_gains(radar: Radar, paths: RadarPaths) -> FloatArray:
    """(path, time) product of the field gains of the Tx and the Rx element and the root of the power [sqrt(W)]."""
    to_device = radar.rotation  # row vectors: world @ R = device
    root = math.sqrt(1e-3 * 10.0 ** (radar.tx_power_dbm / 10.0))
    departing = radar.pattern.amplitude(paths.direction @ to_device)
    if paths.arrival is paths.direction:
        return root * departing * departing
    return root * departing * radar.pattern.amplitude(paths.arrival @ to_device)


def conjugate_gains(
    radar: Radar, paths: RadarPaths, amplitude: FloatArray, window: Window, tx: int, rx: int
) -> ComplexArray:
    """(order, path, time) conjugate gains, element patterns and power included, as coefficients of u^order."""
    gains = [paths.a[tx, rx]] + ([] if paths.dispersion is None else list(paths.dispersion[:, tx, rx]))
    scaled = [np.conj(gain) * amplitude for gain in gains]
    if len(scaled) == 1:
        return scaled[0][None]
    # From powers of (f - frequency) / half_band to powers of u.
    waveform = radar.waveform
    shift = (waveform.start_frequency + waveform.slope * window.middle - paths.frequency) / paths.half_band
    scale = waveform.slope * window.half / paths.half_band
    return np.stack(
        [
            sum(
                (math.comb(m, n) * shift ** (m - n) * scaled[m] for m in range(n, len(scaled))),
                np.zeros_like(scaled[0]),
            )
            * scale**n
            for n in range(len(scaled))
        ]
    )


def phase_terms(
    radar: Radar, delay: FloatArray, slope: FloatArray, curve: FloatArray | None, window: Window
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Phase in cycles at the window's middle, beat in cycles per sample, and cycles of the u^2 term."""
    f_c, mu = radar.waveform.start_frequency, radar.waveform.slope
    middle, half = window.middle, window.half
    constant = delay * (f_c + mu * middle - 0.5 * mu * delay)
    beat = mu * delay + slope * (f_c + mu * (middle - delay))
    quadratic = np.broadcast_to((mu * half**2) * slope * (1 - 0.5 * slope), delay.shape)
    if curve is not None:
        quadratic = quadratic + (0.5 * half**2 * (f_c + mu * middle)) * curve
    return constant, beat * window.step, quadratic


@dataclass(frozen=True)
class Course:
    """Stretches of a frame within which phases and gains are cubics in time."""

    knots: FloatArray
    """(knot,) [s] what the values of :meth:`cubics` belong to."""
    starts: FloatArray
    """(stretch,) [s]"""
    lengths: FloatArray
    """(stretch,) [s]"""
    derivatives: tuple[FloatArray, FloatArray, FloatArray] | None
    """Matrices that take delays at the paths' knots to delays, rates and curvatures at `knots`; None where the rate is
    constant."""

    @classmethod
    def of(cls, paths: RadarPaths, first: float, last: float) -> Course:
        """For paths over `first` … `last` [s]: through three instants where their rate is constant."""
        if len(paths.times) > 1:
            value, slope, curve = (knot_weights(paths.times, paths.times, order) for order in range(3))
            return cls(paths.times, paths.times[:-1], np.diff(paths.times), (value, slope, curve))
        knots = np.linspace(first, last + 1e-6, 3)
        return cls(knots, knots[:1], knots[-1:] - knots[:1], None)

    def place(self, times: FloatArray) -> tuple[np.ndarray, FloatArray]:
        """(time,) stretch of each instant, and how far in it it lies, from 0 to 1."""
        stretch = np.clip(np.searchsorted(self.starts, times, side="right") - 1, 0, len(self.starts) - 1)
        return stretch, np.asarray((times - self.starts[stretch]) / self.lengths[stretch])

    def cubics(self, values: FloatArray) -> FloatArray:
        """(stretch, path, 4) coefficients, lowest first, of the spline through `values` (knot, path)."""
        order = min(3, len(self.knots) - 1)
        out = np.zeros((len(self.starts), values.shape[1], 4))
        for power in range(order + 1):
            matrix = knot_weights(self.knots, self.starts, power) if power < 3 else self._third()
            out[..., power] = (matrix * (self.lengths**power / math.factorial(power))[:, None]) @ values
        return out

    def _third(self) -> FloatArray:
        """Third derivatives within the stretches: at a spline's knots they jump."""
        return knot_weights(self.knots, self.starts + 0.5 * self.lengths, 3)

    def terms(
        self, radar: Radar, paths: RadarPaths, window: Window, tx: int, rx: int
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The three :func:`phase_terms`, (knot, path) each."""
        tau, rate = paths.tau[tx, rx], paths.tau_rate[tx, rx]
        if self.derivatives is None:
            delay = tau.T + rate.T * (self.knots[:, None] - paths.times[0])
            return phase_terms(radar, delay, rate.T, None, window)
        delay, slope, curve = (matrix @ tau.T for matrix in self.derivatives)
        return phase_terms(radar, delay, slope, curve, window)
