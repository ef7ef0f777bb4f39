"""Paths via mirrors, with accuracy in proportion to their level."""

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
from rfgen_sionna.tracing.gains.band import Expansion
from rfgen_sionna.tracing.gains.error_estimate import RefinedReturns
from rfgen_sionna.tracing.gains.expansion import PROBES
from rfgen_sionna.tracing.ghosts.image_band import ImageBand, MirroredFacets
from rfgen_sionna.tracing.ghosts.mirror_images import Mirror, Unfolding
from rfgen_sionna.tracing.integral.propagation import phasors
from rfgen_sionna.tracing.surface.facets import facet_paths, over_time, sum_by_surface
from rfgen_sionna.tracing.surface.surfaces import Surface, tolerance_groups

TOLERANCE_SHARE = 0.3
"""Share of the tolerance for the integral over the returns of one leg combination."""
MAX_TOLERANCE = 0.03
"""Largest relative tolerance of a return, however weak."""
MAX_BATCH = 100_000
"""Facet pieces per integration batch; bounds memory."""
LEG_COMBINATIONS = ((True, False), (False, True), (True, True))
"""Whether the leg from Tx, and that to Rx, has a mirror."""
NO_MIRRORS = (False, False)

Centroids = Callable[[float, NDArray[np.intp]], FloatArray]
"""Time [s] and ascending facet numbers to centroids (facet, 3) [m]."""
MirrorsAt = Callable[[float], tuple[Mirror, ...]]
"""Time [s] to the mirrors at that time."""
MirroredLegs = tuple[bool, bool]
CutFacets = tuple[NDArray[np.intp], FloatArray]
"""Facet (piece,) and barycentric corners (piece, corner, 3) of pieces."""


def image_tolerance(rtol: float, level: float) -> float:
    """Relative tolerance of returns at `level` over the reference of `rtol`."""
    return float(
        np.clip(TOLERANCE_SHARE * rtol / max(level, 1e-12), TOLERANCE_SHARE * min(rtol, MAX_TOLERANCE), MAX_TOLERANCE)
    )


