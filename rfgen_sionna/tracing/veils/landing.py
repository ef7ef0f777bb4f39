"""Where plates show facets to the radar through slabs, on any leg of the way."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray, IntArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.bounces.landing import DIRECT, LandedFacets, Landing, LandingBand, joined, matched
from rfgen_sionna.tracing.bounces.shower import Shower
from rfgen_sionna.tracing.ghosts.image_band import MirroredFacets
from rfgen_sionna.tracing.ghosts.mirrors import Mirror
from rfgen_sionna.tracing.integral.facet import Nodes
from rfgen_sionna.tracing.integral.slabs import NO_SLAB, Screens, Slabs, SlabTable, over_instants, turned
from rfgen_sionna.tracing.shadows.visibility import FINE, GUIDE
from rfgen_sionna.tracing.surface.facets import Facets
from rfgen_sionna.tracing.veils.walk import MOST_SLABS, SHUT, Walk

LEGS = 4
"""From the one end to its plate, from there to the facet, and the same of the other end; what goes straight goes by the
second."""
_OTHER_WAY = [2, 3, 0, 1]
_SOURCE = -3
"""Label of the faces of the plate that a leg begins on."""


@dataclass(frozen=True)
class VeiledLanding(Landing):
    """Pieces of facets that are seen by way of plates and through at least one slab, at an instant."""

    crossed: NDArray[np.int64]
    """(entry, leg, depth) surfaces gone through, or `NO_SLAB`."""
    across: FloatArray
    """(entry, leg, depth, 3) the slabs' normals, summed over the sample points."""

    @staticmethod
    def none() -> VeiledLanding:
        plain = Landing.none()
        crossed = np.zeros((0, LEGS, MOST_SLABS), np.int64)
        return VeiledLanding(**_columns(plain, Landing), crossed=crossed, across=np.zeros((*crossed.shape, 3)))

    def swapped(self) -> VeiledLanding:
        """The same with both ways changed over."""
        crossed, across = self.crossed[:, _OTHER_WAY], self.across[:, _OTHER_WAY]
        return replace(self, first=self.last, last=self.first, crossed=crossed, across=across)

    @property
    def keys(self) -> NDArray[np.int64]:
        """(entry, 3 + leg depth) facet, plates and slabs."""
        plain = np.stack([self.facet, self.first, self.last], axis=1).astype(np.int64)
        return np.concatenate([plain, self.crossed.reshape(len(plain), LEGS * MOST_SLABS)], axis=1)

    def take(self, chosen: NDArray[np.bool_]) -> VeiledLanding:
        """The entries that `chosen` marks."""
        plain = _columns(super().take(chosen), Landing)
        return VeiledLanding(**plain, crossed=self.crossed[chosen], across=self.across[chosen])

    @staticmethod
    def joined(landings: Sequence[VeiledLanding]) -> VeiledLanding:
        """All entries, in ascending order of their keys; no key may be there twice."""
        landings = [each for each in landings if len(each.facet)]
        if not landings:
            return VeiledLanding.none()
        order = np.lexsort(np.concatenate([each.keys for each in landings]).T[::-1])
        return VeiledLanding(
            **_columns(joined(landings), Landing),
            crossed=np.concatenate([each.crossed for each in landings])[order],
            across=np.concatenate([each.across for each in landings])[order],
        )


