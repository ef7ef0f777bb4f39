"""What pairs see of facets is put together, and told apart, facet by facet."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rfgen_sionna.tracing.moving.per_element_visibility import PerElementSampler
from rfgen_sionna.tracing.moving.visible_facets import PerElementVisibility
from rfgen_sionna.tracing.surface.surfaces import collect_surfaces


def drawn(seed, facets=7, pairs=3):
    """Visibility of some facets from some pairs, partly occluded ones in one to three pieces."""
    draw = np.random.default_rng(seed)
    facet, pair = np.nonzero(draw.uniform(size=(facets, pairs)) < 0.6)
    fraction = draw.choice([0.0, 0.3, 1.0], len(facet))
    owner = np.repeat(np.arange(len(facet)), np.where(fraction == 0.3, draw.integers(1, 4, len(facet)), 0))
    return PerElementVisibility(facet, pair, fraction, owner, draw.uniform(size=(len(owner), 3, 3)))


def told(views, names):
    """Visibility by facet name and pair."""
    return {
        (names[facet], pair): (views.fraction[lane], views.pieces[views.owner == lane].tolist())
        for lane, (facet, pair) in enumerate(zip(views.facet.tolist(), views.pair.tolist(), strict=True))
    }


@given(st.integers(0, 1000), st.sets(st.integers(0, 6)))
def test_selected_facets_keep_their_visibility(seed, chosen):
    views, chosen = drawn(seed), sorted(chosen)
    found = told(views.of(np.array(chosen, np.intp)), chosen)
    assert found == {key: each for key, each in told(views, range(7)).items() if key[0] in chosen}


@given(st.integers(0, 1000), st.integers(0, 1000))
def test_concatenation_keeps_each_part(one, other):
    views = drawn(one), drawn(other)
    joined = PerElementVisibility.joined(views, [0, 7])
    assert (np.diff(joined.owner) >= 0).all()
    for first, each in zip((0, 7), views, strict=True):
        assert told(joined.of(np.arange(first, first + 7)), range(7)) == told(each, range(7))


def test_shares_are_means_over_pairs():
    views = PerElementVisibility(
        np.array([0, 0, 2]), np.array([0, 1, 3]), np.array([1.0, 0.5, 0.0]), *PerElementVisibility.none()[3:]
    )
    shares = views.shares(np.array([0.0, 0.25, 1.0]), 4)
    np.testing.assert_allclose(shares, [1.5 / 4, 0.25, 3 / 4])


@pytest.mark.parametrize(("tx", "rx"), [(1, 2), (3, 4), (12, 16)])
def test_representative_pairs_are_the_outermost_ones(tx, rx):
    """All of a few pairs; of many at least those of the outermost elements."""
    y = np.linspace(-1.0, 1.0, tx)[:, None] * [0, 0.03, 0], np.linspace(-1.0, 1.0, rx)[:, None] * [0, 0.01, 0]
    representative = PerElementSampler(collect_surfaces(None, []), *y, np.zeros(3), 1.0, 0.01).representative()
    assert len(np.unique(representative)) == len(representative) == min(tx * rx, 12)
    for ends, count in ((representative // rx, tx), (representative % rx, rx)):
        assert {0, count - 1} <= set(ends.tolist())
