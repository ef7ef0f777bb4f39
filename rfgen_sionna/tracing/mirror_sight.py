"""What mirrors show of facets to the radar."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.records import FloatArray
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.facets import Facets
from rfgen_sionna.tracing.ghost_levels import ON_MIRROR
from rfgen_sionna.tracing.mirrors import Mirror
from rfgen_sionna.tracing.surfaces import Surfaces
from rfgen_sionna.tracing.visibility import MirrorView, mirrored_fraction, seen_by_both


@dataclass(frozen=True)
class MirroredView:
    """How much of the facets is seen by way of each mirror in use, at an instant."""

    once: FloatArray
    """(mirror, facet) share seen both directly and by the mirror."""
    twice: FloatArray
    """(mirror, facet) share seen by the mirror."""
    across: FloatArray
    """(pair, facet) share seen by each of two mirrors."""
    looked_at: int
    rays: int


class MirrorSight:
    """Finds out how much of moving surfaces the radar sees by way of mirrors, as far as its range window."""

    def __init__(self, mirrors: Sequence[Mirror], surfaces: Surfaces, viewpoint: FloatArray, max_range: float) -> None:
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
            return MirroredView(once, twice, np.zeros((len(pairs), len(facets))), 0, 0)
        number = kept[place]
        shown = MirrorView(
            np.stack([mirror.normal for mirror in self._mirrors])[number],
            np.array([mirror.offset for mirror in self._mirrors])[number],
            number.astype(np.int32),
            self._owner,
        )
        found = mirrored_fraction(rays, view, facets.corners[column], facets.number[column], fraction[column], shown)
        length = np.linalg.norm(facets.centroids[column] - self._images[number], axis=1)
        near = length + distance[column] < 2 * reach
        once[place, column] = np.where(used[number, 0] & near, found.once, 0.0)
        twice[place, column] = np.where(used[number, 1] & (length < reach), found.twice, 0.0)
        points[place, column] = found.points
        one, other = np.searchsorted(kept, pairs).T
        across = seen_by_both(points[one], points[other]) * (lengths[one] + lengths[other] < 2 * reach)
        return MirroredView(once, twice, across, len(column), found.rays)
