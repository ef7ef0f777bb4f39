"""Sampling of facets' visibility on lattices, with the shadow boundaries on each facet."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.scene.point_visibility import PointVisibility
from rfgen_sionna.tracing.shadows.lattices import inset_points, points_of
from rfgen_sionna.tracing.shadows.visible_polygons import (
    EDGE_INSET,
    VisiblePolygons,
    crossed_by_edges,
    find_visible_polygons,
)
from rfgen_sionna.tracing.surface.quadratic_patch import barycentric

_BUNDLED = 8
"""Rays per facet from which packets of rays are faster."""
_BATCH = 500_000
"""Points per batch; bounds memory."""
_HIDDEN = 4e-3
"""Energy that undetected boundaries miss, over that of the returns that they could cut; measured in a furnished
room."""
_SEARCHED = 2
"""Lattice level of the search: finer ones find more edges on one facet in a thousand, which return 0.02 %."""
_BESIDE, _BAND_HALVINGS, _ITSELF = 1e-3, 8, 0.98
"""Offset into the visible side over the search width; bisections of the band's far end; and the ratio of distances from
which the occluder counts as the surface itself."""


class OccluderTest(Protocol):
    """A :class:`~rfgen_sionna.scene.rays.RayScene` or :class:`~rfgen_sionna.scene.occluders.Occluders`."""

    def targets(
        self, viewpoint: FloatArray, corners: FloatArray, facets: Any, moving: bool = False, bundled: bool = False
    ) -> PointVisibility:
        """Visibility test of points on pieces of `facets`."""


class LatticeSampler:
    """Samples facets on lattices; the latest sample of a facet counts.

    The arguments are those of `sample_visibility`, with the phase range `width` (facet,) [rad] and the visible
    `fraction` (facet,), which is updated.
    """

    def __init__(
        self,
        rays: OccluderTest,
        viewpoint: FloatArray,
        corners: FloatArray,
        facet: IntArray | NDArray[np.int64],
        width: FloatArray,
        fraction: FloatArray,
    ) -> None:
        self._rays, self._viewpoint = rays, viewpoint
        self._corners, self._facet, self._width, self._fraction = corners, facet, width, fraction
        self.lattice: NDArray[np.intp] = np.full(len(corners), -1, np.intp)
        """(facet,) level of the latest lattice; -1 before the first."""
        self._turn = np.zeros(len(corners), np.intp)
        self._found: list[tuple[int, NDArray[np.intp], VisiblePolygons]] = []

    def sample(self, chosen: NDArray[np.intp], level: NDArray[np.intp]) -> None:
        """Sample the `chosen` facets on lattices of their `level` (facet,)."""
        self.lattice[chosen] = level[chosen]
        turn = len(self._found)
        self._turn[chosen] = turn
        batch = np.cumsum(points_of(level[chosen])) // _BATCH
        for some in np.split(chosen, np.flatnonzero(np.diff(batch)) + 1):
            many = bool(points_of(level[some]).sum() > _BUNDLED * len(some))
            targets = self._rays.targets(self._viewpoint, self._corners[some], self._facet[some], bundled=many)
            polygons = find_visible_polygons(targets, level[some], self._width[some])
            self._found.append((turn, some, polygons))
            self._fraction[some] = polygons.fraction

    def search(self, cut: FloatArray, allowed: float) -> tuple[NDArray[np.intp], FloatArray, int]:
        """(facet,) lattice level where an undetected boundary was found, else -1; (facet,) error of skipped facets;
        rays sent.

        Facets are searched by decreasing bound `cut` (facet,) until the rest adds up to `allowed`.
        """
        order = np.argsort(cut, kind="stable")
        few = int(np.searchsorted(np.cumsum(_HIDDEN * cut[order] ** 2), allowed**2))
        missed, found = np.zeros(len(cut)), np.full(len(cut), -1, np.intp)
        missed[order[:few]] = np.sqrt(_HIDDEN) * cut[order[:few]]
        chosen = np.sort(order[few:])
        chosen = chosen[cut[chosen] > 0]
        points = points_of(np.full(len(chosen), _SEARCHED))
        for own in np.split(chosen, np.flatnonzero(np.diff(np.cumsum(points) // _BATCH)) + 1):
            targets = self._rays.targets(self._viewpoint, self._corners[own], self._facet[own], bundled=True)
            crossed = crossed_by_edges(targets, np.full(len(own), _SEARCHED), self._fraction[own] > 0)
            found[own[crossed]] = _SEARCHED
        return found, missed, int(points.sum())

    def sample_sides(self, whole: NDArray[np.intp], places: IntArray) -> int:
        """Find boundaries along the sides that fully visible facets (`whole`) share with occluded ones; returns the
        rays sent.

        `places` (facet, 3) are the numbers of `shared_vertices`.
        """
        own = places[whole]
        if not len(own):
            return 0
        occluded = places[self._fraction == 0]
        # Few of the occluded facets have two corners in common with these.
        shared = np.zeros(int(max(own.max(), occluded.max(initial=0))) + 1, np.bool_)
        shared[own] = True
        one, two, three = shared[occluded].T
        occluded = occluded[(one & two) | (two & three) | (three & one)]
        row, corner = np.nonzero(np.isin(_sides(own), _sides(occluded)))
        row, one = np.unique(row, return_index=True)  # one side per facet
        if not len(row):
            return 0
        some, corner = whole[row], corner[one]
        triangle = np.eye(3)[(corner[:, None] + np.arange(3)) % 3]  # the corner across the side comes first
        side = 0.5 * (triangle[:, 1] + triangle[:, 2])
        outside = side + EDGE_INSET * (side - triangle[:, 0])
        targets = self._rays.targets(self._viewpoint, self._corners[some], self._facet[some])
        _, occluder = targets.edges(np.arange(len(some)), inset_points(side), outside, 0)
        shadowed = np.flatnonzero(occluder < 1.0)
        ends, found = np.tile(occluder[shadowed, None], 2), some[shadowed]
        self._turn[found] = turn = len(self._found)
        polygons = VisiblePolygons(np.ones(len(found)), np.arange(len(found)), triangle[shadowed], ends, 0)
        self._found.append((turn, found, polygons))
        return len(some)

    def collect(self, reach: float, least: float) -> tuple[NDArray[np.intp], FloatArray, FloatArray, int]:
        """(piece,) facet, ascending, (piece, corner, 3) corners, (piece, 4) occluders, and the number of rays.

        Where elements within `reach` [m] see a boundary shifted by more than `least` [m], its visible band is searched.
        """
        owner = np.concatenate([some[polygons.owner] for _, some, polygons in self._found])
        pieces = np.concatenate([polygons.pieces for _, _, polygons in self._found])
        occluder = np.concatenate([polygons.occluder for _, _, polygons in self._found])
        turn = np.concatenate([np.full(len(polygons.owner), turn) for turn, _, polygons in self._found])
        latest = np.flatnonzero(turn == self._turn[owner])
        order = latest[np.argsort(owner[latest], kind="stable")]
        owner, pieces, occluder = owner[order], pieces[order], occluder[order]
        next_occluder, sent = self._bands(owner, pieces, occluder, reach, least)
        sent += sum(polygons.rays for _, _, polygons in self._found)
        return owner, pieces, np.column_stack([occluder, next_occluder]), sent

    def _bands(
        self, owner: NDArray[np.intp], pieces: FloatArray, occluder: FloatArray, reach: float, least: float
    ) -> tuple[FloatArray, int]:
        """(piece, 2) width [m] of the visible band beside each boundary and its far occluder's ratio; the rays sent."""
        found = np.tile([np.inf, np.nan], (len(owner), 1))
        off = occluder.mean(axis=1)
        some = np.flatnonzero(reach * (1.0 - off) > least * off)  # not NaN
        if not len(some):
            return found, 0
        corners = self._corners[owner[some]] - self._viewpoint
        start, stop = (np.einsum("ec,eci->ei", pieces[some, corner], corners) for corner in (1, 2))
        middle, (one, other) = 0.5 * (start + stop), (corners[:, k] - corners[:, 0] for k in (1, 2))
        normal = np.cross(one, other)
        inward = np.cross(normal, stop - start)
        inward /= np.maximum(lengths(inward), 1e-300)[:, None]
        upright = np.abs(np.einsum("ei,ei->e", normal, middle)) / np.maximum(lengths(normal) * lengths(middle), 1e-300)
        width = 2.0 * reach * (1.0 - off[some]) / np.maximum(off[some] * np.maximum(upright, 0.1), 1e-6)
        way = barycentric((corners[:, 0] + width[:, None] * inward)[:, None], corners)[:, 0] - [1.0, 0.0, 0.0]
        edge = 0.5 * (pieces[some, 1] + pieces[some, 2])
        owners = owner[some]
        targets = self._rays.targets(self._viewpoint, self._corners[owners], self._facet[owners])
        crossing, next_occluder = targets.edges(np.arange(len(some)), edge + _BESIDE * way, edge + way, _BAND_HALVINGS)
        # Occluders other than the curved surface itself.
        occluded = np.flatnonzero(next_occluder < _ITSELF)
        share = ((crossing - edge) * way).sum(axis=1)[occluded] / np.maximum((way**2).sum(axis=1)[occluded], 1e-300)
        found[some[occluded]] = np.column_stack([share * width[occluded], next_occluder[occluded]])
        return found, (1 + _BAND_HALVINGS) * len(some)


def _sides(places: IntArray) -> NDArray[np.int64]:
    """(facet, corner) key of the side opposite each corner, for vertex numbers `places` (facet, 3)."""
    one, other = places[:, [1, 2, 0]].astype(np.int64), places[:, [2, 0, 1]].astype(np.int64)
    return np.asarray((np.minimum(one, other) << 32) + np.maximum(one, other))
