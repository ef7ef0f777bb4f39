"""Radars written as TI's `.cfg`: a board gets the simulated frame, or the field that it cannot have is named."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rfgen_sionna.radar import Profile, Radar, Slot
from rfgen_sionna.radar.config import RadarConfigError

WRITTEN = [
    (name, preset)
    for name, presets in Radar.available().items()
    for preset in presets
    if re.match("[ai]wr", name) and preset != "ddm"
]

LONG = {"slope": 1e12, "ramp_end_time": 600e-6, "num_loops": 4, "frame_period": 0.5}


def again(radar: Radar, folder: Path) -> Radar:
    """The radar through its `.cfg`."""
    path = folder / "written.cfg"
    path.write_text(radar.to_cfg(), encoding="utf-8")
    return Radar.load(path, board=radar.name)


@pytest.mark.parametrize(("name", "preset"), WRITTEN)
def test_a_written_configuration_gives_the_same_frame(name: str, preset: str, tmp_path: Path) -> None:
    radar = Radar.load(name, preset)
    found = again(radar, tmp_path)
    assert found.waveform == radar.waveform
    assert (found.tx_names, found.rx_names, found.adc) == (radar.tx_names, radar.rx_names, radar.adc)


def test_the_text_is_that_of_the_board(tmp_path: Path) -> None:
    lines = Radar.load("awr1843").to_cfg().splitlines()
    commands = [line for line in lines if not line.startswith("%")]
    assert commands[:10] == [
        "sensorStop",
        "flushCfg",
        "dfeDataOutputMode 1",
        "channelCfg 15 7 0",
        "adcCfg 2 1",
        "adcbufCfg -1 0 1 1 1",
        "profileCfg 0 77 7 6 65 0 0 60.012 1 256 4400 0 0 30",
        "chirpCfg 0 0 0 0 0 0 0 1",
        "chirpCfg 1 1 0 0 0 0 0 4",
        "chirpCfg 2 2 0 0 0 0 0 2",
    ]
    assert "frameCfg 0 2 128 0 100 1 0" in commands
    assert commands[-1] == "sensorStart"


def test_steps_of_the_device_are_stated() -> None:
    """3.6 GHz / 2**26 for the start frequency at 77 GHz, 900 of them a microsecond for the slope."""
    lines = Radar.load("awr1843").to_cfg().splitlines()
    (slope,) = [line for line in lines if "slope" in line]
    step = 3.6e9 / 2**26 * 900e-6  # [MHz/us]
    assert f"slope 60.012 MHz/us; the device takes {1243 * step:.6f}" in slope
    assert "in steps of 0.048280" in slope
    finer = Radar.load("iwr6843isk").to_cfg()
    assert "steps of 0.036210" in finer


def test_turned_feeds_are_undone_by_the_board() -> None:
    """The factors that TI's demonstration needs on the ODS: those of two receivers of each Tx are -1."""
    (line,) = [line for line in Radar.load("iwr6843isk_ods").to_cfg().splitlines() if line.startswith("compRangeBias")]
    factors = np.array(line.split()[2:], dtype=float).reshape(3, 4, 2)
    np.testing.assert_array_equal(factors[..., 1], 0)
    assert sorted(factors[0, :, 0]) == [-1, -1, 1, 1]
    assert "-0" not in line.split()
    plain = Radar.load("awr1642boost").to_cfg()
    assert "compRangeBiasAndRxChanPhase 0.0" + " 1 0" * 8 + "\n" in plain


def test_ddm_of_the_mcu_plus_demonstration(tmp_path: Path) -> None:
    """TX1, TX3, TX4, TX2 turn by multiples of -60 degrees: the order is that of ddmPhaseShiftAntOrder."""
    radar = Radar.load("awr2944evm", "four_tx")
    slot = Slot((0.0,) * 4, advance_deg=(0.0, -180.0, -60.0, -120.0))
    radar = replace(radar, waveform=replace(radar.waveform, tx_order=(), slots=(slot,), num_loops=96))
    text = radar.to_cfg()
    assert "ddmPhaseShiftAntOrder 0 2 3 1" in text
    assert "chirpCfg 0 5 0 0 0 0 0 15" in text
    assert f"frameCfg 0 5 16 0 {radar.waveform.num_samples} " in text
    found = again(radar, tmp_path)
    np.testing.assert_allclose(np.mod(found.waveform.slots[0].advance_deg, 360), [0, 180, 300, 240])
    assert replace(found.waveform, slots=radar.waveform.slots) == radar.waveform


def test_real_samples_of_a_device_of_sdk_3(tmp_path: Path) -> None:
    radar = Radar.load("awr1843")
    radar = replace(radar, adc=replace(radar.adc, real=True))
    text = radar.to_cfg()
    assert "adcCfg 2 0\nadcbufCfg -1 1 1 1 1\n" in text
    assert "frameCfg 0 2 128 0 100 1 0\n" in text
    assert again(radar, tmp_path).adc.real


def test_power_below_the_boards_is_written_in_steps_of_1_db(tmp_path: Path) -> None:
    lower = replace(Radar.load("awr1843"), tx_power_dbm=9.0)
    assert f"65 {3 | 3 << 8 | 3 << 16} 0 60.012" in lower.to_cfg()
    assert again(lower, tmp_path).tx_power_dbm == 9.0
    odd = replace(lower, tx_power_dbm=13.5).to_cfg()
    assert "the Tx power is +1.5 dB from the board's" in odd
    assert "65 0 0 60.012" in odd