class ImageReturns:
    """Integrates mirrored facets over the band, element pairs and time.

    `names` are those of objects and parts, `rtol` is relative to the direct return of each surface. `mirrors` returns
    the mirrors at a time [s], the same objects if static; `band` constructs the integrator.
    """

    def __init__(
        self,
        surfaces: tuple[Surface, ...],
        names: tuple[tuple[str, ...], tuple[str, ...]],
        radar: Radar,
        rtol: float,
        mirrors: MirrorsAt,
        band: Callable[[Radar, float, Sequence[Mirror], bool, bool], ImageBand] = ImageBand,
    ) -> None:
        self._surfaces, self._names, self._radar, self._rtol = surfaces, names, radar, rtol
        self._materials = tuple(surface.material for surface in surfaces)
        self._viewpoint = np.asarray(radar.position)
        self._mirrors = mirrors
        self._band = lru_cache(maxsize=64)(lambda mirrors, legs, tolerance: band(radar, tolerance, mirrors, *legs))
        self._expansions: dict[MirroredLegs, tuple[float, Expansion]] = {}
        self._missed: dict[MirroredLegs, float] = {}
        self._turn = 0

    def reset(self) -> None:
        """Discard the expansions."""
        self._expansions.clear()
        self._missed.clear()

    def finish(self, error: float) -> None:
        """Finish an interval whose returns had this `error`."""
        self._turn += 1
        if error > 1.5 * self._rtol:
            self.reset()

    def __call__(
        self,
        legs: MirroredLegs,
        knots: FloatArray,
        sample_times: FloatArray,
        visible_facets: Sequence[MirroredFacets],
        shares: FloatArray,
        facet: NDArray[np.intp],
        centroids: Centroids,
        reference_level: FloatArray,
        cut: Sequence[CutFacets] = (),
    ) -> tuple[RadarPaths, float]:
        """Paths of one of the `LEG_COMBINATIONS` and their error, relative to the direct returns `reference_level`
        (surface,).

        Delays and gains are for `knots` [s], from the same facets at each of the `sample_times` [s], with visible
        `shares` (sample time, facet). `facet` (facet,) numbers them for `centroids`; pieces in `cut` replace shares of
        some.
        """
        middle, first, last = len(sample_times) // 2, visible_facets[0].first, visible_facets[0].last
        mirrors = self._mirrors(float(sample_times[middle]))
        departing, arriving = self._directions(visible_facets[middle].centroids, mirrors, first, last, legs)
        probe = self._band(mirrors, legs, MAX_TOLERANCE)
        weight = shares[middle] * np.sqrt(probe.pattern_gain(departing) * probe.pattern_gain(arriving))
        tolerance, expansion = self._expansion(legs, mirrors, visible_facets[middle], weight, reference_level)
        bands = [self._band(self._mirrors(float(t)), legs, tolerance) for t in sample_times]
        gains = [band(each, self._materials, expansion) for band, each in zip(bands, visible_facets, strict=True)]
        error = self._error(bands[middle], visible_facets[middle], weight, gains[middle], reference_level, legs)
        for each, part in zip(gains, shares, strict=True):
            each *= part
        aside = np.zeros((len(sample_times), len(facet), 3))
        for k, pieces in enumerate(cut):
            self._put(pieces, gains[k], aside[k], bands[k], visible_facets[k], expansion)
        if moved := bool(aside.any()):
            aside = _fill_unseen(aside, shares > 0)
        needed, back = np.unique(facet, return_inverse=True)

        def places(t: float) -> FloatArray:
            found = centroids(t, needed)[back.reshape(-1)]
            # The phase follows the centroid of the visible part.
            return found + np.tensordot(knot_weights(sample_times, np.array([t])), aside, 1)[0] if moved else found

        def facets_at(t: float) -> MirroredFacets:
            if len(sample_times) == 1:
                return visible_facets[0]
            k = min(max(int(np.searchsorted(sample_times, t)) - 1, 0), len(sample_times) - 2)
            return visible_facets[k].between(
                visible_facets[k + 1], (t - sample_times[k]) / (sample_times[k + 1] - sample_times[k])
            )

        curves = over_time(
            knots,
            sample_times,
            np.stack(gains, axis=-1),
            lambda t: self._band(self._mirrors(t), legs, tolerance).lengths(places(t), facets_at(t)),
        )
        directions = [self._directions(places(float(t)), self._mirrors(float(t)), first, last, legs) for t in knots]
        departing, arriving = (np.stack([each[end] for each in directions], axis=1) for end in (0, 1))
        span = bands[middle].centre, bands[middle].half_band
        bounces = 1 + sum(legs) * max((each.bounces for each in mirrors), default=1)
        paths = facet_paths(
            self._surfaces, visible_facets[0], knots, *curves, departing, *span, self._names, arriving, bounces
        )
        return paths, error

    def _put(
        self,
        cut: CutFacets,
        gains: ComplexArray,
        aside: FloatArray,
        band: ImageBand,
        visible_facets: MirroredFacets,
        expansion: Expansion,
    ) -> None:
        """Write gains of pieces to `gains` (order, tx, rx, facet) and their centroids' offsets to `aside` (facet, 3)
        [m]."""
        owner, pieces = cut
        if not len(owner):
            return
        own, of = np.unique(owner, return_inverse=True)
        one, other = (pieces[:, corner, :2] - pieces[:, 0, :2] for corner in (1, 2))
        area = np.abs(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0])
        total = np.maximum(np.bincount(of, area), 1e-300)
        middle = np.stack([np.bincount(of, area * each) for each in pieces.mean(axis=1).T], axis=1) / total[:, None]
        places = np.einsum("fc,fci->fi", middle, np.take(visible_facets.corners, own, axis=0))
        aside[own] = places - visible_facets.centroids[own]
        values = np.zeros((len(expansion.nodes), len(own)), np.complex128)
        for some in np.array_split(np.arange(len(owner)), -(-len(owner) // MAX_BATCH)):
            parts = cast(MirroredFacets, visible_facets.cut(owner[some], pieces[some]))
            found = band.gains_via(places[of[some]], parts, self._materials, expansion.nodes)
            gather = csr_array((np.ones(len(some)), (of[some], np.arange(len(some)))), shape=(len(own), len(some)))
            values += (gather @ found.T).T
        gains[..., own] = band.combined(expansion, values)

    def estimate(self, legs: MirroredLegs, t: float, visible_facets: MirroredFacets, u: FloatArray) -> ComplexArray:
        """(probe, facet) approximate returns at `t` [s] for one pair at positions `u` (probe,) in the band."""
        mirrors = self._mirrors(t)
        departing, arriving = self._directions(
            visible_facets.centroids, mirrors, visible_facets.first, visible_facets.last, legs
        )
        band = self._band(mirrors, legs, MAX_TOLERANCE)
        found = band.at_probes(
            visible_facets, self._materials, u, (0, 0), np.minimum(visible_facets.parts, 2).astype(np.int32)
        )
        waves = found.a * phasors(band.frequency(u)[:, None] * found.tau)
        return np.asarray(waves * np.sqrt(band.pattern_gain(departing) * band.pattern_gain(arriving)))

    def levels(
        self, legs: MirroredLegs, t: float, visible_facets: MirroredFacets, group: NDArray[np.intp], count: int
    ) -> tuple[FloatArray, FloatArray]:
        """(group,) approximate coherent and incoherent returns at `t` [s] for one pair at the centre frequency."""
        a = self.estimate(legs, t, visible_facets, np.zeros(1))
        total = np.abs(sum_by_surface(a, group.astype(np.int32), count)[0])
        return total, np.sqrt(np.bincount(group, np.abs(a[0]) ** 2, count))

    def _error(
        self,
        band: ImageBand,
        facets: MirroredFacets,
        weight: FloatArray,
        gains: NDArray[np.complex128],
        reference_level: FloatArray,
        legs: MirroredLegs,
    ) -> float:
        """Error relative to the direct or own returns, whichever is larger: at first at two pairs over the band, later
        at one pair and position at a time."""
        pairs, probes = [(0, 0), (gains.shape[1] - 1, gains.shape[2] - 1)], PROBES
        if legs in self._missed:
            pairs = [(self._turn % gains.shape[1], (self._turn // gains.shape[1]) % gains.shape[2])]
            probes = PROBES[[self._turn % len(PROBES)]]
        known = band, facets, self._materials, weight
        found = [
            RefinedReturns.of(*known, pair, probes).of_expansion(gains[:, *pair], reference_level).error
            for pair in pairs
        ]
        error = float(np.max(found, initial=0.0))
        return max(error, self._missed.setdefault(legs, error))

    def _expansion(
        self,
        legs: MirroredLegs,
        mirrors: tuple[Mirror, ...],
        facets: MirroredFacets,
        weight: FloatArray,
        reference_level: FloatArray,
    ) -> tuple[float, Expansion]:
        if legs not in self._expansions:
            unoccluded = np.flatnonzero(weight > 0)
            facets, weight = facets.take(unoccluded), weight[unoccluded]
            rough = self._band(mirrors, legs, MAX_TOLERANCE)
            found = rough.at_probes(facets, self._materials, PROBES, (0, 0), facets.parts)
            phasor = phasors(rough.frequency(PROBES)[:, None] * found.tau)
            returns = sum_by_surface(found.a * phasor * weight, facets.surface, len(reference_level))
            level = np.sqrt((np.abs(returns) ** 2).mean(axis=0))
            # The surface with the strongest images relative to its direct return sets the tolerance.
            share = float(np.max(level / np.maximum(np.maximum(reference_level, level), 1e-300), initial=0.0))
            tolerance = image_tolerance(self._rtol, share)
            band = self._band(mirrors, legs, tolerance)
            # Significant images of each tolerance group are controlled separately, for reciprocity.
            matter = (level > TOLERANCE_SHARE * self._rtol * reference_level)[facets.surface]
            chosen = np.flatnonzero(matter) if matter.any() else np.arange(len(facets))
            judged = facets.take(chosen), self._materials, weight[chosen]
            self._expansions[legs] = tolerance, band.expansion_for(*judged, apart=tolerance_groups(self._surfaces))
        return self._expansions[legs]

    def _directions(
        self,
        centroids: FloatArray,
        mirrors: tuple[Mirror, ...],
        first: NDArray[np.int32],
        last: NDArray[np.int32],
        legs: MirroredLegs,
    ) -> tuple[FloatArray, FloatArray]:
        """(facet, 3) unit vectors towards the first and the last interaction."""
        place = centroids - self._viewpoint
        unfolded = Unfolding(mirrors, self._viewpoint)

        def towards(by: bool, mirror: NDArray[np.int32]) -> FloatArray:
            visible = unfolded(place, mirror) if by else place
            return np.asarray(visible / np.maximum(np.linalg.norm(visible, axis=1, keepdims=True), 1e-12))

        return towards(legs[0], first), towards(legs[1], last)


def _fill_unseen(aside: FloatArray, visible: NDArray[np.bool_]) -> FloatArray:
    """(sample time, facet, 3) `aside` of each facet's nearest sample time at which it is `visible`."""
    found, order = aside.copy(), np.arange(len(aside))
    for k in range(len(aside)):
        for nearest in sorted(order, key=lambda other: -abs(other - k)):  # the nearest last
            found[k] = np.where(visible[nearest][:, None], aside[nearest], found[k])
    return found
