"""Dechirped samples summed path by path and sample by sample, from the definition."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rfgen_sionna.radar import Radar
from rfgen_sionna.records import ComplexArray, FloatArray


def direct_sum(
    radar: Radar,
    delay: Callable[[FloatArray, int, int], FloatArray],
    gain: ComplexArray,
    start: float = 0.0,
) -> ComplexArray:
    """(chirp, tx, rx, sample) for `delay(times (n,), tx, rx) -> (path, n)` [s] and constant gains (tx, rx, path).

    The element pattern and the Tx power are left out.
    """
    waveform = radar.waveform
    t = waveform.sample_times
    shape = (waveform.num_loops, len(radar.tx_names), len(radar.rx_names), waveform.num_samples)
    out = np.empty(shape, dtype=complex)
    for chirp in range(shape[0]):
        for tx in range(shape[1]):
            for rx in range(shape[2]):
                tau = delay(start + waveform.chirp_times[chirp, tx] + t, tx, rx)
                cycles = waveform.start_frequency * tau + waveform.slope * t * tau - 0.5 * waveform.slope * tau**2
                phasor = np.exp(2j * np.pi * np.mod(cycles, 1.0))
                out[chirp, tx, rx] = (np.conj(gain[tx, rx])[:, None] * phasor).sum(axis=0)
    return out
