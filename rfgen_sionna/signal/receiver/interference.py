"""Chirps of another FMCW radar that cross the receiver's band.

After the mixer the other radar's chirp has the difference of the two ramps, f_b(t) = f(t) - f'(t - t'), which crosses
the IF band at the difference of the slopes: a burst of length B_if / |mu - mu'|. Bursts are computed on a finer grid,
filtered and decimated to the ADC's rate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._short_repr import ShortRepr
from rfgen_sionna._types import ComplexArray, FloatArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.signal.noise import device_stream, frame_stream
from rfgen_sionna.signal.receiver.value_checks import check_number, check_numbers

OVERSAMPLING = 8  # of the grid: room for the transition of the IF filter and the fade of a burst beyond it
IF_SHARE = 0.9
"""Default passband of the IF filter as a share of the complex sample rate."""
TRANSITION_SHARE = 0.1
"""Width of the filter's edges as a share of the sample rate."""
REJECTION_DB = 70.0  # of the IF filter's stopband, below the noise of usual bursts
_PAIRS = 256  # bursts at a time: bounds memory


@dataclass(frozen=True, repr=False)
class Interferer(ShortRepr):
    """Another FMCW radar in the surroundings, not synchronised with this one.

    Its direct one-way path counts, with a random phase of each ramp.
    """

    radar: Radar
    """Waveform, pose, power and element pattern of the other radar."""
    received_dbm: float | None = None
    """Power at an Rx port [dBm]; None takes Friis' equation, with patterns and polarisations of both radars."""
    start: float | None = None
    """Start of its first frame, from the start of the own first frame [s]; None draws one within its frame period."""
    if_band_hz: tuple[float, float] | None = None
    """Edges (-6 dB) of the receiver's IF band on the targets' side [Hz]; None takes 0 to 0.9 of the sample rate, for a
    real ADC 0.45 of it. A single mixer passes both sides alike."""

    def __post_init__(self) -> None:
        if not isinstance(self.radar, Radar):
            raise TypeError(f"interferer.radar is a {type(self.radar).__name__}: a Radar is needed")
        if self.received_dbm is not None:
            check_number("interferer.received_dbm", self.received_dbm, -250, 60, "dBm")
        if self.start is not None:
            check_number("interferer.start", self.start, -1e6, 1e6, "s")
        if self.if_band_hz is not None:
            band = check_numbers("interferer.if_band_hz", self.if_band_hz, -1e10, 1e10, "Hz")
            if len(band) != 2 or band[0] >= band[1]:
                raise ValueError(f"interferer.if_band_hz is {band!r}: two frequencies, the lower one first, are needed")
            object.__setattr__(self, "if_band_hz", band)

    def check(self, radar: Radar) -> None:
        """Raise if both radars have the same position, or the band does not fit the sample rate."""
        if math.dist(self.radar.position, radar.position) < 1e-3:
            raise ValueError(
                f"interferer.radar is at {self.radar.position} m, the position of the radar: another position is needed"
            )
        low, high = self.band(radar)
        rate = radar.waveform.sample_rate
        if radar.adc.real and (low < 0 or high > 0.5 * (1 - TRANSITION_SHARE) * rate * (1 + 1e-9)):
            raise ValueError(
                f"interferer.if_band_hz is {(low, high)!r}; radar '{radar.name}' has real samples (adc.real), 0 … "
                f"{0.5 * (1 - TRANSITION_SHARE) * rate:g} Hz fit its sample rate of {rate:g} Hz without aliases"
            )
        if high - low > (1 - TRANSITION_SHARE) * rate * (1 + 1e-9):
            raise ValueError(
                f"interferer.if_band_hz is {(low, high)!r}, {high - low:g} Hz wide; at most "
                f"{(1 - TRANSITION_SHARE) * rate:g} Hz fit the sample rate of {rate:g} Hz without aliases"
            )

    def band(self, radar: Radar) -> tuple[float, float]:
        """Edges of the IF band on the targets' side [Hz]."""
        return self.if_band_hz or (0.0, IF_SHARE * radar.waveform.sample_rate * (0.5 if radar.adc.real else 1.0))

    def direction(self, radar: Radar) -> FloatArray:
        """(3,) unit vector towards the other radar, in the device frame of `radar`."""
        line = np.subtract(self.radar.position, radar.position)
        return np.asarray(line / np.linalg.norm(line) @ radar.rotation)

    def amplitude(self, radar: Radar) -> float:
        """Amplitude at an Rx port [sqrt(W)]: P G G' (wavelength / 4 pi R)^2 times the cosine between both fields."""
        if self.received_dbm is not None:
            return float(10.0 ** ((self.received_dbm - 30) / 20))
        line = np.subtract(self.radar.position, radar.position)
        distance = float(np.linalg.norm(line))
        line = line / distance
        gains = float(radar.pattern.amplitude(line @ radar.rotation)) * float(
            self.radar.pattern.amplitude(-line @ self.radar.rotation)
        )
        fields = []
        for field in (radar.rx_field, self.radar.tx_field):
            across = field - (field @ line) * line
            fields.append(across / max(float(np.linalg.norm(across)), 1e-12))
        aligned = abs(float(fields[0] @ fields[1]))
        power = 1e-3 * 10.0 ** (self.radar.tx_power_dbm / 10)
        if slots := self.radar.waveform.slots:  # elements that radiate at once, with random phases on average
            power *= float(np.mean([len(slot.on) for slot in slots]))
        return math.sqrt(power) * gains * aligned * self.radar.wavelength / (4 * math.pi * distance)

    def samples(self, radar: Radar, *, seed: int, frame: int, index: int = 0, profile: int = 0) -> ComplexArray:
        """(chirp, tx, rx, sample) at the ADC of `radar`, of one profile [sqrt(W)].

        `seed`, `frame`, `index` of the interferer and number of the `profile` determine the draws.
        """
        name = f"interference.{index}"
        start = self.start
        if start is None:
            start = float(device_stream(seed, name, radar).uniform(0, self.radar.waveform.frame_period))
        rng = frame_stream(seed, name + (f".{profile}" if profile else ""), frame, radar)
        waveform = radar.waveform
        bursts = np.zeros((*waveform.chirp_times.shape, waveform.num_samples), dtype=np.complex128)
        for number in range(len(self.radar.waveform.profiles)):
            replace(self, radar=self.radar.of_profile(number))._add(bursts, radar, frame, start, rng)
        steering = np.exp(-2j * math.pi / radar.wavelength * (radar.rx_positions @ self.direction(radar)))
        steering = steering * np.conj(radar.feed_factors[1])
        return np.asarray(bursts[:, :, None, :] * steering[:, None])

    def _add(self, bursts: ComplexArray, radar: Radar, frame: int, start: float, rng: np.random.Generator) -> None:
        """Add the bursts of this radar's chirps, of one profile, to `bursts` (chirp, entry, sample)."""
        chirps, ramps = self._crossings(radar, frame * radar.waveform.frame_period - start)
        phases = rng.uniform(0, 2 * math.pi, len(chirps))
        flat = bursts.reshape(-1, bursts.shape[-1])
        amplitude = self.amplitude(radar)
        for first in range(0, len(chirps), _PAIRS):
            part = slice(first, first + _PAIRS)
            np.add.at(flat, chirps[part], amplitude * self._bursts(radar, ramps[part], phases[part]))

    def _crossings(self, radar: Radar, clock: float) -> tuple[NDArray[np.intp], FloatArray]:
        """Flat index of own chirps with a ramp in their band, and start of that ramp after the own one [s].

        `clock` is the start of the own frame after the other radar's first one [s].
        """
        own, other = radar.waveform, self.radar.waveform
        margin = _filter(radar, self.band(radar))[0]
        begin, end = own.adc_start_time - margin, own.adc_start_time + own.num_samples / own.sample_rate + margin
        starts = np.sort((np.arange(other.num_loops)[:, None] * other.loop_period + other.slot_times).ravel())
        starts = np.concatenate([starts + shift * other.frame_period for shift in (-1, 0, 1)])
        low, high = _span(radar, self.band(radar))
        chirps, ramps = [], []
        for chirp, t in enumerate(own.chirp_times.ravel() + clock):
            cycle = math.floor(t / other.frame_period) * other.frame_period
            local = starts + (cycle - t)
            local = local[(local + other.ramp_end_time > begin) & (local < end)]
            edges = np.stack([np.maximum(begin, local), np.minimum(end, local + other.ramp_end_time)])
            beat = _beat(radar, self.radar, edges, local)
            met = (beat.max(axis=0) > low) & (beat.min(axis=0) < high)
            chirps += [chirp] * int(met.sum())
            ramps += list(local[met])
        return np.array(chirps, dtype=np.intp), np.array(ramps, dtype=np.float64)

    def _bursts(self, radar: Radar, ramps: FloatArray, phases: FloatArray) -> ComplexArray:
        """(burst, sample) of unit amplitude, filtered."""
        from scipy.signal import oaconvolve

        own, other = radar.waveform, self.radar.waveform
        margin, taps = _filter(radar, self.band(radar))
        middle = _middle(radar, self.band(radar))
        rate = own.sample_rate * OVERSAMPLING
        lead = round(margin * rate)
        t = own.adc_start_time + np.arange(-lead, own.num_samples * OVERSAMPLING + lead) / rate
        since = t - ramps[:, None]
        # Cycles of the beat, less those of the band's middle, counted from the start of the own ramp.
        start = _beat(radar, self.radar, np.zeros(1), ramps[:, None]) - middle
        cycles = start * t + 0.5 * (own.slope - other.slope) * t**2
        offset = np.abs(_beat(radar, self.radar, t, ramps[:, None]) - middle)
        # Frequencies above the grid's limit fade out in the filter's stopband.
        flat, gone = 0.25 * rate, 0.5 * rate
        fade = 0.5 + 0.5 * np.cos(math.pi * np.clip((offset - flat) / (gone - flat), 0, 1))
        on = (since >= 0) & (since <= other.ramp_end_time)
        angle = 2 * math.pi * (cycles - np.rint(cycles)) + phases[:, None]
        chirp = on * fade * np.exp(1j * angle)
        filtered = oaconvolve(chirp, taps[None, :], mode="valid", axes=-1)
        filtered = filtered[:, : own.num_samples * OVERSAMPLING : OVERSAMPLING]
        return np.asarray(filtered * np.exp(2j * math.pi * middle * own.sample_times))


