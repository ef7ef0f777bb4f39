"""Small radars and point targets for tests of the receiver."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray
from rfgen_sionna.radar import ElementPattern, Radar


@pytest.fixture(scope="session")
def small() -> Callable[..., Radar]:
    """The mmMesh chirp in a frame of a few loops, isotropic elements, 30 dBm; changes of the waveform by name."""

    def make(loops: int = 4, **changes: Any) -> Radar:
        radar = Radar.load("awr1843", "mmmesh")
        waveform = replace(radar.waveform, num_loops=loops, **changes)
        return replace(radar, waveform=waveform, pattern=ElementPattern(0.0), tx_power_dbm=30.0)

    return make


@pytest.fixture(scope="session")
def echoes() -> Callable[..., ComplexArray]:
    """(chirp, tx, rx, sample) of still targets at `ranges` [m] with `gains`, from the definition."""

    def make(radar: Radar, ranges: Any, gains: Any = 1.0, extra_delay: float = 0.0) -> ComplexArray:
        wave = radar.waveform
        tau = 2 * np.atleast_1d(ranges)[:, None] / SPEED_OF_LIGHT + extra_delay
        cycles = wave.start_frequency * tau + wave.slope * wave.sample_times * tau - 0.5 * wave.slope * tau**2
        one = (np.broadcast_to(gains, len(tau))[:, None] * np.exp(2j * np.pi * np.mod(cycles, 1.0))).sum(axis=0)
        shape = (wave.num_loops, len(radar.tx_names), len(radar.rx_names), wave.num_samples)
        return np.broadcast_to(one, shape).copy()

    return make
