"""Points on facets that tell what is seen, and what mirrors show of facets."""

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
    """(n^2, 3) barycentric centroids of the n^2 equal triangles that a triangle splits into."""
    upright = [(i + 1 / 3, j + 1 / 3) for i in range(n) for j in range(n - i)]
    inverted = [(i + 2 / 3, j + 2 / 3) for i in range(n) for j in range(n - i - 1)]
    u = np.array(upright + inverted) / n
    return np.column_stack([u, 1 - u.sum(axis=1)])


GUIDE_POINTS = np.array([[2 / 3, 1 / 6, 1 / 6], [1 / 6, 2 / 3, 1 / 6], [1 / 6, 1 / 6, 2 / 3]])
FINE_LATTICE = barycentric_lattice(4)
_TIPS = inset_points(np.eye(3), EDGE_INSET)
_LEAST_HEIGHT = 1e-4
"""What lies nearer to a mirror than this [m] is on it."""
_ABOVE = 2e-4
"""Rays from mirror to mirror start this far above the first [m], which may be off its plane by half of it."""


@dataclass(frozen=True)
class MirrorView:
    """Which mirror shows each facet, and where the mirrors' faces are."""

    normal: FloatArray
    """(facet, 3) unit vector of the facet's mirror, towards the viewpoint's side."""
    offset: FloatArray
    """(facet,) normal . x of the mirror [m]."""
    mirror: IntArray
    """(facet,) number of the mirror."""
    owner: IntArray
    """(face,) number of the mirror that each face of the ray scene belongs to, -1 for none."""

    def take(self, index: NDArray[np.intp]) -> MirrorView:
        """That of the facets that `index` counts out."""
        return MirrorView(self.normal[index], self.offset[index], self.mirror[index], self.owner)

    def is_visible(
        self, rays: RayScene, viewpoint: FloatArray, targets: FloatArray, facet: IntArray
    ) -> tuple[NDArray[np.bool_], int]:
        """(facet,) whether the viewpoint sees by each one's mirror a point on it, `targets` (facet, 3) [m], of which
        `facet` (facet,) is the ray scene's face; and the rays sent."""
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
    """As :class:`MirrorView`, of mirrors that others show."""

    first: MirrorView
    """Of each facet the mirror that comes before its own."""

    def take(self, index: NDArray[np.intp]) -> SecondOrderView:
        """That of the facets that `index` counts out."""
        own = super().take(index)
        return SecondOrderView(own.normal, own.offset, own.mirror, own.owner, self.first.take(index))

    def is_visible(
        self, rays: RayScene, viewpoint: FloatArray, targets: FloatArray, facet: IntArray
    ) -> tuple[NDArray[np.bool_], int]:
        """As there, by way of both mirrors."""
        first = self.first
        image = viewpoint - 2.0 * (first.normal @ viewpoint - first.offset)[:, None] * first.normal
        place = _crossing(self, image, targets)
        turn = _crossing(first, np.broadcast_to(viewpoint, place.shape), place)
        found, sent = np.asarray(~np.isnan(place + turn).any(axis=1)), 0
        met = np.full(len(targets), -1, np.int64)
        # A ray that leaves the first mirror starts a little above it.
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
    """(facet, 3) where ways from a `source` (facet, 3) to `targets` (facet, 3) meet each one's mirror [m]; NaN where
    one of both is not before it."""
    here, there = (np.einsum("ri,ri->r", each, view.normal) - view.offset for each in (source, targets))
    share = here / np.where((here > _LEAST_HEIGHT) & (there > _LEAST_HEIGHT), here + there, np.nan)
    foot, other = (each - height[:, None] * view.normal for each, height in ((source, here), (targets, there)))
    return np.asarray(foot + share[:, None] * (other - foot))


@dataclass(frozen=True)
class MirroredShares:
    """Visible shares of facets that mirrors show."""

    once: FloatArray
    """(facet,) share of the area that is seen both directly and by the mirror, 0 … 1."""
    twice: FloatArray
    """(facet,) share that is seen by the mirror."""
    points: NDArray[np.uint16]
    """(facet,) which of the points `FINE_LATTICE` that is, a bit for each: all or none where guiding rays agree."""
    mixed: NDArray[np.bool_]
    """(facet,) whether those do not, or not with their neighbours', or a part is seen directly: a rim may be on it."""
    rays: int


def mirrored_fraction(
    rays: RayScene, viewpoint: FloatArray, corners: FloatArray, facet: IntArray, direct: FloatArray, view: MirrorView
) -> MirroredShares:
    """Share of each facet's area that its mirror shows to the viewpoint.

    A point counts where the way from the viewpoint first meets the mirror in the place that the law of reflection asks
    for, and nothing is between that place and the point. `direct` (facet,) is the share that is seen directly. Three
    guiding rays go to every facet, next to its corners; where they disagree, where the neighbour in the list (most
    often one in the mesh too) is shown differently, or where a part is seen directly, 16 on a lattice decide.
    """
    count = 0

    def shares(index: NDArray[np.intp], weights: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
        """The share seen both ways, and (sample, facet) which points the mirror shows."""
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
    """Share of the points `FINE_LATTICE` that are among both of two choices of :attr:`MirroredShares.points`."""
    return np.asarray(np.bitwise_count(one & other) / len(FINE_LATTICE))


class MirrorVisibilitySampler:
    """Tells which points of facets mirrors show, as :class:`rfgen_sionna.tracing.shadows.visible_polygons.Look` has it.

    Parameters
    ----------
    rays
        The geometry.
    viewpoint
        (3,) [m].
    corners, facet
        (facet, 3, 3) [m] and (facet,) the ray scene's face that each is a piece of.
    views
        The mirrors that are to show a point, all of them.
    straight
        Whether it is to be seen directly as well.
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
        """As there."""
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
        """As there; how far off what casts a shadow is nobody asks for."""
        return bisect_edges(self.visible, of, unoccluded, occluded, halvings)
