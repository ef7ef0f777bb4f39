"""Where plates show facets to the radar: ray tubes from a plate's outline, cut out of the facets that they land on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.materials import Material
from rfgen_sionna.tracing.ghosts.image_band import ImageBand, MirroredFacets
from rfgen_sionna.tracing.integral.facet import FacetGains, Into, Nodes, by_curvature, facet_gains
from rfgen_sionna.tracing.integral.obliquity import Media
from rfgen_sionna.tracing.surface.bend import barycentric
from rfgen_sionna.tracing.surface.facets import Facets

DIRECT = -1
"""Stands for the straight way, in place of a plate's number."""
NEAR = 1e-4
"""What lies nearer to a plate than this [m] is on it."""


@dataclass(frozen=True)
class Landing:
    """Pieces of facets that are seen by way of plates, at an instant."""

    facet: NDArray[np.intp]
    """(entry,) number of the facet; entries are in ascending order of `key`."""
    first: IntArray
    """(entry,) plate on the one way, or `DIRECT`."""
    last: IntArray
    """(entry,) plate on the other way."""
    pieces: FloatArray
    """(piece, 3, 3) [m], world."""
    owner: NDArray[np.intp]
    """(piece,) entry that each piece belongs to."""
    share: FloatArray
    """(piece,) how much of each is seen, above 0."""

    @staticmethod
    def none() -> Landing:
        empty = np.zeros(0, np.int32)
        return Landing(empty.astype(np.intp), empty, empty, np.zeros((0, 3, 3)), empty.astype(np.intp), np.zeros(0))

    def take(self, chosen: NDArray[np.bool_]) -> Landing:
        """The entries that `chosen` marks."""
        place = np.cumsum(chosen) - 1
        kept = chosen[self.owner]
        return Landing(
            self.facet[chosen],
            self.first[chosen],
            self.last[chosen],
            self.pieces[kept],
            place[self.owner[kept]],
            self.share[kept],
        )

    def swapped(self) -> Landing:
        """The same with both ways changed over."""
        return replace(self, first=self.last, last=self.first)

    @property
    def keys(self) -> NDArray[np.int64]:
        """(entry, 3) facet and plates."""
        return np.stack([self.facet, self.first, self.last], axis=1).astype(np.int64)


@dataclass(frozen=True)
class LandedFacets(MirroredFacets):
    """Facets as plates show them: of each only the pieces that are seen count."""

    pieces: FloatArray
    """(piece, 3, 3) [m], world."""
    owner: NDArray[np.intp]
    """(piece,) facet of each."""
    share: FloatArray
    """(piece,) what each counts."""

    @staticmethod
    def landed(
        facets: Facets,
        keys: NDArray[np.int64],
        landing: Landing,
        swapped: bool,
        place: NDArray[np.intp] | None = None,
    ) -> LandedFacets:
        """Facets by `keys` (facet, 3), sorted by their rows; what else is in `landing` is left out.

        `swapped` are seen the other way round: first the last plate. `place` is where in `keys` each entry is, if that
        is known.
        """
        chosen = facets.take(keys[:, 0]).pulled(None)
        base = {each.name: getattr(chosen, each.name) for each in fields(Facets)}
        first, last = (keys[:, column].astype(np.int32) for column in ((2, 1) if swapped else (1, 2)))
        at = (_rows(keys, landing.keys) if place is None else place)[landing.owner]
        kept = at >= 0
        return LandedFacets(
            **base,
            first=first,
            last=last,
            pieces=landing.pieces[kept],
            owner=at[kept],
            share=landing.share[kept],
        )

    def finer(self) -> tuple[LandedFacets, NDArray[np.intp]]:
        """The same in twice as many parts."""
        return replace(self, parts=2 * self.parts), np.arange(len(self))

    def times(self, factor: FloatArray) -> LandedFacets:
        """The same, of which each counts `factor` (facet,) times as much."""
        return replace(self, share=self.share * factor[self.owner])

    def take(self, index: NDArray[np.intp]) -> LandedFacets:
        """The facets that `index`, no number of them twice, counts out."""
        place = np.full(len(self), -1, dtype=np.intp)
        place[index] = np.arange(len(index))
        owner = place[self.owner]
        kept = owner >= 0
        chosen = super().take(index)
        return LandedFacets(
            **{each.name: getattr(chosen, each.name) for each in fields(MirroredFacets)},
            pieces=self.pieces[kept],
            owner=owner[kept],
            share=self.share[kept],
        )


