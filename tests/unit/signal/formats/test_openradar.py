"""openradar (PyPI, module `mmwave`), which people run on DCA1000 files, reads ours as it reads a board's."""

from __future__ import annotations

from pathlib import Path

import mmwave.dataloader
import mmwave.dsp
import numpy as np
import pytest

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.processing import range_doppler
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import AdcCube
from rfgen_sionna.signal.formats import write_capture
from tests.reference.direct_sum import direct_sum
from tests.unit.signal.formats.captures import shortened


def target(radar: Radar, distance: float, velocity: float) -> AdcCube:
    """A point ahead and a little to the left, receding with `velocity` [m/s]; samples of about 1e-5 sqrt(W)."""
    towards = np.array([np.cos(0.2), np.sin(0.2), 0.0])

    def delay(times: np.ndarray, tx: int, rx: int) -> np.ndarray:
        point = towards * (distance + velocity * times[:, None])
        ends = (radar.tx_positions[tx], radar.rx_positions[rx])
        return np.sum([np.linalg.norm(point - end, axis=1) for end in ends], axis=0)[None] / SPEED_OF_LIGHT

    gain = np.full((len(radar.tx_names), len(radar.rx_names), 1), 1e-5 * np.exp(0.3j))
    return AdcCube(direct_sum(radar, delay, gain)[None].astype(np.complex64), radar, np.zeros(1))


@pytest.mark.parametrize(("distance", "velocity"), [(3.0, 1.2), (7.4, -2.0)])
def test_openradar_finds_the_same_samples_and_the_target_in_the_same_bins(
    tmp_path: Path, distance: float, velocity: float
) -> None:
    radar = shortened("awr1843", "mmmesh", 32, 256)
    cube = target(radar, distance, velocity)
    report = write_capture(cube, tmp_path)
    assert report.scale is not None
    raw = np.fromfile(tmp_path / "adc_data.bin", dtype=np.int16)
    frame = mmwave.dataloader.DCA1000.organize(raw, num_chirps=96, num_rx=4, num_samples=256)
    fired = cube.data[0][:, [0, 2, 1]].reshape(96, 4, 256) / report.scale
    error = frame - fired
    assert max(np.abs(error.real).max(), np.abs(error.imag).max()) <= 0.51  # half an LSB, and float32

    ranges = mmwave.dsp.range_processing(frame)
    power, _ = mmwave.dsp.doppler_processing(ranges, num_tx_antennas=3, clutter_removal_enabled=False)
    power = np.fft.fftshift(power, axes=1)  # openradar leaves zero Doppler in front
    ours = range_doppler(cube.data[0], radar, range_window="boxcar", velocity_window="boxcar")
    theirs = np.unravel_index(np.argmax(power), power.shape)
    assert theirs == np.unravel_index(np.argmax(ours.power), ours.power.shape)
    assert abs(ours.range[theirs[0]] - distance) < radar.range_resolution
    assert abs(ours.velocity[theirs[1]] - velocity) < 0.6 * radar.velocity_resolution
