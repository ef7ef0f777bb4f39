"""What moves: its paths, whose facets are kept fine enough from one stretch of time to the next."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray, IntArray
from rfgen_sionna.records import RadarPaths
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.gains.band import BandTracer, Expansion
from rfgen_sionna.tracing.integral.phasors import phasors
from rfgen_sionna.tracing.moving.facets import MovingFacets, Positions
from rfgen_sionna.tracing.moving.fading import when_seen_best
from rfgen_sionna.tracing.moving.faint import LEAST_RTOL
from rfgen_sionna.tracing.moving.further import FurtherWays, SeenFurther
from rfgen_sionna.tracing.moving.glances import BETWEEN_PER_RTOL, Glances, fine_times, moved
from rfgen_sionna.tracing.moving.knots import Splined
from rfgen_sionna.tracing.moving.own_places import OwnPlaces
from rfgen_sionna.tracing.moving.precision import Precision
from rfgen_sionna.tracing.moving.returns import FacetReturns
from rfgen_sionna.tracing.moving.sight import Sight
from rfgen_sionna.tracing.moving.stretch import Glanced, Look, Returned, Stretch
from rfgen_sionna.tracing.moving.views import Seen
from rfgen_sionna.tracing.shadows.horizon import near_the_horizon
from rfgen_sionna.tracing.shadows.outlines import Passing
from rfgen_sionna.tracing.surface.facets import RATE_STEP, Facets, facet_paths, over_time
from rfgen_sionna.tracing.surface.surfaces import Surfaces, lots

MEASURED_EVERY = 5
"""The error is measured once in so many stretches, as it changes with what the body does rather than from one to the
next and takes about as long to know as all else."""
PAIR, UNSTEADY = 2, 4
"""The fewest instants of a stretch, and in how many stretches no pair is tried after one in which shadows moved."""
USUAL = 1.5
"""What people's facets return without interfering, over what they return: 0.5 to 3, mostly less than this."""


