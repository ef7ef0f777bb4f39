"""Facet gains for every element pair over the sampled band, from as few integrals as they need.

Without the propagation phase of its centroid a facet's gain varies little over array and band: few integrals and an
expansion (:mod:`rfgen_sionna.tracing.gains.expansion`) suffice. With one polarisation on both sides reciprocity leaves
even powers of the difference of Tx and Rx only.
"""

from __future__ import annotations

import logging

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray, IntArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.scene.materials import Material
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.tracing.gains.diffuse import diffuse_gains
from rfgen_sionna.tracing.gains.element_pattern import PatternGain
from rfgen_sionna.tracing.gains.expansion import PROBES, ArrayExpansions, Expansion, Probes, root_mean_square
from rfgen_sionna.tracing.integral.facet import FacetGains, GainBuffer, Nodes, facet_gains, split_by_curvature
from rfgen_sionna.tracing.integral.obliquity import Media
from rfgen_sionna.tracing.integral.propagation import delay_rates, phasors, propagation_delays
from rfgen_sionna.tracing.integral.quadratic import SlopeOrder
from rfgen_sionna.tracing.shadows.boundary_edges import BoundaryCorrection, ShadowEdges
from rfgen_sionna.tracing.shadows.boundary_integrals import boundary_gains
from rfgen_sionna.tracing.surface.facets import CANCELLED, Facets, curvature, sum_by_surface

MAX_ORDER, MAX_DEGREE = 8, 6
"""Bounds of the expansion over the band and over the array: interpolation at more nodes is ill-conditioned."""
EXPANSION_SHARE = 0.3
"""Share of the tolerance for an expansion; the rest is left to the facets."""
SLOPE_LIMIT = 0.2
"""The same for expansions by slopes, whose error is that of all pairs, not of single ones."""
PROBE_FACETS, MIN_PROBE_FACETS = 20_000, 4_000
"""Strongest facets that decide on an expansion, and the least number per tolerance group."""
MONOSTATIC = 0.5
"""(baseline / distance)^2 per tolerance, below which obliquity is monostatic: error a quarter of it."""
WIDE_ARRAY = 0.1
"""Reach of an array over the distance of a facet, from which each pair has its own diffuse return: error 0.2 dB."""
MAX_CORRECTION_LANES = 4_000_000
"""Gains of shadow-boundary corrections per kernel call: bounds the memory."""
STEADY_FACTOR = 2.0
"""(band / frequency)^2 per tolerance, below which reflection may be linear over the band: error 0.1 to 0.2 of it."""
_LOG = logging.getLogger(__name__)


