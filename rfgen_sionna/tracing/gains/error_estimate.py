"""Error estimate of traced returns by one halving test: the same with finer facets."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rfgen_sionna._types import ComplexArray, FloatArray, IntArray
from rfgen_sionna.scene.materials import Material
from rfgen_sionna.scene.mesh import unit
from rfgen_sionna.tracing.gains.band import BandTracer
from rfgen_sionna.tracing.gains.expansion import PROBES
from rfgen_sionna.tracing.integral.propagation import phasors
from rfgen_sionna.tracing.surface.facets import CANCELLED, Facets, sum_by_surface
from rfgen_sionna.tracing.surface.resolution import log_gain_excess

SAFETY = 2.0
"""Factor on the error at one pair and a few frequencies, for all others."""


@dataclass(frozen=True)
class ErrorEstimate:
    """Estimated errors of coherent returns by surface, root mean squares over the probes."""

    amount: FloatArray
    """(surface,) absolute error of the return."""
    level: FloatArray
    """(surface,) the return."""
    least: FloatArray
    """(surface,) lower bound of the reference level."""
    incoherent: FloatArray
    """(surface,) incoherent sum of the facets' returns."""

    @property
    def error(self) -> FloatArray:
        """(surface,) error relative to the surface's return; 0 without a return."""
        return _ratio(self.amount, np.maximum(self.level, self.least))

    @property
    def cancellation(self) -> FloatArray:
        """(surface,) incoherent over coherent sum: factor on independent relative errors of the facets."""
        return _ratio(self.incoherent, np.maximum(self.level, self.least))

    @property
    def scale(self) -> float:
        """The strongest return or the incoherent sum of all facets, whichever is larger: coherent sums may cancel."""
        return max(float(self.level.max(initial=0.0)), float(np.linalg.norm(self.incoherent)))

    @property
    def total(self) -> float:
        """Error of all surfaces together, relative to `scale`."""
        return float(_ratio(np.linalg.norm(self.amount), np.float64(self.scale)))

    @property
    def share(self) -> FloatArray:
        """(surface,) share in the square of the total."""
        return _ratio(self.amount**2, np.float64((self.amount**2).sum()))


def combine_groups(found: ErrorEstimate, tolerance_group: IntArray) -> ErrorEstimate:
    """The same with the return of a surface's `tolerance_group` (surface,) in place of its own. Errors are scaled so
    that the largest of a group is that of all its surfaces together."""
    count = len(tolerance_group)
    alone = np.bincount(tolerance_group, minlength=count)[tolerance_group] == 1

    def norm(values: FloatArray) -> FloatArray:
        return np.sqrt(np.bincount(tolerance_group, values**2, count))

    def most(values: FloatArray) -> FloatArray:
        largest = np.zeros(count)
        np.maximum.at(largest, tolerance_group, values)
        return largest

    incoherent = norm(found.incoherent)
    level = np.maximum(most(np.maximum(found.level, found.least)), incoherent)
    amount = found.amount * _ratio(norm(found.amount), most(found.amount))[tolerance_group]
    return ErrorEstimate(
        np.where(alone, found.amount, amount),
        np.where(alone, found.level, level[tolerance_group]),
        found.least,
        np.where(alone, found.incoherent, incoherent[tolerance_group]),
    )


def _ratio(amount: Any, scale: Any) -> Any:
    return np.where(scale > 0, amount / np.where(scale > 0, scale, 1.0), 0.0)


def tolerance_factor(error: FloatArray, rtol: float) -> FloatArray:
    """(surface,) factor on the facets' tolerance that brings `error` (surface,) below `rtol`. Powers of the root of a
    half keep the facets of a displaced scene equal."""
    excess = np.maximum(2.0 * error / rtol, 1.0)
    return np.asarray(0.5 ** np.clip(0.5 * np.ceil(2.0 * np.log2(excess)), 1.0, 5.0))


