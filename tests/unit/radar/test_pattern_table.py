"""Element patterns from tables and by name, other polarisations, and overrides."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rfgen_sionna._types import FloatArray
from rfgen_sionna.radar import ElementPattern, NamedPattern, Radar, TablePattern
from rfgen_sionna.radar.config import RadarConfigError
from rfgen_sionna.radar.pattern_table import read_table


def towards(azimuth_deg: Any, elevation_deg: Any = 0.0) -> FloatArray:
    """Unit vectors in the device frame: azimuth to the left, elevation upwards."""
    azimuth, elevation = np.broadcast_arrays(np.radians(azimuth_deg), np.radians(elevation_deg))
    return np.stack(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], axis=-1
    )


def gain(azimuth: Any, elevation: Any) -> Any:
    """No symmetry anywhere: left and right, up and down differ."""
    return 9.0 - 12 * ((np.asarray(azimuth) - 5) / 80) ** 2 - 12 * ((np.asarray(elevation) + 3) / 50) ** 2


AZIMUTH, ELEVATION = np.arange(-60.0, 61.0, 10.0), np.arange(-30.0, 31.0, 5.0)


def csv(path: Path) -> Path:
    order = np.random.default_rng(0).permutation(len(AZIMUTH) * len(ELEVATION))
    pairs = [(a, e) for a in AZIMUTH for e in ELEVATION]
    lines = ["# made up", "azimuth_deg, elevation_deg, gain_dbi"]
    lines += [f"{pairs[i][0]}, {pairs[i][1]}, {gain(*pairs[i])}  # {i}" for i in order]
    path.write_text("\n".join(lines))
    return path


def ffd(path: Path, *, phi: FloatArray, frequencies: tuple[float, ...] = (76e9, 79e9)) -> Path:
    """HFSS's layout; the fields of the second frequency are twice as strong and mirrored in azimuth."""
    theta = np.arange(60.0, 121.0, 5.0)
    lines = [f"60 120 {len(theta)}", f"{phi[0]} {phi[-1]} {len(phi)}", f"Frequencies {len(frequencies)}"]
    for number, frequency in enumerate(frequencies):
        lines.append(f"Frequency {frequency:.15e}")
        for t in theta:
            for p in phi:
                azimuth = (p + 180) % 360 - 180
                field = 10 ** (gain(-azimuth if number else azimuth, 90 - t) / 20) * (1 + number)
                lines.append(f"{0.6 * field:.9e} 0.0 0.0 {-0.8 * field:.9e}")
    path.write_text("\n".join(lines))
    return path


def test_a_csv_file_is_read_with_its_sides(tmp_path: Path) -> None:
    pattern = read_table(csv(tmp_path / "element.csv"), 77e9)
    azimuth, elevation = np.meshgrid(AZIMUTH, ELEVATION)
    np.testing.assert_allclose(pattern.gain_db(towards(azimuth, elevation)), gain(azimuth, elevation), atol=1e-4)
    # Half way between two points the mean of both, in dB; outside what the rim has.
    assert pattern.gain_db(towards(25)) == pytest.approx((gain(20, 0) + gain(30, 0)) / 2, abs=1e-4)
    assert pattern.gain_db(towards(120)) == pytest.approx(gain(60, 0), abs=1e-4)
    assert pattern.gain_db(towards(0, -80)) == pytest.approx(gain(0, -30), abs=1e-4)
    assert pattern.peak_gain_dbi == pytest.approx(gain(AZIMUTH[:, None], ELEVATION).max(), abs=1e-4)
    np.testing.assert_allclose(
        20 * np.log10(pattern.amplitude(towards(azimuth, elevation))), gain(azimuth, elevation), atol=1e-4
    )


def test_a_peak_of_ones_own_shifts_the_table(tmp_path: Path) -> None:
    path = csv(tmp_path / "element.csv")
    given, shifted = read_table(path, 77e9), read_table(path, 77e9, 3.0)
    assert shifted.peak_gain_dbi == pytest.approx(3.0)
    difference = shifted.gain_db(towards(AZIMUTH)) - given.gain_db(towards(AZIMUTH))
    np.testing.assert_allclose(difference, 3.0 - given.peak_gain_dbi, atol=2e-4)


