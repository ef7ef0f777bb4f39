"""Facets of the static scene and the search for those that the radar sees."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.gains.band import BandTracer
from rfgen_sionna.tracing.shadows.adaptive_sampling import (
    CornerVisibility,
    sample_visibility,
    shared_vertices,
)
from rfgen_sionna.tracing.shadows.boundary_edges import ShadowEdges
from rfgen_sionna.tracing.shadows.silhouettes import FacetLocator, SilhouetteRays
from rfgen_sionna.tracing.surface.facets import Facets, stack_facets, with_patches
from rfgen_sionna.tracing.surface.surfaces import Surfaces
from rfgen_sionna.tracing.surface.tessellate import tessellate


def static_facets(
    surfaces: Surfaces,
    band: BandTracer,
    viewpoint: FloatArray,
    tolerance: FloatArray,
    max_range: float,
) -> Facets:
    """Facets of the static surfaces, for the `tolerance` (surface,) and up to `max_range` [m], visible or not."""
    pieces = [
        tessellate(
            points, surface.faces, viewpoint, band.highest, rtol, band.pattern_gain, max_range, band.half_band,
            smooth=surface.smooth, still=True,
        )
        for points, surface, rtol in zip(surfaces.static_vertices, surfaces.static, tolerance.tolist(), strict=True)
    ]  # fmt: skip
    wavenumber = max_wavenumber(band)
    flat = stack_facets(surfaces.static, pieces, [surfaces.static_vertices], viewpoint, wavenumber)
    (found,) = with_patches(flat, surfaces.static, pieces, [surfaces.static_vertices])
    return found


def max_wavenumber(band: BandTracer) -> float:
    """Wavenumber at the band's highest frequency [rad/m]."""
    return 2 * np.pi * band.highest / SPEED_OF_LIGHT


class VisibleStaticFacets(NamedTuple):
    """Visible static facets."""

    facets: Facets
    fraction: FloatArray
    """(facet,)"""
    edges: ShadowEdges
    """Shadow boundaries on the pieces."""
    tiny: Facets
    """Facets for the gain density at each boundary."""
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
) -> VisibleStaticFacets:
    """Visible facets of the static scene, cut at shadow boundaries. `tolerance` (surface,) is of the tessellation,
    `rtol` of the visibility."""
    facets = static_facets(surfaces, band, viewpoint, tolerance, max_range)
    near = lengths(facets.centroids - viewpoint) < max_range
    facets = facets.take(np.flatnonzero(facets.facing & near))
    facets = facets.with_pattern_gradient(band.pattern_gradient(facets))
    if rays is None:
        nothing = np.zeros(len(facets))
        none = np.zeros(0, np.intp)
        edges, _ = band.edges(facets, none, np.zeros((0, 3, 3)), np.zeros((0, 4)), none, np.zeros(1))
        return VisibleStaticFacets(facets, nothing, edges, facets.take(none), 0.0, 0.0, 0)
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
    edges, edge_error = band.edges(facets, found.owner, found.pieces, found.occluder, group, np.array([level]))
    tiny, edges = facets.cut(edges.owner, edges.small_piece), replace(edges, owner=len(whole) + edges.piece)
    if visible.pattern_gradient is not None:
        tiny = replace(
            tiny, pattern_gradient=visible.pattern_gradient[edges.owner], gradient_origin=visible.centroids[edges.owner]
        )
    return VisibleStaticFacets(
        visible, np.concatenate([found.fraction[whole], np.ones(len(found.owner))]), edges, tiny,
        level, float(np.hypot(missed, edge_error[0])), sent + found.rays,
    )  # fmt: skip
