"""Samples behind the receiver: its impairments in their order, and its ADC."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._short_repr import ShortRepr
from rfgen_sionna._types import ComplexArray, FloatArray
from rfgen_sionna.radar import Adc, Radar
from rfgen_sionna.signal.noise import add_thermal_noise, check_whole, frame_stream, noise_power
from rfgen_sionna.signal.receiver.delay_phase_errors import generator_error
from rfgen_sionna.signal.receiver.receiver import Receiver
from rfgen_sionna.signal.receiver.receiver_record import ReceiverSource, read_receiver
from rfgen_sionna.signal.receiver.static_paths import static_paths, tone


def receive(
    samples: ComplexArray,
    radar: Radar,
    receiver: ReceiverSource,
    *,
    seed: int = 0,
    frame: int = 0,
    full_scale: float | None = None,
) -> ReceivedFrame:
    """Samples of one frame behind the receiver.

    Order: echoes, leakage and chassis, delayed by the range bias; the generator's ramp error and phase noise, by the
    delay of each path; Tx chains; interference; coupling of the Rx antennas; thermal noise; Rx chains; IQ imbalance or
    the real part; DC offset; ADC.

    Parameters
    ----------
    samples
        (chirp, tx, rx, sample) complex ones of :func:`~rfgen_sionna.signal.synthesize` [sqrt(W)], not modified; they
        include `receiver.tx_gains`.
    receiver
        A Receiver, a table of its parts or a TOML file with such a table
        (:func:`~rfgen_sionna.signal.receiver.receiver_record.read_receiver`).
    seed, frame
        Draws depend on these, on the radar's name and pose (at t = 0) and on the name of the impairment alone.
        Properties of the device (mismatch, phase of the DC offset, clocks of interferers) do not depend on `frame`.
    full_scale
        Range of an automatic ADC [sqrt(W)], such as that of the run's first frame; None sets it from this frame.

    Raises
    ------
    ValueError
        If the shape of the samples or the receiver does not fit `radar`, or the samples are real.
    """
    if samples.shape != radar.frame_shape:
        raise ValueError(f"samples have the shape {samples.shape}; radar '{radar.name}' makes {radar.frame_shape}")
    if radar.adc.real and np.isrealobj(samples):
        raise ValueError(f"samples are {samples.dtype}: the complex ones of synthesize are needed, also for a real ADC")
    seed, frame = check_whole("seed", seed), check_whole("frame", frame)
    receiver = read_receiver(receiver, radar)
    out = np.array(samples, dtype=np.complex128)
    wave = radar.waveform
    tx_gain, rx_gain = (None, None) if receiver.mismatch is None else receiver.mismatch.factors(radar, seed)
    for number in range(len(wave.profiles)):
        axis = list(wave.profile_axis(number)) if wave.other_profiles else slice(None)
        gains = None if tx_gain is None else tx_gain[list(wave.profile_tx(number))]
        out[:, axis] = _one_profile(out[:, axis], radar.of_profile(number), receiver, gains, seed, frame, number)
    if receiver.coupling is not None:
        out = receiver.coupling.apply(out)
    if receiver.thermal_noise:
        add_thermal_noise(out, radar, seed, frame)
    if rx_gain is not None:
        out *= rx_gain[:, None]
    if receiver.iq_imbalance is not None:
        out = receiver.iq_imbalance.apply(out, radar)
    received: ComplexArray | FloatArray = math.sqrt(2) * out.real if radar.adc.real else out
    if receiver.dc_offset is not None:
        received += receiver.dc_offset.offsets(radar, seed)[:, None]
    adc = receiver.converter(radar)
    return ReceivedFrame(received) if adc is None else convert(received, radar, adc, full_scale)


def _one_profile(
    samples: ComplexArray,
    radar: Radar,
    receiver: Receiver,
    tx_gains: ComplexArray | None,
    seed: int,
    frame: int,
    number: int,
) -> ComplexArray:
    """Static paths, generator, Tx chains and interference for the chirps of profile `number`; `samples` may change."""
    wave = radar.waveform
    together = bool(wave.slots) and not wave.separated
    weights = np.conj(wave.axis_weights) if together else None
    if weights is not None and tx_gains is not None:
        weights = weights * tx_gains
    if receiver.range_bias is not None:
        samples *= receiver.range_bias.phasor(radar)
    statics = static_paths(radar, receiver.leakage, receiver.chassis, receiver.range_bias)
    error = None
    if receiver.ramp_error is not None or receiver.phase_noise is not None:
        rng = frame_stream(seed, "phase_noise" + (f".{number}" if number else ""), frame, radar)
        error = generator_error(samples, statics, radar, receiver.ramp_error, receiver.phase_noise, rng, weights)
    for path in statics:
        signal = path.amplitude * tone(radar, wave.sample_times, path.delay)
        samples += signal if weights is None else np.einsum("lat,trs->lars", weights, signal)
    if error is not None:
        samples += error
    if tx_gains is not None and not together:
        samples *= tx_gains[:, None, None]
    for index, other in enumerate(receiver.interferers):
        samples += other.samples(radar, seed=seed, frame=frame, index=index, profile=number)
    return samples


AUTOMATIC_HEADROOM = 2.0
"""Least ratio of an automatic full scale to the largest I or Q, or real sample, that it is set from."""


@dataclass(frozen=True, repr=False)
class ReceivedFrame(ShortRepr):
    """Samples of one frame behind the receiver."""

    samples: ComplexArray | FloatArray
    """(chirp, tx, rx, sample) in square roots of watts at the receiver input; real ones of a real ADC."""
    adc: Adc | None = None
    """None for samples that are not quantised."""
    full_scale: float | None = None
    """Largest I or Q, or real sample, of the converters [sqrt(W)]; None for samples that are not quantised."""
    clipped: float = 0.0
    """Share of the converters' words beyond the range."""

    @property
    def lsb(self) -> float | None:
        """Step of the converters [sqrt(W)]; None for samples that are not quantised."""
        return None if self.adc is None or self.full_scale is None else self.full_scale / 2 ** (self.adc.bits - 1)

    @property
    def words(self) -> NDArray[np.int16] | NDArray[np.int32]:
        """(chirp, tx, rx, sample, 2) signed words of I and Q, or (chirp, tx, rx, sample) real ones: `samples` in units
        of `lsb`, exactly. Samples that are not quantised are a ValueError."""
        if self.adc is None or self.lsb is None:
            raise ValueError("capture.words: the receiver had no ADC (Receiver(adc=...))")
        parts = self.samples if self.adc.real else np.stack([self.samples.real, self.samples.imag], axis=-1)
        words = np.rint(parts / self.lsb)
        return words.astype(np.int16) if self.adc.bits <= 16 else words.astype(np.int32)


