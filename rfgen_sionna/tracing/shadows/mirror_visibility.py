"""Visibility of facets through plane mirrors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.shadows.lattices import inset_points
from rfgen_sionna.tracing.shadows.mirror_views import MirrorView
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
