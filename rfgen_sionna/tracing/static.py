"""The part of a scene that stays: traced once per radar pose."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.records import FloatArray, RadarPaths
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.accuracy import finer, measure
from rfgen_sionna.tracing.facets import Facets, facet_paths, stack_facets
from rfgen_sionna.tracing.gains import BandTracer
from rfgen_sionna.tracing.surfaces import Surfaces
from rfgen_sionna.tracing.tessellate import tessellate
from rfgen_sionna.tracing.visibility import Visibility, changed_fraction, visible_fraction

MAX_ROUNDS = 4
"""How often the facets are made finer before the tolerance is given up with a warning."""
MAX_EFFORT = 10_000_000
"""Triangles to integrate at each node, beyond which the tolerance is given up as well."""
_LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class StaticTrace:
    """Paths of the static scene without actors, and what is needed to know what actors hide of them."""

    paths: RadarPaths
    """One path per facet of `facets`, a single knot."""
    facets: Facets
    fraction: FloatArray
    """(facet,) visible share without actors, above 0."""
    guides: NDArray[np.bool_]
    """(facet, 3) which guiding rays got through without actors."""
    viewpoint: FloatArray
    rays: int
    """Rays sent."""
    error: float
    """Estimated error of the coherent return, relative to what `tracing.accuracy.Accuracy.total` says."""
    level: float
    """What that is."""
    levels: FloatArray
    """(surface,) coherent return of each surface."""
    hidden: Facets
    """Facets that are hidden, or in part."""
    hidden_fraction: FloatArray
    """(hidden,) visible share of those."""

    @cached_property
    def _spheres(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        return spheres(self.facets, self.viewpoint)

    def visible(self, rays: RayScene, actors: Sequence[FloatArray]) -> tuple[FloatArray, int]:
        """Visible share of each facet with the actors where `rays` has them, and the number of rays sent.

        `actors` are the (vertex, 3) positions [m] of each actor. A facet that no actor touches keeps its share to the
        bit.
        """
        index = np.flatnonzero(behind(self._spheres, self.viewpoint, actors))
        fraction = self.fraction.copy()
        facets = self.facets.take(index)
        fraction[index], count = changed_fraction(
            rays, self.viewpoint, facets.corners, facets.number, self.fraction[index], self.guides[index]
        )
        return fraction, count

    def shadow(self, knots: FloatArray, fraction: FloatArray) -> tuple[RadarPaths, NDArray[np.intp]]:
        """What is missing of the static paths when the visible shares at the knots are `fraction` (facet, time).

        Returns the paths, weighted with the share less the unobstructed one, and which static path each belongs to.
        """
        return shaded_paths(self.paths, fraction / self.fraction[:, None], knots)


def shaded_paths(paths: RadarPaths, left: FloatArray, knots: FloatArray) -> tuple[RadarPaths, NDArray[np.intp]]:
    """What is missing of static `paths`, of a single knot, when `left` (path, time) is left of each at the knots [s].

    Returns the paths, weighted with what is left less 1, and which static path each belongs to.
    """
    index = np.flatnonzero((left != 1.0).any(axis=1))
    weight, chosen, count = left[index] - 1.0, paths.select(index), len(knots)

    def over_time(values: FloatArray, axis: int) -> FloatArray:
        return np.broadcast_to(values, (*values.shape[:axis], count, *values.shape[axis + 1 :]))

    return (
        replace(
            chosen,
            a=chosen.a * weight,
            dispersion=None if chosen.dispersion is None else chosen.dispersion * weight,
            tau=over_time(chosen.tau, 3),
            tau_rate=over_time(chosen.tau_rate, 3),
            times=knots,
            direction=over_time(chosen.direction, 1),
            arrival=over_time(chosen.arrival, 1),
        ),
        index,
    )


def spheres(facets: Facets, viewpoint: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Direction, distance and radius [m] of a sphere around each facet, from the viewpoint."""
    centroids = facets.centroids
    distance = lengths(centroids - viewpoint)
    radius = lengths(facets.corners - centroids[:, None]).max(axis=1, initial=0.0)
    return facets.directions(viewpoint), distance, radius


