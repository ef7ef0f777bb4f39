"""Fresnel transition at a shadow boundary, against dense quadrature."""

import numpy as np
import pytest

from rfgen_sionna.tracing.reflectors.reflector_shadows import fresnel_transition, transition_integral


def test_half_of_the_field_on_the_boundary_and_all_or_nothing_far_from_it():
    assert fresnel_transition(np.array([0.0]))[0] == pytest.approx(0.5)
    # The edge wave falls off with 1 / (pi sqrt(2) v).
    for v in (20.0, -20.0):
        assert abs(fresnel_transition(np.array([v]))[0] - (v > 0)) == pytest.approx(
            1 / (np.pi * np.sqrt(2) * 20), rel=1e-3
        )


@pytest.mark.parametrize("slope", [0.0, 0.3, -2.0, 7.0])
@pytest.mark.parametrize(("low", "high"), [(-3.0, 4.0), (-6.0, -0.5), (0.2, 5.0), (-4.0, 0.0), (0.0, 2.5)])
def test_difference_to_geometrical_optics_equals_quadrature(low, high, slope):
    """Within 1e-4, the effect of the least slope."""
    v = low + (np.arange(200_000) + 0.5) / 200_000 * (high - low)
    truth = ((fresnel_transition(v) - (v > 0)) * np.exp(-1j * slope * v)).mean() * (high - low)
    assert abs(transition_integral(*(np.array([each]) for each in (low, high, slope)))[0] - truth) < 1e-4


def test_over_all_v_it_is_the_difference_of_the_edge_wave_and_the_straight_wave():
    q = np.array([0.5, 3.8, -9.0])
    found = transition_integral(np.full(3, -np.inf), np.full(3, np.inf), q)
    assert np.allclose(found, 1j / q - 1j * np.exp(0.5j * q**2 / np.pi) / q)
    # At most half a zone, and 0 where the phase is stationary.
    q = np.linspace(-30, 30, 1001)
    assert abs(transition_integral(np.full(1001, -np.inf), np.full(1001, np.inf), q)).max() == pytest.approx(
        0.481, abs=2e-3
    )
