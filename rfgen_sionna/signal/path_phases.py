"""Phase, beat frequency and gain of a path's samples, as smooth curves over the frame.

Around the middle t_m of the ADC window, u = (t - t_m) / half, the delay is tau + rate t + curve t^2 / 2, which makes
the phase a constant, a term in u (the beat frequency) and a small one in u^2. All three are as smooth in time as the
delay.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import RadarPaths, knot_weights


@dataclass(frozen=True)
class AdcWindow:
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
    def of(cls, radar: Radar) -> AdcWindow:
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
    radar: Radar,
    paths: RadarPaths,
    amplitude: FloatArray | NDArray[np.float32],
    window: AdcWindow,
    tx: int,
    rx: int,
) -> NDArray[np.complexfloating[Any]]:
    """(order, path, time) conjugate gains, element patterns and power included, as coefficients of u^order; in the
    precision of `amplitude`, which is that of :func:`element_gains`."""
    number = np.result_type(amplitude.dtype, np.complex64)
    found = paths.a[None, tx, rx]
    if paths.dispersion is not None:
        found = np.concatenate([found, paths.dispersion[:, tx, rx]], dtype=number, casting="same_kind")
    scaled = np.conj(found.astype(number, copy=False)) * amplitude
    if paths.dispersion is None:
        return np.asarray(scaled)
    orders, waveform = len(scaled), radar.waveform
    # What arrives at t was sent at t - tau, when the chirp was at f_c + mu (t - tau): powers of (f - frequency) /
    # half_band, so much lower at each path's own delay, become such of the frequency that is sent.
    delay = paths.tau[tx, rx]
    if delay.shape[-1] != scaled.shape[-1]:
        delay = delay.mean(axis=-1, keepdims=True)
    lower = (-waveform.slope / paths.half_band * delay).astype(amplitude.dtype)
    for least in range(orders - 1):
        for order in range(orders - 2, least - 1, -1):
            scaled[order] += lower * scaled[order + 1]
    # And those powers of u.
    shift = (waveform.start_frequency + waveform.slope * window.middle - paths.frequency) / paths.half_band
    scale = waveform.slope * window.half / paths.half_band
    powers = np.array(
        [[math.comb(m, n) * shift ** max(m - n, 0) * scale**n for m in range(orders)] for n in range(orders)]
    )
    # Real times complex as two real products side by side.
    flat = np.ascontiguousarray(scaled).reshape(orders, -1).view(amplitude.dtype)
    joined = powers.astype(amplitude.dtype) @ flat
    return np.asarray(joined.view(number).reshape(scaled.shape))


def phase_terms(
    radar: Radar, delay: FloatArray, slope: FloatArray, curve: FloatArray | None, window: AdcWindow
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


def gain_coefficients(
    gains: NDArray[np.complexfloating[Any]], derivative: FloatArray, window: AdcWindow
) -> NDArray[np.complexfloating[Any]]:
    """(order + 1, path, knot) coefficients that go on changing during the ADC window, from (order, path, knot).

    `derivative` (knot, knot) takes values at the knots to their rates there [1/s]. What is left out is the bend of a
    gain over the window: a quarter to a half of (half window x rate)^2, 1e-6 of a gain that changes by 7 % a
    millisecond.
    """
    change = gains.reshape(-1, gains.shape[-1]) @ (window.half * derivative.T).astype(gains.real.dtype)
    out = np.empty((len(gains) + 1, *gains.shape[1:]), dtype=gains.dtype)
    out[:-1], out[-1] = gains, 0.0
    out[1:] += change.reshape(gains.shape)
    return out


@dataclass(frozen=True)
class PathSplines:
    """Phases and gains over a frame as B-splines in time, cubic where there are knots enough."""

    knots: FloatArray
    """(knot,) [s] that values are given at."""
    derivatives: tuple[FloatArray, FloatArray, FloatArray] | None
    """Matrices that take delays at the paths' knots to delays, rates and curvatures there; None where the rate is
    constant."""
    matrix: FloatArray
    """(coefficient, knot) takes values at the knots to as many coefficients."""
    corners: FloatArray
    """Knots of the B-splines, counted from the first of `knots` [s]."""

    @classmethod
    def of(cls, paths: RadarPaths, first: float, last: float) -> PathSplines:
        """For paths over `first` … `last` [s]: through three instants where their rate is constant."""
        from scipy.interpolate import make_interp_spline

        knots, derivatives = np.linspace(first, last + 1e-6, 3), None
        if len(paths.times) > 1:
            knots = paths.times
            value, slope, curve = (knot_weights(knots, knots, order) for order in range(3))
            derivatives = (value, slope, curve)
        # Not-a-knot, as the paths' own splines are.
        spline = make_interp_spline(knots - knots[0], np.eye(len(knots)), k=min(3, len(knots) - 1))
        return cls(knots, derivatives, np.asarray(spline.c), np.asarray(spline.t))

    def place(self, times: FloatArray) -> tuple[NDArray[np.intp], FloatArray]:
        """(time,) first of the coefficients that count at each instant, and the weights (time, degree + 1) of these."""
        from scipy.interpolate import BSpline

        degree = len(self.corners) - len(self.knots) - 1
        inside = np.clip(times - self.knots[0], self.corners[0], self.corners[-1])
        found = BSpline.design_matrix(inside, self.corners, degree)
        return found.indices.reshape(-1, degree + 1)[:, 0].astype(np.intp), found.data.reshape(-1, degree + 1)

    def terms(
        self, radar: Radar, paths: RadarPaths, window: AdcWindow, tx: int, rx: int
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The three :func:`phase_terms`, (knot, path) each."""
        tau, rate = paths.tau[tx, rx], paths.tau_rate[tx, rx]
        if self.derivatives is None:
            delay = tau.T + rate.T * (self.knots[:, None] - paths.times[0])
            return phase_terms(radar, delay, rate.T, None, window)
        delay, slope, curve = (matrix @ tau.T for matrix in self.derivatives)
        return phase_terms(radar, delay, slope, curve, window)


def gains_change(
    radar: Radar,
    paths: RadarPaths,
    amplitude: FloatArray,
    splines: PathSplines,
    window: AdcWindow,
    pair: tuple[int, int],
    least: float,
) -> bool:
    """Whether gains change within an ADC window by more than `least` of themselves; one (tx, rx) speaks for all."""
    if splines.derivatives is None or max(paths.a.shape[-1], amplitude.shape[-1]) == 1:
        return False
    gains = conjugate_gains(radar, paths, amplitude, window, *pair)[:1]
    held, change = (max_power(part).sum() for part in gain_coefficients(gains, splines.derivatives[1], window))
    return bool(change > least**2 * held)


def max_power(gains: NDArray[np.complexfloating[Any]]) -> NDArray[np.floating[Any]]:
    """(path,) largest |gain|^2 of (path, time). NumPy takes maxima along a short last axis at a tenth of the speed."""
    power = gains.real.astype(np.float64) ** 2 + gains.imag.astype(np.float64) ** 2  # of what is weak as well
    return functools.reduce(np.maximum, power.T)
