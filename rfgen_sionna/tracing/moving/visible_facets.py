"""Facets at a sample time with their visible fraction, from the phase centre and per element pair."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.tracing.surface.facets import Facets


class PerElementVisibility(NamedTuple):
    """Visibility of facets from element pairs, where it may differ from that of the phase centre: one lane per facet
    and pair."""

    facet: NDArray[np.intp]
    """(lane,)"""
    pair: NDArray[np.intp]
    """(lane,) index of the Tx times the number of Rx, plus that of the Rx."""
    fraction: FloatArray
    """(lane,) visible fraction."""
    owner: NDArray[np.intp]
    """(piece,) lane of each visible piece of a partly occluded facet, ascending."""
    pieces: FloatArray
    """(piece, corner, 3) barycentric coordinates of the corners."""

    def shares(self, fraction: FloatArray, pairs: int) -> FloatArray:
        """(facet,) visible fraction, the mean over `pairs` element pairs; `fraction` (facet,) is that of the phase
        centre."""
        more = np.bincount(self.facet, self.fraction - fraction[self.facet], len(fraction))
        return np.asarray(np.clip(fraction + more / pairs, 0.0, 1.0))

    def of(self, chosen: NDArray[np.intp]) -> PerElementVisibility:
        """Lanes of the facets with ascending indices `chosen`, numbered among these."""
        place = np.minimum(np.searchsorted(chosen, self.facet), max(len(chosen) - 1, 0))
        mine = chosen[place] == self.facet if len(chosen) else np.zeros(len(self.facet), np.bool_)
        inside = mine[self.owner]
        lane = np.cumsum(mine) - 1
        return PerElementVisibility(
            place[mine], self.pair[mine], self.fraction[mine], lane[self.owner[inside]], self.pieces[inside]
        )

    @staticmethod
    def none() -> PerElementVisibility:
        """Empty."""
        no = np.zeros(0, np.intp)
        return PerElementVisibility(no, no, np.zeros(0), no, np.zeros((0, 3, 3)))

    @staticmethod
    def joined(parts: Sequence[PerElementVisibility], first: Sequence[int]) -> PerElementVisibility:
        """Concatenation; `first` is the index of each part's first facet."""
        lanes = np.cumsum([0, *(len(each.facet) for each in parts)]).tolist()
        return PerElementVisibility(
            np.concatenate([each.facet + start for each, start in zip(parts, first, strict=False)]),
            np.concatenate([each.pair for each in parts]),
            np.concatenate([each.fraction for each in parts]),
            np.concatenate([each.owner + start for each, start in zip(parts, lanes, strict=False)]),
            np.concatenate([each.pieces for each in parts]),
        )


class PerElementSamples(NamedTuple):
    """Result of per-element sampling."""

    views: PerElementVisibility
    missed: FloatArray
    """(surface,) estimated error of each return, relative to `level` (surface,), as of :attr:`VisibleFacets.level`."""
    level: FloatArray
    rays: int
    """Number of rays."""


