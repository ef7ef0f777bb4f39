"""The cascade and the 24 GHz radar: arrays, timing and limits against hand computations and the sources' figures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rfgen_sionna.radar import Radar
from rfgen_sionna.radar.config import read_config
from rfgen_sionna.resources import available, resolve

C = 299_792_458.0


@pytest.mark.parametrize(
    ("name", "resolution", "window", "speed_step", "speed", "frame"),
    [
        # B = 42.003e12 * 256 / 22.5e6 = 477.90 MHz; c / 2B; 256 of them; f = 77 GHz + 42.003e12 (2.72 us + 5.689 us) =
        # 77.3532 GHz, so 3.87563 mm; a loop is 12 * 16.32 us = 195.84 us; 3.87563 mm / (4 * 195.84 us).
        ("mmwcas", 0.31366, 80.296, 0.154607, 4.94745, 12.53376e-3),
        # B = 200 MHz, 64 cells of c / 400 MHz; middle 24.125 GHz, 12.42663 mm; chirps every 500 us.
        ("position2go", 0.74948, 47.967, 0.776664, 6.21332, 8e-3),
        ("position2go_v11", 0.74948, 47.967, 0.776664, 6.21332, 8e-3),
    ],
)
def test_limits_by_hand(
    name: str, resolution: float, window: float, speed_step: float, speed: float, frame: float
) -> None:
    radar = Radar.load(name)
    assert radar.range_resolution == pytest.approx(resolution, rel=2e-5)
    assert radar.max_range == pytest.approx(window, rel=2e-5)
    assert radar.velocity_resolution == pytest.approx(speed_step, rel=2e-5)
    assert radar.max_velocity == pytest.approx(speed, rel=2e-5)
    assert radar.waveform.frame_length == pytest.approx(frame, rel=1e-9)


class TestCascade:
    radar = Radar.load("mmwcas")
    half = C / 76.8e9 / 2

    def test_the_frame_fires_from_the_last_to_the_first(self) -> None:
        fired = [self.radar.tx_names[tx] for tx in self.radar.waveform.tx_order]
        assert fired == [f"TX{number}" for number in range(12, 0, -1)]
        tx12, tx1 = self.radar.tx_names.index("TX12"), self.radar.tx_names.index("TX1")
        assert self.radar.waveform.chirp_times[0, tx12] == 0.0
        assert self.radar.waveform.chirp_times[0, tx1] == pytest.approx(11 * 16.32e-6)

    def test_the_virtual_array_has_86_columns_and_four_rows(self) -> None:
        virtual = self.radar.virtual_positions / self.half
        assert virtual.shape == (12, 16, 3)
        np.testing.assert_array_equal(virtual[..., 0], 0.0)
        rows = np.round(virtual[..., 2], 6)
        assert np.unique(rows).tolist() == [0.0, 1.0, 4.0, 6.0]
        columns = np.unique(np.round(virtual[rows == 0][:, 1], 6))
        np.testing.assert_allclose(columns, np.arange(86) - 42.5, atol=1e-6)
        # The rows above: TX3, TX2 and TX1, at azimuth 9, 10 and 11 of the source.
        for name, row, column in (("TX3", 1, 9), ("TX2", 4, 10), ("TX1", 6, 11)):
            raised = virtual[self.radar.tx_names.index(name)]
            np.testing.assert_allclose(raised[:, 2], row, atol=1e-9)
            assert raised[self.radar.rx_names.index("RX13"), 1] == pytest.approx(column - 42.5)

    def test_elements_stand_in_the_order_of_the_devices(self) -> None:
        """RX1 … RX4 of the master at 11 … 14, then slaves 1, 2 and 3 at 50, 46 and 0; to the left is +y."""
        columns = self.radar.rx_positions[:, 1] / self.half + 26.5
        expected = [*range(11, 15), *range(50, 54), *range(46, 50), *range(4)]
        np.testing.assert_allclose(columns, expected, atol=1e-9)

    def test_it_resolves_a_degree_and_a_half(self) -> None:
        """Design guide TIDUEN5A: 1.4 degrees: 3 dB width of 86 half wavelengths, 0.886 wavelengths / aperture."""
        aperture = 86 * self.half
        assert np.degrees(0.886 * self.radar.wavelength / aperture) == pytest.approx(1.2, abs=0.05)
        assert np.degrees(self.radar.wavelength / aperture) == pytest.approx(1.4, abs=0.1)


@pytest.mark.parametrize(("name", "spacing"), [("position2go", 6.22e-3), ("position2go_v11", 7.75e-3)])
def test_the_two_hardware_versions_differ_in_their_spacing(name: str, spacing: float) -> None:
    radar = Radar.load(name)
    assert (len(radar.tx_positions), len(radar.rx_positions)) == (1, 2)
    np.testing.assert_allclose(np.diff(radar.rx_positions, axis=0), [[0.0, spacing, 0.0]], atol=1e-12)
    assert radar.adc.bits == 12
    assert Radar.load(name, look_at=(1, 0, 0)).waveform == Radar.load("position2go").waveform


def test_the_24_ghz_chirps_keep_to_their_band_and_their_clock() -> None:
    """300 us up, 100 us down, 100 us steady; 64 samples over the chirp; all of 24.025 … 24.225 GHz."""
    waveform = Radar.load("position2go").waveform
    assert waveform.chirp_period == pytest.approx(500e-6)
    assert waveform.bandwidth == pytest.approx(200e6, rel=1e-8)
    assert waveform.num_samples / waveform.sample_rate == pytest.approx(300e-6, rel=1e-9)
    assert waveform.start_frequency + waveform.slope * waveform.ramp_end_time <= 24.225e9
    assert (waveform.num_samples, waveform.num_loops) == (64, 16)


@pytest.mark.parametrize("name", available("radars"))
def test_every_number_has_a_source(name: str) -> None:
    """Of each section's values and of each preset; names, angles of cuts and the kind of pattern need none."""
    table = read_config(resolve("radars", name))
    sources = table["source"]
    assert all(isinstance(text, str) and len(text) > 10 for text in sources.values())
    needed = [f"preset.{preset}" for preset in table["preset"]]
    for section in ("array", "pattern", "transmitter", "receiver", "adc"):
        cuts = ("azimuth_deg", "elevation_deg", "kind")
        keys = [key for key in table[section] if not key.endswith("_names") and key not in cuts]
        needed += [f"{section}.{key}" for key in keys if section not in sources]
    assert set(needed) - set(sources) == set()
    for key in sources:
        section, _, rest = key.partition(".")
        assert section in table
        assert not rest or rest in table[section]


