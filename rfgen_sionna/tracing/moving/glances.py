"""Glances between instants at facets that shadows' edges pass over.

Gains are splines through instants. Where the edge of a shadow moves over a facet, above all over a large one seen
aslant, its gain changes with the wavelengths that the edge passes and not with the turns of the body: in a walking
person a few facets of thousands, behind the arm that swings. By how much splines miss them between instants is told by
leaving each instant out in turn. Those that matter are looked at in between as well, and go by paths of their own.

Instants tell of edges that they see. What hides a facet for less than the time between two of them, a rod of 2 cm at
1.5 m/s, may be missed by all; and what ghosts and slabs show of actors follows its instants alone. Of what actors hide
of the static scene :mod:`rfgen_sionna.tracing.static.glances` takes care.
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
from rfgen_sionna.tracing.integral.phasors import phasors
from rfgen_sionna.tracing.moving.knots import QUIET_GAPS, Splined
from rfgen_sionna.tracing.moving.missed import edged, largest_energy, left_out, lost, missed_of, rms
from rfgen_sionna.tracing.moving.returns import AT_ONCE, FacetReturns, Lit
from rfgen_sionna.tracing.moving.sight import Sight
from rfgen_sionna.tracing.moving.slab_edges import carried_on
from rfgen_sionna.tracing.moving.views import Seen
from rfgen_sionna.tracing.shadows.parallax import Parallax
from rfgen_sionna.tracing.shadows.return_bounds import returns_at_most
from rfgen_sionna.tracing.surface.bend import Bend
from rfgen_sionna.tracing.surface.facets import Facets

BETWEEN_PER_RTOL = 3.0
"""What a return may err by between instants for shadows that move on, relative to itself [root mean square over time],
per unit of the tolerance: as much as for gains that turn with the body."""
MOST = 8
"""Times from one instant to the next, at most; twice as many from the first of three to the second."""
_EACH = 0.7
"""Share of that which facets that are looked at in between may err by, and the others."""
FEWEST = 3
"""Instants that tell anything."""


class Chosen(NamedTuple):
    """Facets to be looked at between instants."""

    facets: NDArray[np.intp]
    """(chosen,) ascending."""
    rounds: int
    """Times from one instant to the next."""
    rest: FloatArray
    """(surface,) estimated error of all others between instants."""
    level: FloatArray
    """(surface,) return that errors are relative to."""
    width: FloatArray
    """(chosen,) phase between the ends of each facet, both ways [rad]."""

    def error(self, followed: FloatArray | float = 0.0) -> float:
        """Estimated relative error between times of the worst surface, of which the chosen facets have the energy
        `followed` (surface,)."""
        energy = self.rest**2 + followed
        return float(np.sqrt(energy / np.where(self.level > 0, self.level, np.inf) ** 2).max(initial=0.0))


def choose(
    gains: ComplexArray,
    phasors: ComplexArray,
    shares: FloatArray,
    width: FloatArray,
    steady: NDArray[np.bool_],
    surface: NDArray[np.integer[Any]],
    level: FloatArray,
    rtol: float,
    most: int = MOST,
    aside: ComplexArray | None = None,
) -> Chosen:
    """Choose facets that splines through the instants miss most of, where all that edges pass over miss more than the
    tolerance.

    Parameters
    ----------
    gains, phasors
        (facet, instant) of one pair at one frequency, antennas included, and of the propagation, at `FEWEST` or more
        evenly spaced instants.
    shares
        (facet, instant) of the area that is seen.
    width
        (facet,) phase between the ends of each facet, both ways [rad].
    steady
        (facet,) whether a facet faces the radar all the time; others are not chosen.
    surface
        (facet,) position in the list of surfaces.
    level
        (surface,) return that errors are relative to.
    rtol
        Relative tolerance.
    most
        Times from one instant to the next, at most.
    aside
        (inner instant,) what is missed of others of the only surface there is, which are not to be chosen.
    """
    chosen, rounds, rest = [np.zeros(0, np.intp)], 1, np.zeros(len(level))
    missed = np.where(edged(shares)[:, None], left_out(gains), 0.0)
    # An edge that moves on by a wavelength from one instant to the next may seem to rest.
    swing = width * np.abs(np.diff(shares)).max(axis=1)
    seen = np.where(edged(shares), largest_energy(gains), 0.0)
    gaps = gains.shape[1] - 1
    energy = np.maximum(largest_energy(missed), seen * lost(swing, gaps))
    missed = missed * phasors[:, 1:-1]
    for number in range(len(level)):
        mine = np.flatnonzero(surface == number)
        allowed = BETWEEN_PER_RTOL * rtol * level[number]
        able = mine[steady[mine] & (energy[mine] > 0)]
        able = able[np.argsort(-energy[able], kind="stable")]
        # What the others miss when the first so many are followed: one by one, and as they add up, side by side.
        apart, together = np.zeros(len(able) + 1), np.zeros((len(able) + 1, missed.shape[1]), np.complex128)
        np.cumsum(energy[able], out=apart[1:])
        np.cumsum(missed[able], axis=0, out=together[1:])
        others = np.sqrt(np.maximum(energy[mine].sum() - apart, 0.0))
        left = missed[mine].sum(axis=0) if aside is None else missed[mine].sum(axis=0) + aside
        others = np.maximum(others, rms(left - together))
        count = 0
        if others[0] > allowed > 0:
            enough = np.maximum.accumulate(others[::-1])[::-1] <= _EACH * allowed
            count = int(enough.argmax()) if enough.any() else len(able)
            chosen.append(followed := able[:count])
            while (
                rounds < most and (seen * lost(swing / rounds, gaps * rounds))[followed].sum() > (_EACH * allowed) ** 2
            ):
                rounds += 1
        rest[number] = others[count]
    found = np.sort(np.concatenate(chosen))
    return Chosen(found, rounds, rest, level, width[found])


def moved(first: Seen, last: Seen, viewpoint: FloatArray, wavenumber: float, lot: IntArray) -> FloatArray:
    """(surface,) how much of what each `lot` (surface,) returns without interfering may come or go from one instant to
    the next for shadows' edges that move on: what facets may return when an edge cuts them, by the share that changes,
    side by side. Where all edges go one way a line between both misses half of that at most; what comes back, or passes
    a facet as a whole in between, is not told (`STRAIGHT` and `PAIR_TURN` of
    :mod:`rfgen_sionna.tracing.moving.instants` keep it small)."""
    chosen = np.flatnonzero((first.fraction > 0) | (last.fraction > 0))
    facets = first.facets
    most, cut, _ = returns_at_most(np.take(facets.corners, chosen, axis=0) - viewpoint, wavenumber)
    before, after = first.fraction[chosen], last.fraction[chosen]
    weight, surface, count = np.maximum(first.weight, last.weight)[chosen], lot[facets.surface[chosen]], len(lot)
    change = np.bincount(surface, weight * cut * np.abs(after - before), count)
    level = np.sqrt(np.bincount(surface, 0.5 * (before**2 + after**2) * (weight * most) ** 2, count))
    return np.where(level > 0, change / np.where(level > 0, level, 1.0), 0.0)


def most_rounds(instants: int, most: int = MOST) -> int:
    """Times from one to the next of so many instants, at most: `most`, twice as many of those further apart."""
    return most if instants - 1 > QUIET_GAPS else 2 * most


def fine_times(instants: FloatArray, rounds: int) -> FloatArray:
    """(time,) `rounds` of them from each of the evenly spaced `instants` [s] to the next, which are among them."""
    part = np.arange(rounds) / rounds  # those of twice as many hold these to the bit
    between = instants[:-1, None] + part * np.diff(instants)[:, None]
    return np.append(between, instants[-1])


class Followed(NamedTuple):
    """Facets that were looked at between instants."""

    times: FloatArray
    """(time,) [s]"""
    facets: Facets
    """As they are at the first of them."""
    coefficients: ComplexArray
    """(order, tx, rx, facet, time) of a path for each."""
    looked_at: int
    """Facets looked at, each as often as it was."""
    rays: int
    error: float
    """Estimated error of all facets between the times, relative to its return, of the worst surface."""


class Glances:
    """Finds the facets whose gains splines through instants miss, and looks at them in between."""

    def __init__(
        self,
        band: BandTracer,
        sight: Sight,
        returns: FacetReturns,
        viewpoint: FloatArray,
        max_range: float,
        rtol: float,
        lot: IntArray,
    ) -> None:
        self._band, self._sight, self._returns = band, sight, returns
        self._viewpoint, self._max_range, self._rtol = viewpoint, max_range, rtol
        self._pairs = int(np.prod([len(each) for each in band.elements]))
        self._lot = lot  # (surface,) what shares one tolerance

    def choose(
        self,
        facets: Sequence[Facets],
        references: Sequence[FloatArray],
        values: Sequence[ComplexArray],
        parallax: Sequence[Parallax | None],
        shares: FloatArray,
        expansion: Expansion,
        level: FloatArray,
    ) -> Chosen:
        """Which of the `facets` ask for it: their `values` (value, facet) at each instant, by way of the points
        `references` (facet, 3) [m], are those of what is seen of them, with the `parallax`, and `shares` (facet,
        instant) of the area; `level` (surface,) is what each surface's return usually is."""
        some = np.flatnonzero(edged(shares))
        if len(facets) < FEWEST or not len(some):
            return Chosen(np.zeros(0, np.intp), 1, np.zeros(len(level)), level, np.zeros(0))
        half = len(facets) // 2
        surface = self._lot[facets[half].surface]
        own = Facets.taken(facets, some)
        ends = lengths(own[half].corners - self._viewpoint)
        # Who comes into the range window is not coming out of a shadow.
        near = np.all([lengths(each.centroids - self._viewpoint) < self._max_range for each in own], axis=0)
        beside = [None if each is None else each.within(some) for each in parallax]
        found = choose(
            self._single(own[half], [each[:, some] for each in values], beside, expansion),
            np.concatenate([self._phasors(each[some]) for each in references], axis=1),
            np.where(near[:, None], shares[some], 1.0),
            4 * np.pi * self._band.highest / SPEED_OF_LIGHT * np.ptp(ends, axis=1),
            np.all([each.facing for each in own], axis=0),
            surface[some],
            level,
            self._rtol,
            most_rounds(len(facets)),
        )
        return found._replace(facets=some[found.facets])

    def follow(
        self,
        chosen: Chosen,
        followed: NDArray[np.intp],
        places: IntArray,
        instants: FloatArray,
        seen: Sequence[Seen],
        expansion: Expansion,
        positions: Splined,
        corners: Callable[[float], FloatArray],
        rays: RayScene,
        from_own_places: Callable[[Seen, float], Seen],
    ) -> Followed:
        """Look at the `chosen` facets, those that `followed` counts out of all that are `seen` at the `instants` [s],
        until splines miss no more than the tolerance, or as often as may be.

        `places` (facet, 3) are theirs of :func:`rfgen_sionna.tracing.shadows.sampling.touching`; `positions` and
        `corners` give those (vertex, 3) of all moving surfaces and theirs (facet, 3, 3) [m] at a time [s], and `rays`
        is the ray scene at one of the instants. What is seen at a time [s] is told `from_own_places` of pairs, where
        that counts.
        """
        at_instants = [each.of(followed) for each in seen]
        first, count = at_instants[0].facets, len(followed)
        known, looked = instants, replace(Seen.joined(at_instants), looked_at=0, rays=0)
        outline = np.max([each.outline for each in at_instants], axis=0)
        level = np.min([each.level for each in seen], axis=0)
        bends = [each.facets.bend for each in at_instants if each.facets.bend is not None]
        rounds = chosen.rounds
        while True:
            times = fine_times(instants, rounds)
            fresh = np.setdiff1d(times, known)
            positions.look_up(fresh)
            step = times_at_once(rays.num_facets, self._viewpoint, positions(float(instants[0])))
            for begin in range(0, len(fresh), step):
                some = fresh[begin : begin + step]
                there = np.stack([corners(t) for t in some.tolist()])
                facets = first.at(there, Bend.blended(bends, knot_weights(instants, some)))
                looks = self._sight.looks(rays, [positions(t) for t in some.tolist()], there)
                found = self._sight.glance(looks, facets, places, outline, level)
                found = carried_on(found, some, instants, seen, self._viewpoint)
                if seen[0].own is not None:
                    counted = replace(found, rays=0, looked_at=0), found
                    single = [counted[k == 0].of(np.arange(count * k, count * (k + 1))) for k in range(len(some))]
                    found = Seen.joined(
                        [from_own_places(each, t) for each, t in zip(single, some.tolist(), strict=True)]
                    )
                known, looked = np.concatenate([known, some]), Seen.joined([looked, found])
            # All that is known is at these times, though not in their order.
            order = np.argsort(known)
            own, references = looked.facets, looked.facets.centroids
            every = np.arange(len(own))
            lit = self._lit(looked, count, max(1, AT_ONCE // count), expansion)
            values = lit.values[0]
            by_time = [values[:, count * k : count * (k + 1)] for k in order]
            shares = looked.shares(self._pairs).reshape(-1, count)[order].T
            waves = self._phasors(references).reshape(-1, count)[order].T
            of_time = [None] * len(order) if lit.parallax[0] is None else lit.parallax[0].split(count, len(order))
            beside = [of_time[k] for k in order]
            gains = self._single(first, by_time, beside, expansion)
            own_lot, lots = self._lot[first.surface], len(chosen.level)
            missed = missed_of(gains, waves, shares, chosen.width, own_lot, lots)
            error = chosen.error(missed)
            if error <= BETWEEN_PER_RTOL * self._rtol or 2 * rounds > most_rounds(len(instants)):
                break
            rounds *= 2
        parts = [own.take(every[count * k : count * (k + 1)]) for k in order]
        coefficients, _ = self._returns.coefficients(parts, shares, by_time, expansion, np.arange(count), beside)
        return Followed(times, first, coefficients, looked.looked_at, looked.rays, error)

    def _lit(self, looked: Seen, count: int, most: int, expansion: Expansion) -> Lit:
        """What is seen of `count` facets at several times, each by way of its centroid, at so many times at most at
        once; as of a single instant."""
        found, parallax = list[ComplexArray](), list[Parallax]()
        for first in range(0, len(looked.facets), most * count):
            some = looked.of(np.arange(first, min(first + most * count, len(looked.facets))))
            own = some.facets
            times = len(own) // count
            lit = self._returns.seen([some], np.arange(len(own)), [own], [own.centroids], expansion, times)
            found += lit.values
            parallax += [each._replace(owner=each.owner + first) for each in lit.parallax if each is not None]
        values = found[0] if len(found) == 1 else np.concatenate(found, axis=1)
        beside = Parallax.joined(parallax) if parallax else None
        return Lit([], [values], [beside], lit.missed)

    def _phasors(self, reference: FloatArray) -> ComplexArray:
        """(facet, 1) of the propagation by way of the points `reference` (facet, 3) [m], as for :meth:`_single`."""
        return phasors(self._band.centre * self._band.delays(reference, (0, 0)))[:, None]

    def _single(
        self,
        facets: Facets,
        values: Sequence[ComplexArray],
        parallax: Sequence[Parallax | None],
        expansion: Expansion,
    ) -> ComplexArray:
        """(facet, time) gains of the first pair in the middle of the band, antennas included."""
        found = np.stack([expansion.weights[0, 0, 0] @ each for each in values], axis=-1)
        for k, beside in enumerate(parallax):
            if beside is not None:
                found[:, k] += beside.of_first(len(found))
        return np.asarray(found * self._band.importance(facets.directions(self._viewpoint))[:, None])
