"""The loop's facet kernel against the kernel of the static scene."""

import numpy as np
import pytest

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.scene.materials import material
from rfgen_sionna.tracing.integral.facet import Nodes, facet_gains
from rfgen_sionna.tracing.integral.fresnel import media_table
from rfgen_sionna.tracing.integral.leg_fields import LegTables
from rfgen_sionna.tracing.integral.obliquity import Media
from rfgen_sionna.tracing.integral.patch_gains import patch_gains

MATERIALS = [material("metal"), material("skin"), material("concrete")]
FREQUENCIES = np.array([77e9, 79e9])
NO_CUTS = np.zeros((0, 2, 3, 3)), np.zeros(0, np.int32)


def gains(corners, kinds, tx, rx, fields, bistatic, cut_of=None, cuts=NO_CUTS, visible=None, turn=0.05):
    """(node, facet) gains of flat facets."""
    count = len(corners)
    nodes = np.hstack([tx, rx, 2 * np.pi / SPEED_OF_LIGHT * FREQUENCIES[:, None]])
    found, centroids = np.empty((2, count), np.complex128), np.empty((count, 3))
    patch_gains(
        corners.reshape(-1, 3), np.arange(3 * count, dtype=np.int32).reshape(-1, 3), np.full((count, 3), -1, np.int32),
        np.zeros((1, 3)), np.arange(count, dtype=np.int32), np.zeros((0, 3, 3)), np.arange(count),
        np.ones(count) if visible is None else visible, np.full(count, -1, np.int32) if cut_of is None else cut_of,
        *cuts, kinds, np.zeros(count, np.bool_), nodes, fields, media_table(Media.at(MATERIALS, FREQUENCIES)), bistatic,
        0.1, turn, np.zeros((0, 3)), LegTables.direct(), found, centroids,
    )  # fmt: skip
    return found


def facets(size, count=200, seed=0):
    rng = np.random.default_rng(seed)
    centres = np.array([3.0, 0, 0]) + rng.uniform(-1, 1, (count, 3))
    return centres[:, None] + size * rng.standard_normal((count, 3, 3)), rng.integers(0, 3, count).astype(np.int32)


@pytest.mark.parametrize(("size", "most"), [(0.01, 3e-3), (0.05, 1.5e-2)])
@pytest.mark.parametrize("baseline", [0.002, 0.5])
def test_flat_facets_are_those_of_the_reference(size, most, baseline):
    """Metal and dielectrics, equal and crossed polarisations, elements together and apart."""
    corners, kinds = facets(size)
    tx = np.array([[0, baseline, 0.0]] * 2)
    fields = np.array([[0, 0, 1.0], np.array([0, 1, 1]) / np.sqrt(2)])
    parts = np.full(len(corners), 4, np.int32)
    known = facet_gains(corners, kinds, Media.at(MATERIALS, FREQUENCIES), Nodes(tx, -tx, FREQUENCIES), *fields, parts)
    found = gains(corners, kinds, tx, -tx, fields, True)
    assert np.linalg.norm(found - known.a) < most * np.linalg.norm(known.a)


def test_pieces_add_up_to_the_facet():
    """A facet cut in two along a line: both parts return what the whole does."""
    corners, kinds = facets(0.02, seed=4)
    tx, fields = np.array([[0, 0.01, 0.0]] * 2), np.array([[0, 0, 1.0]] * 2)
    whole = gains(corners, kinds, tx, -tx, fields, False)
    low = np.array([[1, 0, 0], [0.6, 0.4, 0], [0.7, 0, 0.3]])
    rest = np.array([[[0, 1, 0], [0, 0, 1], [0.6, 0.4, 0]], [[0, 0, 1], [0.7, 0, 0.3], [0.6, 0.4, 0]]], float)
    cuts = np.stack([np.stack([low, np.zeros((3, 3))]), rest]), np.array([1, 2], np.int32)
    parts = [gains(corners, kinds, tx, -tx, fields, False, np.full(len(corners), k, np.int32), cuts) for k in (0, 1)]
    assert np.linalg.norm(parts[0] + parts[1] - whole) < 3e-3 * np.linalg.norm(whole)


def test_the_visible_fraction_is_a_factor():
    corners, kinds = facets(0.02, seed=5)
    tx, fields = np.array([[0, 0.01, 0.0]] * 2), np.array([[0, 0, 1.0]] * 2)
    share = np.random.default_rng(0).uniform(0, 1, len(corners))
    found, whole = (gains(corners, kinds, tx, -tx, fields, False, visible=each) for each in (share, None))
    assert np.allclose(found, share * whole, rtol=1e-12, atol=0)


def test_both_ways_return_the_same():
    """Reciprocity, with elements half a metre apart."""
    corners, kinds = facets(0.02, seed=6)
    tx, fields = np.array([[0, 0.25, 0.1]] * 2), np.array([[0, 0, 1.0], [0, 0.6, 0.8]])
    there = gains(corners, kinds, tx, -tx, fields, True)
    back = gains(corners, kinds, -tx, tx, fields[::-1].copy(), True)
    assert np.abs(there - back).max() < 1e-6 * np.abs(there).max()
