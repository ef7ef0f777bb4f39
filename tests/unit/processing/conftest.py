"""Point targets straight from the beat equation: the oracle of these tests shares no code with the package."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from rfgen_sionna.radar import Radar

C = 299_792_458.0


def beat_cube(
    radar: Radar,
    targets: list[tuple[Any, Any, complex]],
    frames: int = 1,
    noise: float = 0.0,
    seed: int = 0,
) -> np.ndarray:
    """(frame, chirp, tx, rx, sample) of targets (position at time 0, velocity, amplitude) in the device frame.

    Exact spherical paths per element pair, every sample at its own instant. A real ADC has sqrt(2) times the real part
    and half the noise power. Feeds turn the wave, of which the mixer takes the conjugate.
    """
    wave = radar.waveform
    fast = wave.adc_start_time + np.arange(wave.num_samples) / wave.sample_rate
    shape = (frames, wave.num_loops, len(radar.tx_positions), len(radar.rx_positions), wave.num_samples)
    cube = np.zeros(shape, complex)
    slots = {tx: slot for slot, tx in enumerate(wave.tx_order)}
    for frame in range(frames):
        for tx in range(cube.shape[2]):
            ramp = (
                frame * wave.frame_period
                + np.arange(wave.num_loops) * len(wave.tx_order) * (wave.idle_time + wave.ramp_end_time)
                + slots[tx] * (wave.idle_time + wave.ramp_end_time)
            )
            t = ramp[:, None] + fast
            for position, velocity, amplitude in targets:
                point = np.asarray(position, float) + t[..., None] * np.asarray(velocity, float)
                out = np.linalg.norm(point - radar.tx_positions[tx], axis=-1)
                for rx in range(cube.shape[3]):
                    tau = (out + np.linalg.norm(point - radar.rx_positions[rx], axis=-1)) / C
                    turns = wave.start_frequency * tau + wave.slope * fast * tau - 0.5 * wave.slope * tau**2
                    for phases, element in ((radar.tx_phases_deg, tx), (radar.rx_phases_deg, rx)):
                        turns -= phases[element] / 360 if phases else 0.0
                    cube[frame, :, tx, rx] += amplitude * np.exp(2j * np.pi * (turns % 1))
    if noise:
        rng = np.random.default_rng(seed)
        share = noise / np.sqrt(2) if radar.adc.real else noise
        cube += share * np.sqrt(0.5) * (rng.standard_normal(cube.shape) + 1j * rng.standard_normal(cube.shape))
    if radar.adc.real:
        return (np.sqrt(2) * cube.real).astype(np.float32)
    return cube.astype(np.complex64)


@pytest.fixture(scope="session")
def synthesise() -> Callable[..., np.ndarray]:
    return beat_cube


@pytest.fixture(scope="session")
def mmmesh() -> Radar:
    return Radar.load("awr1843", preset="mmmesh")


@pytest.fixture(scope="session")
def di_gesture() -> Radar:
    return Radar.load("awr1843", preset="di_gesture")
