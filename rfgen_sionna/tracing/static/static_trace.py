"""Direct returns of the static scene, traced once per radar pose."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.records import RadarPaths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.gains.band import BandTracer
from rfgen_sionna.tracing.gains.error_estimate import SAFETY, RefinedReturns, tolerance_factor
from rfgen_sionna.tracing.shadows.silhouettes import SilhouetteRays, static_silhouettes
from rfgen_sionna.tracing.static.actor_shadows import Shadow, cast_shadow
from rfgen_sionna.tracing.static.static_facets import find_visible_facets, max_wavenumber
from rfgen_sionna.tracing.static.static_visibility import StaticReturns, StaticVisibility
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
    returns: StaticReturns

    @cached_property
    def unoccluded(self) -> NDArray[np.int64]:
        """Visible faces of the ray scene, ascending."""
        return np.unique(self.facets.number).astype(np.int64)

    @cached_property
    def weight(self) -> FloatArray:
        """(facet,) field gain of the element pattern."""
        return self.returns.band.pattern_gain(self.facets.directions(self.viewpoint))

    @property
    def without_actors(self) -> StaticVisibility:
        """Visibility without actors."""
        count = len(self.facets)
        return StaticVisibility(
            np.ones(count), np.zeros(0, np.intp), np.zeros((0, 3, 3)), None, 0.0, np.zeros(count), np.inf,
            np.zeros((0, 0), np.complex128), None,
        )  # fmt: skip

    def integrated(self, static_visibility: Sequence[StaticVisibility]) -> list[StaticVisibility]:
        """The same with integrated values."""
        cut = [each for each in static_visibility if len(each.owner)]
        found = iter(self.returns.of_pieces(self.facets, cut) if cut else [])
        return [next(found) if len(each.owner) else each for each in static_visibility]

    def shadows(
        self, knots: FloatArray, static_visibility: Sequence[StaticVisibility], index: NDArray[np.intp] | None = None
    ) -> tuple[Shadow, Shadow]:
        """Shadows on static paths with integrated visibility at each of the `knots` [s]: changing ones and constant
        ones. `index` (facet,) are the facets that shares are of, ascending; None means all."""
        every = np.arange(len(self.facets)) if index is None else index
        left = np.stack([each.left for each in static_visibility], axis=1)
        paths = self.paths if index is None else self.paths.select(index)
        within = np.searchsorted(every, np.concatenate([each.owner for each in static_visibility]))
        changing, steady = (shadow.at(every) for shadow in cast_shadow(paths, left, knots, within))
        a, dispersion = changing.paths.a, changing.paths.dispersion  # writable copies
        for knot, each in enumerate(static_visibility):
            if not len(each.owner):
                continue
            owner = np.unique(each.owner)
            gains = self.returns.band.combined(self.returns.expansion, each.values[..., None])[..., 0]
            row, share = np.searchsorted(changing.index, owner), self.fraction[owner]
            if (correction := each.boundary_correction) is not None:
                correction.within(owner).add_to(gains)
            gains *= share
            if self.returns.rough is not None:
                visible = share * each.left[np.searchsorted(every, owner)]
                gains[0] += np.sqrt(visible) * self.returns.rough[..., owner]  # energy goes with the visible area
            a[..., row, knot] = gains[0] - self.paths.a[..., owner, 0]
            if dispersion is not None and self.paths.dispersion is not None:
                dispersion[..., row, knot] = gains[1:] - self.paths.dispersion[..., owner, 0]
        return changing, steady


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
    returns = StaticReturns(band, materials, expansion, None, max_wavenumber(band), rtol, visible.level)
    if len(visible.edges.owner):
        returns.boundary_correction(visible.tiny, visible.edges, facets.centroids[visible.edges.owner]).add_to(gains)
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
        float(np.hypot(found.total, SAFETY * visible.missed)), found.scale,
        replace(returns, rough=rough),
    )  # fmt: skip
