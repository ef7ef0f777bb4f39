"""Interpolation taps for nonuniform Fourier transforms, the best ones of a given width.

A point at X on a grid of G = 2 N cells becomes `w` values on the cells around it, so that after a transform and a
division by a fixed weight each of the N middle modes k has the phase exp(j 2 pi k X / G). Taps need not stand for the
phase alone: for any smooth T(u) with u = k / (N / 2) in -1 … 1 there are taps that make it T(u) times the phase. Here
they come from least squares over the modes (J. Fessler and B. Sutton, IEEE Trans. SP-51 (2003), 560) as polynomials in
the place of the point between two cells.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from rfgen_sionna._types import ComplexArray, FloatArray

WIDTHS = tuple(range(2, 15))
_FREQUENCIES, _PLACES = 80, 28
_MOST_POWERS = 40
NEGLIGIBLE = 0.1
"""Share of the tolerance that a coefficient of the gain may be left out at."""
Term = tuple[int, int]
"""(m, n): T(u) = u^m T_2(u)^n, with the Chebyshev polynomial T_2(u) = 2 u^2 - 1."""


@dataclass(frozen=True)
class InterpolationKernel:
    """InterpolationKernel of one term."""

    coefficients: FloatArray
    """(tap, degree + 1) polynomials in v = 2 (place of the first tap after X - w/2) - 1, lowest degree first."""
    odd: bool
    """Whether the taps are to be multiplied by j: those of odd terms are imaginary."""
    error: float
    """Root mean square error over modes and places."""


@lru_cache(maxsize=64)
def deconvolution(width: int, count: int) -> FloatArray:
    """(count,) factors of the modes -count // 2 … after the transform of a grid of 2 count cells."""
    modes = np.arange(count) - count // 2
    return 1.0 / _window_transform(width, np.pi * modes / count)


def value(term: Term, u: FloatArray) -> FloatArray:
    """T(u)"""
    return np.asarray(u ** term[0] * (2 * u * u - 1) ** term[1])


def _window_transform(width: int, omega: FloatArray) -> FloatArray:
    """Fourier transform of the window exp(b (sqrt(1 - x^2) - 1)) at `omega` [rad per cell]; sets what modes weigh."""
    x, weight = _quadrature()
    window = weight * np.exp(2.3 * width * (np.sqrt(1 - x * x) - 1))
    return np.asarray(np.cos(np.multiply.outer(omega * width / 2, x)) @ window * (width / 2))


@lru_cache(maxsize=1)
def _quadrature() -> tuple[FloatArray, FloatArray]:
    return np.polynomial.legendre.leggauss(200)


@lru_cache(maxsize=256)
def interpolation_kernel(width: int, term: Term) -> InterpolationKernel:
    """The taps of `width` cells for one term."""
    omega = np.cos(np.pi * (np.arange(_FREQUENCIES) + 0.5) / _FREQUENCIES) * (np.pi / 2)
    wanted = value(term, omega / (np.pi / 2))
    odd = bool(term[0] % 2)

    def system(place: float) -> ComplexArray:
        phase = np.exp(1j * np.multiply.outer(omega, np.arange(width) + place - width / 2))
        return np.asarray(phase / _window_transform(width, omega)[:, None] * (1j if odd else 1))

    places = 0.5 - 0.5 * np.cos(np.pi * (np.arange(_PLACES) + 0.5) / _PLACES)
    rows = []
    for place in places:
        matrix = system(float(place))
        stacked = np.concatenate([matrix.real, matrix.imag])
        rows.append(np.linalg.lstsq(stacked, np.concatenate([wanted, 0 * wanted]), rcond=None)[0])
    fitted = np.stack(rows)
    degree = width  # more make no width any better
    coefficients = np.stack(
        [np.polynomial.polynomial.polyfit(2 * places - 1, fitted[:, tap], degree) for tap in range(width)]
    )
    errors = []
    for place in np.linspace(0.01, 0.99, 15):
        at = np.polynomial.polynomial.polyval(2 * place - 1, coefficients.T)
        errors.append(np.mean(np.abs(system(float(place)) @ at - wanted) ** 2))
    return InterpolationKernel(coefficients, odd, float(np.sqrt(np.mean(errors))))


def width_for(weights: dict[Term, float], eps: float) -> int:
    """The least width whose terms, of these relative sizes, err by no more than `eps` together."""
    for width in WIDTHS[:-1]:
        if sum(weight * interpolation_kernel(width, term).error for term, weight in weights.items()) <= eps:
            return width
    return WIDTHS[-1]


def needed_terms(angle: float, sizes: FloatArray, eps: float) -> dict[Term, float]:
    """(order of the gain, power of the quadratic phase) of the terms that matter to `eps`, with their relative sizes.

    exp(j angle T) leaves angle^(n+1) / (n+1)! after n powers; `sizes` are those of the gain's coefficients.
    """
    terms: dict[Term, float] = {}
    for order, size in enumerate(sizes):
        left = float(size) / max(float(sizes[0]), 1e-300) if order else 1.0
        if left <= NEGLIGIBLE * eps:
            continue
        power = 0
        terms[order, 0] = left
        left *= angle
        while left > 0.3 * eps and power < _MOST_POWERS:
            power += 1
            terms[order, power] = left
            left *= angle / (power + 1)
    return terms
