"""Direct returns of the static scene, traced once per radar pose."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.records import RadarPaths
from rfgen_sionna.scene.materials import Material
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.gains.band import BandTracer
from rfgen_sionna.tracing.gains.error_estimate import SAFETY, RefinedReturns, tolerance_factor
from rfgen_sionna.tracing.shadows.silhouettes import SilhouetteRays, static_silhouettes
from rfgen_sionna.tracing.static.static_facets import find_visible_facets
from rfgen_sionna.tracing.surface.facets import Facets, facet_paths
from rfgen_sionna.tracing.surface.surfaces import Surfaces

MAX_ROUNDS = 4
"""Most rounds of refinement; after them the tolerance is given up with a warning."""
MAX_EFFORT = 10_000_000
"""Most triangles to integrate per node (memory and time); beyond them the tolerance is given up as well."""
_MIDDLE = slice(1, 2)
"""Probe at the band's centre."""
_LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class StaticTrace:
    """Paths of the static scene without actors, and its facets, which actors occlude."""

    paths: RadarPaths
    """One path per facet of `facets`, a single knot."""
    facets: Facets
    """Visible facets; of partly visible ones the visible pieces."""
    fraction: FloatArray
    """(facet,) visible share without actors, above 0."""
    viewpoint: FloatArray
    """(3,) phase centre of the radar [m]."""
    rays: int
    """Rays sent."""
    error: float
    """Estimated error of the coherent return, relative to `level`."""
    level: float
    """Reference level (:attr:`rfgen_sionna.tracing.gains.error_estimate.ErrorEstimate.scale`)."""
    band: BandTracer
    materials: tuple[Material, ...]
    """(surface,)"""

    @cached_property
    def unoccluded(self) -> NDArray[np.int64]:
        """Visible faces of the ray scene, ascending."""
        return np.unique(self.facets.number).astype(np.int64)

    @cached_property
    def weight(self) -> FloatArray:
        """(facet,) field gain of the element pattern."""
        return self.band.pattern_gain(self.facets.directions(self.viewpoint))


def trace_static(
    surfaces: Surfaces,
    rays: RayScene | None,
    band: BandTracer,
    viewpoint: FloatArray,
    rtol: float,
    max_range: float,
) -> StaticTrace:
    """Trace the static surfaces up to `max_range` [m], as the radar's IF filter removes farther ones.

    `rays` holds the static scene alone; None without static surfaces. Warns where `rtol` is not met.
    """
    materials = tuple(surface.material for surface in surfaces.static)
    resolution, rays_sent = np.ones(len(materials)), 0
    before = [np.inf, np.inf]  # error of single facets, and with an expansion
    silhouette_rays = None
    if rays is not None:
        past, span = static_silhouettes(surfaces, viewpoint)
        silhouette_rays, rays_sent = SilhouetteRays(past, rays.first_facet(viewpoint, past), span), len(past)
    for attempt in range(MAX_ROUNDS):
        visible = find_visible_facets(
            surfaces, rays, band, viewpoint, rtol, rtol * resolution, max_range, silhouette_rays
        )
        facets, rays_sent = visible.facets, rays_sent + visible.rays
        weight = visible.fraction * band.pattern_gain(facets.directions(viewpoint))
        refined = RefinedReturns.of(band, facets, materials, weight)
        # Facets that are too coarse at the band's centre need no expansion.
        found, exact = refined.of_facets(places=_MIDDLE)
        effort = float((facets.parts.astype(np.float64) ** 2).sum())
        # Stop where the error hardly falls or the effort is too large.
        last = attempt == MAX_ROUNDS - 1 or found.total > 0.5 * before[0] or effort * found.total / rtol > MAX_EFFORT
        before[0] = found.total
        if last or found.total <= rtol:
            strength = np.abs(exact[0]) * weight
            expansion = band.expansion_for(facets, materials, weight, coherent=False, strength=strength)
            values = band.values(facets, materials, expansion)
            one = replace(expansion, weights=expansion.weights[:, :1, :1])
            found = refined.of_expansion(band.combined(one, values)[:, 0, 0])
            if found.total <= rtol:
                break
            last = last or found.total > 0.5 * before[1] or effort * found.total / rtol > MAX_EFFORT
            before[1] = found.total
        if last:
            _LOG.warning("the return of the static scene has a relative error of %.2g (rtol: %g)", found.total, rtol)
            break
        resolution[found.share > 0.1 / len(materials)] *= tolerance_factor(np.array(found.total), rtol)
    gains = band.combined(expansion, values)
    gains *= visible.fraction
    if len(edges := visible.edges.owner):
        densities = band.values(visible.tiny, materials, expansion, visible.edges.middle + band.viewpoint)
        reference = facets.centroids[edges]
        band.boundary_correction(visible.edges, densities, reference, expansion).add_to(gains)
    if (rough := band.diffuse(facets, materials)) is not None:  # each facet by itself
        gains[0] += np.sqrt(visible.fraction) * rough  # energy goes with the visible area
    tau = band.delays(facets.centroids)[..., None]
    paths = facet_paths(
        surfaces.static, facets, np.array([0.0]), gains[..., None], tau, np.zeros_like(tau),
        facets.directions(viewpoint)[:, None], band.centre, band.half_band,
        (surfaces.object_names, surfaces.part_names),
    )  # fmt: skip
    return StaticTrace(
        paths, facets, visible.fraction, viewpoint, rays_sent,
        float(np.hypot(found.total, SAFETY * visible.missed)), found.scale, band, materials,
    )  # fmt: skip
