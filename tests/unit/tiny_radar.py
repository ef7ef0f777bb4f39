"""Text of a radar that is quick to simulate."""

from __future__ import annotations

import re

from rfgen_sionna.resources import resolve


def tiny_radar_text() -> str:
    """The shipped radar with 8 loops of 2 Tx, 4 Rx and 64 samples, 20 times a second, as preset "tiny"."""
    text = resolve("radars", "awr1843").read_text(encoding="utf-8")
    start, stop = text.index("[preset.mmmesh]"), text.rindex("[source]")
    preset = """[preset.tiny]
start_frequency_hz = 77.0e9
slope_hz_per_s = 60.012e12
sample_rate_hz = 4.4e6
num_samples = 64
idle_time_s = 7.0e-6
adc_start_time_s = 6.0e-6
ramp_end_time_s = 25.0e-6
num_loops = 8
tx_order = ["TX1", "TX3"]
frame_period_s = 0.05

"""
    text = text[:start] + preset + text[stop:]
    text = re.sub(r'"preset\.\w+" = .*\n', "", text) + '"preset.tiny" = "made up for tests"\n'
    return text.replace('default_preset = "mmmesh"', 'default_preset = "tiny"').replace('"awr1843"', '"tiny"', 1)
