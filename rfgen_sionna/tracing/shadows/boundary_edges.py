"""Straight pieces of shadow boundaries on facets, and the correction of returns for elements beside the phase centre.

Shadows are cast from the array's phase centre. For another element the boundary shifts by its offset times the distance
from occluder to facet over that from radar to occluder. A pair sees the points that Tx and Rx both see, unless a slab
casts the shadow (:mod:`rfgen_sionna.tracing.shadows.boundary_integrals`). The correction is the integral between both
boundaries: first order in the width, with the full phase.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import ComplexArray, FloatArray
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.tracing.shadows.return_bounds import MAX_BOUNDARY_WIDTH, error_budget
from rfgen_sionna.tracing.surface.facets import Facets
from rfgen_sionna.tracing.surface.quadratic_patch import barycentric

MAX_SLANT = 2.0
"""Largest change of the way from occluder to facet between elements, as a factor: beyond it a facet is seen edge-on."""
_TINY = 1e-4
"""Size of the small piece around an edge's middle, over the facet's: its phase is uniform."""
_MAX_PHASE_ERROR = 0.03
"""Largest phase error of a straight piece at its ends [rad]: 30 dB below its return."""
_MOST_PIECES = 256
"""Most pieces of one edge; bounds memory for facets of many wavelengths."""
_LEFT_PER_RTOL = 1.0
"""Bound on the return of skipped edges per unit of the tolerance (:meth:`ShadowEdges.return_bounds`)."""
_LIKELY, _MISSED = 0.2, (0.005, 0.015)
"""Typical return of a boundary over its bound, and the error of that on flat and on curved facets, which have many
short edges; measured on plates and bodies."""


@dataclass(frozen=True)
class ShadowEdges:
    """Straight pieces of shadow boundaries on facets."""

    owner: NDArray[np.intp]
    """(edge,) facet of each edge."""
    piece: NDArray[np.intp]
    """(edge,) visible piece that it bounds."""
    small_piece: FloatArray
    """(edge, corner, 3) barycentric coordinates of a small piece of the facet around the edge's middle."""
    area: FloatArray
    """(edge,) area of the small piece [m^2]."""
    middle: FloatArray
    """(edge, 3) middle of the edge [m], from the viewpoint."""
    along: FloatArray
    """(edge, 3) unit vector along the edge; `length` (edge,) [m]."""
    length: FloatArray
    tangents: FloatArray
    """(edge, 2, 3) surface tangents across and along the edge; `edge_curvature` (edge, 3, 3) holds the second
    derivatives across, along and mixed [1/m]."""
    edge_curvature: FloatArray
    inward: FloatArray
    """(edge, 3) unit vector in the facet, across the edge to the visible side."""
    normal: FloatArray
    """(edge, 3) unit normal."""
    occluder: FloatArray
    """(edge,) occluder's distance over the edge's."""
    weight: FloatArray
    """(edge,) weight of the correction, 0 … 1."""
    band: FloatArray
    """(edge,) width of the visible band beside the edge [m]; `next_occluder` (edge,) is the distance ratio of the
    occluder at its far end. Infinity and NaN where the band is wider than the array resolves."""
    next_occluder: FloatArray
    through: ComplexArray
    """(edge, 2, 3) amplitude transmitted by the occluder, one way and two ways, at the lowest, middle and highest
    frequency; (edge, 0, 3) without slabs."""

    @staticmethod
    def of(
        facets: Facets,
        owner: NDArray[np.intp],
        pieces: FloatArray,
        occluder: FloatArray,
        viewpoint: FloatArray,
        wavenumber: float,
    ) -> ShadowEdges:
        """Straight pieces of the boundaries of visible `pieces` (piece, 3, 3) on flat facets `owner` (piece,).

        `occluder` (piece, 4) is :attr:`SampledVisibility.occluder`, or (piece, 16) that of
        :class:`rfgen_sionna.tracing.shadows.boundary_edges.ShadowEdges`. At `wavenumber` [rad/m] the phase is
        linear on each piece.
        """
        edged = np.flatnonzero(occluder[:, 0] < 1.0)  # not NaN
        through = np.ascontiguousarray(occluder[edged, 4:]).view(np.complex128)
        through = through.reshape(len(edged), through.shape[1] // 3, 3)
        owner, occluder, band = owner[edged], occluder[edged, :2].mean(axis=1), occluder[edged, 2:4]
        corners = np.take(facets.corners, owner, axis=0) - viewpoint
        start, stop = (pieces[edged, corner] for corner in (1, 2))
        first, last = (np.einsum("ec,eci->ei", each, corners) for each in (start, stop))
        patch = np.sqrt(4.0 * _MAX_PHASE_ERROR / wavenumber * lengths(0.5 * (first + last)))
        count = np.clip(np.ceil(lengths(last - first) / patch), 1, _MOST_PIECES).astype(np.intp)
        edge = np.repeat(np.arange(len(edged)), count)
        step = np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)
        share = ((step + 0.5) / count[edge])[:, None]
        place = (1.0 - share) * start[edge] + share * stop[edge]
        along = (last - first)[edge] / count[edge, None]
        length = lengths(along)
        along /= np.maximum(length, 1e-300)[:, None]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        size = lengths(across)
        normal = (across / np.maximum(size, 1e-300)[:, None])[edge]
        inward = np.cross(normal, along)
        return ShadowEdges(
            owner[edge],
            edged[edge],
            place[:, None] + _TINY * (np.eye(3) - 1 / 3),
            0.5 * _TINY**2 * size[edge],
            np.einsum("ec,eci->ei", place, corners[edge]),
            along,
            length,
            np.stack([inward, along], axis=1),
            np.zeros((len(edge), 3, 3)),
            inward,
            normal,
            occluder[edge],
            np.ones(len(edge)),
            band[edge, 0],
            band[edge, 1],
            through[edge],
        )

    def significant(
        self,
        return_bounds: FloatArray,
        unknown: FloatArray,
        known: FloatArray,
        curved: NDArray[np.bool_],
        group: NDArray[np.intp],
        level: FloatArray,
        rtol: float,
    ) -> tuple[ShadowEdges, FloatArray]:
        """Edges with a significant return, weighted, and each group's error (group,) relative to its `level` (group,).

        `return_bounds`, `unknown` and `known` (edge,) are of :meth:`return_bounds`, `curved` (edge,) marks
        curved facets.
        """

        def energy(strength: FloatArray) -> FloatArray:
            return np.asarray(np.bincount(group, strength**2, len(level)))

        least = np.zeros(len(level))
        for each in np.flatnonzero(np.bincount(group)):
            least[each] = error_budget(return_bounds[group == each], _LEFT_PER_RTOL * rtol * level[each])
        counted = np.clip(return_bounds / np.maximum(least, 1e-300)[group] - 1.0, 0.0, 1.0)
        missed = energy(_LIKELY * (1.0 - counted) * return_bounds) + energy((1.0 - known) * counted * unknown)
        missed = np.sqrt(missed + energy(np.where(curved, _MISSED[1], _MISSED[0]) * return_bounds))
        missed, weight = missed / np.where(level > 0, level, np.inf), known * counted
        return replace(self, weight=weight).take(np.flatnonzero(weight)), missed

    def with_curvature(self, facets: Facets) -> ShadowEdges:
        """The same edges on curved `facets`."""
        if facets.patch is None or not len(self.owner):
            return self
        corners = np.take(facets.corners, self.owner, axis=0)
        ways = np.concatenate([self.tangents, self.tangents.sum(axis=1, keepdims=True)], axis=1)
        steps = barycentric(corners[:, :1] + ways, corners) - [1.0, 0.0, 0.0]
        slope, more = facets.patch.take(self.owner).turned(self.small_piece.mean(axis=1), steps)
        edge_curvature = np.concatenate([2.0 * more[:, :2], more[:, 2:] - more[:, :1] - more[:, 1:2]], axis=1)
        return replace(self, tangents=self.tangents + slope[:, :2], edge_curvature=edge_curvature)

    def take(self, index: NDArray[np.intp] | slice) -> ShadowEdges:
        """Edges of an index."""
        return self._map(lambda name: getattr(self, name)[index])

    @staticmethod
    def joined(parts: Sequence[ShadowEdges]) -> ShadowEdges:
        """Concatenation."""
        return parts[0]._map(lambda name: np.concatenate([getattr(each, name) for each in parts]))

    def _map(self, column: Callable[[str], NDArray[Any]]) -> ShadowEdges:
        return ShadowEdges(**{each.name: column(each.name) for each in fields(self)})

    def shifts(self, elements: FloatArray) -> FloatArray:
        """(element, edge) inward shift of the boundary for `elements` (element, 3) [m] from the viewpoint [m]."""
        height, own = np.einsum("ei,ei->e", self.normal, self.middle), elements @ self.normal.T
        below = self.occluder * height - own
        on = (height - own) * self.occluder / np.where(np.abs(below) > 1e-12, below, 1e-12)
        on = np.clip(on, 1.0 / MAX_SLANT, MAX_SLANT) / np.maximum(self.occluder, 1e-6)
        # From the element through the occluder, `on` times as far.
        here, there = elements @ self.inward.T, np.einsum("ei,ei->e", self.inward, self.middle)
        return np.asarray(here + on * (self.occluder * there - here) - there)

    def return_bounds(
        self, tx: FloatArray, rx: FloatArray, wavenumber: float, edge_curvature: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Bounds on the correction of any pair of elements `tx` and `rx` (element, 3) [m] from the viewpoint.

        Returns (edge,) the bound, the bound where the surface beside the edge is unknown, and the known share, 0 … 1;
        the unit is that of :attr:`SampledVisibility.returned`, twice the solid angle. The phase along the edge limits
        coherent addition, up to 1 rad or half the first Fresnel zone. On a grazing surface of `edge_curvature` (edge,)
        [1/m] the phase gradient changes across the boundary, so that only its two sides contribute.
        """
        distance = np.maximum(lengths(self.middle), 1e-9)
        towards = self.middle / distance[:, None]
        turn = 2.0 * wavenumber * np.abs(np.einsum("ei,ei->e", self.along, towards))
        width = np.abs(self.shifts(np.concatenate([tx, rx]))).max(axis=0, initial=0.0)
        upright = np.abs(np.einsum("ei,ei->e", self.normal, towards))
        widest = MAX_BOUNDARY_WIDTH * np.sqrt(2 * np.pi / wavenumber * distance)
        known = np.clip(2.0 - width / widest, 0.0, 1.0)
        width = np.minimum(width, 2.0 * widest)
        angle = upright * width * self.length / distance**2
        if self.through.size:
            once, twice = self.through[:, 0], self.through[:, 1]
            angle *= (np.abs(1.0 - once) + np.abs(once - twice)).max(axis=1)
        aslant = np.abs(np.einsum("ei,ei->e", self.inward, towards)) - edge_curvature * upright * width
        return_bounds = 2.0 * angle / np.maximum(0.5 * turn * self.length, 1.0)
        zone = np.sqrt(np.pi / (2.0 * wavenumber * (edge_curvature * upright + 1.0 / distance)))
        in_phase = np.minimum(2.0 / np.maximum(turn, 1e-9), zone)
        more = np.sqrt(np.maximum(in_phase / np.maximum(self.length, 1e-12), 1.0))
        return return_bounds, return_bounds * more / np.maximum(wavenumber * aslant * width, 1.0), known


class BoundaryCorrection(NamedTuple):
    """Corrections of facet returns for the elements' own shadow boundaries."""

    owner: NDArray[np.intp]
    """(edge,) facet of each edge."""
    gains: ComplexArray
    """(order, tx, rx, edge) polynomials in u, with delays by the facets' reference points."""

    def take(self, index: NDArray[np.intp] | slice) -> BoundaryCorrection:
        """Corrections of an index of edges."""
        return BoundaryCorrection(self.owner[index], self.gains[..., index])

    def within(self, chosen: NDArray[np.intp]) -> BoundaryCorrection:
        """Corrections of the `chosen` facets, ascending, renumbered."""
        if not len(chosen):
            return BoundaryCorrection(np.zeros(0, np.intp), self.gains[..., :0])
        place = np.minimum(np.searchsorted(chosen, self.owner), len(chosen) - 1)
        mine = np.flatnonzero(chosen[place] == self.owner)
        return BoundaryCorrection(place[mine], self.gains[..., mine])

    def split(self, facets: int, times: int) -> list[BoundaryCorrection]:
        """Corrections of each of `times` equal runs of `facets`."""
        return [self.within(np.arange(first, first + facets)) for first in range(0, facets * times, facets)]

    def add_to(self, gains: ComplexArray) -> None:
        """Add to `gains` (order, tx, rx, facet)."""
        order = np.argsort(self.owner, kind="stable")
        facets, first = np.unique(self.owner[order], return_index=True)
        if len(facets):
            gains[..., facets] += np.add.reduceat(self.gains[..., order], first, axis=-1)

    @staticmethod
    def joined(parts: Sequence[BoundaryCorrection]) -> BoundaryCorrection:
        """Concatenation."""
        owner, gains = (np.concatenate([each[k] for each in parts], axis=-1) for k in (0, 1))
        return BoundaryCorrection(owner, gains)
