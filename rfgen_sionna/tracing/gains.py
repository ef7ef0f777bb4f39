"""Facet gains over the sampled band: value at its centre and how it changes towards its probes."""

from __future__ import annotations

import logging
from dataclasses import dataclass

import numpy as np

from rfgen_sionna.radar import Radar
from rfgen_sionna.records import ComplexArray, FloatArray, IntArray
from rfgen_sionna.scene.materials import Material
from rfgen_sionna.tracing.facet import FacetGains, facet_gains

MAX_ORDER = 8
_LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class BandGains:
    """Gains of facets as polynomials in (f - centre) / half_band."""

    coefficients: ComplexArray
    """(order, tx, rx, facet); row 0 is the gain at the centre."""
    tau: FloatArray
    """(tx, rx, facet) delay [s]."""


class BandTracer:
    """Facet gains of one radar; positions are taken relative to its phase centre, which keeps their digits."""

    def __init__(self, radar: Radar, rtol: float) -> None:
        self.centre = radar.center_frequency
        self.half_band = 0.5 * radar.waveform.bandwidth
        self.highest = self.centre + self.half_band
        self._origin = np.asarray(radar.position)
        self._tx = radar.tx_world - self._origin
        self._rx = radar.rx_world - self._origin
        self._fields = radar.tx_field, radar.rx_field
        self._rtol = rtol
        self._pattern, self._rotation = radar.pattern, radar.rotation

    def importance(self, direction: FloatArray) -> FloatArray:
        """Two-way field gain of an element towards world directions (..., 3), relative to the peak; shape (...)."""
        level = self._pattern.gain_db(direction @ self._rotation) - self._pattern.peak_gain_dbi
        return np.asarray(10.0 ** (level / 10.0), dtype=np.float64)

    def _gains(
        self, corners: FloatArray, materials: tuple[Material, ...], index: IntArray, u: FloatArray, single: bool
    ) -> FacetGains:
        frequencies = self.centre + self.half_band * u
        permittivity = np.empty((len(u), len(corners)), dtype=np.complex128)
        permeability = np.empty_like(permittivity)
        for number, material in enumerate(materials):
            chosen = index == number
            permittivity[:, chosen] = material.relative_permittivity(frequencies)[:, None]
            permeability[:, chosen] = material.relative_permeability(frequencies)[:, None]
        tx, rx = (self._tx[:1], self._rx[:1]) if single else (self._tx, self._rx)
        return facet_gains(corners - self._origin, tx, rx, *self._fields, permittivity, permeability, frequencies)

    def __call__(self, corners: FloatArray, materials: tuple[Material, ...], index: IntArray, order: int) -> BandGains:
        """Gains of `corners` (facet, 3, 3) [m, world]; facet i is of `materials[index[i]]`.

        `order` coefficients are fitted through as many Chebyshev nodes of the band.
        """
        nodes = chebyshev_nodes(order)
        gains = self._gains(corners, materials, index, nodes, single=False)
        if order == 1:
            return BandGains(gains.a, gains.tau)
        inverse = np.linalg.inv(np.vander(nodes, order, increasing=True))
        return BandGains(np.tensordot(inverse, gains.a, axes=1), gains.tau)

    def order_for(
        self, corners: FloatArray, materials: tuple[Material, ...], index: IntArray, weight: FloatArray
    ) -> int:
        """Smallest number of coefficients whose coherent sum is right to `rtol` over the band.

        A facet that lies aslant is long against the range resolution: its gain changes over the band, and neighbours
        that cancel at the centre frequency don't elsewhere. Only the sum tells by how much that matters, so it is
        measured, for one element pair, in its middle and at both ends.
        """
        probes = np.array([-1.0, 0.0, 1.0])
        exact = self._gains(corners, materials, index, probes, single=True)
        frequencies = self.centre + self.half_band * probes
        phasor = np.exp(-2j * np.pi * frequencies[:, None] * exact.tau[0, 0]) * weight
        truth = (exact.a[:, 0, 0] * phasor).sum(axis=1)
        # Where everything cancels by chance the single returns set the scale.
        scale = max(_rms(truth), float(np.abs(exact.a[:, 0, 0] * weight).max(initial=0.0)))
        for order in range(1, MAX_ORDER + 1):
            nodes = chebyshev_nodes(order)
            a = self._gains(corners, materials, index, nodes, single=True).a[:, 0, 0]
            fitted = np.vander(probes, order, increasing=True) @ np.linalg.solve(
                np.vander(nodes, order, increasing=True), a
            )
            if _rms((fitted * phasor).sum(axis=1) - truth) <= self._rtol * scale:
                return order
        _LOG.warning("rtol %g: facets change too fast over the band for %d coefficients", self._rtol, MAX_ORDER)
        return MAX_ORDER


def _rms(values: ComplexArray) -> float:
    return float(np.sqrt(np.mean(np.abs(values) ** 2)))


def chebyshev_nodes(order: int) -> FloatArray:
    """(order,) Chebyshev nodes on (-1, 1)."""
    return np.cos(np.pi * (np.arange(order) + 0.5) / order)
