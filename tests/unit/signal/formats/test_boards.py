"""Files as real boards leave them: no sidecar of ours, the tool's own JSON or XML, and what it leaves open."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rfgen_sionna.radar import Radar, Waveform
from rfgen_sionna.records import AdcCube
from rfgen_sionna.signal.formats import (
    CaptureFormatError,
    CaptureWarning,
    open_capture,
    radar_from_studio,
    read_capture,
    write_capture,
)
from tests.unit.signal.formats.captures import awr1843, cascade, lsb_cube, position2go, shortened


def as_from_a_board(cube: AdcCube, folder: Path, capture_format: str) -> None:
    write_capture(cube, folder, capture_format, scale=1.0)
    for sidecar in folder.glob("*.rfgen"):
        sidecar.unlink()


def close(found: Waveform, wanted: Waveform) -> bool:
    """Equal up to the digits that the tool's units leave."""
    return all(
        getattr(found, name) == getattr(wanted, name)
        or getattr(found, name) == pytest.approx(getattr(wanted, name), rel=1e-9)
        for name in Waveform.__dataclass_fields__
    )


def change(path: Path, keys: list[Any], value: Any) -> None:
    config = json.loads(path.read_text())
    at = config
    for key in keys[:-1]:
        at = at[key]
    if value is None:
        del at[keys[-1]]
    else:
        at[keys[-1]] = value
    path.write_text(json.dumps(config))


RF = ["mmWaveDevices", 0, "rfConfig"]
RAW = ["mmWaveDevices", 0, "rawDataCaptureConfig"]
PROFILE = [*RF, "rlProfiles", 0, "rlProfileCfg_t"]


@pytest.mark.parametrize(
    ("radar", "hardware"),
    [
        (awr1843(), Radar.load("awr1843", "mmmesh")),
        (replace(Radar.load("awr1843", "di_gesture")), Radar.load("awr1843", "mmmesh")),
        (cascade(), Radar.load("mmwcas")),
    ],
)
def test_the_tools_own_json_gives_waveform_and_elements(tmp_path: Path, radar: Radar, hardware: Radar) -> None:
    """DI-Gesture fires two of the three Tx of the hardware."""
    capture_format = "cascade" if radar.name == "mmwcas" else "dca1000"
    cube = lsb_cube(radar, 2, 32768)
    as_from_a_board(cube, tmp_path, capture_format)
    capture = open_capture(tmp_path, radar=hardware)
    assert (capture.scale, capture.seed, capture.radar.tx_names) == (None, None, radar.tx_names)
    assert close(capture.radar.waveform, radar.waveform)
    np.testing.assert_array_equal(capture.radar.tx_positions, radar.tx_positions)
    np.testing.assert_allclose(capture.frame_times, cube.frame_times - 1.5, atol=1e-9)
    with pytest.warns(CaptureWarning, match="declares no scale"):
        back = read_capture(tmp_path, radar=hardware)
    np.testing.assert_array_equal(back.data, cube.data)


def test_position2gos_own_xml_gives_the_ramp(tmp_path: Path) -> None:
    cube = lsb_cube(position2go(), 3, 2048)
    as_from_a_board(cube, tmp_path, "position2go")
    capture = open_capture(tmp_path, radar=Radar.load("position2go"))
    assert close(capture.radar.waveform, cube.radar.waveform)
    assert capture.scale is None
    np.testing.assert_array_equal(capture.cube().data, cube.data)


def test_position2go_files_of_one_frame_each_are_a_sequence(tmp_path: Path) -> None:
    cube = lsb_cube(position2go(), 3, 2048)
    for frame in range(3):
        one = replace(cube, data=cube.data[frame : frame + 1], frame_times=cube.frame_times[frame : frame + 1])
        write_capture(one, tmp_path / f"run_{frame}.raw", "position2go", scale=1.0)
    for sidecar in tmp_path.glob("*.rfgen"):
        sidecar.unlink()
    capture = open_capture(tmp_path, radar=cube.radar)
    assert len(capture.paths) == len(capture) == 3
    np.testing.assert_array_equal(capture.cube().data, cube.data)
    np.testing.assert_allclose(capture.frame_times, [0, 0.1, 0.2])


