"""Words of a DCA1000 as TI's documents lay them out (SWRA581B; `rawDataReader` of mmWave Studio), built by hand."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rfgen_sionna.radar import Radar
from rfgen_sionna.records import AdcCube
from rfgen_sionna.signal.formats import CaptureFormatError, CaptureWarning, open_capture, read_capture, write_capture
from tests.unit.signal.formats.captures import lsb_cube, shortened

LOOPS, SAMPLES = 3, 8


def board(name: str, receivers: tuple[int, ...] | None = None, real: bool | None = None) -> Radar:
    radar = shortened(name, Radar.load(name).preset, LOOPS, SAMPLES)
    if real is not None:
        radar = replace(radar, adc=replace(radar.adc, real=real))
    if receivers is None:
        return radar
    return replace(
        radar, rx_names=tuple(radar.rx_names[n] for n in receivers), rx_positions=radar.rx_positions[list(receivers)]
    )


def values(radar: Radar, frames: int = 2) -> np.ndarray:
    """(frame, loop, slot, rx, sample, part) of a board; every word differs from its neighbours."""
    loops, slots, channels, samples = radar.frame_shape
    parts = 1 if radar.adc.real else 2
    shape = (frames, loops, slots, channels, samples, parts)
    return np.random.default_rng(3).integers(-2000, 2000, shape).astype("<i2")


def check(path: Path, radar: Radar, words: np.ndarray, **options: int) -> None:
    capture = open_capture(path, radar=radar, **options)
    assert len(capture) == len(words)
    for number in range(len(words)):
        found = capture.lsb(number)[:, list(radar.waveform.slot_axis)]  # as fired
        wanted = words[number, ..., 0] if radar.adc.real else words[number, ..., 0] + 1j * words[number, ..., 1]
        assert found.dtype == (np.float32 if radar.adc.real else np.complex64)
        np.testing.assert_array_equal(found, wanted)


def test_four_lanes_carry_i_of_all_receivers_then_their_q(tmp_path: Path) -> None:
    radar = board("iwr1443boost")
    words = values(radar)
    content: list[int] = []
    for chirp in words.reshape(-1, 4, SAMPLES, 2):
        for sample in range(SAMPLES):
            content += [chirp[rx, sample, part] for part in (0, 1) for rx in range(4)]
    (tmp_path / "adc_data.bin").write_bytes(np.array(content, "<i2").tobytes())
    check(tmp_path, radar, words)
    custom = replace(radar, name="my board")
    with pytest.raises(AssertionError):
        check(tmp_path, custom, words)
    check(tmp_path, custom, words, lanes=4)


def test_four_lanes_of_a_board_with_two_receivers_on(tmp_path: Path) -> None:
    """TI's application report has zeros for the others, `rawDataReader` leaves them out: the zeros decide."""
    radar = board("iwr1443boost", receivers=(0, 2))
    words = values(radar)
    padded = np.zeros((*words.shape[:3], SAMPLES, 2, 4), "<i2")
    padded[..., [0, 2]] = words.transpose(0, 1, 2, 4, 5, 3)
    (tmp_path / "padded.bin").write_bytes(padded.tobytes())
    check(tmp_path / "padded.bin", radar, words)
    content: list[int] = []
    for chirp in words.reshape(-1, 2, SAMPLES, 2):
        flat = [chirp[rx, sample] for sample in range(SAMPLES) for rx in range(2)]
        for first in range(0, len(flat), 4):
            content += [value[part] for part in (0, 1) for value in flat[first : first + 4]]
    (tmp_path / "packed.bin").write_bytes(np.array(content, "<i2").tobytes())
    check(tmp_path / "packed.bin", radar, words)


@pytest.mark.parametrize("name", ["awr1642boost", "iwr6843isk", "awr2944evm"])
def test_real_samples_of_two_lanes_lie_receiver_by_receiver(tmp_path: Path, name: str) -> None:
    radar = board(name, real=True)
    words = values(radar)
    content = [int(word) for chirp in words.reshape(-1, len(radar.rx_names), SAMPLES) for rx in chirp for word in rx]
    (tmp_path / "adc_data.bin").write_bytes(np.array(content, "<i2").tobytes())
    check(tmp_path, radar, words)


def test_real_samples_of_four_lanes_lie_sample_by_sample(tmp_path: Path) -> None:
    radar = board("iwr1443boost", real=True)
    words = values(radar)
    content = [
        int(chirp[rx, n, 0]) for chirp in words.reshape(-1, 4, SAMPLES, 1) for n in range(SAMPLES) for rx in range(4)
    ]
    (tmp_path / "adc_data.bin").write_bytes(np.array(content, "<i2").tobytes())
    check(tmp_path, radar, words)


