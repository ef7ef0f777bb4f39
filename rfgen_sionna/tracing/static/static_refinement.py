"""Temporal refinement of shadows on the static scene.

The counterpart for actors is :mod:`rfgen_sionna.tracing.moving.temporal_refinement`. A shadow boundary that crosses an
oblique facet changes its return faster than splines through the sample times can follow. Such facets are sampled more
often and get knots of their own. The boundary's motion is estimated from the visible share: a rod across the middle of
a facet moves two boundaries at a constant share, and the estimate may be too low.
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
from rfgen_sionna.tracing.moving.knots import interpolation_loss, leave_one_out, missed_energy, rms
from rfgen_sionna.tracing.moving.temporal_refinement import (
    MIN_SAMPLE_TIMES,
    TIME_ERROR_PER_RTOL,
    choose_refinement,
    fine_times,
    max_subdivisions,
)
from rfgen_sionna.tracing.shadows.return_bounds import max_returns
from rfgen_sionna.tracing.static.actor_shadows import Shadow
from rfgen_sionna.tracing.static.static_trace import StaticTrace
from rfgen_sionna.tracing.static.static_visibility import StaticVisibility

MAX_SUBDIVISIONS = 32
"""Most parts of the gap between sample times. Larger than
:data:`rfgen_sionna.tracing.moving.temporal_refinement.MAX_SUBDIVISIONS`: flat facets of rooms are wider than bodies'.
"""
LEAVE_ONE_OUT_SCALE = 0.35
"""Typical error of a spline through all sample times over its leave-one-out error. Facets are refined by the scaled
error; the stated error is unscaled."""

_NEGLIGIBLE_SHARE = 0.3
"""Share of the tolerance that facets left out before integration may make up."""


class ActorOcclusion(NamedTuple):
    """Occlusion of the static scene's direct returns by actors over an interval."""

    sample_times: FloatArray
    """(sample time,) [s]"""
    static_visibility: Sequence[StaticVisibility]
    """Visibility at each sample time; refined facets count as fully visible."""
    times: FloatArray
    """(time,) times of the refined facets [s]; empty without any."""
    chosen: NDArray[np.intp]
    """(facet,) refined facets, ascending."""
    occluders: Sequence[StaticVisibility]
    """Integrated visibility of the refined facets alone, at each of their times."""
    error: float
    """Estimated error between times, relative to :attr:`StaticTrace.level`."""
    sampled_facets: int
    """Number of additional facet samples."""
    rays: int
    """Additional rays."""
    missed: float
    """Largest :attr:`StaticVisibility.missed` of the additional samples."""

    def shadows(self, static: StaticTrace) -> tuple[Shadow, ...]:
        """Shadows on the `static` paths."""
        found = static.shadows(self.sample_times, static.integrated(self.static_visibility))
        return found if not len(self.times) else (*found, *static.shadows(self.times, self.occluders, self.chosen))


def refine_occlusion(
    static: StaticTrace,
    sample_times: FloatArray,
    static_visibility: Sequence[StaticVisibility],
    rays: Callable[[float], RayScene],
    rtol: float,
) -> ActorOcclusion:
    """Resample static facets whose shadow is off between evenly spaced `sample_times` [s], until the tolerance is met
    or `MAX_SUBDIVISIONS` is reached.

    `static_visibility` is from :meth:`StaticTrace.visible` at the sample times; `rays` returns the ray scene at a time
    [s].
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
    skipped = np.maximum.accumulate(np.maximum(apart, rms(together)))  # incoherent and coherent
    sure = int(np.count_nonzero(skipped <= _NEGLIGIBLE_SHARE * TIME_ERROR_PER_RTOL * rtol * static.level))
    apart_skipped, together_skipped = (
        (apart[sure - 1], together[sure - 1]) if sure else (0.0, np.zeros(together.shape[1], np.complex128))
    )
    rows = np.sort(order[sure:])
    some, width, mine = some[rows], width[rows], np.zeros(len(left), np.bool_)
    mine[some] = True
    integrated_visibility = static.integrated([each.only(mine) for each in static_visibility])
    most = max_subdivisions(len(sample_times), MAX_SUBDIVISIONS)
    found = choose_refinement(
        LEAVE_ONE_OUT_SCALE * _single(static, some, left[some], integrated_visibility),
        np.broadcast_to(_phasors(static.paths, some), (len(some), len(sample_times))), left[some], width,
        np.ones(len(some), np.bool_), np.zeros(len(some), np.intp), np.array([static.level]), rtol, most,
        together_skipped,
    )  # fmt: skip
    found = found._replace(rest=np.hypot(found.rest, apart_skipped) / LEAVE_ONE_OUT_SCALE)
    if not len(found.facets):
        return nothing._replace(error=found.error())
    chosen, rounds = some[found.facets], max(found.rounds, 2)
    mine = np.zeros(len(left), np.bool_)
    mine[chosen] = True
    silhouette = np.max([each.silhouette for each in static_visibility], axis=0)
    nearest = min(each.nearest for each in static_visibility)

    def own(visibility: StaticVisibility) -> StaticVisibility:
        """The same for the chosen facets alone, to save memory."""
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
        if np.sqrt(missed[0]) <= TIME_ERROR_PER_RTOL * rtol * static.level or rounds == most:
            break
        rounds = min(2 * rounds, most)
    rest = [each.only(~mine) for each in static_visibility]
    resampled = len(chosen) * (len(known) - len(sample_times))
    missed_edges = max(each.missed for each in known.values())
    return ActorOcclusion(
        sample_times, rest, times, chosen, occluders, found.error(missed), resampled, sent, missed_edges
    )


def interpolation_error(static: StaticTrace, paths: RadarPaths, left: FloatArray) -> float:
    """Estimated error between sample times of indirect static `paths` (single knot) with visible share `left` (path,
    sample time), relative to :attr:`StaticTrace.level`."""
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
    """(facet,) bound of the leave-one-out error before integration, from shares `left` (facet, sample time) and from a
    boundary that crosses a facet of phase width `width` [rad] and return bound `cut` of
    :func:`rfgen_sionna.tracing.shadows.return_bounds.max_returns`."""
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
    """(facet, time) gains of the first element pair at the band's centre, antennas included, of the facets `index` with
    visible share `left` (facet, time); partly occluded ones are from the integrated `static_visibility`."""
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
    """(path, 1) propagation phasors of the first element pair at the band's centre."""
    return phasors(paths.frequency * paths.tau[0, 0, index])
