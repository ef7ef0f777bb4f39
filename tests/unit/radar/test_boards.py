"""Boards as their makers draw them: virtual arrays against TI's and Infineon's own tables, and the page of radars.

A virtual array is drawn as one sees it facing the board: the upper row first, the index growing to the right, which is
to the left looking out. Channels are numbered in the order of names, Tx by Tx.
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rfgen_sionna.radar import Radar
from rfgen_sionna.radar.config import read_config
from rfgen_sionna.resources import available, resolve

C = 299_792_458.0
PAGE = Path(__file__).parents[3] / "docs" / "radars.md"


@cache
def table(name: str) -> dict[str, Any]:
    return read_config(resolve("radars", name))


@cache
def whole(name: str) -> Radar:
    """The radar with all its Tx elements."""
    radars = [Radar.load(name, preset) for preset in table(name)["preset"]]
    return max(radars, key=lambda radar: len(radar.tx_names))


def virtual_rows(radar: Radar, pitch: float, height: float) -> dict[int, list[int]]:
    """Columns of each row of the virtual array, in `pitch` and `height` [m] from the lower left, facing the board."""
    virtual = radar.virtual_positions.reshape(-1, 3)
    steps = (virtual - virtual.min(axis=0))[:, 1:] / (pitch, height)
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-6)
    rows: dict[int, list[int]] = {}
    for column, row in np.rint(steps).astype(int):
        rows.setdefault(int(row), []).append(int(column))
    return {row: sorted(rows[row]) for row in sorted(rows)}


class TestVirtualArrays:
    @pytest.mark.parametrize(
        ("name", "pitch"),
        [("awr1843", C / 77e9 / 2), ("iwr6843isk", 2.5e-3), ("iwr1443boost", C / 79e9 / 2)],
    )
    def test_three_tx_give_eight_columns_and_four_above_them(self, name: str, pitch: float) -> None:
        """TX1 fills columns 0 … 3, TX3 columns 4 … 7, TX2 columns 2 … 5 half a wavelength higher."""
        radar = whole(name)
        assert virtual_rows(radar, pitch, pitch) == {0: list(range(8)), 1: [2, 3, 4, 5]}
        raised = radar.tx_positions[:, 2] - radar.tx_positions[0, 2]
        np.testing.assert_allclose(raised, [0.0, pitch, 0.0], atol=1e-9)

    def test_the_awr1642boost_has_one_row_of_eight(self) -> None:
        radar, pitch = whole("awr1642boost"), C / 77e9 / 2
        assert virtual_rows(radar, pitch, pitch) == {0: list(range(8))}
        np.testing.assert_allclose(np.diff(radar.tx_positions, axis=0), [[0.0, 4 * pitch, 0.0]], atol=1e-9)

    def test_the_awr2944evm_follows_antgeometrycfg(self) -> None:
        """Rows (0 is the upper one) and columns of Tx0Rx0 … Tx3Rx3 in TI's demo; 0.5 and 0.8 wavelengths a cell."""
        cells = "1 0 1 1 1 2 1 3 0 2 0 3 0 4 0 5 1 4 1 5 1 6 1 7 1 8 1 9 1 10 1 11"
        row, column = np.array(cells.split(), int).reshape(-1, 2).T
        wavelength = C / 77e9
        virtual = whole("awr2944evm").virtual_positions.reshape(-1, 3)
        virtual = virtual - virtual[0]
        np.testing.assert_allclose(virtual[:, 1], 0.5 * wavelength * column, atol=1e-9)
        np.testing.assert_allclose(virtual[:, 2], 0.8 * wavelength * (1 - row), atol=1e-9)

    @pytest.mark.parametrize(
        ("name", "pitch", "azimuth", "elevation", "rotation"),
        [
            (
                "iwr6843isk",
                2.5e-3,
                "0 -1 -2 -3 -2 -3 -4 -5 -4 -5 -6 -7",
                "-1 -1 -1 -1 0 0 0 0 -1 -1 -1 -1",
                "1 1 1 1 1 1 1 1 1 1 1 1",
            ),
            (
                "iwr6843aop",
                2.5e-3,
                "-1 -1 0 0 -3 -3 -2 -2 -1 -1 0 0",
                "-1 0 -1 0 -3 -2 -3 -2 -3 -2 -3 -2",
                "1 -1 1 -1 1 -1 1 -1 1 -1 1 -1",
            ),
            (
                "iwr6843isk_ods",
                2.426e-3,
                "0 0 -1 -1 -2 -2 -3 -3 -2 -2 -3 -3",
                "0 -1 -1 0 0 -1 -1 0 -2 -3 -3 -2",
                "1 -1 -1 1 1 -1 -1 1 1 -1 -1 1",
            ),
        ],
    )
    def test_sixty_gigahertz_boards_follow_antgeometry(
        self, name: str, pitch: float, azimuth: str, elevation: str, rotation: str
    ) -> None:
        """antGeometry0, antGeometry1 and antPhaseRot of TI's 3D people tracking: x to the right looking out, z up."""
        radar = whole(name)
        x, z, sign = (np.array(text.split(), float) for text in (azimuth, elevation, rotation))
        virtual = radar.virtual_positions.reshape(-1, 3)
        virtual = virtual - virtual[0]
        np.testing.assert_allclose(virtual[:, 1], pitch * (x[0] - x), atol=1e-9)
        np.testing.assert_allclose(virtual[:, 2], pitch * (z - z[0]), atol=1e-9)
        tx, rx = radar.feed_factors
        np.testing.assert_allclose((tx[:, None] * rx).ravel(), sign, atol=1e-12)

    def test_the_bgt60tr13c_is_an_l_of_two_and_a_half_millimetres(self) -> None:
        """RX1 beside RX3, RX2 above it."""
        radar = whole("bgt60tr13c")
        rx1, rx2, rx3 = radar.rx_positions
        np.testing.assert_allclose(rx1 - rx3, [0.0, 2.5e-3, 0.0], atol=1e-12)
        np.testing.assert_allclose(rx2 - rx3, [0.0, 0.0, 2.5e-3], atol=1e-12)

    @pytest.mark.parametrize("name", ["iwr6843isk", "iwr1443boost", "awr1642boost", "awr2944evm"])
    def test_the_index_grows_to_the_left_looking_out(self, name: str) -> None:
        radar = whole(name)
        assert np.all(np.diff(radar.rx_positions[:, 1]) > 0)
        assert radar.tx_positions[0, 1] > radar.rx_positions[-1, 1]


