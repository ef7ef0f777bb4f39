"""Radar files are read strictly: what is not understood, missing or impossible is refused with its name and value."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rfgen_sionna.radar import Adc, Radar
from rfgen_sionna.radar.config import RadarConfigError

Refuses = Callable[..., None]


def test_a_file_of_ones_own_is_a_radar(radar_file: Any) -> None:
    radar_file.set("name", "mine")
    radar_file.set("preset.mmmesh.num_loops", 16)
    for path in (radar_file.path, str(radar_file.path)):
        radar_file.load()
        radar = Radar.load(path, position=(1, 2, 3))
        assert (radar.name, radar.preset, radar.waveform.num_loops) == ("mine", "mmmesh", 16)
        assert radar.position == (1.0, 2.0, 3.0)
    assert radar_file.load("di_gesture").waveform.num_loops == 64


def test_positions_are_in_half_wavelengths_of_the_design_frequency(radar_file: Any) -> None:
    radar_file.set("array.design_frequency_hz", 299_792_458.0 * 250)  # a wavelength of 4 mm
    radar = radar_file.load()
    np.testing.assert_allclose(radar.rx_positions[:, 1], [-9.4e-3, -7.4e-3, -5.4e-3, -3.4e-3], rtol=1e-12)
    np.testing.assert_allclose(radar.tx_positions[1], [0, 6.4e-3, 2e-3], rtol=1e-12)


@pytest.mark.parametrize("section", ["", "array.", "pattern.", "transmitter.", "receiver.", "preset.mmmesh."])
def test_unknown_keys_are_refused_with_the_known_ones(radar_file: Any, refuses: Refuses, section: str) -> None:
    radar_file.set(f"{section}loudness", 3)
    known = {"": "default_preset", "array.": "rx_names", "preset.mmmesh.": "num_loops"}.get(section, "_")
    refuses(f"unknown key '{section}loudness'", known)


@pytest.mark.parametrize(
    "key",
    [
        *("name", "default_preset", "array", "pattern", "preset", "array.tx_names", "pattern.azimuth_db"),
        *("transmitter.power_dbm", "receiver.noise_figure_db", "preset.mmmesh.slope_hz_per_s"),
        "preset.di_gesture.num_loops",
    ],
)
def test_missing_keys_are_named(radar_file: Any, refuses: Refuses, key: str) -> None:
    radar_file.remove(key)
    refuses(f"'{key}' is missing")


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("name", 7, "str"),
        ("preset.mmmesh.num_loops", 128.0, "int"),
        ("preset.mmmesh.num_loops", True, "int"),
        ("preset.mmmesh.slope_hz_per_s", "60.012e12", "int or float"),
        ("preset.mmmesh.slope_hz_per_s", float("nan"), "finite"),
        ("preset.mmmesh.tx_order", [1, 3, 2], "str"),
        ("transmitter.power_dbm", float("inf"), "finite"),
        ("transmitter.frequency_range_hz", [76e9], "two positive frequencies"),
        ("transmitter.frequency_range_hz", [81e9, 76e9], "two positive frequencies"),
        ("transmitter.frequency_range_hz", ["76 GHz", "81 GHz"], "int or float"),
        ("receiver.temperature_k", -20.0, "0 … 2000 K"),
        ("array.tx_names", "TX1", "list"),
        ("array.polarization", "circular", "V, H, +45, -45"),
        ("array.rx_positions_half_wavelengths", [[0, 0, 0], [0, 1], [0, 2, 0], [0, 3, 0]], "three numbers"),
        ("array.rx_positions_half_wavelengths", [0, 1, 2, 3], "list"),
        ("pattern.azimuth_db", [0.0, -3.0], "same length"),
        ("preset.mmmesh", 3, "table"),
        ("source.preset", 3, "text"),
        ("source", "TI", "dict"),
    ],
)
def test_values_of_the_wrong_kind_are_refused(
    radar_file: Any, refuses: Refuses, key: str, value: Any, said: str
) -> None:
    radar_file.set(key, value)
    refuses(said)


@pytest.mark.parametrize("factor", [1e3, 1e-3])
@pytest.mark.parametrize(
    "key",
    [
        *("start_frequency_hz", "slope_hz_per_s", "sample_rate_hz", "idle_time_s", "adc_start_time_s"),
        *("ramp_end_time_s", "frame_period_s"),
    ],
)
@pytest.mark.parametrize("preset", ["mmmesh", "di_gesture"])
def test_units_off_by_a_prefix_are_noticed(radar_file: Any, preset: str, key: str, factor: float) -> None:
    radar_file.set(f"preset.{preset}.{key}", radar_file.table["preset"][preset][key] * factor)
    with pytest.raises(RadarConfigError, match=f"{preset}.*"):
        radar_file.load(preset)


@pytest.mark.parametrize("factor", [1e3, 1e-3])
def test_a_design_frequency_off_by_a_prefix_is_noticed(radar_file: Any, refuses: Refuses, factor: float) -> None:
    radar_file.set("array.design_frequency_hz", 77e9 * factor)
    refuses("array.design_frequency_hz", "1e9 … 1e12 Hz")


def test_an_idle_time_of_zero_is_one(radar_file: Any) -> None:
    radar_file.set("preset.mmmesh.idle_time_s", 0)
    assert radar_file.load().waveform.chirp_period == 65e-6


def test_the_adc_window_lies_within_the_ramp(radar_file: Any, refuses: Refuses) -> None:
    radar_file.set("preset.mmmesh.adc_start_time_s", 8e-6)
    refuses("66.18 us", "65 us", "at most 250 samples fit")
    radar_file.set("preset.mmmesh.adc_start_time_s", 65e-6 - 256 / 4.4e6)  # to the last sample
    radar_file.load()


def test_the_chirps_fit_into_the_frame(radar_file: Any, refuses: Refuses) -> None:
    radar_file.set("preset.mmmesh.num_loops", 463)
    refuses("frame_period is 100 ms", "463 loops", "100.008 ms", "at most 462 loops")
    radar_file.set("preset.mmmesh.num_loops", 462)
    radar_file.load()


def test_the_sweep_stays_in_the_band(radar_file: Any, refuses: Refuses) -> None:
    """The band is that of the ADC window, not of the whole ramp."""
    radar_file.set("preset.mmmesh.start_frequency_hz", 77.2e9)
    refuses("waveform samples 77.5601 … 81.0517 GHz", "76 … 81 GHz")
    radar_file.set("preset.mmmesh.start_frequency_hz", 75.5e9)
    refuses("75.8601 …", "76 … 81 GHz")
    openradar = {"start_frequency_hz": 77.4201e9, "slope_hz_per_s": 60e12, "ramp_end_time_s": 62e-6}
    openradar |= {"num_samples": 256, "sample_rate_hz": 5e6, "adc_start_time_s": 6e-6}
    for key, value in openradar.items():  # the ramp ends at 81.14 GHz
        radar_file.set(f"preset.mmmesh.{key}", value)
    assert radar_file.load().waveform.sampled_band[1] == pytest.approx(80.8521e9, rel=1e-9)


def test_two_elements_at_one_place_are_refused(radar_file: Any, refuses: Refuses) -> None:
    radar_file.set("array.rx_positions_half_wavelengths", [[0, 0, 0], [0, 1, 0], [0, 2, 0], [0, 1, 0]])
    refuses("rx_positions", "elements 1 and 3", "same place")


def test_two_elements_of_one_name_are_refused(radar_file: Any, refuses: Refuses) -> None:
    radar_file.set("array.rx_names", ["RX1", "RX2", "RX2", "RX4"])
    refuses("array.rx_names", "RX2")
    radar_file.set("array.rx_names", ["RX1", "RX2", "RX3"])
    refuses("array.rx_names", "each rx position once")


@pytest.mark.parametrize(
    ("order", "said"),
    [(["TX1", "TX3", "TX1"], "twice"), (["TX1", "TX4"], "'TX4'"), ([], "tx_order")],
)
def test_slots_fire_known_elements_once(radar_file: Any, refuses: Refuses, order: list[str], said: str) -> None:
    radar_file.set("preset.mmmesh.tx_order", order)
    refuses(said)


def test_a_file_of_ones_own_needs_no_sources(radar_file: Any) -> None:
    del radar_file.table["source"]
    assert radar_file.load(overrides={"adc.bits": 12}).adc.bits == 12


def test_all_that_is_missing_or_wrong_is_told_at_once(radar_file: Any, refuses: Refuses) -> None:
    for key in ("array.tx_names", "array.polarization", "pattern.azimuth_db", "transmitter", "preset.mmmesh.num_loops"):
        radar_file.remove(key)
    radar_file.remove("preset.di_gesture.slope_hz_per_s")
    radar_file.set("receiver.gain_db", 30.0)
    radar_file.set("adc.bits", "sixteen")
    missing = (
        "array.tx_names",
        "pattern.azimuth_db",
        "transmitter",
        "transmitter.power_dbm",
        "preset.mmmesh.num_loops",
    )
    refuses(
        *("10 entries are missing or wrong", "no polarisation", "'preset.di_gesture.slope_hz_per_s' is missing"),
        *(f"'{key}' is missing" for key in missing),
        *("unknown key 'receiver.gain_db'", "'adc.bits' is 'sixteen'; int is needed"),
    )


def test_all_magnitudes_are_told_at_once(radar_file: Any, refuses: Refuses) -> None:
    radar_file.set("transmitter.power_dbm", 12e3)
    radar_file.set("pattern.azimuth_deg", [0.0, 0.5])
    radar_file.set("pattern.azimuth_db", [0.0, -3.0])
    refuses("transmitter.power_dbm is 12000", "pattern.azimuth_deg is 0.5", "prefix")


def test_sources_are_of_numbers_in_the_file(radar_file: Any, refuses: Refuses) -> None:
    radar_file.table["source"]["receiver.bandwidth_hz"] = "datasheet"
    refuses("[source]", "receiver.bandwidth_hz")
    del radar_file.table["source"]["receiver.bandwidth_hz"]
    radar_file.table["source"]["preset.mmmesh"] = " "
    refuses("source of 'preset.mmmesh'")


def test_presets_exist(radar_file: Any, refuses: Refuses) -> None:
    with pytest.raises(RadarConfigError, match=r"'fast'.*di_gesture, mmmesh"):
        Radar.load("awr1843", "fast")
    radar_file.set("default_preset", "fast")
    refuses("default_preset is 'fast'", "di_gesture, mmmesh")
    radar_file.table["preset"] = {}
    refuses("at least one [preset.NAME]")


@pytest.mark.parametrize("preset", [[], {}, np.array(1), 3, False, ""])
def test_a_preset_is_called_by_its_name(preset: Any) -> None:
    with pytest.raises(RadarConfigError, match=r"preset is .*; presets: .*mmmesh"):
        Radar.load("awr1843", preset)


@pytest.mark.parametrize("overrides", ["x", 3, True, False, (1, 2), [], ["adc.bits"]])
def test_overrides_are_a_table(overrides: Any) -> None:
    with pytest.raises(TypeError, match=r"overrides is .*: a table of keys and values is needed"):
        Radar.load("awr1843", overrides=overrides)
    assert Radar.load("awr1843", overrides={}) == Radar.load("awr1843")


def test_what_is_no_radar_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"'awr1483'.*did you mean 'awr1843'"):
        Radar.load("awr1483")
    with pytest.raises(RadarConfigError, match=r"nowhere\.toml does not exist.*awr1843"):
        Radar.load(tmp_path / "nowhere.toml")
    (tmp_path / "odd.toml").write_text("name = awr")
    with pytest.raises(RadarConfigError, match=r"odd\.toml: not a TOML file"):
        Radar.load(tmp_path / "odd.toml")
    (tmp_path / "latin.toml").write_bytes('name = "Zürich"'.encode("latin-1"))
    with pytest.raises(RadarConfigError, match=r"latin\.toml: not a TOML file: 'utf-8'"):
        Radar.load(tmp_path / "latin.toml")
    for wrong in (None, 1843, ""):
        with pytest.raises(RadarConfigError, match="awr1843"):
            Radar.load(wrong)  # type: ignore[arg-type]


def test_shipped_radars_are_listed_and_load() -> None:
    radars = Radar.available()
    assert radars["awr1843"] == ("mmmesh", "di_gesture", "bpm", "ddm", "near_far", "triangle")
    for name, presets in radars.items():
        for preset in presets:
            assert Radar.load(name, preset).preset == preset


def test_the_adc_has_bits_and_a_full_scale(radar_file: Any, refuses: Refuses) -> None:
    assert radar_file.load().adc == Adc(16, None)
    radar_file.set("adc", {"bits": 12, "full_scale_dbm": -20})
    radar = radar_file.load()
    assert radar.adc == Adc(12, -20.0)
    assert Radar.from_dict(radar.to_dict()).adc == radar.adc
    older = radar.to_dict()
    del older["adc"]
    assert Radar.from_dict(older).adc == Adc()
    radar_file.set("adc.full_scale_dbm", "automatic")
    refuses("'adc.full_scale_dbm' is 'automatic'", '"auto"')
    radar_file.set("adc.full_scale_dbm", 300)
    refuses("adc.full_scale_dbm is 300", "0.2 … 150", "prefix")
    radar_file.set("adc.full_scale_dbm", 100)
    refuses("adc.full_scale_dbm is 100", "-150 … 60 dBm")
    radar_file.set("adc", {"bits": 1, "full_scale_dbm": "auto"})
    refuses("adc.bits is 1", "2 … 24")


SLOTS = [{"tx": ["TX1", "TX3"]}, {"tx": ["TX2"], "phase_deg": [90.0]}]
CHIRP = {
    "start_frequency_hz": 77e9,
    "slope_hz_per_s": 60e12,
    "sample_rate_hz": 5e6,
    "idle_time_s": 7e-6,
    "adc_start_time_s": 6e-6,
    "ramp_end_time_s": 60e-6,
}


@pytest.mark.parametrize(
    ("preset", "changes", "said"),
    [
        ("mmmesh", {"tx_order": None}, ["neither of 'tx_order'", "'slot'"]),
        ("mmmesh", {"slot": SLOTS}, ["both of 'tx_order'", "'slot'"]),
        ("mmmesh", {"multiplexing": "cdm"}, ["'cdm'", "'tdm', 'bpm' or 'ddm'"]),
        ("mmmesh", {"bpm_code": [[1]]}, ["bpm_code", "goes with multiplexing = 'bpm'"]),
        ("mmmesh", {"doppler_bands": 4}, ["doppler_bands", "goes with multiplexing = 'ddm'"]),
        ("mmmesh", {"slope_hz_per_s": 0.0}, ["slope is 0", "max_range_m"]),
        ("mmmesh", {"slope_hz_per_s": -60.012e12}, ["samples 73.1483 … 76.6399 GHz", "76 … 81 GHz"]),
        ("mmmesh", {"max_range_m": 8000.0}, ["max_range_m is 8000", "1 … 800", "prefix"]),
        ("mmmesh", {"profile": [CHIRP]}, ["has profiles and a 'start_frequency_hz' of its own"]),
        ("mmmesh", {"tx_order": None, "slot": []}, ["slot is empty", "at least one slot"]),
        ("mmmesh", {"tx_order": None, "slot": [{"tx": ["TX4"]}]}, ["slot[0].tx names 'TX4'", "TX1, TX2, TX3"]),
        ("mmmesh", {"tx_order": None, "slot": [{"tx": ["TX1", "TX1"]}]}, ["slot[0].tx fires an element twice"]),
        ("mmmesh", {"tx_order": None, "slot": [{"tx": ["TX1"], "phase": [0]}]}, ["unknown key 'preset.mmmesh.slot[0]"]),
        (
            "mmmesh",
            {"tx_order": None, "slot": [{"tx": ["TX1", "TX2"], "phase_deg": [0.0]}]},
            ["slot[0].phase_deg is [0.0]", "one angle for each of ['TX1', 'TX2']"],
        ),
        ("mmmesh", {"tx_order": None, "slot": [{"tx": ["TX1"], "profile": 1}]}, ["slot[0].profile is 1", "0 … 0"]),
        (
            "mmmesh",
            {"tx_order": None, "slot": [{"tx": ["TX1", "TX2"], "advance_deg": [90.0, 450.0]}]},
            ["advance_deg is 450", "0.4 … 360"],
        ),
        (
            "mmmesh",
            {"tx_order": None, "slot": [{"tx": ["TX1", "TX2"], "advance_deg": [90.0, 90.0]}]},
            ["two Tx elements would share a Doppler band"],
        ),
        (
            "mmmesh",
            {"tx_order": None, "slot": [{"tx": ["TX1", "TX2"], "advance_deg": [0.0, 90.0]}, {"tx": ["TX3"]}]},
            ["2 slots of one profile", "a single slot a loop"],
        ),
        ("bpm", {"bpm_code": [[1, 1], [1, 2]]}, ["bpm_code is [[1.0, 1.0], [1.0, 2.0]]", "1 and -1"]),
        ("bpm", {"bpm_code": [[1, 1], [1, 1]]}, ["not independent", "[[1.0, 1.0], [1.0, -1.0]]"]),
        ("bpm", {"bpm_code": [[1, 1, 1], [1, -1, 1]]}, ["one for each of 2 Tx"]),
        ("ddm", {"doppler_bands": 2}, ["doppler_bands is 2", "3 … 64"]),
        ("ddm", {"num_loops": 7}, ["num_loops is 7", "8 loops"]),
        ("near_far", {"profile": None}, ["is missing", "or profiles"]),
        ("near_far", {"profile": [CHIRP, {}]}, ["profile[1].slope_hz_per_s' is missing"]),
        ("near_far", {"profile": [CHIRP, CHIRP | {"slope": 1.0}]}, ["unknown key 'preset.near_far.profile[1].slope'"]),
        ("near_far", {"profile": [CHIRP, CHIRP | {"ramp_end_time_s": 50e-6}]}, ["57.20 us", "at most 220 samples fit"]),
        ("near_far", {"profile": [CHIRP, CHIRP | {"slope_hz_per_s": 60e9}]}, ["profile[1]", "at least 0.0001"]),
        ("near_far", {"profile": [CHIRP, CHIRP | {"sample_rate_hz": 5e3}]}, ["profile[1]", "fit"]),
        ("near_far", {"profile": [CHIRP, CHIRP | {"idle_time_s": -1e-6}]}, ["profile[1].idle_time_s is -1e-06"]),
        ("near_far", {"num_loops": 400}, ["400 loops of 4 slots take", "at most 359 loops"]),
    ],
)  # fmt: skip
def test_slots_and_profiles_that_cannot_be_are_refused(
    radar_file: Any, preset: str, changes: dict[str, Any], said: list[str]
) -> None:
    table = radar_file.table["preset"][preset]
    for key, value in changes.items():
        if value is None:
            del table[key]
        else:
            table[key] = value
    radar_file.table["default_preset"] = preset
    with pytest.raises(RadarConfigError) as caught:
        radar_file.load(preset)
    for part in (str(radar_file.path), *said):
        assert part in str(caught.value)


def test_slots_of_ones_own(radar_file: Any) -> None:
    radar_file.remove("preset.mmmesh.tx_order")
    radar_file.set("preset.mmmesh.slot", SLOTS)
    radar = radar_file.load()
    assert radar.axis_names == ("0:TX1+TX3", "1:TX2@90")
    assert radar.frame_shape == (128, 2, 4, 256)
    assert radar.waveform.multiplexing == "beam"  # two slots don't tell three Tx apart
    assert Radar.from_dict(radar.to_dict()) == radar
