"""Facets of moving surfaces, which persist until the motion demands other ones."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray, IntArray
from rfgen_sionna.records import RadarPaths
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.tracing.gains.band import BandTracer
from rfgen_sionna.tracing.gains.diffuse import grain_of
from rfgen_sionna.tracing.gains.error_estimate import tolerance_factor
from rfgen_sionna.tracing.ghosts.ghosts import Ghosts
from rfgen_sionna.tracing.moving.clusters import FacetClusters
from rfgen_sionna.tracing.shadows.adaptive_sampling import shared_vertices
from rfgen_sionna.tracing.surface.facets import RATE_STEP, Facets, facet_paths, over_time, stack_facets, with_patches
from rfgen_sionna.tracing.surface.resolution import needs_finer_facets
from rfgen_sionna.tracing.surface.surfaces import Surfaces
from rfgen_sionna.tracing.surface.tessellate import Tessellation, tessellate

RANGE_MARGIN = 1.1
"""Range of tessellation over the range window: facets may enter it during the interval."""

Positions = Callable[[float], Sequence[FloatArray]]
"""Time [s] to the (vertex, 3) positions [m] of every moving surface."""
FacetCallback = Callable[[Sequence[FloatArray], NDArray[np.intp]], None]
"""Receives new facets: corners (facet, 3, 3) [m] of each surface's, and the indices of pieces of curved faces."""


