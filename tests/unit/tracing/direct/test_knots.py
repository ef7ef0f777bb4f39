"""Knots of a motion, and errors between them."""

import numpy as np
import pytest

from rfgen_sionna.tracing.direct.knot_count import count_knots
from rfgen_sionna.tracing.direct.time_error import leave_one_out, prediction_error

PAIR = [(np.zeros(3), np.zeros(3))]
WAVENUMBER = 2 * np.pi * 77e9 / 3e8


def vibrating(amplitude, rate):
    points = np.array([[3.0, 0, 0], [3.0, 0.1, 0]])
    along = np.array([amplitude, 0, 0])
    return lambda t: [points + np.sin(2 * np.pi * rate * t) * along]


@pytest.mark.parametrize("rate", [20.0, 390.0, 700.0])
def test_vibrations_get_knots_at_twice_their_rate_and_more(rate):
    """Also where evenly spaced times would be in step with them."""
    count, _ = count_knots(vibrating(1e-4, rate), PAIR, 0.0, 0.0276, WAVENUMBER, 1e-3, 4)
    assert count > 2 * rate * 0.0276


def test_rest_and_steady_motion_take_the_fewest_knots():
    for motion in (vibrating(0.0, 1.0), lambda t: [np.array([[3.0 + 2.0 * t, 0, 0]])]):
        assert count_knots(motion, PAIR, 0.0, 0.0276, WAVENUMBER, 1e-3, 4)[0] == 4


@pytest.mark.parametrize("count", [3, 4, 7, 12])
def test_polynomials_are_predicted_exactly(count):
    """Up to the degree of the neighbours that predict."""
    times = np.linspace(-1, 1, count)
    for degree in range(min(count - 1, 4)):
        assert np.abs(leave_one_out(count) @ times**degree).max() < 1e-12


def test_a_prediction_with_exact_delays_has_no_error():
    """A point in steady motion: gain and delay are polynomials, its phase is not."""
    times = np.linspace(0, 1, 5)
    gains = np.outer([1.0, 2.0], 1 + 0.1 * times).astype(complex)
    delays = np.outer([1.0, 1.1], 1e-8 * (1 + 0.01 * times))
    missed, level = prediction_error(gains, delays, 77e9, np.zeros(2, np.int32), 1)
    assert missed[0] < 1e-9 * level[0]
    broken = delays.copy()
    broken[0, 2] += 1e-12
    assert prediction_error(gains, broken, 77e9, np.zeros(2, np.int32), 1)[0][0] > 0.05 * level[0]
