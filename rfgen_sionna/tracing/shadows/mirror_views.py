"""Points seen by a plane mirror: their images, and the rays that leave its far side."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.rays import RayScene

_LEAST_HEIGHT = 1e-4
"""Points nearer to a mirror's plane than this [m] lie on it."""
_ABOVE = 2e-4
"""Start of rays above the first mirror [m], twice the tolerance of its plane."""


@dataclass(frozen=True)
class MirrorView:
    """Mirror of each facet, and the mirrors' faces."""

    normal: FloatArray
    """(facet, 3) unit normal of the facet's mirror, towards the viewpoint."""
    offset: FloatArray
    """(facet,) normal . x of the mirror [m]."""
    mirror: IntArray
    """(facet,) number of the mirror."""
    owner: IntArray
    """(face,) mirror of each face of the ray scene; -1 for none."""

    def take(self, index: NDArray[np.intp]) -> MirrorView:
        """View of an index of facets."""
        return MirrorView(self.normal[index], self.offset[index], self.mirror[index], self.owner)

    def is_visible(
        self, rays: RayScene, viewpoint: FloatArray, targets: FloatArray, facet: IntArray
    ) -> tuple[NDArray[np.bool_], int]:
        """(facet,) visibility through the mirror of a point `targets` (facet, 3) [m] on each face `facet`; number of
        rays."""
        here = self.normal @ viewpoint - self.offset
        there = np.einsum("ri,ri->r", targets, self.normal) - self.offset
        found = there > _LEAST_HEIGHT
        tried = np.flatnonzero(found)
        normal, here, there = self.normal[tried], here[tried, None], there[tried, None]
        foot, other = viewpoint - here * normal, targets[tried] - there * normal
        place = (there * foot + here * other) / (here + there)
        hit = rays.first_facet(viewpoint, place - viewpoint)
        on = (hit >= 0) & (self.owner[hit] == self.mirror[tried])
        found[tried[~on]] = False
        met = tried[on]
        found[met] = ~rays.occluded(place[on], targets[met], facet[met], hit[on])
        return found, len(tried) + len(met)


@dataclass(frozen=True)
class SecondOrderView(MirrorView):
    """Mirrors that are seen through other mirrors."""

    first: MirrorView
    """First mirror of each facet."""

    def take(self, index: NDArray[np.intp]) -> SecondOrderView:
        """View of an index of facets."""
        own = super().take(index)
        return SecondOrderView(own.normal, own.offset, own.mirror, own.owner, self.first.take(index))

    def is_visible(
        self, rays: RayScene, viewpoint: FloatArray, targets: FloatArray, facet: IntArray
    ) -> tuple[NDArray[np.bool_], int]:
        """Visibility through both mirrors, as in :meth:`MirrorView.is_visible`."""
        first = self.first
        image = viewpoint - 2.0 * (first.normal @ viewpoint - first.offset)[:, None] * first.normal
        place = _crossing(self, image, targets)
        turn = _crossing(first, np.broadcast_to(viewpoint, place.shape), place)
        found, sent = np.asarray(~np.isnan(place + turn).any(axis=1)), 0
        met = np.full(len(targets), -1, np.int64)
        lifted = turn + _ABOVE * first.normal
        for start, end, by in ((np.broadcast_to(viewpoint, place.shape), turn, first), (lifted, place, self)):
            tried = np.flatnonzero(found)
            met[tried] = rays.first_facet(start[tried], end[tried] - start[tried])
            found[tried] = (met[tried] >= 0) & (by.owner[met[tried]] == by.mirror[tried])
            sent += len(tried)
        tried = np.flatnonzero(found)
        found[tried] = ~rays.occluded(place[tried], targets[tried], facet[tried], met[tried])
        return found, sent + len(tried)


def _crossing(view: MirrorView, source: FloatArray, targets: FloatArray) -> FloatArray:
    """(facet, 3) mirror points of the paths from `source` to `targets` (facet, 3) [m]; NaN behind the mirror."""
    here, there = (np.einsum("ri,ri->r", each, view.normal) - view.offset for each in (source, targets))
    share = here / np.where((here > _LEAST_HEIGHT) & (there > _LEAST_HEIGHT), here + there, np.nan)
    foot, other = (each - height[:, None] * view.normal for each, height in ((source, here), (targets, there)))
    return np.asarray(foot + share[:, None] * (other - foot))
