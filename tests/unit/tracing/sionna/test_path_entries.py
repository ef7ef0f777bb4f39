"""Matching of paths between element pairs."""

import numpy as np

from rfgen_sionna.tracing.sionna.path_entries import match_paths


def test_paths_match_by_interactions_and_points():
    # Pair 0 has paths A and B off one surface, pair 1 has them in the other order and C off another surface.
    pair = np.array([0, 0, 1, 1, 1])
    signature = np.array([[1, 7], [1, 7], [1, 7], [1, 7], [1, 8]])
    vertices = np.array([[0.0, 0, 0], [1.0, 0, 0], [1.01, 0, 0], [0.01, 0, 0], [0.0, 0, 0]])[:, None]
    number, first = match_paths(pair, signature, vertices, reach=0.1)
    assert number.tolist() == [0, 1, 1, 0, 2]
    assert first.tolist() == [0, 1, 4]


def test_in_one_element_pair_no_two_paths_are_the_same():
    """The nearer of two matches; a point out of reach belongs to a new path."""
    pair = np.array([1, 0, 0, 2])
    vertices = np.array([[0.0, 0, 0], [0.02, 0, 0], [0.01, 0, 0], [0.2, 0, 0]])[:, None]
    number, first = match_paths(pair, np.ones((4, 1), np.int64), vertices, reach=0.1)
    assert number[0] == number[2] != number[1]
    assert number.tolist() == [0, 1, 0, 2]
    assert first.tolist() == [0, 1, 3]


def test_paths_number_in_the_order_of_their_first_entries():
    rng = np.random.default_rng(3)
    places = rng.uniform(-5, 5, (40, 2, 3))
    pair = np.repeat(np.arange(6), 40)
    order = rng.permutation(240)
    vertices = np.tile(places, (6, 1, 1)) + rng.uniform(-1e-3, 1e-3, (240, 2, 3))
    number, first = match_paths(pair[order], np.ones((240, 3), np.int64), vertices[order], reach=0.01)
    truth = np.tile(np.arange(40), 6)[order]
    assert len(first) == 40
    assert len(np.unique(np.stack([number, truth]), axis=1).T) == 40
    assert (np.diff(first) > 0).all()
    assert number[first].tolist() == list(range(40))


def test_nothing_is_no_path():
    number, first = match_paths(np.zeros(0, int), np.zeros((0, 3), int), np.zeros((0, 1, 3)), 0.1)
    assert len(number) == len(first) == 0
