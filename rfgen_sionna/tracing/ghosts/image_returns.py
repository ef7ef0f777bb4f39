"""Returns by way of mirrors, as paths: to the accuracy that a weaker return beside the direct one needs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from rfgen_sionna._types import ComplexArray, FloatArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import RadarPaths, knot_weights
from rfgen_sionna.tracing.gains.accuracy import Finer
from rfgen_sionna.tracing.gains.band import Expansion
from rfgen_sionna.tracing.gains.probes import PROBES
from rfgen_sionna.tracing.ghosts.image_band import ImageBand, MirroredFacets
from rfgen_sionna.tracing.ghosts.mirrors import Mirror, Unfolding
from rfgen_sionna.tracing.integral.phasors import phasors
from rfgen_sionna.tracing.surface.facets import facet_paths, over_time, sums
from rfgen_sionna.tracing.surface.surfaces import Surface, lots

SHARE = 0.3
"""Share of the tolerance that the integral over the returns of one way may use up."""
LOOSEST = 0.03
"""Tolerance of such a return, relative to itself, however weak it is."""
PIECES = 100_000
"""Pieces of facets that are integrated at once."""
WAYS = ((True, False), (False, True), (True, True))
"""Whether the way from Tx, and that to Rx, goes by a mirror."""
STRAIGHT = (False, False)

Centroids = Callable[[float, NDArray[np.intp]], FloatArray]
"""Time [s] and ascending numbers of facets to their centroids (facet, 3) [m]."""
Mirrors = Callable[[float], tuple[Mirror, ...]]
"""Time [s] to the mirrors as they are then."""
Way = tuple[bool, bool]
Cut = tuple[NDArray[np.intp], FloatArray]
"""The facet (piece,) of pieces, and barycentric coordinates (piece, corner, 3) of their corners."""


def image_tolerance(rtol: float, level: float) -> float:
    """Tolerance of returns relative to themselves that are `level` against what `rtol` is relative to."""
    return float(np.clip(SHARE * rtol / max(level, 1e-12), SHARE * min(rtol, LOOSEST), LOOSEST))


class ImageReturns:
    """Integrates facets that mirrors show, over the band, for all element pairs and over time.

    Parameters
    ----------
    surfaces
        What the facets are of.
    names
        Those of objects and of parts.
    radar
        Where it stands.
    rtol
        Tolerance, relative to the direct return of each surface.
    mirrors
        Time [s] to the mirrors; where they stay, always the same ones.
    band
        What integrates the facets.
    """

    def __init__(
        self,
        surfaces: tuple[Surface, ...],
        names: tuple[tuple[str, ...], tuple[str, ...]],
        radar: Radar,
        rtol: float,
        mirrors: Mirrors,
        band: Callable[[Radar, float, Sequence[Mirror], bool, bool], ImageBand] = ImageBand,
    ) -> None:
        self._surfaces, self._names, self._radar, self._rtol = surfaces, names, radar, rtol
        self._materials = tuple(surface.material for surface in surfaces)
        self._viewpoint = np.asarray(radar.position)
        self._mirrors, self._kind = mirrors, band
        self._made = lru_cache(maxsize=64)(lambda mirrors, tolerance, way: band(radar, tolerance, mirrors, *way))
        self._expansions: dict[Way, tuple[float, Expansion]] = {}
        self._missed: dict[Way, float] = {}
        self._turn = 0

    def forget(self) -> None:
        """Choose the expansions anew."""
        self._expansions.clear()
        self._missed.clear()

    def finish(self, error: float) -> None:
        """Close a stretch of time whose returns together had this `error`."""
        self._turn += 1
        if error > 1.5 * self._rtol:
            self.forget()

    def __call__(
        self,
        way: Way,
        knots: FloatArray,
        instants: FloatArray,
        shown: Sequence[MirroredFacets],
        shares: FloatArray,
        facet: NDArray[np.intp],
        centroids: Centroids,
        usual: FloatArray,
        cut: Sequence[Cut] = (),
    ) -> tuple[RadarPaths, float]:
        """Paths by one of the `WAYS` and their error, relative to the direct returns `usual` (surface,).

        Parameters
        ----------
        knots, instants
            Where delays and gains are wanted, and where gains are given [s].
        shown
            Facets at each instant, the same ones.
        shares
            (instant, facet) how much of each counts.
        facet
            (facet,) number of each for `centroids`.
        cut
            What counts of some of them at each instant, instead of their share of the whole.
        """
        middle, first, last = len(instants) // 2, shown[0].first, shown[0].last
        mirrors = self._mirrors(float(instants[middle]))
        departing, arriving = self._directions(shown[middle].centroids, mirrors, first, last, way)
        probe = self._band(mirrors, way, LOOSEST)
        weight = shares[middle] * np.sqrt(probe.importance(departing) * probe.importance(arriving))
        tolerance, expansion = self._expansion(way, mirrors, shown[middle], weight, usual)
        bands = [self._band(self._mirrors(float(t)), way, tolerance) for t in instants]
        gains = [band(each, self._materials, expansion) for band, each in zip(bands, shown, strict=True)]
        error = self._error(bands[middle], shown[middle], weight, gains[middle], usual, way)
        for each, part in zip(gains, shares, strict=True):
            each *= part
        aside = np.zeros((len(instants), len(facet), 3))
        for k, pieces in enumerate(cut):
            self._put(pieces, gains[k], aside[k], bands[k], shown[k], expansion)
        if moved := bool(aside.any()):
            aside = _filled(aside, shares > 0)
        needed, back = np.unique(facet, return_inverse=True)

        def places(t: float) -> FloatArray:
            found = centroids(t, needed)[back.reshape(-1)]
            # What a rim sweeps over turns in phase with the middle of what is left of it.
            return found + np.tensordot(knot_weights(instants, np.array([t])), aside, 1)[0] if moved else found

        def shown_at(t: float) -> MirroredFacets:
            if len(instants) == 1:
                return shown[0]
            k = min(max(int(np.searchsorted(instants, t)) - 1, 0), len(instants) - 2)
            return shown[k].between(shown[k + 1], (t - instants[k]) / (instants[k + 1] - instants[k]))

        curves = over_time(
            knots,
            instants,
            np.stack(gains, axis=-1),
            lambda t: self._band(self._mirrors(t), way, tolerance).lengths(places(t), shown_at(t)),
        )
        directions = [self._directions(places(float(t)), self._mirrors(float(t)), first, last, way) for t in knots]
        departing, arriving = (np.stack([each[end] for each in directions], axis=1) for end in (0, 1))
        band = bands[middle]
        paths = facet_paths(
            self._surfaces,
            shown[0],
            knots,
            *curves,
            departing,
            band.centre,
            band.half_band,
            self._names,
            arriving,
            1 + sum(way) * max((each.bounces for each in mirrors), default=1),
        )
        return paths, error

    def _put(
        self,
        cut: Cut,
        gains: ComplexArray,
        aside: FloatArray,
        band: ImageBand,
        shown: MirroredFacets,
        expansion: Expansion,
    ) -> None:
        """Write what pieces of facets return to `gains` (order, tx, rx, facet), by way of their middle, and how far
        that is from the facet's to `aside` (facet, 3) [m]."""
        owner, pieces = cut
        if not len(owner):
            return
        own, of = np.unique(owner, return_inverse=True)
        one, other = (pieces[:, corner, :2] - pieces[:, 0, :2] for corner in (1, 2))
        area = np.abs(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0])
        total = np.maximum(np.bincount(of, area), 1e-300)
        middle = np.stack([np.bincount(of, area * each) for each in pieces.mean(axis=1).T], axis=1) / total[:, None]
        places = np.einsum("fc,fci->fi", middle, np.take(shown.corners, own, axis=0))
        aside[own] = places - shown.centroids[own]
        values = np.zeros((len(expansion.nodes), len(own)), np.complex128)
        for some in np.array_split(np.arange(len(owner)), -(-len(owner) // PIECES)):
            parts = cast(MirroredFacets, shown.cut(owner[some], pieces[some]))
            found = band.by_way_of(places[of[some]], parts, self._materials, expansion.nodes)
            gather = csr_array((np.ones(len(some)), (of[some], np.arange(len(some)))), shape=(len(own), len(some)))
            values += (gather @ found.T).T
        gains[..., own] = band.combined(expansion, values)

    def roughly(self, way: Way, t: float, shown: MirroredFacets, u: FloatArray) -> ComplexArray:
        """(probe, facet) roughly what each returns at `t` [s] to one pair at places `u` (probe,) of the band."""
        mirrors = self._mirrors(t)
        departing, arriving = self._directions(shown.centroids, mirrors, shown.first, shown.last, way)
        band = self._band(mirrors, way, LOOSEST)
        found = band.at_probes(shown, self._materials, u, (0, 0), np.minimum(shown.parts, 2).astype(np.int32))
        waves = found.a * phasors(band.frequency(u)[:, None] * found.tau)
        return np.asarray(waves * np.sqrt(band.importance(departing) * band.importance(arriving)))

    def levels(
        self, way: Way, t: float, shown: MirroredFacets, group: NDArray[np.intp], count: int
    ) -> tuple[FloatArray, FloatArray]:
        """(group,) roughly what groups of facets return at `t` [s], coherently and one by one, for one pair in the
        middle of the band; `group` (facet,) below `count`."""
        a = self.roughly(way, t, shown, np.zeros(1))
        total = np.abs(sums(a, group.astype(np.int32), count)[0])
        return total, np.sqrt(np.bincount(group, np.abs(a[0]) ** 2, count))

    def _band(self, mirrors: tuple[Mirror, ...], way: Way, tolerance: float) -> ImageBand:
        band: ImageBand = self._made(_ByIdentity(mirrors), tolerance, way)
        return band

    def _error(
        self,
        band: ImageBand,
        facets: MirroredFacets,
        weight: FloatArray,
        gains: NDArray[np.complex128],
        usual: FloatArray,
        way: Way,
    ) -> float:
        """Error relative to the returns' own or the direct return, whichever is more: with a new expansion at two pairs
        and over the band, which is remembered, then at one place after the other."""
        pairs, probes = [(0, 0), (gains.shape[1] - 1, gains.shape[2] - 1)], PROBES
        if way in self._missed:
            pairs = [(self._turn % gains.shape[1], (self._turn // gains.shape[1]) % gains.shape[2])]
            probes = PROBES[[self._turn % len(PROBES)]]
        known = band, facets, self._materials, weight
        found = [Finer.of(*known, pair, probes).of_expansion(gains[:, *pair], usual).error for pair in pairs]
        error = float(np.max(found, initial=0.0))
        return max(error, self._missed.setdefault(way, error))

    def _expansion(
        self,
        way: Way,
        mirrors: tuple[Mirror, ...],
        facets: MirroredFacets,
        weight: FloatArray,
        usual: FloatArray,
    ) -> tuple[float, Expansion]:
        if way not in self._expansions:
            lit = np.flatnonzero(weight > 0)
            facets, weight = facets.take(lit), weight[lit]
            rough = self._band(mirrors, way, LOOSEST)
            found = rough.at_probes(facets, self._materials, PROBES, (0, 0), facets.parts)
            phasor = phasors(rough.frequency(PROBES)[:, None] * found.tau)
            level = np.sqrt((np.abs(sums(found.a * phasor * weight, facets.surface, len(usual))) ** 2).mean(axis=0))
            # As accurate as the direct return of the surface whose images are strongest against it asks for.
            share = float(np.max(level / np.maximum(np.maximum(usual, level), 1e-300), initial=0.0))
            tolerance = image_tolerance(self._rtol, share)
            band = self._band(mirrors, way, tolerance)
            # Each actor's images are judged by themselves, if they matter beside its direct return; and each way round,
            # so that Tx and Rx may be changed over.
            matter = (level > SHARE * self._rtol * usual)[facets.surface]
            chosen = np.flatnonzero(matter) if matter.any() else np.arange(len(facets))
            judged = facets.take(chosen), self._materials, weight[chosen]
            self._expansions[way] = tolerance, band.expansion_for(*judged, apart=lots(self._surfaces))
        return self._expansions[way]

    def _directions(
        self,
        centroids: FloatArray,
        mirrors: tuple[Mirror, ...],
        first: NDArray[np.int32],
        last: NDArray[np.int32],
        way: Way,
    ) -> tuple[FloatArray, FloatArray]:
        """(facet, 3) unit vectors towards the first and the last interaction."""
        place = centroids - self._viewpoint
        unfolded = Unfolding(mirrors, self._viewpoint)

        def towards(by: bool, mirror: NDArray[np.int32]) -> FloatArray:
            seen = unfolded(place, mirror) if by else place
            return np.asarray(seen / np.maximum(np.linalg.norm(seen, axis=1, keepdims=True), 1e-12))

        return towards(way[0], first), towards(way[1], last)


def _filled(aside: FloatArray, seen: NDArray[np.bool_]) -> FloatArray:
    """(instant, facet, 3) the same where each is `seen` (instant, facet), elsewhere that of the nearest instant."""
    found, order = aside.copy(), np.arange(len(aside))
    for k in range(len(aside)):
        for nearest in sorted(order, key=lambda other: -abs(other - k)):  # the nearest last
            found[k] = np.where(seen[nearest][:, None], aside[nearest], found[k])
    return found


class _ByIdentity(tuple[Mirror, ...]):
    """Mirrors that are told apart by which objects they are, as arrays cannot be hashed."""

    def __hash__(self) -> int:
        return hash(tuple(map(id, self)))

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, tuple)
            and len(self) == len(other)
            and all(a is b for a, b in zip(self, other, strict=True))
        )

    def __ne__(self, other: object) -> bool:
        return not self == other
