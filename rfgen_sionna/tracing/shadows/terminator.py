"""Where round things turn out of sight: facets that look away, but not all of them, bent as they are.

Whether a facet looks at the radar its flat triangle tells. What turns away before the end of one that does returns
nothing, as the integral knows; of one that does not a strip may look at the radar still, before the smooth surface
turns away. All around a body these strips add up, on a ball in phase.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.tracing.surface.facets import Facets

NORMAL_TILT = 1.5
"""The surface leans from the flat facet by as much as normals do and more, where these are of uneven neighbours."""
_CORNERS = np.eye(3)


def near_terminator(facets: Facets, viewpoint: FloatArray, reach: float) -> NDArray[np.bool_]:
    """(facet,) which of those that look away from the `viewpoint` (3,) [m] may look at it in part, or at an element no
    further than `reach` [m] from there, by how much normals lean from the flat facets'."""
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
    """How it runs over some facets."""

    before: NDArray[np.bool_]
    """(facet, corner) at which corners the smooth surface looks at the viewpoint or, as for :func:`near_terminator`,
    at an element near it."""
    owner: NDArray[np.intp]
    """(piece,) which of the facets a piece is of, ascending: those that the viewpoint's horizon crosses are cut at it,
    as what a facet returns has a kink there."""
    pieces: FloatArray
    """(piece, corner, 3) barycentric coordinates of its corners."""

    @staticmethod
    def of(facets: Facets, chosen: NDArray[np.intp], viewpoint: FloatArray, reach: float) -> Terminator:
        """That over the bent `facets` that `chosen` counts out."""
        sampler = _PatchView.of(facets, chosen, viewpoint)
        heights, widths = zip(*(sampler.height(corner) for corner in _CORNERS), strict=True)
        height = np.stack(heights, axis=1)
        mixed = np.flatnonzero((height > 0).any(axis=1) & (height <= 0).any(axis=1))
        sampler, ends = sampler.take(mixed), height[mixed]
        middles = np.stack([sampler.height(0.5 * (1.0 - corner))[0] for corner in _CORNERS], axis=1)
        # One corner is alone on its side; seen from there, the horizon crosses both edges that leave it.
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
        """That over the facets that `kept` (facet,) marks."""
        mine = mask[self.owner]
        return Terminator(self.before[mask], (np.cumsum(mask) - 1)[self.owner[mine]], self.pieces[mine])


def unoccluded_by_neighbours(
    chosen: NDArray[np.intp],
    before: NDArray[np.bool_],
    sampled: NDArray[np.bool_],
    fraction: FloatArray,
    places: IntArray,
) -> NDArray[np.bool_]:
    """(chosen,) which of the facets that `chosen` counts out nothing else hides, as far as their neighbours tell:
    those that were `sampled` (facet,) at and touch their corners `before` (chosen, corner) the horizon are seen by more
    than half, by the `fraction` (facet,) of each, or are such facets themselves. `places` (facet, 3) tell which corners
    touch. Beside facets that are too faint to be looked at strips are fainter."""
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
    """Bent facets as seen from the viewpoint: three vectors of three axes (vector, axis, facet) each, as long rows are
    quick to reckon with."""

    corners: FloatArray
    """[m]"""
    sagittas: FloatArray
    """Four times :attr:`rfgen_sionna.tracing.surface.quadratic_patch.Bend.sagittas` [m]."""

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
        """(facet,) by how much the surface looks at the viewpoint at barycentric coordinates `place` (3,), above 0
        where it does, in units of the (facet,) length of the normal there times the distance."""
        (a, b, c), p, r = place.tolist(), self.corners, self.sagittas
        at = a * p[0] + b * p[1] + c * p[2] + b * c * r[0] + c * a * r[1] + a * b * r[2]
        one = p[1] - p[0] + c * (r[0] - r[1]) + (a - b) * r[2]
        two = p[2] - p[0] + b * (r[0] - r[2]) + (a - c) * r[1]
        cross = _cross(one, two)
        return -(cross * at).sum(axis=0), np.sqrt((cross**2).sum(axis=0))


def _crossing(start: FloatArray, middle: FloatArray, end: FloatArray) -> FloatArray:
    """Where along edges the parabola through three values is 0, whose ends have opposite signs."""
    a, b = 2.0 * (start + end) - 4.0 * middle, 4.0 * middle - 3.0 * start - end
    root = np.sqrt(np.maximum(b * b - 4.0 * a * start, 0.0))
    q = -0.5 * (b + np.where(b < 0, -root, root))
    one, other = (np.divide(x, y, out=np.full(len(x), -1.0), where=y != 0) for x, y in ((q, a), (start, q)))
    return np.clip(np.where((one >= 0) & (one <= 1), one, other), 0.0, 1.0)


def _cross(one: FloatArray, two: FloatArray) -> FloatArray:
    """(axis, ...) of vectors (axis, ...)."""
    return np.stack([one[i - 2] * two[i - 1] - one[i - 1] * two[i - 2] for i in range(3)])
