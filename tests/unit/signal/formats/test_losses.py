"""Packets of 1,456 bytes that a DCA1000 sent and that were lost: filled with zeros, left out, or missing in a dump."""

from __future__ import annotations

import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rfgen_sionna.radar import Radar
from rfgen_sionna.records import AdcCube
from rfgen_sionna.signal.formats import CaptureFormatError, CaptureWarning, open_capture, read_capture, write_capture
from tests.unit.signal.formats.captures import cascade, lsb_cube, shortened

PACKET = 1456
LOOPS, SAMPLES, FRAMES = 16, 128, 4


@pytest.fixture(scope="module")
def radar() -> Radar:
    return shortened("awr1843", "mmmesh", LOOPS, SAMPLES)


@pytest.fixture(scope="module")
def words(radar: Radar) -> np.ndarray:
    """(frame, loop, slot, rx, pair, IQ, 2) of a room in which somebody moves: the same beats in every loop, with phases
    of each channel, a slow rotation, and noise."""
    rng = np.random.default_rng(5)
    slots, channels = 3, 4
    tones = rng.uniform(0.02, 0.3, 5)
    phases = rng.uniform(0, 1, (slots, channels, 5))
    sample = np.arange(SAMPLES)
    scene = np.exp(2j * np.pi * (tones * sample[:, None] + phases[:, :, None])).sum(axis=-1)
    moving = np.exp(2j * np.pi * (0.11 * sample + rng.uniform(0, 1, (slots, channels, 1))))
    turn = np.exp(2j * np.pi * 0.003 * np.arange(FRAMES * LOOPS)).reshape(FRAMES, LOOPS, 1, 1, 1)
    samples = 100 * scene + 50 * turn * moving
    noise = rng.normal(0, 50, (*samples.shape, 2))
    parts = np.rint(np.stack([samples.real, samples.imag], axis=-1) + noise).astype("<i2")
    return parts.reshape(FRAMES, LOOPS, slots, channels, SAMPLES // 2, 2, 2).swapaxes(-1, -2)


@pytest.fixture
def content(words: np.ndarray) -> bytearray:
    return bytearray(words.tobytes())


def lost_rows(radar: Radar, first: int, last: int) -> list[np.ndarray]:
    """(chirp, tx, rx) of each frame with bytes in first … last, counted byte by byte."""
    row = 4 * SAMPLES
    found = [np.zeros((LOOPS, 3, 4), bool) for _ in range(FRAMES)]
    for place in range(first // row, -(-last // row)):
        frame, loop, slot, rx = np.unravel_index(place, (FRAMES, LOOPS, 3, 4))
        found[frame][loop, radar.waveform.slot_axis[slot], rx] = True
    return found


@pytest.mark.parametrize("packet", [0, 37, 67, 68, 202])
def test_a_packet_of_zeros_is_found_in_its_chirps_and_channels(
    tmp_path: Path, radar: Radar, content: bytearray, packet: int
) -> None:
    """A packet has 364 samples: nearly three rows of 128, and parts of others. Packet 67 ends in the next frame."""
    content[packet * PACKET : (packet + 1) * PACKET] = bytes(PACKET)
    (tmp_path / "adc_data.bin").write_bytes(content)
    capture = open_capture(tmp_path, radar=radar)
    wanted = lost_rows(radar, packet * PACKET, min((packet + 1) * PACKET, len(content)))
    assert [loss.frame for loss in capture.lost] == [frame for frame, rows in enumerate(wanted) if rows.any()]
    for loss in capture.lost:
        np.testing.assert_array_equal(loss.rows, wanted[loss.frame])
        assert loss.chirps == tuple(np.flatnonzero(wanted[loss.frame].any(axis=(1, 2))))
        assert all(name in radar.tx_names and other in radar.rx_names for name, other in loss.channels)
    assert (
        sum(loss.samples for loss in capture.lost) == (min((packet + 1) * PACKET, len(content)) - packet * PACKET) // 4
    )
    assert set(capture.complete_frames) == set(range(FRAMES)) - {loss.frame for loss in capture.lost}


def test_lost_frames_are_named_and_left_out_on_request(tmp_path: Path, radar: Radar, content: bytearray) -> None:
    frame = len(content) // FRAMES
    content[frame : 2 * frame] = bytes(frame)
    content[3 * frame + 4096 : 3 * frame + 4096 + PACKET] = bytes(PACKET)
    (tmp_path / "adc_data.bin").write_bytes(content)
    with pytest.warns(CaptureWarning) as caught:
        whole = read_capture(tmp_path, radar=radar)
    message = " ".join(str(warning.message) for warning in caught)
    assert "2 of 4 frames are lost (zeros): frame 1: all; frame 3: 1.5 %, in chirps 0, TX2, RX1, RX2, RX3;" in message
    assert "skip_lost=True leaves these frames out" in message
    assert not whole.data[1].any()
    with pytest.warns(CaptureWarning, match=r"samples are lost \(zeros\): frame 3: 1\.5 %"):
        open_capture(tmp_path, radar=radar).frame(-1)
    with pytest.warns(CaptureWarning, match="declares no scale"):
        part = read_capture(tmp_path, radar=radar, skip_lost=True)
    np.testing.assert_array_equal(part.data, whole.data[[0, 2]])
    np.testing.assert_allclose(part.frame_times, [0, 0.2])
    (tmp_path / "adc_data.bin").write_bytes(bytes(len(content)))
    with pytest.raises(CaptureFormatError, match="no frame is complete"):
        read_capture(tmp_path, radar=radar, skip_lost=True, scale=1.0)


def test_a_silent_receiver_is_told_from_lost_packets(tmp_path: Path, radar: Radar, words: np.ndarray) -> None:
    silent = words.copy()
    silent[:, :, :, 2] = 0
    (tmp_path / "adc_data.bin").write_bytes(silent.tobytes())
    with pytest.warns(CaptureWarning, match=r"4 of 4 frames are lost \(zeros\) \(RX3 silent throughout\)"):
        read_capture(tmp_path, radar=radar, scale=1.0)


def test_zeros_of_a_quiet_receiver_are_no_loss(tmp_path: Path, radar: Radar, words: np.ndarray) -> None:
    """Noise of one LSB: every third word is zero."""
    quiet = np.rint(np.random.default_rng(1).normal(0, 1.0, words.shape)).astype("<i2")
    (tmp_path / "adc_data.bin").write_bytes(quiet.tobytes())
    assert open_capture(tmp_path, radar=radar).lost == ()


def test_lost_bytes_of_a_cascade_device(tmp_path: Path) -> None:
    """All receivers of a sample stand side by side: 91 samples of one chirp and the four receivers of a device."""
    radar = cascade(2, 128)
    cube = lsb_cube(radar, 2, 900)
    write_capture(cube, tmp_path, "cascade", scale=1.0)
    path = tmp_path / "slave1_0000_data.bin"
    data = bytearray(path.read_bytes())
    data[2048 * 5 : 2048 * 5 + PACKET] = bytes(PACKET)
    path.write_bytes(data)
    capture = open_capture(tmp_path)
    np.testing.assert_array_equal(np.count_nonzero(capture.lsb(0)[0, 6, 4:8] == 0, axis=-1), 91)
    data[2048 * 5 : 2048 * 6] = bytes(2048)
    path.write_bytes(data)
    (loss,) = open_capture(tmp_path).lost
    assert (loss.frame, loss.chirps, loss.samples) == (0, (0,), 4 * 128)
    assert loss.channels == tuple(("TX7", f"RX{number}") for number in (5, 6, 7, 8))


def without(content: bytearray, *packets: int) -> bytes:
    kept = [content[start : start + PACKET] for start in range(0, len(content), PACKET)]
    return b"".join(piece for number, piece in enumerate(kept) if number not in packets)


@pytest.mark.parametrize("lost", [(5,), (3,), (100, 101, 102), (2, 3, 4, 5, 6, 150), (66, 67, 68), (8, 190)])
def test_packets_that_were_left_out_are_told_with_their_place(
    tmp_path: Path, radar: Radar, content: bytearray, lost: tuple[int, ...]
) -> None:
    (tmp_path / "adc_data.bin").write_bytes(without(content, *lost))
    places = [f"{PACKET * packet:,}" for packet in lost if packet - 1 not in lost]
    with pytest.raises(CaptureFormatError, match="by the continuity of loops, an estimate, at byte") as caught:
        open_capture(tmp_path, radar=radar)
    assert f"as much as {len(lost)} packet" in str(caught.value)
    assert all(f"byte {place} (frame " in str(caught.value) for place in places)
    with pytest.warns(CaptureWarning, match="zeros stand in for them"):
        capture = open_capture(tmp_path, radar=radar, partial=True)
    for packet in lost:
        content[packet * PACKET : (packet + 1) * PACKET] = bytes(PACKET)
    (tmp_path / "filled").mkdir()
    (tmp_path / "filled" / "adc_data.bin").write_bytes(content)
    filled = open_capture(tmp_path / "filled", radar=radar)
    assert len(capture) == FRAMES
    for frame in range(FRAMES):
        np.testing.assert_array_equal(capture.lsb(frame), filled.lsb(frame))
    assert [str(loss) for loss in capture.lost] == [str(loss) for loss in filled.lost]


def test_an_end_that_is_missing_is_no_lost_packet(tmp_path: Path, radar: Radar, content: bytearray) -> None:
    (tmp_path / "adc_data.bin").write_bytes(content[: -3 * PACKET])
    with pytest.raises(
        CaptureFormatError, match=r"as much as 3 packets .* no break: the end of the recording is missing"
    ):
        open_capture(tmp_path, radar=radar)
    with pytest.warns(CaptureWarning, match="the end"):
        assert len(open_capture(tmp_path, radar=radar, partial=True)) == FRAMES - 1


def test_noise_does_not_show_where_packets_are_missing(tmp_path: Path, radar: Radar, words: np.ndarray) -> None:
    noise = np.random.default_rng(2).normal(0, 100, words.shape).astype("<i2")
    (tmp_path / "adc_data.bin").write_bytes(without(bytearray(noise.tobytes()), 40))
    with pytest.raises(CaptureFormatError, match=r"as much as 1 packet .* do not show where"):
        open_capture(tmp_path, radar=radar)


def dump(content: bytes, order: list[int], long: bool = False) -> bytes:
    """UDP packets with headers: number from 1, [length,] bytes of data before it."""
    out = b""
    for packet in order:
        data = content[packet * PACKET : (packet + 1) * PACKET]
        length = struct.pack("<I", len(data)) if long else b""
        out += struct.pack("<I", packet + 1) + length + (packet * PACKET).to_bytes(6, "little") + data
    return out


@pytest.mark.parametrize("long", [False, True], ids=["10 bytes", "14 bytes"])
def test_a_dump_of_packets_is_put_in_order(tmp_path: Path, radar: Radar, content: bytearray, long: bool) -> None:
    """Reordered, repeated, two lost; the last packet is short, and the file goes on in a second one."""
    count = -(-len(content) // PACKET)
    assert len(content) % PACKET
    order = [packet for packet in range(count) if packet not in (30, 31)]
    order[10], order[11] = order[11], order[10]
    order.insert(50, order[49])
    (tmp_path / "x_Raw_0.bin").write_bytes(dump(content, order[:80], long))
    (tmp_path / "x_Raw_1.bin").write_bytes(dump(content, order[80:], long))
    with pytest.warns(
        CaptureWarning, match=r"dump of UDP packets, of which 2 were lost: 2,912 of .* from byte 43,680 on"
    ):
        capture = open_capture(tmp_path, radar=radar)
    content[30 * PACKET : 32 * PACKET] = bytes(2 * PACKET)
    (tmp_path / "filled").mkdir()
    (tmp_path / "filled" / "adc_data.bin").write_bytes(content)
    filled = open_capture(tmp_path / "filled", radar=radar)
    assert len(capture) == FRAMES
    for frame in range(FRAMES):
        np.testing.assert_array_equal(capture.lsb(frame), filled.lsb(frame))
    assert [loss.frame for loss in capture.lost] == [0]


@pytest.mark.parametrize("name", ["udp.dat", "udp.raw", "udp"])
def test_a_dump_is_recognised_under_any_name(tmp_path: Path, radar: Radar, content: bytearray, name: str) -> None:
    (tmp_path / name).write_bytes(dump(content, list(range(-(-len(content) // PACKET)))))
    assert len(open_capture(tmp_path / name, radar=radar)) == FRAMES


def test_a_dump_that_begins_late_keeps_the_frames_in_step(tmp_path: Path, radar: Radar, content: bytearray) -> None:
    order = list(range(40, -(-len(content) // PACKET)))
    (tmp_path / "dump.bin").write_bytes(dump(content, order))
    with pytest.warns(CaptureWarning, match="of which 40 were lost: .* from byte 0 on"):
        capture = open_capture(tmp_path, radar=radar)
    assert capture.complete_frames == (1, 2, 3)
    whole = np.frombuffer(bytes(content), "<i2").reshape(FRAMES, LOOPS, 3, 4, -1, 2, 2)[2, 3, 1, 2].swapaxes(-1, -2)
    np.testing.assert_array_equal(capture.lsb(2)[3, 2, 2], (whole[..., 0] + 1j * whole[..., 1]).ravel())


def test_a_dump_of_two_recordings_is_refused(tmp_path: Path, radar: Radar, content: bytearray) -> None:
    other = bytes(value ^ 1 for value in content)
    order = list(range(60))
    (tmp_path / "dump.bin").write_bytes(dump(content, order) + dump(other, order))
    with pytest.raises(CaptureFormatError, match="packet 1 comes twice, with other data; these are two recordings"):
        open_capture(tmp_path, radar=radar)


def test_a_dump_that_is_cut_or_damaged_says_where(tmp_path: Path, radar: Radar, content: bytearray) -> None:
    path = tmp_path / "dump.bin"
    packets = dump(content, list(range(60)))
    path.write_bytes(packets[: 1466 * 40] + b"garbage" * 300 + packets[1466 * 40 :])
    with pytest.raises(CaptureFormatError, match=f"byte {1466 * 39:,}: no packet of a DCA1000"):
        open_capture(path, radar=radar)
    path.write_bytes(packets[: 1466 * 40 + 5])
    with pytest.raises(
        CaptureFormatError, match="ends within the header of a packet: shorten the file to 58,640 bytes"
    ):
        open_capture(path, radar=radar)


def test_samples_are_not_taken_for_headers(tmp_path: Path, radar: Radar, content: bytearray) -> None:
    (tmp_path / "adc_data.bin").write_bytes(content)
    first: Any = open_capture(tmp_path, radar=radar)
    assert first.paths == (tmp_path / "adc_data.bin",)
    assert first.lost == ()
    small = AdcCube(np.zeros((1, *radar.frame_shape), np.complex64), radar, np.zeros(1))
    write_capture(small, tmp_path / "zero")
    assert not read_capture(tmp_path / "zero").data.any()
    assert replace(radar) == radar


@pytest.mark.parametrize(("first", "count"), [(20, 2), (33, 3), (41, 4)])
def test_packets_lost_before_one_fast_target_are_found(tmp_path: Path, radar: Radar, first: int, count: int) -> None:
    """1 m/s turn the phase by a tenth of a cycle from loop to loop: across a gap, by more."""
    loops = np.arange(FRAMES * LOOPS)[:, None, None, None]
    cycles = 0.05 * np.arange(SAMPLES) + 0.1 * loops + 0.11 * np.arange(4)[:, None] + 0.3 * np.arange(3)[:, None, None]
    samples = 2000 * np.exp(2j * np.pi * cycles)
    parts = np.stack([samples.real, samples.imag], axis=-1)
    parts += np.random.default_rng(1).normal(0, 30, parts.shape)
    order = np.rint(parts).astype("<i2").reshape(-1, SAMPLES // 2, 2, 2).swapaxes(-1, -2)
    lost = range(first, first + count)
    (tmp_path / "adc_data.bin").write_bytes(without(bytearray(order.tobytes()), *lost))
    said = rf"an estimate, at byte {first * PACKET:,} \(frame 0, .*, {count} packets\); zeros"
    with pytest.raises(CaptureFormatError, match=said):
        open_capture(tmp_path, radar=radar)