def _rows(keys: NDArray[np.int64], wanted: NDArray[np.int64]) -> NDArray[np.intp]:
    """Where in `keys`, sorted by its rows, each row of `wanted` is; -1 where it is not."""
    if len(keys) == 0:
        return np.full(len(wanted), -1, dtype=np.intp)
    base = int(max(keys[:, 1:].max(), wanted[:, 1:].max(initial=0))) + 2
    powers = np.array([base * base, base, 1])
    shift = np.array([0, 1, 1])
    known, sought = (keys + shift) @ powers, (wanted + shift) @ powers
    place = np.minimum(np.searchsorted(known, sought), len(known) - 1)
    return np.where(known[place] == sought, place, -1)


def matched(keys: NDArray[np.int64], wanted: NDArray[np.int64]) -> NDArray[np.intp]:
    """As :func:`_rows`, for rows of any length, no two of them alike."""
    _, back = np.unique(np.concatenate([keys, wanted]), axis=0, return_inverse=True)
    back = back.reshape(-1)
    place = np.full(len(back), -1, dtype=np.intp)
    place[back[: len(keys)]] = np.arange(len(keys))
    return np.asarray(place[back[len(keys) :]])


class LandingBand(ImageBand):
    """As :class:`~rfgen_sionna.tracing.ghosts.image_band.ImageBand`, for :class:`LandedFacets`."""

    def _gains(
        self, facets: Facets, materials: tuple[Material, ...], nodes: Nodes, parts: IntArray | None = None
    ) -> FacetGains:
        from scipy.sparse import csr_array

        if not isinstance(facets, LandedFacets):
            raise TypeError(f"facets is a {type(facets).__name__}: LandedFacets are needed")
        owner = facets.owner
        media, parts = Media.at(materials, nodes.frequency, self.half_band), facets.parts if parts is None else parts
        reference = facets.centroids - self._origin
        bend = None
        if facets.bend is not None:
            bend = facets.bend.take(owner).within(barycentric(facets.pieces, facets.corners[owner]))

        def of(index: NDArray[np.intp] | slice, curved: bool, into: Into | None) -> FacetGains:
            whose = owner[index]
            return facet_gains(
                facets.pieces[index] - self._origin,
                facets.surface[whose],
                media,
                nodes,
                *self.fields,
                parts[whose],
                reference=reference[whose],
                bend=bend.take(index) if curved and bend is not None else None,
                into=into,
                **self._by(facets, nodes, whose),
            )

        found = by_curvature(None if facets.curved is None else facets.curved[owner], of)
        sums = csr_array((facets.share, (owner, np.arange(len(owner)))), shape=(len(facets), len(owner)))
        tau = np.zeros((len(nodes), len(facets)))
        tau[:, owner] = found.tau
        return FacetGains(np.ascontiguousarray((sums @ found.a.T).T)[None], tau)


def joined(landings: Sequence[Landing]) -> Landing:
    """All entries, in ascending order of their keys; no key may be there twice."""
    landings = [each for each in landings if len(each.facet)]
    if not landings:
        return Landing.none()
    keys = np.concatenate([each.keys for each in landings])
    order = np.lexsort(keys.T[::-1])
    rank = np.empty(len(order), np.intp)
    rank[order] = np.arange(len(order))
    firsts = np.cumsum([0] + [len(each.facet) for each in landings])
    owner = np.concatenate([each.owner + start for each, start in zip(landings, firsts, strict=False)])
    return Landing(
        keys[order, 0].astype(np.intp),
        keys[order, 1].astype(np.int32),
        keys[order, 2].astype(np.int32),
        np.concatenate([each.pieces for each in landings]),
        rank[owner],
        np.concatenate([each.share for each in landings]),
    )
