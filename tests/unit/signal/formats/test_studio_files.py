"""Recordings under the names and in the places of mmWave Studio and of people's folders."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rfgen_sionna.radar import Radar
from rfgen_sionna.records import AdcCube
from rfgen_sionna.signal.formats import CaptureFormatError, CaptureWarning, open_capture, write_capture
from tests.unit.signal.formats.captures import awr1843, cascade, lsb_cube

FRAMES = 12
PRESET = Radar.load("awr1843", "mmmesh")
"""The hardware; its frames are larger than those recorded, so that only the JSON gives their shape."""


@pytest.fixture
def cube() -> AdcCube:
    return lsb_cube(awr1843(), FRAMES, 900)


@pytest.fixture
def parts(tmp_path: Path, cube: AdcCube) -> tuple[bytes, dict[str, Any], dict[str, Any]]:
    """Data, `.mmwave.json` and `.setup.json` of a board."""
    write_capture(cube, tmp_path / "made", "dca1000", scale=1.0)
    read = [json.loads((tmp_path / "made" / f"adc_data.{kind}.json").read_text()) for kind in ("mmwave", "setup")]
    content = (tmp_path / "made" / "adc_data.bin").read_bytes()
    shutil.rmtree(tmp_path / "made")
    return content, read[0], read[1]


def lay(folder: Path, files: dict[str, bytes | dict[str, Any]]) -> Path:
    folder.mkdir()
    for name, content in files.items():
        (folder / name).write_bytes(content if isinstance(content, bytes) else json.dumps(content).encode())
    return folder


def cut(content: bytes, count: int) -> list[bytes]:
    """Parts that do not end with a frame or a chirp, as those of a recording do not."""
    step = len(content) // count + 10
    return [content[start : start + step] for start in range(0, len(content), step)]


def listing(setup: dict[str, Any], config: str, processed: list[str], raw: list[str]) -> dict[str, Any]:
    files = [{"rawFileName": b, "processedFileName": a} for a, b in zip(processed, raw, strict=True)]
    captured = {"numFilesCollected": len(files), "fileBasePath": r"C:\ti\mmwave_studio\PostProc", "files": files}
    return setup | {"configUsed": rf"C:\ti\configs\{config}", "capturedFiles": captured}


def test_every_file_leads_to_the_recording_that_its_setup_names(tmp_path: Path, cube: AdcCube, parts: Any) -> None:
    content, config, setup = parts
    names = [f"walk {n}.bin" for n in range(3)], [f"walk_Raw_{n}.bin" for n in range(3)]
    files = dict(zip(names[0], cut(content, 3), strict=True))
    folder = lay(
        tmp_path / "s", {**files, "x.mmwave.json": config, "y.setup.json": listing(setup, "x.mmwave.json", *names)}
    )
    for path in (folder, *folder.iterdir()):
        capture = open_capture(str(path), radar=PRESET)
        assert [file.name for file in capture.paths] == names[0]
        assert {file.name for file in capture.configs} == {"x.mmwave.json", "y.setup.json"}
        np.testing.assert_array_equal(capture.cube().data, cube.data)


def test_a_configuration_that_lies_alone_is_that_of_the_data(tmp_path: Path, cube: AdcCube, parts: Any) -> None:
    content, config, _ = parts
    folder = lay(tmp_path / "s", {"run.bin": content, "anything.mmwave.json": config})
    for path in (folder, folder / "run.bin", folder / "anything.mmwave.json"):
        np.testing.assert_array_equal(open_capture(path, radar=PRESET).cube().data, cube.data)


@pytest.mark.parametrize("kind", ["adc_data_Raw_{}.bin", "adc_data_{}.bin", "hall_Raw_{}.BIN", "hall_{}.bin"])
def test_parts_follow_by_their_numbers(tmp_path: Path, cube: AdcCube, parts: Any, kind: str) -> None:
    """Part 10 comes after part 9; frames lie across the ends of files."""
    content, config, _ = parts
    pieces = cut(content, 11)
    assert len(pieces) == 11
    files = {kind.format(number): piece for number, piece in enumerate(pieces)}
    folder = lay(tmp_path / "s", {**files, "x.mmwave.json": config})
    for path in (folder, folder / kind.format(10), folder / "x.mmwave.json"):
        capture = open_capture(path, radar=PRESET)
        assert [file.name for file in capture.paths] == list(files)
        np.testing.assert_array_equal(capture.cube().data, cube.data)


@pytest.mark.parametrize("kind", ["hall_Raw_{}.bin", "adc_data_{}.bin"])
@pytest.mark.parametrize("missing", [0, 1])
def test_a_missing_part_is_refused(tmp_path: Path, parts: Any, kind: str, missing: int) -> None:
    content, config, _ = parts
    files = {kind.format(number): piece for number, piece in enumerate(cut(content, 3)) if number != missing}
    folder = lay(tmp_path / "s", {**files, "x.mmwave.json": config})
    with pytest.raises(
        CaptureFormatError, match=f"part {missing} of the recording is missing, '{kind.format(missing)}'"
    ):
        open_capture(folder, radar=PRESET)


def test_a_file_that_the_setup_names_is_missing(tmp_path: Path, parts: Any) -> None:
    content, config, setup = parts
    names = [f"a_{n}.bin" for n in range(2)], [f"a_Raw_{n}.bin" for n in range(2)]
    files = {"a_Raw_0.bin": content, "x.mmwave.json": config, "x.setup.json": listing(setup, "x.mmwave.json", *names)}
    folder = lay(tmp_path / "s", files)
    with pytest.raises(FileNotFoundError, match=r"a_Raw_1\.bin' does not exist; '.*x\.setup\.json' names it"):
        open_capture(folder, radar=PRESET)
    (folder / "a_Raw_0.bin").rename(folder / "renamed.bin")
    with pytest.warns(CaptureWarning, match=r"renamed\.bin', the only recording in the folder, is taken"):
        assert len(open_capture(folder, radar=PRESET)) == FRAMES


def test_a_configuration_that_the_setup_names_is_missing(tmp_path: Path, parts: Any) -> None:
    content, config, setup = parts
    folder = lay(
        tmp_path / "s",
        {"a.bin": content, "x.setup.json": listing(setup, "gone.mmwave.json", ["a.bin"], ["a_Raw_0.bin"])},
    )
    with pytest.warns(
        CaptureWarning, match="configUsed is 'gone.mmwave.json', which does not exist; the waveform is that"
    ):
        assert len(open_capture(folder, radar=awr1843())) == FRAMES
    (folder / "other.mmwave.json").write_text(json.dumps(config))
    with pytest.warns(CaptureWarning, match=r"x\.setup\.json is not used"):
        assert len(open_capture(folder / "other.mmwave.json", radar=PRESET)) == FRAMES


def test_a_json_that_is_not_used_is_named(tmp_path: Path, parts: Any) -> None:
    content, config, _ = parts
    folder = lay(
        tmp_path / "s", {"a.bin": content, "a.mmwave.json": config, "notes.json": {"who": "me"}, "p.cfg": b"% x"}
    )
    with pytest.warns(CaptureWarning, match=r"notes\.json, p\.cfg are not used; the radar is that of a\.mmwave\.json"):
        open_capture(folder, radar="awr1843")


def test_recordings_of_their_own_are_not_joined(tmp_path: Path, cube: AdcCube, parts: Any) -> None:
    """Each of them has the frames that the configuration declares."""
    content, config, _ = parts
    files = {f"walk_{number}.bin": bytes(2 * number) + content[2 * number :] for number in range(3)}
    folder = lay(tmp_path / "s", {**files, "walk.mmwave.json": config})
    with pytest.raises(CaptureFormatError, match=r"'walk_0.bin', 'walk_1.bin', 'walk_2.bin': recordings of their own"):
        open_capture(folder, radar=PRESET)
    capture = open_capture(folder / "walk_2.bin", radar=PRESET)
    assert [file.name for file in capture.paths] == ["walk_2.bin"]
    np.testing.assert_array_equal(capture.lsb(3), cube.data[3])


def test_a_folder_of_two_recordings_asks_which(tmp_path: Path, parts: Any) -> None:
    content, config, setup = parts
    folder = lay(tmp_path / "s", {"a.bin": content, "b.bin": content, "a.mmwave.json": config})
    with pytest.raises(CaptureFormatError, match=r"holds 2 recordings: open one of 'a\.bin', 'b\.bin'"):
        open_capture(folder, radar=PRESET)
    assert open_capture(folder / "a.bin", radar=PRESET).configs[0].name == "a.mmwave.json"
    for name in "ab":
        record = listing(setup, "a.mmwave.json", [f"{name}.bin"], [f"{name}_Raw_0.bin"])
        (folder / f"{name}.setup.json").write_text(json.dumps(record))
    with pytest.raises(CaptureFormatError, match=r"several recordings: open one of 'a\.setup\.json', 'b\.setup\.json'"):
        open_capture(folder, radar=PRESET)
    assert open_capture(folder / "b.setup.json", radar=PRESET).paths == (folder / "b.bin",)


def test_two_configurations_and_no_setup(tmp_path: Path, parts: Any) -> None:
    content, config, _ = parts
    folder = lay(tmp_path / "s", {"a.bin": content, "x.mmwave.json": config, "y.mmwave.json": config})
    with pytest.raises(CaptureFormatError, match=r"'x\.mmwave\.json', 'y\.mmwave\.json' and no \.setup\.json"):
        open_capture(folder, radar=PRESET)
    with pytest.warns(CaptureWarning, match=r"x\.mmwave\.json is not used"):
        assert len(open_capture(folder / "y.mmwave.json", radar=PRESET)) == FRAMES


def test_a_setup_without_its_fields(tmp_path: Path, parts: Any) -> None:
    content, config, setup = parts
    folder = lay(
        tmp_path / "s", {"a.bin": content, "x.mmwave.json": config, "x.setup.json": setup | {"capturedFiles": {}}}
    )
    with pytest.raises(CaptureFormatError, match=r"x\.setup\.json' lacks 'files'"):
        open_capture(folder, radar=PRESET)


def test_the_device_of_the_setup_is_proposed(tmp_path: Path, parts: Any) -> None:
    content, config, setup = parts
    record = listing(setup | {"mmWaveDevice": "awr1843"}, "x.mmwave.json", ["a.bin"], ["a_Raw_0.bin"])
    folder = lay(tmp_path / "s", {"a.bin": content, "x.mmwave.json": config, "x.setup.json": record})
    with pytest.raises(CaptureFormatError, match=r"pass radar='awr1843', the mmWaveDevice of 'x\.setup\.json'"):
        open_capture(folder)
    assert len(open_capture(folder, radar="awr1843")) == FRAMES


def test_sidecars_are_no_json_to_others_and_older_ones_still_open(tmp_path: Path, cube: AdcCube) -> None:
    write_capture(cube, tmp_path, "dca1000", scale=0.5)
    assert sorted(path.name for path in tmp_path.glob("*.json")) == ["adc_data.mmwave.json", "adc_data.setup.json"]
    (tmp_path / "adc_data.rfgen").rename(tmp_path / "adc_data.rfgen.json")
    for path in (tmp_path, tmp_path / "adc_data.rfgen.json"):
        assert open_capture(path).scale == 0.5
    write_capture(cube, tmp_path, "dca1000", scale=0.25, overwrite=True)
    assert not (tmp_path / "adc_data.rfgen.json").exists()
    assert open_capture(tmp_path).scale == 0.25


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("adc.dat", b"1234", "has a suffix of no format"),
        ("run.h5", b"\x89HDF", r"opened with rfgen\.open_run"),
        (
            "dump.pcap",
            b"1234",
            r"write the UDP data of the packets, headers of the DCA1000 included, into a \.bin file",
        ),
        ("my.json", b'{"fc": 77}', r"has the fields fc: it is no configuration of a capture"),
        ("adc.npy", b"1234", "is not a NumPy file"),
    ],
)
def test_other_files_are_refused_with_a_cure(tmp_path: Path, name: str, content: bytes, message: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(CaptureFormatError, match=message):
        open_capture(tmp_path / name, radar="awr1843")


def test_a_wrong_radar_is_told_from_a_cut_file(tmp_path: Path, parts: Any) -> None:
    """No configuration beside the data: frames are those of the radar's preset."""
    content, _, _ = parts
    folder = lay(tmp_path / "s", {"a.bin": content[:-4]})
    with pytest.raises(CaptureFormatError, match=r"\(128, 3, 4, 256\) are those of radar 'awr1843', preset 'mmmesh'"):
        open_capture(folder, radar=PRESET)