@pytest.mark.parametrize("name", available("radars"))
def test_what_no_source_tells_is_marked(name: str) -> None:
    sources = read_config(resolve("radars", name))["source"]
    assert "assumption" in sources["array.polarization"]
    assert all(
        any(word in text for word in ("assumption", "not confirmed"))
        for key, text in sources.items()
        if key in ("pattern", "pattern.azimuth_db", "pattern.elevation_db")
    )
    if name.startswith("position2go"):
        assert all("not confirmed" in sources[key] for key in ("transmitter.power_dbm", "receiver.noise_figure_db"))


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"array.rx_positions_m": [[0, 0, 0]] * 4}, ["rx_positions_half_wavelengths and rx_positions_m", "either"]),
        ({"array.tx_positions_half_wavelengths": None}, ["no positions", "'tx_positions_m'"]),
        ({"array.design_frequency_hz": None}, ["'array.design_frequency_hz' is missing", "half_wavelengths"]),
    ],
)
def test_positions_are_in_one_unit(radar_file: Any, refuses: Any, changes: dict[str, Any], said: list[str]) -> None:
    for key, value in changes.items():
        if value is None:
            radar_file.remove(key)
            radar_file.table["source"].pop(key, None)
        else:
            radar_file.set(key, value)
            radar_file.table["source"][key] = "assumption"
    refuses(*said)


def every_section() -> list[tuple[str, str]]:
    """(radar, section) of all sections with numbers; presets are sections of their own."""
    sections = ("array", "pattern", "transmitter", "receiver", "adc")
    return [
        (name, section)
        for name in available("radars")
        for section in (*sections, *(f"preset.{preset}" for preset in read_config(resolve("radars", name))["preset"]))
    ]


def _scales(value: Any) -> bool:
    """Whether a prefix would change a number: not a text, and not zeros alone."""
    numbers = value if isinstance(value, list) else [value]
    if not all(isinstance(number, (int, float, list)) and not isinstance(number, bool) for number in numbers):
        return False
    return bool(np.any(numbers)) and numbers != [[1, 1], [1, -1]]


def _scaled(value: Any, factor: float) -> Any:
    if isinstance(value, list):
        return [_scaled(entry, factor) for entry in value]
    scaled = value * factor
    return int(scaled) if isinstance(value, int) and factor > 1 else scaled


