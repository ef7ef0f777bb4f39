"""Choice of the smallest expansion over band and array whose coherent sums meet a tolerance."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from typing import Protocol

import numpy as np

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray, IntArray
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.tracing.gains.band import BandTracer
from rfgen_sionna.tracing.gains.expansion import PROBES, ArrayExpansions, Expansion
from rfgen_sionna.tracing.integral.facet import Nodes
from rfgen_sionna.tracing.surface.facets import CANCELLED

MAX_ORDER, MAX_DEGREE = 8, 6
"""Bounds of the expansion over the band and over the array: interpolation at more nodes is ill-conditioned."""
_LOG = logging.getLogger(__name__)


class Check(Protocol):
    """Facets at one time whose returns an expansion has to give."""

    group: IntArray
    """(path,) tolerance group."""
    least: FloatArray
    """(group,) least reference of errors."""

    def values(self, table: FloatArray) -> ComplexArray:
        """(node, path) gains at the nodes of a `table` (node, 7)."""

    def waves(self, u: FloatArray, pairs: IntArray) -> ComplexArray:
        """(probe, path) propagation phasors times pattern gain at positions `u` of the band of element `pairs`."""


def node_table(nodes: Nodes) -> FloatArray:
    """(node, 7) Tx and Rx position [m] relative to the viewpoint, and wavenumber [rad/m]."""
    return np.hstack([nodes.tx, nodes.rx, 2 * np.pi / SPEED_OF_LIGHT * nodes.frequency[:, None]])


def choose_expansion(expansions: ArrayExpansions, checks: Sequence[Check], rtol: float, tolerance: float) -> Expansion:
    """Smallest expansion whose error is at most `tolerance`, relative to each group's return; `rtol` is for the
    warning."""
    outer = expansions.representative()
    known: dict[tuple[bytes, bytes, int], tuple[ComplexArray, ComplexArray]] = {}

    def fits(u: FloatArray, pairs: IntArray, basis: Sequence[tuple[int, ...]]) -> bool:
        tried = expansions.through(basis)
        for number, check in enumerate(checks):
            key = u.tobytes(), pairs.tobytes(), number
            if key not in known:
                known[key] = check.values(node_table(expansions.nodes(u, pairs))), check.waves(u, pairs)
            truth, waves = known[key]
            off = (expanded(tried, check.values(node_table(tried.nodes)), u, pairs) - truth) * waves
            count = len(check.least)
            missed, whole = (
                np.sqrt((np.abs(group_sums(each, check.group, count)) ** 2).mean(axis=0))
                for each in (off, truth * waves)
            )
            strongest = np.zeros(count)
            np.maximum.at(strongest, check.group, np.abs(truth * waves).max(axis=0))
            if (missed > tolerance * np.maximum(np.maximum(whole, CANCELLED * strongest), check.least)).any():
                return False
        return True

    order, degree, first = 1, 0, np.zeros(len(PROBES), np.int32)
    middle, ends = np.zeros(len(outer)), np.repeat([-1.0, 1.0], len(outer))
    while order < MAX_ORDER and not fits(PROBES, first, [(k, 0, 0, 0, 0) for k in range(order)]):
        order += 1
    if len(outer) > 1:
        while degree < MAX_DEGREE and not fits(middle, outer, expansions.basis(1, degree, full=True)):
            degree += 1
    if order == MAX_ORDER or degree == MAX_DEGREE:
        _LOG.warning(
            "rtol is %g: gains change too fast for %d coefficients of degree %d over band and array; raise rtol",
            rtol, order, degree,
        )  # fmt: skip
    basis = expansions.basis(order, degree, full=False)
    if degree and order > 1 and not fits(ends, np.tile(outer, 2), basis):
        basis = expansions.basis(order, degree, full=True)
    return expansions.through(basis)


def expanded(expansion: Expansion, values: ComplexArray, u: FloatArray, pairs: IntArray) -> ComplexArray:
    """(probe, facet) gains at positions `u` of the band of `pairs`, from the values (node, facet)."""
    weights = expansion.weights.reshape(expansion.order, -1, len(values))[:, pairs]
    return np.asarray(np.einsum("pk,kpn->pn", np.vander(u, expansion.order, increasing=True), weights) @ values)


def first_pair(expansion: Expansion, values: ComplexArray) -> ComplexArray:
    """(...) gains of the first pair in the middle of the band, from values (node, ...)."""
    weights = expansion.weights[0, 0, 0]
    joined = weights @ np.ascontiguousarray(values).view(np.float64).reshape(len(values), -1)
    return np.asarray(joined.view(np.complex128).reshape(values.shape[1:]))


def pair_waves(band: BandTracer, centroids: FloatArray, u: FloatArray, pairs: IntArray) -> ComplexArray:
    """(probe, facet) propagation phasors by `centroids` (facet, 3) [m] relative to the viewpoint, at positions `u` of
    the band of `pairs` (probe,)."""
    tx, rx = (each - band.viewpoint for each in band.elements)
    one, other = np.divmod(pairs, len(rx))
    length = lengths(centroids - tx[one][:, None]) + lengths(centroids - rx[other][:, None])
    cycles = band.frequency(u)[:, None] * length / SPEED_OF_LIGHT
    return np.asarray(np.exp(-2j * np.pi * (cycles - np.rint(cycles))))


def group_sums(waves: ComplexArray, group: IntArray, count: int) -> ComplexArray:
    """(probe, group) sums of `waves` (probe, facet) by `group` (facet,)."""
    return np.stack([np.bincount(group, row.real, count) + 1j * np.bincount(group, row.imag, count) for row in waves])
