"""Visibility of moving facets from the phase centre, at sample times."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray, IntArray
from rfgen_sionna.scene.mesh import bounds, lengths, max_component, triangle_centroids
from rfgen_sionna.scene.occluders import Occluders, possible_occluders, times_at_once
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.gains.band import BandTracer
from rfgen_sionna.tracing.gains.expansion import PROBES
from rfgen_sionna.tracing.integral.propagation import phasors
from rfgen_sionna.tracing.moving.culling import (
    CULLED_PER_RTOL,
    CURVED_FACTOR,
    FacingFacets,
    ReturnBounds,
    cull_weakest,
    is_nonreflecting,
    specular_reflectance,
)
from rfgen_sionna.tracing.moving.visible_facets import VisibleFacets
from rfgen_sionna.tracing.shadows.adaptive_sampling import CornerVisibility, SampledVisibility, sample_visibility
from rfgen_sionna.tracing.shadows.silhouettes import (
    RAY_SPACING,
    FacetLocator,
    MeshSilhouette,
    SilhouetteRays,
    faces_toward_viewpoint,
    static_silhouettes,
)
from rfgen_sionna.tracing.surface.facets import Facets
from rfgen_sionna.tracing.surface.surfaces import Surfaces, tolerance_groups

MIN_RAY_SPACING = 2.5e-4
"""Smallest angle between silhouette rays past one edge [rad]; bounds their number."""
_ROUNDS, _MAX_EXCESS = 2, 2.0
"""Largest number of culling rounds, and excess of culled returns over the allowed one that starts another round."""
_PER_FACET, _SMALL = 0.3, 0.1
"""Angle between silhouette rays at a tolerance of 1 %, over the width of the facets below which lies the second as a
share of the visible area."""


class MovingVisibility:
    """Visibility of moving surfaces from the phase centre, within the range window."""

    def __init__(
        self, surfaces: Surfaces, band: BandTracer, viewpoint: FloatArray, max_range: float, rtol: float
    ) -> None:
        self._surfaces, self._viewpoint, self._max_range, self._rtol = surfaces, viewpoint, max_range, rtol
        self._wavenumber = 2 * np.pi * band.highest / SPEED_OF_LIGHT
        self._pattern_gain, self._reach = band.pattern_gain, band.reach
        self._silhouettes = [MeshSilhouette(surface.faces) for surface in surfaces.moving]
        self._silhouette_rays: dict[float, SilhouetteRays] = {}
        self._ray_spacing = RAY_SPACING
        self._static: tuple[FloatArray, FloatArray, FloatArray] | None = None
        self._return_bounds = ReturnBounds(viewpoint, self._wavenumber, band.aperture)
        self._reflectance = np.array(
            [specular_reflectance(surface.material, band.frequency(PROBES)) for surface in surfaces.moving]
        )
        self._nonreflecting = np.array(
            [is_nonreflecting(surface.material, band.frequency(PROBES)) for surface in surfaces.moving], bool
        )
        self._curved_factor = np.array(
            [1.0 if surface.smooth is None else CURVED_FACTOR for surface in surfaces.moving]
        )
        self._tolerance_group = tolerance_groups(surfaces.moving)
        self._any_visible = np.ones(len(surfaces.moving))  # visible share of the facing return

    def __call__(
        self,
        rays: RayScene,
        facets: Sequence[Facets],
        places: IntArray,
        times: Sequence[float],
        vertices: Sequence[Sequence[FloatArray]],
        share: FloatArray | None = None,
    ) -> list[VisibleFacets]:
        """Visibility of all `facets` of the moving surfaces at several `times` [s], with their `vertices` (vertex, 3)
        [m] at each; `rays` is the ray scene at any time.

        `places` (facet, 3) are those of :func:`rfgen_sionna.tracing.shadows.adaptive_sampling.shared_vertices`. `share`
        (surface,) is a factor on the allowed return of culled facets (:mod:`rfgen_sionna.tracing.moving.culling`); None
        culls none. Otherwise times do not influence one another.
        """
        facing = [self._facing(each) for each in facets]
        if share is None or not share.any():
            return self._at_all_times(rays, facets, places, times, vertices, facing)
        surfaces, surface = len(self._surfaces.moving), facets[0].surface
        return_estimates, most = [], np.zeros(len(surface))
        total = np.full(surfaces, np.inf)
        for each, there in zip(facets, facing, strict=True):
            return_estimate, there_most = self._return_bounds.of(each, there)
            return_estimates.append(return_estimate)
            most[there.chosen] = np.maximum(most[there.chosen], there_most)
            total = np.minimum(total, np.sqrt(np.bincount(surface[there.chosen], return_estimate**2, surfaces)))
        share = CULLED_PER_RTOL * self._rtol * self._reflectance * self._curved_factor * share
        found = list[VisibleFacets]()

        def waves(some: NDArray[np.intp]) -> ComplexArray:
            away = lengths(np.take(facets[0].centroids, some, axis=0) - self._viewpoint)
            return most[some] * phasors(self._wavenumber / np.pi * away)

        for _ in range(_ROUNDS):
            sampled, sent = (sum(getattr(each, name) for each in found) for name in ("sampled_facets", "rays"))
            weak, left = cull_weakest(most, surface, share * self._any_visible * total, waves)
            remaining = [there.of(np.flatnonzero(~weak[there.chosen])) for there in facing]
            found = self._at_all_times(rays, facets, places, times, vertices, remaining)
            any_visible = np.full(surfaces, np.inf)
            for visible, there, return_estimate in zip(found, facing, return_estimates, strict=True):
                energy = np.bincount(
                    surface[there.chosen], (return_estimate * visible.fraction[there.chosen]) ** 2, surfaces
                )
                any_visible = np.minimum(any_visible, np.sqrt(energy))
            enough = left <= _MAX_EXCESS * share * any_visible
            self._any_visible = np.minimum(np.where(total > 0, any_visible / np.where(total > 0, total, 1.0), 1.0), 1.0)
            if enough.all():
                break
        culled = np.where(any_visible > 0, left / np.where(any_visible > 0, any_visible, 1.0), 0.0)
        found[0] = replace(found[0], sampled_facets=found[0].sampled_facets + sampled, rays=found[0].rays + sent)
        return [replace(each, missed=np.hypot(each.missed, culled), culled=culled) for each in found]

    def _facing(self, facets: Facets) -> FacingFacets:
        chosen = np.flatnonzero(facets.facing)
        if self._nonreflecting.any():
            chosen = chosen[~self._nonreflecting[facets.surface[chosen]]]
        offset = np.take(facets.centroids, chosen, axis=0) - self._viewpoint
        distance = lengths(offset)
        near = distance < self._max_range
        if not near.all():
            chosen, offset, distance = chosen[near], offset[near], distance[near]
        return FacingFacets(chosen, self._pattern_gain(offset / np.maximum(distance, 1e-12)[:, None]))

    def _at_all_times(
        self,
        rays: RayScene,
        facets: Sequence[Facets],
        places: IntArray,
        times: Sequence[float],
        vertices: Sequence[Sequence[FloatArray]],
        facing: Sequence[FacingFacets],
    ) -> list[VisibleFacets]:
        """:meth:`__call__` of `facing` facets, in batches of times."""
        self._silhouette_rays.clear()
        step, found = times_at_once(rays.num_facets, self._viewpoint, vertices[0]), list[VisibleFacets]()
        for first in range(0, len(facets), step):
            some = slice(first, first + step)
            visible, silhouette_rays = self._together(rays, facets[some], places, vertices[some], facing[some])
            found += visible
            self._silhouette_rays |= zip(times[some], silhouette_rays, strict=True)
        return found

    def _together(
        self,
        rays: RayScene,
        facets: Sequence[Facets],
        places: IntArray,
        vertices: Sequence[Sequence[FloatArray]],
        sampled: Sequence[FacingFacets],
    ) -> tuple[list[VisibleFacets], list[SilhouetteRays]]:
        """Visibility of the `sampled` facets of one batch of times, and the silhouette rays."""
        count, surfaces = len(facets), len(self._surfaces.moving)
        offsets = [[points - self._viewpoint for points in there] for there in vertices]
        turned = [
            [silhouette.facing(each) for silhouette, each in zip(self._silhouettes, there, strict=True)]
            for there in offsets
        ]
        candidates = [self._hiding(*each) for each in zip(turned, offsets, strict=True)]
        occluders = rays.occluders(self._viewpoint, vertices, candidates)
        silhouette_rays = self._rays_past(occluders, offsets, turned)
        facing = [each.chosen for each in sampled]
        starts = np.cumsum([0, *(len(each) for each in facing)])
        time = np.repeat(np.arange(count, dtype=np.int32), np.diff(starts))
        corners = np.empty((starts[-1], 3, 3))
        for each, some, first in zip(facets, facing, starts.tolist(), strict=False):
            np.take(each.corners, some, axis=0, out=corners[first : first + len(some)])

        def every(name: str) -> IntArray:
            return np.concatenate([getattr(each, name)[some] for each, some in zip(facets, facing, strict=True)])

        number, group = (
            every("number") + np.int64(rays.num_facets) * time,
            self._tolerance_group[every("surface")] + surfaces * time,
        )
        place = np.concatenate([places[some] for some in facing]) + (int(places.max(initial=-1)) + 1) * time[:, None]
        weight = np.concatenate([each.weight for each in sampled])
        hit = [np.where(each.hit < 0, -1, each.hit + rays.num_facets * k) for k, each in enumerate(silhouette_rays)]
        fallen = SilhouetteRays(
            np.concatenate([each.directions for each in silhouette_rays]),
            np.concatenate(hit),
            np.concatenate([each.span for each in silhouette_rays]),
        )
        # The hits before static silhouettes are not needed: rays to facets find these boundaries.
        silhouette = FacetLocator(corners - self._viewpoint, number).silhouette_lengths(fallen)[1]
        found, guides, missed, level = self._sampled(
            occluders, corners, number, place, silhouette, weight, group, count * surfaces, 0.0, count
        )
        cuts, every_seen = np.searchsorted(found.owner, starts), list[VisibleFacets]()
        for k, (there, some) in enumerate(zip(facets, facing, strict=True)):
            own, cut = slice(starts[k], starts[k + 1]), slice(cuts[k], cuts[k + 1])
            fraction, weights, silhouettes = np.zeros((3, len(there)))
            fraction[some], weights[some], silhouettes[some] = found.fraction[own], weight[own], silhouette[own]
            sent = len(silhouette_rays[k].hit) + (0 if k else guides + found.rays)
            mine = surfaces * k + self._tolerance_group
            every_seen.append(
                VisibleFacets(there, fraction, weights, some[found.owner[cut] - starts[k]], found.pieces[cut],
                     found.occluder[cut], silhouettes, level[mine], missed[mine], len(some), sent)
            )  # fmt: skip
        return every_seen, silhouette_rays

    def _hiding(self, turned: Sequence[NDArray[np.bool_]], offsets: Sequence[FloatArray]) -> NDArray[np.intp]:
        """Moving faces that a ray from the viewpoint may hit first: of closed surfaces not around it only those that
        face it."""
        found, first = [np.zeros(0, np.intp)], 0
        for surface, towards, points in zip(self._surfaces.moving, turned, offsets, strict=True):
            found.append(first + np.flatnonzero(towards | ~surface.outward | _surrounds(points)))
            first += len(towards)
        return np.concatenate(found)

    def occluders(self, rays: RayScene, vertices: Sequence[Sequence[FloatArray]], corners: FloatArray) -> Occluders:
        """Occluders of facets with `corners` (time, facet, 3, 3) [m] at several times, with `vertices` (vertex, 3) [m]
        of each moving surface; `rays` is the ray scene at any time."""
        offsets = [[points - self._viewpoint for points in there] for there in vertices]
        placed = [np.concatenate([np.zeros((0, 3)), *there]) for there in offsets]
        found = possible_occluders(rays.moving_faces, placed, corners - self._viewpoint)
        ends, surfaces = rays.moving_faces[found], self._surfaces.moving
        owner = np.repeat(np.arange(len(surfaces)), [len(each.faces) for each in surfaces])[found]
        outward, candidates = np.concatenate([each.outward for each in surfaces])[found], []
        for points, there in zip(placed, offsets, strict=True):
            around = np.array([_surrounds(each) for each in there])
            candidates.append(found[~outward | around[owner] | faces_toward_viewpoint(points, ends)])
        return rays.occluders(self._viewpoint, vertices, candidates, corners)

    def resample(
        self, occluders: Occluders, facets: Facets, places: IntArray, silhouette: FloatArray, level: FloatArray
    ) -> VisibleFacets:
        """Visibility of some `facets`, time by time, all of which face the radar, with the largest `missed` of all
        times. `places` (facet, 3) and `silhouette` (facet,) [rad] are those of one time, `level` (surface,) that of all
        facets."""
        near = np.flatnonzero(lengths(facets.centroids - self._viewpoint) < self._max_range)
        times, surfaces = len(facets) // len(silhouette), len(self._surfaces.moving)
        time = np.arange(times, dtype=np.int32)[:, None]
        own, local = np.unique(places, return_inverse=True)
        every = (local.ravel().astype(np.int32) + np.int32(len(own)) * time).reshape(-1, 3)
        group = self._tolerance_group[facets.surface] + surfaces * np.repeat(time, len(silhouette))
        number = occluders.numbered(facets.number[: len(silhouette)], times)
        silhouettes = np.tile(silhouette, times)
        weight = self._pattern_gain(facets.directions(self._viewpoint, near))
        found, guides, missed, least = self._sampled(
            occluders, np.take(facets.corners, near, axis=0), number[near], every[near], silhouettes[near], weight,
            group[near], times * surfaces, np.tile(level, times), times,
        )  # fmt: skip
        fraction, weights = np.zeros((2, len(facets)))
        fraction[near], weights[near] = found.fraction, weight
        error = (missed * least).reshape(times, surfaces).max(axis=0)[self._tolerance_group]
        sent = guides + found.rays
        cut = near[found.owner], found.pieces, found.occluder
        of_all = np.where(level > 0, error / np.where(level > 0, level, 1.0), 0.0)
        return VisibleFacets(facets, fraction, weights, *cut, silhouettes, level, of_all, len(near), sent)

    def _sampled(
        self,
        occluders: Occluders,
        corners: FloatArray,
        number: NDArray[np.int64],
        places: IntArray,
        silhouette: FloatArray,
        weight: FloatArray,
        group: NDArray[np.integer[Any]],
        groups: int,
        least: FloatArray | float,
        times: int,
    ) -> tuple[SampledVisibility, int, FloatArray, FloatArray]:
        """Sampled visibility of facets that face the radar, the number of guiding rays, and per group (one surface at
        one of the `times`) the error relative to the incoherent sum, and that sum."""
        guided, guides = CornerVisibility(self._viewpoint, corners, number, places).visible(occluders)
        found = sample_visibility(
            occluders, self._viewpoint, corners, number, guided, self._wavenumber, self._rtol, silhouette, weight,
            group, level=least, times=times, ray_spacing=self._ray_spacing, places=places,
            reach=self._reach,
        )  # fmt: skip
        error, level = (np.sqrt(np.bincount(group, each**2, groups)) for each in (found.missed, found.returned))
        return found, guides, np.where(level > 0, error / np.where(level > 0, level, 1.0), 0.0), level

    def use_silhouette_search(self, corners: Sequence[FloatArray], of_curved: NDArray[np.intp]) -> None:
        """Search for gaps of light with silhouette rays on facets with `corners` (facet, 3, 3) [m], those of each
        surface; `of_curved` are pieces of curved faces."""
        self._return_bounds.form(corners, of_curved)
        apart = silhouette_ray_spacing(corners, self._viewpoint, self._rtol)
        if apart != self._ray_spacing:
            self._ray_spacing, self._static = apart, None

    def silhouette_rays(self, t: float) -> SilhouetteRays:
        """Rays past the silhouettes of moving surfaces, and of static ones before these, at one of the latest times `t`
        [s]."""
        return self._silhouette_rays[t]

    def _rays_past(
        self,
        occluders: Occluders,
        offsets: Sequence[Sequence[FloatArray]],
        turned: Sequence[Sequence[NDArray[np.bool_]]],
    ) -> list[SilhouetteRays]:
        """Silhouette rays at every time, with vertices at `offsets` [m] from the viewpoint and faces `turned` to it."""
        if self._static is None:
            # Directions (ray, 3) to the silhouette, its distance (ray,) [m], and the span of each.
            past, stands_for = static_silhouettes(self._surfaces, self._viewpoint, self._ray_spacing)
            self._static = past, stands_for, lengths(past)
        static, span, distance = self._static
        found, owner = [], list[NDArray[np.intp]]()
        for there, towards in zip(offsets, turned, strict=True):
            possible_occluders = np.zeros(len(static), np.bool_)
            for each in there if len(static) else ():
                far = np.maximum(lengths(each), 1e-12)
                axis = (each / far[:, None]).mean(axis=0)
                axis /= max(float(np.linalg.norm(axis)), 1e-12)
                # Widened by the shift of a boundary between elements.
                opening = np.arccos(np.clip((each @ axis / far).min() - 1e-3, -1.0, 1.0)) + self._reach / distance
                within = static @ axis > np.cos(np.minimum(opening, np.pi)) * distance
                possible_occluders |= within & (distance < far.max())
            placed = zip(self._silhouettes, there, towards, strict=True)
            silhouette_rays = [
                silhouette.silhouette_rays(points, self._ray_spacing, facing) for silhouette, points, facing in placed
            ]
            count = np.array([np.count_nonzero(possible_occluders), *(len(each) for _, each in silhouette_rays)])
            owner.append(np.repeat(np.arange(-1, len(silhouette_rays)), count))
            directions, spans = (
                np.concatenate(e)
                for e in zip((static[possible_occluders], span[possible_occluders]), *silhouette_rays, strict=True)
            )
            found.append((directions, spans, int(np.count_nonzero(possible_occluders))))
        time = np.repeat(np.arange(len(found)), [len(directions) for directions, _, _ in found])
        hits = occluders.first_facet(np.concatenate([directions for directions, _, _ in found]), time)
        return [
            SilhouetteRays(directions, hits[time == k], spans, first, owner[k])
            for k, (directions, spans, first) in enumerate(found)
        ]


def _surrounds(points: FloatArray) -> bool:
    """Whether the viewpoint may be inside a body with `points` (vertex, 3) [m] relative to it."""
    low, high = bounds(points)
    return not bool((low > 0).any() or (high < 0).any())


def silhouette_ray_spacing(corners: Sequence[FloatArray], viewpoint: FloatArray, rtol: float) -> float:
    """Angle [rad] between silhouette rays past an edge, for facets with `corners` (facet, 3, 3) [m] of each surface:
    few facets lie between two rays, so that a ray finds a gap of light that no corner sees."""
    apart = RAY_SPACING
    for each in corners:
        if not len(each):
            continue
        edges = each - each[:, [1, 2, 0]]
        away = np.maximum(lengths(triangle_centroids(each) - viewpoint), 1e-9)
        size, area = max_component(lengths(edges)) / away, lengths(np.cross(edges[:, 0], edges[:, 1])) / away**2
        order = np.argsort(size)
        share = np.cumsum(area[order])
        typical = float(size[order[np.searchsorted(share, _SMALL * share[-1])]])
        # The area between two rays grows with the square of their spacing.
        apart = min(apart, max(_PER_FACET * typical * np.sqrt(rtol / 1e-2), MIN_RAY_SPACING))
    return float(apart)
