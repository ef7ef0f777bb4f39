"""Error of curves through the knots, from the prediction of each knot by the others."""

from __future__ import annotations

import numpy as np

from rfgen_sionna._types import ComplexArray, FloatArray, IntArray

NEIGHBOURS = 4
"""Number of knots that predict one between them."""


def leave_one_out(count: int) -> FloatArray:
    """(inner, count) weights of the values at `count` evenly spaced knots: each inner one less the polynomial through
    its nearest neighbours."""
    weights = np.zeros((max(count - 2, 0), count))
    for k, row in enumerate(weights, 1):
        first = min(max(k - NEIGHBOURS // 2, 0), max(count - NEIGHBOURS - 1, 0))
        others = [m for m in range(first, min(first + NEIGHBOURS + 1, count)) if m != k]
        for m in others:
            row[m] = -np.prod([(k - other) / (m - other) for other in others if other != m])
        row[k] = 1.0
    return weights


def prediction_error(
    gains: ComplexArray, delays: FloatArray, frequency: float, group: IntArray, count: int
) -> tuple[FloatArray, FloatArray]:
    """(group,) error of the return of each of `count` groups at the inner knots if they were left out, and the return
    itself [root mean squares over time]. `gains` (path, knot) are those at the `frequency` [Hz] with antennas, `delays`
    (path, knot) [s], `group` (path,)."""
    weights = leave_one_out(gains.shape[1])
    waves = gains * _phasors(frequency * delays)
    off = delays @ weights.T  # true less predicted
    inner = waves[:, 1:-1]
    # Predicted gains on predicted delays.
    predicted = (gains[:, 1:-1] - gains @ weights.T) * _phasors(frequency * (delays[:, 1:-1] - off))
    missed = _sums(inner - predicted, group, count)
    return _rms(missed), _rms(_sums(waves, group, count))


def mean_level(gains: ComplexArray, delays: FloatArray, frequency: float, group: IntArray, count: int) -> FloatArray:
    """(group,) coherent return of each group [root mean square over time], for the arguments of
    :func:`prediction_error`."""
    return _rms(_sums(gains * _phasors(frequency * delays), group, count))


def _phasors(cycles: FloatArray) -> ComplexArray:
    return np.asarray(np.exp(-2j * np.pi * (cycles - np.rint(cycles))))


def _sums(values: ComplexArray, group: IntArray, count: int) -> ComplexArray:
    """(group, time) sums of `values` (path, time) by `group` (path,)."""
    found = np.zeros((count, values.shape[1]), np.complex128)
    for column, each in enumerate(values.T):
        found[:, column] = np.bincount(group, each.real, count) + 1j * np.bincount(group, each.imag, count)
    return found


def _rms(values: ComplexArray) -> FloatArray:
    """(group,) root mean squares of `values` (group, time); 0 without any time."""
    if not values.shape[1]:
        return np.zeros(len(values))
    return np.asarray(np.sqrt((values.real**2 + values.imag**2).mean(axis=1)))


def share_of(error: FloatArray, level: FloatArray) -> FloatArray:
    """(group,) `error` relative to the `level`; 0 without a return."""
    return np.asarray(error / np.where(level > 0, level, np.inf))
