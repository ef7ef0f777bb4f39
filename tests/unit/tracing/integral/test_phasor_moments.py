"""Means of exp(-j phi) over a triangle against Gauss quadrature."""

import numpy as np
import pytest
from numba import njit

from rfgen_sionna.tracing.integral.phasor_moments import mean_phasor


@njit
def mean_phasors(phases, strengths, sagittas, found):
    """:func:`mean_phasor` (lane,) into `found`, of `phases`, `strengths` and `sagittas` (lane, 3)."""
    for k in range(found.shape[0]):
        p, w, s = phases[k], strengths[k], sagittas[k]
        found[k] = mean_phasor(p[0], p[1], p[2], w[0], w[1], w[2], s[0], s[1], s[2])


def quadrature(phases, strengths, sagittas):
    """The same by 3,600 points in collapsed coordinates."""
    nodes, weights = np.polynomial.legendre.leggauss(60)
    u, v = np.meshgrid(0.5 * (nodes + 1), 0.5 * (nodes + 1))
    weight = np.outer(0.5 * weights, 0.5 * weights) * (1 - v) * 2
    place = np.stack([(1 - u) * (1 - v), u * (1 - v), v])
    strength, linear = (np.tensordot(each, place, 1) for each in (strengths, phases))
    bulge = 4 * sum(sagittas[:, k, None, None] * place[k - 2] * place[k - 1] for k in range(3))
    return (weight * strength * np.exp(-1j * (linear - bulge))).sum(axis=(1, 2))


@pytest.mark.parametrize("spread", [0.01, 0.09, 0.11, 1.0, 10.0, 40.0])
def test_linear_phases_are_exact(spread):
    """Without a quadratic part the closed form and its series hold to 1e-6, on both sides of their border."""
    rng = np.random.default_rng(1)
    phases, strengths = rng.uniform(0, spread, (100, 3)), 1 + 0.3 * rng.standard_normal((100, 3))
    found = np.empty(100, np.complex128)
    mean_phasors(phases, strengths, np.zeros((100, 3)), found)
    assert np.abs(found - quadrature(phases, strengths, np.zeros((100, 3)))).max() < 2e-6


def test_the_error_of_quadratic_phases_is_of_second_order():
    """Half the quadratic phase, a quarter of the error."""
    rng = np.random.default_rng(2)
    phases, sagittas, found = rng.uniform(0, 3, (200, 3)), rng.standard_normal((200, 3)), np.empty(200, np.complex128)
    errors = []
    for size in (0.2, 0.1):
        mean_phasors(phases, np.ones((200, 3)), size * sagittas, found)
        errors.append(np.sqrt(np.mean(np.abs(found - quadrature(phases, np.ones((200, 3)), size * sagittas)) ** 2)))
    assert errors[0] < 0.02
    assert errors[1] < errors[0] / 3.5


def test_the_order_of_corners_does_not_matter():
    rng = np.random.default_rng(3)
    given = [rng.standard_normal((50, 3)) for _ in range(3)]
    found, turned = np.empty((2, 50), np.complex128)
    mean_phasors(*given, found)
    mean_phasors(*(np.ascontiguousarray(each[:, [2, 0, 1]]) for each in given), turned)
    assert np.allclose(found, turned, atol=1e-12)
