"""Glances between instants at what actors hide of the static scene.

As of actors (:mod:`rfgen_sionna.tracing.moving.glances`): where the edge of a shadow moves on over a facet that lies
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
from rfgen_sionna.tracing.integral.phasors import phasors
from rfgen_sionna.tracing.moving.glances import BETWEEN_PER_RTOL, FEWEST, choose, fine_times, most_rounds
from rfgen_sionna.tracing.moving.missed import left_out, lost, missed_of, rms
from rfgen_sionna.tracing.shadows.return_bounds import returns_at_most
from rfgen_sionna.tracing.static.dimmed import Dimmed
from rfgen_sionna.tracing.static.shadows import Shadow
from rfgen_sionna.tracing.static.trace import StaticTrace

MOST = 32
"""What :data:`rfgen_sionna.tracing.moving.glances.MOST` is, of what stays: flat facets of rooms are wider than those of
bodies."""
LIKELY = 0.35
"""What splines through all instants mostly miss, of what they miss without one of them: only where that is above the
tolerance facets are looked at again. The error that is stated is all of it, as much as is missed where edges pass by
wavelengths at once."""

_SURE = 0.3
"""Share of the tolerance that facets which are not even integrated may err by, at most."""


class Hidden(NamedTuple):
    """What actors hide of the static scene's direct returns over a stretch of time."""

    instants: FloatArray
    """(instant,) [s]"""
    dimmed: Sequence[Dimmed]
    """What is left at each instant; of the facets below all is."""
    times: FloatArray
    """(time,) of the facets that were looked at in between [s]; none where there are none."""
    chosen: NDArray[np.intp]
    """(facet,) those facets, ascending."""
    looks: Sequence[Dimmed]
    """What is left of those at each of the times, integrated: their shares alone."""
    error: float
    """Estimated error between times, relative to :attr:`StaticTrace.level`."""
    looked_at: int
    """Facets looked at in between, each as often as it was."""
    rays: int
    """Rays sent for that."""
    missed: float
    """:attr:`Dimmed.missed` of the worst of the looks."""

    def shadows(self, static: StaticTrace) -> tuple[Shadow, ...]:
        """What is missing of the `static` paths."""
        found = static.shadows(self.instants, static.integrated(self.dimmed))
        return found if not len(self.times) else (*found, *static.shadows(self.times, self.looks, self.chosen))


def follow_hidden(
    static: StaticTrace,
    instants: FloatArray,
    dimmed: Sequence[Dimmed],
    rays: Callable[[float], RayScene],
    rtol: float,
) -> Hidden:
    """Look again at the static facets that splines through evenly spaced `instants` [s] miss, until they miss no more
    than the tolerance, or as often as may be.

    `dimmed` are :meth:`StaticTrace.visible` at the instants, and `rays` gives the ray scene at any other time [s].
    """
    nothing = Hidden(instants, dimmed, np.zeros(0), np.zeros(0, np.intp), (), 0.0, 0, 0, 0.0)
    left = np.stack([each.left for each in dimmed], axis=1)
    edged = (left != left[:, :1]).any(axis=1)
    edged[np.concatenate([each.owner for each in dimmed])] = True
    some = np.flatnonzero(edged)
    if len(instants) < FEWEST or not len(some):
        return nothing
    _, cut, width = returns_at_most(static.facets.corners[some] - static.viewpoint, static.returns.wavenumber)
    # Few of many facets may return enough to matter.
    at_most = LIKELY * _at_most(static, some, left[some], cut, width)
    order = np.argsort(at_most, kind="stable")
    whole = (static.paths.a[0, 0, some] * _phasors(static.paths, some))[:, 0] * static.weight[some]
    together = np.cumsum(LIKELY * left_out(whole[order, None] * left[some[order]]), axis=0)
    apart = np.sqrt(np.cumsum(at_most[order] ** 2))
    skipped = np.maximum.accumulate(np.maximum(apart, rms(together)))  # one by one, and as they add up, side by side
    sure = int(np.count_nonzero(skipped <= _SURE * BETWEEN_PER_RTOL * rtol * static.level))
    beside, aside = (apart[sure - 1], together[sure - 1]) if sure else (0.0, np.zeros(together.shape[1], np.complex128))
    rows = np.sort(order[sure:])
    some, width, mine = some[rows], width[rows], np.zeros(len(left), np.bool_)
    mine[some] = True
    told, most = static.integrated([each.only(mine) for each in dimmed]), most_rounds(len(instants), MOST)
    found = choose(
        LIKELY * _single(static, some, left[some], told),
        np.broadcast_to(_phasors(static.paths, some), (len(some), len(instants))),
        left[some],
        width,
        np.ones(len(some), np.bool_),
        np.zeros(len(some), np.intp),
        np.array([static.level]),
        rtol,
        most,
        aside,
    )
    found = found._replace(rest=np.hypot(found.rest, beside) / LIKELY)
    if not len(found.facets):
        return nothing._replace(error=found.error())
    chosen, rounds = some[found.facets], max(found.rounds, 2)
    mine = np.zeros(len(left), np.bool_)
    mine[chosen] = True
    outline = np.max([each.outline for each in dimmed], axis=0)
    nearest = min(each.nearest for each in dimmed)

    def own(look: Dimmed) -> Dimmed:
        """Of a large room no more is kept than what is looked at."""
        return look._replace(left=look.left[chosen])

    known = {t: own(each.only(mine)) for t, each in zip(instants.tolist(), told, strict=True)}
    waves, every = _phasors(static.paths, chosen), np.zeros(len(chosen), np.intp)
    sent = 0
    while True:
        times = fine_times(instants, rounds)
        fresh = [t for t in times.tolist() if t not in known]
        looked = []
        for t in fresh:
            look, count = static.glance(rays(t), chosen, outline, nearest)
            looked.append(own(look))
            sent += count
        known |= zip(fresh, static.integrated(looked), strict=True)
        looks = [known[t] for t in times.tolist()]
        shares = np.stack([each.left for each in looks], axis=1)
        gains, over_time = _single(static, chosen, shares, looks), np.broadcast_to(waves, shares.shape)
        missed = missed_of(gains, over_time, shares, found.width, every, 1)
        if np.sqrt(missed[0]) <= BETWEEN_PER_RTOL * rtol * static.level or rounds == most:
            break
        rounds = min(2 * rounds, most)
    rest = [each.only(~mine) for each in dimmed]
    asked = len(chosen) * (len(known) - len(instants))
    unknown = max(each.missed for each in known.values())
    return Hidden(instants, rest, times, chosen, looks, found.error(missed), asked, sent, unknown)


