"""First-order physical optics of a scene with static and moving parts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.parallel import one_blas_thread
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import SPEED_OF_LIGHT, FloatArray, RadarPaths, knot_weights
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.facets import Facets, facet_paths, stack_facets
from rfgen_sionna.tracing.gains import BandTracer
from rfgen_sionna.tracing.knots import choose_knots
from rfgen_sionna.tracing.relative import Seen, seen_from, to_world
from rfgen_sionna.tracing.static import StaticTrace, trace_static
from rfgen_sionna.tracing.surfaces import collect_surfaces
from rfgen_sionna.tracing.tessellate import Tessellation, tessellate
from rfgen_sionna.tracing.visibility import visible_fraction

if TYPE_CHECKING:
    from rfgen_sionna.scene import Actor, RadarScene

RATE_STEP = 0.5e-3
"""Half the stretch over which an instant's rates are differenced [s]: errs by jerk x step^2 / 6, below 0.1 mm/s."""
PHASE_PER_RTOL = 3.0
"""Phase error between knots [rad, root mean square over the vertices] per unit of `rtol`."""
RANGE_MARGIN = 1.1
"""Facets are made as far as this times the range window: they may come into it during the stretch."""
GAIN_SPACING = 7e-3
"""Longest gap between instants at which gains and visibility are traced [s]; delays may have more knots."""


@dataclass(frozen=True)
class TraceReport:
    """What a trace cost."""

    facets: int
    """Facets integrated."""
    rays: int
    """Visibility rays sent, those of the static scene included."""
    instants: int
    """Instants at which visibility and gains were traced."""
    knots: int
    """Knots of the delays."""


@dataclass(frozen=True)
class Traced:
    """Paths over a stretch of time. The channel is the sum of the three parts, which don't share knots."""

    static: RadarPaths
    """The static scene as if there were no actors: one knot, traced once."""
    shadow: RadarPaths
    """What the actors hide of it: its paths, weighted with the visible share less the unobstructed one."""
    shaded: NDArray[np.intp]
    """(path,) index of the static path that each path of `shadow` takes from."""
    moving: RadarPaths
    """The actors."""
    report: TraceReport


