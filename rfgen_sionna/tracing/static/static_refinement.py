"""Glances between instants at what actors hide of the static scene.

As of actors (:mod:`rfgen_sionna.tracing.moving.temporal_refinement`): where the edge of a shadow moves on over a facet
that lies
aslant, splines through instants miss what it returns in between. Static facets that matter are looked at more often,
and what is hidden of them has knots of its own. How far an edge moves is told by the share that is left: where a rod
hides the middle of a facet, both edges move and the share stays, so that the estimate may be too low.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import ComplexArray, FloatArray
from rfgen_sionna.records import RadarPaths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.integral.propagation import phasors
from rfgen_sionna.tracing.moving.interpolation_loss import interpolation_loss, leave_one_out, missed_energy, rms
from rfgen_sionna.tracing.moving.temporal_refinement import (
    BETWEEN_PER_RTOL,
    MIN_SAMPLE_TIMES,
    choose_refinement,
    fine_times,
    max_subdivisions,
)
from rfgen_sionna.tracing.shadows.return_bounds import max_returns
from rfgen_sionna.tracing.static.actor_shadows import Shadow
from rfgen_sionna.tracing.static.static_trace import StaticTrace
from rfgen_sionna.tracing.static.static_visibility import StaticVisibility

MAX_SUBDIVISIONS = 32
"""What :data:`rfgen_sionna.tracing.moving.temporal_refinement.MAX_SUBDIVISIONS` is, of what stays: flat facets of
rooms are wider than those of
bodies."""
LEAVE_ONE_OUT_SCALE = 0.35
"""What splines through all instants mostly miss, of what they miss without one of them: only where that is above the
tolerance facets are looked at again. The error that is stated is all of it, as much as is missed where edges pass by
wavelengths at once."""

_NEGLIGIBLE_SHARE = 0.3
"""Share of the tolerance that facets which are not even integrated may err by, at most."""


class ActorOcclusion(NamedTuple):
    """What actors hide of the static scene's direct returns over a stretch of time."""

    sample_times: FloatArray
    """(instant,) [s]"""
    static_visibility: Sequence[StaticVisibility]
    """What is left at each instant; of the facets below all is."""
    times: FloatArray
    """(time,) of the facets that were looked at in between [s]; none where there are none."""
    chosen: NDArray[np.intp]
    """(facet,) those facets, ascending."""
    occluders: Sequence[StaticVisibility]
    """What is left of those at each of the times, integrated: their shares alone."""
    error: float
    """Estimated error between times, relative to :attr:`StaticTrace.level`."""
    sampled_facets: int
    """Facets looked at in between, each as often as it was."""
    rays: int
    """Rays sent for that."""
    missed: float
    """:attr:`StaticVisibility.missed` of the worst of the looks."""

    def shadows(self, static: StaticTrace) -> tuple[Shadow, ...]:
        """What is missing of the `static` paths."""
        found = static.shadows(self.sample_times, static.integrated(self.static_visibility))
        return found if not len(self.times) else (*found, *static.shadows(self.times, self.occluders, self.chosen))


def refine_occlusion(
    static: StaticTrace,
    sample_times: FloatArray,
    static_visibility: Sequence[StaticVisibility],
    rays: Callable[[float], RayScene],
    rtol: float,
) -> ActorOcclusion:
    """Look again at the static facets that splines through evenly spaced `sample_times` [s] miss, until they miss no
    more than the tolerance, or as often as may be.

    `static_visibility` are :meth:`StaticTrace.visible` at the instants, and `rays` gives the ray scene at any other
    time [s].
    """
    nothing = ActorOcclusion(sample_times, static_visibility, np.zeros(0), np.zeros(0, np.intp), (), 0.0, 0, 0, 0.0)
    left = np.stack([each.left for each in static_visibility], axis=1)
    edged = (left != left[:, :1]).any(axis=1)
    edged[np.concatenate([each.owner for each in static_visibility])] = True
    some = np.flatnonzero(edged)
    if len(sample_times) < MIN_SAMPLE_TIMES or not len(some):
        return nothing
    _, cut, width = max_returns(static.facets.corners[some] - static.viewpoint, static.returns.wavenumber)
    # Few of many facets may return enough to matter.
    at_most = LEAVE_ONE_OUT_SCALE * _at_most(static, some, left[some], cut, width)
    order = np.argsort(at_most, kind="stable")
    whole = (static.paths.a[0, 0, some] * _phasors(static.paths, some))[:, 0] * static.weight[some]
    together = np.cumsum(LEAVE_ONE_OUT_SCALE * leave_one_out(whole[order, None] * left[some[order]]), axis=0)
    apart = np.sqrt(np.cumsum(at_most[order] ** 2))
    skipped = np.maximum.accumulate(np.maximum(apart, rms(together)))  # one by one, and as they add up, side by side
    sure = int(np.count_nonzero(skipped <= _NEGLIGIBLE_SHARE * BETWEEN_PER_RTOL * rtol * static.level))
    apart_skipped, together_skipped = (
        (apart[sure - 1], together[sure - 1]) if sure else (0.0, np.zeros(together.shape[1], np.complex128))
    )
    rows = np.sort(order[sure:])
    some, width, mine = some[rows], width[rows], np.zeros(len(left), np.bool_)
    mine[some] = True
    integrated_visibility, most = (
        static.integrated([each.only(mine) for each in static_visibility]),
        max_subdivisions(len(sample_times), MAX_SUBDIVISIONS),
    )
    found = choose_refinement(
        LEAVE_ONE_OUT_SCALE * _single(static, some, left[some], integrated_visibility),
        np.broadcast_to(_phasors(static.paths, some), (len(some), len(sample_times))),
        left[some],
        width,
        np.ones(len(some), np.bool_),
        np.zeros(len(some), np.intp),
        np.array([static.level]),
        rtol,
        most,
        together_skipped,
    )
    found = found._replace(rest=np.hypot(found.rest, apart_skipped) / LEAVE_ONE_OUT_SCALE)
    if not len(found.facets):
        return nothing._replace(error=found.error())
    chosen, rounds = some[found.facets], max(found.rounds, 2)
    mine = np.zeros(len(left), np.bool_)
    mine[chosen] = True
    silhouette = np.max([each.silhouette for each in static_visibility], axis=0)
    nearest = min(each.nearest for each in static_visibility)

    def own(visibility: StaticVisibility) -> StaticVisibility:
        """Of a large room no more is kept than what is looked at."""
        return visibility._replace(left=visibility.left[chosen])

    known = {t: own(each.only(mine)) for t, each in zip(sample_times.tolist(), integrated_visibility, strict=True)}
    waves, every = _phasors(static.paths, chosen), np.zeros(len(chosen), np.intp)
    sent = 0
    while True:
        times = fine_times(sample_times, rounds)
        fresh = [t for t in times.tolist() if t not in known]
        sampled = []
        for t in fresh:
            visibility, count = static.resample(rays(t), chosen, silhouette, nearest)
            sampled.append(own(visibility))
            sent += count
        known |= zip(fresh, static.integrated(sampled), strict=True)
        occluders = [known[t] for t in times.tolist()]
        shares = np.stack([each.left for each in occluders], axis=1)
        gains, over_time = _single(static, chosen, shares, occluders), np.broadcast_to(waves, shares.shape)
        missed = missed_energy(gains, over_time, shares, found.width, every, 1)
        if np.sqrt(missed[0]) <= BETWEEN_PER_RTOL * rtol * static.level or rounds == most:
            break
        rounds = min(2 * rounds, most)
    rest = [each.only(~mine) for each in static_visibility]
    resampled = len(chosen) * (len(known) - len(sample_times))
    missed_edges = max(each.missed for each in known.values())
    return ActorOcclusion(
        sample_times, rest, times, chosen, occluders, found.error(missed), resampled, sent, missed_edges
    )