def missed_between(static: StaticTrace, paths: RadarPaths, left: FloatArray) -> float:
    """Estimated error between instants of further `paths` of the static scene, of a single knot, of which `left` (path,
    instant) is left, relative to :attr:`StaticTrace.level`."""
    some = np.flatnonzero((left != left[:, :1]).any(axis=1))
    if left.shape[1] < FEWEST or not len(some) or static.level == 0:
        return 0.0
    importance = static.returns.band.importance
    weight = np.sqrt(importance(paths.direction[some, 0]) * importance(paths.arrival[some, 0]))
    missed = left_out((paths.a[0, 0, some, 0] * weight)[:, None] * left[some])
    together = rms((missed * _phasors(paths, some)).sum(axis=0)[None])[0]
    return max(float(np.linalg.norm(rms(missed))), float(together)) / static.level


def _at_most(
    static: StaticTrace, index: NDArray[np.intp], left: FloatArray, cut: FloatArray, width: FloatArray
) -> FloatArray:
    """(facet,) estimate, without its return being known, of how much each differs from what others of its times tell:
    for shares `left` (facet, instant) that come and go, and for edges that pass on over a facet of so many radians
    `width` (facet,), which cut by an edge returns `cut` (facet,) of
    :func:`rfgen_sionna.tracing.shadows.return_bounds.returns_at_most` at most."""
    weight = static.weight[index]
    whole = np.abs(static.paths.a[0, 0, index, 0]) * weight
    jumps = np.abs(left_out(left.astype(np.complex128))).max(axis=1, initial=0.0)
    # A metal facet's gain is its area over 4 pi R^2, and twice its solid angle is what `cut` begins with.
    swing = width * np.abs(np.diff(left)).max(axis=1)
    return np.asarray(np.maximum(whole * jumps, weight * cut / (8 * np.pi) * np.sqrt(lost(swing, left.shape[1] - 1))))


def _single(static: StaticTrace, index: NDArray[np.intp], left: FloatArray, dimmed: Sequence[Dimmed]) -> ComplexArray:
    """(facet, time) gains of the first pair in the middle of the band, antennas included, of the facets that `index`
    counts out, of which `left` (facet, time) is left; the `dimmed`, integrated, tell it of those hidden in part."""
    found = static.paths.a[0, 0, index] * left
    weights, rough = static.returns.expansion.weights[0, 0, 0], static.returns.rough
    row = np.full(len(static.facets), -1, np.intp)
    row[index] = np.arange(len(index))
    for k, each in enumerate(dimmed):
        cut = np.unique(each.owner)
        mine = np.flatnonzero(row[cut] >= 0)
        if not len(mine):
            continue
        owner = cut[mine]
        own = static.fraction[owner] * (weights @ each.values[:, mine])
        if rough is not None:
            own = own + np.sqrt(static.fraction[owner] * left[row[owner], k]) * rough[0, 0, owner]
        found[row[owner], k] = own
        if each.parallax is not None:
            beside = each.parallax.within(owner)
            found[row[owner], k] += static.fraction[owner] * beside.of_first(len(owner))
    return np.asarray(found * static.weight[index][:, None])


def _phasors(paths: RadarPaths, index: NDArray[np.intp]) -> ComplexArray:
    """(path, 1) of the propagation, of the first pair in the middle of the band."""
    return phasors(paths.frequency * paths.tau[0, 0, index])
