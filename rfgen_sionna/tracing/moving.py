"""What moves: its paths, whose facets are kept fine enough from one stretch of time to the next."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.records import SPEED_OF_LIGHT, ComplexArray, FloatArray, RadarPaths
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.accuracy import SAFETY, Accuracy, Finer
from rfgen_sionna.tracing.bounces import Bounced, Bounces
from rfgen_sionna.tracing.facets import RATE_STEP, Facets, facet_paths, over_time
from rfgen_sionna.tracing.fading import when_seen_best
from rfgen_sionna.tracing.faint import LEAST_RTOL
from rfgen_sionna.tracing.gains import PROBES, BandTracer, Expansion
from rfgen_sionna.tracing.ghosts import Ghosts, GhostView
from rfgen_sionna.tracing.glances import BETWEEN_PER_RTOL, Followed, Glances, fine_times, moved
from rfgen_sionna.tracing.knots import Splined
from rfgen_sionna.tracing.moving_facets import MovingFacets, Positions
from rfgen_sionna.tracing.outlines import Passing
from rfgen_sionna.tracing.phasors import phasors
from rfgen_sionna.tracing.returns import FacetReturns, relative_to_best
from rfgen_sionna.tracing.round_bounces import RoundBounces, RoundSeen
from rfgen_sionna.tracing.sight import Seen, Sight
from rfgen_sionna.tracing.slab_edges import SlabEdges
from rfgen_sionna.tracing.surfaces import Surfaces, lots
from rfgen_sionna.tracing.veils import Veiled, Veils

MAX_ROUNDS = 5
"""How often facets are made finer for one stretch, before the tolerance is given up with a warning."""
MEASURED_EVERY = 5
"""The error is measured once in so many stretches, as it changes with what the body does rather than from one to the
next and takes about as long to know as all else."""
PAIR, UNSTEADY = 2, 4
"""The fewest instants of a stretch, and in how many stretches no pair is tried after one in which shadows moved."""
USUAL = 1.5
"""What people's facets return without interfering, over what they return: 0.5 to 3, mostly less than this."""
_LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class MovingTrace:
    """The moving surfaces over a stretch of time."""

    paths: RadarPaths
    glanced: RadarPaths | None
    """Direct returns of facets that were looked at between instants, at their own knots; None where there are none."""
    error: float
    """Estimated relative error of the return of the worst of them; see :mod:`rfgen_sionna.tracing.accuracy`."""
    between: float
    """Estimated relative error between knots of the direct return of the worst of them, for shadows that move on; see
    :mod:`rfgen_sionna.tracing.glances`."""
    facets: int
    """Facets looked at."""
    rays: int
    places: Callable[[float], FloatArray]
    """Time [s] to the (path, 3) middles [m] of the facets that the first paths, the direct returns, go by. It holds
    until the next stretch is traced."""
    glanced_places: Callable[[float], FloatArray]
    """The same of `glanced`."""
    instants: FloatArray
    """(instant,) at which gains were traced [s]."""