@dataclass(frozen=True)
class VeiledLandedFacets(LandedFacets):
    """Facets as plates show them through slabs."""

    crossed: IntArray
    """(facet, leg, depth) surfaces gone through on the way from Tx and on that to Rx, or `NO_SLAB`."""
    across: FloatArray
    """(facet, leg, depth, 3) unit vectors across them."""

    @classmethod
    def over_time(
        cls, facets: Sequence[Facets], keys: NDArray[np.int64], landings: Sequence[VeiledLanding], swapped: bool
    ) -> list[VeiledLandedFacets]:
        """Facets by `keys`, sorted by their rows, at each instant."""
        places = [matched(keys, landing.keys) for landing in landings]
        normals = over_instants(places, [landing.across for landing in landings], len(keys))
        crossed = keys[:, 3:].reshape(-1, LEGS, MOST_SLABS).astype(np.int32)
        legs = _OTHER_WAY if swapped else list(range(LEGS))
        depth = max(1, int((crossed != NO_SLAB).sum(axis=2).max(initial=0)))
        return [
            cls(
                **_columns(LandedFacets.landed(each, keys, landing, swapped, place), LandedFacets),
                crossed=crossed[:, legs, :depth],
                across=across[:, legs, :depth],
            )
            for each, landing, place, across in zip(facets, landings, places, normals, strict=True)
        ]

    def between(self, after: MirroredFacets, share: float) -> VeiledLandedFacets:
        """With the slabs as they are a `share` of the way to what is seen `after`."""
        return replace(self, across=turned(self.across, _veiled(after).across, share))

    def take(self, index: NDArray[np.intp]) -> VeiledLandedFacets:
        """The facets that `index`, no number of them twice, counts out."""
        chosen = _columns(super().take(index), LandedFacets)
        return VeiledLandedFacets(**chosen, crossed=self.crossed[index], across=self.across[index])


def _columns(record: Any, kind: type) -> dict[str, Any]:
    return {each.name: getattr(record, each.name) for each in fields(kind)}


class VeiledLandingBand(LandingBand):
    """As :class:`~rfgen_sionna.tracing.bounces.landing.LandingBand`, for :class:`VeiledLandedFacets`."""

    def __init__(self, table: SlabTable, radar: Radar, rtol: float, mirrors: Sequence[Mirror], tx: bool, rx: bool):
        super().__init__(radar, rtol, mirrors, tx, rx)
        self._table = table

    def lengths(self, centroids: FloatArray, shown: MirroredFacets) -> FloatArray:
        """(tx, rx, facet) delays [s] by way of `centroids` (facet, 3) [m, world] and the mirrors of the facets, that of
        the slabs' bulk included."""
        shown = _veiled(shown)
        place, legs = centroids - self._origin, []
        for by, mirror, elements, first in ((self.tx, shown.first, self._tx, 0), (self.rx, shown.last, self._rx, 2)):
            seen, behind = place, shown.across[:, first + 1]
            if by:  # as the mirror shows it, and the slabs behind the mirror
                normal = self._normals[mirror]
                height = np.einsum("fi,fi->f", place, normal) + self._offsets[mirror]
                seen = place - 2.0 * height[:, None] * normal
                behind = behind - 2.0 * np.einsum("fdi,fi->fd", behind, normal)[..., None] * normal[:, None]
            offset = seen - elements[:, None]
            distance = np.linalg.norm(offset, axis=2)
            k = offset / np.maximum(distance, 1e-12)[..., None]
            for leg, across in ((first, shown.across[:, first]), (first + 1, behind)):
                distance = distance + self._table.lengths(shown.crossed[:, leg], across, k)
            legs.append(distance)
        return np.asarray((legs[0][:, None] + legs[1]) / SPEED_OF_LIGHT)

    def _by(self, facets: MirroredFacets, nodes: Nodes, index: NDArray[np.intp] | slice) -> dict[str, Any]:
        facets = _veiled(facets)

        def of(leg: int) -> Slabs | None:
            crossed = facets.crossed[:, leg]
            depth = int((crossed != NO_SLAB).sum(axis=1).max(initial=0))
            if depth == 0:
                return None
            across = facets.across[index, leg, :depth]
            return Slabs(self._table, crossed[index, :depth], np.repeat(across[:, :, None], 3, axis=2))

        screens = Screens(of(0), of(1)), Screens(of(2), of(3))
        return {**super()._by(facets, nodes, index), "screens": screens}


def _chains(landing: Landing) -> VeiledLanding:
    if not isinstance(landing, VeiledLanding):
        raise TypeError(f"landing is a {type(landing).__name__}: a VeiledLanding is needed")
    return landing


