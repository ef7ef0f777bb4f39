"""StaticReturns of static facets and of the pieces of them that actors leave visible."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import ComplexArray, FloatArray
from rfgen_sionna.scene.materials import Material
from rfgen_sionna.tracing.gains.band import BandTracer, Expansion
from rfgen_sionna.tracing.shadows.boundary_edges import BoundaryCorrection, ShadowEdges
from rfgen_sionna.tracing.surface.facets import Facets


class StaticVisibility(NamedTuple):
    """What actors leave of static facets, at one time."""

    left: FloatArray
    """(facet,) share of what is seen without actors."""
    owner: NDArray[np.intp]
    """(piece,) facet that a piece is of, ascending: those that are seen of facets that are hidden in part."""
    pieces: FloatArray
    """(piece, corner, 3) barycentric coordinates of their corners."""
    edges: ShadowEdges | None
    """Shadows' edges on these; None where there are none."""
    missed: float
    """Estimated error for what is not known of shadows' edges, relative to what that of :class:`StaticTrace` is."""
    silhouette: FloatArray
    """(facet,) length of actors' outlines that fall on each [rad], as rays' points tell."""
    nearest: float
    """How far the nearest outline of an actor is [m]; infinity where there is none."""
    values: ComplexArray
    """(value, cut) what the expansion starts from of each facet that is hidden in part, in their order: the sum over
    its pieces. None of them before :meth:`StaticTrace.integrated`."""
    boundary_correction: BoundaryCorrection | None
    """What pairs see more or less of these; None before that, and where there is nothing."""

    def only(self, chosen: NDArray[np.bool_]) -> StaticVisibility:
        """The same as if actors hid nothing but the `chosen` (facet,)."""
        cut = np.unique(self.owner)
        mine = chosen[self.owner]
        edges, beside = self.edges, self.boundary_correction
        return StaticVisibility(
            np.where(chosen, self.left, 1.0),
            self.owner[mine],
            self.pieces[mine],
            None if edges is None else edges.take(np.flatnonzero(chosen[edges.owner])),
            self.missed,
            self.silhouette,
            self.nearest,
            self.values[:, chosen[cut]] if self.values.size else self.values,
            None if beside is None else beside.take(np.flatnonzero(chosen[beside.owner])),
        )


@dataclass(frozen=True)
class StaticReturns:
    """What static facets return, and what tells it of pieces of them."""

    band: BandTracer
    materials: tuple[Material, ...]
    expansion: Expansion
    rough: ComplexArray | None
    """(tx, rx, facet) what roughness adds, or (1, 1, facet) the same for every pair; None where nothing is rough."""
    wavenumber: float
    """At the highest frequency [rad/m]."""
    rtol: float
    level: float
    """What all return without interfering, in units of
    :attr:`rfgen_sionna.tracing.shadows.adaptive_sampling.Sampled.returned`."""

    def of_pieces(self, facets: Facets, parts: Sequence[StaticVisibility]) -> list[StaticVisibility]:
        """The same with their values; all are integrated together."""
        owner, pieces = (np.concatenate([getattr(each, k) for each in parts]) for k in ("owner", "pieces"))
        values = self.band.values(facets.cut(owner, pieces), self.materials, self.expansion, facets.centroids[owner])
        found, first = [], 0
        for each in parts:
            last = first + len(each.owner)
            starts = np.unique(each.owner, return_index=True)[1]
            found.append(each._replace(values=np.add.reduceat(values[:, first:last], starts, axis=1)))
            first = last
        known = [each.edges for each in parts if each.edges is not None]
        if not known:
            return found
        edges = ShadowEdges.joined(known)
        beside = self.beside(facets.cut(edges.owner, edges.tiny), edges, facets.centroids[edges.owner])
        first = 0
        for number, each in enumerate(parts):
            if each.edges is not None:
                last = first + len(each.edges.owner)
                found[number] = found[number]._replace(boundary_correction=beside.take(slice(first, last)))
                first = last
        return found

    def beside(self, tiny: Facets, edges: ShadowEdges, reference: FloatArray) -> BoundaryCorrection:
        """What pairs see beside shadows' `edges`, of which `tiny` facets tell, by way of the points `reference`
        (edge, 3) [m]."""
        middle = edges.middle + self.band.viewpoint
        values = self.band.values(tiny, self.materials, self.expansion, middle)
        return self.band.boundary_correction(edges, values, reference, self.expansion)
