"""Paths of moving surfaces, with facets that persist from one interval of time to the next."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray, IntArray
from rfgen_sionna.records import RadarPaths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.gains.band import BandTracer, Expansion
from rfgen_sionna.tracing.integral.propagation import phasors
from rfgen_sionna.tracing.moving.culling import LEAST_RTOL
from rfgen_sionna.tracing.moving.error_control import ErrorControl
from rfgen_sionna.tracing.moving.facet_returns import FacetReturns, best_visible_level
from rfgen_sionna.tracing.moving.indirect_paths import IndirectPaths, IndirectVisibility
from rfgen_sionna.tracing.moving.interval import (
    IntervalVisibility,
    MovingTrace,
    RefinedFacets,
    ReturnedFacets,
    TraceInterval,
)
from rfgen_sionna.tracing.moving.knots import SplinedPositions
from rfgen_sionna.tracing.moving.moving_facets import MovingFacets, Positions
from rfgen_sionna.tracing.moving.moving_visibility import MovingVisibility
from rfgen_sionna.tracing.moving.per_element_visibility import PerElementSampler
from rfgen_sionna.tracing.moving.temporal_refinement import (
    TIME_ERROR_PER_RTOL,
    TemporalRefinement,
    fine_times,
    moved_shadow_returns,
)
from rfgen_sionna.tracing.moving.visible_facets import VisibleFacets
from rfgen_sionna.tracing.shadows.silhouettes import SilhouetteRays
from rfgen_sionna.tracing.shadows.terminator import near_terminator
from rfgen_sionna.tracing.surface.facets import Facets
from rfgen_sionna.tracing.surface.surfaces import Surfaces, tolerance_groups

MEASURED_EVERY = 5
"""Intervals per measurement of the error, which costs about as much as the trace and changes slowly."""
PAIR, UNSTEADY = 2, 4
"""Smallest number of sample times, and intervals without a pair after one with moving shadows."""
TYPICAL_CANCELLATION = 1.5
"""Incoherent over coherent sum of the facets of a walking person: 0.5 to 3, mostly below this."""


class MovingTracer:
    """Traces the moving surfaces interval by interval, with their `indirect` paths.

    Facets persist until the motion demands finer ones (:mod:`rfgen_sionna.tracing.moving.moving_facets`); small
    neighbours share a path (:mod:`rfgen_sionna.tracing.moving.clusters`). The error is measured in every few intervals;
    above the tolerance facets and expansion are chosen anew. `cull` omits facets that are negligible for the antennas
    (:mod:`rfgen_sionna.tracing.moving.culling`).
    """

    def __init__(
        self,
        surfaces: Surfaces,
        band: BandTracer,
        viewpoint: FloatArray,
        max_range: float,
        rtol: float,
        indirect: IndirectPaths,
        cull: bool = True,
    ) -> None:
        self._surfaces, self._band = surfaces, band
        self._viewpoint, self._max_range, self._rtol = viewpoint, max_range, rtol
        self._indirect, self._cull = indirect, cull
        self._tolerance_group = tolerance_groups(surfaces.moving)
        materials = tuple(surface.material for surface in surfaces.moving)
        self._moving_visibility = MovingVisibility(surfaces, band, viewpoint, max_range, rtol)
        self._returns = FacetReturns(band, materials, self._tolerance_group)
        self._temporal_refinement = TemporalRefinement(
            band, self._moving_visibility, self._returns, viewpoint, max_range, rtol, self._tolerance_group
        )
        given = surfaces, band, viewpoint, max_range, rtol, indirect.ghosts
        self._facets = MovingFacets(*given, self._moving_visibility.use_silhouette_search)
        control = surfaces, band, rtol, self._facets, indirect
        self._error_control = ErrorControl(*control, lambda t, known: self._trace_visibility([t], known, True)[0])
        wavenumber = 2 * np.pi * band.highest / SPEED_OF_LIGHT
        self._per_element = PerElementSampler(surfaces, *band.elements, viewpoint, wavenumber, rtol)
        self._cancellation = np.zeros(len(surfaces.moving))
        self._turn = self._unsteady = 0

    def trace(
        self,
        knots: FloatArray,
        sample_times: FloatArray,
        positions: Positions,
        rays: Callable[[float], RayScene],
        ray_scene: RayScene,
        rays_between: Callable[[float], RayScene],
    ) -> MovingTrace:
        """Paths with delays at `knots` and gains at `sample_times` [s]; moving shadows replace two sample times by
        three. `rays` updates the `ray_scene` to a sample time, `rays_between` to any time."""
        planar = self._indirect.active_reflections(positions, float(knots[0]))
        interval = TraceInterval(knots, positions, rays, ray_scene, rays_between, planar)
        visibility = self._visibility(interval, sample_times)
        level, cancellation = self._best_level(visibility)
        rest, refined, time_error = self._refine_in_time(interval, visibility, level)
        paths, heads = self._direct(interval, rest, visibility)

        def centroids(t: float, chosen: NDArray[np.intp]) -> FloatArray:
            return self._facets.centroids(positions(t), chosen)

        given = interval.planar, knots, visibility.sample_times, positions, centroids
        more, indirect_error = self._indirect.trace(*given, visibility.indirect, self._error_control.level)
        self._turn += 1
        views = [
            *visibility.visible,
            *visibility.discarded,
            *visibility.indirect.views,
            *([] if refined is None else [refined.found]),
        ]
        return MovingTrace(
            RadarPaths.concatenate([paths, *more]) if more else paths,
            None if refined is None else refined.paths,
            self._error_control.error(visibility, cancellation) + indirect_error,
            time_error,
            sum(each.sampled_facets for each in views),
            sum(each.rays for each in views),
            lambda t: self._facets.centroids(positions(t), heads),
            lambda t: self._facets.centroids(positions(t), heads[:0] if refined is None else refined.facets),
            visibility.sample_times,
        )

    def _visibility(self, interval: TraceInterval, sample_times: FloatArray) -> IntervalVisibility:
        """Visibility over the interval, as accurate as the tolerance demands."""
        self._unsteady -= 1
        if len(sample_times) == PAIR and (self._unsteady > 0 or self._error_control.per_element.any()):
            sample_times = _with_middle(sample_times)
        positions, middle, control = interval.positions, len(sample_times) // 2, self._error_control
        if self._facets.follow(positions, interval.knots):
            control.reset()
        ends = sorted({0, middle, len(sample_times) - 1})
        self._facets.turn_to([positions(float(sample_times[each])) for each in ends])
        turn, skipped = divmod(self._turn, MEASURED_EVERY)
        if not skipped:
            control.verify_again()
        visibility = control.ensure(
            sample_times,
            interval,
            lambda times, by: self._sampled_visibility(interval, times, by),
            None if skipped else turn,
        )
        unverified = control.unverified(visibility, lambda surfaces: self._shadowed_surfaces(visibility, surfaces))
        if not unverified.any():
            return visibility
        measured = self._measured_correction_error(visibility, interval, unverified)
        control.verify_correction(unverified, *measured, visibility)
        if not control.per_element[unverified].any():
            return visibility
        if len(visibility.sample_times) == PAIR:  # a pair misses shadow boundaries of single element pairs
            self._unsteady = UNSTEADY + 1
            again = self._sampled_visibility(interval, _with_middle(visibility.sample_times), visibility.expansion)
            return again._replace(discarded=[*visibility.visible, *again.discarded])
        visible = self._all_per_element(visibility.visible, visibility.sample_times, interval)
        known = visibility.expansion, visibility.indirect, visibility.moved_shadow_error, visibility.discarded
        return self._integrated(visibility.sample_times, visible, *known)

    def _shadowed_surfaces(self, visibility: IntervalVisibility, surfaces: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """(surface,) whether a shadow boundary of any element pair falls on each of the `surfaces` (surface,) at a
        sample time."""
        found, rays = [], self._moving_visibility.silhouette_rays
        for t, each in zip(visibility.sample_times.tolist(), visibility.visible, strict=True):
            found.append(self._per_element.shadowed_surfaces(rays(t), each, surfaces))
        return np.asarray(np.any(found, axis=0))

    def _measured_correction_error(
        self, visibility: IntervalVisibility, interval: TraceInterval, unverified: NDArray[np.bool_]
    ) -> tuple[FloatArray, FloatArray]:
        """(surface,) error of the shadow-boundary correction of `unverified` surfaces, for the pairs with the most
        different visibility, at the ends and the middle; and (surface,) the largest return of these pairs."""
        own, width, pairs = visibility.returned, len(self._band.elements[1]), self._per_element.representative()
        known = self._facets.places, unverified, self._error_control.cancellation
        most = np.max([each.level for each in visibility.visible], axis=0)
        both = [(pair // width, pair % width) for pair in pairs.tolist()]
        corrections = visibility.sampled_returns.boundary_correction
        off, level = np.zeros((2, len(unverified)))
        for k in sorted({0, len(visibility.sample_times) // 2, len(visibility.sample_times) - 1}):
            t, there = float(visibility.sample_times[k]), visibility.visible[k]
            (patched,) = self._with_patches([there], np.array([t]), interval)
            sampled = self._per_element.visibility(
                interval.rays_between(t), interval.positions(t), patched, *known, pairs, most
            )
            given = patched.with_per_element(sampled, unverified), unverified, both, visibility.expansion
            for pair, (more, whole) in zip(both, self._returns.element_pair_returns(*given), strict=True):
                correction = corrections[k], there, own.selected, visibility.references[k], pair, unverified
                off = np.maximum(off, np.abs(more - self._returns.pair_correction(*correction)))
                level = np.maximum(level, whole)
        return off[self._tolerance_group], level[self._tolerance_group]

    def _sampled_visibility(
        self, interval: TraceInterval, sample_times: FloatArray, expansion: Expansion
    ) -> IntervalVisibility:
        """Visibility and returns at the `sample_times` [s], three instead of two where shadows move too much."""
        positions, moved_shadow_error, discarded = interval.positions, 0.0, list[VisibleFacets]()
        visible = self._trace_visibility(sample_times.tolist(), interval)
        if len(sample_times) == PAIR:
            moved_shadow_error = self._moved_shadow_error(*visible)
            if moved_shadow_error > TIME_ERROR_PER_RTOL * self._rtol:
                moved_shadow_error, self._unsteady, discarded = 0.0, UNSTEADY + 1, visible
                sample_times = _with_middle(sample_times)
                visible = self._trace_visibility(sample_times.tolist(), interval)
        whole = [
            self._facets.from_all_sides(each.facets) if self.traces_back_faces else each.facets for each in visible
        ]
        times = sample_times.tolist(), positions, interval.rays
        indirect, visible = self._indirect.trace_visibility(interval.planar, *times, whole, visible)
        visible = [self._error_control.to_terminator(each) for each in visible]
        visible = self._all_per_element(visible, sample_times, interval)
        return self._integrated(sample_times, visible, expansion, indirect, moved_shadow_error, discarded)

    def _integrated(
        self,
        sample_times: FloatArray,
        visible: list[VisibleFacets],
        expansion: Expansion,
        indirect: IndirectVisibility,
        moved_shadow_error: float,
        discarded: list[VisibleFacets],
    ) -> IntervalVisibility:
        """Returns of the facets that are `visible` at the `sample_times` [s]."""
        selected = np.flatnonzero(np.any([each.any_visible() for each in visible], axis=0))
        pattern_gradient = self._band.pattern_gradient(visible[0].facets, selected)
        visible = [replace(each, facets=each.facets.with_pattern_gradient(pattern_gradient)) for each in visible]
        facets = Facets.taken([each.facets for each in visible], selected)
        cluster_head = self._facets.clusters.heads_over_interval([each.facets.centroids for each in visible], selected)
        references = [np.take(each.facets.centroids, cluster_head, axis=0) for each in visible]
        sampled_returns = self._returns.apply_visibility(visible, selected, facets, references, expansion)
        shares = np.stack([each.shares(len(self._per_element.pairs))[selected] for each in visible], axis=-1)
        returned = ReturnedFacets(
            selected, facets, cluster_head, shares, sampled_returns.values, sampled_returns.boundary_correction
        )
        found = returned, references, sampled_returns, expansion, indirect, moved_shadow_error, discarded
        return IntervalVisibility(sample_times, visible, *found)

    def _best_level(self, visibility: IntervalVisibility) -> tuple[FloatArray, FloatArray]:
        """(surface,) reference level and cancellation of each surface; of an occluded one at its best visibility."""

        def waves(k: int) -> ComplexArray:
            gains = (
                visibility.expansion.weights[0, 0, 0]
                @ visibility.sampled_returns.values[k]
                * visibility.visible[k].weight[visibility.returned.selected]
            )
            return np.asarray(gains * phasors(self._band.centre * self._band.delays(visibility.references[k], (0, 0))))

        own, middle, known = visibility.returned, len(visibility.sample_times) // 2, self._error_control
        tolerance_group = self._tolerance_group[own.facets[middle].surface]
        return best_visible_level(waves, own.shares, tolerance_group, middle, known.level, known.cancellation)

    def _refine_in_time(
        self, interval: TraceInterval, visibility: IntervalVisibility, level: FloatArray
    ) -> tuple[ReturnedFacets, RefinedFacets | None, float]:
        """Facets without temporal refinement, those with it, if any, and the time error."""
        own, sample_times, positions = visibility.returned, visibility.sample_times, interval.positions
        given = own.facets, visibility.references, own.values, own.boundary_correction, own.shares, visibility.expansion
        chosen = self._temporal_refinement.choose(*given, level, self._facets.limited)
        followed = own.selected[chosen.facets]
        if not len(followed):
            return own, None, max(chosen.error(), visibility.moved_shadow_error)
        placed = SplinedPositions(interval.knots, positions)
        most = np.max([each.level for each in visibility.visible], axis=0)
        found = self._temporal_refinement.follow(
            chosen, followed, self._facets.places[followed], sample_times, visibility.visible, visibility.expansion,
            placed, lambda t: self._facets.corners(placed(t), followed), interval.ray_scene,
            lambda visible, t: self._per_element_visible(visible, t, self._facets.places[followed], interval, most),
        )  # fmt: skip
        # At least as many knots as the delays demand, with the refined times among them.
        often = fine_times(found.times, -(-(len(interval.knots) - 1) // (len(found.times) - 1)))
        paths = self._facets.paths(often, found.times, placed, found.facets, found.coefficients, followed, {})
        rest = np.setdiff1d(np.arange(len(own.selected)), chosen.facets, assume_unique=True)
        return own.take(rest), RefinedFacets(found, paths, followed), found.error

    def _direct(
        self, interval: TraceInterval, own: ReturnedFacets, visibility: IntervalVisibility
    ) -> tuple[RadarPaths, NDArray[np.intp]]:
        """Paths of the directly visible facets by cluster, and the cluster heads."""
        clusters, times = self._facets.clusters, visibility.sample_times.tolist()
        pattern = [clusters.relative_pattern_gain(each, own.selected, own.cluster_head) for each in visibility.visible]
        given = own.facets, own.shares, own.values, visibility.expansion, own.cluster_head, own.boundary_correction
        coefficients, heads = self._returns.coefficients(*given, pattern)
        head_facets, count = visibility.visible[0].facets.take(heads), len(self._cancellation)
        by_way = [np.take(each.facets.centroids, heads, axis=0) for each in visibility.visible]
        self._cancellation = self._returns.cancellation(by_way, coefficients[0, 0, 0], head_facets.surface, count)
        known = {t: each.facets.centroids for t, each in zip(times, visibility.visible, strict=True)}
        return self._facets.paths(
            interval.knots, visibility.sample_times, interval.positions, head_facets, coefficients, heads, known
        ), heads

    def _moved_shadow_error(self, first: VisibleFacets, last: VisibleFacets) -> float:
        """Upper bound of the error between two sample times for moving shadows, of the worst surface."""
        wavenumber = 2 * np.pi * self._band.highest / SPEED_OF_LIGHT
        change = moved_shadow_returns(first, last, self._viewpoint, wavenumber, self._tolerance_group)
        return float((0.5 * np.maximum(self._error_control.cancellation, 1.0) * change).max(initial=0.0))

    def silhouette_rays(self, t: float) -> SilhouetteRays:
        """Rays past the silhouettes of moving surfaces at a sample time `t` [s]."""
        return self._moving_visibility.silhouette_rays(t)

    def prepare(self, positions: Positions, times: Sequence[float]) -> Positions:
        """:meth:`rfgen_sionna.tracing.moving.indirect_paths.IndirectPaths.prepare`"""
        return self._indirect.prepare(positions, times)

    def limit_facets(self, limits: Sequence[FloatArray]) -> list[FloatArray]:
        """:meth:`rfgen_sionna.tracing.moving.moving_facets.MovingFacets.limit`"""
        return self._facets.limit(limits)

    @property
    def relative_cancellation(self) -> FloatArray:
        """(surface,) cancellation in the last interval over that of a typical body, at least 1: factor on the errors of
        single facets, as errors do not cancel where returns do."""
        return np.maximum(self._cancellation / TYPICAL_CANCELLATION, 1.0)

    @property
    def traces_back_faces(self) -> bool:
        """Whether mirrors or slabs may show faces that face away from the radar."""
        return bool(self._indirect)

    def _trace_visibility(
        self, times: Sequence[float], interval: TraceInterval, all_around: bool = False
    ) -> list[VisibleFacets]:
        """Direct visibility at several `times` [s], with quadratic patches on visible facets; `all_around` includes
        those at the terminator."""
        vertices, everything = [interval.positions(t) for t in times], self.traces_back_faces
        facets, around = self._facets.at(vertices), self._error_control.terminator | all_around
        if everything:
            facets = self._facets.with_patches(facets, vertices)
        # The cancellation of surfaces that were not visible before is unknown.
        known = (self._error_control.cancellation > 0) & (self._cull and not everything and self._rtol >= LEAST_RTOL)
        share = np.where(known, 1.0 / np.maximum(self._error_control.cancellation, 1.0), 0.0)
        visible = self._moving_visibility(interval.ray_scene, facets, self._facets.places, times, vertices, share)
        if everything:
            return visible
        any_visible = np.any([each.fraction > 0 for each in visible], axis=0)
        if around.any():
            any_visible |= np.any(
                [near_terminator(each.facets, self._viewpoint, self._band.reach) for each in visible], axis=0
            )
        facets = self._facets.with_patches([each.facets for each in visible], vertices, np.flatnonzero(any_visible))
        return [replace(each, facets=own) for each, own in zip(visible, facets, strict=True)]

    def _all_per_element(
        self, visible: Sequence[VisibleFacets], times: FloatArray, interval: TraceInterval
    ) -> list[VisibleFacets]:
        """:meth:`_per_element_visible` at several `times` [s]."""
        self._error_control.exclude_slabs(visible)
        if not self._error_control.per_element.any():
            return list(visible)
        visible = self._with_patches(visible, times, interval)
        level = np.max([each.level for each in visible], axis=0)
        given = zip(visible, times.tolist(), strict=True)
        return [self._per_element_visible(each, t, self._facets.places, interval, level) for each, t in given]

    def _with_patches(
        self, visible: Sequence[VisibleFacets], times: FloatArray, interval: TraceInterval
    ) -> list[VisibleFacets]:
        """The same with quadratic patches on all sampled facets, as elements may see them where the phase centre does
        not."""
        vertices = [interval.positions(t) for t in times.tolist()]
        chosen = np.flatnonzero(np.any([each.weight > 0 for each in visible], axis=0))
        facets = self._facets.with_patches([each.facets for each in visible], vertices, chosen)
        return [replace(each, facets=own) for each, own in zip(visible, facets, strict=True)]

    def _per_element_visible(
        self, visible: VisibleFacets, t: float, places: IntArray, interval: TraceInterval, level: FloatArray
    ) -> VisibleFacets:
        """Facets at `t` [s] with per-element visibility where it counts; arguments as of
        :meth:`PerElementSampler.visibility`."""
        own, every = self._error_control.per_element, self._per_element
        if not own.any():
            return visible
        given = interval.positions(t), visible, places, own, self._error_control.cancellation, every.pairs, level
        return visible.with_per_element(every.visibility(interval.rays_between(t), *given), own)


def _with_middle(sample_times: FloatArray) -> FloatArray:
    """Two sample times and their middle."""
    return np.linspace(sample_times[0], sample_times[-1], 3)
