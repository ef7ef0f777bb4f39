"""Indirect paths of the static scene: by planar reflectors and through slabs, traced once as routes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.records import RadarPaths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.direct.run_scene import RunScene
from rfgen_sionna.tracing.direct.trace_plan import TracePlan
from rfgen_sionna.tracing.legs.leg import Leg
from rfgen_sionna.tracing.routes.route_trace import Route, RouteTracer
from rfgen_sionna.tracing.static.actor_shadows import StaticIndirectPaths
from rfgen_sionna.tracing.surface.surfaces import Surfaces

SAMPLE_SPACING, MAX_SAMPLES = 0.03, 6
"""Distance [m] of the points of a facet at which actors occlude it, and their largest number along an edge."""


@dataclass(frozen=True)
class StaticRoutes(StaticIndirectPaths):
    """Paths by static reflectors and through static slabs, single knot."""

    starts: FloatArray
    """(segment, 3) [m]"""
    ends: FloatArray
    """(segment, 3) [m]"""
    sample: NDArray[np.intp]
    """(segment,) sample of each."""
    path: NDArray[np.intp]
    """(sample,) path of each."""
    moving: RayScene | None
    """Actors alone."""

    def visible(self, rays: RayScene, actors: Sequence[FloatArray]) -> tuple[FloatArray, int]:
        """(path,) share that the actors at `actors` (vertex, 3) [m] leave, and the number of rays sent; `rays` is not
        used."""
        count = self.paths.num_paths
        if self.moving is None or not len(self.starts):
            return np.ones(count), 0
        self.moving.update(actors)
        near = _near(self.starts, self.ends, np.concatenate(actors))
        hidden = np.zeros(len(self.path), np.bool_)
        if len(near):
            blocked = self.moving.occluded(self.starts[near], self.ends[near])
            hidden[self.sample[near[blocked]]] = True
        left = np.bincount(self.path, ~hidden, count) / np.maximum(np.bincount(self.path, minlength=count), 1)
        return left, len(near)


def _near(starts: FloatArray, ends: FloatArray, points: FloatArray) -> NDArray[np.intp]:
    """Segments that pass the box around `points` (point, 3) [m]."""
    low, high = points.min(axis=0), points.max(axis=0)
    span = ends - starts
    with np.errstate(divide="ignore", invalid="ignore"):
        one, other = (low - starts) / span, (high - starts) / span
    inside = (starts >= low) & (starts <= high)
    enter = np.where(span != 0, np.minimum(one, other), np.where(inside, -np.inf, np.inf)).max(axis=1)
    leave = np.where(span != 0, np.maximum(one, other), np.where(inside, np.inf, -np.inf)).min(axis=1)
    return np.flatnonzero((np.maximum(enter, 0.0) <= np.minimum(leave, 1.0)) & (span != 0).any(axis=1))


def trace_static_routes(scene: RunScene, surfaces: Surfaces, level: float, max_bounces: int) -> StaticRoutes | None:
    """Routes of the static `surfaces`, of which `scene` is made; None without any. `level` is that of the direct
    returns."""
    vertices = surfaces.static_vertices
    alone = replace(surfaces, static=(), static_vertices=(), moving=scene.surfaces)
    tracer = RouteTracer(alone, vertices, scene.band.viewpoint, scene.wavelength, max_bounces, through_slabs=True)
    plan = TracePlan.single(scene, vertices)
    (sample,) = plan.sample([0.0])
    levels = np.zeros(len(scene.group))
    levels[scene.group] = level
    now, names = np.zeros(1), (surfaces.object_names, surfaces.part_names)
    found = tracer.trace(plan, now, [sample], levels)
    if not found:
        return None
    paths = RadarPaths.concatenate([tracer.paths(plan, now, [sample], each, names) for each in found])
    starts, ends = list[FloatArray](), list[FloatArray]()
    samples, owners = list[NDArray[np.intp]](), list[NDArray[np.intp]]()
    first_path = first_sample = 0
    for each in found:
        points, owner = _points(each.route, sample.points[plan.mesh.meshes.corners[each.route.facets]])
        for leg in (each.route.out[0], each.route.back[0]):
            places = _polyline(leg, points)
            for here, there in pairwise(places):
                starts.append(here + scene.band.viewpoint)
                ends.append(there + scene.band.viewpoint)
                samples.append(first_sample + np.arange(len(points)))
        owners.append(first_path + owner)
        first_path, first_sample = first_path + len(each.route.facets), first_sample + len(points)
    actors = None
    if surfaces.moving:
        still = [(np.zeros((int(each.faces.max()) + 1, 3)), each.faces) for each in surfaces.moving]
        actors = RayScene([], still, origin=scene.band.viewpoint)
    lines, whose = (np.concatenate(starts), np.concatenate(ends)), (np.concatenate(samples), np.concatenate(owners))
    return StaticRoutes(paths, 0.0, 0, *lines, *whose, actors)


def _points(route: Route, corners: FloatArray) -> tuple[FloatArray, NDArray[np.intp]]:
    """(sample, 3) points [m] of facets with `corners` (facet, 3, 3) that both legs reach, and the facet of each."""
    edge = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    along = np.clip(np.ceil(edge / SAMPLE_SPACING), 1, MAX_SAMPLES).astype(int)
    planes = np.concatenate([route.out[0].planes, route.back[0].planes])
    points, owners = [], []
    for n in np.unique(along).tolist():
        index = np.flatnonzero(along == n)
        weights = _lattice(n)
        inner = np.einsum("pk,fki->fpi", weights, corners[index])
        reached = (inner @ planes[:, :3].T >= planes[:, 3]).all(axis=2)
        reached[~reached.any(axis=1), 0] = True
        facet, place = np.nonzero(reached)
        points.append(inner[facet, place])
        owners.append(index[facet])
    return np.concatenate(points), np.concatenate(owners)


def _lattice(n: int) -> FloatArray:
    """(point, 3) barycentric coordinates of the centroids of `n` by `n` equal parts of a triangle."""
    found = []
    for i in range(n):
        for j in range(n - i):
            found.append((i + 1 / 3, j + 1 / 3))
            if j < n - i - 1:
                found.append((i + 2 / 3, j + 2 / 3))
    first, second = np.array(found).T / n
    return np.column_stack([first, second, 1.0 - first - second])


def _polyline(leg: Leg, points: FloatArray) -> list[FloatArray]:
    """Positions (point, 3) [m] from the radar along a `leg` to `points` (point, 3)."""
    view, places = leg.view, [np.zeros_like(points)]
    for segment, normal, mirror in zip(leg.segments[1:], leg.normals, leg.mirrors, strict=True):
        # Where the straight line crosses the mirror, taken back to the space after it.
        offset = mirror.offset + normal @ (segment.shift + view)
        here, there = normal @ view - offset, points @ normal - offset
        crossing = view + (here / (here - there))[:, None] * (points - view)
        places.append((crossing - segment.shift - view) @ segment.turn)
    return [*places, points]
