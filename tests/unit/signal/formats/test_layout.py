"""The bytes lie where the boards' own readers look for them: decoded here sample by sample, as those are described."""

from __future__ import annotations

import json
import struct
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io

from rfgen_sionna.records import AdcCube
from rfgen_sionna.signal.formats import CaptureFormatError, open_capture, read_capture, write_capture
from tests.unit.signal.formats.captures import awr1843, bgt60, cascade, lsb_cube, position2go, shortened


def test_an_mmmesh_frame_has_the_bytes_of_the_board(tmp_path: Path) -> None:
    """128 loops × 3 Tx × 4 Rx × 256 samples × 4 bytes."""
    write_capture(lsb_cube(shortened("awr1843", "mmmesh", 128, 256), 2, 100), tmp_path)
    assert (tmp_path / "adc_data.bin").stat().st_size == 2 * 1_572_864


def test_dca1000_two_i_then_two_q_slot_by_slot_as_fired(tmp_path: Path) -> None:
    cube = lsb_cube(awr1843(), 2, 32768)
    write_capture(cube, tmp_path, scale=1.0)
    content = (tmp_path / "adc_data.bin").read_bytes()
    place = 0
    for frame in range(2):
        for loop in range(4):
            for tx in (0, 2, 1):  # mmMesh fires TX1, TX3, TX2
                for rx in range(4):
                    for pair in range(3):
                        i0, i1, q0, q1 = struct.unpack_from("<4h", content, place)
                        place += 8
                        assert cube.data[frame, loop, tx, rx, 2 * pair] == i0 + 1j * q0
                        assert cube.data[frame, loop, tx, rx, 2 * pair + 1] == i1 + 1j * q1
    assert place == len(content)


def test_dca1000_has_no_frames_of_a_position2go(tmp_path: Path) -> None:
    cube = lsb_cube(position2go(), 1, 100)
    message = r"radar 'position2go'.* is at 24\.\d+ GHz; .* 57 … 64 GHz and 76 … 81 GHz: take 'position2go'"
    with pytest.raises(CaptureFormatError, match=message):
        write_capture(cube, tmp_path, "dca1000")
    assert not list(tmp_path.iterdir())
    write_capture(cube, tmp_path, "position2go")


def test_dca1000_needs_pairs_of_samples(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"waveform\.num_samples is 5.*even"):
        write_capture(lsb_cube(awr1843(samples=5), 1, 100), tmp_path)


def test_cascade_four_receivers_of_a_sample_side_by_side(tmp_path: Path) -> None:
    """Read as TI's `read_ADC_bin_TDA2_separateFiles` does; TX12 fires first."""
    radar = cascade(2, 4)
    cube = lsb_cube(radar, 3, 32768)
    write_capture(cube, tmp_path / "run7", "cascade", scale=1.0)
    for device, name in enumerate(["master", "slave1", "slave2", "slave3"]):
        content = (tmp_path / "run7" / f"{name}_0000_data.bin").read_bytes()
        place = 0
        for frame in range(3):
            for loop in range(2):
                for chirp in range(12):
                    for sample in range(4):
                        for rx in range(4):
                            i, q = struct.unpack_from("<2h", content, place)
                            place += 4
                            assert cube.data[frame, loop, 11 - chirp, 4 * device + rx, sample] == i + 1j * q
        assert place == len(content)