@pytest.mark.parametrize(
    "phi", [np.arange(-180.0, 181.0, 10.0), np.arange(0.0, 361.0, 10.0), np.arange(0.0, 360.0, 10.0)]
)
def test_a_far_field_of_hfss_is_read_at_the_nearest_frequency(tmp_path: Path, phi: FloatArray) -> None:
    """Theta from the zenith, phi from boresight to the left and running fastest; both field components count."""
    path = ffd(tmp_path / "element.ffd", phi=phi)
    azimuth, elevation = np.meshgrid(np.arange(-180.0, 180.0, 10.0), np.arange(-30.0, 31.0, 5.0))
    for frequency, side in ((76.4e9, 1), (81e9, -1)):
        pattern = read_table(path, frequency, 9.5)
        expected = gain(side * azimuth, elevation)
        np.testing.assert_allclose(
            pattern.gain_db(towards(azimuth, elevation)), expected - expected.max() + 9.5, atol=2e-4
        )
    assert pattern.gain_db(towards(175)) == pytest.approx(
        (pattern.gain_db(towards(170)) + pattern.gain_db(towards(-180))) / 2, abs=1e-6
    )


def test_what_is_no_pattern_file_is_refused(tmp_path: Path) -> None:
    def refused(name: str, text: str | None, said: str, peak: float | None = None) -> None:
        if text is not None:
            (tmp_path / name).write_text(text)
        with pytest.raises(ValueError, match=rf"{name}.*{said}"):
            read_table(tmp_path / name, 77e9, peak)

    refused("none.csv", None, "does not exist")
    refused("odd.txt", "0", r"a \.csv or an \.ffd")
    refused("head.csv", "phi,theta,gain\n0,0,0", "first line")
    head = "azimuth_deg,elevation_deg,gain_dbi\n"
    refused("cell.csv", head + "0,0\n", "three finite numbers")
    refused("nan.csv", head + "0,0,nan\n", "three finite numbers")
    refused("grid.csv", head + "0,0,1\n0,10,1\n10,0,1\n", "3 directions for 2 azimuths times 2")
    refused("few.csv", head + "0,0,1\n", "at least 2")
    refused("far.csv", head + "0,0,1\n0,95,1\n10,0,1\n10,95,1\n", "±90")
    refused("loud.csv", head + "0,0,100\n0,5,1\n10,0,1\n10,5,1\n", "-30 … 60 dBi")
    ffd(tmp_path / "level.ffd", phi=np.arange(-180.0, 181.0, 30.0))
    refused("level.ffd", None, "peak_gain_dbi is needed")
    short = (tmp_path / "level.ffd").read_text().splitlines()[:-1]
    refused("short.ffd", "\n".join(short[:20]), "not the far field of HFSS", 7.0)
    refused("other.ffd", "antenna", "not the far field of HFSS", 7.0)


def test_a_radar_file_names_its_table(radar_file: Any, refuses: Any) -> None:
    csv(radar_file.path.parent / "element.csv")
    radar_file.table["pattern"] = {"kind": "table", "file": "element.csv"}
    radar_file.table["source"] = {
        key: text for key, text in radar_file.table["source"].items() if not key.startswith("pattern")
    } | {"pattern": "made up"}
    radar = radar_file.load()
    assert isinstance(radar.pattern, TablePattern)
    again = Radar.from_dict(json.loads(json.dumps(radar.to_dict())))
    assert again == radar
    assert hash(again) == hash(radar)
    assert again.pattern.gain_db(towards(20, 5)) == pytest.approx(gain(20, 5), abs=1e-4)
    radar_file.set("pattern.azimuth_db", [0.0, 0.0])
    refuses("'pattern.azimuth_db' does not go with pattern.kind = 'table'")
    radar_file.table["pattern"] = {"kind": "table"}
    refuses("'pattern.file' is missing")
    radar_file.table["pattern"] = {"kind": "horn"}
    refuses("'pattern.kind' is 'horn'", "'cuts', 'table' or 'sionna:NAME'")
    radar_file.table["pattern"] = {"kind": "table", "file": "nowhere.csv"}
    refuses("nowhere.csv does not exist")


