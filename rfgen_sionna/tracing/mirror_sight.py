"""What mirrors show of facets to the radar."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.records import FloatArray
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.facets import Facets
from rfgen_sionna.tracing.ghost_levels import ON_MIRROR
from rfgen_sionna.tracing.mirrors import Mirror
from rfgen_sionna.tracing.rims import Rims, cut_by_rims
from rfgen_sionna.tracing.sampling import returns_at_most
from rfgen_sionna.tracing.surfaces import Surfaces
from rfgen_sionna.tracing.visibility import MirrorView, Shown, mirrored_fraction, seen_by_both


class Parts(NamedTuple):
    """What is seen of facets that are shown in part."""

    row: NDArray[np.intp]
    """(piece,) the mirror or pair of mirrors that shows it, and the facet (piece,) that it is of."""
    column: NDArray[np.intp]
    pieces: FloatArray
    """(piece, corner, 3) barycentric coordinates of its corners."""

    @staticmethod
    def none() -> Parts:
        """Where nothing is cut."""
        return Parts(np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros((0, 3, 3)))


@dataclass(frozen=True)
class MirroredView:
    """How much of the facets is seen by way of each mirror in use, at an instant."""

    once: FloatArray
    """(mirror, facet) share seen both directly and by the mirror."""
    twice: FloatArray
    """(mirror, facet) share seen by the mirror."""
    across: FloatArray
    """(pair, facet) share seen by each of two mirrors."""
    cut: tuple[Parts, Parts, Parts]
    """What is seen of those that matter of which a part is, once, twice and across."""
    missed: float
    """Estimated error for what is not known of the rims of such parts, relative to what is seen directly."""
    looked_at: int
    rays: int


class MirrorSight:
    """Finds out how much of moving surfaces the radar sees by way of mirrors, as far as its range window."""

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
        # Which mirror each face of the ray scene belongs to, -1 for none.
        self._owner = np.full(sum(len(each.faces) for each in (*surfaces.static, *surfaces.moving)), -1, np.int32)
        for number, mirror in enumerate(mirrors):
            self._owner[mirror.faces] = number

    def __call__(
        self,
        rays: RayScene,
        facets: Facets,
        fraction: FloatArray,
        kept: NDArray[np.intp],
        used: NDArray[np.bool_],
        pairs: NDArray[np.intp],
    ) -> MirroredView:
        """What the mirrors `kept`, numbers of them, show of the facets.

        `fraction` (facet,) is seen directly; `used` (mirror, 2) says of all mirrors whether they count once and twice,
        and `pairs` (pair, 2) which two of them count together, one there and the other back.
        """
        shape = (len(kept), len(facets))
        once, twice, points = np.zeros(shape), np.zeros(shape), np.zeros(shape, np.uint16)
        lengths, paired = np.full(shape, np.inf), np.isin(kept, pairs)
        centre, view, reach = facets.centroids, self._viewpoint, self._max_range
        radius = np.linalg.norm(facets.corners - centre[:, None], axis=2).max(axis=1, initial=0.0)
        edges = facets.corners[:, 1:] - facets.corners[:, :1]
        normal = np.cross(edges[:, 0], edges[:, 1])
        distance = np.linalg.norm(centre - view, axis=1)
        closed = self._closed[facets.surface]
        rows, columns = [], []
        for row, which in enumerate(kept):
            mirror = self._mirrors[which]
            image = self._images[which]
            length = np.linalg.norm(centre - image, axis=1)
            faces = ~closed | (np.einsum("fi,fi->f", normal, image - centre) > 0)
            wanted = (used[which, 0] & (fraction > 0) & (length + distance < 2 * reach)) | (
                used[which, 1] & (length < reach)
            )
            if paired[row]:  # with a nearer one it may be within the window
                wanted |= length + distance < 2 * reach  # no mirror's way is shorter than the straight one
                lengths[row] = length
            index = np.flatnonzero(faces & wanted & (mirror.height(centre) > ON_MIRROR))
            index = index[mirror.spans(mirror.crossings(view, centre[index]), radius[index])]
            rows.append(np.full(len(index), row))
            columns.append(index)
        place, column = np.concatenate(rows), np.concatenate(columns)
        if len(column) == 0:
            return MirroredView(once, twice, np.zeros((len(pairs), len(facets))), (Parts.none(),) * 3, 0.0, 0, 0)
        number = kept[place]
        shown = self._view(number)
        found = mirrored_fraction(rays, view, facets.corners[column], facets.number[column], fraction[column], shown)
        length = np.linalg.norm(facets.centroids[column] - self._images[number], axis=1)
        near = length + distance[column] < 2 * reach
        asked = np.zeros((2, *shape), np.bool_)
        asked[:, place, column] = used[number, 0] & near & (fraction[column] > 0), used[number, 1] & (length < reach)
        once[place, column], twice[place, column], points[place, column] = found.once, found.twice, found.points
        once *= asked[0]
        twice *= asked[1]
        rim = np.zeros(shape, np.bool_)
        rim[place, column] = found.mixed
        one, other = np.searchsorted(kept, pairs).T
        both_near = lengths[one] + lengths[other] < 2 * reach
        across = seen_by_both(points[one], points[other]) * both_near
        some = rim | (points > 0)
        rims_across = (rim[one] | rim[other]) & some[one] & some[other] & both_near
        parts, missed, sent = [], 0.0, found.rays
        # What all of it may return, directly and by way of mirrors.
        most, *shown_most = (
            returns_at_most(facets.corners - end, self._wavenumber)[0] for end in (view, *self._images[kept])
        )
        by_way = [np.sqrt(own * most) * part for own, part in zip(shown_most, once, strict=True)]
        by_way += [own * part for own, part in zip(shown_most, twice, strict=True)]
        level = float(np.linalg.norm([most * fraction, *by_way]))
        by_one, by_pair = kept[:, None], kept[np.stack([one, other], axis=1)] if len(pairs) else pairs
        for share, rimmed, mirrors, straight in (
            (once, (rim | ((once > 0) & (once < 1))) & asked[0], by_one, True),
            (twice, rim & asked[1], by_one, False),
            (across, rims_across, by_pair, False),
        ):
            by, of = np.nonzero(rimmed)
            rims, rays_there = self._cut(rays, facets, of, mirrors[by], straight, share[by, of], level)
            share[by, of] = rims.share
            parts.append(Parts(by[rims.owner], of[rims.owner], rims.pieces))
            missed, sent = float(np.hypot(missed, rims.missed)), sent + rays_there
        # Of some both are known closer than what they have in common.
        at_most = np.where(asked[1], twice, 1.0)
        across = np.minimum(across, np.minimum(at_most[one], at_most[other]))
        once_cut, twice_cut, across_cut = parts
        return MirroredView(once, twice, across, (once_cut, twice_cut, across_cut), missed, len(column), sent)

    def _view(self, number: NDArray[np.intp]) -> MirrorView:
        """Of facets that are shown by the mirrors of that `number` (facet,)."""
        return MirrorView(
            np.stack([mirror.normal for mirror in self._mirrors])[number],
            np.array([mirror.offset for mirror in self._mirrors])[number],
            number.astype(np.int32),
            self._owner,
        )

    def _cut(
        self,
        rays: RayScene,
        facets: Facets,
        index: NDArray[np.intp],
        mirrors: NDArray[np.intp],
        straight: bool,
        share: FloatArray,
        level: float,
    ) -> tuple[Rims, int]:
        """What rims and shadows leave of the facets that `index` counts out, of which the `mirrors` (facet, way) show
        about a `share` (facet,), and of which it is to be seen directly as well if one way is `straight`; and the rays
        sent."""
        corners, number = np.take(facets.corners, index, axis=0), facets.number[index]
        ways = [corners - self._images[own][:, None] for own in mirrors.T]
        if straight or len(ways) == 1:
            ways.append(corners - self._viewpoint if straight else ways[0])
        (_, one, there), (_, other, back) = (returns_at_most(each, self._wavenumber) for each in ways)
        looks: list[Shown] = []

        def look(some: NDArray[np.intp]) -> Shown:
            views = [self._view(own) for own in mirrors[some].T]
            looks.append(Shown(rays, self._viewpoint, corners[some], number[some], views, straight))
            return looks[-1]

        found = cut_by_rims(look, np.sqrt(one * other), 0.5 * (there + back), share, level, self._rtol)
        return found, sum(each.sent for each in looks)