class Tracer:
    """Traces one radar in one scene with its actors.

    The static scene is tessellated, tested for visibility and integrated once; per stretch of time only the actors
    and what they hide is traced anew. First order: every surface reflects with the Fresnel coefficients of its front as
    that of a half-space; slabs, roughness and further bounces are not traced.

    Parameters
    ----------
    scene
        The static scene; None is free space.
    radar
        Position, elements, band and range window. If it moves, what :meth:`trace` and geometry say
        of directions is in the frame of :mod:`rfgen_sionna.tracing.relative`; :meth:`instant` speaks of the world.
    actors
        What moves.
    rtol
        Allowed relative error of a facet's gain (see :func:`~rfgen_sionna.tracing.tessellate.allowed_bulge`) and, times
        `PHASE_PER_RTOL`, phase error between knots [rad].
    """

    def __init__(self, scene: RadarScene | None, radar: Radar, actors: Sequence[Actor], rtol: float = 1e-3) -> None:
        self.radar = radar
        self.actors: tuple[Actor | Seen, ...] = tuple(actors)
        if radar.trajectory is not None:
            # Seen from the radar all the world moves, in the frame of t = 0.
            self.actors, scene = seen_from(radar, scene, actors), None
        self.rtol = rtol
        self.surfaces = collect_surfaces(scene, self.actors)
        self._viewpoint = np.asarray(radar.position)
        self._band = BandTracer(radar, rtol)
        self._positions: dict[float, list[FloatArray]] = {}

    @cached_property
    def static(self) -> StaticTrace:
        """The static scene, traced at first use."""
        return trace_static(
            self.surfaces, self._static_rays, self._band, self._viewpoint, self.rtol, self.radar.max_range
        )

    @cached_property
    def _static_rays(self) -> RayScene | None:
        """The static meshes alone; None where there are none."""
        return RayScene(self._static_meshes, origin=self._viewpoint) if self._static_meshes else None

    def behind_scene(self, points: FloatArray) -> NDArray[np.bool_]:
        """(point,) whether the static scene stands between the radar and each of `points` (point, 3) [m]."""
        if self._static_rays is None:
            return np.zeros(len(points), dtype=np.bool_)
        return self._static_rays.occluded(self._viewpoint, points)

    @cached_property
    def _rays(self) -> RayScene:
        """Static and moving meshes together."""
        moving = [(points, actor.faces) for points, actor in zip(self._vertices(0.0), self.actors, strict=True)]
        return RayScene(self._static_meshes, moving, origin=self._viewpoint)

    @property
    def _static_meshes(self) -> list[tuple[FloatArray, NDArray[np.int32]]]:
        surfaces = self.surfaces
        return [(points, each.faces) for points, each in zip(surfaces.static_vertices, surfaces.static, strict=True)]

    def _vertices(self, t: float) -> list[FloatArray]:
        """Vertices of every actor at `t`; kept for the stretch at hand, as knots are chosen by trying."""
        if t not in self._positions:
            self._positions[t] = [actor.vertices(t) for actor in self.actors]
        return self._positions[t]

    @one_blas_thread()
    def trace(self, start: float, stop: float) -> Traced:
        """Paths from `start` to `stop` [s], with as many knots as the motion asks for."""
        self._positions.clear()
        knots = np.array([start])
        if self.actors:
            knots = choose_knots(
                self._vertices,
                self._viewpoint,
                start,
                stop,
                self._band.highest,
                PHASE_PER_RTOL * self.rtol,
                GAIN_SPACING,
            )
        return self._traced(knots)

    @one_blas_thread()
    def instant(self, t: float) -> RadarPaths:
        """All paths at one instant [s] with their rates: static ones first, then the actors'; a single knot."""
        self._positions.clear()
        traced = self._traced(np.array([t]))
        static = traced.static
        if len(traced.shaded):
            a = static.a.copy()
            a[:, :, traced.shaded] += traced.shadow.a
            dispersion = None if static.dispersion is None else static.dispersion.copy()
            if dispersion is not None and traced.shadow.dispersion is not None:
                dispersion[:, :, :, traced.shaded] += traced.shadow.dispersion
            static = replace(static, a=a, dispersion=dispersion).select(np.any(a != 0, axis=(0, 1, 3)))
        paths = RadarPaths.concatenate([replace(static, times=np.array([t])), traced.moving])
        if self.radar.trajectory is None:
            return paths
        direction = to_world(paths.direction, self.radar, t)
        return replace(paths, direction=direction, arrival=direction)

    def geometry(self, t: float) -> tuple[RayScene, list[FloatArray], list[FloatArray | None]]:
        """The ray scene as it stands at `t` [s], each object's vertices [m], and their velocities [m/s] or None."""
        self._positions.clear()
        moving = self._vertices(t)
        if self.actors:
            self._rays.update(moving)
        before, after = self._vertices(t - RATE_STEP), self._vertices(t + RATE_STEP)
        velocities = [(b - a) / (2 * RATE_STEP) for a, b in zip(before, after, strict=True)]
        static = list(self.surfaces.static_vertices)
        return self._rays, [*static, *moving], [*([None] * len(static)), *velocities]

    def _traced(self, knots: FloatArray) -> Traced:
        static = self.static
        rays, looked_at = static.rays, len(static.facets)
        pieces = self._tessellations(knots)
        instants = _every_so_often(knots, GAIN_SPACING)
        stacked, fractions, shares = [], [], []
        for t in instants:
            vertices = self._vertices(float(t))
            each = stack_facets(self.surfaces.moving, pieces, vertices, self._viewpoint)
            fraction, share = np.zeros(len(each)), static.fraction
            if self.actors:
                self._rays.update(vertices)
                near = np.linalg.norm(each.centroids - self._viewpoint, axis=1) < self.radar.max_range
                facing = np.flatnonzero(each.facing & near)
                seen = visible_fraction(self._rays, self._viewpoint, each.corners[facing], each.number[facing])
                fraction[facing] = seen.fraction
                share, more = static.visible(self._rays, vertices)
                rays += seen.rays + more
                looked_at += len(facing)
            stacked.append(each)
            fractions.append(fraction)
            shares.append(share)
        shadow, shaded = static.shadow(instants, np.stack(shares, axis=1))
        moving = self._moving_paths(knots, instants, pieces, stacked, np.stack(fractions, axis=1))
        report = TraceReport(looked_at, rays, len(instants), len(knots))
        return Traced(static.paths, shadow, shaded, moving, report)

    def _tessellations(self, knots: FloatArray) -> list[Tessellation]:
        """Tessellation of every actor at the knot where it comes nearest to the radar."""
        pieces = []
        for index, surface in enumerate(self.surfaces.moving):
            poses = [self._vertices(float(t))[index] for t in knots]
            nearest = min(poses, key=lambda points: float(np.linalg.norm(points - self._viewpoint, axis=1).min()))
            pieces.append(
                tessellate(
                    nearest,
                    surface.faces,
                    self._viewpoint,
                    self._band.highest,
                    self.rtol,
                    self._band.importance,
                    RANGE_MARGIN * self.radar.max_range,
                )
            )
        return pieces

    def _moving_paths(
        self,
        knots: FloatArray,
        instants: FloatArray,
        pieces: list[Tessellation],
        stacked: list[Facets],
        fraction: FloatArray,
    ) -> RadarPaths:
        """Paths of the facets that are seen at any instant; `fraction` is (facet, instant)."""
        surfaces = self.surfaces.moving
        materials = tuple(surface.material for surface in surfaces)
        kept = np.flatnonzero((fraction > 0).any(axis=1))
        facets, fraction = [each.take(kept) for each in stacked], fraction[kept]
        middle = len(instants) // 2
        order = self._band.order_for(facets[middle].corners, materials, facets[middle].surface, fraction[:, middle])
        shape = (len(self.radar.tx_positions), len(self.radar.rx_positions), len(kept))
        coefficients = np.empty((order, *shape, len(instants)), dtype=np.complex128)
        for k, each in enumerate(facets):
            gains = self._band(each.corners, materials, each.surface, order)
            coefficients[..., k] = gains.coefficients * fraction[:, k]
        if len(knots) > len(instants):
            coefficients = coefficients @ knot_weights(instants, knots).T
        tau, direction = np.empty((*shape, len(knots))), np.empty((len(kept), len(knots), 3))
        for k, t in enumerate(knots):
            tau[..., k], direction[:, k] = self._delays(float(t), pieces, kept)
        if len(knots) > 1:
            rate = tau @ knot_weights(knots, knots, 1).T
        else:
            before, after = (self._delays(float(knots[0]) + step, pieces, kept)[0] for step in (-RATE_STEP, RATE_STEP))
            rate = ((after - before) / (2 * RATE_STEP))[..., None]
        return facet_paths(
            surfaces,
            facets[0],
            knots,
            coefficients,
            tau,
            rate,
            direction,
            self._band.centre,
            self._band.half_band,
            (self.surfaces.object_names, self.surfaces.part_names),
        )

    def _delays(self, t: float, pieces: list[Tessellation], kept: NDArray[np.intp]) -> tuple[FloatArray, FloatArray]:
        """Delays (tx, rx, facet) [s] by way of the centroids of the facets `kept` at `t`, and directions (facet, 3)."""
        parts = [
            piece.centroids(points, surface.faces)
            for piece, points, surface in zip(pieces, self._vertices(t), self.surfaces.moving, strict=True)
        ]
        centroids = np.concatenate([np.zeros((0, 3)), *parts])[kept] - self._viewpoint
        to_tx, to_rx = (
            np.linalg.norm(centroids - (elements - self._viewpoint)[:, None], axis=2)
            for elements in (self.radar.tx_world, self.radar.rx_world)
        )
        distance = np.maximum(np.linalg.norm(centroids, axis=1, keepdims=True), 1e-12)
        return (to_tx[:, None] + to_rx) / SPEED_OF_LIGHT, centroids / distance


def _every_so_often(knots: FloatArray, spacing: float) -> FloatArray:
    """Every 2^n-th knot, as few as keep to the longest gap [s]; there are 2^m + 1 knots, or one."""
    stride = 1
    while 2 * stride < len(knots) and (knots[2 * stride] - knots[0]) <= spacing * (1 + 1e-9):
        stride *= 2
    return knots[::stride]
