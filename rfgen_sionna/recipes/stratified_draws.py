"""Random numbers that cover [0, 1) evenly over the recordings of a split (Latin hypercube).

Each key has its own order of the recordings and one number of each of n equal intervals (McKay, Beckman and Conover,
Technometrics 21, 1979). A number of one recording is found without those of the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.recipes.partitions import stream

BELOW_ONE = float(np.nextafter(1.0, 0.0))
"""Largest number drawn."""


@dataclass(frozen=True)
class StratifiedDraws:
    """Numbers in [0, 1) of one recording, or of one body of a pool, by key."""

    seed: int
    """Seed of the recipe."""
    number: int
    """Number of the recording."""
    attempt: int
    """Attempts after the first (0) draw independently of other recordings."""
    group: str
    """Name of the split; each has orders of its own."""
    rank: int
    """Number of the recording within the split."""
    size: int
    """Number of recordings of the split."""

    def even(self, key: str) -> float:
        """For choices: those of a split have equal steps, so that every interval has its share to within one."""
        if self.attempt:
            return self.loose(key)
        order, start = _order(self.seed, key, self.group, self.size)
        return min((int(order[self.rank]) + start) / self.size, BELOW_ONE)

    def loose(self, key: str) -> float:
        """For ranges: anywhere in the recording's own interval."""
        own = float(stream(self.seed, self.number, self.attempt, key).random())
        if self.attempt:
            return own
        order, _ = _order(self.seed, key, self.group, self.size)
        return min((int(order[self.rank]) + own) / self.size, BELOW_ONE)


def chosen(number: float, chances: Sequence[float]) -> tuple[int, float]:
    """Index whose interval of the chances' sums has the number, and where in the interval it is, in [0, 1)."""
    sums = np.cumsum(chances) / np.sum(chances)
    index = int(np.searchsorted(sums, number, side="right"))
    low = float(sums[index - 1]) if index else 0.0
    return index, min((number - low) / (float(sums[index]) - low), BELOW_ONE)


@lru_cache(maxsize=512)
def _order(seed: int, key: str, group: str, size: int) -> tuple[NDArray[np.int32], float]:
    """Interval of each recording of a split, and where in their intervals even numbers are."""
    rng = stream(seed, "order", key, group)
    return rng.permutation(np.arange(size, dtype=np.int32)), float(rng.random())
