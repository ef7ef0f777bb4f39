"""Configurations as makers ship them give the presets of the boards: TI's demo profiles, Infineon's config.json."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rfgen_sionna.radar import Radar
from tests.unit.signal.formats.captures import BGT60_SHAPE

DEMO = """\
% Platform:{platform}
sensorStop
flushCfg
dfeDataOutputMode 1
channelCfg 15 {tx_mask} 0
adcCfg 2 {adc}
adcbufCfg -1 {real} 1 1 1
lowPower 0 0
{profile}
{chirps}
{frame}
guiMonitor -1 1 1 0 0 0 1
cfarCfg -1 0 2 8 4 3 0 15 1
clutterRemoval -1 0
lvdsStreamCfg -1 0 1 0
sensorStart
"""


def demo(platform: str, profile: str, tx_masks: list[int], frame: str, real: bool = False) -> str:
    """TI's demo configuration: one chirp for each Tx mask, in this order."""
    return DEMO.format(
        platform=platform,
        tx_mask=sum(tx_masks),
        adc=0 if real else 1,
        real=int(real),
        profile=f"profileCfg {profile}",
        chirps="\n".join(f"chirpCfg {slot} {slot} 0 0 0 0 0 {mask}" for slot, mask in enumerate(tx_masks)),
        frame=f"frameCfg {frame}",
    )


SIXTY = "0 60 359 7 57.14 0 0 70 1 256 5209 0 0 158"
CONFIGURATIONS = {
    ("iwr6843isk", "out_of_box"): demo("xWR68xx", SIXTY, [1, 4, 2], "0 2 16 0 100 1 0"),
    ("iwr6843isk_ods", "out_of_box"): demo("xWR68xx", SIXTY, [1, 2, 4], "0 2 16 0 100 1 0"),
    ("iwr6843aop", "out_of_box"): demo("xWR68xx_AOP", SIXTY, [1, 2, 4], "0 2 16 0 100 1 0"),
    ("iwr1443boost", "out_of_box"): demo(
        "xWR14xx", "0 77 429 7 57.14 0 0 70 1 240 4884 0 0 30", [1, 4, 2], "0 2 16 0 100 1 0"
    ),
    ("awr1642boost", "out_of_box"): demo(
        "xWR16xx", "0 77 429 7 57.14 0 0 70 1 256 5209 0 0 30", [1, 2], "0 1 16 0 100 1 0"
    ),
    ("awr2944evm", "out_of_box"): demo(
        "AWR294X", "0 77 267 7 57.14 0 0 70 1 560 11396 0 0 158", [1, 4, 2], "0 2 16 20 560 100 1 0", real=True
    ),
}
BREATHING = {"device_config": {"fmcw_single_shape": BGT60_SHAPE}}


def same_radar(found: Radar, wanted: Radar) -> None:
    """Elements, feeds and waveform of two radars, whatever they are called."""
    assert (found.tx_names, found.rx_names) == (wanted.tx_names, wanted.rx_names)
    np.testing.assert_array_equal(found.virtual_positions, wanted.virtual_positions)
    assert (found.tx_phases_deg, found.rx_phases_deg) == (wanted.tx_phases_deg, wanted.rx_phases_deg)
    assert (replace(found.adc, iq_swap=False), found.tx_power_dbm, found.noise_figure_db) == (
        wanted.adc,
        wanted.tx_power_dbm,
        wanted.noise_figure_db,
    )
    here, there = found.waveform, wanted.waveform
    assert (here.num_samples, here.num_loops, here.tx_order) == (there.num_samples, there.num_loops, there.tx_order)
    for field in ("start_frequency", "slope", "sample_rate", "idle_time", "adc_start_time", "ramp_end_time"):
        assert getattr(here, field) == pytest.approx(getattr(there, field), rel=1e-6), field
    assert here.frame_period == pytest.approx(there.frame_period, rel=1e-6)
    np.testing.assert_allclose(here.chirp_times, there.chirp_times, rtol=1e-6)


@pytest.mark.parametrize(("name", "preset"), CONFIGURATIONS)
def test_the_demo_s_configuration_is_the_preset(tmp_path: Path, name: str, preset: str) -> None:
    path = tmp_path / "profile.cfg"
    path.write_text(CONFIGURATIONS[name, preset])
    same_radar(Radar.load(path, board=name), Radar.load(name, preset))


def test_infineon_s_configuration_is_the_preset(tmp_path: Path) -> None:
    path = tmp_path / "config.json"
    path.write_text(json.dumps(BREATHING))
    same_radar(Radar.load(path), Radar.load("bgt60tr13c", "breathing"))


@pytest.mark.parametrize(
    ("name", "preset"),
    [*CONFIGURATIONS, ("iwr6843isk", "people_tracking"), ("awr1642boost", "bpm"), ("awr2944evm", "four_tx")],
)
def test_a_preset_comes_back_from_its_own_configuration(tmp_path: Path, name: str, preset: str) -> None:
    radar: Any = Radar.load(name, preset)
    path = tmp_path / "mine.cfg"
    path.write_text(radar.to_cfg())
    again = Radar.load(path, board=name)
    assert again.waveform.multiplexing == radar.waveform.multiplexing
    np.testing.assert_allclose(again.waveform.axis_weights, radar.waveform.axis_weights, atol=1e-12)
    same_radar(again, radar)