class MovingParts:
    """Traces the moving surfaces stretch by stretch, and where there may be any their `ghosts` in walls, what
    `bounces` from one flat part or body to the other, plainly and through slabs, `rounds` from bent surface to bent
    surface, and what is seen through slabs, behind `veils`.

    Facets stay the same until the motion asks for finer ones (:mod:`rfgen_sionna.tracing.moving_facets`); small
    neighbouring ones make a path together (:mod:`rfgen_sionna.tracing.patches`). Their error is measured in every few
    stretches; where it is above the tolerance, facets and expansion are chosen anew. Not `aimed`, what is faint to the
    antennas (:mod:`rfgen_sionna.tracing.faint`) is traced as well.
    """

    def __init__(
        self,
        surfaces: Surfaces,
        band: BandTracer,
        viewpoint: FloatArray,
        max_range: float,
        rtol: float,
        ghosts: Ghosts | None = None,
        bounces: Sequence[Bounces] = (),
        rounds: RoundBounces | None = None,
        veils: Veils | None = None,
        aimed: bool = True,
    ) -> None:
        self._surfaces, self._band = surfaces, band
        self._viewpoint, self._max_range, self._rtol = viewpoint, max_range, rtol
        self._ghosts, self._bounces, self._veils, self._aimed = ghosts, tuple(bounces), veils, aimed
        self._rounds = rounds
        self._slab_edges = None if veils is None else SlabEdges(veils, band)
        self._materials = tuple(surface.material for surface in surfaces.moving)
        self._lot = lots(surfaces.moving)
        self._alone = np.bincount(self._lot, minlength=len(self._lot))[self._lot] == 1
        self._sight = Sight(surfaces, band, viewpoint, max_range, rtol)
        self._returns = FacetReturns(band, self._materials, self._lot)
        self._glances = Glances(band, self._sight, self._returns, viewpoint, max_range, rtol, self._lot)
        kept = surfaces.moving, band, viewpoint, max_range, rtol, ghosts
        self._facets = MovingFacets(*kept, self._sight.look_for)
        self._expansion: Expansion | None = None
        self._level = np.zeros(len(surfaces.moving))
        self._interference = np.zeros(len(surfaces.moving))
        self._cancelling = np.zeros(len(surfaces.moving))
        self._error = self._last = 0.0
        self._turn = self._unsteady = 0

    def trace(
        self,
        knots: FloatArray,
        instants: FloatArray,
        positions: Positions,
        rays: Callable[[float], RayScene],
        ray_scene: RayScene,
    ) -> MovingTrace:
        """Paths with delays at `knots` and gains traced at `instants` [s]; where shadows move, two of them are not
        enough. `rays` gives the `ray_scene` as it is at an instant."""
        self._unsteady -= 1
        if len(instants) == PAIR and self._unsteady > 0:
            instants = _three(instants)
        middle, steady = len(instants) // 2, 0.0
        ghosts = self._ghosts if self._ghosts is not None and self._ghosts.active else None
        bounces = [each for each in self._bounces if each.follow(positions, knots[0])]
        if self._facets.follow(positions, knots):
            self._expansion, self._level = None, np.zeros(len(self._level))
        self._facets.turn_to([positions(float(instants[each])) for each in sorted({0, middle, len(instants) - 1})])
        in_vain: list[Seen] = []
        kept_on = self._expansion is not None  # facets and expansion of earlier stretches
        for attempt in range(2):
            afresh = attempt == 0 or kept_on
            expansion = self._expansion or self._refine(float(instants[middle]), positions, rays, ray_scene, afresh)
            seen = self._see(instants.tolist(), positions, ray_scene)
            if len(instants) == PAIR:
                steady = self._changed(*seen)
                if steady > BETWEEN_PER_RTOL * self._rtol:
                    instants, middle, steady, self._unsteady = _three(instants), 1, 0.0, UNSTEADY + 1
                    in_vain = seen
                    seen = self._see(instants.tolist(), positions, ray_scene)
            whole = [self._facets.from_all_sides(each.facets) if self.beside else each.facets for each in seen]
            mirrored: list[GhostView] = []
            bounced: list[list[Bounced]] = [[] for _ in bounces]
            rounded: list[RoundSeen] = []
            veiled: list[Veiled] = []
            for k, there in enumerate(seen if self.beside else ()):
                t, own = float(instants[k]), whole[k]
                shown_to = rays(t), own, there.fraction
                if ghosts is not None:  # now, as the ray scene stands at this time
                    mirrored.append(ghosts.see(*shown_to))
                for plates, shown in zip(bounces, bounced, strict=True):
                    shown.append(plates.see(t, *shown_to))
                if self._rounds is not None:
                    faces, everything = own.number[there.fraction > 0], self._everything(t, positions)
                    rounded.append(self._rounds.see(shown_to[0], everything, faces))
                if self._veils is not None:
                    veiled.append(self._veils.see(shown_to[0], self._everything(t, positions), *shown_to[1:]))
                if self._slab_edges is not None:
                    seen[k] = self._slab_edges.beside(shown_to[0], self._everything(t, positions), there)
            kept = np.flatnonzero(np.any([each.fraction > 0 for each in seen], axis=0))
            pull = self._band.pull(seen[0].facets, kept)
            seen = [replace(each, facets=each.facets.pulled(pull)) for each in seen]
            facets = Facets.taken([each.facets for each in seen], kept)
            leader = self._facets.patches.followed([each.facets.centroids for each in seen], kept)
            references = [np.take(each.facets.centroids, leader, axis=0) for each in seen]
            lit = self._returns.seen(seen, kept, facets, references, expansion)
            if self._turn % MEASURED_EVERY:
                break
            gains = self._band.combined(expansion, lit.whole[middle])
            weight = seen[middle].fraction[kept] * seen[middle].weight[kept]
            self._last = self._measure(facets[middle], weight, gains, references[middle])
            if self._last <= 1.5 * max(self._rtol, self._error) or attempt:
                break
            self._expansion = None
        values, parallax, shares = lit.values, lit.parallax, np.stack([each.fraction[kept] for each in seen], axis=-1)

        def waves(k: int) -> ComplexArray:
            gains = expansion.weights[0, 0, 0] @ values[k] * seen[k].weight[kept]
            return np.asarray(gains * phasors(self._band.centre * self._band.delays(references[k], (0, 0))))

        given = waves, shares, self._lot[facets[middle].surface], middle, self._level, self._interference
        level, interference = when_seen_best(*given)
        chosen = self._glances.choose(facets, references, values, parallax, shares, expansion, level)
        glanced, followed, between = None, kept[chosen.facets], max(chosen.error(), steady)
        looked: list[Seen | GhostView | Bounced | RoundSeen | Veiled | Followed] = [
            *seen,
            *in_vain,
            *mirrored,
            *chain(*bounced),
            *rounded,
            *veiled,
        ]
        if len(followed):
            placed = Splined(knots, positions)
            found = self._glances.follow(
                chosen, followed, self._facets.places[followed], instants, seen, expansion, placed,
                lambda t: self._facets.corners(placed(t), followed), ray_scene,
            )  # fmt: skip
            # As many knots as delays ask for, the times among them.
            often = fine_times(found.times, -(-(len(knots) - 1) // (len(found.times) - 1)))
            glanced = self._paths(often, found.times, placed, found.facets, found.coefficients, followed, {})
            between = found.error
            looked.append(found)
            rest = np.setdiff1d(np.arange(len(kept)), chosen.facets, assume_unique=True)
            kept, leader, shares = kept[rest], leader[rest], shares[rest]
            facets = Facets.taken(facets, rest)
            values = [np.take(each, rest, axis=1) for each in values]
            parallax = [None if each is None else each.within(rest) for each in parallax]
        pattern = [self._facets.patches.pattern(each, kept, leader) for each in seen]
        kept_on_paths = facets, shares, values, expansion, leader, parallax, pattern
        coefficients, led = self._returns.coefficients(*kept_on_paths)
        led_by, by_way = seen[0].facets.take(led), [np.take(each.facets.centroids, led, axis=0) for each in seen]
        self._cancelling = self._returns.cancelling(
            by_way, coefficients[0, 0, 0], led_by.surface, len(self._cancelling)
        )
        known = {t: each.facets.centroids for t, each in zip(instants.tolist(), seen, strict=True)}
        paths = self._paths(knots, instants, positions, led_by, coefficients, led, known)
        self._turn += 1
        interference = np.where(interference > 0, interference, 1.0)  # of what was hidden nobody knows
        returned = np.stack([each.level for each in seen])
        edges = relative_to_best(np.stack([each.missed for each in seen]), returned, returned.max(axis=0))
        shadows = SAFETY * interference * np.hypot(edges, lit.missed)
        error = float(np.hypot(max(self._last, self._error), shadows.max(initial=0.0)))

        def centroids(t: float, chosen: NDArray[np.intp]) -> FloatArray:
            return self._facets.centroids(positions(t), chosen)

        more: list[RadarPaths] = []
        if self._veils is not None:
            through, missed, _ = self._veils.trace(knots, instants, whole, veiled, centroids, self._level)
            more, error = [] if through is None else [through], error + missed
        if ghosts is not None:
            found_there, missed = ghosts.trace(knots, instants, whole, mirrored, centroids, self._level)
            more, error = more + found_there, error + missed
        for plates, shown in zip(bounces, bounced, strict=True):
            found_there, missed = plates.trace(knots, instants, whole, shown, centroids, self._level)
            more, error = more + found_there, error + missed
        if self._rounds is not None:
            around, missed = self._rounds.trace(knots, instants, rounded, positions, self._level)
            more, error = more if around is None else [*more, around], error + missed
        return MovingTrace(
            RadarPaths.concatenate([paths, *more]) if more else paths,
            glanced,
            error,
            between,
            sum(each.looked_at for each in looked),
            sum(each.rays for each in looked),
            lambda t: self._facets.centroids(positions(t), led),
            lambda t: self._facets.centroids(positions(t), followed),
            instants,
        )

    def _changed(self, first: Seen, last: Seen) -> float:
        """Error between two instants for shadows that move on, at most, of the worst surface."""
        wavenumber = 2 * np.pi * self._band.highest / SPEED_OF_LIGHT
        change = moved(first, last, self._viewpoint, wavenumber, self._lot)
        return float((0.5 * np.maximum(self._interference, 1.0) * change).max(initial=0.0))

    def passing(self, t: float) -> Passing:
        """Rays that just pass the outlines of what moves at one of the instants [s]."""
        return self._sight.passing(t)

    def consider(self, positions: Positions, times: Sequence[float]) -> Positions:
        """Choose the mirrors whose ghosts matter at `times` [s]; returns what delays are to follow in time."""
        ghosts = self._ghosts
        if ghosts is not None:
            ghosts.consider([positions(t) for t in times])
        mirrored = ghosts is not None and ghosts.active
        bounces = [each for each in self._bounces if each.follow(positions, times[0])]
        if not mirrored and not bounces:
            return positions

        def followed(t: float) -> list[FloatArray]:
            found = list(positions(t))
            if ghosts is not None and mirrored:
                found = ghosts.followed(found)
            return [*found, *(points for each in bounces for points in each.followed(positions(t)))]

        return followed

    @property
    def cancelled(self) -> FloatArray:
        """(surface,) how much larger errors of single facets are for all of a surface than for a body, whose facets
        return without order, as told in the stretch before: where a flat thing looks elsewhere they cancel nearly, and
        their errors don't."""
        return np.maximum(self._cancelling / USUAL, 1.0)

    @property
    def beside(self) -> bool:
        """Whether mirrors show what looks away from the radar, or slabs: the back of a hollow body."""
        return self._ghosts is not None or bool(self._bounces) or self._veils is not None

    def _refine(
        self,
        t: float,
        positions: Positions,
        rays: Callable[[float], RayScene],
        ray_scene: RayScene,
        afresh: bool,
    ) -> Expansion:
        """Choose the expansion, and facets so fine that the error at `t` is allowed.

        `afresh`, it begins with the coarsest ones: what another pose has asked for this one need not.
        """
        facets: list[float] = []
        whole: list[float] = []
        self._last = 0.0
        if afresh:
            self._facets.coarsen(positions(t))
        while True:
            held = self._held(t, positions, rays, ray_scene)
            error = self._noted([held.of_facets(self._level)[0]])
            facets.append(self._error)
            # More of the same is no use where the error hardly falls; from one number of parts to the next it may rise.
            last = len(facets) == MAX_ROUNDS or (len(facets) > 2 and min(facets[-2:]) > 0.7 * facets[-3])
            # Facets that are too coarse by themselves need no expansion to tell it by.
            if not last and self._facets.refine(error, positions(t)):
                continue
            expansion, error = self._expanded(held)
            if not (error > self._rtol).any():
                return expansion
            whole.append(self._error)
            # What finer facets have hardly mended once is the expansion's own.
            if last or (len(whole) > 1 and whole[-1] > 0.7 * whole[-2]) or not self._facets.refine(error, positions(t)):
                break
        worst = int(np.argmax(error))
        whose = f"'{self._surfaces.moving[worst].name}'" if self._alone[worst] else "all that stays"
        _LOG.warning("the return of %s is right to %.2g of itself (rtol: %g)", whose, error[worst], self._rtol)
        return expansion

    def _held(self, t: float, positions: Positions, rays: Callable[[float], RayScene], ray_scene: RayScene) -> Finer:
        """What is seen at `t` [s], with finer facets to compare it with, for the first pair."""
        (seen,) = self._see([t], positions, ray_scene)
        share = seen.fraction
        if self._veils is not None:  # as fine as what is seen through slabs asks for
            veiled = self._veils.see(rays(t), self._everything(t, positions), seen.facets, share)
            share = share + self._veils.weights(veiled, len(share))
        kept = np.flatnonzero(share > 0)
        facets, fraction = seen.facets.pulled(self._band.pull(seen.facets, kept)).take(kept), share[kept]
        weight, reference = self._weight(facets, fraction), seen.facets.centroids[self._facets.patches.leader[kept]]
        return Finer.of(self._band, facets, self._materials, weight, reference=reference, lot=self._lot)

    def _expanded(self, held: Finer) -> tuple[Expansion, FloatArray]:
        """The expansion that the facets `held` ask for, and the error (surface,) of each surface with it."""
        known = self._band, held.facets, self._materials, held.weight
        expansion = self._band.expansion_for(*known[1:], reference=held.reference, apart=self._lot)
        values = self._band.values(held.facets, self._materials, expansion, held.reference)
        gains = self._band.combined(expansion, values)
        telling = {(gains.shape[1] // 2, gains.shape[2] // 2), (gains.shape[1] - 1, gains.shape[2] - 1)} - {held.pair}
        others = [Finer.of(*known, pair, reference=held.reference, lot=self._lot) for pair in sorted(telling)]
        self._expansion = expansion
        return expansion, self._noted(
            [each.of_expansion(gains[:, *each.pair], self._level) for each in [held, *others]]
        )

    def _noted(self, found: Sequence[Accuracy]) -> FloatArray:
        """The error (surface,) of each surface, the worst of those `found`; they are kept in mind."""
        error = np.max([each.error for each in found], axis=0)
        # Where the return fades no facets are asked for that it does not need elsewhere.
        self._level = np.max([self._level, *(each.level for each in found)], axis=0)
        self._interference = np.max([each.interference for each in found], axis=0)
        self._error = float(error.max(initial=0.0))
        return np.asarray(error)

    def _see(self, times: Sequence[float], positions: Positions, ray_scene: RayScene) -> list[Seen]:
        vertices, everything = [positions(t) for t in times], self.beside
        facets = self._facets.at(vertices)
        if everything:
            facets = self._facets.bent(facets, vertices)
        # Of what was not seen before nobody knows how it interferes.
        known = (self._interference > 0) & (self._aimed and not everything and self._rtol >= LEAST_RTOL)
        share = np.where(known, 1.0 / np.maximum(self._interference, 1.0), 0.0)
        seen = self._sight(ray_scene, facets, self._facets.places, times, vertices, share)
        if everything:
            return seen
        kept = np.flatnonzero(np.any([each.fraction > 0 for each in seen], axis=0))
        facets = self._facets.bent([each.facets for each in seen], vertices, kept)
        return [replace(each, facets=own) for each, own in zip(seen, facets, strict=True)]

    def _everything(self, t: float, positions: Positions) -> list[FloatArray]:
        """(vertex, 3) positions [m] of all surfaces at `t` [s]."""
        return [*self._surfaces.static_vertices, *positions(t)]

    def _weight(self, facets: Facets, fraction: FloatArray) -> FloatArray:
        return np.asarray(fraction * self._band.importance(facets.directions(self._viewpoint)))

    def _measure(
        self, facets: Facets, weight: FloatArray, gains: NDArray[np.complex128], reference: FloatArray
    ) -> float:
        """Error of the worst surface for one pair, another one from turn to turn. Over the band: where the return fades
        at one place of it, the error there tells little."""
        turn = self._turn // MEASURED_EVERY
        pair = (turn % gains.shape[1], (turn // gains.shape[1]) % gains.shape[2])
        held = Finer.of(self._band, facets, self._materials, weight, pair, PROBES, reference, self._lot)
        return float(held.of_expansion(gains[:, *pair], self._level).error.max(initial=0.0))

    def _paths(
        self,
        knots: FloatArray,
        instants: FloatArray,
        positions: Positions,
        facets: Facets,
        gains: NDArray[np.complex128],
        led: NDArray[np.intp],
        known: Mapping[float, FloatArray],
    ) -> RadarPaths:
        """Paths by way of `facets`, which `led` counts out of all, with `gains` (order, tx, rx, facet, instant); the
        centroids (facet, 3) [m] of all facets are `known` at some times."""
        direction = np.empty((len(led), len(knots), 3))
        column = {float(t): k for k, t in enumerate(knots)}

        def centroids(t: float) -> FloatArray:
            return np.take(known[t], led, axis=0) if t in known else self._facets.centroids(positions(t), led)

        def delays(t: float) -> FloatArray:
            there = centroids(t)
            if t in column:
                offset = there - self._viewpoint
                direction[:, column[t]] = offset / np.maximum(lengths(offset), 1e-12)[:, None]
            return self._band.delays(there)

        def rates(t: float) -> FloatArray:
            before, after = positions(t - RATE_STEP), positions(t + RATE_STEP)
            velocities = [(b - a) / (2 * RATE_STEP) for a, b in zip(before, after, strict=True)]
            return self._band.rates(centroids(t), self._facets.centroids(velocities, led))

        curves = over_time(knots, instants, gains, delays, rates)
        return facet_paths(
            self._surfaces.moving,
            facets,
            knots,
            *curves,
            direction,
            self._band.centre,
            self._band.half_band,
            (self._surfaces.object_names, self._surfaces.part_names),
        )


def _three(instants: FloatArray) -> FloatArray:
    """Two instants and the one half way."""
    return np.linspace(instants[0], instants[-1], 3)
