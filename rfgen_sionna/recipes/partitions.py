"""Splits of a set: how many recordings each has, and which part of a pool is its own."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

WHOLE_SET = "all"
"""Name of the only split of a recipe without splits."""


def stream(*keys: int | str) -> np.random.Generator:
    """Random numbers of their own for each combination of keys, independent of the order in which they are drawn."""
    return np.random.default_rng([zlib.crc32(key.encode()) if isinstance(key, str) else key for key in keys])


def derived_seed(*keys: int | str) -> int:
    """A seed below 2^53 for each combination of keys."""
    words = [zlib.crc32(key.encode()) if isinstance(key, str) else key for key in keys]
    return int(np.random.SeedSequence(words).generate_state(1, np.uint64)[0] >> np.uint64(11))


def parts_of(total: int, shares: Mapping[str, float], least: int = 0) -> dict[str, int]:
    """Whole numbers of sum `total`, by shares of sum 1 and largest remainders, at least `least` each.

    Raises:
        ValueError: the total is too small.
    """
    if total < least * len(shares):
        raise ValueError(f"{total} for {len(shares)} splits: at least {least * len(shares)} are needed")
    rest = total - least * len(shares)
    exact = {name: max(share * total - least, 0.0) for name, share in shares.items()}
    scale = rest / (sum(exact.values()) or 1.0)
    found = {name: int(value * scale + 1e-9) for name, value in exact.items()}
    by_remainder = sorted(shares, key=lambda name: found[name] - exact[name] * scale)
    for name in by_remainder[: rest - sum(found.values())]:
        found[name] += 1
    return {name: least + value for name, value in found.items()}


def partition(total: int, shares: Mapping[str, float], rng: np.random.Generator) -> dict[str, NDArray[np.int64]]:
    """The numbers 0 to `total` - 1 in parts by shares, one at least for each, no number in two.

    Raises:
        ValueError: there are fewer numbers than parts.
    """
    sizes = parts_of(total, shares, least=1)
    edges = np.cumsum([0, *sizes.values()])
    order = rng.permutation(total)
    return {name: np.sort(order[a:b]) for name, a, b in zip(sizes, edges[:-1], edges[1:], strict=True)}


def assigned(total: int, shares: Mapping[str, float], rng: np.random.Generator) -> tuple[NDArray[Any], NDArray[Any]]:
    """Split of each of `total` recordings, as an index, and the number of the recording within its split."""
    sizes = parts_of(total, shares)
    split = rng.permutation(np.repeat(np.arange(len(sizes)), list(sizes.values())))
    rank = np.zeros(total, np.int64)
    for index, size in enumerate(sizes.values()):
        rank[split == index] = np.arange(size)
    return split, rank