@dataclass(frozen=True)
class MovingTrace:
    """The moving surfaces over a stretch of time."""

    paths: RadarPaths
    glanced: RadarPaths | None
    """Direct returns of facets that were looked at between instants, at their own knots; None where there are none."""
    error: float
    """Estimated relative error of the return of the worst of them; see :mod:`rfgen_sionna.tracing.gains.accuracy`."""
    between: float
    """Estimated relative error between knots of the direct return of the worst of them, for shadows that move on; see
    :mod:`rfgen_sionna.tracing.moving.glances`."""
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
    """Traces the moving surfaces stretch by stretch, and what is seen of them by `further` ways.

    Facets stay the same until the motion asks for finer ones (:mod:`rfgen_sionna.tracing.moving.facets`); small
    neighbouring ones make a path together (:mod:`rfgen_sionna.tracing.moving.patches`). Their error is measured in
    every few stretches; where it is above the tolerance, facets and expansion are chosen anew. Not `aimed`, what is
    faint to the antennas (:mod:`rfgen_sionna.tracing.moving.faint`) is traced as well.
    """

    def __init__(
        self,
        surfaces: Surfaces,
        band: BandTracer,
        viewpoint: FloatArray,
        max_range: float,
        rtol: float,
        further: FurtherWays,
        aimed: bool = True,
    ) -> None:
        self._surfaces, self._band = surfaces, band
        self._viewpoint, self._max_range, self._rtol = viewpoint, max_range, rtol
        self._further, self._aimed = further, aimed
        self._lot = lots(surfaces.moving)
        materials = tuple(surface.material for surface in surfaces.moving)
        self._sight = Sight(surfaces, band, viewpoint, max_range, rtol)
        self._returns = FacetReturns(band, materials, self._lot)
        self._glances = Glances(band, self._sight, self._returns, viewpoint, max_range, rtol, self._lot)
        kept = surfaces.moving, band, viewpoint, max_range, rtol, further.ghosts
        self._facets = MovingFacets(*kept, self._sight.look_for)
        self._precision = Precision(
            surfaces, band, rtol, self._facets, further, lambda t, stretch: self._see([t], stretch, True)[0]
        )
        self._own_places = OwnPlaces(
            surfaces, *band.elements, viewpoint, 2 * np.pi * band.highest / SPEED_OF_LIGHT, rtol
        )
        self._cancelling = np.zeros(len(surfaces.moving))
        self._turn = self._unsteady = 0

    def trace(
        self,
        knots: FloatArray,
        instants: FloatArray,
        positions: Positions,
        rays: Callable[[float], RayScene],
        ray_scene: RayScene,
        rays_between: Callable[[float], RayScene],
    ) -> MovingTrace:
        """Paths with delays at `knots` and gains traced at `instants` [s]; where shadows move, two of them are not
        enough. `rays` gives the `ray_scene` as it is at an instant, `rays_between` at any time, by itself."""
        stretch = Stretch(
            knots, positions, rays, ray_scene, rays_between, self._further.over(positions, float(knots[0]))
        )
        look = self._look(stretch, instants)
        level, interference = self._when_seen_best(look)
        rest, glanced, between = self._glance(stretch, look, level)
        paths, led = self._direct(stretch, rest, look)

        def centroids(t: float, chosen: NDArray[np.intp]) -> FloatArray:
            return self._facets.centroids(positions(t), chosen)

        given = stretch.bounces, knots, look.instants, positions, centroids
        more, beyond = self._further.trace(*given, look.further, self._precision.level)
        self._turn += 1
        views = [*look.seen, *look.in_vain, *look.further.views, *([] if glanced is None else [glanced.found])]
        return MovingTrace(
            RadarPaths.concatenate([paths, *more]) if more else paths,
            None if glanced is None else glanced.paths,
            self._precision.error(look, interference) + beyond,
            between,
            sum(each.looked_at for each in views),
            sum(each.rays for each in views),
            lambda t: self._facets.centroids(positions(t), led),
            lambda t: self._facets.centroids(positions(t), led[:0] if glanced is None else glanced.facets),
            look.instants,
        )

    def _look(self, stretch: Stretch, instants: FloatArray) -> Look:
        """What is seen in the stretch, as accurately as it has to be."""
        self._unsteady -= 1
        if len(instants) == PAIR and (self._unsteady > 0 or self._precision.own.any()):
            instants = _three(instants)
        positions, middle = stretch.positions, len(instants) // 2
        if self._facets.follow(positions, stretch.knots):
            self._precision.forget()
        self._facets.turn_to([positions(float(instants[each])) for each in sorted({0, middle, len(instants) - 1})])
        turn, between = divmod(self._turn, MEASURED_EVERY)
        if not between:
            self._precision.ask_again()
        look = self._precision.ensure(
            instants, stretch, lambda times, by: self._looked(stretch, times, by), None if between else turn
        )
        doubtful = self._precision.doubtful(look, lambda surfaces: self._fallen_on(look, surfaces))
        if not doubtful.any():
            return look
        self._precision.hold_strips(doubtful, *self._off(look, stretch, doubtful), look)
        if not self._precision.own[doubtful].any():
            return look
        if len(look.instants) == PAIR:  # which tell nothing of edges that pairs see
            self._unsteady = UNSTEADY + 1
            again = self._looked(stretch, _three(look.instants), look.expansion)
            return again._replace(in_vain=[*look.seen, *again.in_vain])
        seen = self._all_from_own_places(look.seen, look.instants, stretch)
        return self._integrated(look.instants, seen, look.expansion, look.further, look.steady, look.in_vain)

    def _fallen_on(self, look: Look, surfaces: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """(surface,) on which of the `surfaces` (surface,) edges of shadows fall at an instant, as pairs see them."""
        given = zip(look.instants.tolist(), look.seen, strict=True)
        found = [self._own_places.fallen_on(self._sight.passing(t), each, surfaces) for t, each in given]
        return np.asarray(np.any(found, axis=0))

    def _off(self, look: Look, stretch: Stretch, doubtful: NDArray[np.bool_]) -> tuple[FloatArray, FloatArray]:
        """(surface,) error of what strips beside shadows' edges tell of the `doubtful` ones, of the pairs that see most
        differently, at the ends and half way, and (surface,) the largest return of these."""
        own, width, pairs = look.returned, len(self._band.elements[1]), self._own_places.telling()
        known = self._facets.places, doubtful, self._precision.interference
        most = np.max([each.level for each in look.seen], axis=0)
        both = [(pair // width, pair % width) for pair in pairs.tolist()]
        off, level = np.zeros((2, len(doubtful)))
        for k in sorted({0, len(look.instants) // 2, len(look.instants) - 1}):
            t, there = float(look.instants[k]), look.seen[k]
            (bent,) = self._bent([there], np.array([t]), stretch)
            looked = self._own_places.look(stretch.rays_between(t), stretch.positions(t), bent, *known, pairs, most)
            given = bent.from_own_places(looked, doubtful), doubtful, both, look.expansion
            for pair, (more, whole) in zip(both, self._returns.from_own_places(*given), strict=True):
                strips = look.lit.parallax[k], there, own.kept, look.references[k], pair, doubtful
                off = np.maximum(off, np.abs(more - self._returns.beside(*strips)))
                level = np.maximum(level, whole)
        return off[self._lot], level[self._lot]

    def _looked(self, stretch: Stretch, instants: FloatArray, expansion: Expansion) -> Look:
        """What is seen at the `instants` [s], at three of them where shadows move too much for two, and what the facets
        that are seen return."""
        positions, steady, in_vain = stretch.positions, 0.0, list[Seen]()
        seen = self._see(instants.tolist(), stretch)
        if len(instants) == PAIR:
            steady = self._changed(*seen)
            if steady > BETWEEN_PER_RTOL * self._rtol:
                instants, steady, self._unsteady, in_vain = _three(instants), 0.0, UNSTEADY + 1, seen
                seen = self._see(instants.tolist(), stretch)
        whole = [self._facets.from_all_sides(each.facets) if self.beside else each.facets for each in seen]
        times = instants.tolist(), positions, stretch.rays
        further, seen = self._further.see(stretch.bounces, *times, whole, seen)
        seen = [self._precision.to_the_horizon(each) for each in seen]
        seen = self._all_from_own_places(seen, instants, stretch)
        return self._integrated(instants, seen, expansion, further, steady, in_vain)

    def _integrated(
        self,
        instants: FloatArray,
        seen: list[Seen],
        expansion: Expansion,
        further: SeenFurther,
        steady: float,
        in_vain: list[Seen],
    ) -> Look:
        """What facets return that are `seen` at the `instants` [s]."""
        kept = np.flatnonzero(np.any([each.shown() for each in seen], axis=0))
        pull = self._band.pull(seen[0].facets, kept)
        seen = [replace(each, facets=each.facets.pulled(pull)) for each in seen]
        facets = Facets.taken([each.facets for each in seen], kept)
        leader = self._facets.patches.followed([each.facets.centroids for each in seen], kept)
        references = [np.take(each.facets.centroids, leader, axis=0) for each in seen]
        lit = self._returns.seen(seen, kept, facets, references, expansion)
        shares = np.stack([each.shares(len(self._own_places.pairs))[kept] for each in seen], axis=-1)
        returned = Returned(kept, facets, leader, shares, lit.values, lit.parallax)
        return Look(instants, seen, returned, references, lit, expansion, further, steady, in_vain)

    def _when_seen_best(self, look: Look) -> tuple[FloatArray, FloatArray]:
        """(surface,) level and interference of each, of one that goes behind another when it is seen best."""

        def waves(k: int) -> ComplexArray:
            gains = look.expansion.weights[0, 0, 0] @ look.lit.values[k] * look.seen[k].weight[look.returned.kept]
            return np.asarray(gains * phasors(self._band.centre * self._band.delays(look.references[k], (0, 0))))

        own, middle, known = look.returned, len(look.instants) // 2, self._precision
        lot = self._lot[own.facets[middle].surface]
        return when_seen_best(waves, own.shares, lot, middle, known.level, known.interference)

    def _glance(self, stretch: Stretch, look: Look, level: FloatArray) -> tuple[Returned, Glanced | None, float]:
        """Facets that shadows' edges pass over are looked at between instants and go by paths of their own: the others,
        these, if there are any, and what is missed between times."""
        own, instants, positions = look.returned, look.instants, stretch.positions
        given = own.facets, look.references, own.values, own.parallax, own.shares, look.expansion
        chosen = self._glances.choose(*given, level)
        followed = own.kept[chosen.facets]
        if not len(followed):
            return own, None, max(chosen.error(), look.steady)
        placed, most = Splined(stretch.knots, positions), np.max([each.level for each in look.seen], axis=0)
        found = self._glances.follow(
            chosen, followed, self._facets.places[followed], instants, look.seen, look.expansion, placed,
            lambda t: self._facets.corners(placed(t), followed), stretch.ray_scene,
            lambda seen, t: self._from_own_places(seen, t, self._facets.places[followed], stretch, most),
        )  # fmt: skip
        # As many knots as delays ask for, the times among them.
        often = fine_times(found.times, -(-(len(stretch.knots) - 1) // (len(found.times) - 1)))
        paths = self._paths(often, found.times, placed, found.facets, found.coefficients, followed, {})
        rest = np.setdiff1d(np.arange(len(own.kept)), chosen.facets, assume_unique=True)
        return own.take(rest), Glanced(found, paths, followed), found.error

    def _direct(self, stretch: Stretch, own: Returned, look: Look) -> tuple[RadarPaths, NDArray[np.intp]]:
        """Paths of the facets that are seen directly, small neighbours together, and the facets they go by."""
        pattern = [self._facets.patches.pattern(each, own.kept, own.leader) for each in look.seen]
        given = own.facets, own.shares, own.values, look.expansion, own.leader, own.parallax, pattern
        coefficients, led = self._returns.coefficients(*given)
        led_by, count = look.seen[0].facets.take(led), len(self._cancelling)
        by_way = [np.take(each.facets.centroids, led, axis=0) for each in look.seen]
        self._cancelling = self._returns.cancelling(by_way, coefficients[0, 0, 0], led_by.surface, count)
        known = {t: each.facets.centroids for t, each in zip(look.instants.tolist(), look.seen, strict=True)}
        return self._paths(stretch.knots, look.instants, stretch.positions, led_by, coefficients, led, known), led

    def _changed(self, first: Seen, last: Seen) -> float:
        """Error between two instants for shadows that move on, at most, of the worst surface."""
        wavenumber = 2 * np.pi * self._band.highest / SPEED_OF_LIGHT
        change = moved(first, last, self._viewpoint, wavenumber, self._lot)
        return float((0.5 * np.maximum(self._precision.interference, 1.0) * change).max(initial=0.0))

    def passing(self, t: float) -> Passing:
        """Rays that just pass the outlines of what moves at one of the instants [s]."""
        return self._sight.passing(t)

    def consider(self, positions: Positions, times: Sequence[float]) -> Positions:
        """:meth:`FurtherWays.consider`"""
        return self._further.consider(positions, times)

    @property
    def cancelled(self) -> FloatArray:
        """(surface,) how much larger errors of single facets are for all of a surface than for a body, whose facets
        return without order, as told in the stretch before: where a flat thing looks elsewhere they cancel nearly, and
        their errors don't."""
        return np.maximum(self._cancelling / USUAL, 1.0)

    @property
    def beside(self) -> bool:
        """Whether mirrors show what looks away from the radar, or slabs: the back of a hollow body."""
        return bool(self._further)

    def _see(self, times: Sequence[float], stretch: Stretch, all_around: bool = False) -> list[Seen]:
        """What is seen directly at several `times` [s] of the stretch, bent where it is seen, and `all_around` or where
        that counts along the horizon, too."""
        vertices, everything = [stretch.positions(t) for t in times], self.beside
        facets, around = self._facets.at(vertices), self._precision.rims | all_around
        if everything:
            facets = self._facets.bent(facets, vertices)
        # Of what was not seen before nobody knows how it interferes.
        known = (self._precision.interference > 0) & (self._aimed and not everything and self._rtol >= LEAST_RTOL)
        share = np.where(known, 1.0 / np.maximum(self._precision.interference, 1.0), 0.0)
        seen = self._sight(stretch.ray_scene, facets, self._facets.places, times, vertices, share)
        if everything:
            return seen
        shown = np.any([each.fraction > 0 for each in seen], axis=0)
        if around.any():
            shown |= np.any([near_the_horizon(each.facets, self._viewpoint, self._band.reach) for each in seen], axis=0)
        facets = self._facets.bent([each.facets for each in seen], vertices, np.flatnonzero(shown))
        return [replace(each, facets=own) for each, own in zip(seen, facets, strict=True)]

    def _all_from_own_places(self, seen: Sequence[Seen], times: FloatArray, stretch: Stretch) -> list[Seen]:
        """What is `seen` at some `times` [s], as :meth:`_from_own_places` has it."""
        self._precision.leave_slabs(seen)
        if not self._precision.own.any():
            return list(seen)
        seen = self._bent(seen, times, stretch)
        level = np.max([each.level for each in seen], axis=0)
        given = zip(seen, times.tolist(), strict=True)
        return [self._from_own_places(each, t, self._facets.places, stretch, level) for each, t in given]

    def _bent(self, seen: Sequence[Seen], times: FloatArray, stretch: Stretch) -> list[Seen]:
        """What is `seen` at some `times` [s], all bent that is looked at, as pairs may see it where the phase centre
        does not."""
        vertices = [stretch.positions(t) for t in times.tolist()]
        chosen = np.flatnonzero(np.any([each.weight > 0 for each in seen], axis=0))
        facets = self._facets.bent([each.facets for each in seen], vertices, chosen)
        return [replace(each, facets=own) for each, own in zip(seen, facets, strict=True)]

    def _from_own_places(self, seen: Seen, t: float, places: IntArray, stretch: Stretch, level: FloatArray) -> Seen:
        """What is `seen` at `t` [s] of facets at some `places` (facet, 3), of surfaces of which that counts from each
        pair's own places; the others are those of :meth:`OwnPlaces.look`."""
        own, every = self._precision.own, self._own_places
        if not own.any():
            return seen
        given = stretch.positions(t), seen, places, own, self._precision.interference, every.pairs, level
        return seen.from_own_places(every.look(stretch.rays_between(t), *given), own)

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