@dataclass(frozen=True)
class VisibleFacets:
    """Facets at a sample time with their visible fraction."""

    facets: Facets
    fraction: FloatArray
    """(facet,) visible fraction of the area: the shadow weight of the facet's return."""
    weight: FloatArray
    """(facet,) two-way antenna field gain towards each, over the largest; 0 for facets that were not sampled: they face
    away, are too far or negligible."""
    owner: NDArray[np.intp]
    """(piece,) facet of each visible piece of the partly occluded ones."""
    pieces: FloatArray
    """(piece, corner, 3) barycentric coordinates of the corners."""
    occluder: FloatArray
    """(piece, 4) :attr:`rfgen_sionna.tracing.shadows.adaptive_sampling.SampledVisibility.occluder`, or (piece, 16) with
    the transmission of slabs there (:mod:`rfgen_sionna.tracing.moving.slab_transmission`)."""
    silhouette: FloatArray
    """(facet,) length of silhouettes on each facet [rad], from silhouette rays."""
    level: FloatArray
    """(surface,) incoherent sum of the facets of the surface's tolerance group
    (:func:`rfgen_sionna.tracing.surface.surfaces.tolerance_groups`), in units of
    :attr:`rfgen_sionna.tracing.shadows.adaptive_sampling.SampledVisibility.returned`."""
    missed: FloatArray
    """(surface,) estimated error of that return for uncertain shadow boundaries and culled facets, relative to `level`.
    """
    sampled_facets: int
    rays: int
    culled: FloatArray | float = 0.0
    """(surface,) part of `missed` for culled facets."""
    per_element: PerElementVisibility | None = None
    """Visibility from element pairs; None without."""

    def of(self, chosen: NDArray[np.intp]) -> VisibleFacets:
        """The facets with ascending indices `chosen`."""
        place = np.minimum(np.searchsorted(chosen, self.owner), max(len(chosen) - 1, 0))
        mine = chosen[place] == self.owner if len(chosen) else np.zeros(len(self.owner), np.bool_)
        return replace(
            self,
            facets=self.facets.take(chosen),
            fraction=self.fraction[chosen],
            weight=self.weight[chosen],
            owner=place[mine],
            pieces=self.pieces[mine],
            occluder=self.occluder[mine],
            silhouette=self.silhouette[chosen],
            per_element=None if self.per_element is None else self.per_element.of(chosen),
        )

    def slab_shadowed_surfaces(self) -> NDArray[np.intp]:
        """Surfaces on which shadows of transmitting slabs fall."""
        slabs = (self.occluder[:, 4:] != 0).any(axis=1) & (self.occluder[:, 0] < 1.0)
        return np.unique(self.facets.surface[self.owner[slabs]])

    def any_visible(self) -> NDArray[np.bool_]:
        """(facet,) whether any pair sees any part of each."""
        found = self.fraction > 0
        if self.per_element is not None:
            found[self.per_element.facet] = True
        return found

    def shares(self, pairs: int) -> FloatArray:
        """(facet,) visible fraction, the mean over `pairs` element pairs where these are known."""
        return self.fraction if self.per_element is None else self.per_element.shares(self.fraction, pairs)

    def with_per_element(self, sampled: PerElementSamples, surfaces: NDArray[np.bool_]) -> VisibleFacets:
        """The same with per-element visibility of some `surfaces` (surface,) in place of the shadow-boundary
        correction."""
        occluder = np.where(surfaces[self.facets.surface[self.owner]][:, None], np.nan, self.occluder)
        visible = sampled.missed * sampled.level / np.where(self.level > 0, self.level, np.inf)
        missed = np.where(surfaces, np.hypot(self.culled, visible), self.missed)
        return replace(self, occluder=occluder, per_element=sampled.views, missed=missed, rays=self.rays + sampled.rays)

    @staticmethod
    def joined(parts: Sequence[VisibleFacets]) -> VisibleFacets:
        """Concatenation, with the least `level` and the largest `missed`."""
        first = np.cumsum([0, *(len(each.fraction) for each in parts)])
        fraction, weight, pieces, occluder, silhouette = (
            np.concatenate([getattr(each, name) for each in parts])
            for name in ("fraction", "weight", "pieces", "occluder", "silhouette")
        )
        owner = np.concatenate([each.owner + start for each, start in zip(parts, first[:-1], strict=True)])
        level, missed = np.min([each.level for each in parts], axis=0), np.max([each.missed for each in parts], axis=0)
        count, rays = sum(each.sampled_facets for each in parts), sum(each.rays for each in parts)
        culled = np.max([np.broadcast_to(each.culled, len(each.level)) for each in parts], axis=0)
        elements = _joined_elements([each.per_element for each in parts], first.tolist())
        given = fraction, weight, owner, pieces, occluder, silhouette, level, missed, count, rays, culled, elements
        return VisibleFacets(Facets.joined([each.facets for each in parts]), *given)


def _joined_elements(parts: Sequence[PerElementVisibility | None], first: Sequence[int]) -> PerElementVisibility | None:
    """Concatenation of per-element visibility; `first` is the index of each part's first facet."""
    if all(each is None for each in parts):
        return None
    return PerElementVisibility.joined([PerElementVisibility.none() if each is None else each for each in parts], first)
