"""What waves make of a straight edge of light and shadow: the integral of what is beside geometrical optics.

Behind a straight edge the field of geometrical optics, H(v) = 1 where v > 0, is F(v) = 1/2 + (1 + j)/2 (C(v) - j S(v))
in truth, of Fresnel's integrals; v is the distance from the shadow's edge in units in which the detour by the edge is
v^2 lambda / 4. What physical optics integrates over a lit surface has a phase of its own, q per unit of v. Of F - H
nothing is left where that is stationary, as much is too little on the one side as is too much on the other; else it is
(exp(j q^2 / 2 pi) - 1) / (j q), the difference between a wave that turns at the edge itself and one that goes straight
past it and turns at the shadow's. A surface that ends near the edge has either side in part.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import ComplexArray, FloatArray

MIN_SLOPE = 1e-4
"""Slope below which it counts as such: beside 1 / q enough digits are left, and over hundreds of zones next to no
phase."""


def fresnel_transition(v: FloatArray) -> ComplexArray:
    """F, of any shape."""
    from scipy.special import fresnel

    sine, cosine = fresnel(v)
    return np.asarray(0.5 + 0.5 * (1 + 1j) * (cosine - 1j * sine))


def transition_integral(low: FloatArray, high: FloatArray, slope: FloatArray) -> ComplexArray:
    """Integral of (F(v) - H(v)) exp(-j q v) from v = `low` to `high`, which may be infinite; `slope` is q. All of one
    shape."""
    q = np.where(slope < 0, -1.0, 1.0) * np.maximum(np.abs(slope), MIN_SLOPE)
    turned = np.exp(0.5j * q * q / np.pi)

    unoccluded = low >= 0, high > 0

    def below(v: FloatArray, unoccluded: NDArray[np.bool_]) -> ComplexArray:
        # By parts: F' is a Gaussian of imaginary width, which the phase's slope moves.
        known = np.isfinite(v)
        there = np.where(known, v, 0.0)
        own = np.where(known, (fresnel_transition(there) - unoccluded) * np.exp(-1j * q * there), 0.0)
        return np.asarray(1j / q * (own - turned * fresnel_transition(v + q / np.pi)))

    return np.asarray(
        below(high, unoccluded[1]) - below(low, unoccluded[0]) + np.where(unoccluded[1] & ~unoccluded[0], 1j / q, 0.0)
    )
