"""Facets that are integrated apart come back in their order."""

import numpy as np
import pytest

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