def _veiled(shown: MirroredFacets) -> VeiledLandedFacets:
    if not isinstance(shown, VeiledLandedFacets):
        raise TypeError(f"shown is a {type(shown).__name__}: VeiledLandedFacets are needed")
    return shown


class VeiledShower(Shower):
    """As :class:`~rfgen_sionna.tracing.bounces.shower.Shower`, for what is seen through slabs.

    Parameters
    ----------
    walk
        Goes through slabs of the geometry.
    through
        (surface,) amplitude that gets through each.
    least
        Of both ways together, what is not looked at any more.
    given
        What a :class:`~rfgen_sionna.tracing.bounces.shower.Shower` is made of.
    """

    def __init__(self, walk: Walk, through: FloatArray, least: float, *given: Any) -> None:
        super().__init__(*given)
        self._walk, self._amplitude, self._least = walk, np.append(through, 1.0), least  # the last one for NO_SLAB

    def land(self, index: NDArray[np.intp], first: int, last: int) -> VeiledLanding:
        """What is seen of the facets `index` by way of the plates `first` and `last`, which may be `DIRECT`, through at
        least one slab."""
        index, pieces, owner = self._cut(index, first, last)
        if len(pieces) == 0:
            return VeiledLanding.none()
        before = self._walk.sent
        every = np.arange(len(pieces))
        chains, normals = self._look(pieces, index[owner], first, last, GUIDE)
        alike = (chains == chains[:, :1]).all(axis=(1, 2))
        rows = [(every[alike], chains[alike], normals[alike])]
        if (~alike).any():
            mixed = every[~alike]
            rows.append((mixed, *self._look(pieces[mixed], index[owner[mixed]], first, last, FINE)))
        self.sent += self._walk.sent - before
        return self._gathered(index, pieces, owner, first, last, rows)

    def left(self, landing: Landing) -> FloatArray:
        """(entry,) of the amplitude at most, there and back, at normal incidence."""
        crossed = _chains(landing).crossed
        return np.asarray(np.where(crossed >= 0, self._amplitude[crossed], 1.0).prod(axis=(1, 2)))

    def again(self, rays: RayScene, pieces: Landing, chosen: NDArray[np.intp]) -> tuple[FloatArray, int]:
        """As :meth:`~rfgen_sionna.tracing.bounces.shower.Shower.again`: the share from where ways go through the same
        slabs as they did, and through nothing else."""
        pieces = _chains(pieces)
        other = copy(self)
        other._walk = self._walk.among(rays)
        share, entry = np.zeros(len(chosen)), pieces.owner[chosen]
        facet, own = pieces.facet[entry], pieces.crossed[entry].reshape(len(chosen), 1, -1)
        ways = np.stack([pieces.first[entry], pieces.last[entry]], axis=1)
        for first, last in np.unique(ways, axis=0).tolist():
            index = np.flatnonzero((ways == (first, last)).all(axis=1))
            corners = pieces.pieces[chosen[index]] - self._view
            chains, _ = other._look(corners, facet[index], first, last, GUIDE)
            share[index] = (chains[:, :1] == own[index]).all(axis=(1, 2))
            mixed = ~(chains == chains[:, :1]).all(axis=(1, 2))
            if mixed.any():
                index = index[mixed]
                chains, _ = other._look(corners[mixed], facet[index], first, last, FINE)
                share[index] = (chains == own[index]).all(axis=2).mean(axis=1)
        return share, other._walk.sent

    def _gathered(
        self,
        index: NDArray[np.intp],
        pieces: FloatArray,
        owner: NDArray[np.intp],
        first: int,
        last: int,
        rows: Sequence[tuple[NDArray[np.intp], NDArray[np.int64], FloatArray]],
    ) -> VeiledLanding:
        """Entries from pieces, and the chains and normals of their samples."""
        keys, weights, normals = [], [], []
        for piece, chains, across in rows:
            samples = chains.shape[1]
            key = np.concatenate([np.repeat(piece, samples)[:, None], chains.reshape(-1, LEGS * MOST_SLABS)], axis=1)
            seen = (key[:, 1] != SHUT) & (key[:, 1:] != NO_SLAB).any(axis=1)
            keys.append(key[seen])
            weights.append(np.full(int(seen.sum()), 1.0 / samples))
            normals.append(across.reshape(-1, LEGS, MOST_SLABS, 3)[seen])
        found, back = np.unique(np.concatenate(keys), axis=0, return_inverse=True)
        if len(found) == 0:
            return VeiledLanding.none()
        share = np.asarray(np.bincount(back.reshape(-1), np.concatenate(weights), len(found)), np.float64)
        across = np.zeros((len(found), LEGS, MOST_SLABS, 3))
        np.add.at(across, back.reshape(-1), np.concatenate(normals))
        piece = found[:, 0].astype(np.intp)
        found[:, 0] = index[owner[piece]]
        entries, entry = np.unique(found, axis=0, return_inverse=True)
        total = np.zeros((len(entries), LEGS, MOST_SLABS, 3))
        np.add.at(total, entry.reshape(-1), across)
        count = len(entries)
        return VeiledLanding(
            entries[:, 0].astype(np.intp),
            np.full(count, first, np.int32),
            np.full(count, last, np.int32),
            pieces[piece] + self._view,
            entry.reshape(-1),
            share,
            entries[:, 1:].reshape(count, LEGS, MOST_SLABS),
            total,
        )

    def _look(
        self, pieces: FloatArray, facet: NDArray[np.intp], first: int, last: int, weights: FloatArray
    ) -> tuple[NDArray[np.int64], FloatArray]:
        """(piece, sample, leg depth) surfaces on the ways to samples of pieces, `SHUT` where nothing gets through, and
        (piece, sample, leg, depth, 3) their normals."""
        targets = np.einsum("sc,pci->psi", weights, pieces).reshape(-1, 3)
        lane = np.repeat(facet, len(weights))
        one = self._way(targets, lane, first)
        other = one if last == first else self._way(targets, lane, last)
        chains = np.concatenate([one[0], other[0]], axis=1)
        left = np.where(chains >= 0, self._amplitude[chains], 1.0).prod(axis=(1, 2))
        chains[(chains == SHUT).any(axis=(1, 2)) | (left <= self._least)] = SHUT
        normals = np.concatenate([one[1], other[1]], axis=1)
        shape = len(pieces), len(weights)
        return chains.reshape(*shape, -1), normals.reshape(*shape, LEGS, MOST_SLABS, 3)

    def _way(self, targets: FloatArray, facet: NDArray[np.intp], plate: int) -> tuple[NDArray[np.int64], FloatArray]:
        """(target, 2, depth) surfaces before and behind the plate on the way to points relative to the viewpoint, with
        their normals."""
        number = self._facets.number[facet]
        chains = np.full((len(targets), 2, MOST_SLABS), NO_SLAB, np.int64)
        normals = np.zeros((*chains.shape, 3))
        if plate == DIRECT:
            chains[:, 1], normals[:, 1] = self._walk(self._view, targets + self._view, None, number)
            return chains, normals
        place, before = self._turning(targets, np.full(len(targets), plate, np.int32))
        chains[~before] = SHUT
        lane = np.flatnonzero(before)
        place, there = place[lane] + self._view, targets[lane] + self._view
        ends = np.full(len(lane), plate)
        chains[lane, 0], normals[lane, 0] = self._walk(self._view, place, self._owner, ends, exact=True)
        on = chains[lane, 0, 0] != SHUT
        lane, place, there = lane[on], place[on], there[on]
        label = np.where(self._owner == plate, _SOURCE, np.arange(len(self._owner)))
        starts = np.full(len(lane), _SOURCE)
        chains[lane, 1], normals[lane, 1] = self._walk(place, there, label, number[lane], starts)
        return chains, normals