@pytest.mark.parametrize(
    ("name", "band", "power", "noise", "step", "real"),
    [
        ("iwr6843isk", (60e9, 64e9), 12.0, 12.0, 5.625, False),
        ("iwr6843isk_ods", (60e9, 64e9), 12.0, 12.0, 5.625, False),
        ("iwr6843aop", (60e9, 64e9), 10.0, 15.0, 5.625, False),
        ("iwr1443boost", (76e9, 81e9), 12.0, 15.0, 180.0, False),
        ("awr1642boost", (76e9, 81e9), 12.5, 15.0, 180.0, False),
        ("awr2944evm", (76e9, 81e9), 13.5, 12.0, 5.625, True),
        ("bgt60tr13c", (58e9, 63.5e9), 5.0, 12.0, 0.0, True),
    ],
)
def test_devices_are_those_of_the_datasheets(
    name: str, band: tuple[float, float], power: float, noise: float, step: float, real: bool
) -> None:
    radar = whole(name)
    assert tuple(table(name)["transmitter"]["frequency_range_hz"]) == band
    assert (radar.tx_power_dbm, radar.noise_figure_db) == (power, noise)
    assert radar.waveform.phase_step_deg == step
    assert radar.adc.real == real


@pytest.mark.parametrize("name", available("radars"))
def test_every_chirp_samples_inside_the_band(name: str) -> None:
    low, high = table(name)["transmitter"]["frequency_range_hz"]
    for preset in table(name)["preset"]:
        first, last = Radar.load(name, preset).waveform.sampled_band
        assert low <= first <= last <= high