def interpolation_error(static: StaticTrace, paths: RadarPaths, left: FloatArray) -> float:
    """Estimated error between instants of further `paths` of the static scene, of a single knot, of which `left` (path,
    instant) is left, relative to :attr:`StaticTrace.level`."""
    some = np.flatnonzero((left != left[:, :1]).any(axis=1))
    if left.shape[1] < MIN_SAMPLE_TIMES or not len(some) or static.level == 0:
        return 0.0
    pattern_gain = static.returns.band.pattern_gain
    weight = np.sqrt(pattern_gain(paths.direction[some, 0]) * pattern_gain(paths.arrival[some, 0]))
    missed = leave_one_out((paths.a[0, 0, some, 0] * weight)[:, None] * left[some])
    together = rms((missed * _phasors(paths, some)).sum(axis=0)[None])[0]
    return max(float(np.linalg.norm(rms(missed))), float(together)) / static.level


def _at_most(
    static: StaticTrace, index: NDArray[np.intp], left: FloatArray, cut: FloatArray, width: FloatArray
) -> FloatArray:
    """(facet,) estimate, without its return being known, of how much each differs from what others of its times tell:
    for shares `left` (facet, instant) that come and go, and for edges that pass on over a facet of so many radians
    `width` (facet,), which cut by an edge returns `cut` (facet,) of
    :func:`rfgen_sionna.tracing.shadows.return_bounds.max_returns` at most."""
    weight = static.weight[index]
    whole = np.abs(static.paths.a[0, 0, index, 0]) * weight
    jumps = np.abs(leave_one_out(left.astype(np.complex128))).max(axis=1, initial=0.0)
    # A metal facet's gain is its area over 4 pi R^2, and twice its solid angle is what `cut` begins with.
    swing = width * np.abs(np.diff(left)).max(axis=1)
    return np.asarray(
        np.maximum(whole * jumps, weight * cut / (8 * np.pi) * np.sqrt(interpolation_loss(swing, left.shape[1] - 1)))
    )


def _single(
    static: StaticTrace, index: NDArray[np.intp], left: FloatArray, static_visibility: Sequence[StaticVisibility]
) -> ComplexArray:
    """(facet, time) gains of the first pair in the middle of the band, antennas included, of the facets that `index`
    counts out, of which `left` (facet, time) is left; the integrated
    `static_visibility` covers those hidden in part."""
    found = static.paths.a[0, 0, index] * left
    weights, rough = static.returns.expansion.weights[0, 0, 0], static.returns.rough
    row = np.full(len(static.facets), -1, np.intp)
    row[index] = np.arange(len(index))
    for k, each in enumerate(static_visibility):
        cut = np.unique(each.owner)
        mine = np.flatnonzero(row[cut] >= 0)
        if not len(mine):
            continue
        owner = cut[mine]
        own = static.fraction[owner] * (weights @ each.values[:, mine])
        if rough is not None:
            own = own + np.sqrt(static.fraction[owner] * left[row[owner], k]) * rough[0, 0, owner]
        found[row[owner], k] = own
        if each.boundary_correction is not None:
            correction = each.boundary_correction.within(owner)
            found[row[owner], k] += static.fraction[owner] * correction.of_first(len(owner))
    return np.asarray(found * static.weight[index][:, None])


def _phasors(paths: RadarPaths, index: NDArray[np.intp]) -> ComplexArray:
    """(path, 1) of the propagation, of the first pair in the middle of the band."""
    return phasors(paths.frequency * paths.tau[0, 0, index])
