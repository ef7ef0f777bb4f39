"""Visible parts of static facets, with and without actors, and their returns."""

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
    """Visibility of static facets at one time, with actors."""

    left: FloatArray
    """(facet,) visible share, relative to the scene without actors."""
    owner: NDArray[np.intp]
    """(piece,) facet of each visible piece, ascending; partly occluded facets alone have pieces."""
    pieces: FloatArray
    """(piece, corner, 3) barycentric coordinates of the corners."""
    edges: ShadowEdges | None
    """Shadow boundaries on the pieces; None without any."""
    missed: float
    """Estimated error of unresolved shadow boundaries, relative to the static reference level."""
    silhouette: FloatArray
    """(facet,) length of actors' silhouettes on each [rad]."""
    nearest: float
    """Distance of the nearest silhouette of an actor [m]; infinity without any."""
    values: ComplexArray
    """(value, cut) integrals of each partly occluded facet, in order: sums over pieces. Empty before
    :meth:`StaticTrace.integrated`."""
    boundary_correction: BoundaryCorrection | None
    """Per-element correction of the shadow boundaries; None before integration and without boundaries."""

    def only(self, chosen: NDArray[np.bool_]) -> StaticVisibility:
        """The same, as if actors occluded nothing but the `chosen` (facet,)."""
        cut = np.unique(self.owner)
        mine = chosen[self.owner]
        edges, correction = self.edges, self.boundary_correction
        return StaticVisibility(
            np.where(chosen, self.left, 1.0), self.owner[mine], self.pieces[mine],
            None if edges is None else edges.take(np.flatnonzero(chosen[edges.owner])), self.missed, self.silhouette,
            self.nearest, self.values[:, chosen[cut]] if self.values.size else self.values,
            None if correction is None else correction.take(np.flatnonzero(chosen[correction.owner])),
        )  # fmt: skip


@dataclass(frozen=True)
class StaticReturns:
    """Integration of static facets and their pieces."""

    band: BandTracer
    materials: tuple[Material, ...]
    expansion: Expansion
    rough: ComplexArray | None
    """(tx, rx, facet) diffuse gains, or (1, 1, facet) equal for all pairs; None without rough surfaces."""
    wavenumber: float
    """At the highest frequency [rad/m]."""
    rtol: float
    level: float
    """Incoherent sum of all returns, in units of
    :attr:`rfgen_sionna.tracing.shadows.adaptive_sampling.SampledVisibility.returned`."""

    def of_pieces(self, facets: Facets, parts: Sequence[StaticVisibility]) -> list[StaticVisibility]:
        """The same visibilities with values, integrated in one batch."""
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
        correction = self.boundary_correction(
            facets.cut(edges.owner, edges.small_piece), edges, facets.centroids[edges.owner]
        )
        first = 0
        for number, each in enumerate(parts):
            if each.edges is not None:
                last = first + len(each.edges.owner)
                found[number] = found[number]._replace(boundary_correction=correction.take(slice(first, last)))
                first = last
        return found

    def boundary_correction(self, tiny: Facets, edges: ShadowEdges, reference: FloatArray) -> BoundaryCorrection:
        """Per-element correction of shadow boundaries `edges`, with the gain densities of the `tiny` facets, relative
        to the points `reference` (edge, 3) [m]."""
        middle = edges.middle + self.band.viewpoint
        values = self.band.values(tiny, self.materials, self.expansion, middle)
        return self.band.boundary_correction(edges, values, reference, self.expansion)
