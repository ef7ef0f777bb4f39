"""Facets that are integrated apart come back in their order."""

import numpy as np
import pytest

from rfgen_sionna.radar import Radar
from rfgen_sionna.records import SPEED_OF_LIGHT
from rfgen_sionna.tracing import gains
from rfgen_sionna.tracing.facet import FacetGains


@pytest.mark.parametrize("runs", [1, 2, 7, 400])
@pytest.mark.parametrize("most", [0, 10_000])
def test_flat_and_curved_facets_come_back_in_their_order(runs: int, most: int, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(gains, "_RUNS", most)
    rng = np.random.default_rng(runs)
    curved = np.repeat(np.arange(runs) % 2 == 1, rng.integers(1, 9, runs))
    asked = []

    def of(index, bent):
        asked.append(bent)
        number = np.arange(len(curved))[index]
        terms = number + 1j * np.arange(6).reshape(3, 2, 1)
        return FacetGains(terms, 0.5 * number + np.arange(2)[:, None])

    found = gains.by_curvature(curved, of)
    assert asked == ([False] if runs == 1 else [False, True])
    whole = of(slice(None), False)
    assert np.array_equal(found.terms, whole.terms)
    assert np.array_equal(found.tau, whole.tau)


def test_rates_are_those_of_delays():
    """Of points that move as straight as may be, against delays just before and after."""
    radar = Radar.load("awr1843", "mmmesh", position=(0.3, -0.2, 1), look_at=(3, 0, 1))
    band, rng = gains.BandTracer(radar, 1e-2), np.random.default_rng(0)
    places, velocities = rng.uniform(-1, 1, (40, 3)) + np.array([3, 0, 1]), rng.uniform(-5, 5, (40, 3))
    step = 1e-5
    before, after = (band.delays(places + sign * step * velocities) for sign in (-1, 1))
    found = band.rates(places, velocities)
    assert found.shape == (3, 4, 40)
    np.testing.assert_allclose(found, (after - before) / (2 * step), rtol=0, atol=1e-5 / SPEED_OF_LIGHT)
    assert np.abs(found).max() > 1.0 / SPEED_OF_LIGHT
