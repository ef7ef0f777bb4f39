"""Moving surfaces, and their shadows on static ones, at common sample times."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.records import RadarPaths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.moving.moving_trace import MovingTracer
from rfgen_sionna.tracing.report import Traced, TraceReport
from rfgen_sionna.tracing.static.actor_shadows import Shadow
from rfgen_sionna.tracing.static.static_refinement import interpolation_error, refine_occlusion
from rfgen_sionna.tracing.static.static_trace import StaticTrace
from rfgen_sionna.tracing.static.static_visibility import StaticVisibility


class RaysAt(Protocol):
    """Static and moving meshes at a time."""

    def __call__(self, t: float, keep: bool = True) -> RayScene:
        """At `t` [s], valid until the next call; `keep` caches the vertices for the current interval."""


@dataclass(frozen=True)
class JointScene:
    """Static scene with its indirect paths, and moving surfaces."""

    static: StaticTrace
    indirect: Sequence[Any]
    """Indirect paths between static surfaces and through them."""
    paths: RadarPaths
    """All paths of the static scene without actors."""
    vertices: Callable[[float], Sequence[FloatArray]]
    rays_at: RaysAt
    rays: RayScene
    """At any time."""
    has_actors: bool
    rtol: float


def trace_jointly(
    scene: JointScene,
    knots: FloatArray,
    sample_times: FloatArray,
    parts: MovingTracer,
    turned: float,
    watch: Callable[[float, RayScene], None] | None,
) -> Traced:
    """Trace with delays at `knots` and gains at `sample_times` [s]; `turned` is the time error so far, and `watch` is
    called with each sample time and the ray scene of that time."""
    static, static_indirect = scene.static, scene.indirect
    shares: dict[float, StaticVisibility] = {}
    fractions: list[dict[float, FloatArray]] = [{} for _ in static_indirect]
    sent = [static.rays, *(each.rays for each in static_indirect)]

    @cache
    def occluded() -> NDArray[np.intp]:
        """Static facets that actors may occlude at a sample time."""
        each = zip(*(scene.vertices(t) for t in sample_times.tolist()), strict=True)
        return static.behind([np.concatenate(places) for places in each])

    def visibility(t: float) -> RayScene:
        """Ray scene at `t`; finds the static facets that actors occlude then, once per time."""
        rays = scene.rays_at(t)
        if t not in shares and scene.has_actors:
            shares[t], count = static.visible(rays, occluded(), parts.silhouette_rays(t))
            sent.append(count)
            for each, by_time in zip(static_indirect, fractions, strict=True):
                by_time[t], count = each.visible(rays, scene.vertices(t))
                sent.append(count)
            if watch is not None:
                watch(t, rays)
        return rays

    moving = parts.trace(knots, sample_times, scene.vertices, visibility, scene.rays, scene.rays_at)
    sample_times = moving.sample_times
    for t in sample_times.tolist():
        if t not in shares and scene.has_actors and (len(static.facets) or watch is not None):
            visibility(t)

    static_visibility = [shares.get(t, static.without_actors) for t in sample_times.tolist()]
    candidates = refine_occlusion(
        static, sample_times, static_visibility, lambda t: scene.rays_at(t, keep=False), scene.rtol
    )
    indirect = [
        np.stack([by_time[t] for t in sample_times.tolist()], axis=1) if by_time else None for by_time in fractions
    ]
    pairs = list(zip(static_indirect, indirect, strict=True))
    unseen = [interpolation_error(static, each.paths, share) for each, share in pairs if share is not None]

    def shadows() -> tuple[Shadow, ...]:
        found = list(candidates.shadows(static))
        first = static.paths.num_paths
        for each, share in pairs:
            if share is not None:
                found += [shadow.of(first) for shadow in each.shadows(sample_times, share)]
            first += each.paths.num_paths
        return tuple(shadow for shadow in found if shadow.paths.num_paths)

    edges = max([candidates.missed, *(each.missed for each in shares.values())])
    report = TraceReport(
        facets=len(static.facets) + moving.facets + candidates.sampled_facets,
        rays=sum(sent) + moving.rays + candidates.rays,
        sample_times=len(sample_times),
        knots=len(knots),
        error=max(float(np.hypot(static.error, edges)) + sum(each.error for each in static_indirect), moving.error),
        time_error=max(float(np.hypot(moving.time_error, turned)), float(np.linalg.norm([candidates.error, *unseen]))),
    )
    return Traced(scene.paths, shadows, moving.paths, moving.refined, report, moving.places, moving.refined_places)
