"""Dechirped samples summed path by path, Tx by Tx and sample by sample, from the definition."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rfgen_sionna._types import ComplexArray, FloatArray
from rfgen_sionna.radar import Radar


def direct_sum(
    radar: Radar,
    delay: Callable[[FloatArray, int, int], FloatArray],
    gain: ComplexArray,
    start: float = 0.0,
    course: Callable[[FloatArray], FloatArray] | None = None,
    offset: tuple[float, float] | None = None,
) -> ComplexArray:
    """(chirp, tx, rx, sample) for `delay(times (n,), tx, rx) -> (path, n)` [s] and gains (tx, rx, path).

    The gains are constant, or change by the factors `course(times) -> (path, n)`. With an `offset`, a frequency and
    half a band [Hz], they go with how far from that the frequency is at which what arrives was sent, over the half
    band.

    The element pattern and the Tx power are left out.
    """
    waveform = radar.waveform
    phases = [
        each or (0.0,) * count
        for each, count in ((radar.tx_phases_deg, gain.shape[0]), (radar.rx_phases_deg, gain.shape[1]))
    ]
    gain = gain * np.exp(1j * np.radians(np.add.outer(*phases)))[..., None]
    if waveform.slots:
        return _slot_by_slot(radar, delay, gain, start)
    t = waveform.sample_times
    shape = (waveform.num_loops, len(radar.tx_names), len(radar.rx_names), waveform.num_samples)
    out = np.empty(shape, dtype=complex)
    for chirp in range(shape[0]):
        for tx in range(shape[1]):
            for rx in range(shape[2]):
                tau = delay(start + waveform.chirp_times[chirp, tx] + t, tx, rx)
                cycles = waveform.start_frequency * tau + waveform.slope * t * tau - 0.5 * waveform.slope * tau**2
                phasor = np.exp(2j * np.pi * np.mod(cycles, 1.0))
                if offset is not None:
                    sent = waveform.start_frequency + waveform.slope * (t - tau)
                    phasor = phasor * (sent - offset[0]) / offset[1]
                if course is not None:
                    phasor = phasor * np.conj(course(start + waveform.chirp_times[chirp, tx] + t))
                out[chirp, tx, rx] = (np.conj(gain[tx, rx])[:, None] * phasor).sum(axis=0)
    return out


def _slot_by_slot(
    radar: Radar, delay: Callable[[FloatArray, int, int], FloatArray], gain: ComplexArray, start: float
) -> ComplexArray:
    """Slots one after the other, each a chirp of its profile that several Tx radiate, with the phases of the loop."""
    wave = radar.waveform
    loops, receivers, count = wave.num_loops, len(radar.rx_names), wave.num_samples
    out = np.zeros((loops, len(wave.slots), receivers, count), dtype=complex)
    now = start
    for loop in range(loops):
        for place, slot in enumerate(wave.slots):
            profile = wave.profiles[slot.profile]
            if (loop, place) != (0, 0):
                now += profile.idle_time
            t = profile.adc_start_time + np.arange(count) / profile.sample_rate
            for tx, phase in enumerate(slot.phases_deg):
                if phase is None:
                    continue
                turned = phase + loop * (slot.advance_deg[tx] if slot.advance_deg else 0.0)
                if wave.phase_step_deg:
                    turned = round(turned / wave.phase_step_deg) * wave.phase_step_deg
                for rx in range(receivers):
                    tau = delay(now + t, tx, rx)
                    cycles = profile.start_frequency * tau + profile.slope * t * tau - 0.5 * profile.slope * tau**2
                    # What is radiated with a phase is received with it, and the mixer conjugates what is received.
                    received = gain[tx, rx] * np.exp(1j * np.radians(turned))
                    phasor = np.exp(2j * np.pi * np.mod(cycles, 1.0))
                    out[loop, place, rx] += (np.conj(received)[:, None] * phasor).sum(axis=0)
            now += profile.ramp_end_time
    return out
