"""From paths to the samples of a radar's ADC."""

from rfgen_sionna.signal.noise import add_thermal_noise, noise_power
from rfgen_sionna.signal.synthesis import synthesize

__all__ = ["add_thermal_noise", "noise_power", "synthesize"]