@pytest.mark.parametrize("capture_format", ["dca1000", "cascade", "position2go", "rfgenesis"])
def test_without_a_word_on_the_radar_one_is_asked_for(tmp_path: Path, capture_format: str) -> None:
    radar = {"cascade": cascade(), "position2go": position2go()}.get(capture_format, awr1843())
    cube = lsb_cube(radar, 2, 1000)
    as_from_a_board(cube, tmp_path, capture_format)
    with pytest.raises(CaptureFormatError, match=r"beside it with its radar: pass radar="):
        open_capture(tmp_path)
    for config in [*tmp_path.glob("*.json"), *tmp_path.glob("*.xml")]:
        config.unlink()
    capture = open_capture(tmp_path, radar=radar)
    assert capture.radar == radar
    np.testing.assert_array_equal(capture.cube().data, cube.data)


def test_a_board_that_ran_until_it_was_stopped(tmp_path: Path) -> None:
    """numFrames is 0 then: the file tells."""
    cube = lsb_cube(awr1843(), 3, 1000)
    as_from_a_board(cube, tmp_path, "dca1000")
    change(tmp_path / "adc_data.mmwave.json", [*RF, "rlFrameCfg_t", "numFrames"], 0)
    assert len(open_capture(tmp_path, radar=awr1843())) == 3
    change(tmp_path / "adc_data.mmwave.json", [*RF, "rlFrameCfg_t", "numFrames"], 4)
    with pytest.raises(CaptureFormatError, match=r"4 frames of 1,152 bytes are 4,608: 1,152 bytes are missing"):
        open_capture(tmp_path, radar=awr1843())


def test_i_and_q_swapped(tmp_path: Path) -> None:
    cube = lsb_cube(awr1843(), 1, 1000)
    as_from_a_board(cube, tmp_path, "dca1000")
    change(tmp_path / "adc_data.mmwave.json", [*RAW, "rlDevDataFmtCfg_t", "iqSwapSel"], 1)
    swapped = open_capture(tmp_path, radar=awr1843()).frame(0)
    np.testing.assert_array_equal(swapped, cube.data[0].imag + 1j * cube.data[0].real)


@pytest.mark.parametrize(
    ("keys", "value", "message"),
    [
        ([*RF, "waveformType"], "continuousWave", "waveformType is 'continuousWave'; supported"),
        (
            [*RF, "rlRfPhaseShiftCfgs"],
            [{"rlRfPhaseShiftCfg_t": {"chirpStartIdx": 0, "chirpEndIdx": 0, "tx0PhaseShift": 90.0}}],
            "tx0PhaseShift is 90; a number of steps of 5.625 degrees, 0 … 63",
        ),
        ([*RF, "waveformType"], "advancedFrameChirp", "lacks 'rlAdvFrameCfg_t'"),
        ([*RF, "rlAdcOutCfg_t", "fmt", "b2AdcOutFmt"], 3, "b2AdcOutFmt 3; 16 bits (2) and real (0) or complex"),
        ([*RF, "rlAdcOutCfg_t", "fmt", "b2AdcBits"], 1, "16 bits"),
        ([*RF, "rlProfiles"], [], "rlProfiles has 0 profiles"),
        ([*RF, "rlChirps", 1, "rlChirpCfg_t", "profileId"], 3, "rlChirps use profile 3; rlProfiles has [0]"),
        ([*RF, "rlChirps", 1, "rlChirpCfg_t", "txEnable"], "0x0", "chirp 1 fires no Tx"),
        ([*RF, "rlChanCfg_t"], None, "lacks 'rlChanCfg_t'"),
        ([*RAW, "rlDevDataFmtCfg_t", "chInterleave"], 2, "chInterleave is 2; 0 or 1"),
        ([*RAW, "rlDevLaneEnable_t", "laneEn"], "0x7", "laneEn is '0x7'; two lanes (0x3) or four (0xF)"),
        ([*PROFILE, "numAdcSamples"], "many", "many"),
        ([*PROFILE, "rampEndTime_usec"], 1.0, "ADC window ends"),
        (["mmWaveDevices"], [], "mmWaveDevices has 0 entries; 1 or 4"),
    ],
)
def test_what_cannot_be_followed_is_named(tmp_path: Path, keys: list[Any], value: Any, message: str) -> None:
    as_from_a_board(lsb_cube(awr1843(), 1, 100), tmp_path, "dca1000")
    config = tmp_path / "adc_data.mmwave.json"
    change(config, keys, value)
    with pytest.raises(CaptureFormatError) as caught:
        radar_from_studio(config, awr1843())
    assert message in str(caught.value)
    assert "adc_data.mmwave.json" in str(caught.value)


