"""Facets of the static scene and the search for those that the radar sees."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.gains.band import BandTracer
from rfgen_sionna.tracing.shadows.adaptive_sampling import (
    CornerVisibility,
    SampledVisibility,
    sample_visibility,
    shared_vertices,
)
from rfgen_sionna.tracing.shadows.boundary_edges import ShadowEdges
from rfgen_sionna.tracing.shadows.silhouettes import FacetLocator, SilhouetteRays
from rfgen_sionna.tracing.static.flat_cells import FlatCells, is_divided
from rfgen_sionna.tracing.surface.facets import Facets, stack_facets, with_patches
from rfgen_sionna.tracing.surface.surfaces import Surface, Surfaces
from rfgen_sionna.tracing.surface.tessellate import NO_FACETS, Tessellation, tessellate


def static_facets(
    surfaces: Surfaces,
    band: BandTracer,
    viewpoint: FloatArray,
    tolerance: FloatArray,
    max_range: float,
    chosen: Collection[int] | None = None,
    pieces_of: FlatCells | None = None,
) -> Facets:
    """Facets of the static surfaces, or of the surfaces `chosen`, for the `tolerance` (surface,) and up to `max_range`
    [m], visible or not. Of surfaces that have any, only the triangles `pieces_of` are divided."""

    def divided(number: int, points: FloatArray, surface: Surface, rtol: float) -> Tessellation:
        if chosen is not None and number not in chosen:
            return NO_FACETS
        given = viewpoint, band.highest, rtol, band.pattern_gain, max_range, band.half_band
        if pieces_of is None or not is_divided(surface):
            return tessellate(points, surface.faces, *given, smooth=surface.smooth, still=True)
        first = surface.first_facet
        own = pieces_of.take(np.flatnonzero((pieces_of.face >= first) & (pieces_of.face < first + len(surface.faces))))
        triangles = np.arange(3 * len(own.face), dtype=np.int32).reshape(-1, 3)
        found = tessellate(own.corners.reshape(-1, 3) + viewpoint, triangles, *given, still=True)
        return found.within(own.face - np.int32(first), own.weights)

    pieces = [
        divided(number, points, surface, rtol)
        for number, (points, surface, rtol) in enumerate(
            zip(surfaces.static_vertices, surfaces.static, tolerance.tolist(), strict=True)
        )
    ]
    wavenumber = max_wavenumber(band)
    flat = stack_facets(surfaces.static, pieces, [surfaces.static_vertices], viewpoint, wavenumber)
    (found,) = with_patches(flat, surfaces.static, pieces, [surfaces.static_vertices])
    return found


def facets_of_cells(
    surfaces: Surfaces, band: BandTracer, viewpoint: FloatArray, tolerance: FloatArray, cells: FlatCells
) -> tuple[Facets, NDArray[np.intp]]:
    """Facets of `cells`, for the `tolerance` (surface,), and the (facet,) index of the cell of each."""
    first = np.array([each.first_facet for each in surfaces.static])
    surface = np.searchsorted(first, cells.face, side="right") - 1
    pieces, owner = [], []
    for number, rtol in enumerate(tolerance.tolist()):
        index = np.flatnonzero(surface == number)
        if not len(index):
            pieces.append(NO_FACETS)
            continue
        own = cells.take(index)
        triangles = np.arange(3 * len(index), dtype=np.int32).reshape(-1, 3)
        given = viewpoint, band.highest, rtol, band.pattern_gain, np.inf, band.half_band
        found = tessellate(own.corners.reshape(-1, 3) + viewpoint, triangles, *given, still=True)
        pieces.append(found.within(own.face - np.int32(first[number]), own.weights))
        # As `within` orders them.
        owner.append(index[found.face[np.argsort(own.face[found.face], kind="stable")]])
    flat = stack_facets(surfaces.static, pieces, [surfaces.static_vertices], viewpoint, max_wavenumber(band))
    return with_patches(flat, surfaces.static, pieces, [surfaces.static_vertices])[0], np.concatenate(owner)


SlabEdgeTransmission = Callable[[RayScene, Facets, SampledVisibility], tuple[FloatArray, int]]
"""Returns (piece, 16) occluders and transmission as :meth:`rfgen_sionna.tracing.shadows.boundary_edges.ShadowEdges.of`
takes them, and the number of rays sent."""


def max_wavenumber(band: BandTracer) -> float:
    """Wavenumber at the band's highest frequency [rad/m]."""
    return 2 * np.pi * band.highest / SPEED_OF_LIGHT


class VisibleStaticFacets(NamedTuple):
    """Static facets, visible and occluded ones."""

    facets: Facets
    fraction: FloatArray
    """(facet,)"""
    whole: int
    """Number of uncut facets, which come first; pieces follow."""
    edges: ShadowEdges
    """Shadow boundaries on the pieces."""
    tiny: Facets
    """Facets for the gain density at each boundary."""
    hidden: Facets
    """Facets that are occluded, wholly or in part."""
    hidden_fraction: FloatArray
    """(hidden,)"""
    level: float
    """Incoherent sum of all returns, in units of
    :attr:`rfgen_sionna.tracing.shadows.adaptive_sampling.SampledVisibility.returned`."""
    missed: float
    """Estimated error of unresolved shadow boundaries, relative to `level`."""
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
    pieces_of: FlatCells | None = None,
) -> VisibleStaticFacets:
    """Visible facets of the static scene, cut at shadow boundaries, and occluded ones with their visible share.
    `tolerance` (surface,) is of the tessellation, `rtol` of the visibility; `pieces_of` as of :func:`static_facets`."""
    facets = static_facets(surfaces, band, viewpoint, tolerance, max_range, pieces_of=pieces_of)
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
        visible, np.concatenate([found.fraction[whole], np.ones(len(found.owner))]), len(whole), edges, tiny,
        facets.take(hidden), found.fraction[hidden], level, float(np.hypot(missed, edge_error[0])),
        sent + found.rays + slab_rays,
    )  # fmt: skip
