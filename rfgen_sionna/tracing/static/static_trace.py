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
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.gains.band import BandTracer
from rfgen_sionna.tracing.gains.error_estimate import SAFETY, RefinedReturns, tolerance_factor
from rfgen_sionna.tracing.shadows.adaptive_sampling import (
    CornerVisibility,
    sample_visibility,
    shared_vertices,
)
from rfgen_sionna.tracing.shadows.shadow_cones import BoundingSpheres, bounding_spheres, in_shadow_cones
from rfgen_sionna.tracing.shadows.silhouettes import FacetLocator, SilhouetteRays, static_silhouettes
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
    """Paths of the static scene without actors, and the state to find its occlusion by actors."""

    paths: RadarPaths
    """One path per facet of `facets`, a single knot."""
    facets: Facets
    """Visible facets; of partly visible ones the visible pieces."""
    fraction: FloatArray
    """(facet,) visible share without actors, above 0."""
    scene: RayScene | None
    """Static surfaces; None without any."""
    viewpoint: FloatArray
    """(3,) phase centre of the radar [m]."""
    rays: int
    """Rays sent."""
    error: float
    """Estimated error of the coherent return, relative to `level`."""
    level: float
    """Reference level (:attr:`rfgen_sionna.tracing.gains.error_estimate.ErrorEstimate.scale`)."""
    levels: FloatArray
    """(surface,) coherent return of each surface."""
    whole: int
    """Number of uncut facets, the first of `facets`."""
    hidden: Facets
    """Facets that are occluded, wholly or in part."""
    hidden_fraction: FloatArray
    """(hidden,) visible share of those."""
    tolerance: FloatArray
    """(surface,) tolerance of the tessellation."""
    returns: StaticReturns

    @cached_property
    def unoccluded(self) -> NDArray[np.int64]:
        """Visible faces of the ray scene, ascending."""
        return np.unique(self.facets.number).astype(np.int64)

    @cached_property
    def _guides(self) -> tuple[CornerVisibility, NDArray[np.bool_], int]:
        """Visibility rays to facet corners, (facet, 3) visibility without actors, and the number of rays."""
        # Corners of pieces lie on shadow boundaries: they are sampled as with actors.
        facets = self.facets
        places = shared_vertices(facets.corners, facets.surface)
        guides = CornerVisibility(self.viewpoint, facets.corners, facets.number, places)
        if self.scene is None:
            return guides, np.zeros((len(facets), 3), np.bool_), 0
        return guides, *guides.visible(self.scene)

    @cached_property
    def _spheres(self) -> BoundingSpheres:
        return bounding_spheres(self.facets, self.viewpoint)

    @cached_property
    def weight(self) -> FloatArray:
        """(facet,) field gain of the element pattern."""
        return self.returns.band.pattern_gain(self.facets.directions(self.viewpoint))

    @cached_property
    def _any_visible(self) -> FacetLocator:
        return FacetLocator(self.facets.corners - self.viewpoint, self.facets.number)

    @property
    def without_actors(self) -> StaticVisibility:
        """Visibility without actors."""
        count = len(self.facets)
        return StaticVisibility(
            np.ones(count), np.zeros(0, np.intp), np.zeros((0, 3, 3)), None, 0.0, np.zeros(count), np.inf,
            np.zeros((0, 0), np.complex128), None,
        )  # fmt: skip

    def behind(self, actors: Sequence[FloatArray]) -> NDArray[np.intp]:
        """Facets that the `actors`, each at (point, 3) [m], may occlude."""
        if not len(self.facets):
            return np.zeros(0, np.intp)
        return np.flatnonzero(in_shadow_cones(self._spheres, self.viewpoint, actors))

    def visible(
        self, rays: RayScene, index: NDArray[np.intp], silhouette_rays: SilhouetteRays
    ) -> tuple[StaticVisibility, int]:
        """Visibility of all facets with the actors in `rays`, and the number of rays sent.

        `index` are the facets that actors may occlude, `silhouette_rays` pass just beside the actors. Only occlusion by
        actors is sampled; a facet that none of them touches keeps its share bit for bit.
        """
        past = silhouette_rays.of_actors
        nearest = float(lengths(past.directions).min(initial=np.inf))
        return self.resample(rays, index, self._any_visible.silhouette_lengths(past)[0], nearest)

    def resample(
        self, rays: RayScene, index: NDArray[np.intp], silhouette: FloatArray, nearest: float
    ) -> tuple[StaticVisibility, int]:
        """As :meth:`visible`, with the `silhouette` length (facet,) [rad] on each facet and the distance `nearest` [m]
        of the nearest silhouette."""
        every, silhouette = silhouette, silhouette[index]
        known = "_guides" in self.__dict__
        guides, unoccluded, first = self._guides
        now, sent = guides.visible(rays, index, moving=True)
        sent += 0 if known else first
        now &= unoccluded[index]
        # By columns: several times as fast as reductions of rows of three.
        (one, two, three), (one_now, two_now, three_now) = unoccluded[index].T, now.T
        changed = (one != one_now) | (two != two_now) | (three != three_now)
        visible, passed = one_now | two_now | three_now, silhouette > 0
        left = np.ones(len(self.facets))
        occluded = index[changed & ~passed & ~visible]
        left[occluded] = 0.0
        some = np.flatnonzero(passed | (changed & visible))
        chosen = index[some]
        found = sample_visibility(
            rays, self.viewpoint, self.facets.corners[chosen], self.facets.number[chosen], now[some],
            self.returns.wavenumber, self.returns.rtol, silhouette[some], self.weight[chosen],
            before=unoccluded[chosen], level=self.returns.level, moving=True, places=guides.places[chosen],
            occluded=guides.places[occluded], reach=self.returns.band.reach, occluder_distance=nearest,
        )  # fmt: skip
        left[chosen] = found.fraction
        missed = SAFETY * float(np.linalg.norm(found.missed)) / self.returns.level if self.returns.level > 0 else 0.0
        nothing = np.zeros((0, 0), np.complex128)
        cut, edges = chosen[found.owner], None
        if len(cut) and self.returns.level > 0:
            group, level = np.zeros(len(cut), np.intp), np.array([self.returns.level])
            edges, edge_error = self.returns.band.edges(self.facets, cut, found.pieces, found.occluder, group, level)
            missed = float(np.hypot(missed, SAFETY * edge_error[0]))
        return StaticVisibility(
            left, cut, found.pieces, edges, missed, every, nearest, nothing, None
        ), sent + found.rays

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
        paths, facets, visible.fraction, rays, viewpoint, rays_sent,
        float(np.hypot(found.total, SAFETY * visible.missed)), found.scale, found.level, visible.whole, visible.hidden,
        visible.hidden_fraction, rtol * resolution, replace(returns, rough=rough),
    )  # fmt: skip
