"""What waves turn by is exp(-2j pi c), whole turns left out."""

import numpy as np

from rfgen_sionna.tracing.integral.phasors import phasors


def test_they_are_complex_exponentials():
    cycles = np.concatenate([np.linspace(-3, 3, 4001), np.random.default_rng(0).uniform(0, 1e4, 100_000)])
    assert np.abs(phasors(cycles) - np.exp(-2j * np.pi * np.mod(cycles, 1.0))).max() < 2e-15
    assert np.abs(phasors(np.array([0.0, 1e6, 0.25, 0.5, -0.25])) - [1, 1, -1j, -1, 1j]).max() < 1e-15


def test_of_any_shape():
    cycles = np.random.default_rng(1).uniform(0, 5, (3, 40, 7))
    assert np.array_equal(phasors(cycles), phasors(cycles.ravel()).reshape(cycles.shape))
    assert np.array_equal(phasors(cycles[:, ::2]), phasors(cycles)[:, ::2])
    assert phasors(np.zeros((0, 4))).shape == (0, 4)
