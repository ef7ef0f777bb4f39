"""Footprints of reflectors with slabs on any leg."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Self, cast

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray, IntArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.ghosts.image_band import ImageBand, MirroredFacets
from rfgen_sionna.tracing.ghosts.mirror_images import Mirror
from rfgen_sionna.tracing.integral.facet import Nodes
from rfgen_sionna.tracing.integral.slabs import (
    NO_SLAB,
    SlabStack,
    SlabStacks,
    SlabTable,
    interpolated_normals,
    normals_over_time,
)
from rfgen_sionna.tracing.reflectors.clipped_footprints import (
    DIRECT,
    ClippedFootprints,
    ReflectedBand,
    ReflectedFacets,
    columns,
    find_rows,
)
from rfgen_sionna.tracing.reflectors.footprint_clipper import MAX_IMAGES, FootprintClipper, FreeLegs
from rfgen_sionna.tracing.reflectors.planar_reflectors import PlanarPart, PlanarReflector
from rfgen_sionna.tracing.shadows.mirror_visibility import FINE_LATTICE, GUIDE_POINTS
from rfgen_sionna.tracing.surface.facets import Facets
from rfgen_sionna.tracing.transmission.slab_crossings import BLOCKED, MAX_SLABS, SlabTracer
from rfgen_sionna.tracing.transmission.transmission import OMITTED_SHARE, Transmission

LEGS = 4
"""From one end to its reflector, from there to the facet, and the same of the other end; a straight leg is the
second."""
_REVERSED_LEGS = [2, 3, 0, 1]
_SOURCE = -3
"""Label of the faces of the reflector that a leg starts on."""


@dataclass(frozen=True)
class SlabFootprints(ClippedFootprints):
    """Visible pieces of facets by reflectors and through at least one slab, at one time."""

    crossed: NDArray[np.int64]
    """(entry, leg, depth) surfaces crossed, or `NO_SLAB`."""
    across: FloatArray
    """(entry, leg, depth, 3) normals of the slabs, summed over the sample points."""

    @classmethod
    def none(cls) -> Self:
        plain, crossed = ClippedFootprints.none(), np.zeros((0, LEGS, MAX_SLABS), np.int64)
        return cls(**columns(plain, ClippedFootprints), crossed=crossed, across=np.zeros((*crossed.shape, 3)))

    def swapped(self) -> Self:
        """The same with both legs swapped."""
        crossed, across = self.crossed[:, _REVERSED_LEGS], self.across[:, _REVERSED_LEGS]
        return replace(self, first=self.last, last=self.first, crossed=crossed, across=across)

    @property
    def keys(self) -> NDArray[np.int64]:
        """(entry, 3 + leg depth) facet, reflectors and slabs."""
        plain = np.stack([self.facet, self.first, self.last], axis=1).astype(np.int64)
        return np.concatenate([plain, self.crossed.reshape(len(plain), LEGS * MAX_SLABS)], axis=1)


@dataclass(frozen=True)
class SlabReflectedFacets(ReflectedFacets):
    """Facets by reflectors through slabs."""

    crossed: IntArray
    """(facet, leg, depth) surfaces crossed from Tx and to Rx, or `NO_SLAB`."""
    across: FloatArray
    """(facet, leg, depth, 3) unit normals of the slabs."""

    @classmethod
    def over_time(
        cls, facets: Sequence[Facets], keys: NDArray[np.int64], footprint_sets: Sequence[SlabFootprints], swapped: bool
    ) -> list[SlabReflectedFacets]:
        """Facets by sorted `keys` at each sample time."""
        places = [find_rows(keys, footprints.keys) for footprints in footprint_sets]
        normals = normals_over_time(places, [footprints.across for footprints in footprint_sets], len(keys))
        crossed = keys[:, 3:].reshape(-1, LEGS, MAX_SLABS).astype(np.int32)
        legs = _REVERSED_LEGS if swapped else list(range(LEGS))
        depth = max(1, int((crossed != NO_SLAB).sum(axis=2).max(initial=0)))
        return [
            cls(
                **columns(ReflectedFacets.clipped(each, keys, footprints, swapped, place), ReflectedFacets),
                crossed=crossed[:, legs, :depth],
                across=across[:, legs, :depth],
            )
            for each, footprints, place, across in zip(facets, footprint_sets, places, normals, strict=True)
        ]

    def between(self, after: MirroredFacets, share: float) -> SlabReflectedFacets:
        """With slab normals at a `share` of the way to those of `after`."""
        return replace(self, across=interpolated_normals(self.across, cast(SlabReflectedFacets, after).across, share))

    def take(self, index: NDArray[np.intp]) -> SlabReflectedFacets:
        """Facets by `index` without repeated ones."""
        chosen = columns(super().take(index), ReflectedFacets)
        return SlabReflectedFacets(**chosen, crossed=self.crossed[index], across=self.across[index])


class SlabReflectedBand(ReflectedBand):
    """As :class:`~rfgen_sionna.tracing.reflectors.clipped_footprints.ReflectedBand`, for
    :class:`SlabReflectedFacets`."""

    def __init__(self, table: SlabTable, radar: Radar, rtol: float, mirrors: Sequence[Mirror], tx: bool, rx: bool):
        super().__init__(radar, rtol, mirrors, tx, rx)
        self._table = table

    def lengths(self, centroids: FloatArray, visible_facets: MirroredFacets) -> FloatArray:
        """(tx, rx, facet) delays [s] by `centroids` (facet, 3) [m, world] and the facets' mirrors, with those of the
        slabs."""
        visible_facets = cast(SlabReflectedFacets, visible_facets)
        place, legs = centroids - self._origin, []
        for by, mirror, elements, first in (
            (self.tx, visible_facets.first, self._tx, 0),
            (self.rx, visible_facets.last, self._rx, 2),
        ):
            visible, behind = place, visible_facets.across[:, first + 1]
            if by:  # images of the facet and of the slabs behind the mirror
                normal = self._normals[mirror]
                height = np.einsum("fi,fi->f", place, normal) + self._offsets[mirror]
                visible = place - 2.0 * height[:, None] * normal
                behind = behind - 2.0 * np.einsum("fdi,fi->fd", behind, normal)[..., None] * normal[:, None]
            offset = visible - elements[:, None]
            distance = np.linalg.norm(offset, axis=2)
            k = offset / np.maximum(distance, 1e-12)[..., None]
            for leg, across in ((first, visible_facets.across[:, first]), (first + 1, behind)):
                distance = distance + self._table.lengths(visible_facets.crossed[:, leg], across, k)
            legs.append(distance)
        return np.asarray((legs[0][:, None] + legs[1]) / SPEED_OF_LIGHT)

    def _by(self, facets: MirroredFacets, nodes: Nodes, index: NDArray[np.intp] | slice) -> dict[str, Any]:
        facets = cast(SlabReflectedFacets, facets)

        def of(leg: int) -> SlabStack | None:
            crossed = facets.crossed[:, leg]
            depth = int((crossed != NO_SLAB).sum(axis=1).max(initial=0))
            if depth == 0:
                return None
            across = facets.across[index, leg, :depth]
            return SlabStack(self._table, crossed[index, :depth], np.repeat(across[:, :, None], 3, axis=2))

        slab_stacks = SlabStacks(of(0), of(1)), SlabStacks(of(2), of(3))
        return {**super()._by(facets, nodes, index), "slab_stacks": slab_stacks}


class SlabFootprintClipper(FootprintClipper):
    """As :class:`~rfgen_sionna.tracing.reflectors.footprint_clipper.FootprintClipper` with its arguments `given`,
    through slabs that `slab_tracer` finds. Surfaces transmit the amplitude `through` (surface,); paths of less than
    `least` are blocked."""

    def __init__(self, slab_tracer: SlabTracer, through: FloatArray, least: float, *given: Any) -> None:
        super().__init__(*given)
        self._slab_tracer, self._least = slab_tracer, least
        self._amplitude = np.append(through, 1.0)  # last entry for NO_SLAB

    def clip_facets(self, index: NDArray[np.intp], first: int, last: int) -> SlabFootprints:
        """Visible parts of the facets `index` by the reflectors `first` and `last`, either of which may be `DIRECT`,
        through at least one slab."""
        index, pieces, owner = self._cut(index, first, last)
        if len(pieces) == 0:
            return SlabFootprints.none()
        before = self._slab_tracer.sent
        every = np.arange(len(pieces))
        crossings, normals = self._visibility(pieces, index[owner], first, last, GUIDE_POINTS)
        alike = (crossings == crossings[:, :1]).all(axis=(1, 2))
        rows = [(every[alike], crossings[alike], normals[alike])]
        if (~alike).any():
            mixed = every[~alike]
            rows.append((mixed, *self._visibility(pieces[mixed], index[owner[mixed]], first, last, FINE_LATTICE)))
        self.sent += self._slab_tracer.sent - before
        return self._gathered(index, pieces, owner, first, last, rows)

    def left(self, footprints: ClippedFootprints) -> FloatArray:
        """(entry,) bound of the amplitude of both legs, at normal incidence."""
        crossed = cast(SlabFootprints, footprints).crossed
        return np.asarray(np.where(crossed >= 0, self._amplitude[crossed], 1.0).prod(axis=(1, 2)))

    def resample(self, rays: RayScene, pieces: ClippedFootprints, chosen: NDArray[np.intp]) -> tuple[FloatArray, int]:
        """As :meth:`.FootprintClipper.resample`; legs must cross the same slabs as before."""
        pieces = cast(SlabFootprints, pieces)
        other = copy(self)
        other._slab_tracer = self._slab_tracer.with_rays(rays)
        share, entry = np.zeros(len(chosen)), pieces.owner[chosen]
        facet, own = pieces.facet[entry], pieces.crossed[entry].reshape(len(chosen), 1, -1)
        ways = np.stack([pieces.first[entry], pieces.last[entry]], axis=1)
        for first, last in np.unique(ways, axis=0).tolist():
            index = np.flatnonzero((ways == (first, last)).all(axis=1))
            corners = pieces.pieces[chosen[index]] - self._view
            crossings, _ = other._visibility(corners, facet[index], first, last, GUIDE_POINTS)
            share[index] = (crossings[:, :1] == own[index]).all(axis=(1, 2))
            mixed = ~(crossings == crossings[:, :1]).all(axis=(1, 2))
            if mixed.any():
                index = index[mixed]
                crossings, _ = other._visibility(corners[mixed], facet[index], first, last, FINE_LATTICE)
                share[index] = (crossings == own[index]).all(axis=2).mean(axis=1)
        return share, other._slab_tracer.sent

    def _gathered(
        self,
        index: NDArray[np.intp],
        pieces: FloatArray,
        owner: NDArray[np.intp],
        first: int,
        last: int,
        rows: Sequence[tuple[NDArray[np.intp], NDArray[np.int64], FloatArray]],
    ) -> SlabFootprints:
        """Entries from pieces with the slabs and normals of their samples."""
        keys, weights, normals = [], [], []
        for piece, crossings, across in rows:
            samples = crossings.shape[1]
            key = np.concatenate([np.repeat(piece, samples)[:, None], crossings.reshape(-1, LEGS * MAX_SLABS)], axis=1)
            visible = (key[:, 1] != BLOCKED) & (key[:, 1:] != NO_SLAB).any(axis=1)
            keys.append(key[visible])
            weights.append(np.full(int(visible.sum()), 1.0 / samples))
            normals.append(across.reshape(-1, LEGS, MAX_SLABS, 3)[visible])
        found, back = np.unique(np.concatenate(keys), axis=0, return_inverse=True)
        if len(found) == 0:
            return SlabFootprints.none()
        share = np.asarray(np.bincount(back.reshape(-1), np.concatenate(weights), len(found)), np.float64)
        across = np.zeros((len(found), LEGS, MAX_SLABS, 3))
        np.add.at(across, back.reshape(-1), np.concatenate(normals))
        piece = found[:, 0].astype(np.intp)
        found[:, 0] = index[owner[piece]]
        entries, entry = np.unique(found, axis=0, return_inverse=True)
        total = np.zeros((len(entries), LEGS, MAX_SLABS, 3))
        np.add.at(total, entry.reshape(-1), across)
        count = len(entries)
        return SlabFootprints(
            entries[:, 0].astype(np.intp), np.full(count, first, np.int32), np.full(count, last, np.int32),
            pieces[piece] + self._view, entry.reshape(-1), share, entries[:, 1:].reshape(count, LEGS, MAX_SLABS), total,
        )  # fmt: skip

    def _visibility(
        self, pieces: FloatArray, facet: NDArray[np.intp], first: int, last: int, weights: FloatArray
    ) -> tuple[NDArray[np.int64], FloatArray]:
        """(piece, sample, leg depth) surfaces on the legs to samples of pieces, `BLOCKED` on blocked ones, and (piece,
        sample, leg, depth, 3) their normals."""
        targets = np.einsum("sc,pci->psi", weights, pieces).reshape(-1, 3)
        lane = np.repeat(facet, len(weights))
        one = self._way(targets, lane, first)
        other = one if last == first else self._way(targets, lane, last)
        crossings = np.concatenate([one[0], other[0]], axis=1)
        left = np.where(crossings >= 0, self._amplitude[crossings], 1.0).prod(axis=(1, 2))
        crossings[(crossings == BLOCKED).any(axis=(1, 2)) | (left <= self._least)] = BLOCKED
        normals = np.concatenate([one[1], other[1]], axis=1)
        shape = len(pieces), len(weights)
        return crossings.reshape(*shape, -1), normals.reshape(*shape, LEGS, MAX_SLABS, 3)

    def _way(
        self, targets: FloatArray, facet: NDArray[np.intp], reflector: int
    ) -> tuple[NDArray[np.int64], FloatArray]:
        """(target, 2, depth) surfaces before and behind the reflector on the leg to points relative to the viewpoint,
        and their normals."""
        number = self._facets.number[facet]
        crossings = np.full((len(targets), 2, MAX_SLABS), NO_SLAB, np.int64)
        normals = np.zeros((*crossings.shape, 3))
        if reflector == DIRECT:
            crossings[:, 1], normals[:, 1] = self._slab_tracer(self._view, targets + self._view, None, number)
            return crossings, normals
        place, before = self._reflection_points(targets, np.full(len(targets), reflector, np.int32))
        crossings[~before] = BLOCKED
        lane = np.flatnonzero(before)
        place, there = place[lane] + self._view, targets[lane] + self._view
        ends = np.full(len(lane), reflector)
        crossings[lane, 0], normals[lane, 0] = self._slab_tracer(self._view, place, self._owner, ends, exact=True)
        on = crossings[lane, 0, 0] != BLOCKED
        lane, place, there = lane[on], place[on], there[on]
        label = np.where(self._owner == reflector, _SOURCE, np.arange(len(self._owner)))
        starts = np.full(len(lane), _SOURCE)
        crossings[lane, 1], normals[lane, 1] = self._slab_tracer(place, there, label, number[lane], starts)
        return crossings, normals


class SlabLegs(FreeLegs):
    """Reflected legs of which at least one goes through a slab: ghosts and corners behind a wall, a window, clothing.
    `only` these surfaces transmit, None means all."""

    def __init__(self, transmission: Transmission, only: Sequence[int] | None = None) -> None:
        self._transmission, self._amplitude = transmission, transmission.slab_amplitudes(only)

    @property
    def band(self) -> Callable[[Radar, float, Sequence[Mirror], bool, bool], ImageBand]:
        return partial(SlabReflectedBand, self._transmission.table)

    def clipper(
        self,
        rays: RayScene,
        vertices: Sequence[FloatArray],
        reflectors: Sequence[PlanarReflector | None],
        owner: IntArray,
        viewpoint: FloatArray,
        facets: Facets,
        max_range: float,
    ) -> SlabFootprintClipper:
        least = OMITTED_SHARE * self._transmission.rtol
        # A ghost may cross a slab on one of its legs alone.
        slab_tracer = SlabTracer(rays, vertices, self._transmission.surfaces, self._amplitude, least**2)
        given = rays, reflectors, owner, viewpoint, facets, max_range
        return SlabFootprintClipper(slab_tracer, self._amplitude, least, *given)

    def directly_visible(self, facets: Facets, fraction: FloatArray) -> NDArray[np.bool_]:
        return self._transmission.possibly_visible(facets, self._transmission.penetrable)

    def joined(self, footprint_sets: Sequence[ClippedFootprints]) -> ClippedFootprints:
        return SlabFootprints.merge(footprint_sets)

    def over_time(
        self,
        facets: Sequence[Facets],
        keys: NDArray[np.int64],
        footprint_sets: Sequence[ClippedFootprints],
        swapped: bool,
    ) -> Sequence[ReflectedFacets]:
        return SlabReflectedFacets.over_time(facets, keys, cast(Sequence[SlabFootprints], footprint_sets), swapped)

    def imaging(
        self, planar_parts: Sequence[PlanarPart], reflectors: Sequence[PlanarReflector | None], static: int
    ) -> list[int]:
        """The largest reflectors, walls among them."""
        there = [number for number, reflector in enumerate(reflectors) if reflector is not None]
        return sorted(there, key=lambda number: -planar_parts[number].area)[:MAX_IMAGES]