def test_radhar_s_frame_has_the_cells_of_its_data() -> None:
    """Velocity cells of 0.615 m/s, 16 of them; 256 bins of 0.04091 m from 240 samples; 30 frames a second."""
    radar = Radar.load("iwr1443boost", "radhar")
    assert radar.velocity_resolution == pytest.approx(0.615, abs=5e-4)
    assert radar.waveform.num_loops == 16
    assert radar.waveform.range_window / 256 == pytest.approx(0.04091, rel=2e-3)
    assert 1 / radar.waveform.frame_period == pytest.approx(30, rel=1e-4)


def test_the_recorded_bgt60tr13c_sweeps_its_whole_band() -> None:
    """58 to 63.5 GHz: cells of c / (2 5.5 GHz) = 27.25 mm, 32 of them from 64 real samples; chirps every 591.125 us."""
    radar = Radar.load("bgt60tr13c", "breathing")
    assert radar.waveform.sampled_band == pytest.approx((58e9, 63.5e9), rel=1e-12)
    assert radar.range_resolution == pytest.approx(27.254e-3, rel=1e-4)
    assert radar.max_range == pytest.approx(32 * 27.254e-3, rel=1e-4)
    assert radar.waveform.chirp_period == pytest.approx(591.125e-6, rel=1e-6)


def picture(radar: Radar) -> str:
    """Virtual array facing the board, the upper row first: heights [mm], and channels in their columns."""
    virtual = 1e3 * radar.virtual_positions.reshape(-1, 3)
    virtual = virtual - virtual.min(axis=0)
    heights = np.unique(np.round(virtual[:, 2], 3))
    left = np.unique(np.round(virtual[:, 1], 6))
    pitch = np.diff(left).min() if len(left) > 1 else 1.0
    columns = np.rint(virtual[:, 1] / pitch).astype(int)
    lines = [f"columns {pitch:.3f} mm apart"]
    for height in heights[::-1]:
        row = [" ."] * (columns.max() + 1)
        for channel in np.flatnonzero(np.isclose(virtual[:, 2], height, atol=2e-3)):
            row[columns[channel]] = f"{channel + 1:2d}"
        lines.append(f"{height:6.3f} mm  {' '.join(row)}")
    return "\n".join(lines)


def preset_lines(name: str) -> list[str]:
    """Rows of the table of presets."""
    lines = []
    for preset in table(name)["preset"]:
        radar = Radar.load(name, preset)
        wave = radar.waveform
        low, high = (f"{frequency / 1e9:.5g}" for frequency in wave.sampled_band)
        cell = f"{radar.range_resolution:.3f}, {radar.max_range:.2f}" if np.isfinite(radar.range_resolution) else "none"
        lines.append(
            f"| `{preset}` | {low} to {high} | {wave.num_loops} × {len(radar.axis_names)} × {wave.num_samples} | "
            f"{1 / wave.frame_period:.3g} | {cell} | {radar.velocity_resolution:.3f}, {radar.max_velocity:.2f} |"
        )
    return lines


@pytest.fixture(scope="module")
def sections() -> dict[str, str]:
    """Sections of docs/radars.md by radar."""
    _, *parts = re.split(r"^## (\w+)$", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return dict(zip(parts[::2], parts[1::2], strict=True))


class TestPage:
    """docs/radars.md lists the radars as they are."""

    def test_it_has_every_radar(self, sections: dict[str, str]) -> None:
        assert list(sections) == list(available("radars"))

    @pytest.mark.parametrize("name", available("radars"))
    def test_presets(self, sections: dict[str, str], name: str) -> None:
        rows = [line for line in sections[name].splitlines() if line.startswith("| `")]
        assert rows == preset_lines(name)

    @pytest.mark.parametrize("name", [name for name in available("radars") if name != "mmwcas"])
    def test_virtual_arrays(self, sections: dict[str, str], name: str) -> None:
        """The cascade's 86 columns are described in words."""
        drawn = re.findall(r"```text\n(.*?)\n```", sections[name], flags=re.DOTALL)
        assert drawn == [picture(whole(name))]

    def test_its_example_runs(self) -> None:
        (example,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL)
        names: dict[str, Any] = {}
        exec(example, names)
        assert names["radar"].pattern.peak_gain_dbi == 7.5
        assert names["radar"].waveform.num_loops == 64
