"""Operations on series that are sampled at the rate of the signals of a motion."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray

RATE = 20.0
"""Samples per second of all signals [Hz]."""
Flags = NDArray[np.bool_]


def rate_of(values: FloatArray) -> FloatArray:
    """(sample, ...) derivative of samples at `RATE` [1/s]."""
    return np.gradient(values, axis=0) * RATE


def smooth(values: FloatArray, seconds: float) -> FloatArray:
    """(sample, ...) moving average over `seconds`, of what there is at the ends."""
    half = round(0.5 * seconds * RATE)
    total = np.concatenate([np.zeros_like(values[:1]), np.cumsum(values, axis=0)])
    here = np.arange(len(values))
    low, high = np.maximum(here - half, 0), np.minimum(here + half + 1, len(values))
    averaged: FloatArray = (total[high] - total[low]) / (high - low).reshape(-1, *(1,) * (values.ndim - 1))
    return averaged


def stretches(flags: Flags) -> list[tuple[int, int]]:
    """First sample and end of each run of true flags."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], np.asarray(flags, np.int8), [0]])))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def longest(flags: Flags) -> float:
    """Length of the longest run of true flags [s]."""
    return max((b - a for a, b in stretches(flags)), default=0) / RATE


def share(flags: Flags) -> float:
    """Share of true flags."""
    return float(np.mean(flags)) if len(flags) else 0.0


def swings(values: FloatArray, size: float) -> int:
    """Number of moves of a signal from one turning point to the next that are at least `size` large."""
    return max(len(turning_points(values, size)) - 1, 0)


def turning_points(values: FloatArray, size: float) -> list[int]:
    """Samples where a signal turns, between moves of at least `size`; the first and the last one are ends."""
    points, low, high, rising = [], 0, 0, 0
    for k, value in enumerate(values):
        low = k if value < values[low] else low
        high = k if value > values[high] else high
        if rising >= 0 and values[high] - value >= size:
            points.append(high)
            rising, low = -1, k
        elif rising <= 0 and value - values[low] >= size:
            points.append(low)
            rising, high = 1, k
        if rising > 0 and value >= values[high]:
            high = k
        if rising < 0 and value <= values[low]:
            low = k
    if rising:
        points.append(high if rising > 0 else low)
    return points


def period(values: FloatArray, shortest: float = 0.3, longest_one: float = 4.0) -> tuple[float, float]:
    """Period of a repeated movement (sample, ...) [s] and the autocorrelation at it, 0 for none."""
    flat = values.reshape(len(values), -1)
    flat = flat - flat.mean(axis=0)
    best = (0.0, 0.0)
    for lag in range(int(shortest * RATE), min(int(longest_one * RATE), int(0.6 * len(flat)))):
        a, b = flat[lag:], flat[:-lag]
        match = float(np.sum(a * b) / max(np.sqrt(np.sum(a * a) * np.sum(b * b)), 1e-12))
        if match > best[1] + 0.02:
            best = lag / RATE, match
    return best
