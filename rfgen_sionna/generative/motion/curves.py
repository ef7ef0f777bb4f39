"""Smooth curves (C² in time) for synthesised motion."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import BPoly

from rfgen_sionna._types import FloatArray


def ease(s: FloatArray) -> FloatArray:
    """0 to 1 with zero first and second derivative at both ends; constant outside.

    Minimum-jerk profile of human reaching (Flash and Hogan 1985).
    """
    s = np.clip(s, 0.0, 1.0)
    return s**3 * (10.0 + s * (6.0 * s - 15.0))


def cruise(s: FloatArray, ramp: float = 0.35) -> FloatArray:
    """0 to 1 like :func:`ease`, but at constant speed between two ramps of length `ramp` (at most 0.5)."""
    s = np.clip(s, 0.0, 1.0)

    def half(x: FloatArray) -> FloatArray:
        r = np.minimum(x / ramp, 1.0)
        return (ramp * r**4 * (2.5 + r * (r - 3.0)) + np.maximum(x - ramp, 0.0)) / (1.0 - ramp)

    return np.where(s <= 0.5, half(s), 1.0 - half(1.0 - s))


def bump(s: FloatArray) -> FloatArray:
    """0 to 1 and back over s in [0, 1], C² at both ends."""
    s = np.clip(s, 0.0, 1.0)
    return 64.0 * (s * (1.0 - s)) ** 3


def keys(t: FloatArray, times: Sequence[float], values: ArrayLike) -> FloatArray:
    """Minimum-jerk moves between key values, at rest in each.

    Args:
        t: (n,) times [s].
        times: (k,) ascending times of the keys [s].
        values: (k,) or (k, d) key values.

    Returns:
        (n,) or (n, d) values at `t`; constant before the first and after the last key.
    """
    v = np.asarray(values, np.float64)
    knots = np.asarray(times, np.float64)
    i = np.clip(np.searchsorted(knots, t, side="right") - 1, 0, len(knots) - 2)
    s = ease((t - knots[i]) / (knots[i + 1] - knots[i]))
    if v.ndim > 1:
        s = s.reshape(-1, *([1] * (v.ndim - 1)))
    return v[i] + (v[i + 1] - v[i]) * s


def hermite(t: FloatArray, times: Sequence[float], states: Sequence[Sequence[float]]) -> FloatArray:
    """(n,) quintic pieces through (value, first, second derivative) at each of `times` [s]; `t` is clipped to their
    range."""
    curve = BPoly.from_derivatives(np.asarray(times, float), [list(s) for s in states])
    return curve(np.clip(t, times[0], times[-1]))


def wander(t: FloatArray, rng: np.random.Generator, rms: float, low: float = 0.1, high: float = 0.7) -> FloatArray:
    """(n,) slow irregular drift of the given rms: eight sinusoids between `low` and `high` [Hz], amplitude ∝ 1/f."""
    f = np.geomspace(low, high, 8) * rng.uniform(0.85, 1.15, 8)
    a = 1.0 / f
    a *= rms * np.sqrt(2.0 / np.sum(a**2))
    phase = rng.uniform(0.0, 2.0 * np.pi, 8)
    return np.sin(2.0 * np.pi * np.outer(t, f) + phase) @ a