def test_cascade_index_tells_frames_sizes_and_times(tmp_path: Path) -> None:
    radar = shortened("mmwcas", "ti_default", 64, 256)
    cube = lsb_cube(radar, 2, 100)
    write_capture(cube, tmp_path, "cascade")
    frame_size = 64 * 12 * 256 * 4 * 4
    for device, flags in {"master": 1, "slave1": 0x101, "slave2": 0x201, "slave3": 0x301}.items():
        content = (tmp_path / f"{device}_0000_idx.bin").read_bytes()
        assert len(content) == 24 + 2 * 48
        assert struct.unpack_from("<IIIIQ", content) == (0x746B6362, 1, 0, 2, 2 * frame_size)
        assert (tmp_path / f"{device}_0000_data.bin").stat().st_size == 2 * frame_size
        for frame in range(2):
            assert content[24 + 48 * frame :][:2] == b"id"
            entry = struct.unpack_from("<HHIHH4IIQQ", content, 24 + 48 * frame)
            assert entry[:9] == (0x6469, 1, flags, 2048, 768, 4096, 0, 0, 0)
            assert entry[9:] == (frame_size, 1_500_000 + 100_000 * frame, frame * frame_size)


@pytest.mark.parametrize(("tag", "width"), [(0x6469, 2048), (0x6964, 256)], ids=["board", "older files"])
def test_a_recording_of_a_cascade_board(tmp_path: Path, tag: int, width: int) -> None:
    """Bytes as the TDA2 host writes them: 12 chirps × 64 loops of 256 samples, 4 Rx a device, no JSON."""
    frame_size = 64 * 12 * 256 * 4 * 4
    words = np.random.default_rng(1).integers(-900, 900, (4, 2, 64, 12, 256, 4, 2), dtype=np.int16)
    for device, name in enumerate(["master", "slave1", "slave2", "slave3"]):
        (tmp_path / f"{name}_0000_data.bin").write_bytes(words[device].astype("<i2").tobytes())
        index = struct.pack("<IIIIQ", 0x746B6362, 1, 0, 2, 2 * frame_size)
        for frame in range(2):
            place = (frame_size, 7_000_000 + 100_000 * frame, frame * frame_size)
            flags = device << 8 | 1
            index += struct.pack("<HHIHH4IIQQ", tag, 1, flags, width, 768, 4096, 0, 0, 0, *place)
        (tmp_path / f"{name}_0000_idx.bin").write_bytes(index)
    capture = open_capture(tmp_path, radar=shortened("mmwcas", "ti_default", 64, 256))
    assert len(capture) == 2
    np.testing.assert_allclose(capture.frame_times, [0, 0.1])
    found = capture.lsb(1)  # TX12 fires first
    i, q = words[2, 1, 5, 3, 17, 1]
    assert found[5, 8, 4 * 2 + 1, 17] == i + 1j * q
    np.testing.assert_array_equal(found[:, ::-1, 4:8].swapaxes(2, 3), words[1, 1, ..., 0] + 1j * words[1, 1, ..., 1])


def test_a_cascade_index_of_other_frames_names_width_and_height(tmp_path: Path) -> None:
    write_capture(lsb_cube(cascade(2, 4), 2, 100), tmp_path, "cascade")
    (tmp_path / "capture.rfgen").unlink()
    next(tmp_path.glob("*.mmwave.json")).unlink()
    with pytest.raises(CaptureFormatError, match=r"width 32 \(samples × 4 Rx .*height 24 .*; the radar's .* 64, 24, "):
        open_capture(tmp_path, radar=cascade(2, 8))


def test_cascade_goes_on_in_further_files(tmp_path: Path) -> None:
    radar = cascade(2, 4)
    cube = lsb_cube(radar, 5, 1000)
    write_capture(cube, tmp_path, "cascade", max_file_size=2 * 2 * 12 * 4 * 16 + 8)
    sizes = [(tmp_path / f"slave1_{number:04d}_data.bin").stat().st_size for number in range(3)]
    assert sizes == [3072, 3072, 1536]
    np.testing.assert_array_equal(read_capture(tmp_path).data, cube.data)


