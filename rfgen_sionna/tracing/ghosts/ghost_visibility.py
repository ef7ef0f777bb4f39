"""Visibility of facets via mirrors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.ghosts.ghost_levels import ON_MIRROR
from rfgen_sionna.tracing.ghosts.mirror_images import Mirror, SecondOrderImage
from rfgen_sionna.tracing.shadows.adaptive_sampling import ClippedFacets, clip_by_silhouettes
from rfgen_sionna.tracing.shadows.mirror_views import MirrorView, SecondOrderView
from rfgen_sionna.tracing.shadows.mirror_visibility import MirrorVisibilitySampler, mirrored_fraction, visible_to_both
from rfgen_sionna.tracing.shadows.return_bounds import max_returns
from rfgen_sionna.tracing.surface.facets import Facets
from rfgen_sionna.tracing.surface.surfaces import Surfaces


class PartialFacets(NamedTuple):
    """Visible pieces of partly visible facets."""

    row: NDArray[np.intp]
    """(piece,) mirror or pair of mirrors."""
    column: NDArray[np.intp]
    """(piece,) facet."""
    pieces: FloatArray
    """(piece, corner, 3) barycentric coordinates."""

    @staticmethod
    def none() -> PartialFacets:
        """No pieces."""
        return PartialFacets(np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros((0, 3, 3)))


@dataclass(frozen=True)
class MirroredVisibility:
    """Visible shares of facets via the selected mirrors at one sample time."""

    once: FloatArray
    """(mirror, facet) share visible both directly and by the mirror."""
    twice: FloatArray
    """(mirror, facet) share visible by the mirror."""
    across: FloatArray
    """(pair, facet) share visible by both mirrors."""
    cut: tuple[PartialFacets, PartialFacets, PartialFacets]
    """Pieces of partly visible facets with significant returns, for `once`, `twice` and `across`."""
    missed: float
    """Estimated error of the pieces over the incoherent sum of direct and mirrored returns, of the worst surface."""
    sampled_facets: int
    rays: int


class GhostVisibilitySampler:
    """Samples the visibility of moving surfaces via mirrors, within the range window."""

    def __init__(
        self,
        mirrors: Sequence[Mirror],
        surfaces: Surfaces,
        viewpoint: FloatArray,
        max_range: float,
        wavenumber: float,
        rtol: float,
    ) -> None:
        self._wavenumber, self._rtol = wavenumber, rtol
        self._mirrors, self._viewpoint, self._max_range = tuple(mirrors), viewpoint, max_range
        self._closed = np.array([surface.closed for surface in surfaces.moving], dtype=np.bool_)
        self._images = np.array([mirror.image(viewpoint) for mirror in mirrors]).reshape(-1, 3)
        # First face of the mirror that each face of the ray scene belongs to; -1 for none.
        self._owner = np.full(sum(len(each.faces) for each in (*surfaces.static, *surfaces.moving)), -1, np.int32)
        before = [mirror.before for mirror in mirrors if isinstance(mirror, SecondOrderImage)]
        for mirror in (*mirrors, *before):
            self._owner[mirror.faces] = mirror.faces[0]
        own = self._planes(mirrors)
        self._planes_of = [own, self._planes(before)] if before else [own]

    def __call__(
        self,
        rays: RayScene,
        facets: Facets,
        fraction: FloatArray,
        selected: NDArray[np.intp],
        used: NDArray[np.bool_],
        pairs: NDArray[np.intp],
    ) -> MirroredVisibility:
        """Visibility via the `selected` mirrors.

        `fraction` (facet,) is the share visible directly; `used` (mirror, 2) marks mirrors in use on one leg and on
        both, and `pairs` (pair, 2) are mirrors used one out and the other back.
        """
        shape = (len(selected), len(facets))
        once, twice, points = np.zeros(shape), np.zeros(shape), np.zeros(shape, np.uint16)
        lengths, paired = np.full(shape, np.inf), np.isin(selected, pairs)
        centre, view, reach = facets.centroids, self._viewpoint, self._max_range
        radius = np.linalg.norm(facets.corners - centre[:, None], axis=2).max(axis=1, initial=0.0)
        edges = facets.corners[:, 1:] - facets.corners[:, :1]
        normal = np.cross(edges[:, 0], edges[:, 1])
        distance = np.linalg.norm(centre - view, axis=1)
        closed = self._closed[facets.surface]
        rows, columns = [np.zeros(0, np.intp)], [np.zeros(0, np.intp)]
        for row, which in enumerate(selected):
            mirror = self._mirrors[which]
            image = self._images[which]
            length = np.linalg.norm(centre - image, axis=1)
            faces = ~closed | (np.einsum("fi,fi->f", normal, image - centre) > 0)
            wanted = (used[which, 0] & (fraction > 0) & (length + distance < 2 * reach)) | (
                used[which, 1] & (length < reach)
            )
            if paired[row]:  # together with a nearer mirror it may be within the window
                wanted |= length + distance < 2 * reach
                lengths[row] = length
            index = np.flatnonzero(faces & wanted & (mirror.height(centre) > ON_MIRROR))
            index = index[mirror.spans(mirror.crossings(view, centre[index]), radius[index])]
            rows.append(np.full(len(index), row))
            columns.append(index)
        place, column = np.concatenate(rows), np.concatenate(columns)
        if len(column) == 0:
            return MirroredVisibility(
                once, twice, np.zeros((len(pairs), len(facets))), (PartialFacets.none(),) * 3, 0.0, 0, 0
            )
        number = selected[place]
        facet_views = self._view(number)
        found = mirrored_fraction(
            rays, view, facets.corners[column], facets.number[column], fraction[column], facet_views
        )
        length = np.linalg.norm(facets.centroids[column] - self._images[number], axis=1)
        near = length + distance[column] < 2 * reach
        asked = np.zeros((2, *shape), np.bool_)
        asked[:, place, column] = used[number, 0] & near & (fraction[column] > 0), used[number, 1] & (length < reach)
        once[place, column], twice[place, column], points[place, column] = found.once, found.twice, found.points
        once *= asked[0]
        twice *= asked[1]
        partial = np.zeros(shape, np.bool_)
        partial[place, column] = found.mixed
        one, other = np.searchsorted(selected, pairs).T
        both_near = lengths[one] + lengths[other] < 2 * reach
        across = visible_to_both(points[one], points[other]) * both_near
        some = partial | (points > 0)
        partial_across = (partial[one] | partial[other]) & some[one] & some[other] & both_near
        parts, sent, surfaces = [], found.rays, len(self._closed)
        missed, level = np.zeros(surfaces), np.zeros(surfaces)
        by_one, by_pair = selected[:, None], selected[np.stack([one, other], axis=1)] if len(pairs) else pairs
        masks = (partial | ((once > 0) & (once < 1))) & asked[0], partial & asked[1], partial_across
        if any(mask.any() for mask in masks):
            level = self._level(facets, fraction, selected, once, twice)
        # One leg by a mirror in either direction, both legs by one mirror, or by two in either order.
        for share, mask, mirrors, straight, ways in (
            (once, masks[0], by_one, True, 2.0),
            (twice, masks[1], by_one, False, 1.0),
            (across, masks[2], by_pair, False, 2.0),
        ):
            found_parts = [PartialFacets.none()]
            for surface in np.unique(facets.surface[mask.any(axis=0)]):
                by, of = np.nonzero(mask & (facets.surface == surface))
                given = share[by, of], float(level[surface])
                clipped, rays_there = self._cut(rays, facets, of, mirrors[by], straight, *given)
                share[by, of] = clipped.share
                found_parts.append(PartialFacets(by[clipped.owner], of[clipped.owner], clipped.pieces))
                missed[surface] += (ways * clipped.missed) ** 2
                sent += rays_there
            parts.append(PartialFacets(*(np.concatenate(each) for each in zip(*found_parts, strict=True))))
        # The share by both mirrors is at most that by either.
        at_most = np.where(asked[1], twice, 1.0)
        whole = np.ones(across.shape, np.bool_)
        whole[parts[2].row, parts[2].column] = False
        across = np.where(whole, np.minimum(across, np.minimum(at_most[one], at_most[other])), across)
        once_cut, twice_cut, across_cut = parts
        cut, error = (once_cut, twice_cut, across_cut), float(np.sqrt(missed.max(initial=0.0)))
        return MirroredVisibility(once, twice, across, cut, error, len(column), sent)

    def _level(
        self, facets: Facets, fraction: FloatArray, selected: NDArray[np.intp], once: FloatArray, twice: FloatArray
    ) -> FloatArray:
        """(surface,) incoherent sum of the returns of each, directly and via the `selected` mirrors."""
        direct = facets.corners - self._viewpoint
        energy = (max_returns(direct, self._wavenumber)[0] * fraction) ** 2
        for which, by_one, by_two in zip(selected, once, twice, strict=True):
            image = facets.corners - self._images[which]
            energy += 2.0 * (max_returns(image, self._wavenumber, direct)[0] * by_one) ** 2
            energy += (max_returns(image, self._wavenumber)[0] * by_two) ** 2
        return np.sqrt(np.bincount(facets.surface, energy, len(self._closed)))

    def _planes(self, mirrors: Sequence[Mirror]) -> MirrorView:
        normals, offsets = np.array([each.normal for each in mirrors]), np.array([each.offset for each in mirrors])
        return MirrorView(
            normals.reshape(-1, 3), offsets, np.array([each.faces[0] for each in mirrors], np.int32), self._owner
        )

    def _view(self, number: NDArray[np.intp]) -> MirrorView:
        """View of facets via the mirrors `number` (facet,)."""
        own, *before = (each.take(number) for each in self._planes_of)
        return SecondOrderView(own.normal, own.offset, own.mirror, own.owner, before[0]) if before else own

    def _cut(
        self,
        rays: RayScene,
        facets: Facets,
        index: NDArray[np.intp],
        mirrors: NDArray[np.intp],
        straight: bool,
        share: FloatArray,
        level: float,
    ) -> tuple[ClippedFacets, int]:
        """Visible parts of partly visible facets of an `index` by their `mirrors` (facet, way), and directly if
        `straight`; rays."""
        corners, number = np.take(facets.corners, index, axis=0), facets.number[index]
        ends = [corners - self._images[own][:, None] for own in mirrors.T]
        if straight:
            ends.append(corners - self._viewpoint)
        _, cut, width = max_returns(ends[0], self._wavenumber, ends[1] if len(ends) > 1 else None)
        occluders: list[MirrorVisibilitySampler] = []

        def visibility(some: NDArray[np.intp]) -> MirrorVisibilitySampler:
            views = [self._view(own) for own in mirrors[some].T]
            occluders.append(
                MirrorVisibilitySampler(rays, self._viewpoint, corners[some], number[some], views, straight)
            )
            return occluders[-1]

        found = clip_by_silhouettes(visibility, cut, width, share, level, self._rtol)
        return found, sum(each.sent for each in occluders)
