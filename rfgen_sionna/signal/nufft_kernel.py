"""Least-squares interpolation kernels of nonuniform Fourier transforms.

A point at X on a grid of G = 2 N cells becomes `w` values (taps) on the cells around it, so that after a transform and
a division by a fixed weight each of the N middle modes k has the phase exp(j 2 pi k X / G), times T(u) for any smooth T
of u = k / (N / 2) in -1 … 1. The taps are polynomials in the position of the point between two cells, from least
squares over the modes (J. Fessler and B. Sutton, IEEE Trans. SP-51 (2003), 560).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from rfgen_sionna._types import ComplexArray, FloatArray

WIDTHS = tuple(range(2, 15))  # cells; 14 err by 1e-13
_FREQUENCIES, _POSITIONS = 80, 28  # Chebyshev points of the fits, more than their coefficients (at most 15)
_MAX_POWER = 40  # of the quadratic phase; bounds the number of terms for very fast targets
NEGLIGIBLE = 0.1
"""Share of the tolerance below which a coefficient of the gain is left out."""
Term = tuple[int, int]
"""(m, n): T(u) = u^m T_2(u)^n, with the Chebyshev polynomial T_2(u) = 2 u^2 - 1."""


@dataclass(frozen=True)
class InterpolationKernel:
    """Taps of one term."""

    coefficients: FloatArray
    """(tap, degree + 1) polynomials in v = 2 (position of the first tap after X - w/2) - 1, lowest degree first."""
    odd: bool
    """Whether the taps are imaginary, to be multiplied by j: those of odd terms."""
    error: float
    """Root mean square error over modes and positions."""


@lru_cache(maxsize=64)
def deconvolution(width: int, count: int) -> FloatArray:
    """(count,) factors of the modes -count // 2 … after the transform of a grid of 2 `count` cells."""
    modes = np.arange(count) - count // 2
    return 1.0 / _window_transform(width, np.pi * modes / count)


def value(term: Term, u: FloatArray) -> FloatArray:
    """T(u)"""
    return np.asarray(u ** term[0] * (2 * u * u - 1) ** term[1])


def _window_transform(width: int, omega: FloatArray) -> FloatArray:
    """Fourier transform of the window exp(b (sqrt(1 - x^2) - 1)) at `omega` [rad per cell], the weight of the modes."""
    x, weight = _quadrature()
    window = weight * np.exp(2.3 * width * (np.sqrt(1 - x * x) - 1))
    return np.asarray(np.cos(np.multiply.outer(omega * width / 2, x)) @ window * (width / 2))


@lru_cache(maxsize=1)
def _quadrature() -> tuple[FloatArray, FloatArray]:
    return np.polynomial.legendre.leggauss(200)


@lru_cache(maxsize=256)
def interpolation_kernel(width: int, term: Term) -> InterpolationKernel:
    """Taps of `width` cells for one term."""
    omega = np.cos(np.pi * (np.arange(_FREQUENCIES) + 0.5) / _FREQUENCIES) * (np.pi / 2)
    wanted = value(term, omega / (np.pi / 2))
    odd = bool(term[0] % 2)

    def system(place: float) -> ComplexArray:
        phase = np.exp(1j * np.multiply.outer(omega, np.arange(width) + place - width / 2))
        return np.asarray(phase / _window_transform(width, omega)[:, None] * (1j if odd else 1))

    positions = 0.5 - 0.5 * np.cos(np.pi * (np.arange(_POSITIONS) + 0.5) / _POSITIONS)
    rows = []
    for place in positions:
        matrix = system(float(place))
        stacked = np.concatenate([matrix.real, matrix.imag])
        rows.append(np.linalg.lstsq(stacked, np.concatenate([wanted, 0 * wanted]), rcond=None)[0])
    fitted = np.stack(rows)
    degree = width  # a higher degree lowers no error
    coefficients = np.stack(
        [np.polynomial.polynomial.polyfit(2 * positions - 1, fitted[:, tap], degree) for tap in range(width)]
    )
    errors = []
    for place in np.linspace(0.01, 0.99, 15):
        at = np.polynomial.polynomial.polyval(2 * place - 1, coefficients.T)
        errors.append(np.mean(np.abs(system(float(place)) @ at - wanted) ** 2))
    return InterpolationKernel(coefficients, odd, float(np.sqrt(np.mean(errors))))


def width_for(weights: dict[Term, float], eps: float) -> int:
    """Least width for which the errors of the terms, times their relative sizes, sum to at most `eps`."""
    for width in WIDTHS[:-1]:
        if sum(weight * interpolation_kernel(width, term).error for term, weight in weights.items()) <= eps:
            return width
    return WIDTHS[-1]


def needed_terms(angle: float, sizes: FloatArray, eps: float) -> dict[Term, float]:
    """Relative sizes of the significant terms (order of the gain, power of the quadratic phase).

    The remainder of exp(j angle T) after n powers is angle^(n+1) / (n+1)!; `sizes` are those of the gain's
    coefficients.
    """
    terms: dict[Term, float] = {}
    for order, size in enumerate(sizes):
        left = float(size) / max(float(sizes[0]), 1e-300) if order else 1.0
        if left <= NEGLIGIBLE * eps:
            continue
        power = 0
        terms[order, 0] = left
        left *= angle
        while left > 0.3 * eps and power < _MAX_POWER:
            power += 1
            terms[order, power] = left
            left *= angle / (power + 1)
    return terms
