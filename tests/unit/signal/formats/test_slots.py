"""Codes, Doppler bands, beams and several kinds of chirps in the boards' files."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rfgen_sionna.radar import Radar, Slot
from rfgen_sionna.records import AdcCube
from rfgen_sionna.signal.formats import CaptureFormatError, open_capture, read_capture, write_capture
from tests.unit.signal.formats.captures import lsb_cube, shortened


def cube_of(radar: Radar, seed: int = 0) -> AdcCube:
    """Whole LSB in two frames."""
    rng = np.random.default_rng(seed)
    levels = rng.integers(-2048, 2048, size=(2, *radar.frame_shape, 2)).astype(np.float32)
    times = radar.waveform.frame_period * np.arange(2)
    return AdcCube(levels.view(np.complex64)[..., 0], radar, times, seed)


SLOTTED = {preset: shortened("awr1843", preset, 8, 6) for preset in ("bpm", "ddm", "near_far", "triangle")}
STEERED = shortened("mmwcas", "steered_left", 2, 4)


@pytest.mark.parametrize("preset", SLOTTED)
@pytest.mark.parametrize("capture_format", ["dca1000", "matlab"])
def test_every_kind_of_frame_comes_back(tmp_path: Path, preset: str, capture_format: str) -> None:
    cube = cube_of(SLOTTED[preset])
    write_capture(cube, tmp_path, capture_format)
    again = read_capture(tmp_path)
    np.testing.assert_array_equal(again.data, cube.data)
    assert again.radar == cube.radar


def test_samples_lie_slot_by_slot(tmp_path: Path) -> None:
    """Order frame, loop, slot, receiver, sample."""
    cube = cube_of(SLOTTED["near_far"])
    write_capture(cube, tmp_path, "dca1000", scale=1.0)
    words = np.fromfile(tmp_path / "adc_data.bin", "<i2").reshape(2, 8, 4, 4, 3, 2, 2)
    np.testing.assert_array_equal(words[..., 0, :].reshape(cube.data.shape), cube.data.real)


def tables(folder: Path) -> dict[str, object]:
    found: dict[str, object] = json.loads((folder / "adc_data.mmwave.json").read_text())["mmWaveDevices"][0]["rfConfig"]
    return found


def test_the_boards_json_lists_codes(tmp_path: Path) -> None:
    write_capture(cube_of(SLOTTED["bpm"]), tmp_path, "dca1000")
    rf = tables(tmp_path)
    assert rf["MIMOScheme"] == "BPM"
    enabled = [entry["rlChirpCfg_t"]["txEnable"] for entry in rf["rlChirps"]]  # type: ignore[attr-defined]
    assert enabled == ["0x5", "0x5"]
    # Bits 4 and 5 are TX3 between and during chirps.
    assert rf["rlBpmChirps"] == [{"rlBpmChirpCfg_t": {"chirpStartIdx": 1, "chirpEndIdx": 1, "constBpmVal": "0x30"}}]
    assert rf["rlRfPhaseShiftCfgs"] == []


def test_the_boards_json_lists_phases_of_the_loops_until_they_come_round(tmp_path: Path) -> None:
    """Four loops of one slot are one loop of four chirps; TX2 by 16, TX3 by 32 steps of 5.625 degrees."""
    write_capture(cube_of(SLOTTED["ddm"]), tmp_path, "dca1000")
    rf = tables(tmp_path)
    assert len(rf["rlChirps"]) == 4  # type: ignore[arg-type]
    assert rf["rlFrameCfg_t"]["numLoops"] == 2  # type: ignore[index]
    shifts = [entry["rlRfPhaseShiftCfg_t"] for entry in rf["rlRfPhaseShiftCfgs"]]  # type: ignore[attr-defined]
    assert [(s["chirpStartIdx"], s["tx0PhaseShift"], s["tx1PhaseShift"], s["tx2PhaseShift"]) for s in shifts] == [
        (1, 0, 16, 32),
        (2, 0, 32, 0),
        (3, 0, 48, 32),
    ]


@pytest.mark.parametrize("preset", SLOTTED)
def test_the_boards_json_alone_gives_the_frame(tmp_path: Path, preset: str) -> None:
    cube = cube_of(SLOTTED[preset])
    write_capture(cube, tmp_path, "dca1000", scale=1.0)
    (tmp_path / "adc_data.rfgen").unlink()
    hardware = Radar.load("awr1843")
    capture = open_capture(tmp_path, radar=hardware)
    found, wanted = capture.radar.waveform, cube.radar.waveform
    for mine, theirs in zip(found.profiles, wanted.profiles, strict=True):
        for name in theirs.__dataclass_fields__:
            assert getattr(mine, name) == pytest.approx(getattr(theirs, name), rel=1e-9)
    weights = np.broadcast_to(wanted.axis_weights, (wanted.num_loops, *wanted.axis_weights.shape[1:]))
    listed = np.broadcast_to(found.axis_weights, (found.num_loops, *found.axis_weights.shape[1:]))
    np.testing.assert_allclose(listed.reshape(-1, wanted.num_tx), weights.reshape(-1, wanted.num_tx), atol=1e-12)
    np.testing.assert_allclose(np.sort(found.chirp_times.ravel()), np.sort(wanted.chirp_times.ravel()), rtol=1e-9)
    np.testing.assert_array_equal(capture.frame(0).reshape(cube.data[0].shape), cube.data[0])


def test_the_cascade_steers(tmp_path: Path) -> None:
    cube = cube_of(STEERED)
    write_capture(cube, tmp_path / "run", "cascade", scale=1.0)
    np.testing.assert_array_equal(read_capture(tmp_path / "run").data, cube.data)
    (tmp_path / "run" / "capture.rfgen").unlink()
    found = open_capture(tmp_path / "run", radar=Radar.load("mmwcas")).radar
    assert found.tx_names == STEERED.tx_names
    np.testing.assert_allclose(found.waveform.axis_weights, STEERED.waveform.axis_weights, atol=1e-12)


def test_what_the_board_cannot_do_is_refused(tmp_path: Path) -> None:
    radar = SLOTTED["bpm"]
    odd = replace(radar, waveform=replace(radar.waveform, slots=(Slot((0.0, 61.0)),), phase_step_deg=0.0))
    with pytest.raises(CaptureFormatError, match=r"phase 61 degrees.*steps of 5\.625"):
        write_capture(cube_of(odd), tmp_path, "dca1000")
    with pytest.raises(CaptureFormatError, match="sets slot_starts or loop_time"):
        write_capture(cube_of(SLOTTED["near_far"].of_profile(1)), tmp_path, "dca1000")
    with pytest.raises(CaptureFormatError, match="has bpm slots of 1 profiles"):
        write_capture(cube_of(radar), tmp_path, "rfgenesis")
    doppler = shortened("position2go", "doppler", 8, 16)
    down = replace(doppler, waveform=replace(doppler.waveform, slope=-0.6e12))
    with pytest.raises(CaptureFormatError, match="upwards or of a constant frequency"):
        write_capture(cube_of(down), tmp_path, "position2go")
    assert not list(tmp_path.iterdir())
    long = Radar.load("awr1843", "ddm")
    slow = replace(long.waveform, slots=(Slot((0.0, 0.0, 0.0), 0, (0.0, 5.625 / 3, 90.0)),), num_loops=1024)
    turning = cube_of(replace(long, waveform=replace(slow, num_samples=2)))
    with pytest.raises(CaptureFormatError, match=r"repeat after \d+ loops.*device has 512"):
        write_capture(turning, tmp_path, "dca1000")


def test_a_constant_frequency_in_position2gos_files(tmp_path: Path) -> None:
    radar = shortened("position2go", "doppler", 8, 16)
    cube = lsb_cube(radar, 2, 2048)
    write_capture(cube, tmp_path, "position2go", scale=1.0)
    np.testing.assert_array_equal(read_capture(tmp_path).data, cube.data)
    (tmp_path / "position2go.rfgen").unlink()
    found = open_capture(tmp_path, radar=Radar.load("position2go", "doppler")).radar.waveform
    assert (found.slope, found.max_range) == (0.0, 30.0)
