"""How far traced returns are from what finer facets would give."""

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
"""What is measured at one pair and a few frequencies counts this much, for all the others."""


@dataclass(frozen=True)
class ErrorEstimate:
    """Estimated errors of coherent returns, surface by surface; root mean squares over the probes."""

    amount: FloatArray
    """(surface,) error of each return."""
    level: FloatArray
    """(surface,) the return."""
    least: FloatArray
    """(surface,) what counts as its level at least."""
    incoherent: FloatArray
    """(surface,) root of the sum of the energies that its facets return one by one."""

    @property
    def error(self) -> FloatArray:
        """(surface,) relative to the surface's own return; 0 where it returns nothing."""
        return _ratio(self.amount, np.maximum(self.level, self.least))

    @property
    def cancellation(self) -> FloatArray:
        """(surface,) what its facets would return without interfering, over its return: errors that do not know of each
        other are this much larger for the surface than for its facets."""
        return _ratio(self.incoherent, np.maximum(self.level, self.least))

    @property
    def scale(self) -> float:
        """The strongest surface's return, or what all facets return without interfering, whichever is more: of a street
        seen at grazing incidence next to nothing is left but the rims, and no tolerance can be relative to that."""
        return max(float(self.level.max(initial=0.0)), float(np.linalg.norm(self.incoherent)))

    @property
    def total(self) -> float:
        """Error of all surfaces together, relative to `scale`."""
        return float(_ratio(np.linalg.norm(self.amount), np.float64(self.scale)))

    @property
    def share(self) -> FloatArray:
        """(surface,) share of each surface in the square of the total."""
        return _ratio(self.amount**2, np.float64((self.amount**2).sum()))


def combine_groups(found: ErrorEstimate, tolerance_group: IntArray) -> ErrorEstimate:
    """The same with what several surfaces of a `tolerance_group` (surface,) return together in place of what each
    does: errors are
    relative to that, and so much larger that the worst is that of all of them side by side."""
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
    """By what the tolerance of each surface's facets is to be multiplied to bring its `error` below `rtol`: powers of
    the root of a half, so that the same facets come out wherever the same scene stands."""
    excess = np.maximum(2.0 * error / rtol, 1.0)
    return np.asarray(0.5 ** np.clip(0.5 * np.ceil(2.0 * np.log2(excess)), 1.0, 5.0))


