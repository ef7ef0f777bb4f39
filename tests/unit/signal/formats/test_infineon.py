"""`radar.npy` and `config.json` of Infineon's boards, as their tools leave them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rfgen_sionna.radar import Radar
from rfgen_sionna.signal.formats import CaptureFormatError, open_capture, read_capture, write_capture
from tests.unit.signal.formats.captures import BGT60_SHAPE as SHAPE
from tests.unit.signal.formats.captures import bgt60, lsb_cube


def recorded(folder: Path, words: np.ndarray, **changes: Any) -> Path:
    folder.mkdir(exist_ok=True)
    np.save(folder / "radar.npy", words)
    config = {"device_config": {"fmcw_single_shape": SHAPE | changes}}
    (folder / "config.json").write_text(json.dumps(config, indent=4))
    return folder


def words(*shape: int) -> np.ndarray:
    return np.random.default_rng(1).integers(0, 4096, shape).astype(np.uint16)


def test_a_recording_opens_with_its_board_and_chirps(tmp_path: Path) -> None:
    stored = words(5, 3, 8, 64)
    folder = recorded(tmp_path / "a", stored)
    for path in (folder, folder / "radar.npy", folder / "config.json"):
        capture = open_capture(path)
        assert (capture.format, capture.radar.name, len(capture), capture.scale) == ("infineon", "bgt60tr13c", 5, None)
        assert capture.radar.frame_shape == (8, 1, 3, 64)
        assert capture.radar.waveform.sampled_band == pytest.approx((58e9, 63.5e9))
        np.testing.assert_allclose(np.diff(capture.frame_times), 0.0772688, rtol=1e-5)
        found = capture.lsb(2)
        assert found.dtype == np.float32
        assert found[6, 0, 1, 40] == float(stored[2, 1, 6, 40]) - 2048
        np.testing.assert_array_equal(found[:, 0].swapaxes(0, 1), stored[2].astype(float) - 2048)


def test_receivers_in_use_and_other_hardware(tmp_path: Path) -> None:
    folder = recorded(tmp_path / "a", words(2, 2, 8, 64), rx_antennas=[1, 3])
    for radar in (None, "bgt60tr13c", Radar.load("bgt60tr13c", position=(0, 0, 1))):
        capture = open_capture(folder, radar=radar)
        assert capture.radar.rx_names == ("RX1", "RX3")
        assert capture.radar.waveform.num_samples == 64
    assert capture.radar.position == (0, 0, 1)


def test_shares_of_the_python_interface(tmp_path: Path) -> None:
    stored = words(3, 3, 8, 64)
    folder = recorded(tmp_path / "a", (stored / 4095).astype(np.float32))
    np.testing.assert_array_equal(open_capture(folder).lsb(1)[:, 0].swapaxes(0, 1), stored[1].astype(float) - 2048)


@pytest.mark.parametrize(
    ("stored", "message"),
    [
        (words(3, 2, 8, 64), r"uint16 \(3, 2, 8, 64\); .* \(3, 8, 64\) after the frames is needed by 'config.json'"),
        (words(3, 8, 3, 64), r"\(3, 8, 3, 64\)"),
        (words(3, 3, 8, 64).astype(np.float32) - 2048, r"float32 values -20.. … .*; shares 0 … 1 of a 12-bit"),
        (words(3, 3, 8, 64) * 16, r"uint16 values .*; words 0 … 4,095 of a 12-bit converter are needed"),
        (words(3, 3, 8 * 64), r"holds uint16 \(3, 3, 512\): complex .* is of RF Genesis, uint16 .* of Infineon"),
    ],
)
def test_other_arrays_are_refused(tmp_path: Path, stored: np.ndarray, message: str) -> None:
    folder = recorded(tmp_path / "a", stored)
    with pytest.raises(CaptureFormatError, match=message):
        read_capture(folder, scale=1.0)


def test_another_board_is_refused(tmp_path: Path) -> None:
    folder = recorded(tmp_path / "a", words(3, 3, 8, 64))
    with pytest.raises(CaptureFormatError, match=r"1 Tx and real samples; radar 'awr1843' has 3 Tx and complex ones"):
        open_capture(folder, radar="awr1843")


def test_without_a_configuration_a_radar_is_asked_for(tmp_path: Path) -> None:
    folder = recorded(tmp_path / "a", words(3, 3, 8, 64))
    (folder / "config.json").unlink()
    with pytest.raises(CaptureFormatError, match="pass radar="):
        open_capture(folder)
    with pytest.raises(CaptureFormatError, match=r"is needed by radar 'bgt60tr13c', preset"):
        open_capture(folder, radar="bgt60tr13c")
    assert len(open_capture(folder, radar=bgt60(8, 64))) == 3


def test_the_configuration_that_is_written_is_the_boards(tmp_path: Path) -> None:
    radar = bgt60(8, 64)
    cube = lsb_cube(radar, 2, 2048)
    write_capture(cube, tmp_path, "infineon", scale=1.0)
    stored = np.load(tmp_path / "radar.npy")
    assert (stored.dtype, stored.shape) == (np.uint16, (2, 3, 8, 64))
    np.testing.assert_array_equal(stored.transpose(0, 2, 1, 3)[:, :, None].astype(float) - 2048, cube.data)
    shape = json.loads((tmp_path / "config.json").read_text())["device_config"]["fmcw_single_shape"]
    assert set(shape) == set(SHAPE)
    (tmp_path / "radar.rfgen").unlink()
    capture = open_capture(tmp_path)
    for name in ("start_frequency", "slope", "sample_rate", "num_samples", "num_loops", "chirp_period", "frame_period"):
        wanted = getattr(radar.waveform, name, None)
        assert wanted is None or getattr(capture.radar.waveform, name) == pytest.approx(wanted, rel=1e-9), name
    np.testing.assert_array_equal(capture.cube().data, cube.data)


@pytest.mark.parametrize("name", ["awr1843", "position2go", "awr2944evm"])
def test_frames_that_a_board_of_infineon_has_not(tmp_path: Path, name: str) -> None:
    with pytest.raises(CaptureFormatError, match=r"complex ADC|3 slots of 3 Tx"):
        write_capture(lsb_cube(Radar.load(name), 1, 100), tmp_path, "infineon")