@dataclass(frozen=True)
class RefinedReturns:
    """Returns of finer facets for one element pair at some positions of the band, to compare others with. Flat facets
    have twice the parts per edge, bent ones are divided into four. The error is of second order in the phase bulge and
    falls sixteenfold: that of the finer returns is below a tenth of the difference."""

    band: BandTracer
    facets: Facets
    """Facets to compare."""
    materials: tuple[Material, ...]
    weight: FloatArray
    """(facet,) visibility times pattern gain."""
    pair: tuple[int, int]
    probes: FloatArray
    """(probe,) positions in the band, -1 … 1."""
    reference: FloatArray | None
    """(facet, 3) reference points [m] of the delays; None means the centroids."""
    tolerance_group: IntArray | None
    """(surface,) :func:`~rfgen_sionna.tracing.surface.surfaces.tolerance_groups`; None makes each surface a group."""
    returned: ComplexArray
    """(probe, surface) returns of the finer facets."""

    @staticmethod
    def of(
        band: BandTracer,
        facets: Facets,
        materials: tuple[Material, ...],
        weight: FloatArray,
        pair: tuple[int, int] = (0, 0),
        probes: FloatArray = PROBES,
        reference: FloatArray | None = None,
        tolerance_group: IntArray | None = None,
    ) -> RefinedReturns:
        """Integrate the finer facets; the arguments are the fields."""
        if not len(facets):
            nothing = np.zeros((len(probes), len(materials)), np.complex128)
            return RefinedReturns(band, facets, materials, weight, pair, probes, reference, tolerance_group, nothing)
        finer, index = facets.finer()
        counted = weight[index]
        if facets.pattern_gradient is not None:
            # Finer facets have the gain of their own direction; flat ones the second-order rest of the gain.
            finer = finer.with_pattern_gradient(band.pattern_gradient(finer))
            middle_gain = np.maximum(band.pattern_gain(facets.directions(band.viewpoint)), 1e-12)
            counted = counted * band.pattern_gain(finer.directions(band.viewpoint)) / middle_gain[index]
            flat = np.arange(len(index)) if finer.curved is None else np.flatnonzero(~finer.curved)
            ends = band.pattern_gain(unit(finer.corners[flat] - band.viewpoint))
            counted[flat] *= np.exp(np.clip(0.25 * log_gain_excess(ends, middle_gain[index[flat]]), -1.0, 1.0))
        fine = band.at_probes(finer, materials, probes, pair, finer.parts)
        waves = fine.a * phasors(band.frequency(probes)[:, None] * fine.tau)
        returned = sum_by_surface(waves * counted, finer.surface, len(materials))
        return RefinedReturns(band, facets, materials, weight, pair, probes, reference, tolerance_group, returned)

    def of_facets(
        self, reference_level: FloatArray | None = None, places: slice = slice(None)
    ) -> tuple[ErrorEstimate, ComplexArray]:
        """Errors of the integrals, and gains (probe, facet), at `places` of the probes; `reference_level` as below."""
        chosen = replace(self, probes=self.probes[places], returned=self.returned[places])
        given = self.facets, self.materials, chosen.probes, self.pair, self.facets.parts
        exact = self.band.at_probes(*given, self.reference)
        return chosen._compared(exact.a, exact.tau, reference_level), exact.a

    def of_expansion(self, coefficients: ComplexArray, reference_level: FloatArray | None = None) -> ErrorEstimate:
        """Errors of gains that are polynomials over the band: of expansion and integrals, without visibility.
        `coefficients` (order, facet) are those of the pair, without `weight`. `reference_level` (surface,) is the
        return at other times, a lower bound of the level where returns cancel; None means no bound."""
        pair, reference = self.pair, self.reference
        tau = self.band.pair_delays(self.facets, pair) if reference is None else self.band.delays(reference, pair)
        gains = np.vander(self.probes, len(coefficients), increasing=True) @ coefficients
        return self._compared(gains, tau, reference_level)

    def _compared(self, gains: ComplexArray, tau: FloatArray, reference_level: FloatArray | None) -> ErrorEstimate:
        """Errors of `gains` (probe, facet) with delays `tau` [s]."""
        count, surface = len(self.materials), self.facets.surface
        coarse = gains * phasors(self.band.frequency(self.probes)[:, None] * tau) * self.weight
        error = sum_by_surface(coarse, surface, count) - self.returned
        single = np.abs(coarse)
        least = np.zeros(count) if reference_level is None else reference_level.copy()
        np.maximum.at(least, surface, CANCELLED * single.max(axis=0))
        level = np.sqrt((np.abs(self.returned) ** 2).mean(axis=0))
        energy = np.bincount(surface, (single**2).mean(axis=0), count)
        # Diffuse returns are a lower bound of the level.
        if (diffuse := self.band.diffuse(self.facets, self.materials)) is not None:
            tx, rx = (min(index, size - 1) for index, size in zip(self.pair, diffuse.shape[:2], strict=True))
            scattered = np.bincount(surface, np.abs(diffuse[tx, rx] * self.weight) ** 2, count)
            least, energy = np.maximum(least, np.sqrt(scattered)), energy + scattered
        found = ErrorEstimate(SAFETY * np.sqrt((np.abs(error) ** 2).mean(axis=0)), level, least, np.sqrt(energy))
        return found if self.tolerance_group is None else combine_groups(found, self.tolerance_group)