@dataclass(frozen=True)
class RefinedReturns:
    """Returns of finer facets, of one element pair at some places of the band: what others are compared with.

    Flat facets are integrated in four times as many parts, bent ones split into four. The integral's error is of second
    order in the phase bulge of a part and so goes down sixteen times with it: what is left in the finer returns is
    below a tenth of the difference.
    """

    band: BandTracer
    facets: Facets
    """Those that finer ones are compared with."""
    materials: tuple[Material, ...]
    weight: FloatArray
    """(facet,) share of each facet that counts: visibility times the antenna's field gain."""
    pair: tuple[int, int]
    probes: FloatArray
    """(probe,) places in the band, -1 … 1."""
    reference: FloatArray | None
    """(facet, 3) points [m] that the coefficients' delays go by; None is the facets' centroids."""
    tolerance_group: IntArray | None
    """(surface,) what shares one tolerance (:func:`rfgen_sionna.tracing.surface.surfaces.tolerance_groups`); None is
    each by
    itself."""
    returned: ComplexArray
    """(probe, surface)"""

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
        """Integrate them; the arguments are the fields."""
        if not len(facets):
            nothing = np.zeros((len(probes), len(materials)), np.complex128)
            return RefinedReturns(band, facets, materials, weight, pair, probes, reference, tolerance_group, nothing)
        finer_ones, index = facets.finer()
        counted = weight[index]
        if facets.pattern_gradient is not None:
            # Each of the finer ones counts by its own direction; flat ones are the same, in more parts, but for what
            # the antennas' rise in the middle leaves out.
            finer_ones = finer_ones.with_pattern_gradient(band.pattern_gradient(finer_ones))
            usual_gain = np.maximum(band.pattern_gain(facets.directions(band.viewpoint)), 1e-12)
            counted = counted * band.pattern_gain(finer_ones.directions(band.viewpoint)) / usual_gain[index]
            flat = np.arange(len(index)) if finer_ones.curved is None else np.flatnonzero(~finer_ones.curved)
            ends = band.pattern_gain(unit(finer_ones.corners[flat] - band.viewpoint))
            counted[flat] *= np.exp(np.clip(0.25 * log_gain_excess(ends, usual_gain[index[flat]]), -1.0, 1.0))
        fine = band.at_probes(finer_ones, materials, probes, pair, finer_ones.parts)
        waves = fine.a * phasors(band.frequency(probes)[:, None] * fine.tau)
        returned = sum_by_surface(waves * counted, finer_ones.surface, len(materials))
        return RefinedReturns(band, facets, materials, weight, pair, probes, reference, tolerance_group, returned)

    def of_facets(
        self, reference_level: FloatArray | None = None, places: slice = slice(None)
    ) -> tuple[ErrorEstimate, ComplexArray]:
        """Of the facets themselves, integrated at those `places` of the probes: what an expansion cannot mend;
        `reference_level`
        is that of :meth:`of_expansion`. And (probe, facet) their gains there."""
        chosen = replace(self, probes=self.probes[places], returned=self.returned[places])
        exact = self.band.at_probes(
            self.facets, self.materials, chosen.probes, self.pair, self.facets.parts, self.reference
        )
        return chosen._compared(exact.a, exact.tau, reference_level), exact.a

    def of_expansion(self, coefficients: ComplexArray, reference_level: FloatArray | None = None) -> ErrorEstimate:
        """Of gains that are polynomials over the band: the error of the expansion over band and array is in it as
        well as the integrals', and so are those of Fresnel coefficients and slopes over a facet; that of visibility,
        which :mod:`rfgen_sionna.tracing.shadows.adaptive_sampling` estimates, is not.

        Parameters
        ----------
        coefficients
            (order, facet) of the pair, without `weight`.
        usual
            (surface,) level that a return has at other times and places, if it is known: the error is relative to it
            where the return at hand is weaker, by interference.
        """
        pair, reference = self.pair, self.reference
        tau = self.band.ways(self.facets, pair) if reference is None else self.band.delays(reference, pair)
        return self._compared(
            np.vander(self.probes, len(coefficients), increasing=True) @ coefficients, tau, reference_level
        )

    def _compared(self, gains: ComplexArray, tau: FloatArray, reference_level: FloatArray | None) -> ErrorEstimate:
        """Of `gains` (probe, facet) without the propagation phase of delays `tau` [s]."""
        count, surface = len(self.materials), self.facets.surface
        coarse = gains * phasors(self.band.frequency(self.probes)[:, None] * tau) * self.weight
        error = sum_by_surface(coarse, surface, count) - self.returned
        single = np.abs(coarse)
        least = np.zeros(count) if reference_level is None else reference_level.copy()
        np.maximum.at(least, surface, CANCELLED * single.max(axis=0))
        level = np.sqrt((np.abs(self.returned) ** 2).mean(axis=0))
        energy = np.bincount(surface, (single**2).mean(axis=0), count)
        # Beside what rough things scatter diffusely little counts that is next to nothing.
        if (diffuse := self.band.diffuse(self.facets, self.materials)) is not None:
            tx, rx = (min(index, size - 1) for index, size in zip(self.pair, diffuse.shape[:2], strict=True))
            scattered = np.bincount(surface, np.abs(diffuse[tx, rx] * self.weight) ** 2, count)
            least, energy = np.maximum(least, np.sqrt(scattered)), energy + scattered
        found = ErrorEstimate(SAFETY * np.sqrt((np.abs(error) ** 2).mean(axis=0)), level, least, np.sqrt(energy))
        return found if self.tolerance_group is None else combine_groups(found, self.tolerance_group)
