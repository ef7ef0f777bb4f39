"""Radars: configuration, element patterns, derived limits. Pure NumPy."""

from rfgen_sionna.radar.adc import Adc
from rfgen_sionna.radar.pattern import ElementPattern, NamedPattern
from rfgen_sionna.radar.pattern_table import TablePattern
from rfgen_sionna.radar.pose import Trajectory
from rfgen_sionna.radar.profile import Profile
from rfgen_sionna.radar.radar import Radar
from rfgen_sionna.radar.slots import Slot
from rfgen_sionna.radar.waveform import Waveform

__all__ = [
    "Adc",
    "ElementPattern",
    "NamedPattern",
    "Profile",
    "Radar",
    "Slot",
    "TablePattern",
    "Trajectory",
    "Waveform",
]