def test_a_folder_without_a_capture_names_what_is_in_it(tmp_path: Path) -> None:
    (tmp_path / "RadarIfxAvian_00").mkdir()
    with pytest.raises(CaptureFormatError, match=r"holds no capture .*; it has the folders RadarIfxAvian_00"):
        open_capture(tmp_path)
    with pytest.raises(FileNotFoundError, match="does not exist"):
        open_capture(tmp_path / "nothing.bin")


def test_a_radar_may_be_a_name_or_a_file(tmp_path: Path, parts: Any) -> None:
    content, config, _ = parts
    folder = lay(tmp_path / "s", {"a.bin": content, "a.mmwave.json": config})
    assert open_capture(folder, radar="awr1843").radar.waveform == open_capture(folder, radar=PRESET).radar.waveform
    wrong = replace(PRESET, rx_names=PRESET.rx_names[:2], rx_positions=PRESET.rx_positions[:2])
    with pytest.raises(CaptureFormatError, match="RX3 is enabled"):
        open_capture(folder, radar=wrong)


def test_the_setup_of_a_cascade_names_its_configuration(tmp_path: Path) -> None:
    cube = lsb_cube(cascade(), 2, 900)
    write_capture(cube, tmp_path / "run", "cascade", scale=1.0)
    folder = tmp_path / "run"
    (folder / "capture.rfgen").unlink()
    config = folder / "run.mmwave.json"
    (folder / "old.mmwave.json").write_text(config.read_text().replace('"numLoops": 2', '"numLoops": 4'))
    with pytest.warns(CaptureWarning, match=r"old\.mmwave\.json, run\.mmwave\.json are not used"):
        open_capture(folder, radar=cascade())
    setup = {"configUsed": "run.mmwave.json", "capturedFiles": {"files": []}}
    (folder / "x.setup.json").write_text(json.dumps(setup))
    with pytest.warns(CaptureWarning, match=r"'.*run': old\.mmwave\.json is not used"):
        capture = open_capture(folder, radar="mmwcas")
    assert {file.name for file in capture.configs if file.is_file()} == {"run.mmwave.json", "x.setup.json"}
    for path in (folder / "x.setup.json", folder / "run.mmwave.json", folder / "slave2_0000_data.bin"):
        with pytest.warns(CaptureWarning, match="not used"):
            np.testing.assert_array_equal(open_capture(path, radar="mmwcas").cube().data, cube.data)


