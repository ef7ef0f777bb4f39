"""Thermal noise of the receiver."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.radar import Radar

BOLTZMANN = 1.380649e-23
"""[J/K] (exact, SI)."""


def noise_power(radar: Radar) -> float:
    """Noise power in one complex sample [W]: k T F B, with the complex sample rate as bandwidth B."""
    factor = 10.0 ** (radar.noise_figure_db / 10.0)
    return BOLTZMANN * radar.temperature * factor * radar.waveform.sample_rate


def add_thermal_noise(samples: NDArray[np.complex128], radar: Radar, seed: int, frame: int) -> None:
    """Add circular white Gaussian noise in place to the samples of one frame, any shape, in square roots of watts.

    The same `seed` and `frame` give the same noise whatever else was simulated.
    """
    rng = np.random.default_rng(np.random.SeedSequence([seed, frame]))
    sigma = np.sqrt(0.5 * noise_power(radar))
    samples.real += rng.normal(scale=sigma, size=samples.shape)
    samples.imag += rng.normal(scale=sigma, size=samples.shape)
