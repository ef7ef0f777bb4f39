"""Splits have the sizes of their shares, and nothing in common."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rfgen_sionna.recipes.partitions import assigned, derived_seed, partition, parts_of, stream

shares_of_sum_one = st.lists(st.integers(1, 50), min_size=1, max_size=6).map(
    lambda parts: {f"s{index}": part / sum(parts) for index, part in enumerate(parts)}
)


@given(st.integers(0, 500), shares_of_sum_one)
def test_parts_are_within_one_of_their_shares(total: int, shares: dict[str, float]) -> None:
    parts = parts_of(total, shares)
    assert sum(parts.values()) == total
    assert all(abs(parts[name] - share * total) < 1 + 1e-6 for name, share in shares.items())


@given(st.integers(6, 200), shares_of_sum_one, st.integers(0, 2**32))
def test_a_partition_has_every_number_once_and_no_empty_part(total: int, shares: dict[str, float], seed: int) -> None:
    parts = partition(total, shares, np.random.default_rng(seed))
    assert sorted(np.concatenate(list(parts.values())).tolist()) == list(range(total))
    assert all(len(part) for part in parts.values())


def test_too_small_a_pool_is_refused() -> None:
    with pytest.raises(ValueError, match="2 for 3 splits: at least 3 are needed"):
        partition(2, {"a": 0.5, "b": 0.3, "c": 0.2}, np.random.default_rng(0))


def test_recordings_are_numbered_within_their_split() -> None:
    split, rank = assigned(50, {"a": 0.6, "b": 0.4}, np.random.default_rng(0))
    for index, size in enumerate((30, 20)):
        assert rank[split == index].tolist() == list(range(size))


def test_streams_and_seeds_depend_on_each_key_alone() -> None:
    assert stream(0, 5, "a").integers(1 << 60) == stream(0, 5, "a").integers(1 << 60)
    found = {derived_seed(0, number, attempt, key) for number in range(50) for attempt in range(3) for key in "ab"}
    assert len(found) == 300
    assert max(found) < 2**53
