"""`rfgen show` and `rfgen export` of captures, as a board leaves them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from rfgen_sionna import cli
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import AdcCube
from rfgen_sionna.signal.formats import CaptureWarning, open_capture, read_capture
from tests.unit.signal.formats.captures import awr1843

CHIRPS = {
    "chirp_repetition_time_s": 0.0006, "end_frequency_Hz": 63500000000, "frame_repetition_time_s": 0.08,
    "num_chirps_per_frame": 8, "num_samples_per_chirp": 64, "rx_antennas": [1, 2, 3], "sample_rate_Hz": 2000000,
    "start_frequency_Hz": 58000000000, "tx_antennas": [1], "mimo_mode": "off",
}  # fmt: skip


def run(*arguments: str | Path) -> str:
    result = CliRunner().invoke(cli.app, [str(argument) for argument in arguments], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return " ".join(result.output.split())


@pytest.fixture
def board(tmp_path: Path) -> Path:
    """Two frames of an AWR1843 in a folder without any JSON; half a packet's samples of the second are lost."""
    radar = Radar.load("awr1843")
    words = np.random.default_rng(0).integers(-500, 500, 2 * 2 * int(np.prod(radar.frame_shape))).astype("<i2")
    words[-2000:-1000] = 0
    (tmp_path / "hall").mkdir()
    words.tofile(tmp_path / "hall" / "adc_data.bin")
    return tmp_path / "hall"


def test_show_tells_of_files_levels_and_losses(board: Path) -> None:
    out = run("show", board, "--radar", "awr1843", "--no-pictures")
    assert "capture dca1000: " in out
    assert "described by the radar given" in out
    assert "2 × 128 × 3 × 4 × 256 (frame, chirp, tx, rx, sample) complex64, 2 frames, one each 100 ms" in out
    assert "scale none: samples are in LSB" in out
    assert "rms RX1 40" in out
    assert "largest value 500" in out
    assert "lost samples of 1 of 2 frames (zeros) frame 1: 0.13 %, in chirps 127, TX2, RX1, RX2, RX3" in out


def test_show_draws_a_capture_in_the_current_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of Infineon's boards the configuration names the board."""
    folder = tmp_path / "breathing"
    folder.mkdir()
    np.save(folder / "radar.npy", np.random.default_rng(0).integers(1000, 3000, (2, 3, 8, 64)).astype(np.uint16))
    (folder / "config.json").write_text(json.dumps({"device_config": {"fmcw_single_shape": CHIRPS}}))
    monkeypatch.chdir(tmp_path)
    run("show", "breathing")
    assert (tmp_path / "breathing.png").stat().st_size > 10_000
    assert (tmp_path / "breathing.gif").is_file()
    assert "exists and is kept" in run("show", folder)


@pytest.mark.filterwarnings("ignore::rfgen_sionna.signal.formats.CaptureWarning", "ignore:samples of 1 frames are lost")
def test_export_of_a_capture(board: Path, tmp_path: Path) -> None:
    """Without a scale the words stay what they are."""
    out = run("export", board, "--radar", "awr1843", "--format", "matlab", "--output", tmp_path / "a.mat")
    assert "2 frames, in LSB, 0 values clipped" in out
    first = read_capture(board, radar="awr1843")
    np.testing.assert_array_equal(read_capture(tmp_path / "a.mat").data, first.data)
    arguments = ("--format", "dca1000", "--scale", "1e-9", "--skip-lost")
    out = run("export", board, "--radar", "awr1843", *arguments, "--output", tmp_path / "b")
    assert "1 frames, 1e-09 √W per LSB" in out
    capture = open_capture(tmp_path / "b")
    assert (len(capture), capture.scale) == (1, 1e-9)  # the words are the same
    np.testing.assert_array_equal(capture.lsb(0), first.data[0])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), r"pass radar="),
        (("--board", "awr1843"), "--board is 'awr1843' without --radar"),
        (("--radar", "position2go"), "radar 'position2go', .* is at 24.12 GHz; a DCA1000 records devices of"),
    ],
)
def test_a_capture_that_cannot_be_opened(board: Path, arguments: tuple[str, ...], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        run("show", board, *arguments, "--no-pictures")


def test_options_of_captures_are_none_of_runs(tmp_path: Path) -> None:
    for command in (("show",), ("export", "--format", "dca1000", "--output", tmp_path / "x")):
        with pytest.raises(ValueError, match="--partial is for captures"):
            run(*command, tmp_path / "run.h5", "--partial")
    with pytest.raises(ValueError, match="--skip-lost is for captures"):
        run("export", tmp_path / "run.h5", "--format", "dca1000", "--output", tmp_path / "x", "--skip-lost")


def test_samples_on_the_disk_are_a_cube(board: Path) -> None:
    with pytest.warns(CaptureWarning, match="no configuration beside it"):
        capture = open_capture(board, radar="awr1843")
    assert (capture.adc.shape, capture.adc.dtype) == ((2, 128, 3, 4, 256), np.complex64)
    with pytest.warns(CaptureWarning, match="lost"):
        whole = capture.cube()
    np.testing.assert_array_equal(capture.adc[0:2], whole.data)
    np.testing.assert_array_equal(capture.adc.select((1,))[0], whole.data[1])
    assert isinstance(AdcCube(capture.adc, awr1843(), capture.frame_times), AdcCube)
