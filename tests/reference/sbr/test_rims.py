"""Where elements see a rim fall on what it hides, and what may be missed there."""

import numpy as np
import pytest

from tests.reference.sbr.parallax import Strips, doubts, shifts
from tests.reference.sbr.rims import Rims

FRONT, BACK, HIGH = 1.0, 3.0, 0.1


def upright():
    """An upright edge at `FRONT` before a plane at `BACK`, seen to its left."""
    ends = np.array([[[1.0, 0.0, -HIGH], [1.0, 0.0, HIGH]]]) / np.hypot(1.0, HIGH)
    far = np.hypot(1.0, HIGH) * np.ones((1, 2))
    rows = np.zeros((1, 2), np.intp)
    return Rims(ends, FRONT * far, BACK * far, rows[:, 0], rows, np.array([[0.0, 1.0, 0.0]]))


def test_an_element_sees_a_rim_fall_where_rays_by_way_of_it_do():
    """By similar triangles, times the cosine of the ends' elevation; along the rim and at the source nothing moves; an
    element beside or beyond what hides sees no shadow of it."""
    aside = np.array([0.0, 0.01, -0.02])
    elements = np.stack([np.zeros(3), aside, np.zeros(3)], axis=1)
    normal = np.tile([-1.0, 0.0, 0.0], (1, 2, 1))
    found = shifts(upright(), normal, elements)[0]
    wanted = -aside * (BACK / FRONT - 1.0) / (BACK * np.hypot(1.0, HIGH))
    np.testing.assert_allclose(found, np.tile(wanted, (2, 1)), atol=1e-12)
    ahead = np.array([[0.0, 0.0, 0.05], [FRONT, 0.01, 0.0], [2.0, 0.01, 0.0]])
    np.testing.assert_allclose(shifts(upright(), normal, ahead)[0, :, [0, 2]], 0.0, atol=1e-12)
    assert np.isfinite(shifts(upright(), normal, ahead)).all()


def test_rims_are_joined_and_taken_row_by_row():
    two = Rims.joined([upright(), Rims.none(), upright()])
    assert (len(Rims.none()), len(two), len(two.take(np.array([True, False])))) == (0, 2, 1)


def test_what_may_be_missed_is_that_of_the_worst_pair():
    """Two rims on the first group, which add up for one pair and of which another sees neither; none on the second."""
    more = np.array([[[1, 1, 0], [0, 0, 0]]], np.int8)
    found = Strips(np.zeros((3, 6), np.intp), np.array([0, 1, 1]), more)
    told = doubts(found, np.array([1.0, 1.0, 5.0], complex), np.zeros(3, np.intp), 2)
    assert told == pytest.approx([np.sqrt(0.05**2 * 4 + 0.2**2 * 2), 0.0])
    nothing = Strips(np.zeros((0, 6), np.intp), np.zeros(0, np.intp), np.zeros((1, 2, 0), np.int8))
    assert (doubts(nothing, np.zeros(0, complex), np.zeros(0, np.intp), 2) == 0).all()
