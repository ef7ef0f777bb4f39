"""Chirps made periodic, so that a Fourier transform sorts their beat frequencies without leakage.

The gap between the end of a chirp and its next beginning is filled by autoregressive interpolation (Janssen, Veldhuis
and Vries, IEEE Trans. ASSP 34, 1986): of all fillings the one that the linear predictor of the frame's own signals
finds least surprising. The paths go on through the gap at their own beat frequencies while their phases come round.
"""

from __future__ import annotations

import numpy as np

from rfgen_sionna._types import ComplexArray

_FITTED_ROWS = 96
_RIDGE = 1e-9
"""Share of the signal's power that is added as white noise: bounds the predictor where there are few paths."""


def gap_length(count: int) -> int:
    """Samples of the gap for chirps of `count` samples, even; 0 where a chirp is too short to predict from."""
    return 0 if count < 16 else 2 * round(min(64, count // 4) / 2)


def fill_gap(samples: ComplexArray) -> ComplexArray:
    """(..., sample) with half the gap before and half of it behind each chirp; periodic."""
    count = samples.shape[-1]
    gap = gap_length(count)
    if gap == 0:
        return samples
    rows = samples.reshape(-1, count)
    predictor = _predictor(rows[:: max(1, len(rows) // _FITTED_ROWS)], gap // 2)
    order = len(predictor) - 1
    # Prediction errors that touch the gap, as a matrix on [order samples before, gap, order samples behind].
    errors = np.zeros((gap + order, gap + 2 * order), dtype=np.complex128)
    for row in range(gap + order):
        errors[row, row : row + order + 1] = predictor[::-1]
    inside, known = errors[:, order : order + gap], np.delete(errors, np.s_[order : order + gap], axis=1)
    filling = -np.linalg.lstsq(inside, known, rcond=None)[0]
    around = np.concatenate([rows[:, -order:], rows[:, :order]], axis=1)
    filled = around @ filling.T
    half = gap // 2
    extended = np.concatenate([filled[:, half:], rows, filled[:, :half]], axis=1)
    return extended.reshape(*samples.shape[:-1], count + gap)


def _predictor(rows: ComplexArray, order: int) -> ComplexArray:
    """(order + 1,) one and minus the weights of the past samples, from prediction forwards and backwards."""
    windows = np.lib.stride_tricks.sliding_window_view(rows, order + 1, axis=-1).reshape(-1, order + 1)
    matrix = windows.T.conj() @ windows
    matrix = matrix + matrix[::-1, ::-1].conj()  # backwards in time a path's frequency is that of its conjugate
    power = float(np.trace(matrix).real) / (order + 1)
    weights = np.zeros(order + 1, dtype=np.complex128)
    weights[0] = 1.0
    if power == 0.0:
        return weights
    past = matrix[:order, :order] + _RIDGE * power * np.eye(order)
    # Columns run from the oldest sample to the newest, the one that is predicted.
    weights[1:] = -np.linalg.solve(past, matrix[:order, order])[::-1]
    return weights