def behind(
    around: tuple[FloatArray, FloatArray, FloatArray], viewpoint: FloatArray, actors: Sequence[FloatArray]
) -> NDArray[np.bool_]:
    """(facet,) facets, `around` them `spheres`, that reach into the cone around an actor, and not before it."""
    direction, distance, radius = around
    found = np.zeros(len(distance), dtype=np.bool_)
    for points in actors:
        offset = points - viewpoint
        reach = lengths(offset)
        unit = offset / np.maximum(reach, 1e-12)[:, None]
        axis = unit.mean(axis=0)
        length = float(np.linalg.norm(axis))
        if length < 0.1:  # the actor surrounds the radar
            return np.ones(len(distance), dtype=np.bool_)
        axis /= length
        opening = np.arccos(np.clip((unit @ axis).min(), -1.0, 1.0))
        if opening > 0.45 * np.pi:  # a cone this wide need not hold the triangles between its directions
            return np.ones(len(distance), dtype=np.bool_)
        # A triangle comes nearer than its corners, but not than the plane across the axis through the nearest one.
        index = np.flatnonzero(distance + radius > (offset @ axis).min())
        off_axis = np.arccos(np.clip(direction[index] @ axis, -1.0, 1.0))
        margin = np.arctan2(radius[index], distance[index]) + 1e-3
        found[index[off_axis <= opening + margin]] = True
    return found


def trace_static(
    surfaces: Surfaces, rays: RayScene | None, band: BandTracer, viewpoint: FloatArray, rtol: float, max_range: float
) -> StaticTrace:
    """Trace the static surfaces; facets beyond `max_range` [m] are left out, as the radar's IF filter removes them.

    `rays` holds the static scene alone; None where there is no static surface.
    """
    materials = tuple(surface.material for surface in surfaces.static)
    fineness, rays_sent, before = np.ones(len(materials)), 0, np.inf
    for attempt in range(MAX_ROUNDS):
        facets, seen, hidden = _seen_facets(surfaces, rays, band, viewpoint, rtol * fineness, max_range)
        rays_sent += seen.rays
        weight = seen.fraction * band.importance(facets.directions(viewpoint))
        expansion = band.expansion_for(facets, materials, weight, coherent=False)
        gains = band(facets, materials, expansion)
        found = measure(band, facets, materials, weight, gains[:, 0, 0], (0, 0))
        if found.total <= rtol:
            break
        coarse = found.share > 0.1 / len(materials)
        effort, earlier = float((facets.parts.astype(np.float64) ** 2).sum()), before
        before = found.total
        # More of the same is no use where the error hardly falls, or where it would take too long.
        if attempt == MAX_ROUNDS - 1 or before > 0.5 * earlier or effort * before / rtol > MAX_EFFORT:
            _LOG.warning("the return of the static scene is right to %.2g of itself (rtol: %g)", found.total, rtol)
            break
        fineness[coarse] *= finer(np.array(found.total), rtol)
    gains *= seen.fraction
    if (rough := band.diffuse(facets, materials)) is not None:
        gains[0] += np.sqrt(seen.fraction) * rough  # of energy, half of a facet returns half
    tau = band.delays(facets.centroids)[..., None]
    paths = facet_paths(
        surfaces.static,
        facets,
        np.array([0.0]),
        gains[..., None],
        tau,
        np.zeros_like(tau),
        facets.directions(viewpoint)[:, None],
        band.centre,
        band.half_band,
        (surfaces.object_names, surfaces.part_names),
    )
    seen_as = facets, seen.fraction, seen.guides, viewpoint, rays_sent
    return StaticTrace(paths, *seen_as, found.total, found.scale, found.level, *hidden)


def _seen_facets(
    surfaces: Surfaces,
    rays: RayScene | None,
    band: BandTracer,
    viewpoint: FloatArray,
    rtol: FloatArray,
    max_range: float,
) -> tuple[Facets, Visibility, tuple[Facets, FloatArray]]:
    """The facets that are seen, made for a tolerance (surface,) of each surface; and those that are hidden, or in part,
    with their visible share."""
    pieces = [
        tessellate(
            points,
            surface.faces,
            viewpoint,
            band.highest,
            tolerance,
            band.importance,
            max_range,
            band.half_band,
            smooth=surface.smooth,
        )
        for points, surface, tolerance in zip(surfaces.static_vertices, surfaces.static, rtol.tolist(), strict=True)
    ]
    facets = stack_facets(surfaces.static, pieces, surfaces.static_vertices, viewpoint)
    near = lengths(facets.centroids - viewpoint) < max_range
    facets = facets.take(np.flatnonzero(facets.facing & near))
    if rays is None:
        nothing = np.zeros(len(facets))
        return facets, Visibility(nothing, np.zeros((len(facets), 3), np.bool_), 0), (facets, nothing)
    seen = visible_fraction(rays, viewpoint, facets.corners, facets.number)
    kept = np.flatnonzero(seen.fraction > 0)
    hidden = np.flatnonzero(seen.fraction < 1)
    there = Visibility(seen.fraction[kept], seen.guides[kept], seen.rays)
    return facets.take(kept), there, (facets.take(hidden), seen.fraction[hidden])
