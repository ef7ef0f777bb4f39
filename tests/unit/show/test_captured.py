"""Pictures and summary of a capture: levels relative to full scale where it declares no scale."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rfgen_sionna.radar import Radar
from rfgen_sionna.records import AdcCube
from rfgen_sionna.show import sheet, summary
from rfgen_sionna.show.displayable import CapturedRun, power_unit
from rfgen_sionna.show.run_view import view_frame
from rfgen_sionna.signal.formats import open_capture, write_capture


def tone(radar, cycles):
    """A tone at full scale of the ADC, in every channel."""
    wave = np.exp(2j * np.pi * cycles * np.arange(radar.waveform.num_samples) / radar.waveform.num_samples)
    full = 2 ** (radar.adc.bits - 1) - 1
    values = full * (wave.real if radar.adc.real else wave)
    return np.broadcast_to(values, (2, *radar.frame_shape)).astype(radar.sample_type)


@pytest.mark.parametrize(("name", "capture_format"), [("awr1843", "dca1000"), ("bgt60tr13c", "infineon")])
def test_a_tone_at_full_scale_is_at_zero_decibels(tmp_path, name, capture_format):
    radar = Radar.load(name)
    radar = replace(radar, waveform=replace(radar.waveform, num_loops=8, num_samples=64))
    cube = AdcCube(tone(radar, 12), radar, 0.1 * np.arange(2))
    write_capture(cube, tmp_path, capture_format, scale=None)
    run = CapturedRun(open_capture(tmp_path))
    assert power_unit(run) == "dBFS"
    view = view_frame(run, 1)
    assert view.unit == "dBFS"
    assert view.range_doppler.max() == pytest.approx(0.0, abs=0.05)
    write_capture(cube, tmp_path, capture_format, full_scale_dbm=-10.0, overwrite=True, scale="auto")
    assert power_unit(CapturedRun(open_capture(tmp_path))) == "dBm"


def test_a_capture_is_drawn_and_summarised(tmp_path, small_radar):
    rng = np.random.default_rng(1)
    words = rng.integers(-100, 100, (3, *small_radar.frame_shape, 2)).astype(np.float32)
    cube = AdcCube(words.view(np.complex64)[..., 0], small_radar, 0.1 * np.arange(3))
    write_capture(cube, tmp_path, scale=1e-9)
    capture = open_capture(tmp_path)
    text = summary(capture)
    assert "dca1000: " in text
    assert "described by adc_data.mmwave.json, adc_data.setup.json, adc_data.rfgen" in text
    assert "1e-09 √W per LSB" in text
    assert "lost         nothing" in text
    assert sheet(capture, tmp_path / "sheet.png", dpi=40).stat().st_size > 5_000
