"""Parts of facets that planar reflectors show to the radar: footprints of a reflector's cone, clipped to facets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Self, cast

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.materials import Material
from rfgen_sionna.tracing.ghosts.image_band import ImageBand, MirroredFacets
from rfgen_sionna.tracing.integral.facet import FacetGains, GainBuffer, Nodes, facet_gains, split_by_curvature
from rfgen_sionna.tracing.integral.obliquity import Media
from rfgen_sionna.tracing.surface.facets import Facets
from rfgen_sionna.tracing.surface.quadratic_patch import barycentric

DIRECT = -1
"""Number of the straight leg, in place of a reflector's."""
ON_PLANE = 1e-4
"""Distance below which a point is on a reflector [m]: well below a wavelength, above rounding."""


@dataclass(frozen=True)
class ClippedFootprints:
    """Visible pieces of facets by reflectors, at one time."""

    facet: NDArray[np.intp]
    """(entry,) facet; entries ascend by `keys`."""
    first: IntArray
    """(entry,) reflector of the outgoing leg, or `DIRECT`."""
    last: IntArray
    """(entry,) reflector of the return leg, or `DIRECT`."""
    pieces: FloatArray
    """(piece, 3, 3) [m], world."""
    owner: NDArray[np.intp]
    """(piece,) entry of each piece."""
    share: FloatArray
    """(piece,) visible share, above 0."""

    @classmethod
    def none(cls) -> Self:
        """No entries."""
        empty, index = np.zeros(0, np.int32), np.zeros(0, np.intp)
        return cls(index, empty, empty, np.zeros((0, 3, 3)), index, np.zeros(0))

    @classmethod
    def concatenate(cls, footprint_sets: Sequence[ClippedFootprints]) -> Self:
        """All entries, one set after the other."""
        firsts = np.cumsum([0] + [len(each.facet) for each in footprint_sets])
        columns = {each.name: [getattr(found, each.name) for found in footprint_sets] for each in fields(cls)}
        columns["owner"] = [owner + first for owner, first in zip(columns["owner"], firsts, strict=False)]
        return cls(**{name: np.concatenate(column) for name, column in columns.items()})

    @classmethod
    def merge(cls, footprint_sets: Sequence[ClippedFootprints]) -> Self:
        """All entries, in ascending order of their keys, each of them unique."""
        footprint_sets = [each for each in footprint_sets if len(each.facet)]
        if not footprint_sets:
            return cls.none()
        found = cls.concatenate(footprint_sets)
        order = np.lexsort(found.keys.T[::-1])
        rank = np.empty(len(order), np.intp)
        rank[order] = np.arange(len(order))
        return replace(found, **found._entries(order), owner=rank[found.owner])

    def take(self, chosen: NDArray[np.bool_]) -> Self:
        """Entries by the mask `chosen` (entry,)."""
        place, used = np.cumsum(chosen) - 1, chosen[self.owner]
        pieces, owner, share = self.pieces[used], place[self.owner[used]], self.share[used]
        return replace(self, **self._entries(chosen), pieces=pieces, owner=owner, share=share)

    def _entries(self, index: NDArray[np.intp] | NDArray[np.bool_]) -> dict[str, Any]:
        """Fields per entry, indexed."""
        names = {each.name for each in fields(self)} - {"pieces", "owner", "share"}
        return {name: getattr(self, name)[index] for name in sorted(names)}

    def swapped(self) -> Self:
        """The same with both legs swapped."""
        return replace(self, first=self.last, last=self.first)

    @property
    def keys(self) -> NDArray[np.int64]:
        """(entry, 3) facet and reflectors."""
        return np.stack([self.facet, self.first, self.last], axis=1).astype(np.int64)


