"""Radars: configuration, element patterns, derived limits. Pure NumPy."""

from rfgen_sionna.radar.adc import Adc
from rfgen_sionna.radar.pattern import ElementPattern
from rfgen_sionna.radar.radar import Radar
from rfgen_sionna.radar.waveform import Waveform

__all__ = ["Adc", "ElementPattern", "Radar", "Waveform"]
