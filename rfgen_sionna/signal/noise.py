"""Random streams of a radar, one for each impairment, and the thermal noise of its receiver.

A stream depends on the seed, on the name of the impairment and on the name and pose of the radar at t = 0, to the
micrometre and microradian: radars of one scene draw independently, and no impairment changes the draws of another.
"""

from __future__ import annotations

import hashlib
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.radar import Radar

BOLTZMANN = 1.380649e-23
"""[J/K] (exact, SI)."""


def _key(name: str, radar: Radar) -> tuple[int, ...]:
    place = np.rint(np.array([*radar.position, *radar.orientation]) * 1e6).astype("<i8")
    digest = hashlib.blake2b(radar.name.encode() + b"\0" + place.tobytes(), digest_size=8).digest()
    return (zlib.crc32(name.encode()), *np.frombuffer(digest, "<u4").tolist())


def device_stream(seed: int, name: str, radar: Radar) -> np.random.Generator:
    """Random generator of an impairment `name` that is constant over all frames."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=_key(name, radar)))


def frame_stream(seed: int, name: str, frame: int, radar: Radar) -> np.random.Generator:
    """Random generator of an impairment `name` in one frame."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(*_key(name, radar), frame)))


def noise_seed(seed: int, index: int) -> int:
    """Seed of the receiver of radar number `index` of a recording: the recording's own for the first one.

    Two radars of one name at one place would have the same noise otherwise.
    """
    return seed if index == 0 else int(np.random.SeedSequence([seed, 79, index]).generate_state(1)[0])


def check_whole(name: str, value: Any) -> int:
    """`value`, checked to be a whole number of at least 0."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < 0:
        raise ValueError(f"{name} is {value!r}: a whole number of at least 0 is needed")
    return int(value)


def noise_power(radar: Radar) -> float:
    """Noise power in one sample [W]: k T F B. The bandwidth B is the largest sample rate, half of it for a real ADC."""
    return _density(radar) * max(profile.sample_rate for profile in radar.waveform.profiles)


def _density(radar: Radar) -> float:
    """Noise power in one sample over the sample rate [W/Hz]: k T F, half of it for a real ADC."""
    density = BOLTZMANN * radar.temperature * 10.0 ** (radar.noise_figure_db / 10.0)
    return 0.5 * density if radar.adc.real else density


def add_thermal_noise(samples: NDArray[np.complex128], radar: Radar, seed: int, frame: int) -> None:
    """Add circular white Gaussian noise in place to the `samples` of one frame [sqrt(W)].

    `samples` has any shape, but (..., tx, rx, sample) where profiles sample at different rates; they are complex, also
    for a real ADC, before its real part is taken. The noise depends on `seed`, `frame`, and the name and pose of the
    radar alone.
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
