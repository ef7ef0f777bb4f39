"""FMCW chirps and how they fill a frame."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rfgen_sionna.records import SPEED_OF_LIGHT, FloatArray


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float, np.number)) and not isinstance(value, bool) and bool(np.isfinite(value))


def _is_index(value: object) -> bool:
    return isinstance(value, (int, np.integer)) and not isinstance(value, bool)


@dataclass(frozen=True)
class Waveform:
    """A TDM-MIMO frame of linear chirps. Times count from the start of each ramp.

    A chirp is `idle_time` of silence followed by a ramp of `ramp_end_time`; the ADC takes `num_samples` from
    `adc_start_time` on. One loop fires `tx_order` slot by slot; a frame is `num_loops` loops.
    """

    start_frequency: float
    """Frequency at the start of the ramp [Hz]."""
    slope: float
    """[Hz/s]"""
    sample_rate: float
    """Complex samples per second [Hz]."""
    num_samples: int
    idle_time: float
    """[s]"""
    adc_start_time: float
    """[s]"""
    ramp_end_time: float
    """[s]"""
    num_loops: int
    tx_order: tuple[int, ...]
    """Tx index fired in each slot of a loop; every Tx of the radar fires exactly once."""
    frame_period: float
    """[s]"""

    def __post_init__(self) -> None:
        for name in ("start_frequency", "slope", "sample_rate", "ramp_end_time", "frame_period"):
            value = getattr(self, name)
            if not (_is_number(value) and value > 0):
                raise ValueError(f"waveform.{name} is {value!r}: a positive, finite number is needed")
        for name in ("idle_time", "adc_start_time"):
            value = getattr(self, name)
            if not (_is_number(value) and value >= 0):
                raise ValueError(f"waveform.{name} is {value!r}: a finite number [s] of at least 0 is needed")
        for name in ("num_samples", "num_loops"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < 1:
                raise ValueError(f"waveform.{name} is {value!r}: a whole number of at least 1 is needed")
        fired = list(self.tx_order)
        if not fired or not all(_is_index(tx) for tx in fired) or sorted(fired) != list(range(len(fired))):
            raise ValueError(
                f"waveform.tx_order is {self.tx_order!r}: each of the Tx elements 0..n-1 must fire exactly once a loop"
            )
        object.__setattr__(self, "tx_order", tuple(int(tx) for tx in fired))
        adc_end = self.adc_start_time + self.num_samples / self.sample_rate
        if adc_end > self.ramp_end_time * (1 + 1e-9):
            raise ValueError(
                f"waveform: the ADC window ends at {adc_end * 1e6:.2f} us ({self.num_samples} samples at "
                f"{self.sample_rate / 1e6:g} Msps from {self.adc_start_time * 1e6:g} us), after ramp_end_time "
                f"{self.ramp_end_time * 1e6:g} us: at most "
                f"{int((self.ramp_end_time - self.adc_start_time) * self.sample_rate)} samples fit"
            )
        if self.frame_length > self.frame_period * (1 + 1e-9):
            raise ValueError(
                f"waveform.frame_period is {self.frame_period * 1e3:g} ms but {self.num_loops} loops of "
                f"{len(self.tx_order)} slots of {self.chirp_period * 1e6:g} us take {self.frame_length * 1e3:.3f} ms: "
                f"lengthen the period or take at most {int(self.frame_period / self.loop_period)} loops"
            )

    @property
    def num_slots(self) -> int:
        return len(self.tx_order)

    @property
    def chirp_period(self) -> float:
        """Start of one ramp to the start of the next [s]."""
        return self.idle_time + self.ramp_end_time

    @property
    def loop_period(self) -> float:
        """Time between two ramps of the same Tx [s]."""
        return self.num_slots * self.chirp_period

    @property
    def frame_length(self) -> float:
        """Time that the chirps of a frame take, idle times included [s]."""
        return self.num_loops * self.loop_period

    @property
    def bandwidth(self) -> float:
        """Bandwidth swept during the ADC window [Hz]."""
        return self.slope * self.num_samples / self.sample_rate

    @property
    def center_frequency(self) -> float:
        """Instantaneous frequency in the middle of the ADC window [Hz]."""
        return self.start_frequency + self.slope * (self.adc_start_time + 0.5 * self.num_samples / self.sample_rate)

    @property
    def wavelength(self) -> float:
        """At `center_frequency` [m]."""
        return SPEED_OF_LIGHT / self.center_frequency

    @cached_property
    def sample_times(self) -> FloatArray:
        """(sample,) times of the samples after the start of the ramp [s]."""
        return self.adc_start_time + np.arange(self.num_samples) / self.sample_rate

    @cached_property
    def chirp_times(self) -> FloatArray:
        """(chirp, tx) start of each ramp after the start of the frame's first ramp [s]."""
        slot = np.argsort(self.tx_order)
        return np.arange(self.num_loops)[:, None] * self.loop_period + slot[None, :] * self.chirp_period

    @property
    def range_resolution(self) -> float:
        """c / 2B [m]"""
        return SPEED_OF_LIGHT / (2 * self.bandwidth)

    @property
    def max_range(self) -> float:
        """Range whose beat frequency equals the complex sample rate [m]."""
        return self.sample_rate * SPEED_OF_LIGHT / (2 * self.slope)

    @property
    def velocity_resolution(self) -> float:
        """wavelength / (2 loops loop_period) [m/s]"""
        return self.wavelength / (2 * self.num_loops * self.loop_period)

    @property
    def max_velocity(self) -> float:
        """Largest unambiguous |radial velocity|, wavelength / (4 loop_period) [m/s]."""
        return self.wavelength / (4 * self.loop_period)
