"""Terminator of curved bodies: facets that face away from the radar, but whose smooth surface partly faces it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.tracing.surface.facets import Facets

NORMAL_TILT = 1.5
"""Tilt of the smooth surface over that of its vertex normals; more than 1 for uneven neighbours."""
_CORNERS = np.eye(3)
"""Barycentric coordinates of the corners."""


def near_terminator(facets: Facets, viewpoint: FloatArray, reach: float) -> NDArray[np.bool_]:
    """(facet,) whether a facet that faces away from the `viewpoint` (3,) [m] may partly face it, or an element within
    `reach` [m] of it, by the tilt of its vertex normals."""
    found = np.zeros(len(facets), np.bool_)
    if facets.turn is None:
        return found
    away = np.flatnonzero(~facets.facing & (facets.turn > 0))
    p, offset = np.take(facets.corners, away, axis=0).T, (np.take(facets.centroids, away, axis=0) - viewpoint).T
    cross = _cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    leans = np.minimum(NORMAL_TILT * facets.turn[away], 1.0)
    most = np.sqrt((cross**2).sum(axis=0)) * (leans * np.sqrt((offset**2).sum(axis=0)) + reach)
    found[away] = (cross * offset).sum(axis=0) < most
    return found


class Terminator(NamedTuple):
    """Course of the terminator over some facets."""

    before: NDArray[np.bool_]
    """(facet, corner) corners at which the smooth surface faces the viewpoint or an element near it."""
    owner: NDArray[np.intp]
    """(piece,) facet of each piece, ascending; facets are cut at the terminator, where the integrand has a kink."""
    pieces: FloatArray
    """(piece, corner, 3) barycentric coordinates."""

    @staticmethod
    def of(facets: Facets, chosen: NDArray[np.intp], viewpoint: FloatArray, reach: float) -> Terminator:
        """Terminator over the `chosen` curved facets."""
        sampler = _PatchView.of(facets, chosen, viewpoint)
        heights, widths = zip(*(sampler.height(corner) for corner in _CORNERS), strict=True)
        height = np.stack(heights, axis=1)
        mixed = np.flatnonzero((height > 0).any(axis=1) & (height <= 0).any(axis=1))
        sampler, ends = sampler.take(mixed), height[mixed]
        middles = np.stack([sampler.height(0.5 * (1.0 - corner))[0] for corner in _CORNERS], axis=1)
        # One corner is alone on its side; the terminator crosses both edges that leave it.
        above = ends > 0
        lone = np.where(above.sum(axis=1) == 1, above.argmax(axis=1), (~above).argmax(axis=1))
        row, start, crossed = np.arange(len(mixed)), _CORNERS[lone], []
        for step in (1, 2):
            other, middle = (lone + step) % 3, (lone - step) % 3
            along = _crossing(ends[row, lone], middles[row, middle], ends[row, other])[:, None]
            crossed.append((1.0 - along) * start + along * _CORNERS[other])
        first, second = crossed
        one, two = _CORNERS[(lone + 1) % 3], _CORNERS[(lone + 2) % 3]
        parts = ((start, first, second), (first, one, two), (first, two, second))
        pieces = np.stack([np.stack(each, axis=1) for each in parts], axis=1)
        before = height > -reach * np.stack(widths, axis=1)
        return Terminator(before, np.repeat(mixed, len(parts)), pieces.reshape(-1, 3, 3))

    def take(self, mask: NDArray[np.bool_]) -> Terminator:
        """Terminator over the facets of a mask (facet,)."""
        mine = mask[self.owner]
        return Terminator(self.before[mask], (np.cumsum(mask) - 1)[self.owner[mine]], self.pieces[mine])


def unoccluded_by_neighbours(
    chosen: NDArray[np.intp],
    before: NDArray[np.bool_],
    sampled: NDArray[np.bool_],
    fraction: FloatArray,
    places: IntArray,
) -> NDArray[np.bool_]:
    """(chosen,) facets at the terminator that no other surface occludes, by their neighbours' visible share.

    More than half must be visible of the `sampled` (facet,) facets, by their `fraction` (facet,), that touch the
    corners `before` (chosen, corner) the terminator, or of facets found this way. `places` (facet, 3) number the
    corners.
    """
    touched, size = places[sampled], int(places.max(initial=-1)) + 1
    count = np.bincount(touched.ravel(), minlength=size).astype(np.float64)
    total = np.bincount(touched.ravel(), np.repeat(fraction[sampled], 3), size)
    corners, found, more = places[chosen], np.zeros(len(chosen), np.bool_), True
    while more:
        around, visible = (np.where(before, each[corners], 0.0).sum(axis=1) for each in (count, total))
        fresh = (visible > 0.5 * around) & ~found
        more, found = bool(fresh.any()), found | fresh
        for each in (count, total):
            np.add.at(each, corners[fresh], 1.0)
    return found


class _PatchView(NamedTuple):
    """Quadratic patches as seen from the viewpoint; arrays (vector, axis, facet) for speed."""

    corners: FloatArray
    """Corners [m]."""
    sagittas: FloatArray
    """Four times :attr:`rfgen_sionna.tracing.surface.quadratic_patch.QuadraticPatch.sagittas` [m]."""

    @staticmethod
    def of(facets: Facets, chosen: NDArray[np.intp], viewpoint: FloatArray) -> _PatchView:
        p, patch = np.take(facets.corners, chosen, axis=0) - viewpoint, facets.patch
        if patch is None:
            return _PatchView(np.moveaxis(p, 0, -1), np.zeros((3, 3, len(p))))
        own = patch.take(chosen)
        p = p if own.corner_offsets is None else p + own.corner_offsets
        return _PatchView(np.moveaxis(p, 0, -1).copy(), 4.0 * np.moveaxis(own.sagittas, 0, -1))

    def take(self, some: NDArray[np.intp]) -> _PatchView:
        return _PatchView(self.corners[..., some], self.sagittas[..., some])

    def height(self, place: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(facet,) product of normal and direction to the viewpoint at barycentric `place` (3,), and (facet,) its
        scale."""
        (a, b, c), p, r = place.tolist(), self.corners, self.sagittas
        at = a * p[0] + b * p[1] + c * p[2] + b * c * r[0] + c * a * r[1] + a * b * r[2]
        one = p[1] - p[0] + c * (r[0] - r[1]) + (a - b) * r[2]
        two = p[2] - p[0] + b * (r[0] - r[2]) + (a - c) * r[1]
        cross = _cross(one, two)
        return -(cross * at).sum(axis=0), np.sqrt((cross**2).sum(axis=0))


def _crossing(start: FloatArray, middle: FloatArray, end: FloatArray) -> FloatArray:
    """Zero of the parabola through three equidistant values, on 0 … 1; the end values have opposite signs."""
    a, b = 2.0 * (start + end) - 4.0 * middle, 4.0 * middle - 3.0 * start - end
    root = np.sqrt(np.maximum(b * b - 4.0 * a * start, 0.0))
    q = -0.5 * (b + np.where(b < 0, -root, root))
    one, other = (np.divide(x, y, out=np.full(len(x), -1.0), where=y != 0) for x, y in ((q, a), (start, q)))
    return np.clip(np.where((one >= 0) & (one <= 1), one, other), 0.0, 1.0)


def _cross(one: FloatArray, two: FloatArray) -> FloatArray:
    """(axis, ...) cross products of vectors (axis, ...)."""
    return np.stack([one[i - 2] * two[i - 1] - one[i - 1] * two[i - 2] for i in range(3)])