class BandTracer:
    """Facet gains of one radar over its band."""

    probe_facets = PROBE_FACETS
    """Largest number of facets that decide on an expansion."""
    tangents = True
    """Whether gains have slopes."""

    def __init__(self, radar: Radar, rtol: float, seed: int = 0) -> None:
        self.centre = radar.center_frequency
        self.half_band = 0.5 * radar.waveform.bandwidth
        self.highest = self.centre + self.half_band
        self._origin = np.asarray(radar.position)
        self._tx = radar.tx_world - self._origin
        self._rx = radar.rx_world - self._origin
        self.fields = radar.tx_field, radar.rx_field
        # Monostatic obliquity needs equal polarisations.
        self.alike = bool(np.allclose(*self.fields))
        self._rtol, self._seed = rtol, seed
        self._pattern = PatternGain(radar.pattern, radar.rotation)
        self.expansions = ArrayExpansions(radar, 2 if self.alike else 1)
        self.aperture = self.expansions.aperture
        self.reach = float(lengths(np.concatenate([self._tx, self._rx])).max())  # from the phase centre [m]
        self.baseline = float(np.linalg.norm(self._tx[:, None] - self._rx, axis=2).max())
        self._steady = 3.0 * self.half_band**2 < STEADY_FACTOR * rtol * self.centre**2

    @property
    def viewpoint(self) -> FloatArray:
        """(3,) phase centre of the radar [m]."""
        return self._origin

    @property
    def elements(self) -> tuple[FloatArray, FloatArray]:
        """(tx, 3) and (rx, 3) positions of the elements [m]."""
        return self._origin + self._tx, self._origin + self._rx

    def pattern_gain(self, direction: FloatArray) -> FloatArray:
        """(...) two-way field gain towards world directions (..., 3), relative to the peak."""
        return self._pattern.gains(direction)

    def pattern_gradient(self, facets: Facets, chosen: NDArray[np.intp] | slice = slice(None)) -> FloatArray | None:
        """(facet, 3) :attr:`rfgen_sionna.tracing.surface.facets.Facets.pattern_gradient` of the `chosen` facets, else
        0; None if it is 0 everywhere."""
        found = self._pattern.gradients(facets.centroids[chosen] - self._origin)
        if found is None:
            return None
        pattern_gradient = np.zeros((len(facets), 3))
        pattern_gradient[chosen] = found
        return pattern_gradient

    def pattern_gradients(self, places: FloatArray) -> FloatArray | None:
        """(point, 3) gradient of the logarithm of the pattern gain [1/m] at `places` (point, 3) [m] relative to the
        viewpoint; None if it is zero everywhere."""
        return self._pattern.gradients(places)

    def frequency(self, u: FloatArray) -> FloatArray:
        """Frequencies [Hz] at positions `u`, -1 … 1, of the band."""
        return self.expansions.frequency(u)

    def delays(self, centroids: FloatArray, pair: tuple[int, int] | None = None) -> FloatArray:
        """(tx, rx, facet) delays [s] via `centroids` (facet, 3) [m, world]; (facet,) for a single `pair`."""
        places = centroids - self._origin
        if pair is not None:
            return propagation_delays(places, self._tx[pair[0], None], self._rx[pair[1], None])[0, 0]
        return propagation_delays(places, self._tx, self._rx)

    def rates(self, centroids: FloatArray, velocities: FloatArray) -> FloatArray:
        """(tx, rx, facet) rates [s/s] of :meth:`delays`, for points of `velocities` (facet, 3) [m/s]."""
        return delay_rates(centroids - self._origin, velocities, self._tx, self._rx)

    def pair_delays(self, facets: Facets, pair: tuple[int, int]) -> FloatArray:
        """(facet,) delays [s] of the gains of one pair."""
        return self.delays(facets.centroids, pair)

    def __call__(self, facets: Facets, materials: tuple[Material, ...], expansion: Expansion) -> ComplexArray:
        """(order, tx, rx, facet) gains as polynomials in u, for the `materials` of the facets' surfaces."""
        return self.combined(expansion, self.values(facets, materials, expansion))

    def combined(self, expansion: Expansion, values: ComplexArray) -> ComplexArray:
        """(order, tx, rx, ...) gains as polynomials in u, from the values (value, ...) of the `expansion`."""
        weights = expansion.weights.reshape(-1, len(values))
        # One real product for both parts.
        joined = weights @ np.ascontiguousarray(values).view(np.float64).reshape(len(values), -1)
        return joined.view(np.complex128).reshape(*expansion.weights.shape[:3], *values.shape[1:])

    def expansion_for(
        self,
        facets: Facets,
        materials: tuple[Material, ...],
        weight: FloatArray,
        coherent: bool = True,
        strength: FloatArray | None = None,
    ) -> Expansion:
        """Smallest expansion whose coherent sums are right to a share of `rtol`, over the band and the outermost pairs.

        Only sums count: gains at oblique incidence vary over the band and cancel. Probes are one pair over the band,
        and the outermost pairs with some others in its middle and at its ends. `weight` (facet,) is visibility times
        pattern gain. Errors are relative to the coherent sum, or without `coherent` to the incoherent sum where it is
        larger. `strength` (facet,) is the weighted gain's magnitude up to a factor; None computes it.
        """
        if len(facets) > self.probe_facets:
            if strength is None:
                once = self.at_probes(facets, materials, np.zeros(1), (0, 0), np.ones(len(facets), np.int32))
                strength = np.abs(once.a[0] * weight)
            most = max(self.probe_facets, MIN_PROBE_FACETS)
            strongest = np.sort(np.argsort(-strength)[:most])
            facets, weight = facets.take(strongest), weight[strongest]
        pairs = self.expansions.representative()
        middle, ends = np.zeros(len(pairs)), np.repeat([-1.0, 1.0], len(pairs))
        order, degree = 1, 0

        def probes(u: FloatArray, at: IntArray) -> Probes:
            return self._probes(facets, materials, weight, u, at, coherent)

        def error(probes: Probes, found: Expansion) -> float:
            return self._error(facets, materials, probes, found)

        def fits(u: FloatArray, at: IntArray, basis: list[tuple[int, ...]]) -> bool:
            return error(probes(u, at), self.expansions.through(basis)) <= EXPANSION_SHARE * self._rtol

        first = np.zeros(len(PROBES), np.int32)
        if self.tangents:
            tried = [probes(PROBES, first), *([probes(ends, np.tile(pairs, 2))] if len(pairs) > 1 else [])]

            def is_right(found: Expansion) -> bool:
                return all(error(each, found) <= SLOPE_LIMIT * self._rtol for each in tried)

            # From the usual expansion to dearer ones until one is right, or to cheaper ones while they are. Materials
            # that change too much over the band fail with any slopes if steady.
            for steady in (True, False) if self._steady else (False,):
                dearer, cheaper = self.expansions.tangents(steady)
                found = next((number for number, each in enumerate(dearer) if is_right(each)), None)
                if found is not None:
                    best = dearer[found]
                    for each in cheaper if best.order == dearer[0].order else ():
                        if not is_right(each):
                            break
                        best = each
                    return best
        while order <= MAX_ORDER and not fits(PROBES, first, [(k, 0, 0, 0, 0) for k in range(order)]):
            order += 1
        if len(pairs) > 1:
            while degree < MAX_DEGREE and not fits(middle, pairs, self.expansions.basis(1, degree, full=True)):
                degree += 1
        if order > MAX_ORDER or degree == MAX_DEGREE:
            _LOG.warning(
                "rtol is %g: gains change too fast for %d coefficients of degree %d over band and array; raise rtol",
                self._rtol, min(order, MAX_ORDER), degree,
            )  # fmt: skip
            order = min(order, MAX_ORDER)
        basis = self.expansions.basis(order, degree, full=False)
        if degree and order > 1 and not fits(ends, np.tile(pairs, 2), basis):
            basis = self.expansions.basis(order, degree, full=True)
        return self.expansions.through(basis)

    def edges(
        self,
        facets: Facets,
        owner: NDArray[np.intp],
        pieces: FloatArray,
        occluder: FloatArray,
        group: NDArray[np.intp],
        level: FloatArray,
    ) -> tuple[ShadowEdges, FloatArray]:
        """Significant shadow edges on `facets`, and the omitted return of each `group` (piece,). The other arguments
        are those of :meth:`rfgen_sionna.tracing.shadows.boundary_edges.ShadowEdges.of` and `significant`."""
        wavenumber = 2 * np.pi * self.highest / SPEED_OF_LIGHT
        found = ShadowEdges.of(facets, owner, pieces, occluder, self._origin, wavenumber)
        towards = found.middle / np.maximum(lengths(found.middle), 1e-9)[:, None]
        edge_curvature = curvature(facets, found.owner)
        at_most, unknown, known = found.return_bounds(self._tx, self._rx, wavenumber, edge_curvature)
        counts = self.pattern_gain(towards)
        at_most, unknown = counts * at_most, counts * unknown
        bent = np.zeros(len(found.owner), np.bool_) if facets.curved is None else facets.curved[found.owner]
        found, missed = found.significant(at_most, unknown, known, bent, group[found.piece], level, self._rtol)
        return found.with_curvature(facets), missed

    def boundary_correction(
        self, edges: ShadowEdges, values: ComplexArray, reference: FloatArray, expansion: Expansion
    ) -> BoundaryCorrection:
        """Corrections of pairs at shadow `edges`, for reference points (edge, 3) [m, world] and `values` (value, edge)
        of the edges' small pieces."""
        shape = *expansion.weights.shape[:3], len(edges.owner)
        gains, known = np.empty(shape, np.complex128), (self._tx, self._rx, self.centre, self.half_band)
        calls = -(-gains.size // MAX_CORRECTION_LANES)
        ends = np.linspace(0, shape[-1], calls + 1).astype(np.intp).tolist()
        for some in map(slice, ends[:-1], ends[1:]):
            small = self.combined(expansion, values[:, some])
            gains[..., some] = boundary_gains(edges.take(some), *known, small, reference[some] - self._origin)
        return BoundaryCorrection(edges.owner, gains)

    def diffuse(self, facets: Facets, materials: tuple[Material, ...]) -> ComplexArray | None:
        """(tx, rx, facet) diffuse gains (:mod:`rfgen_sionna.tracing.gains.diffuse`), (1, 1, facet) if equal for all
        pairs; None without rough surfaces."""
        known = self.fields, self.centre, self._seed
        found = diffuse_gains(facets, materials, (self._origin[None],) * 2, *known)
        near = np.flatnonzero(self.reach > WIDE_ARRAY * lengths(facets.centroids - self._origin))
        if found is not None and found[..., near].any():
            ends = self._origin + self._tx, self._origin + self._rx
            found = np.repeat(np.repeat(found, len(self._tx), axis=0), len(self._rx), axis=1)
            of_near = diffuse_gains(facets.take(near), materials, ends, *known)
            found[..., near] = 0.0 if of_near is None else of_near
        if found is None or facets.grain is None:
            return found
        # Phase of the path via the grain's middle.
        rough = np.flatnonzero(found.any(axis=(0, 1)))
        middle = np.einsum("fc,fci->fi", facets.grain[rough, 1:], facets.corners[rough])
        way = self.delays(middle) - self.delays(facets.centroids[rough])
        every = np.zeros((*way.shape[:2], found.shape[2]), np.complex128)
        every[..., rough] = found[..., rough] * np.exp(-2j * np.pi * self.centre * way)
        return every

    def at_probes(
        self,
        facets: Facets,
        materials: tuple[Material, ...],
        u: FloatArray,
        pair: tuple[int, int],
        parts: IntArray,
        reference: FloatArray | None = None,
    ) -> FacetGains:
        """Gains (probe, facet) of one pair at positions `u` of the band, integrated in `parts` without expansion.
        `reference` is that of :meth:`values`."""
        nodes = self.expansions.nodes(u, np.full(len(u), pair[0] * len(self._rx) + pair[1], np.int32))
        if reference is None:
            return self._gains(facets, materials, nodes, parts)
        return self._integrated(facets, materials, nodes, parts, reference=reference)

    def values(
        self, facets: Facets, materials: tuple[Material, ...], expansion: Expansion, reference: FloatArray | None = None
    ) -> ComplexArray:
        """(value, facet) values of the `expansion`, via `reference` (facet, 3) [m, world]; None means centroids."""
        if expansion.axes is None and reference is None:
            return self._gains(facets, materials, expansion.nodes).a
        given = expansion.nodes, facets.parts, expansion.axes, reference, expansion.slopes, expansion.steady
        found = self._integrated(facets, materials, *given)
        return found.terms.reshape(found.terms.shape[0] * found.terms.shape[1], len(facets))

    def _probes(
        self,
        facets: Facets,
        materials: tuple[Material, ...],
        weight: FloatArray,
        u: FloatArray,
        pairs: IntArray,
        coherent: bool,
    ) -> Probes:
        exact = self._gains(facets, materials, self.expansions.nodes(u, pairs))
        waves = weight * phasors(self.frequency(u)[:, None] * exact.tau)
        group, count = np.zeros(len(facets), np.int32), 1
        single, strongest = np.abs(exact.a * weight), np.zeros(count)
        np.maximum.at(strongest, group, single.max(axis=0, initial=0.0))
        scale = np.maximum(root_mean_square(sum_by_surface(exact.a * waves, group, count)), CANCELLED * strongest)
        # The level of several surfaces, as of a room, is their incoherent sum.
        if not coherent:
            scale = np.maximum(scale, np.sqrt(np.bincount(group, (single**2).mean(axis=0), count)))
        return Probes(u, pairs, exact.a, waves, group, scale)

    def _error(
        self,
        facets: Facets,
        materials: tuple[Material, ...],
        probes: Probes,
        expansion: Expansion,
    ) -> float:
        """Largest relative error of the coherent sums at the probes."""
        values = self.values(facets, materials, expansion)
        found = np.vander(probes.u, expansion.order, increasing=True)  # (probe, order)
        weights = expansion.weights.reshape(expansion.order, -1, len(values))[:, probes.pairs]
        rows = np.einsum("pk,kpn->pn", found, weights)
        return probes.error(rows @ values)

    def _gains(
        self, facets: Facets, materials: tuple[Material, ...], nodes: Nodes, parts: IntArray | None = None
    ) -> FacetGains:
        return self._integrated(facets, materials, nodes, facets.parts if parts is None else parts)

    def _integrated(
        self,
        facets: Facets,
        materials: tuple[Material, ...],
        nodes: Nodes,
        parts: IntArray,
        axes: FloatArray | None = None,
        reference: FloatArray | None = None,
        slopes: SlopeOrder = SlopeOrder.SECOND,
        steady: bool = False,
    ) -> FacetGains:
        media = Media.at(materials, nodes.frequency, self.half_band)
        nearest = float(lengths(facets.centroids - self._origin).min(initial=np.inf))
        monostatic = self.alike and bool(self.baseline**2 < MONOSTATIC * self._rtol * nearest**2)

        def of(index: NDArray[np.intp] | slice, curved: bool, buffer: GainBuffer | None) -> FacetGains:
            return facet_gains(
                facets.corners[index],
                facets.surface[index],
                media,
                nodes,
                *self.fields,
                parts[index],
                monostatic,
                patch=facets.patch.take(index) if curved and facets.patch is not None else None,
                axes=axes,
                reference=None if reference is None else reference[index],
                pattern_gradient=None if facets.pattern_gradient is None else facets.pattern_gradient[index],
                gradient_origin=None if facets.gradient_origin is None else facets.gradient_origin[index],
                buffer=buffer,
                origin=self._origin,
                steady=steady,
                kinds=slopes,
            )

        return split_by_curvature(facets.curved, of)