@dataclass(frozen=True)
class ReflectedFacets(MirroredFacets):
    """Facets by reflectors; only their visible pieces count."""

    pieces: FloatArray
    """(piece, 3, 3) [m], world."""
    owner: NDArray[np.intp]
    """(piece,) facet of each piece."""
    share: FloatArray
    """(piece,) weight of each."""

    @staticmethod
    def clipped(
        facets: Facets,
        keys: NDArray[np.int64],
        footprints: ClippedFootprints,
        swapped: bool,
        place: NDArray[np.intp] | None = None,
    ) -> ReflectedFacets:
        """Facets by sorted `keys` (facet, 3); other entries of `footprints` are left out. `swapped` has the legs in
        reverse order. `place` (entry,) is the row of each entry in `keys`, None finds it."""
        chosen = facets.take(keys[:, 0]).with_pattern_gradient(None)
        first, last = (keys[:, column].astype(np.int32) for column in ((2, 1) if swapped else (1, 2)))
        at = (_find_rows(keys, footprints.keys) if place is None else place)[footprints.owner]
        kept = at >= 0
        return ReflectedFacets(
            **columns(chosen, Facets), first=first, last=last, pieces=footprints.pieces[kept], owner=at[kept],
            share=footprints.share[kept],
        )  # fmt: skip

    def finer(self) -> tuple[ReflectedFacets, NDArray[np.intp]]:
        """The same in twice as many parts."""
        return replace(self, parts=2 * self.parts), np.arange(len(self))

    def times(self, factor: FloatArray) -> ReflectedFacets:
        """The same with weights times `factor` (facet,)."""
        return replace(self, share=self.share * factor[self.owner])

    def take(self, index: NDArray[np.intp]) -> ReflectedFacets:
        """Facets by `index` without repeated ones."""
        place = np.full(len(self), -1, dtype=np.intp)
        place[index] = np.arange(len(index))
        owner = place[self.owner]
        kept = owner >= 0
        chosen = super().take(index)
        return ReflectedFacets(
            **columns(chosen, MirroredFacets), pieces=self.pieces[kept], owner=owner[kept], share=self.share[kept],
        )  # fmt: skip


def columns(record: Any, kind: type) -> dict[str, Any]:
    """Fields of a dataclass `kind` in a `record`."""
    return {each.name: getattr(record, each.name) for each in fields(kind)}


def _find_rows(keys: NDArray[np.int64], wanted: NDArray[np.int64]) -> NDArray[np.intp]:
    """Row in the sorted `keys` of each row of `wanted`; -1 where absent."""
    if len(keys) == 0:
        return np.full(len(wanted), -1, dtype=np.intp)
    base = int(max(keys[:, 1:].max(), wanted[:, 1:].max(initial=0))) + 2
    powers = np.array([base * base, base, 1])
    shift = np.array([0, 1, 1])
    known, sought = (keys + shift) @ powers, (wanted + shift) @ powers
    place = np.minimum(np.searchsorted(known, sought), len(known) - 1)
    return np.where(known[place] == sought, place, -1)


def find_rows(keys: NDArray[np.int64], wanted: NDArray[np.int64]) -> NDArray[np.intp]:
    """As :func:`_find_rows`, for unique rows of any length."""
    _, back = np.unique(np.concatenate([keys, wanted]), axis=0, return_inverse=True)
    back = back.reshape(-1)
    place = np.full(len(back), -1, dtype=np.intp)
    place[back[: len(keys)]] = np.arange(len(keys))
    return np.asarray(place[back[len(keys) :]])


class ReflectedBand(ImageBand):
    """As :class:`~rfgen_sionna.tracing.ghosts.image_band.ImageBand`, for :class:`ReflectedFacets`."""

    def _gains(
        self, facets: Facets, materials: tuple[Material, ...], nodes: Nodes, parts: IntArray | None = None
    ) -> FacetGains:
        from scipy.sparse import csr_array

        facets = cast(ReflectedFacets, facets)
        owner = facets.owner
        media, parts = Media.at(materials, nodes.frequency, self.half_band), facets.parts if parts is None else parts
        reference = facets.centroids - self._origin
        patch = None
        if facets.patch is not None:
            patch = facets.patch.take(owner).within(barycentric(facets.pieces, facets.corners[owner]))

        def of(index: NDArray[np.intp] | slice, curved: bool, buffer: GainBuffer | None) -> FacetGains:
            whose = owner[index]
            return facet_gains(
                facets.pieces[index] - self._origin, facets.surface[whose], media, nodes, *self.fields, parts[whose],
                reference=reference[whose], patch=patch.take(index) if curved and patch is not None else None,
                buffer=buffer, **self._by(facets, nodes, whose),
            )  # fmt: skip

        found = split_by_curvature(None if facets.curved is None else facets.curved[owner], of)
        sums = csr_array((facets.share, (owner, np.arange(len(owner)))), shape=(len(facets), len(owner)))
        tau = np.zeros((len(nodes), len(facets)))
        tau[:, owner] = found.tau
        return FacetGains(np.ascontiguousarray((sums @ found.a.T).T)[None], tau)
