"""Profile of a chirp: the ramp and its ADC window."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray


def is_number(value: Any) -> bool:
    """Whether `value` is a finite real number and no bool."""
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # an integer above float64
        return False


@dataclass(frozen=True)
class Profile:
    """A chirp: `idle_time` of silence, then a ramp of `ramp_end_time`. ADC times count from the start of the ramp."""

    start_frequency: float
    """Frequency at the start of the ramp [Hz]."""
    slope: float
    """[Hz/s]; negative sweeps downwards, 0 is a constant frequency (CW)."""
    sample_rate: float
    """Samples per second, complex or real ones [Hz]."""
    idle_time: float
    """[s]"""
    adc_start_time: float
    """[s]"""
    ramp_end_time: float
    """[s]"""

    def check(self, num_samples: int, what: str) -> None:
        """Check the fields for `num_samples` samples; `what` names the profile in errors.

        Raises
        ------
        ValueError
            A field is out of range, or the ADC window exceeds the ramp.
        """
        for name in ("start_frequency", "sample_rate", "ramp_end_time"):
            value = getattr(self, name)
            if not (is_number(value) and value > 0):
                raise ValueError(f"{what}.{name} is {value!r}: a positive, finite number is needed")
        if not is_number(self.slope):
            raise ValueError(
                f"{what}.slope is {self.slope!r}: a finite number [Hz/s] is needed, negative for a ramp downwards, "
                "0 for a constant frequency"
            )
        for name in ("idle_time", "adc_start_time"):
            value = getattr(self, name)
            if not (is_number(value) and value >= 0):
                raise ValueError(f"{what}.{name} is {value!r}: a finite number [s] of at least 0 is needed")
        adc_end = self.adc_start_time + num_samples / self.sample_rate
        if adc_end > self.ramp_end_time * (1 + 1e-9):
            raise ValueError(
                f"{what}: the ADC window ends at {adc_end * 1e6:.2f} us ({num_samples} samples at "
                f"{self.sample_rate / 1e6:g} Msps from {self.adc_start_time * 1e6:g} us), after ramp_end_time "
                f"{self.ramp_end_time * 1e6:g} us: at most "
                f"{max(0, int((self.ramp_end_time - self.adc_start_time) * self.sample_rate))} samples fit"
            )
        if self.start_frequency + self.slope * self.ramp_end_time <= 0:
            raise ValueError(
                f"{what}: the ramp ends at {self.start_frequency + self.slope * self.ramp_end_time:g} Hz "
                f"(start_frequency {self.start_frequency:g}, slope {self.slope:g}, ramp_end_time "
                f"{self.ramp_end_time:g}): a positive frequency is needed"
            )

    @property
    def chirp_period(self) -> float:
        """Idle time and ramp [s]."""
        return self.idle_time + self.ramp_end_time

    def sampled_band(self, num_samples: int) -> tuple[float, float]:
        """Lowest and highest frequency during the ADC window [Hz]."""
        first = self.start_frequency + self.slope * self.adc_start_time
        last = first + self.slope * num_samples / self.sample_rate
        return min(first, last), max(first, last)

    def sample_times(self, num_samples: int) -> FloatArray:
        """(sample,) times after the start of the ramp [s]."""
        return self.adc_start_time + np.arange(num_samples) / self.sample_rate

    @property
    def range_window(self) -> float:
        """Range whose beat frequency equals the sample rate [m]; infinite without a slope."""
        return self.sample_rate * SPEED_OF_LIGHT / (2 * abs(self.slope)) if self.slope else float("inf")