def convert(
    samples: ComplexArray | FloatArray, radar: Radar, adc: Adc, full_scale: float | None = None
) -> ReceivedFrame:
    """Round I and Q, or real samples, to the nearest of 2^bits steps, clipped to -2^(bits-1) … 2^(bits-1) - 1 steps.

    The range is that of `adc.full_scale_dbm`. An automatic range is `full_scale` [sqrt(W)]; without one, the power of
    two that leaves 6 to 12 dB above the largest I, Q or real one of these samples, or the noise. Samples are exact in
    float32.
    """
    if adc.full_scale_dbm is not None:
        full_scale = 10.0 ** ((adc.full_scale_dbm - 30) / 20) * (math.sqrt(2) if adc.real else 1.0)
    elif full_scale is None:
        peak = max(float(np.abs(part).max(initial=0.0)) for part in (samples.real, samples.imag))
        least = AUTOMATIC_HEADROOM * max(peak, noise_power(radar) ** 0.5, 1e-20)
        full_scale = 2.0 ** math.ceil(math.log2(least))
    half = 2 ** (adc.bits - 1)
    lsb = full_scale / half
    out, beyond = np.empty_like(samples), 0
    parts = [(samples, out)] if adc.real else [(samples.real, out.real), (samples.imag, out.imag)]
    for part, target in parts:
        words = np.rint(part / lsb) + 0.0  # words have no negative zero
        beyond += int(np.count_nonzero((words < -half) | (words > half - 1)))
        target[...] = np.clip(words, -half, half - 1) * lsb
    return ReceivedFrame(out, adc, full_scale, beyond / max(len(parts) * samples.size, 1))
