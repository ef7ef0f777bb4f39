"""Radars in the shapes of three boards, small enough to write many frames of, and cubes of whole LSB."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.radar import Radar
from rfgen_sionna.radar.pattern import ElementPattern
from rfgen_sionna.radar.waveform import Waveform
from rfgen_sionna.records import AdcCube

HALF_CASCADE, HALF_P2G = 299_792_458.0 / 76.8e9 / 2, 299_792_458.0 / 24.125e9 / 2


def awr1843(loops: int = 4, samples: int = 6) -> Radar:
    """The shipped radar with mmMesh's slots (TX1, TX3, TX2), shortened."""
    radar = Radar.load("awr1843", "mmmesh")
    return replace(radar, waveform=replace(radar.waveform, num_loops=loops, num_samples=samples))


def cascade(loops: int = 2, samples: int = 4) -> Radar:
    """12 Tx and 16 Rx of the MMWCAS-RF-EVM; TX12 fires first."""
    azimuth, elevation = [11, 10, 9, 32, 28, 24, 20, 16, 12, 8, 4, 0], [6, 4, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0]
    receivers = [11, 12, 13, 14, 50, 51, 52, 53, 46, 47, 48, 49, 0, 1, 2, 3]
    tx = [[0.0, HALF_CASCADE * y, HALF_CASCADE * z] for y, z in zip(azimuth, elevation, strict=True)]
    rx = [[0.0, HALF_CASCADE * y, -0.05] for y in receivers]
    wave = Waveform(
        start_frequency=77e9, slope=42.003e12, sample_rate=22.5e6, num_samples=samples, idle_time=2e-6,
        adc_start_time=2.72e-6, ramp_end_time=14.32e-6, num_loops=loops, tx_order=tuple(range(11, -1, -1)),
        frame_period=0.1,
    )  # fmt: skip
    return _radar("mmwcas", wave, np.array(tx), np.array(rx))


def position2go(loops: int = 3, samples: int = 8) -> Radar:
    """1 Tx and 2 Rx at 24 GHz; a slow ramp and a long pause."""
    rx = [[0.0, 0.0, 0.01], [0.0, HALF_P2G, 0.01]]
    wave = Waveform(
        start_frequency=24.025e9, slope=200e6 / 300e-6, sample_rate=64 / 300e-6, num_samples=samples,
        idle_time=200e-6, adc_start_time=0.0, ramp_end_time=300e-6, num_loops=loops, tx_order=(0,), frame_period=0.15,
    )  # fmt: skip
    return _radar("position2go", wave, np.array([[0.0, 0.0, 0.0]]), np.array(rx))


def _radar(name: str, wave: Waveform, tx: NDArray[np.float64], rx: NDArray[np.float64]) -> Radar:
    return Radar(
        name=name, preset="test", waveform=wave, pattern=ElementPattern(peak_gain_dbi=5.0), polarization="V",
        tx_names=tuple(f"TX{i + 1}" for i in range(len(tx))), rx_names=tuple(f"RX{i + 1}" for i in range(len(rx))),
        tx_positions=tx, rx_positions=rx, tx_power_dbm=10.0, noise_figure_db=14.0, temperature=290.0,
    )  # fmt: skip


RADARS = {
    "dca1000": awr1843(),
    "cascade": cascade(),
    "position2go": position2go(),
    "rfgenesis": awr1843(),
    "matlab": awr1843(),
}
FULL_SCALE = {"dca1000": 32768, "cascade": 32768, "position2go": 2048}


def lsb_cube(radar: Radar, frames: int, full_scale: int, seed: int = 0, scale: float = 1.0) -> AdcCube:
    """Whole LSB over the full scale, both ends among them, times `scale` [sqrt(W)]."""
    wave = radar.waveform
    shape = (frames, wave.num_loops, len(radar.tx_names), len(radar.rx_names), wave.num_samples, 2)
    levels = np.random.default_rng(seed).integers(-full_scale, full_scale, size=shape)
    levels.flat[:2] = -full_scale, full_scale - 1
    data = (levels.astype(np.float32) * np.float32(scale)).view(np.complex64)[..., 0]
    return AdcCube(data=data, radar=radar, frame_times=1.5 + wave.frame_period * np.arange(frames), seed=seed)