@pytest.mark.parametrize(
    ("name", "real"),
    [(name, real) for name in ("iwr1443boost", "awr1642boost", "iwr6843isk") for real in (False, True)]
    + [("awr2944evm", True)],
)
def test_what_is_written_is_read_again_with_and_without_the_sidecar(tmp_path: Path, name: str, real: bool) -> None:
    radar = board(name, real=real)
    cube = lsb_cube(radar, 2, 32768, scale=0.5)
    report = write_capture(cube, tmp_path, scale=0.5)
    assert report.values == 2 * LOOPS * np.prod(radar.frame_shape[1:]) * (1 if real else 2)
    np.testing.assert_array_equal(read_capture(tmp_path).data, cube.data)
    config = json.loads((tmp_path / "adc_data.mmwave.json").read_text())["mmWaveDevices"][0]
    assert config["rfConfig"]["rlAdcOutCfg_t"]["fmt"]["b2AdcOutFmt"] == (0 if real else 1)
    first = "1443" in name
    raw = config["rawDataCaptureConfig"]
    assert raw["rlDevLaneEnable_t"]["laneEn"] == ("0xF" if first else "0x3")
    assert raw["rlDevDataFmtCfg_t"]["chInterleave"] == (0 if first else 1)
    (tmp_path / "adc_data.rfgen").unlink()
    capture = open_capture(tmp_path, radar=Radar.load(name))
    assert capture.radar.adc.real == real
    np.testing.assert_array_equal(0.5 * capture.frame(1), cube.data[1])


def test_full_scale_of_a_real_tone(tmp_path: Path) -> None:
    """A tone of power P has the amplitude sqrt(2 P) in real samples (mean square P)."""
    radar = board("awr2944evm")
    power = 1e-3 * 10 ** (-20.0 / 10)
    phase = 2 * np.pi * np.arange(SAMPLES) / SAMPLES
    data = np.broadcast_to(np.sqrt(2 * power) * np.cos(phase), (1, *radar.frame_shape)).astype(np.float32)
    report = write_capture(AdcCube(data, radar, np.zeros(1)), tmp_path, full_scale_dbm=-20.0)
    assert report.full_scale_dbm == pytest.approx(-20.0)
    assert open_capture(tmp_path).lsb(0).min() == -32768
    np.testing.assert_allclose(np.mean(read_capture(tmp_path).data ** 2), power, rtol=1e-4)


def test_samples_of_the_wrong_kind_are_refused(tmp_path: Path) -> None:
    radar = board("awr2944evm")
    with pytest.raises(ValueError, match=r"cube\.data is complex64; radar 'awr2944evm' has a real ADC"):
        write_capture(AdcCube(np.zeros((1, *radar.frame_shape), np.complex64), radar, np.zeros(1)), tmp_path)
    for capture_format in ("cascade", "position2go", "rfgenesis"):
        with pytest.raises(CaptureFormatError, match=r"has a real ADC .*complex samples only"):
            write_capture(lsb_cube(radar, 1, 100), tmp_path, capture_format)
    with pytest.raises(ValueError, match="lanes is 3; 2 or 4"):
        write_capture(lsb_cube(board("awr1843"), 1, 100), tmp_path, lanes=3)


@pytest.mark.parametrize("streamed", [True, False])
def test_demonstrations_of_the_sdk_stream_q_before_i(tmp_path: Path, streamed: bool) -> None:
    """SampleSwap 1 of adcbufCfg stores Q in the lower half of a word, and LVDS sends that first. A demonstration that
    does not stream (dataFmt 0) made no recording: others' have I first."""
    (tmp_path / "profile.cfg").write_text(
        "channelCfg 15 1 0\nadcCfg 2 1\nadcbufCfg -1 0 1 1 1\nprofileCfg 0 60 100 7 57.14 0 0 70 1 256 5209 0 0 30\n"
        f"chirpCfg 0 0 0 0 0 0 0 1\nframeCfg 0 0 4 0 100 1 0\nlvdsStreamCfg -1 0 {int(streamed)} 0\n"
    )
    radar = Radar.load(tmp_path / "profile.cfg", board="iwr6843isk")
    assert radar.adc.iq_swap == streamed
    assert Radar.from_dict(radar.to_dict()) == radar
    beat = 2 * 2.5 / 299792458.0 * 70e12
    tone = np.rint(1000 * np.exp(2j * np.pi * beat * np.arange(256) / 5.209e6))
    parts = (tone.imag, tone.real) if streamed else (tone.real, tone.imag)
    content = np.stack([part.reshape(-1, 2) for part in parts], axis=1).astype("<i2")
    np.tile(content.ravel(), 4 * 4).tofile(tmp_path / "adc_data.bin")
    samples = open_capture(tmp_path / "adc_data.bin", radar=radar).lsb(0)
    np.testing.assert_array_equal(samples, np.broadcast_to(tone, (4, 1, 4, 256)))
    with pytest.warns(CaptureWarning, match=rf"farther half of the range axis .* pass iq_swap={streamed}"):
        other = open_capture(
            tmp_path / "adc_data.bin", radar=replace(radar, adc=replace(radar.adc, iq_swap=not streamed))
        )
    np.testing.assert_array_equal(other.lsb(0), samples.imag + 1j * samples.real)
    chosen = open_capture(tmp_path / "adc_data.bin", radar=radar, iq_swap=not streamed)
    np.testing.assert_array_equal(chosen.lsb(0), other.lsb(0))
