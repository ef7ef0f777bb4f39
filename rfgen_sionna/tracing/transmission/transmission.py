"""Direct returns through slabs: behind a wall or a window, under clothing.

A ray that meets a surface with a thickness goes straight on, up to `MAX_SLABS` times. An occluded facet is visible
through each sequence of slabs that rays to its corners cross; where the sequences differ it is cut at the slabs'
silhouettes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray, IntArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import RadarPaths
from rfgen_sionna.scene.mesh import unit
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.ghosts.image_band import ImageBand, MirroredFacets
from rfgen_sionna.tracing.ghosts.image_returns import NO_MIRRORS, Centroids, CutFacets, ImageReturns
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
from rfgen_sionna.tracing.reflectors.clipped_footprints import columns
from rfgen_sionna.tracing.shadows.adaptive_sampling import clip_by_silhouettes
from rfgen_sionna.tracing.shadows.lattices import inset_points
from rfgen_sionna.tracing.shadows.return_bounds import max_returns
from rfgen_sionna.tracing.shadows.visible_polygons import EDGE_INSET
from rfgen_sionna.tracing.surface.facets import Facets
from rfgen_sionna.tracing.surface.quadratic_patch import QUARTERS, split_values
from rfgen_sionna.tracing.surface.surfaces import Surface, Surfaces
from rfgen_sionna.tracing.transmission.slab_crossings import MAX_SLABS, SlabTracer, SlabVisibility

_GUIDE_POINTS = inset_points(np.eye(3), EDGE_INSET)
_TO_CORNERS = np.linalg.inv(_GUIDE_POINTS).T
"""(point, corner) linear map from values at `_GUIDE_POINTS`, the targets of guiding rays, to the facet's corners."""
OMITTED_SHARE = 0.5
"""Share of the tolerance below which the transmitted amplitude of a round trip counts as 0."""


@dataclass(frozen=True)
class TransmittedVisibility:
    """Facets visible through slabs, at one time."""

    keys: NDArray[np.int64]
    """(entry, 1 + depth) facet and surface of each slab, nearest first, or `NO_SLAB`; sorted by rows."""
    share: FloatArray
    """(entry,) visible share of the facet's area."""
    normals: FloatArray
    """(entry, depth, corner, 3) normals of the slabs on the legs to the facet's corners, not normalised."""
    owner: NDArray[np.intp]
    """(piece,) entry of each, ascending; partly covered facets alone have pieces."""
    pieces: FloatArray
    """(piece, corner, 3) barycentric coordinates of the corners."""
    missed: float
    """Estimated error of the pieces, relative to the incoherent sum of all facets."""
    sampled_facets: int
    rays: int


@dataclass(frozen=True)
class TransmittedFacets(MirroredFacets):
    """Facets, each through one sequence of slabs."""

    crossed: IntArray
    """(facet, depth) surfaces crossed, or `NO_SLAB`."""
    across: FloatArray
    """(facet, depth, corner, 3) unit normals of the slabs on the legs to the facet's corners."""

    @classmethod
    def transmitted(cls, facets: Facets, keys: NDArray[np.int64], normals: FloatArray) -> TransmittedFacets:
        """Facets by `keys` (entry, 1 + depth)."""
        chosen = facets.take(keys[:, 0].astype(np.intp)).with_pattern_gradient(None)
        none = np.zeros(len(keys), np.int32)
        return cls(
            **columns(chosen, Facets), first=none, last=none, crossed=keys[:, 1:].astype(np.int32), across=normals,
        )  # fmt: skip

    def between(self, after: MirroredFacets, share: float) -> TransmittedFacets:
        """With slab normals at a `share` of the way to those of `after`."""
        return replace(self, across=interpolated_normals(self.across, cast(TransmittedFacets, after).across, share))

    def finer(self) -> tuple[Facets, NDArray[np.intp]]:
        """As of any facets; quarters of curved facets get normals at their own corners."""
        found, index = super().finer()
        pieces = np.flatnonzero(np.zeros(len(self), np.bool_) if self.curved is None else self.curved)
        across = self.across[index]
        for level in range(across.shape[1] if len(pieces) else 0):
            across[-len(QUARTERS) * len(pieces) :, level] = split_values(QUARTERS, self.across[pieces, level])
        return replace(cast(TransmittedFacets, found), across=across), index

    def cut(self, owner: NDArray[np.intp], weights: FloatArray) -> TransmittedFacets:
        """Pieces as of any facets, with the mean normals of the whole facet, which delays use
        (:meth:`TransmissionBand.lengths`)."""
        found = cast(TransmittedFacets, super().cut(owner, weights))
        return replace(found, across=np.repeat(unit(found.across.sum(axis=2))[:, :, None], 3, axis=2))

    def take(self, index: NDArray[np.intp]) -> TransmittedFacets:
        """Facets by `index`."""
        chosen = super().take(index)
        return TransmittedFacets(
            **columns(chosen, MirroredFacets),
            crossed=self.crossed[index],
            across=self.across[index],
        )


