"""Facets and an expansion so fine that what moves returns directly is as accurate as the tolerance asks for."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.tracing.gains.accuracy import SAFETY, Accuracy, Finer
from rfgen_sionna.tracing.gains.band import BandTracer, Expansion
from rfgen_sionna.tracing.gains.probes import PROBES
from rfgen_sionna.tracing.integral.phasors import phasors
from rfgen_sionna.tracing.moving.facets import MovingFacets
from rfgen_sionna.tracing.moving.faint import LEAST_RTOL
from rfgen_sionna.tracing.moving.further import FurtherWays
from rfgen_sionna.tracing.moving.returns import relative_to_best
from rfgen_sionna.tracing.moving.stretch import Look, Stretch
from rfgen_sionna.tracing.moving.views import Seen
from rfgen_sionna.tracing.shadows.horizon import Horizon, near_the_horizon, seen_beside
from rfgen_sionna.tracing.surface.facets import sums
from rfgen_sionna.tracing.surface.surfaces import Surfaces, lots

RIM_PER_RTOL, FINE_RIM_PER_RTOL = 1.5, 0.3
"""What rims may come to, per unit of the tolerance, before they are traced; the second below `LEAST_RTOL`, where facets
are cut at the horizon. Those of a person come to about the default tolerance, and take a tenth of a frame."""
UNCUT = 0.3
"""Share of what rims return that is told wrong of facets that are not cut there, as strengths have a kink on them."""
DOUBTFUL_PER_RTOL, BENT_DOUBTFUL_PER_RTOL, OWN_PER_RTOL = 0.1, 1.0, 1.0
"""What strips beside shadows' edges may miss by an estimate, per unit of the tolerance, before they are held against
what pairs see from their own places, of flat surfaces and of bent ones, where the estimate is right to a factor of two;
and what they may then be off by before that counts."""
RISEN, HELD = 2.0, 2.0
"""By what factor the estimate may rise before they are held against it anew, and what they are off by at other times
and for other pairs, over what was found."""
MAX_ROUNDS = 5
"""How often facets are made finer for one stretch, before the tolerance is given up with a warning."""
_LOG = logging.getLogger(__name__)


class Precision:
    """Chooses facets and expansion, and says what the direct return of `surfaces` errs by.

    What is chosen is kept until the error is found to be above the tolerance; `see` tells what is seen directly at a
    time [s] of a stretch, `further` what by other ways.
    """

    def __init__(
        self,
        surfaces: Surfaces,
        band: BandTracer,
        rtol: float,
        facets: MovingFacets,
        further: FurtherWays,
        see: Callable[[float, Stretch], Seen],
    ) -> None:
        self._surfaces, self._band, self._rtol = surfaces, band, rtol
        self._facets, self._further, self._see = facets, further, see
        self._materials = tuple(surface.material for surface in surfaces.moving)
        self._lot = lots(surfaces.moving)
        self.forget()
        self.interference = np.zeros(len(surfaces.moving))
        """(surface,) :attr:`rfgen_sionna.tracing.gains.accuracy.Accuracy.interference` of each, 0 where nobody
        knows."""
        self.rims = np.zeros(len(surfaces.moving), np.bool_)
        """(surface,) of which counts what facets show before the horizon that look away themselves."""
        self.own = np.zeros(len(surfaces.moving), np.bool_)
        """(surface,) of which counts what each pair sees from its own places."""
        self._still = np.array([each.still for each in surfaces.moving], np.bool_)
        self._held_at, self._told, self._off = np.zeros((3, len(surfaces.moving)))
        self.ask_again()
        self._bent = np.array([each.smooth is not None for each in surfaces.moving], np.bool_)
        self._fine, self._round = rtol < LEAST_RTOL, bool(self._bent.any())
        self._error = self._last = self._rim = 0.0

    def forget(self) -> None:
        """Choose all anew: facets are other ones."""
        self.expansion: Expansion | None = None
        """The one in use, if any is."""
        self.level = np.zeros(len(self._surfaces.moving))
        """(surface,) return of each, the largest that was met, or what pairs see of it where they were asked."""
        self._lowered = np.ones(len(self._surfaces.moving))

    def ensure(
        self, instants: FloatArray, stretch: Stretch, look: Callable[[FloatArray, Expansion], Look], turn: int | None
    ) -> Look:
        """What a `look` at the `instants` [s] of a stretch tells by an expansion that is fine enough, of facets that
        are: those of earlier stretches, where nothing says that they are not. That is measured where there is a `turn`,
        which says for what pair."""
        kept_on = self.expansion is not None
        if kept_on and turn is not None and self._round:  # a thing that turns may show more of its rim
            self._weigh_rims(self._see(_middle(instants), stretch))
        found = look(instants, self.expansion or self._refine(_middle(instants), stretch, True))
        if turn is None or self._measured(found, turn) <= 1.5 * max(self._rtol, self._error):
            return found
        self.expansion = None
        # What was just chosen, from the coarsest on, goes on from where it is.
        again = look(found.instants, self._refine(_middle(found.instants), stretch, kept_on))
        self._measured(again, turn)
        return again._replace(in_vain=[*found.in_vain, *again.in_vain])

    def ask_again(self) -> None:
        """Forget of which surfaces own places count: strips are held against them anew."""
        self.level, self.interference = self.level / self._lowered, self.interference * self._lowered
        self._lowered = np.ones(len(self.own))
        self.own[:] = False
        self._held_at[:], self._told[:], self._off[:] = 0.0, 1.0, 0.0

    def doubtful(self, look: Look, fallen_on: Callable[[NDArray[np.bool_]], NDArray[np.bool_]]) -> NDArray[np.bool_]:
        """(surface,) of which nobody knows whether strips beside shadows' edges tell what pairs see. `fallen_on` says
        on which of some surfaces (surface,) edges fall that the phase centre may not see, of which strips don't tell:
        it is asked of what has none at all, and of what is flat, where no slabs are seen through."""
        estimate = self._strips(look)
        asked = (
            (estimate > np.where(self._bent, BENT_DOUBTFUL_PER_RTOL, DOUBTFUL_PER_RTOL) * self._rtol)
            & (estimate > RISEN * self._held_at)
        )  # fmt: skip
        silent = ~asked & (~self._bent | (estimate == 0)) & ~self._still & ~self.own
        if silent.any() and not self._further.through_slabs:  # which rays from own places don't go through
            asked |= fallen_on(silent)
        # Of furniture there is not the time to hold them against anything.
        asked &= ~self.own & ~self._still
        return np.asarray(np.isin(self._lot, self._lot[asked]) & ~self._beside_slabs(look.seen))

    def leave_slabs(self, seen: Sequence[Seen]) -> None:
        """Let own places not count of surfaces beside slabs that are seen through: strips are all there is then."""
        self.own &= ~self._beside_slabs(seen)

    def _beside_slabs(self, seen: Sequence[Seen]) -> NDArray[np.bool_]:
        """(surface,) on whose lot shadows fall that let something through."""
        through = np.concatenate([each.through() for each in seen])
        return np.asarray(np.isin(self._lot, self._lot[through]))

    def hold_strips(self, doubtful: NDArray[np.bool_], off: FloatArray, level: FloatArray, look: Look) -> None:
        """Take what strips of `doubtful` surfaces are `off` by (surface,), as an amplitude, for what they are. Pairs
        have returns of a `level` (surface,), which may be far above what is known of the first pair: then that is what
        errors are relative to from now on. Of flat ones, of which mostly pieces return, it may be far below what shares
        of whole facets come to as well."""
        anew = doubtful & (level > 0) & (~self._bent | (level > self.level))
        lowered = np.where(anew & (self.level > 0), level / np.where(self.level > 0, self.level, 1.0), 1.0)
        self._lowered, self.interference = self._lowered * lowered, self.interference / lowered
        self.level = np.where(anew, level, self.level)
        off = off / np.where(self.level > 0, self.level, np.inf)
        estimate = self._strips(look)
        self.own |= doubtful & (off > OWN_PER_RTOL * self._rtol)
        self._held_at = np.where(doubtful, estimate, self._held_at)
        # Beside edges that the phase centre hardly sees there are no strips that a factor would tell of.
        tells = estimate > np.where(self._bent, BENT_DOUBTFUL_PER_RTOL, DOUBTFUL_PER_RTOL) * self._rtol
        told = np.where(tells, HELD * off / np.where(tells, estimate, 1.0), 1.0)
        self._told = np.where(doubtful, told, self._told)
        self._off = np.where(doubtful, np.where(tells, 0.0, HELD * off), self._off)

    def _strips(self, look: Look) -> FloatArray:
        """(surface,) estimated error of strips."""
        return np.asarray(SAFETY * np.maximum(self.interference, 1.0) * look.lit.missed)

    def error(self, look: Look, interference: FloatArray) -> float:
        """Estimated error of the direct return of the worst surface: that of integrals, and of what is not known of
        shadows, by the `interference` (surface,) of each."""
        interference = np.where(interference > 0, interference, 1.0)  # of what was hidden nobody knows
        returned = np.stack([each.level for each in look.seen])
        edges = relative_to_best(np.stack([each.missed for each in look.seen]), returned, returned.max(axis=0))
        strips = SAFETY * np.maximum(interference, 1.0) * self._told * look.lit.missed
        strips = np.maximum(strips, np.where(self.own, 0.0, self._off))
        shadows = np.hypot(SAFETY * interference * edges, strips)
        return float(np.linalg.norm([max(self._last, self._error), self._rim, shadows.max(initial=0.0)]))

    def _refine(self, t: float, stretch: Stretch, afresh: bool) -> Expansion:
        """Choose the expansion, and facets so fine that the error at `t` is allowed, and whether rims count.

        `afresh`, it begins with the coarsest ones: what another pose has asked for this one need not.
        """
        self.ask_again()  # what returns are is told anew
        expansion, seen = self._refined(t, stretch, afresh)
        self._weigh_rims(seen)
        return expansion

    def _weigh_rims(self, seen: Seen) -> None:
        """Tell of which surfaces rims count, and what the others' come to, by what is `seen` without."""
        rim = self._missed_at_rims(seen)
        self.rims = rim > (FINE_RIM_PER_RTOL if self._fine else RIM_PER_RTOL) * self._rtol
        left = 0.0 if self._fine else UNCUT
        self._rim = float((rim * np.where(self.rims, left, 1.0)).max(initial=0.0))

    def _refined(self, t: float, stretch: Stretch, afresh: bool) -> tuple[Expansion, Seen]:
        """Expansion and facets, and what is seen of these at `t`."""
        facets: list[float] = []
        whole: list[float] = []
        self._last, vertices = 0.0, stretch.positions(t)
        if afresh:
            self._facets.coarsen(vertices)
        while True:
            held, seen = self._held(t, stretch)
            error = self._noted([held.of_facets(self.level)[0]])
            facets.append(self._error)
            # More of the same is no use where the error hardly falls; from one number of parts to the next it may rise.
            last = len(facets) == MAX_ROUNDS or (len(facets) > 2 and min(facets[-2:]) > 0.7 * facets[-3])
            # Facets that are too coarse by themselves need no expansion to tell it by.
            if not last and self._facets.refine(error, vertices):
                continue
            expansion, error = self._expanded(held)
            if not (error > self._rtol).any():
                return expansion, seen
            whole.append(self._error)
            # What finer facets have hardly mended once is the expansion's own.
            in_vain = len(whole) > 1 and whole[-1] > 0.7 * whole[-2]
            if last or in_vain or not self._facets.refine(error, vertices):
                break
        worst = int(np.argmax(error))
        alone = np.count_nonzero(self._lot == self._lot[worst]) == 1
        whose = f"'{self._surfaces.moving[worst].name}'" if alone else "all that stays"
        _LOG.warning("the return of %s is right to %.2g of itself (rtol: %g)", whose, error[worst], self._rtol)
        return expansion, seen

    def _held(self, t: float, stretch: Stretch) -> tuple[Finer, Seen]:
        """What is seen at `t` [s], with finer facets to compare it with, for the first pair; and that."""
        seen = self._see(t, stretch)
        share = self._further.weights(lambda: stretch.rays(t), stretch.positions(t), seen.facets, seen.fraction)
        kept = np.flatnonzero(share > 0)
        facets = seen.facets.pulled(self._band.pull(seen.facets, kept)).take(kept)
        weight = share[kept] * self._band.importance(facets.directions(self._band.viewpoint))
        reference = seen.facets.centroids[self._facets.patches.leader[kept]]
        return Finer.of(self._band, facets, self._materials, weight, reference=reference, lot=self._lot), seen

    def _expanded(self, held: Finer) -> tuple[Expansion, FloatArray]:
        """The expansion that the facets `held` ask for, and the error (surface,) of each surface with it."""
        known = self._band, held.facets, self._materials, held.weight
        expansion = self._band.expansion_for(*known[1:], reference=held.reference, apart=self._lot)
        values = self._band.values(held.facets, self._materials, expansion, held.reference)
        gains = self._band.combined(expansion, values)
        telling = {(gains.shape[1] // 2, gains.shape[2] // 2), (gains.shape[1] - 1, gains.shape[2] - 1)} - {held.pair}
        others = [Finer.of(*known, pair, reference=held.reference, lot=self._lot) for pair in sorted(telling)]
        self.expansion = expansion
        return expansion, self._noted([each.of_expansion(gains[:, *each.pair], self.level) for each in [held, *others]])

    def _noted(self, found: Sequence[Accuracy]) -> FloatArray:
        """The error (surface,) of each surface, the worst of those `found`; they are kept in mind."""
        error = np.max([each.error for each in found], axis=0)
        # Where the return fades no facets are asked for that it does not need elsewhere.
        self.level = np.max([self.level, *(each.level for each in found)], axis=0)
        self.interference = np.max([each.interference for each in found], axis=0)
        self._error = float(error.max(initial=0.0))
        return np.asarray(error)

    def _measured(self, look: Look, turn: int) -> float:
        """Error of the worst surface for one pair, another one from turn to turn. Over the band: where the return fades
        at one place of it, the error there tells little."""
        middle, own = len(look.instants) // 2, look.returned
        gains = self._band.combined(look.expansion, look.lit.whole[middle])
        weight = look.seen[middle].fraction[own.kept] * look.seen[middle].weight[own.kept]
        if (outward := own.facets[middle].outward) is not None:
            weight = weight * ~outward  # their kink is at the horizon, where they are cut, or told of by themselves
        pair = (turn % gains.shape[1], (turn // gains.shape[1]) % gains.shape[2])
        given = self._materials, weight, pair, PROBES, look.references[middle], self._lot
        held = Finer.of(self._band, own.facets[middle], *given)
        self._last = float(held.of_expansion(gains[:, *pair], self.level).error.max(initial=0.0))
        return self._last

    def to_the_horizon(self, seen: Seen, everywhere: bool = False) -> Seen:
        """What is `seen`, and what facets that look away still show before the horizon: those of surfaces whose
        :attr:`rims` count, or `everywhere`."""
        if not (everywhere or self.rims.any()):
            return seen
        known = self._band.viewpoint, self._band.reach
        near = near_the_horizon(seen.facets, *known) & (everywhere | self.rims[seen.facets.surface])
        chosen = np.flatnonzero(near)
        horizon = Horizon.of(seen.facets, chosen, *known)
        shown = seen_beside(chosen, horizon.before, seen.weight > 0, seen.fraction, self._facets.places)
        chosen, horizon, outward = chosen[shown], horizon.take(shown), np.zeros(len(near), np.bool_)
        fraction, weight = seen.fraction.copy(), seen.weight.copy()
        outward[chosen], fraction[chosen] = True, 1.0
        weight[chosen] = self._band.importance(seen.facets.directions(self._band.viewpoint, chosen))
        if not (self._fine or everywhere):
            return replace(seen, facets=seen.facets.round_the_rim(outward), fraction=fraction, weight=weight)
        owner = np.concatenate([seen.owner, chosen[horizon.owner]])
        order = np.argsort(owner, kind="stable")
        no_edge = np.full((len(horizon.owner), seen.hider.shape[1]), np.nan)
        return replace(
            seen,
            facets=seen.facets.round_the_rim(outward),
            fraction=fraction,
            weight=weight,
            owner=owner[order],
            pieces=np.concatenate([seen.pieces, horizon.pieces])[order],
            hider=np.concatenate([seen.hider, no_edge])[order],
        )

    def _missed_at_rims(self, seen: Seen) -> FloatArray:
        """(surface,) estimated error of each return where what facets show that look away is left out."""
        whole, count = self.to_the_horizon(seen, True), len(self._materials)
        rims = np.flatnonzero(~seen.facets.facing & (whole.weight > 0))
        if not len(rims):
            return np.zeros(count)
        facets, cut = whole.facets.pulled(None).take(rims), np.isin(whole.owner, rims)
        owner = np.searchsorted(rims, whole.owner[cut])
        entire = np.setdiff1d(np.arange(len(rims)), owner)
        pieces = np.concatenate([whole.pieces[cut], np.broadcast_to(np.eye(3), (len(entire), 3, 3))])
        owner = np.concatenate([owner, entire])
        facets = facets.cut(owner, pieces)
        found = self._band.at_probes(facets, self._materials, PROBES, (0, 0), facets.parts)
        waves = found.a * phasors(self._band.frequency(PROBES)[:, None] * found.tau) * whole.weight[rims[owner]]
        lot = self._lot[facets.surface]
        together = np.abs(sums(waves, lot, count))
        apart = np.sqrt([np.bincount(lot, each, count) for each in np.abs(waves) ** 2])
        missed = SAFETY * np.sqrt((np.maximum(together, apart) ** 2).mean(axis=0))[self._lot]
        return np.asarray(missed / np.where(self.level > 0, self.level, np.inf))


def _middle(instants: FloatArray) -> float:
    return float(instants[len(instants) // 2])
