"""Means over curved triangles against dense quadrature of the same quadratics."""

import numpy as np
import pytest

from rfgen_sionna.tracing.curved.array_elements import band_nodes, fit_over_band
from tests.reference.sbr.footprints import _mean


def dense(phase, strength, n=300):
    x, w = np.polynomial.legendre.leggauss(n)
    x, w = 0.5 * (x + 1), 0.5 * w
    u, v = (each.ravel() for each in np.meshgrid(x, x, indexing="ij"))
    weight = 2 * u * np.outer(w, w).ravel()
    corner = np.stack([1 - u, u * (1 - v), u * v])
    shapes = np.concatenate([corner * (2 * corner - 1), 4 * corner[[1, 2, 0]] * corner[[2, 0, 1]]])
    middle = 4 / 9 * phase[:, 3:].sum(axis=1) - phase[:, :3].sum(axis=1) / 9
    return (strength @ shapes * np.exp(-1j * (phase @ shapes - middle[:, None]))) @ weight


@pytest.mark.parametrize("size", [0.01, 1.0, 10.0, 100.0])
def test_means_of_quadratics_are_those_of_dense_quadrature(size):
    """To a thousandth of the strength: the bend within a part of a footprint is kept to first order."""
    rng = np.random.default_rng(int(size * 100))
    phase = size * rng.normal(size=(20, 6))
    strength = 1.0 + 0.1 * (rng.normal(size=(20, 6)) + 1j * rng.normal(size=(20, 6)))
    assert np.abs(_mean(1.0, phase, strength) - dense(phase, strength)).max() < 1e-3


def test_a_few_frequencies_tell_the_band():
    """A footprint over which paths differ by 5 cm, over 4 GHz, within the tolerance that was asked for."""
    u = band_nodes(0.05, 2e9, 1e-3)
    assert len(u) > 2
    x = 2 * np.pi * 2e9 * 0.025 / 299792458.0
    found = fit_over_band(u, np.exp(-1j * x * u)[:, None])[:, 0]
    places = np.linspace(-1, 1, 51)
    values = sum(c * places**k for k, c in enumerate(found))
    assert np.abs(values - np.exp(-1j * x * places)).max() < 1e-3
    assert len(band_nodes(1e-6, 2e9, 1e-3)) == 1