def test_position2go_levels_and_trailer(tmp_path: Path) -> None:
    cube = lsb_cube(position2go(), 2, 2048)
    write_capture(cube, tmp_path, "position2go", scale=1.0)
    content = (tmp_path / "position2go.raw").read_bytes()
    place = 0
    for frame in range(2):
        for chirp in range(3):
            for rx in range(2):
                i, q = (np.array(struct.unpack_from(">8f", content, place + 32 * part)) for part in (0, 1))
                place += 64
                assert min(i.min(), q.min()) >= 0
                assert max(i.max(), q.max()) <= 1
                levels = 4095 * (i + 1j * q)
                np.testing.assert_allclose(levels - (2048 + 2048j), cube.data[frame, chirp, 0, rx], atol=1e-3)
        assert struct.unpack_from(">8I", content, place) == (frame, 3, 2, 8, 3, 12, 0, 1)
        place += 32
    assert place == len(content)


def test_position2go_xml_says_what_infineons_example_asks_for(tmp_path: Path) -> None:
    write_capture(lsb_cube(shortened("position2go", "default", 16, 64), 1, 100), tmp_path, "position2go")
    device = ElementTree.parse(tmp_path / "position2go.xml").getroot()
    assert device.tag == "Device"
    number = {
        "BaseEndpoint/FrameFormat/numChirpsPerFrame": 16,
        "BaseEndpoint/FrameFormat/numSamplesPerChirp": 64,
        "BaseEndpoint/FrameFormat/rxMask": 3,
        "BaseEndpoint/DeviceInfo/numAntennasTx": 1,
        "BaseEndpoint/DeviceInfo/numAntennasRx": 2,
        "BaseEndpoint/chirpDuration_ns": 300_000,
        "FmcwEndpoint/FmcwConfiguration/lowerFrequency_kHz": 24_025_000,
        "FmcwEndpoint/FmcwConfiguration/upperFrequency_kHz": 24_225_000,
        "AdcxmcEndpoint/AdcxmcConfiguration/samplerateHz": 213_333.333,
    }
    for name, value in number.items():
        assert float(device.findtext(name) or "nan") == pytest.approx(value, rel=1e-8), name
    assert device.findtext("BaseEndpoint/FrameFormat/signalPart") == "RADAR_SIGNAL_I_AND_Q"
    calibration = device.findtext("CalibrationEndpoint/callibrationData") or ""
    assert all(float(value) == 0 for value in calibration.strip("[]").split(", "))
    acquisition = device.find("Acquisition")
    assert acquisition is not None
    assert float(acquisition.get("acquisitionRate", "")) == 100.0  # ms


def test_rfgenesis_axes_and_configuration(tmp_path: Path) -> None:
    """As its `TI1843_config.json` has it: Tx in the order of slots, so that the raised TX2 is the last."""
    cube = lsb_cube(awr1843(), 2, 1000)
    write_capture(cube, tmp_path, "rfgenesis")
    frames = np.load(tmp_path / "radar_frames.npy")
    assert frames.dtype == np.complex128
    np.testing.assert_array_equal(frames, cube.data[:, :, [0, 2, 1]].transpose(0, 2, 3, 1, 4))
    config = json.loads((tmp_path / "radar_frames_config.json").read_text())
    published = {
        "num_tx": 3, "num_rx": 4, "fc": 77e9, "slope": 60.012, "adc_start_time": 6, "sample_rate": 4400,
        "idle_time": 7, "ramp_end_time": 65, "frame_per_second": 10,
    }  # fmt: skip
    assert {name: config[name] for name in published} == pytest.approx(published)
    tx, rx = np.array(config["tx_loc"]), np.array(config["rx_loc"])
    np.testing.assert_allclose(tx - tx[0], [[0, 0, 0], [4, 0, 0], [2, 1, 0]], atol=1e-5)
    np.testing.assert_allclose(np.diff(rx, axis=0), [[1, 0, 0]] * 3, atol=1e-5)


