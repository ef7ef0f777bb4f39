"""Delays, delay rates and phasors against NumPy."""

import numpy as np
import pytest

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.tracing.integral.propagation import delay_rates, phasors, propagation_delays


@pytest.mark.parametrize(("senders", "receivers"), [(1, 1), (3, 4), (12, 16), (3, 1), (1, 2)])
def test_delays_are_path_lengths_over_the_speed_of_light(senders, receivers):
    rng = np.random.default_rng(senders)
    places, tx, rx = rng.normal(size=(501, 3)) * 5, rng.normal(size=(senders, 3)), rng.normal(size=(receivers, 3))
    there = np.linalg.norm(places - tx[:, None], axis=2)[:, None]
    back = np.linalg.norm(places - rx[:, None], axis=2)
    assert np.abs(propagation_delays(places, tx, rx) * SPEED_OF_LIGHT - there - back).max() < 1e-14 * 30
    # Of fewer places, and of none.
    assert np.array_equal(propagation_delays(places[:7], tx, rx), propagation_delays(places, tx, rx)[..., :7])
    assert propagation_delays(places[:0], tx, rx).shape == (senders, receivers, 0)


def test_rates_are_differences_of_delays():
    rng = np.random.default_rng(7)
    places, speed = rng.normal(size=(2, 300, 3)) + 3.0
    tx, rx, step = rng.normal(size=(3, 3)), rng.normal(size=(4, 3)), 1e-5
    change = (propagation_delays(places + step * speed, tx, rx) - propagation_delays(places - step * speed, tx, rx)) / (
        2 * step
    )
    assert np.abs(delay_rates(places, speed, tx, rx) - change).max() < 1e-9 * np.abs(change).max()


def test_phasors_are_complex_exponentials():
    cycles = np.concatenate([np.linspace(-3, 3, 4001), np.random.default_rng(0).uniform(0, 1e4, 100_000)])
    assert np.abs(phasors(cycles) - np.exp(-2j * np.pi * np.mod(cycles, 1.0))).max() < 2e-15
    assert np.abs(phasors(np.array([0.0, 1e6, 0.25, 0.5, -0.25])) - [1, 1, -1j, -1, 1j]).max() < 1e-15


def test_phasors_of_any_shape():
    cycles = np.random.default_rng(1).uniform(0, 5, (3, 40, 7))
    assert np.array_equal(phasors(cycles), phasors(cycles.ravel()).reshape(cycles.shape))
    assert np.array_equal(phasors(cycles[:, ::2]), phasors(cycles)[:, ::2])
    assert phasors(np.zeros((0, 4))).shape == (0, 4)