class TransmissionBand(ImageBand):
    """As :class:`~rfgen_sionna.tracing.ghosts.image_band.ImageBand`, for :class:`TransmittedFacets` without mirrors."""

    def __init__(self, table: SlabTable, radar: Radar, rtol: float, mirrors: Sequence[Mirror], tx: bool, rx: bool):
        super().__init__(radar, rtol, mirrors, tx, rx)
        self._table = table

    def lengths(self, centroids: FloatArray, visible_facets: MirroredFacets) -> FloatArray:
        """(tx, rx, facet) delays [s] by `centroids` (facet, 3) [m, world], with those of the slabs."""
        visible_facets = cast(TransmittedFacets, visible_facets)
        place, legs, across = centroids - self._origin, [], unit(visible_facets.across.sum(axis=2))
        for elements in (self._tx, self._rx):
            offset = place - elements[:, None]
            distance = np.linalg.norm(offset, axis=2)
            k = offset / np.maximum(distance, 1e-12)[..., None]
            legs.append(distance + self._table.lengths(visible_facets.crossed, across, k))
        return np.asarray((legs[0][:, None] + legs[1]) / SPEED_OF_LIGHT)

    def _by(self, facets: MirroredFacets, nodes: Nodes, index: NDArray[np.intp] | slice) -> dict[str, Any]:
        facets = cast(TransmittedFacets, facets)
        slab_stacks = SlabStacks(None, SlabStack(self._table, facets.crossed[index], facets.across[index]))
        return {"slab_stacks": (slab_stacks, slab_stacks)}


