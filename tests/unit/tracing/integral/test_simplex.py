"""Closed-form moments of a phasor over a triangle against Gauss-Legendre quadrature."""

import numpy as np
import pytest

from rfgen_sionna.scene.kernels import drjit_types
from rfgen_sionna.tracing.integral.simplex import moments


def quadrature(p, n=160):
    """(10,) mean, three corner and three edge moments, and growth of the edge moments; Duffy's map makes the triangle a
    square."""
    node, weight = np.polynomial.legendre.leggauss(n)
    s, t = np.meshgrid((node + 1) / 2, (node + 1) / 2, indexing="ij")
    w = np.outer(weight, weight) / 4 * 2 * s  # Jacobian s, mean over an area of 1/2
    corner = np.stack([1 - s, s * (1 - t), s * t])
    phasor = w * np.exp(-1j * np.tensordot(p, corner, axes=1))
    pairs = ((1, 2), (0, 2), (0, 1))
    corners = [(corner[i] * phasor).sum() for i in range(3)]
    edges = [(corner[i] * corner[k] * phasor).sum() for i, k in pairs]
    turning = -1j * np.tensordot(p, corner, axes=1) * phasor
    return np.array([phasor.sum(), *corners, *edges, *((corner[i] * corner[k] * turning).sum() for i, k in pairs)])


PHASES = [
    (0.0, 0.0, 0.0),
    (1e-9, 2e-9, -1e-9),
    (0.2, -0.3, 0.4),
    (0.0, 0.0, 0.0999),
    (0.0, 0.0, 0.1001),
    (0.03, -0.02, 0.01),
    (-0.05, 0.0499, 0.0),
    (-0.05, 0.0501, 0.0),
    (-0.05, 0.04999, 0.05001),
    (0.0, 0.0, 0.999),
    (-0.5, 0.4999, 0.5001),
    (5.0, 5.0, 1.0),
    (5.0, 5.0 + 1e-9, 1.0),
    (3.0, -20.0, 11.0),
    (-60.0, 0.5, 60.0),
    (100.0, 100.2, 99.9),
    (0.0, 80.0, 79.7),
]


def test_moments_agree_with_quadrature():
    """All orders of the corners, in and between both branches, to 1e-11; growth relative to the largest phase."""
    dr, types = drjit_types()
    orders = [(0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)]
    phases = np.array([[phase[i] for i in order] for phase in PHASES for order in orders])
    found = moments(dr, tuple(types.Float64(np.ascontiguousarray(column)) for column in phases.T), growth=True)
    every = found.mean, *found.corner, *found.edge, *found.growth
    got = np.stack([each.re.numpy() + 1j * each.im.numpy() for each in every], axis=1)
    truth = np.array([quadrature(phase) for phase in phases])
    np.testing.assert_allclose(got[:, :7], truth[:, :7], rtol=0, atol=1e-11)
    of_one = np.maximum(np.abs(phases).max(axis=1), 1.0)[:, None]
    np.testing.assert_allclose(got[:, 7:] / of_one, truth[:, 7:] / of_one, rtol=0, atol=1e-11)


@pytest.mark.parametrize("shift", [0.0, 1e4])
def test_moments_add_up(shift):
    """sum_i <l_i e> = <e>, whatever the common phase."""
    dr, types = drjit_types()
    rng = np.random.default_rng(0)
    phases = shift + rng.normal(scale=np.repeat([0.1, 1.0, 10.0, 100.0], 50), size=(3, 200))
    found = moments(dr, tuple(types.Float64(np.ascontiguousarray(row)) for row in phases))
    total = sum(each.re.numpy() + 1j * each.im.numpy() for each in found.corner)
    np.testing.assert_allclose(total, found.mean.re.numpy() + 1j * found.mean.im.numpy(), rtol=0, atol=1e-10)
