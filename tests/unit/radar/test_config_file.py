"""Radars by name, and files of all vendors by their content."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rfgen_sionna.radar import Radar
from rfgen_sionna.radar.board_frames import RadarConfigWarning
from rfgen_sionna.radar.config import RadarConfigError
from rfgen_sionna.signal.formats import radar_from_studio
from rfgen_sionna.signal.formats.mmwave_studio import read_studio
from rfgen_sionna.signal.formats.mmwave_studio_export import studio_config
from tests.unit.signal.formats.captures import BGT60_SHAPE as SHAPE


def written(path: Path, record: Any) -> Path:
    path.write_text(json.dumps(record), encoding="utf-8")
    return path


def studio(preset: str = "mmmesh", name: str = "awr1843", devices: int = 1) -> dict[str, Any]:
    return studio_config(Radar.load(name, preset), 10, devices)


def rf(config: dict[str, Any]) -> dict[str, Any]:
    found: dict[str, Any] = config["mmWaveDevices"][0]["rfConfig"]
    return found


@pytest.mark.parametrize(
    ("name", "board"),
    [
        ("AWR1843", "awr1843"),
        ("awr1843boost", "awr1843"),
        ("AWR1843-BOOST", "awr1843"),
        ("IWR6843ISK", "iwr6843isk"),
        ("IWR6843ISK-ODS", "iwr6843isk_ods"),
        ("iwr1443", "iwr1443boost"),
        ("Awr1642", "awr1642boost"),
        ("AWR2944", "awr2944evm"),
        ("xwr1843", "awr1843"),
        ("IWR1843BOOST", "awr1843"),
        ("AWR1443BOOST", "iwr1443boost"),
        ("BGT60TR13C", "bgt60tr13c"),
        ("MMWCAS-RF-EVM", "mmwcas"),
        ("Position2Go", "position2go"),
    ],
)
def test_names_in_any_case_with_or_without_the_vendors_suffix(name: str, board: str) -> None:
    assert Radar.load(name) == Radar.load(board)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("iwr6843", "boards at 57 … 64 GHz: bgt60tr13c, iwr6843"),
        ("AWR2243", "boards at 76 … 81 GHz: awr1642boost, awr1843, awr2944evm, iwr1443boost, mmwcas; at other"),
        ("bgt60ltr11", "boards at 57 … 64 GHz: bgt60tr13c"),
        ("distance2go", "boards at 24 … 24.25 GHz: position2go, position2go_v11; at other frequencies: awr1642boost"),
        ("awr1834", "did you mean 'awr1843'"),
        ("lidar", "available: awr1642boost, awr1843"),
    ],
)
def test_unknown_names_are_answered_with_boards_of_their_band(name: str, said: str) -> None:
    with pytest.raises(ValueError, match=f"no radar is called '{name}'") as caught:
        Radar.load(name)
    assert said in str(caught.value)


def test_a_board_needs_no_board() -> None:
    with pytest.raises(RadarConfigError, match="board is 'mmwcas', but radar 'awr1843' is a board itself"):
        Radar.load("awr1843", board="mmwcas")


def test_infineon_configuration(tmp_path: Path) -> None:
    """64 samples at 2 MHz fill a ramp of 32 us over 5.5 GHz; the rest of 591 us is idle."""
    radar = Radar.load(written(tmp_path / "config.json", {"device_config": {"fmcw_single_shape": SHAPE}}))
    wave = radar.waveform
    assert (radar.name, radar.preset, radar.adc.real) == ("bgt60tr13c", "frame", True)
    assert radar.frame_shape == (8, 1, 3, 64)
    assert wave.slope == pytest.approx(5.5e9 / 32e-6, rel=1e-12)
    assert wave.sampled_band == pytest.approx((58e9, 63.5e9), rel=1e-12)
    assert wave.loop_period == pytest.approx(591.125e-6, rel=1e-6)
    assert wave.frame_period == 0.07726884633302689
    assert radar.range_resolution == pytest.approx(0.02725, abs=1e-5)  # c / 2B


def test_layouts_of_infineon_are_the_same_radar(tmp_path: Path) -> None:
    radar = Radar.load(written(tmp_path / "a.json", {"device_config": {"fmcw_single_shape": SHAPE}}))
    older = dict(SHAPE)
    older["lower_frequency_Hz"], older["upper_frequency_Hz"] = (
        older.pop("start_frequency_Hz"),
        older.pop("end_frequency_Hz"),
    )
    chirp = {
        "start_frequency_Hz": 58e9,
        "end_frequency_Hz": 63.5e9,
        "sample_rate_Hz": 2e6,
        "num_samples": 64,
        "rx_mask": 7,
        "tx_mask": 1,
        "tx_power_level": 31,
    }
    period, frame = SHAPE["chirp_repetition_time_s"], SHAPE["frame_repetition_time_s"]
    simple = {"chirp_repetition_time_s": period, "frame_repetition_time_s": frame, "num_chirps": 8, "tdm_mimo": False}
    loop = {"type": "loop", "num_repetitions": 8, "repetition_time_s": period, "sequence": [chirp | {"type": "chirp"}]}
    records = [
        {"device_config": {"fmcw_single_shape": older}},
        {"fmcw_single_shape": SHAPE},
        simple | {"chirp": chirp},
        {"device_info": {}, "sequence": [{"repetition_time_s": frame, "sequence": [loop]}]},
        {"sequence": {"loop": {"repetition_time_s": frame, "num_repetitions": 0, "sub_sequence": {"loop": loop}}}},
    ]
    for record in records:
        assert Radar.load(written(tmp_path / "b.json", record)) == radar


def test_fewer_receivers_of_infineon(tmp_path: Path) -> None:
    radar = Radar.load(written(tmp_path / "c.json", {"fmcw_single_shape": SHAPE | {"rx_antennas": [1, 3]}}))
    assert radar.rx_names == ("RX1", "RX3")
    np.testing.assert_array_equal(radar.rx_positions, Radar.load("bgt60tr13c").rx_positions[[0, 2]])


@pytest.mark.parametrize(
    ("record", "said"),
    [
        ({"fmcw_single_shape": SHAPE | {"tx_antennas": [1, 2], "mimo_mode": "tdm"}}, "TX2 fires; radar 'bgt60tr13c'"),
        ({"fmcw_single_shape": SHAPE | {"rx_antennas": [4]}}, "RX4 is enabled; radar 'bgt60tr13c' has RX1, RX2, RX3"),
        ({"fmcw_single_shape": SHAPE | {"mimo_mode": "ddm"}}, "mimo_mode is 'ddm'"),
        (
            {"fmcw_single_shape": SHAPE | {"chirp_repetition_time_s": 1e-5}},
            "a chirp of 3.2e-05 s (64 samples) does not",
        ),
        ({"fmcw_single_shape": SHAPE | {"start_frequency_Hz": 24e9}}, "'bgt60tr13c' reaches 58 … 63.5 GHz"),
        ({"fmcw_single_shape": {"rx_antennas": [1]}}, "start_frequency_Hz and end_frequency_Hz"),
        ({"device_config": {"fmcw_scene": {"max_range_m": 5}}}, "fmcw_scene has requirements"),
        ({"device_config": {"lorem": 1}}, "device_config has lorem"),
        ({"sequence": [{"repetition_time_s": 1, "sequence": [{}, {}]}]}, "the frame's loop has 2 elements"),
    ],
)
def test_what_infineon_can_and_a_radar_cannot_is_named(tmp_path: Path, record: Any, said: str) -> None:
    with pytest.raises(RadarConfigError) as caught:
        Radar.load(written(tmp_path / "config.json", record))
    assert said in str(caught.value)
    assert "config.json" in str(caught.value)


def test_less_power_than_the_boards_is_said(tmp_path: Path) -> None:
    path = written(tmp_path / "config.json", {"fmcw_single_shape": SHAPE | {"tx_power_level": 10}})
    with pytest.warns(
        RadarConfigWarning, match="tx_power_level is 10; the power of the board's file is that of level 31"
    ):
        Radar.load(path)


def test_a_configuration_of_mmwave_studio(tmp_path: Path) -> None:
    path = written(tmp_path / "test.mmwave.json", studio())
    radar = Radar.load(path, board="awr1843")
    assert radar.waveform == Radar.load("awr1843", "mmmesh").waveform
    assert radar_from_studio(str(path), "AWR1843") == radar
    with pytest.raises(
        RadarConfigError, match=r"gives no board.*boards at 77\.36 … 80\.85 GHz .*: awr1843, iwr1443boost$"
    ):
        Radar.load(path)
    cascade = written(tmp_path / "cascade.mmwave.json", studio("ti_default", "mmwcas", 4))
    assert Radar.load(cascade, board="mmwcas").frame_shape == (64, 12, 16, 256)
    with pytest.raises(RadarConfigError, match=r"TX12 and RX16: mmwcas$"):
        Radar.load(cascade)


def test_a_setup_leads_to_its_configuration_and_device(tmp_path: Path) -> None:
    written(tmp_path / "run.mmwave.json", studio())
    setup = {"configUsed": "C:\\ti\\work\\run.mmwave.json", "mmWaveDevice": "awr1843", "capturedFiles": {}}
    path = written(tmp_path / "run.setup.json", setup)
    assert Radar.load(path).waveform == Radar.load("awr1843", "mmmesh").waveform
    setup["mmWaveDevice"] = "xwr18xx"
    with pytest.raises(RadarConfigError, match="gives the device 'xwr18xx', and the antennas are the board's: name it"):
        Radar.load(written(path, setup))
    assert Radar.load(path, board="iwr1443boost").name == "iwr1443boost"
    # The setup gives the device of its configuration, too.
    setup["mmWaveDevice"] = "AWR1843"
    written(path, setup)
    assert Radar.load(tmp_path / "run.mmwave.json").name == "awr1843"
    setup["configUsed"] = "other.mmwave.json"
    with pytest.raises(RadarConfigError, match=r"there is no 'other\.mmwave\.json' beside it"):
        Radar.load(written(path, setup))


def test_variations_phases_and_power_of_mmwave_studio_count(tmp_path: Path) -> None:
    config = studio()
    chirp = rf(config)["rlChirps"][1]["rlChirpCfg_t"]
    chirp |= {
        "startFreqVar_MHz": 1.0,
        "freqSlopeVar_KHz_usec": 48.0,
        "idleTimeVar_usec": 3,
        "adcStartTimeVar_usec": 0.5,
    }
    rf(config)["rlProfiles"][0]["rlProfileCfg_t"] |= {"txOutPowerBackoffCode": "0x030303", "txPhaseShifter": "0x4000"}
    path = written(tmp_path / "test.mmwave.json", config)
    hardware = Radar.load("awr1843")
    for radar in (Radar.load(path, board="awr1843"), radar_from_studio(path, hardware)):
        varied = radar.waveform.profiles[1]
        assert (varied.start_frequency, varied.slope) == (77.001e9, 60.06e12)
        assert (varied.idle_time, varied.adc_start_time) == (10e-6, 6.5e-6)
        assert radar.axis_names == ("0:TX1", "1:TX3", "2:TX2@90")
        assert radar.tx_power_dbm == 9.0


def test_chirps_that_change_while_the_radar_runs_are_refused(tmp_path: Path) -> None:
    config = studio()
    rf(config)["rlDynChirpCfgs"] = [{"rlDynChirpCfg_t": {"isConfigured": 0}}]
    path = written(tmp_path / "test.mmwave.json", config)
    assert Radar.load(path, board="awr1843").waveform == Radar.load("awr1843").waveform
    rf(config)["rlDynPerChirpPhShftCfgs"] = [{"rlDynPerChirpPhShftCfg_t": {"chirpSegSel": 0}}]
    with pytest.raises(RadarConfigError, match="rlDynPerChirpPhShftCfgs is not empty"):
        Radar.load(written(path, config), board="awr1843")


def test_kinds_of_samples_and_lanes_of_mmwave_studio(tmp_path: Path) -> None:
    config = studio()
    rf(config)["rlAdcOutCfg_t"]["fmt"]["b2AdcOutFmt"] = 0
    raw = config["mmWaveDevices"][0]["rawDataCaptureConfig"]
    raw["rlDevLaneEnable_t"]["laneEn"], raw["rlDevDataFmtCfg_t"]["chInterleave"] = "0xF", 0
    found = read_studio(written(tmp_path / "test.mmwave.json", config), Radar.load("awr1843"))
    assert (found.radar.adc.real, found.lanes, found.interleaved) == (True, 4, True)
    found = read_studio(written(tmp_path / "test.mmwave.json", studio()), Radar.load("awr1843"))
    assert (found.radar.adc.real, found.lanes, found.interleaved) == (False, 2, False)


def test_a_fourth_tx_through_mmwave_studio(tmp_path: Path) -> None:
    path = written(tmp_path / "test.mmwave.json", studio("four_tx", "awr2944evm"))
    assert Radar.load(path, board="awr2944evm").waveform == Radar.load("awr2944evm", "four_tx").waveform
    with pytest.raises(ValueError, match="b2AdcOutFmt is that of complex samples; radar 'awr2944evm' has real ones"):
        radar_from_studio(written(path, studio()), Radar.load("awr2944evm"))


def advanced() -> dict[str, Any]:
    config = studio()
    frame = rf(config).pop("rlFrameCfg_t")
    subframes = [
        {
            "forceProfileIdx": 0,
            "chirpStartIdx": first,
            "numOfChirps": count,
            "numLoops": loops,
            "burstPeriodicity_msec": 50.0,
            "chirpStartIdxOffset": 0,
            "numOfBurst": 1,
            "numOfBurstLoops": 1,
            "subFramePeriodicity_msec": 50.0,
        }
        for first, count, loops in ((0, 2, 64), (2, 1, 32))
    ]
    rf(config)["waveformType"] = "advancedFrameChirp"
    rf(config)["rlAdvFrameCfg_t"] = {
        "frameSeq": {
            "numOfSubFrames": 2,
            "forceProfile": 0,
            "numFrames": frame["numFrames"],
            "subFrameCfg": [{"rlSubFrameCfg_t": subframe} for subframe in subframes],
        }
    }
    return config


def test_subframes_of_mmwave_studio_are_presets(tmp_path: Path) -> None:
    path = written(tmp_path / "test.mmwave.json", advanced())
    first = Radar.load(path, "subframe0", board="awr1843")
    assert (first.tx_names, first.frame_shape[0], first.waveform.frame_period) == (("TX1", "TX3"), 64, 0.1)
    second = radar_from_studio(path, Radar.load("awr1843"), "subframe1")
    assert (second.tx_names, second.frame_shape[0], second.preset) == (("TX2",), 32, "subframe1")
    with pytest.raises(ValueError, match="'advancedFrameChirp' with subframe0, subframe1; a frame of one kind"):
        read_studio(path, Radar.load("awr1843"))
    bursts = copy.deepcopy(advanced())
    rf(bursts)["rlAdvFrameCfg_t"]["frameSeq"]["subFrameCfg"][1]["rlSubFrameCfg_t"]["numOfBurst"] = 2
    with pytest.raises(RadarConfigError, match=r"subFrameCfg\[1\]: numOfBurst is 2; one burst"):
        Radar.load(written(path, bursts), "subframe0", board="awr1843")


def test_60_ghz_is_refused_wherever_it_comes_from(tmp_path: Path) -> None:
    config = studio()
    rf(config)["rlProfiles"][0]["rlProfileCfg_t"]["startFreqConst_GHz"] = 60.25
    path = written(tmp_path / "test.mmwave.json", config)
    record = Radar.load("awr1843").to_dict()
    record["waveform"]["start_frequency"] = 60.25e9
    loads = (
        lambda: Radar.load(path, board="awr1843"),
        lambda: radar_from_studio(path, Radar.load("awr1843")),
        lambda: Radar.load("awr1843", overrides={"preset.mmmesh.start_frequency_hz": 60.25e9}),
        lambda: Radar.from_dict(record),
    )
    for load in loads:
        with pytest.raises(
            ValueError, match=r"waveform samples 60\.6101 … 64\.1017 GHz; 'awr1843' reaches 76 … 81 GHz"
        ):
            load()
    del record["frequency_range"]  # older records do not have it
    assert Radar.from_dict(record).frequency_range is None


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("frames.bin", b"\0\1\2\3", "is binary"),
        ("notes.txt", b"what I did today", "is no radar file: a radar file in TOML, a .cfg of TI's mmWave SDK"),
        ("run.lua", b"ar1.ProfileConfig(0, 77, 7)\n", "a Lua script of mmWave Studio"),
        ("cf.json", b'{"DCA1000Config": {}}', "has the keys DCA1000Config and is no radar file"),
        ("adc_data.rfgen", b'{"format": "rfgen-capture"}', "the sidecar of a capture: open_capture"),
        ("broken.json", b'{"mmWaveDevices": [', "is not JSON"),
        ("empty.mmwave.json", b'{"mmWaveDevices": []}', "mmWaveDevices has 0 entries"),
    ],
)
def test_other_files_are_refused_with_what_is_taken(tmp_path: Path, name: str, content: bytes, said: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(RadarConfigError) as caught:
        Radar.load(tmp_path / name, board="awr1843")
    assert said in str(caught.value)
    assert name in str(caught.value)


def test_a_folder_is_no_file(tmp_path: Path) -> None:
    with pytest.raises(RadarConfigError, match="is a folder"):
        Radar.load(tmp_path)


def test_content_counts_and_not_the_suffix(tmp_path: Path, radar_file: Any) -> None:
    radar_file.load()
    (tmp_path / "mine.txt").write_bytes(radar_file.path.read_bytes())
    assert Radar.load(tmp_path / "mine.txt") == Radar.load("awr1843")
    path = written(tmp_path / "mmwave.cfg", studio())
    assert Radar.load(path, board="awr1843").waveform == Radar.load("awr1843").waveform


def test_text_in_utf_16(tmp_path: Path) -> None:
    path = tmp_path / "mine.cfg"
    path.write_text(Radar.load("awr1843").to_cfg(), encoding="utf-16")
    assert Radar.load(path, board="awr1843").waveform == Radar.load("awr1843").waveform


def test_the_device_that_infineons_tools_name_counts(tmp_path: Path) -> None:
    device = {"baseboard_name": "Radar Baseboard MCU7", "device_name": "BGT60TR13C"}
    record: dict[str, Any] = {"device_config": {"fmcw_single_shape": SHAPE}, "device_info": device}
    assert Radar.load(written(tmp_path / "a.json", record)).name == "bgt60tr13c"
    device["device_name"] = "BGT60UTR11AIP"
    path = written(tmp_path / "b.json", record)
    with pytest.raises(RadarConfigError, match=r"b.json gives the device 'BGT60UTR11AIP'.* name it, board="):
        Radar.load(path)
    assert Radar.load(path, board="bgt60tr13c").name == "bgt60tr13c"
