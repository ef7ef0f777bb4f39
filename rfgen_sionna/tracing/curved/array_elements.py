"""Elements of a radar and polynomials over its band, for specular double bounces."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.tracing.gains.band import BandTracer


@dataclass(frozen=True)
class ArrayElements:
    """Positions, fields and pattern of the elements."""

    position: FloatArray
    """(3,) phase centre [m]."""
    rotation: FloatArray
    """(3, 3) device to world."""
    tx: FloatArray
    """(tx, 3) [m], world."""
    rx: FloatArray
    """(rx, 3) [m], world."""
    fields: tuple[FloatArray, FloatArray]
    """Field directions (3,) of Tx and Rx elements, world."""
    pattern_gain: Callable[[FloatArray], FloatArray]
    """From directions (..., 3) to the two-way field gain (...,), relative to its peak."""

    @staticmethod
    def of(radar: Radar) -> ArrayElements:
        """Elements of a radar."""
        return ArrayElements(
            np.asarray(radar.position, np.float64), radar.rotation, np.atleast_2d(radar.tx_world),
            np.atleast_2d(radar.rx_world), (radar.tx_field, radar.rx_field), BandTracer(radar, 1e-2).pattern_gain,
        )  # fmt: skip


MAX_NODES = 9
"""Most nodes: bounds the work; by the error formula below they reach 2e-4 at abs(x) = 3."""


def band_nodes(spread: float, half_band: float, rtol: float) -> FloatArray:
    """Chebyshev nodes -1 … 1 in the band for footprints over which path lengths differ by `spread` [m].

    Their gains are means of exp(-j x u) with abs(x) up to half the spread's phase over half the band. Interpolation at
    n nodes errs by less than abs(x)^n / (n! 2^(n - 1)) (error of Chebyshev interpolation).
    """
    x = 2 * np.pi * half_band * 0.5 * spread / SPEED_OF_LIGHT
    count = 1
    while count < MAX_NODES and x**count / math.factorial(count) / 2 ** (count - 1) > rtol:
        count += 1
    return np.asarray(np.cos(np.pi * (2 * np.arange(count) + 1) / (2 * count)) + 0.0)


def fit_over_band(u: FloatArray, values: ComplexArray) -> ComplexArray:
    """Coefficients (order, ...) of the powers of u from `values` (node, ...) at the nodes `u`."""
    matrix = np.linalg.inv(np.vander(u, increasing=True))
    return np.asarray(np.tensordot(matrix, values, axes=(1, 0)))
