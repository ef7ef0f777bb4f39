"""What is missing or contradicts itself is named, byte by byte; what is whole can be read."""

from __future__ import annotations

import json
import re
import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rfgen_sionna.records import AdcCube
from rfgen_sionna.signal.formats import (
    CaptureFormatError,
    CaptureWarning,
    open_capture,
    read_capture,
    write_capture,
)
from tests.unit.signal.formats.captures import FULL_SCALE, RADARS, awr1843, cascade, lsb_cube, position2go

DATA = {
    "dca1000": "adc_data.bin",
    "cascade": "slave2_0000_data.bin",
    "position2go": "position2go.raw",
    "infineon": "radar.npy",
    "rfgenesis": "radar_frames.npy",
}


@pytest.mark.parametrize("name", sorted(DATA))
@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_a_truncated_file_says_how_much_is_missing_and_gives_what_is_whole(
    name: str, tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    folder = tmp_path_factory.mktemp(name)
    cube = lsb_cube(RADARS[name], 3, FULL_SCALE.get(name, 1000))
    write_capture(cube, folder, name, scale=1.0)
    path = folder / DATA[name]
    whole = path.read_bytes()
    header = len(whole) - {"rfgenesis": 16, "infineon": 2}[name] * cube.data.size if path.suffix == ".npy" else 0
    frame_size = (len(whole) - header) // 3
    kept = data.draw(st.integers(0, len(whole) - header - 1), label="bytes kept")
    path.write_bytes(whole[: header + kept])
    with pytest.raises(CaptureFormatError) as caught:
        read_capture(folder)
    message = str(caught.value)
    assert str(path) in message
    frames = kept // frame_size
    # The cascade's index tells frame by frame, the others' sidecar how many there are.
    missing = ((frames + 1) if name == "cascade" else 3) * frame_size - kept
    assert f"{missing:,}" in message
    if frames == 0:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", CaptureWarning)
            if name == "cascade":  # the other three devices are whole
                assert read_capture(folder, partial=True).data.shape == (3, *cube.data.shape[1:3], 12, 8)
                return
            with pytest.raises(CaptureFormatError):
                read_capture(folder, partial=True)
        return
    with pytest.warns(CaptureWarning):
        part = read_capture(folder, partial=True)
    np.testing.assert_array_equal(part.data, cube.data[:frames])
    np.testing.assert_array_equal(part.frame_times, cube.frame_times[:frames])


@pytest.mark.parametrize("version", ["5", "7.3"])
@settings(max_examples=30, deadline=None)
@given(data=st.data())
def test_a_truncated_matlab_file_is_refused(
    version: str, tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    folder = tmp_path_factory.mktemp("matlab")
    write_capture(lsb_cube(awr1843(), 3, 1000), folder, "matlab", version=version)
    path = folder / "adc_data.mat"
    whole = path.read_bytes()
    kept = data.draw(st.integers(0, len(whole) - 1), label="bytes kept")
    if version == "5" and data.draw(st.booleans()):  # between two variables
        kept = data.draw(st.sampled_from([128, 216]))
    path.write_bytes(whole[:kept])
    for partial in (False, True):
        with pytest.raises(
            CaptureFormatError, match=f"{re.escape(str(path))}' .{kept:,} bytes. is truncated or no MATLAB"
        ):
            read_capture(path, partial=partial)


def test_too_many_bytes_are_refused(tmp_path: Path) -> None:
    cube = lsb_cube(awr1843(), 2, 1000)
    write_capture(cube, tmp_path)
    with (tmp_path / "adc_data.bin").open("ab") as stream:
        stream.write(bytes(100))
    with pytest.raises(CaptureFormatError, match="100 bytes are too many"):
        read_capture(tmp_path)
    with pytest.warns(CaptureWarning, match="too many"):
        assert len(read_capture(tmp_path, partial=True).data) == 2


def test_a_frame_count_is_not_assumed_without_a_sidecar(tmp_path: Path) -> None:
    """Only the last frame can be told to be broken then."""
    cube = lsb_cube(awr1843(), 2, 32768)
    write_capture(cube, tmp_path, scale=1.0)
    for extra in [*tmp_path.glob("*.json"), *tmp_path.glob("*.rfgen")]:
        extra.unlink()
    path = tmp_path / "adc_data.bin"
    frame = path.stat().st_size // 2
    path.write_bytes(path.read_bytes()[: frame + 10])
    with pytest.raises(CaptureFormatError, match=f"ends within frame 1: 10 of its {frame:,} bytes are there"):
        read_capture(path, radar=awr1843())
    with pytest.warns(CaptureWarning, match="ends within frame 1"):
        capture = open_capture(path, radar=awr1843(), partial=True)
    np.testing.assert_array_equal(capture.lsb(0), cube.data[0])


def test_devices_that_recorded_different_numbers_of_frames(tmp_path: Path) -> None:
    cube = lsb_cube(cascade(), 3, 1000)
    write_capture(cube, tmp_path, "cascade")
    index = tmp_path / "slave1_0000_idx.bin"
    content = bytearray(index.read_bytes()[:-48])
    content[12:16] = (2).to_bytes(4, "little")
    index.write_bytes(content)
    with pytest.raises(CaptureFormatError, match="master 3, slave1 2, slave2 3, slave3 3; 3 of each"):
        read_capture(tmp_path)
    with pytest.warns(CaptureWarning, match="slave1 2"):
        np.testing.assert_array_equal(read_capture(tmp_path, partial=True).data, cube.data[:2])


def read_in_part(folder: Path, message: str) -> AdcCube:
    """What is whole; one of the warnings says so."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", CaptureWarning)
        part = read_capture(folder, partial=True)
    assert any(re.search(message, str(warning.message)) for warning in caught)
    return part


@pytest.mark.parametrize("lost", ["data", "all of it", "most of the data"])
def test_a_device_that_is_missing_leaves_the_receivers_of_the_others(tmp_path: Path, lost: str) -> None:
    """Slave 1 has RX5 to RX8."""
    cube = lsb_cube(cascade(), 3, 1000)
    write_capture(cube, tmp_path, "cascade")
    data = tmp_path / "slave1_0000_data.bin"
    if lost == "most of the data":
        data.write_bytes(data.read_bytes()[:100])
    else:
        data.unlink()
    if lost == "all of it":
        (tmp_path / "slave1_0000_idx.bin").unlink()
    with pytest.raises((CaptureFormatError, FileNotFoundError), match=r"slave1_0000_data\.bin"):
        read_capture(tmp_path)
    part = read_in_part(tmp_path, "slave1")
    kept = [index for index, name in enumerate(cube.radar.rx_names) if name not in ("RX5", "RX6", "RX7", "RX8")]
    assert part.radar.rx_names == tuple(cube.radar.rx_names[index] for index in kept)
    np.testing.assert_array_equal(part.radar.rx_positions, cube.radar.rx_positions[kept])
    np.testing.assert_array_equal(part.data, cube.data[:, :, :, kept])
    np.testing.assert_array_equal(part.frame_times, cube.frame_times)


@pytest.mark.parametrize("names", [("slave1",), ("master",), ("master", "slave1", "slave2", "slave3")])
@pytest.mark.parametrize("kept", [None, 0, 10, 24, 24 + 48, 24 + 48 + 5])
def test_an_index_that_was_cut_or_lost_leaves_the_data_readable(
    tmp_path: Path, names: tuple[str, ...], kept: int | None
) -> None:
    cube = lsb_cube(cascade(), 3, 1000)
    write_capture(cube, tmp_path, "cascade")
    for name in names:
        index = tmp_path / f"{name}_0000_idx.bin"
        if kept is None:
            index.unlink()
        else:
            index.write_bytes(index.read_bytes()[:kept])
    if kept is not None or "master" in names:
        with pytest.raises((CaptureFormatError, FileNotFoundError), match=r"0000_idx\.bin"):
            read_capture(tmp_path)
        part = read_in_part(tmp_path, "0000_idx.bin")
    else:
        part = read_capture(tmp_path)  # the master's says the same
    # What all four have lost nobody can tell; without any index frames follow each other.
    frames = 1 if len(names) == 4 and kept is not None and kept >= 24 + 48 else 3
    np.testing.assert_array_equal(part.data, cube.data[:frames])
    np.testing.assert_array_equal(part.frame_times, cube.frame_times[:frames])


def test_frames_after_a_damaged_one_keep_their_times(tmp_path: Path) -> None:
    """Three files of two frames each; of the second pair slave 3 has lost the second frame."""
    cube = lsb_cube(cascade(), 6, 1000)
    size = 4 * 2 * 12 * 8 * 4
    write_capture(cube, tmp_path, "cascade", max_file_size=2 * size)
    data = tmp_path / "slave3_0001_data.bin"
    data.write_bytes(data.read_bytes()[:-1])
    with pytest.raises(CaptureFormatError, match=r"slave3_0001.*1 of its 3,072 bytes are missing"):
        read_capture(tmp_path)
    part = read_in_part(tmp_path, "slave3 5")
    whole = [0, 1, 2, 4, 5]
    np.testing.assert_array_equal(part.data, cube.data[whole])
    np.testing.assert_array_equal(part.frame_times, cube.frame_times[whole])
    for path in tmp_path.glob("*_0001_*"):
        path.unlink()
    part = read_in_part(tmp_path, "0001")
    np.testing.assert_array_equal(part.data, cube.data[[0, 1, 4, 5]])
    np.testing.assert_array_equal(part.frame_times, cube.frame_times[[0, 1, 4, 5]])


@pytest.mark.parametrize(
    ("place", "value", "message"),
    [
        (0, b"\x00", "begins with 0x746b6300"),
        (24, b"\x00", "frame 0: tag 0x6400"),
        (32, b"\x08", "width 8 "),
        (12, b"\x04", "48 bytes are missing"),
    ],
)
def test_an_index_that_contradicts_itself(tmp_path: Path, place: int, value: bytes, message: str) -> None:
    write_capture(lsb_cube(cascade(), 3, 1000), tmp_path, "cascade")
    index = tmp_path / "master_0000_idx.bin"
    content = bytearray(index.read_bytes())
    content[place : place + 1] = value
    index.write_bytes(content)
    with pytest.raises(CaptureFormatError, match=message):
        read_capture(tmp_path)
    part = read_in_part(tmp_path, message)
    np.testing.assert_array_equal(part.data[0], lsb_cube(cascade(), 3, 1000).data[0])


def test_an_index_of_other_frames_is_no_damage(tmp_path: Path) -> None:
    write_capture(lsb_cube(cascade(), 3, 1000), tmp_path, "cascade")
    (tmp_path / "capture.rfgen").unlink()
    (tmp_path / f"{tmp_path.name}.mmwave.json").unlink()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", CaptureWarning)
        with pytest.raises(CaptureFormatError, match=r"width 64 .*height 24 "):
            read_capture(tmp_path, radar=cascade(loops=4), partial=True)


@pytest.mark.parametrize(
    ("field", "message"),
    [(1, "chirps is 7; 3"), (2, "receivers is 7; 2"), (4, "receiver mask is 7; 3"), (5, "ADC bits")],
)
def test_a_trailer_that_contradicts_the_radar(tmp_path: Path, field: int, message: str) -> None:
    write_capture(lsb_cube(position2go(), 2, 1000), tmp_path, "position2go")
    path = tmp_path / "position2go.raw"
    content = bytearray(path.read_bytes())
    place = len(content) - 32 + 4 * field
    content[place : place + 4] = (7).to_bytes(4, "big")
    path.write_bytes(content)
    with pytest.raises(CaptureFormatError, match=f"frame 1: {message}"):
        read_capture(tmp_path)


def test_missing_files_are_named(tmp_path: Path, capture_format: str) -> None:
    write_capture(lsb_cube(RADARS[capture_format], 2, 100), tmp_path, capture_format)
    name = DATA.get(capture_format, "adc_data.mat")
    (tmp_path / name).unlink()
    with pytest.raises((FileNotFoundError, CaptureFormatError)) as caught:
        read_capture(tmp_path, capture_format)
    assert name in str(caught.value) or ".raw" in str(caught.value)
    with pytest.raises(FileNotFoundError, match="nowhere"):
        read_capture(tmp_path / "nowhere.bin")


def test_a_folder_with_several_captures_asks_which(tmp_path: Path) -> None:
    cube = lsb_cube(awr1843(), 1, 100)
    with pytest.raises(CaptureFormatError, match="holds no capture"):
        read_capture(tmp_path)
    write_capture(cube, tmp_path, "dca1000")
    write_capture(cube, tmp_path / "other.mat", "matlab")
    with pytest.raises(CaptureFormatError, match=r"several formats: open one of 'adc_data.bin' .dca1000., 'other.mat'"):
        read_capture(tmp_path)
    assert read_capture(tmp_path, "dca1000").data.shape == cube.data.shape


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"format": "other"}, "is of format 'other'"),
        ({"scale": -1.0}, "'scale' is -1.0"),
        ({"frame_times_s": []}, "'frame_times_s'"),
        ({"radar": {}}, "radar record lacks"),
        ({"seed": "dice"}, "dice"),
    ],
)
def test_a_sidecar_that_cannot_be(tmp_path: Path, change: dict[str, object], message: str) -> None:
    write_capture(lsb_cube(awr1843(), 1, 100), tmp_path)
    path = tmp_path / "adc_data.rfgen"
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(CaptureFormatError, match=message):
        read_capture(tmp_path)
    path.write_text("{")
    with pytest.raises(CaptureFormatError, match="is not JSON"):
        read_capture(tmp_path)


def test_another_radar_must_have_the_frames_of_the_capture(tmp_path: Path, capture_format: str) -> None:
    radar = RADARS[capture_format]
    write_capture(lsb_cube(radar, 1, 100), tmp_path, capture_format)
    moved = radar.placed(position=(1.0, 2.0, 3.0))
    assert read_capture(tmp_path, radar=moved).radar == moved
    with pytest.raises(CaptureFormatError, match="leave `radar` out"):
        read_capture(tmp_path, radar=awr1843(loops=8))


def test_cascade_files_under_the_names_of_other_devices(tmp_path: Path) -> None:
    """The flags of an index carry the number of its device: two slaves by each other's names are no permutation of
    receivers in silence."""
    write_capture(lsb_cube(cascade(), 1, 10), tmp_path, "cascade", scale=1.0)
    for kind in ("data", "idx"):
        first, second = (tmp_path / f"{name}_0000_{kind}.bin" for name in ("slave1", "slave2"))
        first.rename(tmp_path / "aside")
        second.rename(first)
        (tmp_path / "aside").rename(second)
    with pytest.raises(CaptureFormatError, match=r"slave1_0000_idx.bin', frame 0: flags 0x201 are those of slave2"):
        open_capture(tmp_path)
