"""About what facets return, and which of them are left out."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rfgen_sionna.tracing.moving.culling import cull_weakest
from rfgen_sionna.tracing.moving.representative_faces import _mean_phasor
from rfgen_sionna.tracing.surface.return_estimates import estimate_returns, mean_phasor, solid_angles

WAVENUMBER = 2 * np.pi / 3.9e-3


def triangles(seed, count=400, size=0.02, away=1.0):
    """(axis, corner, facet) [m] of all shapes, from edge-on to face-on."""
    rng = np.random.default_rng(seed)
    return np.array([away, 0, 0])[:, None, None] + size * rng.normal(size=(3, 3, count)) * rng.random(count)


@given(st.integers(0, 10_000), st.floats(1e-4, 0.1))
@settings(max_examples=100, deadline=None)
def test_a_mean_phasor_is_at_most_1_7_times_its_estimate(seed, size):
    """A difference of two phasors, each no longer than 1.2 / sqrt(1 + x^2): at most sqrt(2) times their root sum."""
    corners = triangles(seed, size=size)
    phases = 2 * WAVENUMBER * np.sqrt((corners**2).sum(axis=0))
    truth, told = np.abs(_mean_phasor(phases - phases[0])), mean_phasor(corners, WAVENUMBER)
    assert (truth <= 1.2 * np.sqrt(2.0) * told + 1e-6).all()
    assert 0.3 < np.sqrt((truth**2).sum() / (told**2).sum()) < 1.7


def test_solid_angles_of_small_triangles():
    """By Van Oosterom and Strackee's formula; negative for triangles that face away."""
    corners = triangles(0, size=1e-3)
    a, b, c = np.moveaxis(corners, 1, 0)
    x, y, z = (np.linalg.norm(each, axis=0) for each in (a, b, c))
    volume = np.einsum("if,if->f", a, np.cross(b, c, axis=0))
    total = x * y * z + (a * b).sum(axis=0) * z + (b * c).sum(axis=0) * x + (c * a).sum(axis=0) * y
    assert solid_angles(corners) == pytest.approx(-2 * np.arctan2(volume, total), rel=0.02, abs=1e-12)
    assert np.allclose(solid_angles(corners[:, ::-1]), -solid_angles(corners), rtol=1e-9)


@pytest.mark.parametrize("turn", [1, 2])
def test_which_corner_comes_first_makes_no_difference(turn):
    corners = triangles(1)
    assert np.allclose(
        estimate_returns(np.roll(corners, turn, axis=1), WAVENUMBER), estimate_returns(corners, WAVENUMBER), rtol=1e-9
    )


@given(st.integers(0, 10_000), st.floats(0.0, 1.0), st.integers(1, 3))
@settings(max_examples=100, deadline=None)
def test_culled_facets_return_no_more_than_allowed(seed, share, surfaces):
    """For each surface; one more facet would exceed it."""
    rng = np.random.default_rng(seed)
    return_estimate, surface = rng.exponential(size=500) ** 2, rng.integers(0, surfaces, 500)
    return_estimate[rng.random(500) < 0.1] = 0.0  # facets without an estimate
    allowed = share * np.sqrt(np.bincount(surface, return_estimate**2, surfaces))
    wave = return_estimate * np.exp(2j * np.pi * rng.random(500))
    found, left = cull_weakest(return_estimate, surface, allowed, lambda some: wave[some])
    assert not found[return_estimate == 0].any()
    for number in range(surfaces):
        mine = np.flatnonzero((surface == number) & (return_estimate > 0))
        mine = mine[np.argsort(return_estimate[mine])]
        apart, together = np.sqrt(np.cumsum(return_estimate[mine] ** 2)), np.abs(np.cumsum(wave[mine]))
        count = int(found[mine].sum())
        assert found[mine[:count]].all()  # the weakest ones
        most = np.maximum(apart, np.maximum.accumulate(together)) if len(mine) else np.zeros(0)
        assert left[number] == pytest.approx(most[count - 1] if count else 0.0)
        assert left[number] <= allowed[number] * (1 + 1e-12)
        if count < len(mine):
            assert max(most[count], return_estimate[mine[count]]) > allowed[number] * (1 - 1e-12)


def test_fewer_equal_facets_are_culled():
    """A hundred facets in phase return ten times their incoherent sum."""
    return_estimate, allowed = np.full(1000, 1e-3), np.array([1.001e-2])
    surface = np.zeros(1000, np.int32)
    apart = cull_weakest(
        return_estimate, surface, allowed, lambda some: return_estimate[some] * np.exp(2j * np.pi * 0.37 * some)
    )[0]
    alike = cull_weakest(return_estimate, surface, allowed, lambda some: return_estimate[some].astype(complex))[0]
    assert apart.sum() == 100
    assert alike.sum() == 10
