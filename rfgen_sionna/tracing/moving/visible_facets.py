"""Facets at an instant and how much of them is seen: from the phase centre, and by pairs of elements."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.tracing.surface.facets import Facets


class PerElementVisibility(NamedTuple):
    """What pairs see of facets, where it may not be what the phase centre sees: one lane for each facet and pair."""

    facet: NDArray[np.intp]
    """(lane,)"""
    pair: NDArray[np.intp]
    """(lane,) number of its Tx times the number of Rx, and that of its Rx."""
    fraction: FloatArray
    """(lane,) share that is seen."""
    owner: NDArray[np.intp]
    """(piece,) lane that a piece is of, ascending: what is seen of facets that are hidden in part."""
    pieces: FloatArray
    """(piece, corner, 3) barycentric coordinates of its corners."""

    def shares(self, fraction: FloatArray, pairs: int) -> FloatArray:
        """(facet,) share that is seen by the mean of so many `pairs`, of facets of which the phase centre sees a
        `fraction` (facet,)."""
        more = np.bincount(self.facet, self.fraction - fraction[self.facet], len(fraction))
        return np.asarray(np.clip(fraction + more / pairs, 0.0, 1.0))

    def of(self, chosen: NDArray[np.intp]) -> PerElementVisibility:
        """Those of the facets that `chosen` counts out, ascending, counted among these."""
        place = np.minimum(np.searchsorted(chosen, self.facet), max(len(chosen) - 1, 0))
        mine = chosen[place] == self.facet if len(chosen) else np.zeros(len(self.facet), np.bool_)
        inside = mine[self.owner]
        lane = np.cumsum(mine) - 1
        return PerElementVisibility(
            place[mine], self.pair[mine], self.fraction[mine], lane[self.owner[inside]], self.pieces[inside]
        )

    @staticmethod
    def none() -> PerElementVisibility:
        """Of no facets."""
        no = np.zeros(0, np.intp)
        return PerElementVisibility(no, no, np.zeros(0), no, np.zeros((0, 3, 3)))

    @staticmethod
    def joined(parts: Sequence[PerElementVisibility], first: Sequence[int]) -> PerElementVisibility:
        """One after the other, each with its `first` facet."""
        lanes = np.cumsum([0, *(len(each.facet) for each in parts)]).tolist()
        return PerElementVisibility(
            np.concatenate([each.facet + start for each, start in zip(parts, first, strict=False)]),
            np.concatenate([each.pair for each in parts]),
            np.concatenate([each.fraction for each in parts]),
            np.concatenate([each.owner + start for each, start in zip(parts, lanes, strict=False)]),
            np.concatenate([each.pieces for each in parts]),
        )


class PerElementSamples(NamedTuple):
    """What pairs have found."""

    views: PerElementVisibility
    missed: FloatArray
    """(surface,) estimated error of what each returns, relative to a `level` (surface,) of that, as
    :attr:`rfgen_sionna.tracing.moving.visible_facets.VisibleFacets.level`."""
    level: FloatArray
    rays: int
    """Rays sent."""


@dataclass(frozen=True)
class VisibleFacets:
    """Facets at an instant and how much of them is seen."""

    facets: Facets
    fraction: FloatArray
    """(facet,) share of the area."""
    weight: FloatArray
    """(facet,) the antennas' two-way field gain towards each, over the largest; 0 for those that were not looked at, as
    they look away, are too far or too faint."""
    owner: NDArray[np.intp]
    """(piece,) facet that a piece is of: what is seen of those hidden in part."""
    pieces: FloatArray
    """(piece, corner, 3) barycentric coordinates of its corners."""
    occluder: FloatArray
    """(piece, 4) :attr:`rfgen_sionna.tracing.shadows.adaptive_sampling.Sampled.occluder`, or (piece, 16) with what
    slabs let
    through there (:mod:`rfgen_sionna.tracing.moving.slab_transmission`)."""
    silhouette: FloatArray
    """(facet,) length of outlines that fall on each [rad], as rays' points tell."""
    level: FloatArray
    """(surface,) what the facets of its lot (:func:`rfgen_sionna.tracing.surface.surfaces.tolerance_groups`) may
    return without
    interfering, in units of :attr:`rfgen_sionna.tracing.shadows.adaptive_sampling.Sampled.returned`."""
    missed: FloatArray
    """(surface,) estimated error of what those return for what is not known of shadows' edges, and for those that
    are too faint to be looked at, relative to what they return without interfering."""
    sampled_facets: int
    rays: int
    culled: FloatArray | float = 0.0
    """What of `missed` (surface,) is for facets too faint to be looked at."""
    per_element: PerElementVisibility | None = None
    """What pairs see of some facets from their own places, if they have looked."""

    def of(self, chosen: NDArray[np.intp]) -> VisibleFacets:
        """The facets that `chosen` counts out, in ascending order."""
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
        """Surfaces on which shadows fall that let something through."""
        slabs = (self.occluder[:, 4:] != 0).any(axis=1) & (self.occluder[:, 0] < 1.0)
        return np.unique(self.facets.surface[self.owner[slabs]])

    def any_visible(self) -> NDArray[np.bool_]:
        """(facet,) of which something is seen, by whatever pair."""
        found = self.fraction > 0
        if self.per_element is not None:
            found[self.per_element.facet] = True
        return found

    def shares(self, pairs: int) -> FloatArray:
        """(facet,) share of the area that is seen, in the mean of so many pairs if they have looked."""
        return self.fraction if self.per_element is None else self.per_element.shares(self.fraction, pairs)

    def with_per_element(self, sampled: PerElementSamples, surfaces: NDArray[np.bool_]) -> VisibleFacets:
        """The same with what pairs see themselves of some `surfaces` (surface,), in place of strips beside shadows'
        edges there."""
        occluder = np.where(surfaces[self.facets.surface[self.owner]][:, None], np.nan, self.occluder)
        visible = sampled.missed * sampled.level / np.where(self.level > 0, self.level, np.inf)
        missed = np.where(surfaces, np.hypot(self.culled, visible), self.missed)
        return replace(self, occluder=occluder, per_element=sampled.views, missed=missed, rays=self.rays + sampled.rays)

    @staticmethod
    def joined(parts: Sequence[VisibleFacets]) -> VisibleFacets:
        """One after the other; of `level` and `missed` the least and the largest."""
        first = np.cumsum([0, *(len(each.fraction) for each in parts)])
        fraction, weight, pieces, occluder, silhouette = (
            np.concatenate([getattr(each, name) for each in parts])
            for name in ("fraction", "weight", "pieces", "occluder", "silhouette")
        )
        return VisibleFacets(
            Facets.joined([each.facets for each in parts]),
            fraction,
            weight,
            np.concatenate([each.owner + start for each, start in zip(parts, first[:-1], strict=True)]),
            pieces,
            occluder,
            silhouette,
            np.min([each.level for each in parts], axis=0),
            np.max([each.missed for each in parts], axis=0),
            sum(each.sampled_facets for each in parts),
            sum(each.rays for each in parts),
            np.max([np.broadcast_to(each.culled, len(each.level)) for each in parts], axis=0),
            _joined_elements([each.per_element for each in parts], first.tolist()),
        )


def _joined_elements(parts: Sequence[PerElementVisibility | None], first: Sequence[int]) -> PerElementVisibility | None:
    """Own views of facets that come one after the other, each part's from its `first` on."""
    if all(each is None for each in parts):
        return None
    return PerElementVisibility.joined([PerElementVisibility.none() if each is None else each for each in parts], first)
