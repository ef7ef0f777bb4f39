"""Where plates show facets to the radar: ray tubes from a plate's outline, cut out of the facets that they land on."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.materials import Material
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.bounces.plates import Plate
from rfgen_sionna.tracing.ghosts.image_band import ImageBand, MirroredFacets
from rfgen_sionna.tracing.integral.facet import FacetGains, Into, Nodes, by_curvature, facet_gains
from rfgen_sionna.tracing.integral.obliquity import Media
from rfgen_sionna.tracing.shadows.visibility import FINE, GUIDE
from rfgen_sionna.tracing.surface.bend import barycentric
from rfgen_sionna.tracing.surface.clip import cut
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


class Shower:
    """Finds out what plates show of facets at an instant.

    Parameters
    ----------
    rays
        The geometry.
    plates
        Of all plates those that there are now, None for the others.
    owner
        (face,) number of the plate that each face of the ray scene belongs to, -1 for none.
    viewpoint
        (3,) phase centre of the radar [m].
    facets
        What is looked at.
    max_range
        Half the length of the longest way that counts [m].
    """

    def __init__(
        self,
        rays: RayScene,
        plates: Sequence[Plate | None],
        owner: IntArray,
        viewpoint: FloatArray,
        facets: Facets,
        max_range: float,
    ) -> None:
        self._rays, self._plates, self._owner, self._view = rays, plates, owner, viewpoint
        self._facets, self._reach = facets, 2.0 * max_range
        self._corners = facets.corners - viewpoint
        self._centre = self._corners.mean(axis=1)
        self._radius = np.linalg.norm(self._corners - self._centre[:, None], axis=2).max(axis=1, initial=0.0)
        self._distance = np.linalg.norm(self._centre, axis=1)
        self._shadows = [[] if plate is None else plate.shadow(viewpoint) for plate in plates]
        self._normals = np.array([np.zeros(3) if plate is None else plate.normal for plate in plates]).reshape(-1, 3)
        self._heights = np.array([0.0 if plate is None else float(plate.height(viewpoint)) for plate in plates])
        self.sent = 0
        """Rays sent so far."""

    def owner(self, index: NDArray[np.intp]) -> IntArray:
        """(chosen,) number of the plate that facets lie on, -1 for none."""
        return np.asarray(self._owner[self._facets.number[index]])

    def lengths(self, plate: int, index: NDArray[np.intp]) -> FloatArray:
        """(chosen,) one-way lengths from the viewpoint to facets' centroids by way of a plate [m]."""
        if plate == DIRECT:
            return np.asarray(self._distance[index])
        image = -2.0 * self._heights[plate] * self._normals[plate]
        return np.asarray(np.linalg.norm(self._centre[index] - image, axis=1))

    def candidates(self, plate: int) -> NDArray[np.intp]:
        """Facets that reach into what the plate shows if nothing is in between, in ascending order."""
        found = []
        for index, middle, radius in self._bodies:
            for sides, offsets in self._shadows[plate]:
                if (sides @ middle - offsets > -radius).all():
                    inside = self._centre[index] @ sides.T - offsets
                    found.append(index[(inside > -self._radius[index, None]).all(axis=1)])
        return np.unique(np.concatenate(found)) if found else np.zeros(0, np.intp)

    @cached_property
    def _bodies(self) -> list[tuple[NDArray[np.intp], FloatArray, float]]:
        """Facets of each surface and a sphere around them."""
        found = []
        for number in np.unique(self._facets.surface):
            index = np.flatnonzero(self._facets.surface == number)
            points = self._corners[index].reshape(-1, 3)
            middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
            found.append((index, middle, float(np.linalg.norm(points - middle, axis=1).max())))
        return found

    def _cut(
        self, index: NDArray[np.intp], first: int, last: int
    ) -> tuple[NDArray[np.intp], FloatArray, NDArray[np.intp]]:
        """Those of the facets `index` that are near enough, what the plates show of them if nothing is in between
        (piece, 3, 3) [m], relative to the viewpoint, and which of them each piece is of."""
        index = index[self.lengths(first, index) + self.lengths(last, index) < self._reach]
        pieces, owner = self._corners[index], np.arange(len(index))
        for plate in dict.fromkeys(each for each in (first, last) if each != DIRECT):
            parts = [cut(pieces, owner, *shadow) for shadow in self._shadows[plate]]
            pieces = np.concatenate([part[0] for part in parts])
            owner = np.concatenate([part[1] for part in parts])
        return index, pieces, owner

    def land(self, index: NDArray[np.intp], first: int, last: int) -> Landing:
        """What is seen of the facets `index` by way of the plates `first` and `last`, which may be `DIRECT`."""
        index, pieces, owner = self._cut(index, first, last)
        if len(pieces) == 0:
            return Landing.none()
        ways = (np.full(len(pieces), plate, np.int32) for plate in (first, last))
        share = self._share(pieces, index[owner], *ways)
        seen = np.flatnonzero(share > 0)
        used, owner = np.unique(owner[seen], return_inverse=True)
        count = len(used)
        return Landing(
            index[used],
            np.full(count, first, np.int32),
            np.full(count, last, np.int32),
            pieces[seen] + self._view,
            owner.reshape(-1),
            share[seen],
        )

    def _share(self, pieces: FloatArray, facet: NDArray[np.intp], first: IntArray, last: IntArray) -> FloatArray:
        """(piece,) share of each that both its ways reach, by plates (piece,): three guiding points, and where they
        disagree a lattice. Rays of all ways go together: there may be hundreds of pairs of plates with few pieces."""

        def share(chosen: NDArray[np.intp], weights: FloatArray) -> FloatArray:
            targets = np.tensordot(weights, pieces[chosen], axes=(1, 1)).reshape(-1, 3)
            piece = np.tile(chosen, len(weights))
            through = self._through(targets, facet[piece], first[piece])
            left = np.flatnonzero(through & (last[piece] != first[piece]))
            through[left] = self._through(targets[left], facet[piece[left]], last[piece[left]])
            return np.asarray(through.reshape(len(weights), -1).mean(axis=0))

        found = share(np.arange(len(pieces)), GUIDE)
        mixed = np.flatnonzero((found > 0) & (found < 1))
        if len(mixed):
            found[mixed] = share(mixed, FINE)
        return found

    def left(self, landing: Landing) -> FloatArray:
        """(entry,) of the amplitude at most, there and back, by what the ways go through."""
        return np.ones(len(landing.facet))

    def near(self, pieces: Landing, bodies: Sequence[FloatArray]) -> NDArray[np.intp]:
        """Pieces with a leg that comes near a body, whose (vertex, 3) positions [m] are given."""
        middle = pieces.pieces.mean(axis=1) - self._view
        touched = np.zeros(len(middle), np.bool_)
        radius = np.linalg.norm(pieces.pieces - self._view - middle[:, None], axis=2).max(axis=1, initial=0.0)
        spheres = []
        for points in bodies:
            centre = 0.5 * (points.min(axis=0) + points.max(axis=0)) - self._view
            spheres.append((centre, float(np.linalg.norm(points - self._view - centre, axis=1).max())))
        for side in (pieces.first[pieces.owner], pieces.last[pieces.owner]):
            normal, here = self._normals[side], self._heights[side][:, None]
            straight = (side == DIRECT)[:, None]
            there = np.einsum("pi,pi->p", middle, normal)[:, None] + here
            place = (there * (-here * normal) + here * (middle - there * normal)) / np.maximum(here + there, 1e-12)
            turn = np.where(straight, 0.0, place)
            for centre, size in spheres:
                for start, end in ((np.zeros_like(turn), turn), (turn, middle)):
                    leg = end - start
                    along = np.einsum("pi,pi->p", centre - start, leg)
                    along = np.clip(along / np.maximum((leg**2).sum(axis=1), 1e-12), 0.0, 1.0)
                    gap = np.linalg.norm(start + along[:, None] * leg - centre, axis=1)
                    touched |= gap < size + radius
        return np.flatnonzero(touched)

    def again(self, rays: RayScene, pieces: Landing, chosen: NDArray[np.intp]) -> tuple[FloatArray, int]:
        """(chosen,) share that is seen of some pieces in another ray scene, and the number of rays sent."""
        other = copy(self)
        other._rays, other.sent = rays, 0
        entry = pieces.owner[chosen]
        given = pieces.pieces[chosen] - self._view, pieces.facet[entry], pieces.first[entry], pieces.last[entry]
        return other._share(*given), other.sent

    def _through(self, targets: FloatArray, facet: NDArray[np.intp], plate: IntArray) -> NDArray[np.bool_]:
        """(target,) whether the way from the viewpoint by a plate (target,) to points of facets, relative to it, is
        free."""
        number, free = self._facets.number[facet], np.zeros(len(targets), np.bool_)
        self.sent += len(targets)
        straight = np.flatnonzero(plate == DIRECT)
        if len(straight):
            free[straight] = ~self._rays.occluded(self._view, targets[straight] + self._view, number[straight])
        sent = np.flatnonzero(plate != DIRECT)
        if len(sent):
            place, before = self._turning(targets[sent], plate[sent])
            sent, place = sent[before], place[before]
            hit = self._rays.first_facet(self._view, place)
            on = (hit >= 0) & (self._owner[hit] == plate[sent])
            sent, place, hit = sent[on], place[on], hit[on]
            self.sent += len(sent)
            free[sent] = ~self._rays.occluded(place + self._view, targets[sent] + self._view, number[sent], hit)
        return free

    def _turning(self, targets: FloatArray, plate: IntArray) -> tuple[FloatArray, NDArray[np.bool_]]:
        """(target, 3) where the ways to points turn at a plate (target,), relative to the viewpoint [m], and whether
        the points lie before it."""
        normal, here = self._normals[plate], self._heights[plate][:, None]
        height = np.einsum("ti,ti->t", targets, normal)[:, None] + here
        before = height > NEAR
        foot, other = -here * normal, targets - height * normal
        return (height * foot + here * other) / np.where(before, here + height, 1.0), before[:, 0]


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
