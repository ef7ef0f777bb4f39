"""Phase errors that depend on the delay of a path, applied to samples that are sums over paths.

A path of delay tau has the beat frequency mu tau, so the discrete Fourier transform of a chirp sorts paths by delay.
The error factor exp(j [phi(t) - phi(t - tau)]) is smooth in tau; its expansion in Lagrange polynomials l_j(tau) on
Chebyshev nodes tau_j turns the sum over paths into few products:

    y(t) = sum_j exp(j [phi(t) - phi(t - tau_j)]) s_j(t),   s_j = inverse transform of l_j(f / mu) S(f).

Chirps are made periodic first, against leakage between bins. The gap between the end of a chirp and its next beginning
is filled by autoregressive interpolation (Janssen, Veldhuis and Vries, IEEE Trans. ASSP 34, 1986): the filling with the
smallest error of the linear predictor of the frame's own signals. The products are on a grid of twice the sample rate,
and the receiver's IF filter removes frequencies outside of the range window. `y - s` is returned.

Approximate are the rest of the leakage, and the delays of moving paths, of which Doppler changes the beat frequency by
v f_c / (mu R) of itself. The errors are at most 1.5 % of the phase error at the end of the range window, for phases up
to 1 rad and ripples slower than 2 % of the sample rate. Sidebands of faster ripples are beyond the IF filter. Paths of
the device itself have known delays, which replace those of the transform.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from rfgen_sionna._types import ComplexArray, FloatArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.signal.receiver.oscillator import PhaseNoise, RampError
from rfgen_sionna.signal.receiver.static_paths import StaticPath, tone

NEGATIVE_SHARE = 1 / 32
"""Share of the range window that counts as below zero, for approaching targets and leakage of near ones; half of it
with a real ADC, whose mixer folds both sidebands."""
_ROWS = 500_000  # grid points of all channels at a time: bounds the memory of a thread to about 50 MB

_FITTED_ROWS = 96  # chirps and channels of a frame that the predictor is fitted to: bounds the time of the fit
_RIDGE = 1e-9
"""White noise added to the signal, as a share of its power: bounds the predictor of few paths."""


@dataclass(frozen=True)
class _BeatGrid:
    """ADC window at twice the sample rate, and beat frequencies of the range window."""

    gap: int
    """Samples of the gap, half of them before the window."""
    times: FloatArray
    """(2 extended sample,) after the start of the ramp [s]."""
    fade: FloatArray
    """(2 extended sample,) one within the ADC window, zero where the period ends."""
    bins: FloatArray
    """(extended sample,) beat frequencies in units of 1 / extended length, ascending in delay."""
    delays: FloatArray
    """(extended sample,) their delays [s]."""
    nodes: FloatArray
    """(node,) [s]"""

    @classmethod
    def of(cls, radar: Radar, variation: float, swing: float) -> _BeatGrid:
        """Nodes for errors that vary with `variation` [Hz] and reach `swing` [rad]."""
        waveform = radar.waveform
        rate, slope = waveform.sample_rate, waveform.slope
        gap = gap_length(waveform.num_samples)
        count = waveform.num_samples + gap
        first = -round((0.5 if radar.adc.real else NEGATIVE_SHARE) * count)
        steps = np.arange(first, first + count)
        delays = np.asarray(steps * rate / (count * abs(slope)), dtype=np.float64)
        # exp(j a x) on -1 … 1 converges beyond a + O(a^(1/3)) nodes.
        turn = math.pi * variation * rate / abs(slope) + swing
        nodes = math.ceil(turn + 4 * turn ** (1 / 3) + 9)
        x = np.cos(math.pi * (np.arange(nodes) + 0.5) / nodes)
        middle, half = 0.5 * (delays[0] + delays[-1]), max(0.5 * (delays[-1] - delays[0]), 1e-15)
        places = np.arange(2 * count) / 2 - gap // 2  # in samples of the window
        outside = np.maximum(0, np.maximum(-places, places - (waveform.num_samples - 1)))
        fade = np.cos(0.5 * math.pi * np.clip(outside / (gap / 2), 0, 1)) ** 2 if gap else np.ones(2 * count)
        times = waveform.adc_start_time + places / rate
        bins = np.asarray(steps * np.sign(slope), dtype=np.float64)
        return cls(gap, times, fade, bins, delays, np.asarray(middle + half * x))

    def weights(self, delays: FloatArray) -> FloatArray:
        """(node, ...) Lagrange polynomials of the nodes at `delays` (...) [s]."""
        middle, half = 0.5 * (self.delays[0] + self.delays[-1]), max(0.5 * (self.delays[-1] - self.delays[0]), 1e-15)
        count = len(self.nodes)
        orders = np.arange(count)
        angle = np.arccos(np.clip((delays - middle) / half, -1, 1))
        at_nodes = np.cos(np.outer(math.pi * (np.arange(count) + 0.5) / count, orders)) * (2 / count)
        at_nodes[:, 0] *= 0.5
        return np.tensordot(at_nodes, np.cos(orders[(...,) + (None,) * np.ndim(delays)] * angle), axes=1)


def generator_error(
    samples: ComplexArray,
    statics: Sequence[StaticPath],
    radar: Radar,
    ramp: RampError | None,
    noise: PhaseNoise | None,
    rng: np.random.Generator,
    tx_weights: ComplexArray | None = None,
) -> ComplexArray:
    """Error of `samples` and of the device's own paths, which `samples` do not include, by the generator's phase.

    `samples` and result are (chirp, tx, rx, sample) [sqrt(W)]. `radar` has one profile with a slope. `tx_weights`
    (loop or 1, slot, tx) are gains of the Tx elements in each slot; None is one element a slot.
    """
    waveform = radar.waveform
    chirps, slots, receivers, inner = samples.shape
    largest = waveform.sample_rate / abs(waveform.slope)
    swing = 1.0
    if ramp is not None:
        swing += math.pi * largest * float(np.abs(ramp.frequency(radar, waveform.sample_times)).max())
    variation = max(0.0 if ramp is None else ramp.variation(radar), 0.0 if noise is None else waveform.sample_rate)
    grid = _BeatGrid.of(radar, variation, swing)
    count = inner + grid.gap
    extended = fill_gap(samples)
    window = slice(grid.gap // 2, grid.gap // 2 + inner)
    # In FFT order: non-negative beat frequencies, then negative ones.
    wide_bins = (grid.bins % (2 * count)).astype(int)
    order = np.argsort(wide_bins)
    wide_bins, bins = wide_bins[order], (grid.bins[order] % count).astype(int)
    above = int(np.count_nonzero(wide_bins < count))
    weights = grid.weights(grid.delays[order]).astype(np.float32)
    own = [
        (
            (path.amplitude * tone(radar, grid.times, path.delay)).astype(np.complex64),
            grid.weights(path.delay).astype(np.float32),
        )
        for path in statics
    ]
    drawn = None
    period = 2 * count / waveform.sample_rate
    if noise is not None:
        drawn = noise.draw(rng, chirps * slots, period, 4 * count).reshape(chirps, slots, 1, -1)
    offsets = np.arange(2 * count + 1) / period
    out = np.empty_like(samples)

    def work(part: slice) -> None:
        # Single precision suffices for the error, which is small, but not for its phase.
        spectrum = (2 * fft.fft(extended[part], axis=-1)[..., bins]).astype(np.complex64)
        chosen = None if drawn is None else drawn[part]
        now = _phase(radar, grid.times, ramp, chosen)
        change = np.zeros((*spectrum.shape[:-1], 2 * count), dtype=np.complex64)
        wide = np.zeros_like(change)
        for node, delay in enumerate(grid.nodes):
            late = None if chosen is None else chosen * np.exp(-2j * math.pi * offsets * delay)
            error = _phasor_less_one(now - _phase(radar, grid.times - delay, ramp, late))
            np.multiply(spectrum[..., :above], weights[node, :above], out=wide[..., :above])
            np.multiply(spectrum[..., above:], weights[node, above:], out=wide[..., count + above :])
            band = fft.ifft(wide, axis=-1)
            for signal, share in own:
                band += _summed(signal * share[node][..., None], tx_weights, part)
            band *= error
            change += band
        change *= grid.fade.astype(np.float32)
        kept = np.zeros_like(change, shape=(*spectrum.shape[:-1], count))
        kept[..., bins] = 0.5 * fft.fft(change, axis=-1)[..., wide_bins]
        out[part] = fft.ifft(kept, axis=-1)[..., window]

    rows = max(1, _ROWS // (slots * receivers * 2 * count))
    parts = [slice(first, first + rows) for first in range(0, chirps, rows)]
    with ThreadPoolExecutor(min(len(parts), os.cpu_count() or 1)) as pool:
        list(pool.map(work, parts))
    return out


def _summed(signal: NDArray[Any], tx_weights: ComplexArray | None, part: slice) -> NDArray[Any]:
    """(chirp or 1, slot, rx, time) of the chirps `part`, from (tx, rx, time)."""
    if tx_weights is None:
        return signal[None]
    weights = tx_weights if len(tx_weights) == 1 else tx_weights[part]
    return np.asarray(np.einsum("lat,trs->lars", weights.astype(signal.dtype), signal))


def _phase(radar: Radar, times: FloatArray, ramp: RampError | None, drawn: ComplexArray | None) -> FloatArray:
    """(..., time) phase error of the generator [rad]; `drawn` are Fourier coefficients of the noise."""
    phase = np.zeros(len(times)) if ramp is None else ramp.phase(radar, times)
    return phase if drawn is None else phase + _on_grid(drawn, len(times))


def _phasor_less_one(phase: FloatArray) -> NDArray[np.complex64]:
    """exp(j phase) - 1 without cancellation."""
    out = np.empty(phase.shape, dtype=np.complex64)
    single = phase.astype(np.float32)
    out.real, out.imag = -2 * np.sin(0.5 * single) ** 2, np.sin(single)
    return out


def _on_grid(coefficients: ComplexArray, count: int) -> FloatArray:
    """(..., count) first half of the period of the real series with these coefficients."""
    length = 2 * (coefficients.shape[-1] - 1)
    return np.asarray(fft.irfft(coefficients * (length / 2), n=length, axis=-1)[..., :count])


def gap_length(count: int) -> int:
    """Even number of samples in the gap for chirps of `count` samples; 0 below 16, too few for a predictor."""
    return 0 if count < 16 else 2 * round(min(64, count // 4) / 2)


def fill_gap(samples: ComplexArray) -> ComplexArray:
    """(..., sample + gap) periodic chirps, with half the gap before and half behind."""
    count = samples.shape[-1]
    gap = gap_length(count)
    if gap == 0:
        return samples
    rows = samples.reshape(-1, count)
    predictor = _predictor(rows[:: max(1, len(rows) // _FITTED_ROWS)], gap // 2)
    order = len(predictor) - 1
    # Matrix from [order samples before, gap, order samples behind] to prediction errors in and around the gap.
    errors = np.zeros((gap + order, gap + 2 * order), dtype=np.complex128)
    for row in range(gap + order):
        errors[row, row : row + order + 1] = predictor[::-1]
    inside, known = errors[:, order : order + gap], np.delete(errors, np.s_[order : order + gap], axis=1)
    filling = -np.linalg.lstsq(inside, known, rcond=None)[0]
    around = np.concatenate([rows[:, -order:], rows[:, :order]], axis=1)
    filled = around @ filling.T
    half = gap // 2
    extended = np.concatenate([filled[:, half:], rows, filled[:, :half]], axis=1)
    return extended.reshape(*samples.shape[:-1], count + gap)


def _predictor(rows: ComplexArray, order: int) -> ComplexArray:
    """(order + 1,) one and minus the weights of the past samples, from forward and backward prediction."""
    windows = np.lib.stride_tricks.sliding_window_view(rows, order + 1, axis=-1).reshape(-1, order + 1)
    matrix = windows.T.conj() @ windows
    matrix = matrix + matrix[::-1, ::-1].conj()  # backwards in time a path's frequency is that of its conjugate
    power = float(np.trace(matrix).real) / (order + 1)
    weights = np.zeros(order + 1, dtype=np.complex128)
    weights[0] = 1.0
    if power == 0.0:
        return weights
    past = matrix[:order, :order] + _RIDGE * power * np.eye(order)
    # Columns run from the oldest sample to the newest, the one that is predicted.
    weights[1:] = -np.linalg.solve(past, matrix[:order, order])[::-1]
    return weights
