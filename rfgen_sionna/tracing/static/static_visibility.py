"""StaticReturns of static facets and of the pieces of them that actors leave visible."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray
from rfgen_sionna.scene.materials import Material
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.gains.band import BandTracer, Expansion
from rfgen_sionna.tracing.shadows.adaptive_sampling import (
    CornerVisibility,
    SampledVisibility,
    sample_visibility,
    shared_vertices,
)
from rfgen_sionna.tracing.shadows.boundary_edges import BoundaryCorrection, ShadowEdges
from rfgen_sionna.tracing.shadows.silhouettes import FacetLocator, SilhouetteRays
from rfgen_sionna.tracing.surface.facets import Facets, stack_facets, with_patches
from rfgen_sionna.tracing.surface.surfaces import Surfaces
from rfgen_sionna.tracing.surface.tessellate import NO_FACETS, tessellate


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
        edges, correction = self.edges, self.boundary_correction
        return StaticVisibility(
            np.where(chosen, self.left, 1.0),
            self.owner[mine],
            self.pieces[mine],
            None if edges is None else edges.take(np.flatnonzero(chosen[edges.owner])),
            self.missed,
            self.silhouette,
            self.nearest,
            self.values[:, chosen[cut]] if self.values.size else self.values,
            None if correction is None else correction.take(np.flatnonzero(chosen[correction.owner])),
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
        """What pairs see beside shadows' `edges`, of which `tiny` facets tell, by way of the points `reference`
        (edge, 3) [m]."""
        middle = edges.middle + self.band.viewpoint
        values = self.band.values(tiny, self.materials, self.expansion, middle)
        return self.band.boundary_correction(edges, values, reference, self.expansion)


def static_facets(
    surfaces: Surfaces,
    band: BandTracer,
    viewpoint: FloatArray,
    tolerance: FloatArray,
    max_range: float,
    chosen: Collection[int] | None = None,
) -> Facets:
    """All facets of the static surfaces, or of those `chosen`, made for the `tolerance` (surface,) of each and as far
    as `max_range` [m]: seen or not, whichever way they look."""
    pieces = [
        tessellate(
            points,
            surface.faces,
            viewpoint,
            band.highest,
            rtol,
            band.pattern_gain,
            max_range,
            band.half_band,
            smooth=surface.smooth,
            still=True,
        )
        if chosen is None or number in chosen
        else NO_FACETS
        for number, (points, surface, rtol) in enumerate(
            zip(surfaces.static_vertices, surfaces.static, tolerance.tolist(), strict=True)
        )
    ]
    wavenumber = max_wavenumber(band)
    flat = stack_facets(surfaces.static, pieces, [surfaces.static_vertices], viewpoint, wavenumber)
    (found,) = with_patches(flat, surfaces.static, pieces, [surfaces.static_vertices])
    return found


SlabEdgeTransmission = Callable[[RayScene, Facets, SampledVisibility], tuple[FloatArray, int]]
"""What is seen of facets to (piece, 16) what casts the shadows and what that lets through, as
:meth:`rfgen_sionna.tracing.shadows.boundary_edges.ShadowEdges.of` takes it, and the number of rays sent."""


def max_wavenumber(band: BandTracer) -> float:
    return 2 * np.pi * band.highest / SPEED_OF_LIGHT


class VisibleStaticFacets(NamedTuple):
    facets: Facets
    fraction: FloatArray
    """(facet,)"""
    whole: int
    """So many facets come first, then pieces of others."""
    edges: ShadowEdges
    """Shadows' edges on these pieces."""
    tiny: Facets
    """What tells of them."""
    hidden: Facets
    hidden_fraction: FloatArray
    """(hidden,)"""
    level: float
    """What all return without interfering, in units of
    :attr:`rfgen_sionna.tracing.shadows.adaptive_sampling.SampledVisibility.returned`."""
    missed: float
    """Estimated error of that for what is not known of shadows' edges, relative to it."""
    rays: int


def find_visible_facets(
    surfaces: Surfaces,
    rays: RayScene | None,
    band: BandTracer,
    viewpoint: FloatArray,
    rtol: float,
    tolerance: FloatArray,
    max_range: float,
    silhouette_rays: SilhouetteRays | None,
    slab_edges: SlabEdgeTransmission | None,
) -> VisibleStaticFacets:
    """The facets that are seen, made for the `tolerance` (surface,) of each surface, and of those that are seen in part
    the pieces that are; and those that are hidden, or in part, with their visible share."""
    facets = static_facets(surfaces, band, viewpoint, tolerance, max_range)
    near = lengths(facets.centroids - viewpoint) < max_range
    facets = facets.take(np.flatnonzero(facets.facing & near))
    facets = facets.with_pattern_gradient(band.pattern_gradient(facets))
    if rays is None:
        nothing = np.zeros(len(facets))
        none = np.zeros(0, np.intp)
        edges, _ = band.edges(facets, none, np.zeros((0, 3, 3)), np.zeros((0, 4)), none, np.zeros(1))
        return VisibleStaticFacets(facets, nothing, len(facets), edges, facets.take(none), facets, nothing, 0.0, 0.0, 0)
    places = shared_vertices(facets.corners, facets.surface)
    guided, sent = CornerVisibility(viewpoint, facets.corners, facets.number, places).visible(rays)
    silhouette, past = (
        (None, None)
        if silhouette_rays is None
        else FacetLocator(facets.corners - viewpoint, facets.number).silhouette_lengths(silhouette_rays)
    )
    weight = band.pattern_gain(facets.directions(viewpoint))
    found = sample_visibility(
        rays, viewpoint, facets.corners, facets.number, guided, max_wavenumber(band), rtol, silhouette, weight,
        search=True, places=places, reach=band.reach, shadowing=past,
    )  # fmt: skip
    cut = np.zeros(len(facets), np.bool_)
    cut[found.owner] = True
    whole = np.flatnonzero((found.fraction > 0) & ~cut)
    visible = Facets.joined([facets.take(whole), facets.cut(found.owner, found.pieces)])
    visible = visible.with_pattern_gradient(band.pattern_gradient(visible))
    level, missed = (float(np.linalg.norm(each)) for each in (found.returned, found.missed))
    missed = missed / level if level > 0 else 0.0
    group = np.zeros(len(found.owner), np.intp)
    occluder, slab_rays = (found.occluder, 0) if slab_edges is None else slab_edges(rays, facets, found)
    edges, edge_error = band.edges(facets, found.owner, found.pieces, occluder, group, np.array([level]))
    tiny, edges = facets.cut(edges.owner, edges.small_piece), replace(edges, owner=len(whole) + edges.piece)
    if visible.pattern_gradient is not None:
        tiny = replace(
            tiny, pattern_gradient=visible.pattern_gradient[edges.owner], gradient_origin=visible.centroids[edges.owner]
        )
    hidden = np.flatnonzero(found.fraction < 1)
    return VisibleStaticFacets(
        visible,
        np.concatenate([found.fraction[whole], np.ones(len(found.owner))]),
        len(whole),
        edges,
        tiny,
        facets.take(hidden),
        found.fraction[hidden],
        level,
        float(np.hypot(missed, edge_error[0])),
        sent + found.rays + slab_rays,
    )