@pytest.mark.parametrize(("field", "value"), [("transferFmtPkt0", "0x6"), ("transferFmtPkt1", "0xE")])
def test_packets_of_more_than_samples_are_refused(tmp_path: Path, field: str, value: str) -> None:
    """Chirp parameters and quality data, which `rawDataReader` refuses too; the chirps are a radar all the same."""
    as_from_a_board(lsb_cube(awr1843(), 1, 100), tmp_path, "dca1000")
    config = tmp_path / "adc_data.mmwave.json"
    change(config, [*RAW, "rlDevDataPathCfg_t", field], value)
    with pytest.raises(CaptureFormatError, match=f"{field} is '{value}'"):
        open_capture(tmp_path, radar="awr1843")
    assert Radar.load(config, board="awr1843").frame_shape == awr1843().frame_shape


def test_elements_that_the_hardware_lacks(tmp_path: Path) -> None:
    as_from_a_board(lsb_cube(awr1843(), 1, 100), tmp_path, "dca1000")
    changed = Radar.load("awr1843", "di_gesture", overrides={"receiver.noise_figure_db": 9.0})
    with pytest.raises(CaptureFormatError, match="TX2 fires; radar 'awr1843' has TX1, TX3"):
        open_capture(tmp_path, radar=changed)


def test_a_board_has_all_its_tx_whatever_its_preset_fires(tmp_path: Path) -> None:
    """The AWR2944EVM's default preset fires three of four Tx."""
    radar = shortened("awr2944evm", "four_tx", 3, 8)
    cube = lsb_cube(radar, 1, 100)
    as_from_a_board(cube, tmp_path, "dca1000")
    for hardware in ("awr2944evm", Radar.load("awr2944evm", position=(1, 2, 3), orientation=(0.1, 0, 0))):
        capture = open_capture(tmp_path, radar=hardware)
        assert capture.radar.tx_names == ("TX1", "TX2", "TX3", "TX4")
        assert capture.radar.preset == "frame"  # no preset of the board
        np.testing.assert_array_equal(capture.radar.tx_positions, radar.tx_positions)
        np.testing.assert_array_equal(capture.frame(0), cube.data[0])
    assert capture.radar.position == (1, 2, 3)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("RADAR_SIGNAL_I_AND_Q", "RADAR_SIGNAL_ONLY_I", "signalPart is 'RADAR_SIGNAL_ONLY_I'"),
        ("samplerateHz", "rate", "lacks the element Device/AdcxmcEndpoint/AdcxmcConfiguration/samplerateHz"),
        ("<rxMask>3<", "<rxMask>7<", "rxMask is 7"),
        ("<numSamplesPerChirp>8<", "<numSamplesPerChirp>x<", "'x'"),
        ("</Device>", "", "is not XML"),
    ],
)
def test_an_xml_that_cannot_be_followed(tmp_path: Path, old: str, new: str, message: str) -> None:
    as_from_a_board(lsb_cube(position2go(), 1, 100), tmp_path, "position2go")
    path = tmp_path / "position2go.xml"
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(CaptureFormatError) as caught:
        open_capture(tmp_path, radar=position2go())
    assert message in str(caught.value)


@pytest.mark.parametrize("unit", [1e-6, 1e-9, 1e-3])
def test_cascade_times_in_the_unit_of_the_host(tmp_path: Path, unit: float) -> None:
    """Time stamps count from when the host was switched on, and their unit shows in the frame period."""
    as_from_a_board(lsb_cube(cascade(), 3, 100), tmp_path, "cascade")
    for index in tmp_path.glob("*_idx.bin"):
        content = bytearray(index.read_bytes())
        for frame, time in enumerate([77.0, 77.1, 77.3]):
            at = 24 + 48 * frame + 32
            content[at : at + 8] = round(time / unit).to_bytes(8, "little")
        index.write_bytes(content)
    np.testing.assert_allclose(open_capture(tmp_path, radar=cascade()).frame_times, [0, 0.1, 0.3], atol=1e-9)


def test_cascade_files_allocated_in_advance_and_the_masters_index_alone(tmp_path: Path) -> None:
    cube = lsb_cube(cascade(), 2, 100)
    as_from_a_board(cube, tmp_path, "cascade")
    for data in tmp_path.glob("*_data.bin"):
        with data.open("ab") as stream:
            stream.write(bytes(100_000))
    for index in tmp_path.glob("slave*_idx.bin"):
        index.unlink()
    np.testing.assert_array_equal(
        open_capture(tmp_path / "master_0000_data.bin", radar=cascade()).cube().data, cube.data
    )
