"""A tool's own configuration that is damaged, or that says other things than the sidecar or the file's size."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rfgen_sionna.radar import Radar
from rfgen_sionna.signal.formats import CaptureFormatError, CaptureWarning, open_capture, read_capture, write_capture
from tests.unit.signal.formats.captures import RADARS, awr1843, lsb_cube, position2go

CONFIGS = {
    "dca1000": "adc_data.mmwave.json",
    "cascade": "{folder}.mmwave.json",
    "position2go": "position2go.xml",
    "infineon": "config.json",
    "rfgenesis": "radar_frames_config.json",
}
RF = ("mmWaveDevices", 0, "rfConfig")


def refused_but_readable(folder: Path, message: str) -> None:
    """The sidecar says enough to read on."""
    with pytest.raises(CaptureFormatError, match=message):
        read_capture(folder)
    with pytest.warns(CaptureWarning, match=message):
        assert len(read_capture(folder, partial=True).data) == 2


@pytest.mark.parametrize("capture_format", sorted(CONFIGS))
def test_a_damaged_configuration_is_told_of(tmp_path: Path, capture_format: str) -> None:
    write_capture(lsb_cube(RADARS[capture_format], 2, 1000), tmp_path, capture_format)
    config = tmp_path / CONFIGS[capture_format].format(folder=tmp_path.name)
    content = config.read_bytes()
    config.write_bytes(content[: len(content) // 2])
    refused_but_readable(tmp_path, f"{re.escape(config.name)}' is not (JSON|XML)")
    config.write_bytes(b"\xff\xfe\x00")
    refused_but_readable(tmp_path, f"{re.escape(config.name)}' is not (JSON|XML)")
    config.write_bytes(content)
    assert len(read_capture(tmp_path).data) == 2
    config.unlink()  # the sidecar needs none
    assert len(read_capture(tmp_path).data) == 2


@pytest.mark.parametrize(
    ("keys", "value", "message"),
    [
        (("rlProfiles", 0, "rlProfileCfg_t", "numAdcSamples"), 8, r"numAdcSamples is 8; 6 by 'adc_data.rfgen'"),
        (("rlProfiles", 0, "rlProfileCfg_t", "freqSlopeConst_MHz_usec"), 60.0, r"freqSlopeConst_MHz_usec is 60.0"),
        (("rlProfiles", 0, "rlProfileCfg_t", "digOutSampleRate"), "fast", "digOutSampleRate is 'fast'; 4400"),
        (("rlFrameCfg_t", "numFrames"), 3, "numFrames is 3; 2"),
        (("rlFrameCfg_t", "numLoops"), None, "numLoops is missing"),
        (("rlFrameCfg_t", "framePeriodicity_msec"), 50, "framePeriodicity_msec is 50; 100"),
        (("rlChanCfg_t", "rxChannelEn"), "0x7", "rxChannelEn is '0x7'"),
        (("rlChirps", 1, "rlChirpCfg_t", "txEnable"), "0x2", r"rlChirps\[1\].rlChirpCfg_t.txEnable is '0x2'; '0x4'"),
        (("rlChirps",), [], r"rlChirps\[0\]"),
        (("rlBpmChirps",), [{"rlBpmChirpCfg_t": {}}], "the number of .*rlBpmChirps is 1; 0"),
        (("rlProfiles",), "none", r"rlProfiles\[0\].rlProfileCfg_t.profileId is missing"),
    ],
)
def test_a_field_of_the_json_that_contradicts_the_sidecar_is_named(
    tmp_path: Path, keys: tuple[Any, ...], value: Any, message: str
) -> None:
    write_capture(lsb_cube(awr1843(), 2, 1000), tmp_path)
    path = tmp_path / "adc_data.mmwave.json"
    config = json.loads(path.read_text())
    at = config
    for key in (*RF, *keys[:-1]):
        at = at[key]
    if value is None:
        del at[keys[-1]]
    else:
        at[keys[-1]] = value
    path.write_text(json.dumps(config))
    refused_but_readable(tmp_path, message)


def test_what_the_capture_does_not_hold_may_differ(tmp_path: Path) -> None:
    """Gains, filters and notes are the user's; a number may be written otherwise."""
    write_capture(lsb_cube(awr1843(), 2, 1000), tmp_path)
    path = tmp_path / "adc_data.mmwave.json"
    config = json.loads(path.read_text())
    rf = config["mmWaveDevices"][0]["rfConfig"]
    rf["rlProfiles"][0]["rlProfileCfg_t"] |= {"rxGain_dB": "0x20", "numAdcSamples": 6.0, "hpfCornerFreq1": 1}
    rf["rlChanCfg_t"]["rxChannelEn"] = "0x0f"
    config["systemConfig"]["summary"] = "of mine"
    path.write_text(json.dumps(config))
    assert len(read_capture(tmp_path).data) == 2


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (">8<", ">16<", "BaseEndpoint/FrameFormat/numSamplesPerChirp is '16'; '8' by 'position2go.rfgen'"),
        ("<rxMask>3<", "<rxMask>1<", "rxMask is '1'"),
        ("RADAR_SIGNAL_I_AND_Q", "RADAR_SIGNAL_ONLY_I", "signalPart is 'RADAR_SIGNAL_ONLY_I'"),
        ("samplerateHz", "rate", "samplerateHz is missing"),
        ('acquisitionRate="', 'acquisitionRate="9', "Acquisition/@acquisitionRate is '9"),
    ],
)
def test_an_element_of_the_xml_that_contradicts_the_sidecar_is_named(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    write_capture(lsb_cube(position2go(), 2, 1000), tmp_path, "position2go")
    path = tmp_path / "position2go.xml"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    refused_but_readable(tmp_path, message)


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("numAdcSamples", 4, "the size is that of whole frames"),
        ("numAdcSamples", 8, "the size is that of whole frames"),
        ("numLoops", 3, "the size is that of whole frames"),
        ("numFrames", 3, "bytes are too many"),
    ],
)
def test_a_json_that_does_not_fit_the_file_scrambles_nothing(
    tmp_path: Path, field: str, value: int, message: str
) -> None:
    """A real board's capture has no sidecar: with partial=True, too, sizes must be those of a capture cut off."""
    write_capture(lsb_cube(awr1843(), 4, 1000), tmp_path)
    (tmp_path / "adc_data.rfgen").unlink()
    path = tmp_path / "adc_data.mmwave.json"
    config = json.loads(path.read_text())
    rf = config["mmWaveDevices"][0]["rfConfig"]
    own = rf["rlProfiles"][0]["rlProfileCfg_t"] if field == "numAdcSamples" else rf["rlFrameCfg_t"]
    own[field] = value
    path.write_text(json.dumps(config))
    for partial in (False, True):
        with pytest.raises(CaptureFormatError, match=rf"numAdcSamples \d.*{message}"):
            open_capture(tmp_path, radar=awr1843(), partial=partial)


