"""How facet gains of every element pair over the band follow from a few values.

Either from gains at pairs and frequencies of the radar (nodes), by the polynomial through them,

    a(u, v, w) = sum_b c_b u^k v_y^m v_z^n w_y^p w_z^q

in the frequency u, the sum v of the Tx and Rx positions and their difference w across the boresight; or from gains in
the middle of the array and their slopes, which the same integral gives for little more, by Hermite's polynomial in u
and Taylor's of first or second order in v. The latter takes a fraction of the integrals wherever the array is small.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rfgen_sionna.records import FloatArray
from rfgen_sionna.tracing.facet import Nodes
from rfgen_sionna.tracing.quadratic import Slopes, pairs


@dataclass(frozen=True)
class Expansion:
    """How the gains of every pair over the band follow from those at a few nodes."""

    nodes: Nodes
    order: int
    """Number of coefficients over the band."""
    weights: FloatArray
    """(order, tx, rx, value) what takes the values at the nodes to coefficients of powers of u for every pair: the
    gains at each node, then with `axes` their slopes (:attr:`~rfgen_sionna.tracing.facet.FacetGains.slopes`)."""
    basis: tuple[tuple[int, ...], ...] = ()
    """Exponents (u, v_y, v_z, w_y, w_z) that it was to have, through nodes."""
    axes: FloatArray | None = None
    """(axis, 3) displacements [m] of the elements, world, over which slopes are taken; None is that none are."""
    slopes: Slopes = Slopes.SECOND
    """Which of them."""


def band_nodes(count: int) -> FloatArray:
    """(count,) Chebyshev nodes of the band, -1 … 1."""
    return np.asarray(np.cos(np.pi * (np.arange(count) + 0.5) / count))


def tangent_weights(
    order: int,
    count: int,
    displaced: FloatArray,
    wavenumbers: float,
    slopes: Slopes,
    apart: FloatArray,
    middle: FloatArray,
) -> FloatArray:
    """(order, pair, value) weights of gains at `count` :func:`band_nodes`, and of their slopes: those of
    :attr:`~rfgen_sionna.tracing.facet.FacetGains.slopes`.

    Parameters
    ----------
    order
        Number of coefficients over the band.
    count
        Number of nodes: as many as coefficients, so that slopes over the wavenumber don't count, or half as many,
        rounded up. If that leaves a coefficient too many, the highest one is left out with Chebyshev's polynomial,
        which spreads over the band what is missed.
    displaced
        (pair, axis) how far along each axis each pair lies.
    wavenumbers
        Change of the wavenumber per unit of u [rad/m].
    slopes
        Which slopes there are.
    apart, middle
        (pair, axis) how far along each axis Tx is from Rx, in the unit of `displaced`, and (axis,) in the middle.
    """
    u = band_nodes(count)
    known = count if order == count else 2 * count
    powers = np.arange(known)
    values = u[:, None] ** powers
    rates = powers * u[:, None] ** np.maximum(powers - 1, 0)
    through = np.zeros((known, 2 * count))  # (power, value or rate)
    through[:, :known] = np.linalg.inv(np.concatenate([values, rates])[:known])
    through[:, count:] *= wavenumbers
    if order < known:
        highest = np.polynomial.chebyshev.cheb2poly(np.eye(known)[-1])
        through = (through - np.outer(highest / highest[-1], through[-1]))[:order]
    across = np.zeros((order, count))
    across[:count] = np.linalg.inv(values[:, :count])
    moved = [displaced[:, axis] for axis in range(displaced.shape[1])]
    each_two = [(one, other, 0.5 if one == other else 1.0) for one, other in pairs(len(moved))]
    squares = [by * moved[one] * moved[other] for one, other, by in each_two]
    if slopes >= Slopes.SECOND:
        moved += squares
    if slopes == Slopes.BOWED:
        more = [by * (apart[:, one] * apart[:, other] - middle[one] * middle[other]) for one, other, by in each_two]
        moved += [square + beside for square, beside in zip(squares, more, strict=True)]
    weights = np.empty((order, len(displaced), count * (2 + len(moved))))
    weights[..., : 2 * count] = through[:, None]
    for number, by in enumerate(moved, 2):
        weights[..., number * count : (number + 1) * count] = by[:, None] * across[:, None]
    return weights
