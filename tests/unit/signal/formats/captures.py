"""The shipped radars, shortened so that many frames are quickly written, and cubes of whole LSB."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rfgen_sionna.radar import Radar
from rfgen_sionna.records import AdcCube

BGT60_SHAPE = {
    "aaf_cutoff_Hz": 500000,
    "chirp_repetition_time_s": 0.0005911249900236726,
    "end_frequency_Hz": 63500000000,
    "frame_repetition_time_s": 0.07726884633302689,
    "hp_cutoff_Hz": 80000,
    "if_gain_dB": 23,
    "mimo_mode": "off",
    "num_chirps_per_frame": 8,
    "num_samples_per_chirp": 64,
    "rx_antennas": [1, 2, 3],
    "sample_rate_Hz": 2000000,
    "start_frequency_Hz": 58000000000,
    "tx_antennas": [1],
    "tx_power_level": 31,
}
"""Chirps of a recording of a BGT60TR13C, as in the `config.json` of Infineon's SDK."""


def shortened(name: str, preset: str, loops: int, samples: int) -> Radar:
    radar = Radar.load(name, preset)
    return replace(radar, waveform=replace(radar.waveform, num_loops=loops, num_samples=samples))


def awr1843(loops: int = 4, samples: int = 6) -> Radar:
    """3 Tx × 4 Rx in mmMesh's slots: TX1, TX3, TX2."""
    return shortened("awr1843", "mmmesh", loops, samples)


def cascade(loops: int = 2, samples: int = 8) -> Radar:
    """12 Tx × 16 Rx; TX12 fires first."""
    return shortened("mmwcas", "ti_default", loops, samples)


def bgt60(loops: int = 3, samples: int = 8) -> Radar:
    """1 Tx × 3 Rx, real samples."""
    return shortened("bgt60tr13c", Radar.load("bgt60tr13c").preset, loops, samples)


def position2go(loops: int = 3, samples: int = 8) -> Radar:
    """1 Tx × 2 Rx."""
    return shortened("position2go", "default", loops, samples)


RADARS = {
    "dca1000": awr1843(),
    "cascade": cascade(),
    "position2go": position2go(),
    "infineon": bgt60(),
    "rfgenesis": awr1843(),
    "matlab": awr1843(),
}
FULL_SCALE = {"dca1000": 32768, "cascade": 32768, "position2go": 2048, "infineon": 2048}


def lsb_cube(radar: Radar, frames: int, full_scale: int, seed: int = 0, scale: float = 1.0) -> AdcCube:
    """Whole LSB over the full scale, both ends among them, times `scale` [sqrt(W)]."""
    wave = radar.waveform
    shape = (frames, *radar.frame_shape, 1 if radar.adc.real else 2)
    levels = np.random.default_rng(seed).integers(-full_scale, full_scale, size=shape)
    levels.flat[:2] = -full_scale, full_scale - 1
    values = levels.astype(np.float32) * np.float32(scale)
    data = values[..., 0] if radar.adc.real else values.view(np.complex64)[..., 0]
    return AdcCube(data=data, radar=radar, frame_times=1.5 + wave.frame_period * np.arange(frames), seed=seed)
