"""What is written comes back: to the LSB, with units, times and the radar; and written again it is the same bytes."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rfgen_sionna.records import AdcCube
from rfgen_sionna.signal.formats import CaptureReport, CaptureWarning, open_capture, read_capture, write_capture
from tests.unit.signal.formats.captures import FULL_SCALE, RADARS, awr1843, lsb_cube

INTEGER = sorted(FULL_SCALE)


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir()) if not path.name.endswith(".json")}


@pytest.mark.parametrize("name", INTEGER)
@settings(max_examples=20, deadline=None)
@given(data=st.data())
def test_every_lsb_comes_back(name: str, tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    seed = data.draw(st.integers(0, 2**32 - 1), label="seed")
    frames = data.draw(st.integers(1, 3), label="frames")
    scale = data.draw(st.floats(1e-12, 1e3), label="scale")
    radar = RADARS[name]
    order = data.draw(st.permutations(range(len(radar.tx_names))), label="slots")
    receivers = data.draw(st.permutations(range(len(radar.rx_names))), label="receivers")
    radar = replace(
        radar,
        waveform=replace(radar.waveform, tx_order=tuple(order)),
        rx_names=tuple(radar.rx_names[i] for i in receivers),
        rx_positions=radar.rx_positions[receivers],
    )
    cube = lsb_cube(radar, frames, FULL_SCALE[name], seed, scale)
    folder = tmp_path_factory.mktemp(name)
    report = write_capture(cube, folder, name, scale=scale)
    capture = open_capture(folder)
    assert (report.clipped, capture.format, capture.scale, capture.seed) == (0, name, scale, seed)
    assert capture.radar == radar
    for frame in range(frames):
        np.testing.assert_array_equal(capture.lsb(frame), lsb_cube(radar, frames, FULL_SCALE[name], seed).data[frame])
    np.testing.assert_array_equal(capture.frame_times, cube.frame_times)
    np.testing.assert_array_equal(read_capture(folder).data, cube.data)
    again = tmp_path_factory.mktemp("again")
    write_capture(capture.cube(), again, name, scale=scale)
    assert contents(again) == contents(folder)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), scale=st.floats(1e-12, 1e3), frames=st.integers(1, 3))
@pytest.mark.parametrize("name", ["rfgenesis", "matlab"])
def test_floating_point_formats_keep_every_bit(
    name: str, tmp_path_factory: pytest.TempPathFactory, seed: int, scale: float, frames: int
) -> None:
    cube = lsb_cube(RADARS[name], frames, 1 << 20, seed, scale)
    folder = tmp_path_factory.mktemp(name)
    write_capture(cube, folder, name)
    back = read_capture(folder)
    np.testing.assert_array_equal(back.data, cube.data)
    np.testing.assert_array_equal(back.frame_times, cube.frame_times)
    assert (back.radar, back.seed) == (cube.radar, seed)


@pytest.mark.parametrize("name", INTEGER)
@settings(max_examples=25, deadline=None)
@given(peak=st.floats(1e-15, 1e6), seed=st.integers(0, 2**32 - 1))
def test_automatic_scale_clips_nothing_wastes_less_than_a_bit_and_is_stable(
    name: str, tmp_path_factory: pytest.TempPathFactory, peak: float, seed: int
) -> None:
    radar = RADARS[name]
    samples = lsb_cube(radar, 1, 32768, seed).data
    cube = AdcCube(samples * np.float32(peak / 32768), radar, np.zeros(1))
    folder, again = tmp_path_factory.mktemp("a"), tmp_path_factory.mktemp("b")
    report = write_capture(cube, folder, name)
    assert report.scale is not None
    assert report.clipped == 0
    assert np.log2(report.scale) == np.rint(np.log2(report.scale))
    capture = open_capture(folder)
    levels = capture.lsb(0).view(np.float32)
    assert FULL_SCALE[name] / 2 <= np.abs(levels).max() <= FULL_SCALE[name]
    error = np.abs((capture.frame(0) - cube.data[0]).view(np.float32)).max()
    assert error <= 0.5001 * report.scale
    assert write_capture(capture.cube(), again, name).scale == report.scale
    assert contents(again) == contents(folder)


def test_silence_is_written_as_silence(tmp_path: Path, capture_format: str) -> None:
    radar = RADARS[capture_format]
    cube = lsb_cube(radar, 1, 4)
    cube = replace(cube, data=np.zeros_like(cube.data))
    write_capture(cube, tmp_path, capture_format)
    assert not np.any(read_capture(tmp_path).data)


@pytest.mark.parametrize("name", INTEGER)
def test_what_exceeds_full_scale_is_clipped_and_counted(name: str, tmp_path: Path) -> None:
    full = FULL_SCALE[name]
    cube = lsb_cube(RADARS[name], 1, 100)
    words = cube.data.view(np.float32)[0, 0, 0, 0]  # I and Q in turn, or real samples
    words[:4] = [full + 5, -full - 7, full - 1, -full]
    report = write_capture(cube, tmp_path, name, scale=1.0)
    assert (report.clipped, report.values) == (2, cube.data.view(np.float32).size)
    words[:2] = [full - 1, -full]
    np.testing.assert_array_equal(read_capture(tmp_path).data, cube.data)


@pytest.mark.parametrize("name", INTEGER)
def test_full_scale_in_dbm_is_the_power_of_a_tone_that_fills_the_converter(name: str, tmp_path: Path) -> None:
    cube = lsb_cube(RADARS[name], 1, 100, scale=1e-9)
    report = write_capture(cube, tmp_path, name, full_scale_dbm=-10.0)
    assert report.scale is not None
    assert report.full_scale_dbm == pytest.approx(-10.0, abs=1e-9)
    # -10 dBm is 0.1 mW: |I + jQ|^2 of complex samples, half the peak's square of real ones
    assert (report.scale * FULL_SCALE[name]) ** 2 == pytest.approx(2e-4 if cube.radar.adc.real else 1e-4)


def test_a_radar_with_a_fixed_full_scale_gives_the_scale(tmp_path: Path) -> None:
    radar = replace(awr1843(), adc=replace(awr1843().adc, full_scale_dbm=-20.0))
    report = write_capture(lsb_cube(radar, 1, 100, scale=1e-9), tmp_path)
    assert report.full_scale_dbm == pytest.approx(-20.0, abs=1e-9)


@pytest.mark.parametrize("name", INTEGER)
def test_samples_without_units_stay_in_lsb(name: str, tmp_path: Path) -> None:
    cube = lsb_cube(RADARS[name], 2, FULL_SCALE[name])
    assert write_capture(cube, tmp_path, name, scale=None).full_scale_dbm is None
    with pytest.warns(CaptureWarning, match="declares no scale: samples are in LSB"):
        back = read_capture(tmp_path)
    np.testing.assert_array_equal(back.data, cube.data)
    np.testing.assert_array_equal(read_capture(tmp_path, scale=0.5).data, 0.5 * cube.data)


def test_a_dataset_on_the_disk_is_written_frame_by_frame(tmp_path: Path, capture_format: str) -> None:
    class Stored:
        """Gives one frame at a time, and nothing else."""

        def __init__(self, data: np.ndarray) -> None:
            self._data, self.shape, self.size = data, data.shape, data.size

        def __getitem__(self, frame: int) -> np.ndarray:
            assert isinstance(frame, int)
            return self._data[frame]

    cube = lsb_cube(RADARS[capture_format], 3, 1024)
    write_capture(replace(cube, data=Stored(cube.data)), tmp_path, capture_format)  # type: ignore[arg-type]
    np.testing.assert_array_equal(read_capture(tmp_path).data, cube.data)


def test_parts_of_a_capture_are_read_alone(tmp_path: Path, capture_format: str) -> None:
    cube = lsb_cube(RADARS[capture_format], 4, 1024)
    write_capture(cube, tmp_path, capture_format)
    capture = open_capture(tmp_path)
    part = capture.cube(slice(1, 4, 2))
    np.testing.assert_array_equal(part.data, cube.data[1:4:2])
    np.testing.assert_array_equal(part.frame_times, cube.frame_times[1:4:2])
    np.testing.assert_array_equal(capture.frame(-1), cube.data[-1])
    with pytest.raises(IndexError, match="frame 4 of a capture with 4 frames"):
        capture.frame(4)


def test_existing_files_stay_unless_told_otherwise(tmp_path: Path, capture_format: str) -> None:
    radar = RADARS[capture_format]
    first = write_capture(lsb_cube(radar, 1, 100, seed=1), tmp_path, capture_format)
    before = contents(tmp_path)
    with pytest.raises(FileExistsError, match=f"'{first.paths[0].name}'|{first.paths[0].name}"):
        write_capture(lsb_cube(radar, 1, 100, seed=2), tmp_path, capture_format)
    assert contents(tmp_path) == before
    write_capture(lsb_cube(radar, 1, 100, seed=2), tmp_path, capture_format, overwrite=True)
    np.testing.assert_array_equal(read_capture(tmp_path).data, lsb_cube(radar, 1, 100, seed=2).data)


def test_a_failed_write_leaves_nothing(tmp_path: Path, capture_format: str) -> None:
    cube = lsb_cube(RADARS[capture_format], 2, 100)
    cube.data[1, 0, 0, 0, 0] = np.nan
    with pytest.raises(ValueError, match="frame 1 holds samples that are not finite"):
        write_capture(cube, tmp_path / "new", capture_format, scale=1.0)
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


def test_the_file_beside_the_data_names_the_capture(tmp_path: Path, capture_format: str) -> None:
    report = write_capture(lsb_cube(RADARS[capture_format], 2, 100), tmp_path, capture_format)
    assert isinstance(report, CaptureReport)
    assert all(path.is_file() for path in report.paths)
    if capture_format == "matlab":
        assert len(report.paths) == 1
        return
    record = json.loads(report.paths[-1].read_text())
    assert (record["scale"], record["scale_units"], record["frames"]) == (report.scale, "sqrt(W)/LSB", 2)
    assert len(open_capture(report.paths[-1])) == 2


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"scale": 0.0}, "scale is 0.0"),
        ({"scale": -1.0}, "scale is -1.0"),
        ({"scale": float("nan")}, "scale is nan"),
        ({"scale": "loud"}, "scale is 'loud'"),
        ({"scale": True}, "scale is True"),
        ({"scale": 1.0, "full_scale_dbm": 0.0}, "give one of them"),
        ({"full_scale_dbm": float("inf")}, "full_scale_dbm is inf"),
        ({"format": "wav"}, "format is 'wav'; allowed: dca1000, cascade, position2go, infineon, rfgenesis, matlab"),
        ({"format": "matlab", "full_scale_dbm": 0.0}, "floating-point"),
        ({"format": "matlab", "version": "6"}, "version is '6'"),
        ({"format": "cascade"}, "has 4 receivers; the cascade records 16"),
        ({"format": "position2go"}, "has 3 Tx"),
    ],
)
def test_mistakes_are_named_before_anything_is_written(
    tmp_path: Path, options: dict[str, object], message: str
) -> None:
    with pytest.raises(ValueError, match=r".") as caught:
        write_capture(lsb_cube(awr1843(), 1, 100), tmp_path / "out", **options)  # type: ignore[arg-type]
    assert message in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_a_cube_that_does_not_fit_its_radar_is_refused(tmp_path: Path, capture_format: str) -> None:
    cube = lsb_cube(RADARS[capture_format], 2, 100)
    with pytest.raises(ValueError, match=r"cube\.data has shape"):
        write_capture(replace(cube, data=cube.data[:, :-1]), tmp_path, capture_format)
    with pytest.raises(ValueError, match="holds no frame"):
        write_capture(replace(cube, data=cube.data[:0], frame_times=np.empty(0)), tmp_path, capture_format)
    with pytest.raises(ValueError, match=r"cube\.frame_times has shape"):
        write_capture(replace(cube, frame_times=np.zeros(3)), tmp_path, capture_format)