def test_a_name_in_sionnas_registry_is_only_a_name_here() -> None:
    radar = Radar.load("awr1843", overrides={"pattern": {"kind": "sionna:tr38901"}})
    assert radar.pattern == NamedPattern("sionna:tr38901")
    assert Radar.from_dict(json.loads(json.dumps(radar.to_dict()))) == radar
    for ask in (radar.pattern.gain_db, radar.pattern.amplitude):
        with pytest.raises(ValueError, match=r"'sionna:tr38901'.*tabulated\(radar\)"):
            ask(towards(0))
    with pytest.raises(ValueError, match="'sionna:' and the name"):
        NamedPattern("tr38901")


def test_both_ends_have_a_polarisation(radar_file: Any, refuses: Any) -> None:
    radar = radar_file.load()
    assert (radar.tx_polarization, radar.rx_polarization) == ("V", "V")
    older = radar.to_dict()
    del older["tx_polarization"], older["rx_polarization"]
    assert Radar.from_dict(older | {"polarization": "H"}) == replace(radar, tx_polarization="H", rx_polarization="H")
    overrides = {"array.polarization": None, "array.tx_polarization": "+45", "array.rx_polarization": "H"}
    crossed = Radar.load(radar_file.path, overrides=overrides, orientation=(np.pi / 2, 0, 0))
    np.testing.assert_allclose(crossed.tx_field, np.array([-1, 0, 1]) / np.sqrt(2), atol=1e-12)
    np.testing.assert_allclose(crossed.rx_field, [-1, 0, 0], atol=1e-12)
    assert Radar.from_dict(crossed.to_dict()) == crossed
    radar_file.set("array.rx_polarization", "H")
    radar_file.table["source"]["array.rx_polarization"] = "assumption"
    refuses("polarization and rx_polarization", "either 'polarization' or both")
    radar_file.remove("array.polarization")
    del radar_file.table["source"]["array.polarization"]
    refuses("[array] has rx_polarization;")


def test_overrides_stand_for_the_files_values() -> None:
    cuts = {
        "peak_gain_dbi": 12.0,
        **{f"{a}_deg": [-90, 90] for a in ("azimuth", "elevation")},
        **{f"{a}_db": [-3, 0] for a in ("azimuth", "elevation")},
    }
    radar = Radar.load(
        "position2go",
        overrides={
            "receiver.noise_figure_db": 9,
            "preset.default.num_loops": 8,
            "pattern": cuts,
            "array.rx_positions_m": [[0, 0, 0], [0, 0, 0.01]],
        },
    )
    assert (radar.noise_figure_db, radar.waveform.num_loops) == (9.0, 8)
    assert radar.pattern == ElementPattern(12.0, (-90.0, 90.0), (-3.0, 0.0), (-90.0, 90.0), (-3.0, 0.0))
    np.testing.assert_allclose(radar.rx_positions, [[0, 0, 0], [0, 0, 0.01]])
    assert Radar.load("position2go").noise_figure_db == 12.0
    assert Radar.load("position2go", overrides={}) == Radar.load("position2go")


@pytest.mark.parametrize(
    ("overrides", "said"),
    [
        ({"receiver.noise": 3.0}, r"unknown key 'receiver\.noise'.*noise_figure_db.*overrides: receiver\.noise"),
        ({"reciever.noise_figure_db": 3.0}, "'reciever.noise_figure_db': there is no table 'reciever'"),
        ({"preset.fast.num_loops": 3}, "there is no table 'fast'"),
        ({"name.first": "x"}, "there is no table 'name'"),
        ({"receiver.noise_figure_db": "low"}, "'low'; int or float"),
        ({"receiver.noise_figure_db": None}, r"'receiver\.noise_figure_db' is missing"),
        ({"transmitter.power_dbm": 300}, "transmitter.power_dbm is 300"),
        ({"preset.default.num_loops": 2000}, "2000 loops"),
    ],
)
def test_overrides_are_checked_as_the_file_is(overrides: dict[str, Any], said: str) -> None:
    with pytest.raises(RadarConfigError, match=said):
        Radar.load("position2go", overrides=overrides)
