"""How gains change over the band: polynomials through a few frequencies."""

from __future__ import annotations

import math

import numpy as np

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray

MAX_NODES = 9


def band_nodes(spread: float, half_band: float, rtol: float) -> FloatArray:
    """Chebyshev's places -1 … 1 in the band, enough for footprints over which paths differ by `spread` [m].

    Their gains are means of exp(-j x u) with |x| up to half the spread's phase over half the band; interpolation at n
    places errs by less than |x|^n / (n! 2^(n - 1)).
    """
    x = 2 * np.pi * half_band * 0.5 * spread / SPEED_OF_LIGHT
    count = 1
    while count < MAX_NODES and x**count / math.factorial(count) / 2 ** (count - 1) > rtol:
        count += 1
    return np.asarray(np.cos(np.pi * (2 * np.arange(count) + 1) / (2 * count)) + 0.0)


def fit_over_band(u: FloatArray, values: ComplexArray) -> ComplexArray:
    """(order, ...) coefficients of the powers of u, from `values` (place, ...) at places `u`."""
    matrix = np.linalg.inv(np.vander(u, increasing=True))
    return np.asarray(np.tensordot(matrix, values, axes=(1, 0)))
