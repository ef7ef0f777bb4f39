"""Expansions: gains of every element pair over the band from few integrals.

Either interpolation of gains at pairs and frequencies of the radar (nodes),

    a(u, v, w) = sum_b c_b u^k v_y^m v_z^n w_y^p w_z^q

in the frequency u, the sum v of the Tx and Rx positions and their difference w across the boresight; or gains in the
middle of the array and their slopes, from the same integral: Hermite's polynomial in u, Taylor's of first or second
order in v, and of second in w. Slopes take a fraction of the integrals for small arrays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.linalg import qr

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray, IntArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.tracing.integral.facet import Nodes
from rfgen_sionna.tracing.integral.quadratic import SlopeOrder, variation_pairs
from rfgen_sionna.tracing.surface.facets import sum_by_surface

TANGENTS = (
    (1, 1, SlopeOrder.FIRST), (2, 1, SlopeOrder.FIRST), (2, 1, SlopeOrder.SECOND), (3, 2, SlopeOrder.FIRST), (3, 2,
    SlopeOrder.SECOND),
    (4, 2, SlopeOrder.FIRST), (4, 2, SlopeOrder.SECOND), (4, 2, SlopeOrder.CURVATURE), (5, 3, SlopeOrder.SECOND), (5, 3,
    SlopeOrder.CURVATURE), (6, 3, SlopeOrder.CURVATURE),
)  # fmt: skip
"""Expansions by slopes, cheapest first: coefficients over the band, nodes, and order of the slopes."""
FIRST_TANGENT = 3
"""Index of the expansion that is tried first: enough for most facets."""
MAX_INNER_PAIRS = 12
"""Bound of the pairs that are tried besides the outermost ones."""


PROBES = np.array([-1.0, 0.0, 1.0])
"""Positions in the band, -1 … 1, at which gains are compared."""


@dataclass(frozen=True)
class Expansion:
    """Weights from gains at a few nodes to gains of every pair over the band."""

    nodes: Nodes
    order: int
    """Number of coefficients over the band."""
    weights: FloatArray
    """(order, tx, rx, value) weights from values to coefficients of powers of u; values are the gains at each node,
    then with `axes` their slopes (:attr:`~rfgen_sionna.tracing.integral.facet.FacetGains.slopes`)."""
    axes: FloatArray | None = None
    """(axis, 3) displacements [m] of the elements for slopes, world; None means no slopes."""
    slopes: SlopeOrder = SlopeOrder.SECOND
    """Order of the slopes."""
    steady: bool = False
    """Whether the reflection is linear over the nodes, which are integrated together."""


def band_nodes(count: int) -> FloatArray:
    """(count,) Chebyshev nodes of the band, -1 … 1."""
    return np.asarray(np.cos(np.pi * (np.arange(count) + 0.5) / count))


def tangent_weights(
    order: int,
    count: int,
    positions: FloatArray,
    wavenumbers: float,
    slopes: SlopeOrder,
    apart: FloatArray,
    middle: FloatArray,
) -> FloatArray:
    """(order, pair, value) weights of gains at `count` :func:`band_nodes`, and of their slopes
    :attr:`~rfgen_sionna.tracing.integral.facet.FacetGains.slopes`, for `order` coefficients over the band.

    `count` is `order`, which leaves slopes over the wavenumber out, or half of it, rounded up; Chebyshev's polynomial
    removes an excess coefficient. `positions` (pair, axis) are those of the pairs along the axes, `wavenumbers` is the
    change of the wavenumber per unit of u [rad/m], and `apart` (pair, axis) and `middle` (axis,) the distance of Tx
    from Rx for the pairs and in the middle, in the unit of `positions`.
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
    moved = [positions[:, axis] for axis in range(positions.shape[1])]
    each_two = [(one, other, 0.5 if one == other else 1.0) for one, other in variation_pairs(len(moved))]
    squares = [by * moved[one] * moved[other] for one, other, by in each_two]
    if slopes >= SlopeOrder.SECOND:
        moved += squares
    if slopes == SlopeOrder.CURVATURE:
        more = [by * (apart[:, one] * apart[:, other] - middle[one] * middle[other]) for one, other, by in each_two]
        moved += [square + each for square, each in zip(squares, more, strict=True)]
    weights = np.empty((order, len(positions), count * (2 + len(moved))))
    weights[..., : 2 * count] = through[:, None]
    for number, by in enumerate(moved, 2):
        weights[..., number * count : (number + 1) * count] = by[:, None] * across[:, None]
    return weights