def test_long_frames_are_loops_of_more_chirps(tmp_path: Path) -> None:
    """A loop counter of eight bits: 1,000 chirps are 250 loops of four."""
    radar = Radar.load("awr1843", "mmmesh")
    wave = replace(radar.waveform, tx_order=(0,), num_loops=1000)
    radar = replace(radar, waveform=wave, tx_names=("TX1",), tx_positions=radar.tx_positions[:1])
    assert "frameCfg 0 3 250 0 100 1 0" in radar.to_cfg()
    assert again(radar, tmp_path).waveform == wave


def test_more_profiles_than_a_device_has_are_variations(tmp_path: Path) -> None:
    radar = Radar.load("awr1843", "mmmesh")
    wave = radar.waveform
    first = wave.profiles[0]
    others = tuple(
        replace(first, idle_time=idle, start_frequency=77e9 + 1e6 * number)
        for number, idle in enumerate((7.5e-6, 9e-6, 12.25e-6, 20e-6), start=1)
    )
    slots = tuple(Slot((0.0,), profile) for profile in range(5))
    wave = replace(wave, tx_order=(), slots=slots, other_profiles=others, num_loops=64)
    radar = replace(radar, waveform=wave, tx_names=("TX1",), tx_positions=radar.tx_positions[:1])
    text = radar.to_cfg()
    assert text.count("profileCfg") == 1
    assert "chirpCfg 3 3 0 3000000 0 5.25 0 1" in text
    assert again(radar, tmp_path).waveform == wave


def ddm(step: float) -> Slot:
    """Three Tx whose phases advance by multiples of `step` degrees a chirp."""
    return Slot((0.0, 0.0, 0.0), advance_deg=(0.0, step, 2 * step))


TWO = Slot((0.0, 45.0, None)), Slot((None, None, 0.0))


@pytest.mark.parametrize(
    ("name", "changes", "said"),
    [
        ("bgt60tr13c", {}, "radar 'bgt60tr13c' is not of TI"),
        ("mmwcas", {}, "the largest Tx number is 12"),
        ("awr1843", {"sample_rate": 1e6, "num_samples": 32}, "waveform.sample_rate is 1 Msps"),
        ("awr1843", {"frame_period": 1.5}, "waveform.frame_period [s] is 1.5"),
        ("awr1843", {"sample_rate": 20e6}, "waveform.sample_rate is 20 Msps; 'awr1843' has 2 … 12.5 Msps of complex"),
        ("awr1642boost", {"sample_rate": 10e6}, "waveform.sample_rate is 10 Msps; 'awr1642boost' has 2 … 6.25 Msps"),
        ("iwr1443boost", {"sample_rate": 18.76e6}, "'iwr1443boost' has 2 … 18.75 Msps of complex samples"),
        ("awr2944evm", {"sample_rate": 40e6}, "'awr2944evm' has 2 … 37.5 Msps of real samples"),
        ("awr1843", LONG | {"num_samples": 1025}, "num_samples is 1025; the buffer of a device of TI has 1024 complex"),
        ("awr2944evm", LONG | {"num_samples": 2049}, "buffer of a device of TI has 2048 real samples of 4 receivers"),
        ("awr1843", {"slope": 120e12, "num_samples": 100}, "waveform.slope is 120 MHz/us; 'awr1843' has at most 100"),
        ("awr1843", {"idle_time": 6e-3, "num_loops": 2}, "waveform.idle_time is 6000 us"),
        ("awr1843", {"slot_starts": (0.0, 80e-6, 160e-6), "loop_time": 300e-6}, "sets slot_starts or loop_time"),
        ("awr1843", {"tx_order": (), "slots": TWO}, "waveform.slots have the phases [{1: 0.0, 2: 45.0}]"),
        ("awr1843", {"num_loops": 457}, "waveform.num_loops is 457 of 3 chirps"),
        (
            "awr1843",
            {"tx_order": (), "slots": (ddm(90.0),)},
            "waveform.slots advance phases (DDM), and samples are complex",
        ),
        (
            "awr2944evm",
            {"tx_order": (), "slots": (ddm(90.0),), "num_loops": 16},
            "waveform.slots[0].advance_deg is [0.0, 90.0, 180.0]; TI's DDM demonstration turns",
        ),
        (
            "awr2944evm",
            {"tx_order": (), "slots": (ddm(-90.0),), "num_loops": 18},
            "waveform.num_loops is 18; the DDM demonstration needs a multiple of 4",
        ),
        (
            "awr1843",
            {
                "tx_order": (),
                "slots": tuple(Slot((0.0, 0.0, 0.0), number) for number in range(6)),
                "other_profiles": tuple(Profile(77e9, 60e12, 5e6 + 1e5 * n, 7e-6, 6e-6, 60e-6) for n in range(5)),
                "num_loops": 8,
            },
            "6 profiles of different sample rates or ramps",
        ),
    ],
)
def test_frames_that_no_board_has_are_named(name: str, changes: dict[str, Any], said: str) -> None:
    radar = Radar.load(name)
    radar = replace(radar, waveform=replace(radar.waveform, **changes))
    with pytest.raises(RadarConfigError) as caught:
        radar.to_cfg()
    assert said in str(caught.value)