def test_a_json_without_a_number_of_frames_is_held_to_the_hardwares_own(tmp_path: Path) -> None:
    write_capture(lsb_cube(awr1843(), 3, 1000), tmp_path)
    (tmp_path / "adc_data.rfgen").unlink()
    path = tmp_path / "adc_data.mmwave.json"
    text = path.read_text().replace('"numFrames": 3', '"numFrames": 0')
    path.write_text(text.replace('"numAdcSamples": 6', '"numAdcSamples": 10'))
    with pytest.raises(CaptureFormatError, match=r"numAdcSamples 10.*the size is that of whole frames"):
        open_capture(tmp_path, radar=awr1843(), partial=True)


def test_a_size_that_fits_another_number_of_samples(tmp_path: Path) -> None:
    """The hardware's own preset has other frames than the capture here, so that only the division tells."""
    write_capture(lsb_cube(awr1843(samples=10), 3, 1000), tmp_path)
    (tmp_path / "adc_data.rfgen").unlink()
    path = tmp_path / "adc_data.mmwave.json"
    path.write_text(path.read_text().replace('"numAdcSamples": 10', '"numAdcSamples": 14'))
    with pytest.raises(CaptureFormatError, match="the size is that of numAdcSamples 10"):
        open_capture(tmp_path, radar=Radar.load("awr1843"), partial=True)


def test_a_frame_with_a_damaged_trailer_is_left_out(tmp_path: Path) -> None:
    cube = lsb_cube(position2go(), 3, 1000)
    write_capture(cube, tmp_path, "position2go")
    path = tmp_path / "position2go.raw"
    content = bytearray(path.read_bytes())
    place = 2 * len(content) // 3 - 32 + 4
    content[place : place + 4] = (7).to_bytes(4, "big")
    path.write_bytes(content)
    with pytest.raises(CaptureFormatError, match="frame 1: chirps is 7"):
        read_capture(tmp_path)
    with pytest.warns(CaptureWarning, match="frame 1: chirps is 7"):
        part = read_capture(tmp_path, partial=True)
    np.testing.assert_array_equal(part.data, cube.data[[0, 2]])
    np.testing.assert_array_equal(part.frame_times, cube.frame_times[[0, 2]])


@pytest.mark.parametrize("encoding", ["utf-9", "utf-7000", "utf-7"])
def test_an_encoding_that_is_none(tmp_path: Path, encoding: str) -> None:
    write_capture(lsb_cube(RADARS["position2go"], 2, 1000), tmp_path, "position2go")
    path = tmp_path / "position2go.xml"
    path.write_bytes(path.read_bytes().replace(b"utf-8", encoding.encode(), 1))
    refused_but_readable(tmp_path, r"position2go.xml' is not XML")


def test_times_of_frames_that_do_not_ascend(tmp_path: Path) -> None:
    write_capture(lsb_cube(awr1843(), 2, 1000), tmp_path)
    path = tmp_path / "adc_data.rfgen"
    record = json.loads(path.read_text())
    record["frame_times_s"] = [0.1, -7.0]
    path.write_text(json.dumps(record))
    with pytest.raises(CaptureFormatError, match=r"'frame_times_s'\[1\] is -7, not after"):
        read_capture(tmp_path)


def test_bytes_after_an_array_s_end(tmp_path: Path) -> None:
    write_capture(lsb_cube(RADARS["rfgenesis"], 2, 1000), tmp_path, "rfgenesis")
    with (tmp_path / "radar_frames.npy").open("ab") as stream:
        stream.write(bytes(700))
    refused_but_readable(tmp_path, "700 bytes are too many")
