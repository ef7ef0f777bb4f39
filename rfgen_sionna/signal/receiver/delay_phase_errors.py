"""Phase errors that depend on a path's delay, applied to samples that are sums over paths.

A path of delay tau has the beat frequency mu tau, so the discrete Fourier transform of a chirp sorts its paths by
delay. The error factor exp(j [phi(t) - phi(t - tau)]) is smooth in tau; it is expanded in Lagrange polynomials
l_j(tau) on Chebyshev nodes tau_j, which turns the sum over paths into few products:

    y(t) = sum_j exp(j [phi(t) - phi(t - tau_j)]) s_j(t),   s_j = inverse transform of l_j(f / mu) S(f).

A path between two bins would leak into others, so chirps are made periodic first (:mod:`.extension`). The products are
taken on a grid of twice the sample rate, and the receiver's IF filter takes away what they put outside of the range
window. `y - s` is what is returned: without an error nothing changes.

What is approximate: what the extension leaves of the leakage, and Doppler, which moves a beat frequency and with it
the delay that a path is taken for by v f_c / (mu R) of itself (1.3 mm of range for 1 m/s at 77 GHz and 60 MHz/us).
Against the sum path by path the samples of a lone path err by at most 1.5 % of the phase error that a target at the end
of the range window has, and those of many paths by 1 % of their own error, as long as that is at most 1 rad and its
ripples are slower than 2 % of the sample rate; the tests hold it to that from 0.3 m on and up to 50 m/s. Faster ripples
put sidebands beyond the edges of the IF band, which the filter takes: the formula path by path knows no filter. Paths
of the device itself have known delays, which are used instead of the transform's.
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
from rfgen_sionna.signal.receiver.gap_filling import fill_gap, gap_length
from rfgen_sionna.signal.receiver.oscillator import PhaseNoise, RampError
from rfgen_sionna.signal.receiver.static_paths import StaticPath, tone

NEGATIVE_SHARE = 1 / 32
"""Share of the range window that counts as just below zero: approaching targets, and what leaks from near ones."""
_ROWS = 500_000  # grid points of all channels at a time: bounds the memory of a thread to about 50 MB


@dataclass(frozen=True)
class _BeatGrid:
    """The ADC window at twice the sample rate, and the beat frequencies that the range window holds."""

    gap: int
    """Samples of the extension, half of them before the window."""
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
        first = -round(NEGATIVE_SHARE * count)
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
    """Error that the generator's phase adds to `samples` and to the device's own paths, which are not in `samples`.

    Parameters
    ----------
    samples
        (chirp, tx, rx, sample) [sqrt(W)].
    statics
        The device's own paths.
    radar
        A waveform of one profile, with a slope: without one a transform does not tell delays apart.
    rng
        What the phase noise is drawn from.
    tx_weights
        (loop or 1, slot, tx) what each slot holds of each Tx element; None is one element a slot.

    Returns
    -------
    (chirp, tx, rx, sample) [sqrt(W)].
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
    # In the order of a transform: beat frequencies from zero up, then those below zero.
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
        # The error is small against the samples: single precision is exact enough for it, its phase apart.
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
    """(tx, rx, time) as the chirps `part` hold it: (chirp or 1, slot, rx, time)."""
    if tx_weights is None:
        return signal[None]
    weights = tx_weights if len(tx_weights) == 1 else tx_weights[part]
    return np.asarray(np.einsum("lat,trs->lars", weights.astype(signal.dtype), signal))


def _phase(radar: Radar, times: FloatArray, ramp: RampError | None, drawn: ComplexArray | None) -> FloatArray:
    """(..., time) phase error of the generator [rad]; `drawn` are Fourier coefficients of the noise at `times`."""
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