class Transmission:
    """Finds and traces direct returns through slabs.

    Parameters
    ----------
    surfaces, radar
        Scene and radar.
    targets
        Surfaces of the facets.
    rtol
        Tolerance, relative to the direct return of each surface.
    """

    def __init__(
        self,
        surfaces: Surfaces,
        targets: tuple[Surface, ...],
        radar: Radar,
        rtol: float,
    ) -> None:
        self.surfaces, self.rtol, self._radar = (*surfaces.static, *surfaces.moving), rtol, radar
        self._viewpoint = np.asarray(radar.position)
        highest = radar.center_frequency + 0.5 * radar.waveform.bandwidth
        self._wavenumber = 2 * np.pi * highest / SPEED_OF_LIGHT
        half_band = 0.5 * radar.waveform.bandwidth
        self.table = table = SlabTable.of([each.material for each in self.surfaces], radar.center_frequency, half_band)
        self.through = np.max(
            [table.strength(radar.center_frequency + u * half_band) for u in (-1.0, 0.0, 1.0)], axis=0
        )
        """(surface,) amplitude that gets through each at most, at normal incidence."""
        names = surfaces.object_names, surfaces.part_names
        self._returns = ImageReturns(targets, names, radar, rtol, lambda _: (), partial(TransmissionBand, table))
        self._own = np.array([self._number(each) for each in targets], np.intp)

    def _number(self, surface: Surface) -> int:
        return next(number for number, each in enumerate(self.surfaces) if each is surface)

    def any_transmission(self, only: Sequence[int] | None = None, *, one_way: bool = False) -> bool:
        """Whether anything is visible through slabs, on a round trip or `one_way`; `only` these surfaces transmit, None
        means all."""
        through = self.through if only is None else self.through[list(only)]
        return bool((through ** (1 if one_way else 2) > OMITTED_SHARE * self.rtol).any())

    def slab_amplitudes(self, only: Sequence[int] | None) -> FloatArray:
        """(surface,) transmitted amplitude, if `only` these surfaces transmit; None means all."""
        through = self.through.copy()
        if only is not None:
            through[np.setdiff1d(np.arange(len(through)), only)] = 0.0
        return through

    def slab_tracer(
        self, rays: RayScene, vertices: Sequence[FloatArray], only: Sequence[int] | None = None
    ) -> SlabTracer:
        """Tracer of rays through the slabs, or `only` these surfaces, down to the least amplitude of a round trip;
        `vertices` are the (vertex, 3) positions [m] of all surfaces."""
        return SlabTracer(rays, vertices, self.surfaces, self.slab_amplitudes(only), OMITTED_SHARE * self.rtol)

    def trace_visibility(
        self,
        rays: RayScene,
        vertices: Sequence[FloatArray],
        facets: Facets,
        fraction: FloatArray,
        only: Sequence[int] | None = None,
    ) -> TransmittedVisibility:
        """Visibility through slabs of the facets, of which `fraction` (facet,) is directly visible. `vertices` are the
        (vertex, 3) positions [m] of all surfaces; `only` these surfaces transmit."""
        through = self.slab_amplitudes(only)
        penetrable = through**2 > OMITTED_SHARE * self.rtol
        near = np.linalg.norm(facets.centroids - self._viewpoint, axis=1) < self._radar.max_range
        index = np.flatnonzero(self.possibly_visible(facets, penetrable) & near & (fraction < 1))
        none = np.zeros((0, 1 + MAX_SLABS), np.int64), np.zeros(0), np.zeros((0, MAX_SLABS, 3, 3))
        empty = TransmittedVisibility(*none, np.zeros(0, np.intp), np.zeros((0, 3, 3)), 0.0, 0, 0)
        if len(index) == 0:
            return empty
        slab_tracer = self.slab_tracer(rays, vertices, only)

        targets = np.einsum("sc,fci->fsi", _GUIDE_POINTS, np.take(facets.corners, index, axis=0)).reshape(-1, 3)
        guided = slab_tracer(self._viewpoint, targets, None, np.repeat(facets.number[index], len(_GUIDE_POINTS)))
        crossings = guided.crossed.reshape(len(index), -1)
        alike = (crossings == np.tile(crossings[:, :MAX_SLABS], len(_GUIDE_POINTS))).all(axis=1) & (
            fraction[index] == 0
        )
        key = np.column_stack([np.repeat(index, len(_GUIDE_POINTS)), guided.crossed])
        visible = np.flatnonzero(key[:, 1] >= 0)
        if not len(visible):
            return replace(empty, sampled_facets=len(index), rays=slab_tracer.sent)
        found, back = np.unique(key[visible], axis=0, return_inverse=True)
        entry = back.reshape(-1)
        gather = csr_array((np.ones(len(visible)), (entry, np.arange(len(visible)))), shape=(len(found), len(visible)))
        # Normals are linear on a facet: guiding rays give those at corners. Where they cross different slabs, each
        # sequence gets the mean of its rays.
        whole = np.repeat(alike, len(_GUIDE_POINTS))[visible]
        to_corners = np.tile(_TO_CORNERS, (len(index), 1))[visible]
        to_corners[~whole] = 1.0
        corners = guided.normals[visible][:, :, None] * to_corners[:, None, :, None]
        normals = (gather @ corners.reshape(len(visible), -1)).reshape(len(found), MAX_SLABS, 3, 3)
        # Pieces cut at slabs' silhouettes have their own phase.
        share = np.bincount(entry, minlength=len(found)) / len(_GUIDE_POINTS)
        through_all = np.where(found[:, 1:] == NO_SLAB, 1.0, through[found[:, 1:]]).prod(axis=1) ** 2
        own = found[:, 0].astype(np.intp)
        most, _, _ = max_returns(facets.corners - self._viewpoint, self._wavenumber)
        level = float(np.hypot(np.linalg.norm(most * fraction), np.linalg.norm(most[own] * share * through_all)))
        part = np.flatnonzero(np.isin(own, index[~alike]))
        pieces, number, crossing = np.take(facets.corners, own[part], axis=0), facets.number[own[part]], found[part, 1:]
        _, cut, width = max_returns(pieces - self._viewpoint, self._wavenumber)

        def sampler(some: NDArray[np.intp]) -> SlabVisibility:
            return SlabVisibility(slab_tracer, self._viewpoint, pieces[some], number[some], crossing[some])

        clipped = clip_by_silhouettes(sampler, through_all[part] * cut, width, share[part], level, self.rtol)
        share[part] = clipped.share
        kept = np.flatnonzero(share)
        owner = np.searchsorted(kept, part[clipped.owner])
        return TransmittedVisibility(
            found[kept], share[kept], normals[kept], owner, clipped.pieces, clipped.missed, len(index), slab_tracer.sent
        )

    @property
    def penetrable(self) -> NDArray[np.bool_]:
        """(surface,) whether it transmits."""
        return np.asarray(self.through**2 > OMITTED_SHARE * self.rtol)

    def possibly_visible(self, facets: Facets, penetrable: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """(facet,) whether the facet faces the radar, or its surface is `penetrable` (surface,) and its back may be
        visible."""
        return np.asarray(facets.facing | penetrable[self._own][facets.surface])

    def weights(self, visible: TransmittedVisibility, count: int) -> FloatArray:
        """(facet,) transmitted amplitude of `count` facets at normal incidence."""
        crossed = visible.keys[:, 1:]
        left = np.where(crossed == NO_SLAB, 1.0, self.through[crossed]).prod(axis=1) ** 2
        return np.asarray(np.bincount(visible.keys[:, 0], visible.share * left, count), np.float64)

    def trace(
        self,
        knots: FloatArray,
        sample_times: FloatArray,
        facets: Sequence[Facets],
        visible: Sequence[TransmittedVisibility],
        centroids: Centroids,
        reference_level: FloatArray,
    ) -> tuple[RadarPaths | None, float, NDArray[np.int64]]:
        """Paths, their error relative to the direct returns `reference_level` (surface,) or to their own, and (path, 1
        + depth) facet and slabs of each. Paths are None without any.

        `facets` and `visible` are of each of the `sample_times` [s]; delays are for the `knots` [s].
        """
        keys, back = np.unique(np.concatenate([each.keys for each in visible]), axis=0, return_inverse=True)
        if len(keys) == 0:
            return None, 0.0, keys
        shares = np.zeros((len(visible), len(keys)))
        cut: list[CutFacets] = []
        places = np.split(back.reshape(-1), np.cumsum([len(each.keys) for each in visible])[:-1])
        for row, place, each in zip(shares, places, visible, strict=True):
            row[place] = each.share
            cut.append((place[each.owner], each.pieces))
        normals = normals_over_time(places, [each.normals for each in visible], len(keys))
        depth = max(1, int((keys[:, 1:] != NO_SLAB).sum(axis=1).max()))
        both = zip(facets, normals, strict=True)
        visible_facets = [
            TransmittedFacets.transmitted(each, keys[:, : 1 + depth], across[:, :depth]) for each, across in both
        ]
        column = keys[:, 0].astype(np.intp)
        paths, error = self._returns(
            NO_MIRRORS, knots, sample_times, visible_facets, shares, column, centroids, reference_level, cut
        )
        self._returns.finish(error)
        error += max(each.missed for each in visible)
        return paths, error, keys
