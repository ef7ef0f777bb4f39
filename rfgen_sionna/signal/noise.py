"""Thermal noise of the receiver."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.radar import Radar
from rfgen_sionna.signal.random_streams import frame_stream

BOLTZMANN = 1.380649e-23
"""[J/K] (exact, SI)."""


def noise_power(radar: Radar) -> float:
    """Noise power in one complex sample [W]: k T F B, with the complex sample rate as bandwidth B.

    Where profiles sample at different rates it is that of the fastest one.
    """
    return _density(radar) * max(profile.sample_rate for profile in radar.waveform.profiles)


def _density(radar: Radar) -> float:
    """k T F [W/Hz]"""
    return BOLTZMANN * radar.temperature * 10.0 ** (radar.noise_figure_db / 10.0)


def add_thermal_noise(samples: NDArray[np.complex128], radar: Radar, seed: int, frame: int) -> None:
    """Add circular white Gaussian noise in place to the samples of one frame, in square roots of watts.

    Any shape; (..., tx, rx, sample) where profiles sample at different rates.

    The same `seed`, `frame` and radar (its name and pose) give the same noise whatever else was simulated; another
    radar of the scene gets other noise.
    """
    rng = frame_stream(seed, "thermal_noise", frame, radar)
    wave = radar.waveform
    if len({profile.sample_rate for profile in wave.profiles}) == 1:
        sigma = np.asarray(np.sqrt(0.5 * noise_power(radar)))
    else:
        rates = np.array([wave.profiles[slot.profile].sample_rate for slot in wave.slots])
        sigma = np.sqrt(0.5 * _density(radar) * rates)[:, None, None]
    samples.real += sigma * rng.standard_normal(samples.shape)
    samples.imag += sigma * rng.standard_normal(samples.shape)