def test_matlab_names_axes_and_units(tmp_path: Path) -> None:
    cube = lsb_cube(awr1843(), 2, 1000, scale=2.0**-30)
    write_capture(cube, tmp_path / "run.mat", "matlab")
    content = scipy.io.loadmat(tmp_path / "run.mat", simplify_cells=True)
    assert content["adc"].dtype == np.complex64
    np.testing.assert_array_equal(content["adc"], np.moveaxis(cube.data, 0, -1))
    assert content["dims"] == "chirp, tx, rx, sample, frame"
    assert (content["units"]["adc"], content["units"]["tx_position"]) == ("sqrt(W)", "m")
    np.testing.assert_array_equal(content["frame_time"], cube.frame_times)
    np.testing.assert_array_equal(content["chirp_time"], cube.radar.waveform.chirp_times)
    np.testing.assert_array_equal(content["sample_time"], cube.radar.waveform.sample_times)
    np.testing.assert_array_equal(content["tx_position"], cube.radar.tx_positions)
    assert content["tx_name"] == "TX1, TX2, TX3"
    assert json.loads(content["description"])["radar"] == json.loads(json.dumps(cube.radar.to_dict()))


def test_matlab_7_3_shows_the_same_axes(tmp_path: Path) -> None:
    """MATLAB reverses the axes of HDF5; SciPy knows the version by the file's first bytes."""
    cube = lsb_cube(awr1843(), 2, 1000)
    write_capture(cube, tmp_path / "run.mat", "matlab", version="7.3")
    with pytest.raises(NotImplementedError, match="HDF reader"):
        scipy.io.loadmat(tmp_path / "run.mat")
    with h5py.File(tmp_path / "run.mat") as file:
        assert file.userblock_size == 512
        adc = file["adc"][:]
        assert file["adc"].attrs["MATLAB_class"] == b"single"
        np.testing.assert_array_equal((adc["real"] + 1j * adc["imag"]).T, np.moveaxis(cube.data, 0, -1))
        assert "".join(map(chr, file["dims"][:].T.ravel())) == "chirp, tx, rx, sample, frame"
        assert file["units"].attrs["MATLAB_class"] == b"struct"
        np.testing.assert_array_equal(file["rx_position"][:].T, cube.radar.rx_positions)
    np.testing.assert_array_equal(read_capture(tmp_path / "run.mat").data, cube.data)


def test_matlab_takes_7_3_where_5_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cube = lsb_cube(awr1843(), 2, 1000)
    monkeypatch.setattr("rfgen_sionna.signal.formats.matlab.MAX_VERSION_5", cube.data.nbytes - 1)
    with pytest.raises(ValueError, match=f"adc has {cube.data.nbytes:,}: take version 7.3"):
        write_capture(cube, tmp_path / "run.mat", "matlab", version="5")
    write_capture(cube, tmp_path / "run.mat", "matlab")
    assert (tmp_path / "run.mat").read_bytes().startswith(b"MATLAB 7.3")


def test_one_frame_and_one_loop_keep_their_axes(tmp_path: Path, capture_format: str) -> None:
    small = {"cascade": cascade, "position2go": position2go, "infineon": bgt60}.get(capture_format, awr1843)
    radar = small(1, 2)
    cube = lsb_cube(radar, 1, 1000)
    write_capture(cube, tmp_path, capture_format)
    assert open_capture(tmp_path).frame(0).shape == cube.data.shape[1:]
    np.testing.assert_array_equal(read_capture(tmp_path).data, cube.data)


def test_receivers_lie_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    """A radar file may list them in any order."""
    radar = awr1843()
    turned = replace(radar, rx_names=radar.rx_names[::-1], rx_positions=radar.rx_positions[::-1])
    cube = lsb_cube(radar, 1, 1000)
    write_capture(cube, tmp_path / "a")
    write_capture(AdcCube(cube.data[:, :, :, ::-1], turned, cube.frame_times), tmp_path / "b")
    assert (tmp_path / "a" / "adc_data.bin").read_bytes() == (tmp_path / "b" / "adc_data.bin").read_bytes()