class ArrayExpansions:
    """Expansions for the element pairs of a radar, with positions relative to its phase centre. `powers` is 2 where
    reciprocity leaves even powers of the difference of Tx and Rx only, else 1."""

    def __init__(self, radar: Radar, powers: int) -> None:
        self.powers = powers
        self._centre, self._half_band = radar.center_frequency, 0.5 * radar.waveform.bandwidth
        origin = np.asarray(radar.position)
        self._tx, self._rx = radar.tx_world - origin, radar.rx_world - origin
        # Across the boresight, in units of half the array's width; depth is neglected.
        tx, rx = radar.tx_positions[:, None, 1:], radar.rx_positions[None, :, 1:]
        total, apart = (each.reshape(-1, 2) for each in (tx + rx, tx - rx))
        self._sum, self._difference = _scaled(total), _scaled(apart, centred=False)
        middle, size = 0.5 * (total.min(axis=0) + total.max(axis=0)), 0.5 * float(np.ptp(total, axis=0).max())
        self.aperture = size  # largest sum of Tx and Rx displacements [m]
        # Tx and Rx in the middle, equally far from their means, for reciprocity.
        ends = np.stack([radar.tx_positions.mean(axis=0), radar.rx_positions.mean(axis=0)])
        ends[:, 1:] += 0.5 * (middle - ends[:, 1:].sum(axis=0))
        self._middle = ends @ radar.rotation.T
        self._spanned = np.flatnonzero(np.abs(self._sum).max(axis=0) > 1e-6)
        self._axes = size * radar.rotation.T[1:][self._spanned]
        between = ends[0, 1:] - ends[1, 1:]
        self._apart, self._between = (each[..., self._spanned] / max(size, 1e-9) for each in (apart, between))

    def frequency(self, u: FloatArray) -> FloatArray:
        """Frequencies [Hz] at positions `u`, -1 … 1, of the band."""
        return np.asarray(self._centre + self._half_band * u)

    def nodes(self, u: FloatArray, pairs: IntArray) -> Nodes:
        """Nodes of element `pairs` (node,), numbered tx * n_rx + rx, at positions `u` (node,) of the band."""
        tx, rx = np.divmod(pairs, len(self._rx))
        return Nodes(self._tx[tx], self._rx[rx], self.frequency(u))

    def representative(self) -> IntArray:
        """(pair,) outermost pairs, at most nine, and some others."""
        found = set()
        for angle in np.arange(8) * (np.pi / 4):
            found.add(int(np.argmax(self._sum @ [np.cos(angle), np.sin(angle)])))
        found.add(int(np.argmax((self._difference**2).sum(axis=1))))
        # Interpolation may oscillate between the outermost ones.
        found.update(np.random.default_rng(0).permutation(len(self._sum))[:MAX_INNER_PAIRS].tolist())
        return np.array(sorted(found), dtype=np.int32)

    def basis(self, order: int, degree: int, full: bool) -> list[tuple[int, ...]]:
        """Exponents (u, v_y, v_z, w_y, w_z); not `full` omits mixed ones of high degree."""
        found: list[tuple[int, ...]] = []
        for k, m, n, p, q in product(range(order), *[range(degree + 1)] * 4):
            if (p + q) % self.powers or m + n + p + q > degree:
                continue
            if full or k / (order - 0.5) + (m + n + p + q) / (degree + 0.5) <= 1.0:
                found.append((k, m, n, p, q))
        return found

    def tangents(self, steady: bool) -> tuple[list[Expansion], list[Expansion]]:
        """Expansions by slopes from the first one on, and the cheaper ones in descending order."""
        # Without axes slopes over them do not matter.
        kinds = [(order, count, kind if len(self._axes) else SlopeOrder.FIRST) for order, count, kind in TANGENTS]
        first, kinds = kinds[FIRST_TANGENT], list(dict.fromkeys(kinds))
        some, start = [self.tangent(*each, steady) for each in kinds], kinds.index(first)
        return some[start:], some[:start][::-1]

    def tangent(
        self, order: int, count: int, slopes: SlopeOrder = SlopeOrder.SECOND, steady: bool = False
    ) -> Expansion:
        """Expansion of `order` coefficients by gains and `slopes` in the array's middle, at `count` nodes
        of the band."""
        u = band_nodes(count)
        tx, rx = (np.broadcast_to(each, (count, 3)) for each in self._middle)
        nodes = Nodes(tx, rx, self.frequency(u))
        wavenumbers = 2 * np.pi * self._half_band / SPEED_OF_LIGHT
        across = self._sum[:, self._spanned], wavenumbers, slopes, self._apart, self._between
        weights = tangent_weights(order, count, *across)
        shape = order, len(self._tx), len(self._rx), -1
        return Expansion(nodes, order, weights.reshape(shape), axes=self._axes, slopes=slopes, steady=steady)

    def over_band(self, order: int) -> Expansion:
        """Interpolation of the first pair at `order` Chebyshev nodes of the band, for all pairs."""
        u = band_nodes(order)
        weights = np.linalg.inv(np.vander(u, order, increasing=True))[:, None, None]
        shape = order, len(self._tx), len(self._rx), order
        return Expansion(
            self.nodes(u, np.zeros(order, np.int32)), order, np.ascontiguousarray(np.broadcast_to(weights, shape))
        )

    def through(self, basis: Sequence[tuple[int, ...]]) -> Expansion:
        """Interpolation by `basis` at as many pairs of the radar and Chebyshev nodes of the band. Pivoted QR picks
        pairs and frequencies (approximate Fekete points); dependent functions leave the basis."""
        order = 1 + max(each[0] for each in basis)
        u = band_nodes(order)
        powers = np.vander(u, order, increasing=True)
        coordinates = np.hstack([self._sum, self._difference])
        spatial = {each[1:]: np.prod(coordinates ** np.array(each[1:]), axis=1) for each in basis}
        columns = np.stack([np.outer(powers[:, each[0]], spatial[each[1:]]).ravel() for each in basis], axis=1)
        _, r, pivots = qr(columns, mode="economic", pivoting=True)
        rank = int(np.count_nonzero(np.abs(np.diag(r)) > 1e-9 * abs(r[0, 0])))
        kept = np.sort(pivots[:rank])
        basis, columns = [basis[each] for each in kept], columns[:, kept]
        _, _, rows = qr(columns.T, mode="economic", pivoting=True)
        rows = np.sort(rows[:rank])
        inverse = np.linalg.inv(columns[rows])
        weights = np.zeros((order, len(self._sum), rank))
        for number, each in enumerate(basis):
            weights[each[0]] += np.outer(spatial[each[1:]], inverse[number])
        nodes = self.nodes(u[rows // len(self._sum)], (rows % len(self._sum)).astype(np.int32))
        return Expansion(nodes, order, weights.reshape(order, len(self._tx), len(self._rx), rank))


@dataclass(frozen=True)
class Probes:
    """Exact gains of some pairs at positions of the band, to test expansions."""

    u: FloatArray
    """(probe,)"""
    pairs: IntArray
    """(probe,)"""
    gains: ComplexArray
    """(probe, facet)"""
    phasors: ComplexArray
    """(probe, facet) propagation phasors times the facets' weights."""
    group: IntArray
    """(facet,) group of the coherent sum."""
    scale: FloatArray
    """(group,) reference level of the errors."""

    def error(self, gains: ComplexArray) -> float:
        """Largest relative error of the groups' coherent sums for `gains` (probe, facet)."""
        missed = root_mean_square(sum_by_surface((gains - self.gains) * self.phasors, self.group, len(self.scale)))
        error = np.where(missed > 0, missed / np.where(self.scale > 0, self.scale, 1e-300), 0.0)
        return float(error.max(initial=0.0))


def root_mean_square(values: ComplexArray) -> FloatArray:
    """(group,) root mean square of `values` (probe, group)."""
    return np.asarray(np.sqrt((np.abs(values) ** 2).mean(axis=0)))


def _scaled(positions: FloatArray, centred: bool = True) -> FloatArray:
    """(pair, 2) positions in -1 … 1; without `centred` zero stays zero."""
    if centred:
        positions = positions - 0.5 * (positions.min(axis=0) + positions.max(axis=0))
    return np.asarray(positions / max(float(np.abs(positions).max()), 1e-9))
