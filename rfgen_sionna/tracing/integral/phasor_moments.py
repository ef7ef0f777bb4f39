"""Means of exp(-j phi) over a triangle on which the phase phi is quadratic, in scalar kernels.

With barycentric coordinates l_i and corner phases p_i the means of a linear phase are divided differences of f(x) =
exp(-j x) (Hermite-Genocchi): with G[x_0 ... x_n] = j^n f[x_0 ... x_n],

    <exp(-j phi)>         = 2 G[p_0, p_1, p_2]
    <l_i exp(-j phi)>     = 2 G[p_0, p_1, p_2, p_i]
    <l_i l_k exp(-j phi)> = 2 G[p_0, p_1, p_2, p_i, p_k]

For sorted phases each reduces to integrals along two edges, spherical Bessel functions of half the phase difference,
divided by the spread; a power series replaces it where the spread is small. The quadratic part of the phase is kept to
first order, and its variance to second order.
"""

from __future__ import annotations

import numpy as np
from numba import njit

FAST = {"contract", "reassoc", "arcp", "nsz"}
"""Freedoms of the compiler: all but those that assume finite numbers."""
SERIES_SPREAD = 0.1
"""Spread of the phases [rad] below which the series holds: remainder below 1e-7."""
MAX_DAMPING = 2.0
"""Largest exponent of the damping by the variance of the quadratic phase."""

_Q = np.linspace(0.0, 0.25, 4001)
_COS = np.polynomial.Polynomial.fit(_Q, np.cos(2 * np.pi * np.sqrt(_Q)), 8, domain=[0, 0.25], window=[0, 0.25]).coef
_SIN = np.polynomial.Polynomial.fit(
    _Q[1:], np.sin(2 * np.pi * np.sqrt(_Q[1:])) / np.sqrt(_Q[1:]), 8, domain=[0, 0.25], window=[0, 0.25]
).coef
_C0, _C1, _C2, _C3, _C4, _C5, _C6, _C7, _C8 = map(float, _COS)
_S0, _S1, _S2, _S3, _S4, _S5, _S6, _S7, _S8 = map(float, _SIN)
_TURN = 1.0 / (2.0 * np.pi)


@njit(fastmath=FAST, error_model="numpy")
def turn(cycles: float) -> complex:
    """exp(-2j pi cycles), to 1e-12."""
    r = cycles - np.floor(cycles + 0.5)
    q = r * r
    c = _C0 + q * (_C1 + q * (_C2 + q * (_C3 + q * (_C4 + q * (_C5 + q * (_C6 + q * (_C7 + q * _C8)))))))
    s = r * (_S0 + q * (_S1 + q * (_S2 + q * (_S3 + q * (_S4 + q * (_S5 + q * (_S6 + q * (_S7 + q * _S8))))))))
    return complex(c, -s)


@njit(fastmath=FAST, error_model="numpy")
def _bessel(h: float, wave: complex) -> tuple[float, float]:
    """Spherical Bessel functions j0(h) and j1(h) / h, with `wave` = exp(-j h)."""
    if h < 0.3:
        q = h * h
        j0 = 1.0 - q / 6.0 * (1.0 - q / 20.0 * (1.0 - q / 42.0 * (1.0 - q / 72.0)))
        return j0, (1.0 - q / 10.0 * (1.0 - q / 28.0 * (1.0 - q / 54.0 * (1.0 - q / 88.0)))) / 3.0
    j0 = -wave.imag / h
    return j0, (j0 - wave.real) / (h * h)


@njit(fastmath=FAST, error_model="numpy")
def mean_phasor(
    a: float, b: float, c: float, wa: float, wb: float, wc: float, ka: float, kb: float, kc: float
) -> complex:
    """Mean of w exp(-j phi): corner phases `a`, `b`, `c` [rad], a strength that is linear with `wa`, `wb`, `wc` at the
    corners, and `ka`, `kb`, `kc` [rad], linear less true phase in the middle of the edge opposite each corner."""
    bulge = (ka + kb + kc) / 3.0  # <4 l_i l_k> = 1/3
    a, b, c = a - bulge, b - bulge, c - bulge
    if a > b:
        a, b, wa, wb, ka, kb = b, a, wb, wa, kb, ka
    if b > c:
        b, c, wb, wc, kb, kc = c, b, wc, wb, kc, kb
    if a > b:
        a, b, wa, wb, ka, kb = b, a, wb, wa, kb, ka
    spread = c - a
    if spread < SERIES_SPREAD:
        m = (a + b + c) / 3.0
        x, y, z = a - m, b - m, c - m
        q, e3 = x * x + y * y + z * z, x * y * z
        carrier = turn(m * _TURN)
        mean = carrier * complex(1.0 - q / 24.0 + q * q / 1440.0, e3 / 60.0)
        # <l_i phi> = (sum x + x_i) / 12 and <l_i l_k phi> = (sum x + x_i + x_k) / 60
        ma = carrier * complex(1.0 / 3.0 - x * x / 60.0 - q / 120.0, -x / 12.0)
        mb = carrier * complex(1.0 / 3.0 - y * y / 60.0 - q / 120.0, -y / 12.0)
        mc = carrier * complex(1.0 / 3.0 - z * z / 60.0 - q / 120.0, -z / 12.0)
        edge = 1.0 / 12.0 - q / 360.0
        ea, eb, ec = (
            carrier * complex(edge, x / 60.0),
            carrier * complex(edge, y / 60.0),
            carrier * complex(edge, z / 60.0),
        )
    else:
        scale = complex(0.0, 1.0 / spread)
        first, second = 0.5 * (b - a), 0.5 * (c - b)
        along, on, middle = turn(first * _TURN), turn(second * _TURN), turn(0.5 * (a + b) * _TURN)
        after = middle * along * on
        j0, j1 = _bessel(first, along)
        even, ab4 = middle * (0.5 * j0), middle * (0.5 * j1)
        odd = ab4 * complex(0.0, -first)
        ab, aab, abb = even + even, even - odd, even + odd
        j0, j1 = _bessel(second, on)
        even, bc4 = after * (0.5 * j0), after * (0.5 * j1)
        odd = bc4 * complex(0.0, -second)
        bc, bbc, bcc = even + even, even - odd, even + odd
        abc = (bc - ab) * scale
        aabc, abbc, abcc = (abc - aab) * scale, (bbc - abb) * scale, (bcc - abc) * scale
        mean, ma, mb, mc = 2.0 * abc, 2.0 * aabc, 2.0 * abbc, 2.0 * abcc
        ea, eb, ec = 2.0 * (bc4 - abbc) * scale, 2.0 * (abcc - aabc) * scale, 2.0 * (abbc - ab4) * scale
    strength = (wa + wb + wc) / 3.0
    bent = 4.0 * (ka * ea + kb * eb + kc * ec) - bulge * mean
    total = wa * ma + wb * mb + wc * mc + strength * complex(-bent.imag, bent.real)
    # <16 l_i^2 l_k^2> - 1/9 = 1/15, <16 l_i^2 l_k l_m> - 1/9 = -1/45
    variance = (ka * ka + kb * kb + kc * kc) / 15.0 - (ka * kb + kb * kc + kc * ka) * (2.0 / 45.0)
    exponent = min(0.5 * variance, MAX_DAMPING)
    return total / (1.0 + exponent * (1.0 + 0.5 * exponent))
