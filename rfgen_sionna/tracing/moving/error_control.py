"""Error control: facets and an expansion fine enough for the tolerance of direct returns."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.tracing.gains.band import BandTracer, Expansion
from rfgen_sionna.tracing.gains.error_estimate import SAFETY, ErrorEstimate, RefinedReturns
from rfgen_sionna.tracing.gains.expansion import PROBES
from rfgen_sionna.tracing.integral.propagation import phasors
from rfgen_sionna.tracing.moving.culling import LEAST_RTOL
from rfgen_sionna.tracing.moving.facet_returns import relative_to_largest
from rfgen_sionna.tracing.moving.indirect_paths import IndirectPaths
from rfgen_sionna.tracing.moving.interval import IntervalVisibility, TraceInterval
from rfgen_sionna.tracing.moving.moving_facets import MovingFacets
from rfgen_sionna.tracing.moving.visible_facets import VisibleFacets
from rfgen_sionna.tracing.shadows.terminator import Terminator, near_terminator, unoccluded_by_neighbours
from rfgen_sionna.tracing.surface.facets import sum_by_surface
from rfgen_sionna.tracing.surface.surfaces import Surfaces, tolerance_groups

TERMINATOR_PER_RTOL, FINE_TERMINATOR_PER_RTOL = 1.5, 0.3
"""Return of facets at the terminator, per unit of the tolerance, above which they are traced; the second below
`LEAST_RTOL`, where facets are cut at the terminator. A person's return is about 1e-3 and costs a tenth
of a frame."""
UNCUT_SHARE = 0.3
"""Share of the return at the terminator that facets err by if not cut there, as their strengths have a kink."""
UNVERIFIED_PER_RTOL, CURVED_UNVERIFIED_PER_RTOL, PER_ELEMENT_PER_RTOL = 0.1, 1.0, 1.0
"""Estimated error of the shadow-boundary correction, per unit of the tolerance, above which it is verified by
per-element visibility: of flat surfaces, and of curved ones, where the estimate is right to a factor of two; and
measured error above which per-element visibility replaces it."""
REVERIFY_GROWTH, CORRECTION_SAFETY = 2.0, 2.0
"""Growth of the estimate that triggers another verification, and factor on the measured error for other times and
pairs."""
MAX_ROUNDS = 5
"""Largest number of refinements per interval; then a warning reports the error."""
_LOG = logging.getLogger(__name__)


class ErrorControl:
    """Chooses facets and expansion of the `surfaces`, and estimates the error of direct returns. The choice persists
    until the error exceeds the tolerance. `trace_visibility` gives the direct visibility at a time [s] of an interval;
    `indirect` paths may demand finer facets."""

    def __init__(
        self,
        surfaces: Surfaces,
        band: BandTracer,
        rtol: float,
        facets: MovingFacets,
        indirect: IndirectPaths,
        trace_visibility: Callable[[float, TraceInterval], VisibleFacets],
    ) -> None:
        self._surfaces, self._band, self._rtol = surfaces, band, rtol
        self._facets, self._indirect, self._trace_visibility = facets, indirect, trace_visibility
        self._materials = tuple(surface.material for surface in surfaces.moving)
        self._tolerance_group = tolerance_groups(surfaces.moving)
        self.reset()
        self.cancellation = np.zeros(len(surfaces.moving))
        """(surface,) :attr:`rfgen_sionna.tracing.gains.error_estimate.ErrorEstimate.cancellation`; 0 where unknown."""
        self.terminator = np.zeros(len(surfaces.moving), np.bool_)
        """(surface,) whether facets beyond the terminator, which face away, count."""
        self.per_element = np.zeros(len(surfaces.moving), np.bool_)
        """(surface,) whether per-element visibility counts."""
        self._static = np.array([each.still for each in surfaces.moving], np.bool_)
        self._verified_at, self._correction_scale, self._correction_offset = np.zeros((3, len(surfaces.moving)))
        self.verify_again()
        self._curved = np.array([each.smooth is not None for each in surfaces.moving], np.bool_)
        self._fine, self._any_curved = rtol < LEAST_RTOL, bool(self._curved.any())
        self._error = self._last = self._terminator_error = 0.0

    def reset(self) -> None:
        """Choose all anew, for new facets."""
        self.expansion: Expansion | None = None
        """Expansion in use; None before the first choice."""
        self.level = np.zeros(len(self._surfaces.moving))
        """(surface,) largest return so far, or that of the verified pairs."""
        self._lowered = np.ones(len(self._surfaces.moving))

    def ensure(
        self,
        sample_times: FloatArray,
        interval: TraceInterval,
        visibility: Callable[[FloatArray, Expansion], IntervalVisibility],
        turn: int | None,
    ) -> IntervalVisibility:
        """`visibility` at the `sample_times` [s] with an expansion that is fine enough. The number of the measurement,
        `turn`, chooses the element pair; None measures only surfaces that return for the first time."""
        continued = self.expansion is not None
        if continued and turn is not None and self._any_curved:  # turning changes the terminator
            self._weigh_terminator(self._trace_visibility(_middle(sample_times), interval))
        found = visibility(sample_times, self.expansion or self._refine(_middle(sample_times), interval, True))
        seen = np.any([each.level > 0 for each in found.visible], axis=0)
        if turn is None and not (seen & (self.level == 0)).any():  # else out of range or of sight so far
            return found
        turn = turn or 0
        if self._measure(found, turn) <= 1.5 * max(self._rtol, self._error):
            return found
        self.expansion = None
        again = visibility(found.sample_times, self._refine(_middle(found.sample_times), interval, continued))
        self._measure(again, turn)
        return again._replace(discarded=[*found.discarded, *again.discarded])

    def verify_again(self) -> None:
        """Discard the verification of the shadow-boundary correction."""
        self.level, self.cancellation = self.level / self._lowered, self.cancellation * self._lowered
        self._lowered = np.ones(len(self.per_element))
        self.per_element[:] = False
        self._verified_at[:], self._correction_scale[:], self._correction_offset[:] = 0.0, 1.0, 0.0

    def unverified(
        self, visibility: IntervalVisibility, shadowed_surfaces: Callable[[NDArray[np.bool_]], NDArray[np.bool_]]
    ) -> NDArray[np.bool_]:
        """(surface,) whether the shadow-boundary correction needs verification.

        `shadowed_surfaces` tests some surfaces (surface,) for shadow boundaries that only some elements see. Surfaces
        without any boundary and flat ones are tested, unless slabs transmit.
        """
        estimate = self._correction_error(visibility)
        least = np.where(self._curved, CURVED_UNVERIFIED_PER_RTOL, UNVERIFIED_PER_RTOL) * self._rtol
        unverified = (estimate > least) & (estimate > REVERIFY_GROWTH * self._verified_at)
        unshadowed = ~unverified & (~self._curved | (estimate == 0)) & ~self._static & ~self.per_element
        if unshadowed.any() and not self._indirect.through_slabs:
            unverified |= shadowed_surfaces(unshadowed)
        # Verification of static surfaces would take too long.
        unverified &= ~self.per_element & ~self._static
        return np.asarray(
            np.isin(self._tolerance_group, self._tolerance_group[unverified]) & ~self._near_slabs(visibility.visible)
        )

    def exclude_slabs(self, visible: Sequence[VisibleFacets]) -> None:
        """Exclude surfaces next to transmitting slabs from per-element visibility, which does not account for slabs."""
        self.per_element &= ~self._near_slabs(visible)

    def _near_slabs(self, visible: Sequence[VisibleFacets]) -> NDArray[np.bool_]:
        """(surface,) whether shadows of transmitting slabs fall on the surface's tolerance group."""
        through = np.concatenate([each.slab_shadowed_surfaces() for each in visible])
        return np.asarray(np.isin(self._tolerance_group, self._tolerance_group[through]))

    def verify_correction(
        self, unverified: NDArray[np.bool_], off: FloatArray, level: FloatArray, visibility: IntervalVisibility
    ) -> None:
        """Record the measured error of the shadow-boundary correction, `off` (surface,), an amplitude, of the
        `unverified` surfaces (surface,). `level` (surface,), the largest return of the pairs, replaces the reference
        level where it is larger; of flat surfaces also where it is smaller, as these return mostly from visible pieces.
        """
        anew = unverified & (level > 0) & (~self._curved | (level > self.level))
        lowered = np.where(anew & (self.level > 0), level / np.where(self.level > 0, self.level, 1.0), 1.0)
        self._lowered, self.cancellation = self._lowered * lowered, self.cancellation / lowered
        self.level = np.where(anew, level, self.level)
        off = off / np.where(self.level > 0, self.level, np.inf)
        estimate = self._correction_error(visibility)
        self.per_element |= unverified & (off > PER_ELEMENT_PER_RTOL * self._rtol)
        self._verified_at = np.where(unverified, estimate, self._verified_at)
        # A factor is meaningless where the phase centre hardly sees the boundary.
        significant = estimate > np.where(self._curved, CURVED_UNVERIFIED_PER_RTOL, UNVERIFIED_PER_RTOL) * self._rtol
        scale = np.where(significant, CORRECTION_SAFETY * off / np.where(significant, estimate, 1.0), 1.0)
        self._correction_scale = np.where(unverified, scale, self._correction_scale)
        offset = np.where(significant, 0.0, CORRECTION_SAFETY * off)
        self._correction_offset = np.where(unverified, offset, self._correction_offset)

    def _correction_error(self, visibility: IntervalVisibility) -> FloatArray:
        """(surface,) estimated error of the shadow-boundary correction."""
        return np.asarray(SAFETY * np.maximum(self.cancellation, 1.0) * visibility.sampled_returns.missed)

    def error(self, visibility: IntervalVisibility, cancellation: FloatArray) -> float:
        """Estimated error of the worst surface's direct return: integration and uncertain shadows, by the
        `cancellation` (surface,)."""
        cancellation = np.where(cancellation > 0, cancellation, 1.0)  # unknown while occluded
        returned = np.stack([each.level for each in visibility.visible])
        missed = np.stack([each.missed for each in visibility.visible])
        edges = relative_to_largest(missed, returned, returned.max(axis=0))
        correction = SAFETY * np.maximum(cancellation, 1.0) * self._correction_scale * visibility.sampled_returns.missed
        correction = np.maximum(correction, np.where(self.per_element, 0.0, self._correction_offset))
        shadows = np.hypot(SAFETY * cancellation * edges, correction)
        return float(np.linalg.norm([max(self._last, self._error), self._terminator_error, shadows.max(initial=0.0)]))

    def _refine(self, t: float, interval: TraceInterval, afresh: bool) -> Expansion:
        """Choose expansion, facets and terminators for the error at `t`; `afresh` starts from the coarsest facets."""
        self.verify_again()
        expansion, visible = self._refined(t, interval, afresh)
        self._weigh_terminator(visible)
        return expansion

    def _weigh_terminator(self, visible: VisibleFacets) -> None:
        """Find the surfaces whose terminator counts, and the error of the others."""
        missed = self._missed_at_terminator(visible)
        self.terminator = missed > (FINE_TERMINATOR_PER_RTOL if self._fine else TERMINATOR_PER_RTOL) * self._rtol
        left = 0.0 if self._fine else UNCUT_SHARE
        self._terminator_error = float((missed * np.where(self.terminator, left, 1.0)).max(initial=0.0))

    def _refined(self, t: float, interval: TraceInterval, afresh: bool) -> tuple[Expansion, VisibleFacets]:
        """Expansion and facets for the tolerance at `t`, and the visibility of these."""
        facets: list[float] = []
        whole: list[float] = []
        self._last, vertices = 0.0, interval.positions(t)
        if afresh:
            self._facets.coarsen(vertices)
        while True:
            refined, visible = self._refined_returns(t, interval)
            error = self._record([refined.of_facets(self.level)[0]])
            facets.append(self._error)
            # Refinement stops where the error hardly falls; it may rise once, with the number of parts.
            last = len(facets) == MAX_ROUNDS or (len(facets) > 2 and min(facets[-2:]) > 0.7 * facets[-3])
            # The expansion is chosen once the facets are fine enough.
            if not last and self._facets.refine(error, vertices):
                continue
            expansion, error = self._expanded(refined)
            if not (error > self._rtol).any():
                return expansion, visible
            whole.append(self._error)
            # An error that finer facets hardly reduce is that of the expansion.
            discarded = len(whole) > 1 and whole[-1] > 0.7 * whole[-2]
            if last or discarded or not self._facets.refine(error, vertices):
                break
        worst = int(np.argmax(error))
        alone = np.count_nonzero(self._tolerance_group == self._tolerance_group[worst]) == 1
        whose = f"'{self._surfaces.moving[worst].name}'" if alone else "the static scene"
        _LOG.warning("the return of %s has a relative error of %.2g (rtol: %g)", whose, error[worst], self._rtol)
        return expansion, visible

    def _refined_returns(self, t: float, interval: TraceInterval) -> tuple[RefinedReturns, VisibleFacets]:
        """Returns at `t` [s] with finer facets for comparison, of the first pair, and the visibility."""
        visible = self._trace_visibility(t, interval)
        share = self._indirect.weights(
            lambda: interval.rays(t), interval.positions(t), visible.facets, visible.fraction
        )
        selected = np.flatnonzero(share > 0)
        facets = visible.facets.with_pattern_gradient(self._band.pattern_gradient(visible.facets, selected)).take(
            selected
        )
        weight = share[selected] * self._band.pattern_gain(facets.directions(self._band.viewpoint))
        reference = visible.facets.centroids[self._facets.clusters.cluster_head[selected]]
        return RefinedReturns.of(
            self._band, facets, self._materials, weight, reference=reference, tolerance_group=self._tolerance_group
        ), visible

    def _expanded(self, refined: RefinedReturns) -> tuple[Expansion, FloatArray]:
        """Expansion for the facets of `refined`, and the error (surface,) with it."""
        known = self._band, refined.facets, self._materials, refined.weight
        expansion = self._band.expansion_for(*known[1:], reference=refined.reference, apart=self._tolerance_group)
        values = self._band.values(refined.facets, self._materials, expansion, refined.reference)
        gains = self._band.combined(expansion, values)
        tx, rx = gains.shape[1:3]
        representative = {(tx // 2, rx // 2), (tx - 1, rx - 1)} - {refined.pair}
        others = [
            RefinedReturns.of(*known, pair, reference=refined.reference, tolerance_group=self._tolerance_group)
            for pair in sorted(representative)
        ]
        self.expansion = expansion
        return expansion, self._record(
            [each.of_expansion(gains[:, *each.pair], self.level) for each in [refined, *others]]
        )

    def _record(self, found: Sequence[ErrorEstimate]) -> FloatArray:
        """Error (surface,), the worst of `found`; updates level and cancellation."""
        error = np.max([each.error for each in found], axis=0)
        # A fading return demands no finer facets than elsewhere.
        self.level = np.max([self.level, *(each.level for each in found)], axis=0)
        self.cancellation = np.max([each.cancellation for each in found], axis=0)
        self._error = float(error.max(initial=0.0))
        return np.asarray(error)

    def _measure(self, visibility: IntervalVisibility, turn: int) -> float:
        """Error of the worst surface for one pair, another one each `turn`; over the band, as fading at one frequency
        distorts it."""
        middle, own = len(visibility.sample_times) // 2, visibility.returned
        gains = self._band.combined(visibility.expansion, visibility.sampled_returns.whole[middle])
        weight = visibility.visible[middle].fraction[own.selected] * visibility.visible[middle].weight[own.selected]
        if (outward := own.facets[middle].outward) is not None:
            weight = weight * ~outward  # handled at the terminator
        pair = (turn % gains.shape[1], (turn // gains.shape[1]) % gains.shape[2])
        given = self._materials, weight, pair, PROBES, visibility.references[middle], self._tolerance_group
        refined = RefinedReturns.of(self._band, own.facets[middle], *given)
        self._last = float(refined.of_expansion(gains[:, *pair], self.level).error.max(initial=0.0))
        return self._last

    def to_terminator(self, visible: VisibleFacets, everywhere: bool = False) -> VisibleFacets:
        """Add facets that face away but show up to the terminator: of surfaces in `terminator`, or `everywhere`."""
        if not (everywhere or self.terminator.any()):
            return visible
        known = self._band.viewpoint, self._band.reach
        near = near_terminator(visible.facets, *known) & (everywhere | self.terminator[visible.facets.surface])
        chosen = np.flatnonzero(near)
        terminator = Terminator.of(visible.facets, chosen, *known)
        any_visible = unoccluded_by_neighbours(
            chosen, terminator.before, visible.weight > 0, visible.fraction, self._facets.places
        )
        chosen, terminator, outward = chosen[any_visible], terminator.take(any_visible), np.zeros(len(near), np.bool_)
        fraction, weight = visible.fraction.copy(), visible.weight.copy()
        outward[chosen], fraction[chosen] = True, 1.0
        weight[chosen] = self._band.pattern_gain(visible.facets.directions(self._band.viewpoint, chosen))
        if not (self._fine or everywhere):
            return replace(visible, facets=visible.facets.with_outward(outward), fraction=fraction, weight=weight)
        owner = np.concatenate([visible.owner, chosen[terminator.owner]])
        order = np.argsort(owner, kind="stable")
        no_edge = np.full((len(terminator.owner), visible.occluder.shape[1]), np.nan)
        return replace(
            visible,
            facets=visible.facets.with_outward(outward),
            fraction=fraction,
            weight=weight,
            owner=owner[order],
            pieces=np.concatenate([visible.pieces, terminator.pieces])[order],
            occluder=np.concatenate([visible.occluder, no_edge])[order],
        )

    def _missed_at_terminator(self, visible: VisibleFacets) -> FloatArray:
        """(surface,) estimated error without facets beyond the terminator."""
        whole, count = self.to_terminator(visible, True), len(self._materials)
        terminator = np.flatnonzero(~visible.facets.facing & (whole.weight > 0))
        if not len(terminator):
            return np.zeros(count)
        facets, cut = whole.facets.with_pattern_gradient(None).take(terminator), np.isin(whole.owner, terminator)
        owner = np.searchsorted(terminator, whole.owner[cut])
        entire = np.setdiff1d(np.arange(len(terminator)), owner)
        pieces = np.concatenate([whole.pieces[cut], np.broadcast_to(np.eye(3), (len(entire), 3, 3))])
        owner = np.concatenate([owner, entire])
        facets = facets.cut(owner, pieces)
        found = self._band.at_probes(facets, self._materials, PROBES, (0, 0), facets.parts)
        waves = found.a * phasors(self._band.frequency(PROBES)[:, None] * found.tau) * whole.weight[terminator[owner]]
        tolerance_group = self._tolerance_group[facets.surface]
        together = np.abs(sum_by_surface(waves, tolerance_group, count))
        apart = np.sqrt([np.bincount(tolerance_group, each, count) for each in np.abs(waves) ** 2])
        missed = SAFETY * np.sqrt((np.maximum(together, apart) ** 2).mean(axis=0))[self._tolerance_group]
        return np.asarray(missed / np.where(self.level > 0, self.level, np.inf))


def _middle(sample_times: FloatArray) -> float:
    return float(sample_times[len(sample_times) // 2])
