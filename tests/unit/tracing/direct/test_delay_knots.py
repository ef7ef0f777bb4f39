"""Knots: as many as the motion asks for, whatever its rhythm, for each mesh by itself."""

import numpy as np
import pytest

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.records import knot_weights
from rfgen_sionna.tracing.direct.knots import choose_knots, spline_error

FREQUENCY = 77e9
K = 4 * np.pi * FREQUENCY / SPEED_OF_LIGHT
LENGTH = 27.648e-3
STILL = np.array([[2.0, 0.5, 0.0], [2.1, 0.5, 0.0], [2.0, 0.6, 0.1]])


def everywhere(directions):
    """Gain of isotropic elements."""
    return np.ones(directions.shape[:-1])


def knots_of(*shifts, tolerance=3e-3, stop=27.648e-3, spacing=7e-3):
    """Knots for meshes of three vertices that are shifted along x by functions of the time [m]."""

    def positions(t):
        return [STILL + np.array([shift(t), 0, 0]) for shift in shifts]

    return choose_knots(positions, np.zeros(3), 0.0, stop, FREQUENCY, tolerance, spacing, everywhere, 0.01).times


def error_of(shift, knots):
    t = np.linspace(0, 27.648e-3, 301)
    truth, values = (np.array([shift(x) for x in times]) for times in (t, knots))
    return K * np.abs(knot_weights(knots, t) @ values - truth).max()


def test_one_knot_without_motion():
    assert len(knots_of(lambda t: 0.0)) == 1
    assert len(knots_of()) == 1


def test_uniform_motion_gets_the_widest_gaps():
    """At constant speed a cubic's four, and no more than what visibility asks for: here 5 ms at most."""
    assert len(knots_of(lambda t: 1.5 * t, spacing=1.0)) == 4
    assert len(knots_of(lambda t: 1.5 * t, spacing=5e-3)) == 7


@pytest.mark.parametrize("frequency", [20.0, 60.0, 284.35, 288.85, 8 / 27.648e-3, 11 / 27.648e-3])
def test_vibrations_are_followed_at_any_frequency(frequency):
    """0.1 mm, in step with evenly spaced knots or not."""

    def shift(t):
        return 1e-4 * np.sin(2 * np.pi * frequency * t)

    knots = knots_of(shift)
    assert len(knots) > 3
    assert error_of(shift, knots) < 0.03


def test_many_still_meshes_do_not_mask_a_moving_one():
    """A fast mesh gets its knots among any number of still ones."""

    def fast(t):
        return 0.05 * np.sin(2 * np.pi * 12 * t)

    alone = knots_of(fast)
    np.testing.assert_array_equal(knots_of(*[lambda t: 0.0] * 50, fast), alone)
    assert error_of(fast, alone) < 0.03


def test_a_kink_warns_at_bounded_cost(caplog):
    knots = knots_of(lambda t: 2.0 * min(t, 0.011))
    assert len(knots) <= 193
    assert "not smooth" in caplog.text


@pytest.mark.parametrize("rate", [50.0, 300.0, 1000.0, 1500.0])
def test_stated_error_of_knots(rate):
    """Of 1 mm: the spline's own error over the interval, found at one place between each two. Smooth vibrations get as
    many knots as they take."""

    def shift(t):
        return 1e-3 * np.sin(2 * np.pi * rate * t)

    given = np.zeros(3), 0.0, LENGTH, FREQUENCY, 1e-3, 10e-3, everywhere, 0.0
    knots, error = choose_knots(lambda t: [STILL + np.array([shift(t), 0, 0])], *given)
    times = np.linspace(0, LENGTH, 5001)
    missed = K * np.sqrt(np.mean((knot_weights(knots, times) @ shift(knots) - shift(times)) ** 2))
    assert 0.5 < error / missed < 1.5
    assert error <= 1e-3


def circling(rate):
    """Circles around the radar, at constant distances."""

    def positions(t):
        cos, sin = np.cos(rate * t), np.sin(rate * t)
        return [STILL @ np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])]

    return positions


def cosine_eighth(directions):
    """Gain of a beam 34 degrees wide."""
    return np.maximum(directions[..., 0], 0.0) ** 8


@pytest.mark.parametrize("rate", [1.0, 10.0, 60.0])
def test_gains_of_a_turning_beam(rate):
    """Gains by splines through the knots are right to the tolerance; who walks by gets no more for it than a cubic's
    four."""
    given = np.zeros(3), 0.0, LENGTH, FREQUENCY, 1e-3, 10e-3
    knots, error = choose_knots(circling(rate), *given, cosine_eighth, 0.0)
    assert (len(knots) == 4) == (rate < 60)

    def gains(times):
        there = np.stack([circling(rate)(t)[0] for t in times])
        return cosine_eighth(there / np.linalg.norm(there, axis=-1, keepdims=True))

    times = np.linspace(0, LENGTH, 1001)
    truth = gains(times)
    missed = knot_weights(knots, times) @ gains(knots) - truth
    assert np.sqrt(np.mean(missed**2) / np.mean(truth**2)) < 2 * max(error, 1e-6)
    assert error < 1e-3


def test_a_discontinuous_pattern_keeps_few_knots(caplog):
    """A table whose ends differ jumps behind the radar: knots end where more don't halve what is missed, a quarter as
    many as there may be, and what is missed of the gain is said."""

    def jumping(directions):
        return np.where(directions[..., 1] > 0, 0.1, 0.063)  # -20 and -24 dB

    def past(t):
        return [STILL * [-1, 0, 1] + np.array([0, 0.1 * (t - 0.4 * LENGTH), 0])]

    knots, error = choose_knots(past, np.zeros(3), 0.0, LENGTH, FREQUENCY, 1e-3, 10e-3, jumping, 0.0)
    assert len(knots) == 49
    assert 0.01 < error < 0.37  # no more than the jump, over what is the larger of both
    assert "not smooth" not in caplog.text


@pytest.mark.parametrize("rate", [1.0, 60.0])
def test_phases_of_elements_beside_the_phase_centre(rate):
    """A pair of elements 1 cm beside the phase centre has its phase to the tolerance."""
    reach = 0.01
    given = np.zeros(3), 0.0, LENGTH, FREQUENCY, 1e-3, 10e-3
    knots, error = choose_knots(circling(rate), *given, everywhere, reach)
    assert (len(knots) == 4) == (rate == 1.0)
    times = np.linspace(0, LENGTH, 1001)
    truth, values = (
        K * np.stack([np.linalg.norm(circling(rate)(t)[0] - [0, reach, 0], axis=-1) for t in when])
        for when in (times, knots)
    )
    missed = np.sqrt(np.mean((knot_weights(knots, times) @ values - truth) ** 2))
    assert missed < 2 * max(error, 1e-5)
    assert error < 1e-3


@pytest.mark.parametrize(("gaps", "most"), [(2, 1.1), (3, 1.4), (5, 1.1), (12, 2.0), (40, 1.1)])
@pytest.mark.parametrize("swing", [0.1, 0.3, 0.6])
def test_spline_error_of_a_phasor(gaps, most, swing):
    """The error law of the choice of sample times holds for the spline through them."""
    sample_times, times = np.arange(gaps + 1.0), np.linspace(0.0, gaps, 40 * gaps + 1)
    found = knot_weights(sample_times, times) @ np.exp(1j * swing * sample_times)
    missed = np.sqrt(np.mean(np.abs(found - np.exp(1j * swing * times)) ** 2))
    assert missed < most * spline_error(np.array(swing), gaps)
    assert missed > 0.3 * spline_error(np.array(swing), gaps)