class MovingFacets:
    """Pieces of the faces of moving surfaces, fine enough for the `viewpoint` (3,) [m] up to `max_range` [m], for a
    relative tolerance `rtol`, and for the images in mirrors of `ghosts`. `on_new_facets` receives new ones."""

    def __init__(
        self,
        surfaces: Surfaces,
        band: BandTracer,
        viewpoint: FloatArray,
        max_range: float,
        rtol: float,
        ghosts: Ghosts | None,
        on_new_facets: FacetCallback,
    ) -> None:
        self.surfaces, self._names = surfaces.moving, (surfaces.object_names, surfaces.part_names)
        self._band, self._viewpoint, self._max_range, self._rtol = band, viewpoint, max_range, rtol
        self._ghosts, self._on_new_facets = ghosts, on_new_facets
        self.pieces: list[Tessellation] = []
        self.places: IntArray = np.zeros((0, 3), np.int32)
        """(facet, 3) index of each corner's position:
        :func:`rfgen_sionna.tracing.shadows.adaptive_sampling.shared_vertices`."""
        self.clusters = FacetClusters(band, viewpoint, rtol)
        self._parts: list[IntArray] = []
        self._turns: list[FloatArray] | None = None  # (face,) per surface; None if all are flat
        self._resolution = np.ones(len(surfaces.moving))
        self._limits: list[FloatArray] | None = None
        self._distance = np.zeros(len(surfaces.moving))

    def follow(self, positions: Positions, knots: FloatArray) -> bool:
        """Make new, coarsest facets where an actor's range has changed by a fifth down or a factor of two up, or where
        a flat surface has turned or moved to a different pattern gradient; returns whether there are new ones."""
        poses = [positions(t) for t in sorted({float(knots[0]), float(knots[-1])})]
        changed = not self.pieces
        for index, _ in enumerate(self.surfaces):
            distances = [lengths(pose[index] - self._viewpoint) for pose in poses]
            nearest = min(float(each.min()) for each in distances)
            out_of_range = max(float(each.max()) for each in distances) > self._max_range
            if out_of_range or not 0.8 * self._distance[index] <= nearest <= 2.0 * self._distance[index]:
                self._distance[index] = nearest
                changed = True
            elif not changed and self.surfaces[index].smooth is None:
                corners = self.pieces[index].corners(poses[0][index], self.surfaces[index].faces)
                known = self._viewpoint, self._band.highest, self._rtol, self._band.pattern_gain
                changed = needs_finer_facets(corners, *known)
        if changed:
            self._resolution[:] = 1.0
            self._split(poses[0])
        return changed

    @property
    def limited(self) -> bool:
        """Whether faces turn so fast that their facets are limited."""
        return self._limits is not None

    def limit(self, limits: Sequence[FloatArray]) -> list[FloatArray]:
        """Limit the edges [m] of the facets of every face to `limits` (face,) of each surface
        (:mod:`rfgen_sionna.tracing.moving.fast_turns`); returns the limits in use, which stay within a factor of
        two."""
        known = self._limits
        if known is None or any(
            ((own > 2.0 * new) | (own < 0.5 * new)).any() for own, new in zip(known, limits, strict=True)
        ):
            known, self.pieces = list(limits), []  # new facets in the next interval
            self._limits = known
        return known

    def coarsen(self, vertices: Sequence[FloatArray]) -> None:
        """Return to the coarsest facets, for `vertices` (vertex, 3) [m] of each surface."""
        if (self._resolution != 1.0).any():
            self._resolution[:] = 1.0
            self._split(vertices)

    def refine(self, error: FloatArray, vertices: Sequence[FloatArray]) -> bool:
        """Refine surfaces with an `error` (surface,) above the tolerance; False if there are none or facets become too
        many."""
        coarse = error > self._rtol
        if not coarse.any():
            return False
        before = self._resolution.copy()
        self._resolution[coarse] *= tolerance_factor(error[coarse], self._rtol)
        try:
            self._split(vertices)
        except ValueError:
            self._resolution = before
            return False
        return True

    def turn_to(self, poses: Sequence[Sequence[FloatArray]]) -> None:
        """Set the number of parts per facet for an interval with the `poses`, (vertex, 3) positions [m] of each
        surface."""
        placed = zip(self.pieces, self.surfaces, zip(*poses, strict=True), strict=True)
        self._parts = [piece.visible_parts(turned, own.faces, self._viewpoint) for piece, own, turned in placed]

    def at(self, vertices: Sequence[Sequence[FloatArray]]) -> list[Facets]:
        """All facets at several times, flat; `vertices` are those of each time."""
        wavenumber = 2 * np.pi * self._band.highest / SPEED_OF_LIGHT
        given = self.pieces, vertices, self._viewpoint, wavenumber, self._parts, self._turns
        return stack_facets(self.surfaces, *given)

    def with_patches(
        self, facets: Sequence[Facets], vertices: Sequence[Sequence[FloatArray]], chosen: NDArray[np.intp] | None = None
    ) -> list[Facets]:
        """The same with quadratic patches; with `chosen`, only facets of these indices need one."""
        return with_patches(facets, self.surfaces, self.pieces, vertices, chosen)

    def from_all_sides(self, facets: Facets) -> Facets:
        """The same with the number of parts for any direction."""
        return replace(facets, parts=np.concatenate([piece.parts for piece in self.pieces]))

    def centroids(self, vertices: Sequence[FloatArray], selected: NDArray[np.intp]) -> FloatArray:
        """(selected, 3) centroids [m] of the facets with ascending indices `selected`."""
        found = [
            piece.centroids(points, faces, chosen) for piece, points, faces, chosen in self._own(vertices, selected)
        ]
        return np.concatenate([np.zeros((0, 3)), *found])

    def corners(self, vertices: Sequence[FloatArray], selected: NDArray[np.intp]) -> FloatArray:
        """(selected, 3, 3) corners [m] of the facets with ascending indices `selected`."""
        found = [piece.corners(points, faces, chosen) for piece, points, faces, chosen in self._own(vertices, selected)]
        return np.concatenate([np.zeros((0, 3, 3)), *found])

    def paths(
        self,
        knots: FloatArray,
        sample_times: FloatArray,
        positions: Positions,
        facets: Facets,
        gains: ComplexArray,
        heads: NDArray[np.intp],
        known: Mapping[float, FloatArray],
    ) -> RadarPaths:
        """Paths of `facets`, the cluster heads with indices `heads`, with `gains` (order, tx, rx, facet, time).
        Centroids (facet, 3) [m] of all facets are `known` at some times."""
        direction = np.empty((len(heads), len(knots), 3))
        column = {float(t): k for k, t in enumerate(knots)}

        def centroids(t: float) -> FloatArray:
            return np.take(known[t], heads, axis=0) if t in known else self.centroids(positions(t), heads)

        def delays(t: float) -> FloatArray:
            there = centroids(t)
            if t in column:
                offset = there - self._viewpoint
                direction[:, column[t]] = offset / np.maximum(lengths(offset), 1e-12)[:, None]
            return self._band.delays(there)

        def rates(t: float) -> FloatArray:
            before, after = positions(t - RATE_STEP), positions(t + RATE_STEP)
            velocities = [(b - a) / (2 * RATE_STEP) for a, b in zip(before, after, strict=True)]
            return self._band.rates(centroids(t), self.centroids(velocities, heads))

        curves = over_time(knots, sample_times, gains, delays, rates)
        return facet_paths(
            self.surfaces, facets, knots, *curves, direction, self._band.centre, self._band.half_band, self._names
        )

    def _own(
        self, vertices: Sequence[FloatArray], selected: NDArray[np.intp]
    ) -> Iterator[tuple[Tessellation, FloatArray, IntArray, NDArray[np.intp]]]:
        """Of each surface its pieces, vertices, faces and its part of `selected`."""
        first = 0
        for piece, points, surface in zip(self.pieces, vertices, self.surfaces, strict=True):
            yield (
                piece,
                points,
                surface.faces,
                selected[(selected >= first) & (selected < first + len(piece.face))] - first,
            )
            first += len(piece.face)

    def _split(self, vertices: Sequence[FloatArray]) -> None:
        images = self._ghosts.images(vertices) if self._ghosts is not None else [[] for _ in vertices]
        limits = [None] * len(vertices) if self._limits is None else self._limits
        self.pieces = [
            tessellate(
                points,
                surface.faces,
                self._viewpoint,
                self._band.highest,
                self._rtol * resolution,
                self._band.pattern_gain,
                RANGE_MARGIN * self._max_range,
                self._band.half_band,
                images=mirrored,
                smooth=surface.smooth,
                grain=grain_of(surface),
                longest_edges=longest,
            )
            for points, surface, resolution, mirrored, longest in zip(
                vertices, self.surfaces, self._resolution, images, limits, strict=True
            )
        ]
        # Curvature hardly changes with the pose of a body.
        if any(surface.smooth is not None for surface in self.surfaces):
            self._turns = [
                np.zeros(len(surface.faces)) if surface.smooth is None else surface.smooth.turn(points, surface.faces)
                for points, surface in zip(vertices, self.surfaces, strict=True)
            ]
        self.turn_to([vertices])
        placed = zip(self.pieces, vertices, self.surfaces, strict=True)
        corners = [piece.corners(points, surface.faces) for piece, points, surface in placed]
        surface = np.repeat(np.arange(len(corners)), [len(each) for each in corners])
        self.places = shared_vertices(np.concatenate([np.zeros((0, 3, 3)), *corners]), surface)
        firsts = np.cumsum([0, *(len(each.face) for each in self.pieces)])
        of_curved = [
            first + piece.pieces
            for piece, first, surface in zip(self.pieces, firsts.tolist(), self.surfaces, strict=False)
            if surface.smooth is not None
        ]
        self._on_new_facets(corners, np.concatenate([np.zeros(0, np.intp), *of_curved]))
        self.clusters.form(self.surfaces, self.pieces, vertices, self._distance)