def test_a_cfg_that_is_the_radar_is_used(tmp_path: Path, cube: AdcCube, parts: Any) -> None:
    """Of TI's demo: `adc_data.bin` beside the `.cfg` that configured the board."""
    content, _, _ = parts
    folder = lay(tmp_path / "s", {"adc_data.bin": content})
    (folder / "profile.cfg").write_text(cube.radar.to_cfg())
    capture = open_capture(folder, radar=Radar.load(folder / "profile.cfg", board="awr1843"))
    np.testing.assert_array_equal(capture.cube().data, cube.data)
    by_path = open_capture(folder, radar=folder / "profile.cfg", board="awr1843")
    np.testing.assert_array_equal(by_path.cube().data, cube.data)
    with pytest.raises(ValueError, match=r"board is 'awr1843': it goes with the path of a configuration as radar"):
        open_capture(folder, board="awr1843")


def test_names_in_a_setup_are_those_of_windows_in_any_case(tmp_path: Path, cube: AdcCube, parts: Any) -> None:
    content, config, setup = parts
    record = {**setup, "configUsed": "C:\\ti\\ADC_DATA.mmwave.JSON"}
    folder = lay(tmp_path / "s", {"adc_data.bin": content, "adc_data.mmwave.json": config, "x.setup.json": record})
    for path in (folder, folder / "adc_data.mmwave.json"):
        np.testing.assert_array_equal(open_capture(path, radar="awr1843").cube().data, cube.data)


