"""Phase, beat frequency and gain of a path's samples, as smooth curves over the frame.

Around the middle t_m of the ADC window, u = (t - t_m) / half, the delay is tau + rate t + curve t^2 / 2. The phase is
then a constant, a term in u (the beat frequency) and a small one in u^2, all as smooth in time as the delay.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import RadarPaths, knot_weights

MIN_SPLINE_KNOTS = 4
"""Least number of knots of a cubic spline."""
LEAST_PART_ERROR, LEAST_PART = 1e-3, 4
"""Error of the phase [rad] and relative error of gains below which the ADC window stays whole, and the least number of
samples of its parts."""


@dataclass(frozen=True)
class AdcWindow:
    """ADC window, with its samples from -1 to 1 in u about the transform's mode 0."""

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
        return cls._from(radar, 0, radar.waveform.num_samples)

    @classmethod
    def parts(cls, radar: Radar, number: int) -> list[AdcWindow]:
        """The window in a `number` of successive parts."""
        bounds = np.linspace(0, radar.waveform.num_samples, number + 1).astype(int).tolist()
        return [cls._from(radar, first, last - first) for first, last in pairwise(bounds)]

    @classmethod
    def _from(cls, radar: Radar, first: int, count: int) -> AdcWindow:
        """Window of `count` samples from the sample `first`."""
        step = 1.0 / radar.waveform.sample_rate
        modes = np.arange(count) - count // 2
        middle = radar.waveform.adc_start_time + (first + count // 2) * step
        return cls(count, step, middle, 0.5 * count * step, np.asarray(modes / (0.5 * count)))


def element_gains(radar: Radar, paths: RadarPaths) -> FloatArray:
    """(path, time) field gain of the Tx element times that of the Rx element times the root of the power [sqrt(W)]."""
    to_device = radar.rotation  # row vectors: world @ R = device
    root = math.sqrt(1e-3 * 10.0 ** (radar.tx_power_dbm / 10.0))
    departing = radar.pattern.amplitude(paths.direction @ to_device)
    if paths.arrival is paths.direction or np.array_equal(paths.arrival, paths.direction):
        return root * departing * departing
    return root * departing * radar.pattern.amplitude(paths.arrival @ to_device)


def conjugate_gains(
    radar: Radar, paths: RadarPaths, amplitude: FloatArray | NDArray[np.float32], window: AdcWindow, tx: int, rx: int
) -> NDArray[np.complexfloating[Any]]:
    """(order, path, time) coefficients of u^order of the conjugate gains times `amplitude` (:func:`element_gains`), in
    its precision."""
    number = np.result_type(amplitude.dtype, np.complex64)
    found = paths.a[None, tx, rx]
    if paths.dispersion is not None:
        found = np.concatenate([found, paths.dispersion[:, tx, rx]], dtype=number, casting="same_kind")
    scaled = np.conj(found.astype(number, copy=False)) * amplitude
    if paths.dispersion is None:
        return np.asarray(scaled)
    orders = len(scaled)
    # A signal that arrives at t was sent at t - tau, with the frequency f_c + mu (t - tau): powers of (f - frequency) /
    # half_band become powers of the frequency sent at t, lower by mu tau.
    delay = paths.tau[tx, rx]
    if delay.shape[-1] != scaled.shape[-1]:
        delay = delay.mean(axis=-1, keepdims=True)
    lower = (-radar.waveform.slope / paths.half_band * delay).astype(amplitude.dtype)
    for least in range(orders - 1):
        for order in range(orders - 2, least - 1, -1):
            scaled[order] += lower * scaled[order + 1]
    powers = frequency_powers(radar, paths, window, orders)
    # Real matrix times complex vectors, as one real product.
    flat = np.ascontiguousarray(scaled).reshape(orders, -1).view(amplitude.dtype)
    joined = powers.astype(amplitude.dtype) @ flat
    return np.asarray(joined.view(number).reshape(scaled.shape))


def frequency_powers(radar: Radar, paths: RadarPaths, window: AdcWindow, orders: int) -> FloatArray:
    """(order of u, order) matrix from powers of (f - frequency) / half_band, f sent in the window, to powers of u."""
    waveform = radar.waveform
    shift = (waveform.start_frequency + waveform.slope * window.middle - paths.frequency) / paths.half_band
    scale = waveform.slope * window.half / paths.half_band
    return np.array(
        [[math.comb(m, n) * shift ** max(m - n, 0) * scale**n for m in range(orders)] for n in range(orders)]
    )


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
    """(order + 1, path, knot) coefficients of gains that change during the ADC window, from (order, path, knot).

    `derivative` (knot, knot) takes values at the knots to their rates there [1/s]. The curvature of a gain over the
    window is left out, an error of a quarter to a half of (half window x rate)^2.
    """
    change = gains.reshape(-1, gains.shape[-1]) @ (window.half * derivative.T).astype(gains.real.dtype)
    out = np.empty((len(gains) + 1, *gains.shape[1:]), dtype=gains.dtype)
    out[:-1], out[-1] = gains, 0.0
    out[1:] += change.reshape(gains.shape)
    return out


@dataclass(frozen=True)
class PathSplines:
    """Phases and gains over a frame as B-splines in time, cubic for at least four knots."""

    knots: FloatArray
    """(knot,) times of the values [s]."""
    derivatives: tuple[FloatArray, FloatArray, FloatArray] | None
    """Matrices from delays at the paths' knots to delays, rates and curvatures there; None for a constant rate."""
    matrix: FloatArray
    """(coefficient, knot) matrix from values at the knots to coefficients."""
    corners: FloatArray
    """Knots of the B-splines, from the first of `knots` [s]."""

    @classmethod
    def of(cls, paths: RadarPaths, first: float, last: float) -> PathSplines:
        """Splines of paths over `first` … `last` [s]; paths of a constant rate get three knots."""
        from scipy.interpolate import make_interp_spline

        knots, derivatives = np.linspace(first, last + 1e-6, 3), None
        if len(paths.times) > 1:
            knots = paths.times
            value, slope, curve = (knot_weights(knots, knots, order) for order in range(3))
            derivatives = (value, slope, curve)
        # Not-a-knot, as in `knot_weights`.
        spline = make_interp_spline(knots - knots[0], np.eye(len(knots)), k=min(3, len(knots) - 1))
        return cls(knots, derivatives, np.asarray(spline.c), np.asarray(spline.t))

    def place(self, times: FloatArray) -> tuple[NDArray[np.intp], FloatArray]:
        """(time,) first non-zero coefficient at each time, and the weights (time, degree + 1) from there on."""
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
    """Whether the gains of one (tx, rx) change within an ADC window by more than `least`, relative to themselves."""
    if splines.derivatives is None or max(paths.a.shape[-1], amplitude.shape[-1]) == 1:
        return False
    gains = conjugate_gains(radar, paths, amplitude, window, *pair)[:1]
    held, change = (max_power(part).sum() for part in gain_coefficients(gains, splines.derivatives[1], window))
    return bool(change > least**2 * held)


def needed_parts(radar: Radar, paths: RadarPaths, eps: float) -> int:
    """Number of parts of the ADC window in which phases are quadratic and gains linear to an error of `eps`, as for
    rotors in chirps of a tenth of a turn: by the third derivative of the delays and the second one of the gains of the
    first element pair."""
    if len(paths.times) < MIN_SPLINE_KNOTS:
        return 1
    window, limit = AdcWindow.of(radar), max(eps, LEAST_PART_ERROR)
    thirds = paths.tau[0, 0] @ knot_weights(paths.times, paths.times, 3).T
    cubic = 2 * np.pi * radar.waveform.start_frequency * window.half**3 / 6.0 * float(np.abs(thirds).max(initial=0.0))
    parts = (cubic / limit) ** (1 / 3)
    if paths.a.shape[-1] == len(paths.times):
        bent = paths.a[0, 0] @ knot_weights(paths.times, paths.times, 2).T
        size = float(np.linalg.norm(paths.a[0, 0]))
        missed = 0.5 * window.half**2 * float(np.linalg.norm(bent)) / size if size > 0 else 0.0
        parts = max(parts, (missed / limit) ** 0.5)
    return max(1, min(int(np.ceil(parts)), window.count // LEAST_PART))


def max_power(gains: NDArray[np.complexfloating[Any]]) -> NDArray[np.floating[Any]]:
    """(path,) largest |gain|^2 of (path, time)."""
    power = gains.real.astype(np.float64) ** 2 + gains.imag.astype(np.float64) ** 2  # float32 would underflow
    return functools.reduce(np.maximum, power.T)  # faster than a maximum along a short last axis