def _beat(radar: Radar, other: Radar, t: FloatArray, ramps: FloatArray) -> FloatArray:
    """Frequency after the mixer [Hz] at `t` after the start of the own ramp; the other ramp starts at `ramps` [s]."""
    own, their = radar.waveform, other.waveform
    return np.asarray(own.start_frequency + own.slope * t - their.start_frequency - their.slope * (t - ramps))


def _middle(radar: Radar, band: tuple[float, float]) -> float:
    """Middle of the band after the mixer [Hz]; 0 for a single mixer, which passes both sides."""
    return 0.0 if radar.adc.real else float(0.5 * (band[0] + band[1]) * np.sign(radar.waveform.slope or 1.0))


def _span(radar: Radar, band: tuple[float, float]) -> tuple[float, float]:
    """Frequency limits of the fine grid [Hz]."""
    middle = _middle(radar, band)
    half = 0.5 * radar.waveform.sample_rate * OVERSAMPLING
    return middle - half, middle + half


def _filter(radar: Radar, band: tuple[float, float]) -> tuple[float, FloatArray]:
    """Half the length [s] and the taps of the filter about the middle of the band, on the fine grid: a low-pass, or a
    band-pass on both sides of zero for a single mixer."""
    from scipy.signal import firwin, kaiserord

    rate = radar.waveform.sample_rate * OVERSAMPLING
    count, beta = kaiserord(REJECTION_DB, 2 * TRANSITION_SHARE / OVERSAMPLING)
    count |= 1
    if radar.adc.real:
        edges = (band[1],) if band[0] == 0 else band
        taps = firwin(count, edges, window=("kaiser", beta), fs=rate, pass_zero=len(edges) == 1)
    else:
        taps = firwin(count, 0.5 * (band[1] - band[0]), window=("kaiser", beta), fs=rate)
    return (count // 2) / rate, np.asarray(taps)