@pytest.mark.parametrize("name", ["ADC_DATA.MMWAVE.JSON", "mmwave.json", "config.json"])
def test_a_configuration_that_was_renamed_is_known_by_its_content(
    tmp_path: Path, cube: AdcCube, parts: Any, name: str
) -> None:
    content, config, _ = parts
    folder = lay(tmp_path / "s", {"adc_data.bin": content, name: config, "notes.json": {"weather": "dry"}})
    with pytest.warns(CaptureWarning, match=rf"notes.json is not used; the radar is that of {name}"):
        capture = open_capture(folder, radar="awr1843")
    np.testing.assert_array_equal(capture.cube().data, cube.data)
    with pytest.warns(CaptureWarning, match="notes.json"):
        assert open_capture(folder / name, radar="awr1843").configs == (folder / name,)


def test_a_preset_that_nobody_named_is_named(tmp_path: Path) -> None:
    """Eight frames of 16 loops without a configuration look like one of 128."""
    words = np.random.default_rng(0).integers(-999, 999, 8 * 16 * 3 * 4 * 256 * 2).astype("<i2")
    words.tofile(tmp_path / "adc_data.bin")
    with pytest.warns(CaptureWarning, match="no configuration.*preset 'mmmesh' of 'awr1843', 128 loops of 256"):
        assert len(open_capture(tmp_path, radar="awr1843")) == 1
    chosen = Radar.load("awr1843", overrides={"preset.mmmesh.num_loops": 16})
    assert len(open_capture(tmp_path, radar=chosen)) == 8  # by choice, without a warning
