"""Visibility of facets through plane mirrors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.shadows.lattices import inset_points
from rfgen_sionna.tracing.shadows.visible_polygons import EDGE_INSET, bisect_edges


def barycentric_lattice(n: int) -> FloatArray:
    """(n^2, 3) barycentric centroids of the n^2 equal subtriangles."""
    upright = [(i + 1 / 3, j + 1 / 3) for i in range(n) for j in range(n - i)]
    inverted = [(i + 2 / 3, j + 2 / 3) for i in range(n) for j in range(n - i - 1)]
    u = np.array(upright + inverted) / n
    return np.column_stack([u, 1 - u.sum(axis=1)])


GUIDE_POINTS = np.array([[2 / 3, 1 / 6, 1 / 6], [1 / 6, 2 / 3, 1 / 6], [1 / 6, 1 / 6, 2 / 3]])
"""Points of three guiding rays, one near each corner."""
FINE_LATTICE = barycentric_lattice(4)
"""Sixteen points of a partly visible facet."""
_TIPS = inset_points(np.eye(3), EDGE_INSET)
"""Guiding points next to the corners."""
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


@dataclass(frozen=True)
class MirroredShares:
    """Visible shares of facets through mirrors."""

    once: FloatArray
    """(facet,) share visible both directly and through the mirror, 0 … 1."""
    twice: FloatArray
    """(facet,) share visible through the mirror."""
    points: NDArray[np.uint16]
    """(facet,) bit mask of the visible points of `FINE_LATTICE`; all or none where guiding rays agree."""
    mixed: NDArray[np.bool_]
    """(facet,) whether guiding rays disagree, also with neighbours, or the facet is partly visible directly."""
    rays: int


def mirrored_fraction(
    rays: RayScene, viewpoint: FloatArray, corners: FloatArray, facet: IntArray, direct: FloatArray, view: MirrorView
) -> MirroredShares:
    """Share of each facet's area that is visible through its mirror.

    Three guiding rays test each facet. Where they disagree, or a neighbour in the list differs, or the facet is partly
    visible directly (`direct` (facet,), 0 … 1), sixteen points decide. A point counts where the path meets the mirror's
    own face at the point of reflection and nothing else on both legs.
    """
    count = 0

    def shares(index: NDArray[np.intp], weights: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
        """(facet,) share visible both ways, and (sample, facet) points visible through the mirror."""
        nonlocal count
        targets = np.tensordot(weights, corners[index], axes=(1, 1)).reshape(-1, 3)  # sample by sample
        lane = np.tile(index, len(weights))
        twice, sent_there = view.take(lane).is_visible(rays, viewpoint, targets, facet[lane])
        count += sent_there
        once = twice.copy()
        sent = np.flatnonzero(twice)
        lane = np.tile(index, len(weights))[sent]
        once[sent[direct[lane] == 0]] = False
        partly = (direct[lane] > 0) & (direct[lane] < 1)
        sent, lane = sent[partly], lane[partly]
        once[sent] = ~rays.occluded(viewpoint, targets[sent], facet[lane])
        count += len(sent)
        shape = len(weights), len(index)
        return once.reshape(shape).mean(axis=0), twice.reshape(shape)

    once, by_points = shares(np.arange(len(corners)), _TIPS)
    twice = by_points.mean(axis=0)
    mixed = (twice > 0) & (twice < 1) | (once != twice) & (once > 0)
    step = (twice[1:] != twice[:-1]) & (view.mirror[1:] == view.mirror[:-1])
    mixed[1:] |= step
    mixed[:-1] |= step
    mixed |= (direct > 0) & (direct < 1) & (twice > 0)
    points = np.where(twice > 0, ~np.uint16(0), np.uint16(0))
    index = np.flatnonzero(mixed)
    once[index], by_points = shares(index, FINE_LATTICE)
    twice[index] = by_points.mean(axis=0)
    points[index] = (by_points << np.arange(len(FINE_LATTICE), dtype=np.uint16)[:, None]).sum(axis=0, dtype=np.uint16)
    return MirroredShares(once, twice, points, mixed, count)


def visible_to_both(one: NDArray[np.uint16], other: NDArray[np.uint16]) -> FloatArray:
    """(facet,) share of `FINE_LATTICE` in both bit masks (:attr:`MirroredShares.points`)."""
    return np.asarray(np.bitwise_count(one & other) / len(FINE_LATTICE))


class MirrorVisibilitySampler:
    """A :class:`rfgen_sionna.tracing.shadows.visible_polygons.VisibilitySampler` for facets seen through all `views`.

    `corners` are (facet, 3, 3) [m] on the ray scene's faces `facet` (facet,); `straight` adds direct visibility.
    """

    def __init__(
        self,
        rays: RayScene,
        viewpoint: FloatArray,
        corners: FloatArray,
        facet: IntArray,
        views: Sequence[MirrorView],
        straight: bool,
    ) -> None:
        self._rays, self._viewpoint, self._corners, self._facet = rays, viewpoint, corners, facet
        self._views, self._straight = views, straight
        self.sent = 0
        """Rays sent."""

    def visible(self, of: NDArray[np.intp], places: FloatArray) -> NDArray[np.bool_]:
        """(ray,) visibility of barycentric `places` (ray, 3) on facets `of` (ray,)."""
        targets = np.einsum("rc,rci->ri", places, np.take(self._corners, of, axis=0))
        found = np.ones(len(of), np.bool_)
        for view in self._views:
            some = np.flatnonzero(found)
            there = of[some]
            found[some], sent = view.take(there).is_visible(
                self._rays, self._viewpoint, targets[some], self._facet[there]
            )
            self.sent += sent
        if self._straight:
            some = np.flatnonzero(found)
            found[some] = ~self._rays.occluded(self._viewpoint, targets[some], self._facet[of[some]])
            self.sent += len(some)
        return found

    def edges(
        self, of: NDArray[np.intp], unoccluded: FloatArray, occluded: FloatArray, halvings: NDArray[np.intp]
    ) -> tuple[FloatArray, FloatArray]:
        """Bisected boundaries; the occluder's distance is NaN."""
        return bisect_edges(self.visible, of, unoccluded, occluded, halvings)
