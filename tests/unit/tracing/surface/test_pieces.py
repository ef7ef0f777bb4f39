"""Pieces of facets by Dr.Jit against NumPy."""

import numpy as np
import pytest

from rfgen_sionna.tracing.surface.facets import _piece_keys
from rfgen_sionna.tracing.surface.quadratic_patch import QUARTERS, QuadraticPatch, split_facets


@pytest.mark.parametrize("displaced", [None, False, True])
@pytest.mark.parametrize("count", [0, 1, 300])
def test_pieces_lie_on_the_surface_of_their_facets(displaced, count):
    rng = np.random.default_rng(count)
    corners, owner = rng.normal(size=(7, 3, 3)), np.sort(rng.integers(0, 7, count))
    weights = rng.dirichlet(np.ones(3), (count, 3))
    patch = None
    if displaced is not None:
        patch = QuadraticPatch(
            0.1 * rng.normal(size=(7, 3, 3)), 0.1 * rng.normal(size=(7, 3, 3)) if displaced else None
        )
    found, bent, width = split_facets(corners, patch, owner, weights)
    np.testing.assert_allclose(found, weights @ corners[owner], atol=1e-14)
    longest = [
        np.linalg.norm(each - each[:, [1, 2, 0]], axis=2).max(axis=1, initial=0) for each in (found, corners[owner])
    ]
    np.testing.assert_allclose(width, longest[0] / longest[1], rtol=1e-12)
    assert (bent is None) == (patch is None)
    if patch is not None and bent is not None:
        slow = patch.take(owner).within(weights)
        np.testing.assert_allclose(bent.sagittas, slow.sagittas, atol=1e-15)
        np.testing.assert_allclose(bent.corner_offsets, slow.corner_offsets, atol=1e-15)


def test_quarters_have_half_the_width_and_the_whole_area():
    corners = np.random.default_rng(1).normal(size=(1, 3, 3))
    found, _, width = split_facets(corners, None, np.zeros(4, np.intp), QUARTERS)
    np.testing.assert_allclose(width, 0.5, rtol=1e-12)
    sides = np.cross(found[:, 1] - found[:, 0], found[:, 2] - found[:, 0])
    whole = np.cross(corners[0, 1] - corners[0, 0], corners[0, 2] - corners[0, 0])
    np.testing.assert_allclose(sides.sum(axis=0), whole, atol=1e-12)


def test_pieces_have_different_numbers():
    """2,000 facets of one face, 64 pieces each: numbers differ, and their bits are balanced."""
    weights = np.eye(3)[None]
    for _ in range(3):
        weights = np.einsum("qcv,pvw->pqcw", QUARTERS, weights).reshape(-1, 3, 3)
    place = _piece_keys(np.repeat(np.arange(2000, dtype=np.int32), 64), np.tile(weights, (2000, 1, 1)))
    assert len(place) == 128_000
    assert len(np.unique(place)) > 128_000 - 10  # of 2^32 numbers 2 fall together
    bits = (place.view(np.uint32)[:, None] >> np.arange(32, dtype=np.uint32)) & 1
    assert np.abs(bits.mean(axis=0) - 0.5).max() < 0.01