@pytest.mark.parametrize(("name", "section"), every_section())
def test_a_forgotten_prefix_is_noticed(name: str, section: str) -> None:
    """Whatever is a thousand times too large or too small is refused, and the message names the preset or the key."""
    values: Any = read_config(resolve("radars", name))
    for part in section.split("."):
        values = values[part]
    preset = section.partition(".")[2] or None
    for key in [key for key, value in values.items() if _scales(value)]:
        for factor in (1e3, 1e-3):
            changed = _scaled(values[key], factor)
            with pytest.raises(ValueError, match=preset or key.removesuffix("_range_hz")) as caught:
                Radar.load(name, preset, overrides={f"{section}.{key}": changed})
            words = ("allowed", "reaches", "needed", "fit", "at most", "within")
            assert any(word in str(caught.value) for word in words), (key, changed)


@pytest.mark.parametrize("factor", [1e3, 1e-3])
@pytest.mark.parametrize(
    ("key", "value"),
    [("adc.full_scale_dbm", -10.0), ("transmitter.power_dbm", -3.0), ("receiver.noise_figure_db", 1.5)],
)
def test_a_forgotten_prefix_in_decibels_is_noticed(key: str, value: float, factor: float) -> None:
    assert Radar.load("awr1843", overrides={key: value, "adc.bits": 16}).name == "awr1843"
    with pytest.raises(ValueError, match=rf"{key.partition('.')[2]} is {value * factor:g}; 0 or.*… .* is allowed"):
        Radar.load("awr1843", overrides={key: value * factor})


@pytest.mark.parametrize("factor", [1e3, 1e-3])
def test_a_forgotten_prefix_in_the_phases_of_slots_is_noticed(factor: float) -> None:
    slots = [dict(slot) for slot in read_config(resolve("radars", "mmwcas"))["preset"]["steered_left"]["slot"]]
    slots[0]["phase_deg"] = [angle * factor for angle in slots[0]["phase_deg"]]
    with pytest.raises(ValueError, match=r"phase_deg .*allowed"):
        Radar.load("mmwcas", "steered_left", overrides={"preset.steered_left.slot": slots})


@pytest.mark.parametrize("factor", [1e3, 1e-3])
@pytest.mark.parametrize("column", [0, 1, 2])
def test_a_forgotten_prefix_in_a_pattern_file_is_noticed(tmp_path: Path, column: int, factor: float) -> None:
    rows = np.array([(a, e, 7.0 - (a / 30) ** 2 / 3) for a in (-90.0, 0.0, 90.0) for e in (-45.0, 45.0)])
    changes = {"pattern": {"kind": "table", "file": str(tmp_path / "mine.csv")}}

    def load() -> None:
        np.savetxt(tmp_path / "mine.csv", rows, delimiter=",", header="azimuth_deg,elevation_deg,gain_dbi", comments="")
        Radar.load("awr1843", overrides=changes)

    load()
    rows[:, column] *= factor
    with pytest.raises(ValueError, match=r"mine\.csv.*(allowed|within|needed)"):
        load()


def every_profile_value() -> list[tuple[str, str, int, str]]:
    """(radar, preset, index, key) of all numbers in presets of several profiles."""
    return [
        (name, preset, index, key)
        for name in available("radars")
        for preset, values in read_config(resolve("radars", name))["preset"].items()
        for index, profile in enumerate(values.get("profile", ()))
        for key, value in profile.items()
        if value
    ]


@pytest.mark.parametrize("factor", [1e3, 1e-3])
@pytest.mark.parametrize(("name", "preset", "index", "key"), every_profile_value())
def test_a_forgotten_prefix_in_a_profile_is_noticed(
    name: str, preset: str, index: int, key: str, factor: float
) -> None:
    profiles = [dict(profile) for profile in read_config(resolve("radars", name))["preset"][preset]["profile"]]
    profiles[index][key] *= factor
    with pytest.raises(ValueError, match=preset) as caught:
        Radar.load(name, preset, overrides={f"preset.{preset}.profile": profiles})
    assert any(word in str(caught.value) for word in ("allowed", "reaches", "needed", "fit", "at most"))


def test_what_every_kind_of_frame_is_called() -> None:
    kinds = {
        (name, preset): Radar.load(name, preset).waveform.multiplexing
        for name in available("radars")
        for preset in Radar.available()[name]
    }
    assert kinds["awr1843", "mmmesh"] == "tdm"
    assert kinds["awr1843", "bpm"] == "bpm"
    assert kinds["awr1843", "ddm"] == "ddm"
    assert kinds["mmwcas", "steered_left"] == "beam"
    assert kinds["position2go", "doppler"] == "none"
    assert len(Radar.load("awr1843", "near_far").waveform.profiles) == 2
    assert Radar.load("awr1843", "triangle").waveform.profiles[1].slope < 0
    assert Radar.load("position2go", "doppler").waveform.slope == 0
