"""Temporal refinement: additional times for facets that a shadow boundary crosses, and the time error of moving
shadows.

Gains are splines through the sample times. Where a shadow boundary moves over a facet, above all a large oblique one,
its gain changes with the wavelengths that the boundary passes. Leaving out each sample time in turn measures the error.
Facets that matter are sampled at additional times and have paths of their own.

Only shadow boundaries at a sample time are found: an occluder that passes a facet between two of them is missed. Ghosts
and paths through slabs have no refinement. :mod:`rfgen_sionna.tracing.static.static_refinement` refines shadows on the
static scene.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray, IntArray
from rfgen_sionna.records import knot_weights
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.scene.occluders import times_at_once
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.gains.band import BandTracer
from rfgen_sionna.tracing.gains.expansion import Expansion
from rfgen_sionna.tracing.integral.propagation import phasors
from rfgen_sionna.tracing.moving.facet_returns import AT_ONCE, FacetReturns, SampledReturns
from rfgen_sionna.tracing.moving.knots import (
    QUIET_GAPS,
    SplinedPositions,
    has_shadow_edge,
    interpolation_loss,
    largest_energy,
    leave_one_out,
    missed_energy,
    rms,
)
from rfgen_sionna.tracing.moving.moving_visibility import MovingVisibility
from rfgen_sionna.tracing.moving.slab_transmission import interpolate_transmission
from rfgen_sionna.tracing.moving.visible_facets import VisibleFacets
from rfgen_sionna.tracing.shadows.boundary_edges import BoundaryCorrection
from rfgen_sionna.tracing.shadows.return_bounds import max_returns
from rfgen_sionna.tracing.surface.facets import Facets
from rfgen_sionna.tracing.surface.quadratic_patch import QuadraticPatch

TIME_ERROR_PER_RTOL = 3.0
"""Allowed error of a return between sample times for moving shadows, relative to itself [root mean square over time],
per unit of the tolerance: as for turning faces."""
MAX_SUBDIVISIONS = 8
"""Largest number of times per gap between sample times; twice as many between three sample times."""
LEAVE_ONE_OUT_SHARE = 0.25
"""Error of splines at kinks, where faces come into view, over that without one sample time: the 1.5th power of a gap of
half the width, and half of the error in its middle."""
_CHOSEN_SHARE = 0.7
"""Share of the allowed error for refined facets, and for the others."""
MIN_SAMPLE_TIMES = 3
"""Smallest number of sample times of which one can be left out."""


class RefinementChoice(NamedTuple):
    """Facets to refine."""

    facets: NDArray[np.intp]
    """(chosen,) ascending."""
    rounds: int
    """Times per gap between sample times."""
    rest: FloatArray
    """(surface,) estimated error of all others between sample times."""
    level: FloatArray
    """(surface,) reference level of errors."""
    width: FloatArray
    """(chosen,) two-way phase between the ends of each facet [rad]."""

    def error(self, followed: FloatArray | float = 0.0) -> float:
        """Estimated relative time error of the worst surface, if the refined facets miss the energy `followed`
        (surface,)."""
        energy = self.rest**2 + followed
        return float(np.sqrt(energy / np.where(self.level > 0, self.level, np.inf) ** 2).max(initial=0.0))


def choose_refinement(
    gains: ComplexArray,
    phasors: ComplexArray,
    shares: FloatArray,
    width: FloatArray,
    steady: NDArray[np.bool_],
    surface: NDArray[np.integer[Any]],
    level: FloatArray,
    rtol: float,
    most: int = MAX_SUBDIVISIONS,
    unfollowed: ComplexArray | None = None,
) -> RefinementChoice:
    """Choose the facets with the largest spline errors, where moving shadows exceed the tolerance.

    `gains` (facet, time), those of one pair at one frequency with antennas, and propagation `phasors` (facet, time) are
    at `MIN_SAMPLE_TIMES` or more evenly spaced times; `shares` (facet, time) are visible fractions; `width` (facet,) is
    the two-way phase between the ends of each facet [rad]; `steady` (facet,) whether it faces the radar all the time,
    as others are not chosen. `level` (surface,) is the reference level of errors, `most` the largest number of times
    per gap, `unfollowed` (inner time,) the error of other facets of the only surface, which are not to be chosen.
    """
    chosen, rounds, rest = [np.zeros(0, np.intp)], 1, np.zeros(len(level))
    missed = np.where(has_shadow_edge(shares)[:, None], leave_one_out(gains), 0.0)
    # A boundary that moves by a wavelength per gap may appear to rest.
    swing = width * np.abs(np.diff(shares)).max(axis=1)
    visible = np.where(has_shadow_edge(shares), largest_energy(gains), 0.0)
    gaps = gains.shape[1] - 1
    energy = np.maximum(largest_energy(missed), visible * interpolation_loss(swing, gaps))
    missed = missed * phasors[:, 1:-1]
    for number in range(len(level)):
        mine = np.flatnonzero(surface == number)
        allowed = TIME_ERROR_PER_RTOL * rtol * level[number]
        able = mine[steady[mine] & (energy[mine] > 0)]
        able = able[np.argsort(-energy[able], kind="stable")]
        # Error of the others if the first n are followed: incoherent and coherent sums.
        apart, together = np.zeros(len(able) + 1), np.zeros((len(able) + 1, missed.shape[1]), np.complex128)
        np.cumsum(energy[able], out=apart[1:])
        np.cumsum(missed[able], axis=0, out=together[1:])
        others = np.sqrt(np.maximum(energy[mine].sum() - apart, 0.0))
        left = missed[mine].sum(axis=0) if unfollowed is None else missed[mine].sum(axis=0) + unfollowed
        others = np.maximum(others, rms(left - together))
        count = 0
        if others[0] > allowed > 0:
            enough = np.maximum.accumulate(others[::-1])[::-1] <= _CHOSEN_SHARE * allowed
            count = int(enough.argmax()) if enough.any() else len(able)
            chosen.append(followed := able[:count])
            while (
                rounds < most
                and (visible * interpolation_loss(swing / rounds, gaps * rounds))[followed].sum()
                > (_CHOSEN_SHARE * allowed) ** 2
            ):
                rounds += 1
        rest[number] = others[count]
    found = np.sort(np.concatenate(chosen))
    return RefinementChoice(found, rounds, rest, level, width[found])


def moved_shadow_returns(
    first: VisibleFacets, last: VisibleFacets, viewpoint: FloatArray, wavenumber: float, tolerance_group: IntArray
) -> FloatArray:
    """(surface,) change of the return of each `tolerance_group` (surface,) between two times for moving shadows,
    relative to its incoherent sum: largest return of a cut facet times the change of its visible fraction.

    A line between both times misses half of that at most, if all boundaries move one way; `STRAIGHT` and `PAIR_TURN` of
    :mod:`rfgen_sionna.tracing.moving.sample_times` bound other motions.
    """
    chosen = np.flatnonzero((first.fraction > 0) | (last.fraction > 0))
    facets = first.facets
    most, cut, _ = max_returns(np.take(facets.corners, chosen, axis=0) - viewpoint, wavenumber)
    before, after = first.fraction[chosen], last.fraction[chosen]
    weight, surface, count = (
        np.maximum(first.weight, last.weight)[chosen],
        tolerance_group[facets.surface[chosen]],
        len(tolerance_group),
    )
    change = np.bincount(surface, weight * cut * np.abs(after - before), count)
    level = np.sqrt(np.bincount(surface, 0.5 * (before**2 + after**2) * (weight * most) ** 2, count))
    return np.where(level > 0, change / np.where(level > 0, level, 1.0), 0.0)


def max_subdivisions(sample_times: int, most: int = MAX_SUBDIVISIONS) -> int:
    """Largest number of times per gap: `most`, twice as many between three sample times or fewer."""
    return most if sample_times - 1 > QUIET_GAPS else 2 * most


def fine_times(sample_times: FloatArray, rounds: int) -> FloatArray:
    """(time,) `rounds` times per gap of the evenly spaced `sample_times` [s], which are among them."""
    part = np.arange(rounds) / rounds  # twice as many contain these exactly
    between = sample_times[:-1, None] + part * np.diff(sample_times)[:, None]
    return np.append(between, sample_times[-1])


class RefinedGains(NamedTuple):
    """Gains of facets under temporal refinement."""

    times: FloatArray
    """(time,) [s]"""
    facets: Facets
    """Facets at the first time."""
    coefficients: ComplexArray
    """(order, tx, rx, facet, time) of one path per facet."""
    sampled_facets: int
    """Facets times the number of times."""
    rays: int
    error: float
    """Estimated relative time error of the worst surface, all facets included."""


class TemporalRefinement:
    """Finds the facets whose gains splines miss, and samples them at additional times."""

    def __init__(
        self,
        band: BandTracer,
        visibility: MovingVisibility,
        returns: FacetReturns,
        viewpoint: FloatArray,
        max_range: float,
        rtol: float,
        tolerance_group: IntArray,
    ) -> None:
        self._band, self._visibility, self._returns = band, visibility, returns
        self._viewpoint, self._max_range, self._rtol = viewpoint, max_range, rtol
        self._pairs = int(np.prod([len(each) for each in band.elements]))
        self._tolerance_group = tolerance_group

    def choose(
        self,
        facets: Sequence[Facets],
        references: Sequence[FloatArray],
        values: Sequence[ComplexArray],
        boundary_correction: Sequence[BoundaryCorrection | None],
        shares: FloatArray,
        expansion: Expansion,
        level: FloatArray,
        turn_fast: bool = False,
    ) -> RefinementChoice:
        """Choose from `facets` with the data of :class:`rfgen_sionna.tracing.moving.interval.ReturnedFacets` at each
        time, `references` (facet, 3) [m] and the reference `level` (surface,). If they `turn_fast`, all keep the sample
        times, and errors are relative to the root mean square of each return over time."""
        some = np.arange(len(shares)) if turn_fast else np.flatnonzero(has_shadow_edge(shares))
        if len(facets) < MIN_SAMPLE_TIMES or not len(some):
            return RefinementChoice(np.zeros(0, np.intp), 1, np.zeros(len(level)), level, np.zeros(0))
        half = len(facets) // 2
        surface = self._tolerance_group[facets[half].surface]
        own = Facets.taken(facets, some)
        ends = lengths(own[half].corners - self._viewpoint)
        # Entering the range window is not leaving a shadow.
        near = np.all([lengths(each.centroids - self._viewpoint) < self._max_range for each in own], axis=0)
        corrections = [None if each is None else each.within(some) for each in boundary_correction]
        gains = self._first_pair_gains(own[half], [each[:, some] for each in values], corrections, expansion)
        waves = np.concatenate([self._phasors(each[some]) for each in references], axis=1)
        width = 4 * np.pi * self._band.highest / SPEED_OF_LIGHT * np.ptp(ends, axis=1)
        if turn_fast:
            returned = np.stack([(gains * waves)[surface == number].sum(axis=0) for number in range(len(level))])
            rest = LEAVE_ONE_OUT_SHARE * np.sqrt(missed_energy(gains, waves, shares, width, surface, len(level)))
            return RefinementChoice(np.zeros(0, np.intp), 1, rest, rms(returned), np.zeros(0))
        found = choose_refinement(
            gains,
            waves,
            np.where(near[:, None], shares[some], 1.0),
            width,
            np.all([each.facing for each in own], axis=0),
            surface[some],
            level,
            self._rtol,
            max_subdivisions(len(facets)),
        )
        return found._replace(facets=some[found.facets])

    def follow(
        self,
        chosen: RefinementChoice,
        followed: NDArray[np.intp],
        places: IntArray,
        sample_times: FloatArray,
        visible: Sequence[VisibleFacets],
        expansion: Expansion,
        positions: SplinedPositions,
        corners: Callable[[float], FloatArray],
        rays: RayScene,
        per_element: Callable[[VisibleFacets, float], VisibleFacets],
    ) -> RefinedGains:
        """Sample the `chosen` facets, with indices `followed` among all `visible` at the `sample_times` [s], until
        splines meet the tolerance or the limit of refinement.

        `places` (facet, 3) are those of :func:`rfgen_sionna.tracing.shadows.adaptive_sampling.shared_vertices`;
        `positions` and `corners` give (vertex, 3) of all moving surfaces and (facet, 3, 3) of the followed facets [m]
        at a time [s]; `rays` is the ray scene at a sample time; `per_element` adds per-element visibility at a time
        [s], where it counts.
        """
        at_instants = [each.of(followed) for each in visible]
        first, count = at_instants[0].facets, len(followed)
        known, sampled = sample_times, replace(VisibleFacets.joined(at_instants), sampled_facets=0, rays=0)
        silhouette = np.max([each.silhouette for each in at_instants], axis=0)
        level = np.min([each.level for each in visible], axis=0)
        patches = [each.facets.patch for each in at_instants if each.facets.patch is not None]
        rounds = chosen.rounds
        while True:
            times = fine_times(sample_times, rounds)
            fresh = np.setdiff1d(times, known)
            positions.precompute(fresh)
            step = times_at_once(rays.num_facets, self._viewpoint, positions(float(sample_times[0])))
            for begin in range(0, len(fresh), step):
                some = fresh[begin : begin + step]
                there = np.stack([corners(t) for t in some.tolist()])
                facets = first.at(there, QuadraticPatch.blended(patches, knot_weights(sample_times, some)))
                occluders = self._visibility.occluders(rays, [positions(t) for t in some.tolist()], there)
                found = self._visibility.resample(occluders, facets, places, silhouette, level)
                found = interpolate_transmission(found, some, sample_times, visible, self._viewpoint)
                if visible[0].per_element is not None:
                    counted = replace(found, rays=0, sampled_facets=0), found
                    single = [counted[k == 0].of(np.arange(count * k, count * (k + 1))) for k in range(len(some))]
                    found = VisibleFacets.joined(
                        [per_element(each, t) for each, t in zip(single, some.tolist(), strict=True)]
                    )
                known, sampled = np.concatenate([known, some]), VisibleFacets.joined([sampled, found])
            order = np.argsort(known)
            own, references = sampled.facets, sampled.facets.centroids
            every = np.arange(len(own))
            sampled_returns = self._samples(sampled, count, max(1, AT_ONCE // count), expansion)
            values = sampled_returns.values[0]
            by_time = [values[:, count * k : count * (k + 1)] for k in order]
            shares = sampled.shares(self._pairs).reshape(-1, count)[order].T
            waves = self._phasors(references).reshape(-1, count)[order].T
            of_time = (
                [None] * len(order)
                if sampled_returns.boundary_correction[0] is None
                else sampled_returns.boundary_correction[0].split(count, len(order))
            )
            corrections = [of_time[k] for k in order]
            gains = self._first_pair_gains(first, by_time, corrections, expansion)
            own_group, tolerance_groups = self._tolerance_group[first.surface], len(chosen.level)
            missed = missed_energy(gains, waves, shares, chosen.width, own_group, tolerance_groups)
            error = chosen.error(missed)
            if error <= TIME_ERROR_PER_RTOL * self._rtol or 2 * rounds > max_subdivisions(len(sample_times)):
                break
            rounds *= 2
        parts = [own.take(every[count * k : count * (k + 1)]) for k in order]
        coefficients, _ = self._returns.coefficients(parts, shares, by_time, expansion, np.arange(count), corrections)
        return RefinedGains(times, first, coefficients, sampled.sampled_facets, sampled.rays, error)

    def _samples(self, sampled: VisibleFacets, count: int, most: int, expansion: Expansion) -> SampledReturns:
        """Returns of `count` facets at several times, each by way of its centroid, in batches of `most` times."""
        found, boundary_correction = list[ComplexArray](), list[BoundaryCorrection]()
        for first in range(0, len(sampled.facets), most * count):
            some = sampled.of(np.arange(first, min(first + most * count, len(sampled.facets))))
            own = some.facets
            times = len(own) // count
            sampled_returns = self._returns.apply_visibility(
                [some], np.arange(len(own)), [own], [own.centroids], expansion, times
            )
            found += sampled_returns.values
            boundary_correction += [
                each._replace(owner=each.owner + first)
                for each in sampled_returns.boundary_correction
                if each is not None
            ]
        values = found[0] if len(found) == 1 else np.concatenate(found, axis=1)
        corrections = BoundaryCorrection.joined(boundary_correction) if boundary_correction else None
        return SampledReturns([], [values], [corrections], sampled_returns.missed)

    def _phasors(self, reference: FloatArray) -> ComplexArray:
        """(facet, 1) propagation phasors by way of `reference` (facet, 3) [m]."""
        return phasors(self._band.centre * self._band.delays(reference, (0, 0)))[:, None]

    def _first_pair_gains(
        self,
        facets: Facets,
        values: Sequence[ComplexArray],
        boundary_correction: Sequence[BoundaryCorrection | None],
        expansion: Expansion,
    ) -> ComplexArray:
        """(facet, time) gains of the first pair in the middle of the band, with antennas."""
        found = np.stack([expansion.weights[0, 0, 0] @ each for each in values], axis=-1)
        for k, corrections in enumerate(boundary_correction):
            if corrections is not None:
                found[:, k] += corrections.of_first(len(found))
        return np.asarray(found * self._band.pattern_gain(facets.directions(self._viewpoint))[:, None])
