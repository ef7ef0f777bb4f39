"""Clipping of reflectors' cones to facets, and legs by reflectors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.ghosts.image_band import ImageBand
from rfgen_sionna.tracing.ghosts.mirror_images import Mirror
from rfgen_sionna.tracing.reflectors.clipped_footprints import (
    DIRECT,
    ON_PLANE,
    ClippedFootprints,
    ReflectedBand,
    ReflectedFacets,
)
from rfgen_sionna.tracing.reflectors.planar_reflectors import PlanarPart, PlanarReflector
from rfgen_sionna.tracing.shadows.mirror_visibility import FINE_LATTICE, GUIDE_POINTS
from rfgen_sionna.tracing.surface.clip import clip_triangles
from rfgen_sionna.tracing.surface.facets import Facets

MAX_IMAGES = 12
"""Most reflectors whose images choose the knots; they move alike."""


class FootprintClipper:
    """Finds visible parts of facets by reflectors, at one time.

    Parameters
    ----------
    rays, owner
        Ray scene, and the reflector of each of its faces (face,), -1 for none.
    reflectors
        Reflectors in use; None for the others.
    viewpoint
        (3,) phase centre of the radar [m].
    facets, max_range
        Facets to be seen by reflectors, and half the longest path length [m].
    """

    def __init__(
        self,
        rays: RayScene,
        reflectors: Sequence[PlanarReflector | None],
        owner: IntArray,
        viewpoint: FloatArray,
        facets: Facets,
        max_range: float,
    ) -> None:
        self._rays, self._reflectors, self._owner, self._view = rays, reflectors, owner, viewpoint
        self._facets, self._reach = facets, 2.0 * max_range
        self._corners = facets.corners - viewpoint
        self._centre = self._corners.mean(axis=1)
        self._radius = np.linalg.norm(self._corners - self._centre[:, None], axis=2).max(axis=1, initial=0.0)
        self._distance = np.linalg.norm(self._centre, axis=1)
        self._shadows = [[] if reflector is None else reflector.shadow(viewpoint) for reflector in reflectors]
        self._normals = np.array(
            [np.zeros(3) if reflector is None else reflector.normal for reflector in reflectors]
        ).reshape(-1, 3)
        self._heights = np.array(
            [0.0 if reflector is None else float(reflector.height(viewpoint)) for reflector in reflectors]
        )
        self.sent = 0
        """Rays sent so far."""

    def owner(self, index: NDArray[np.intp]) -> IntArray:
        """(chosen,) reflector of each facet, -1 for none."""
        return np.asarray(self._owner[self._facets.number[index]])

    def lengths(self, reflector: int, index: NDArray[np.intp]) -> FloatArray:
        """(chosen,) one-way path lengths from the viewpoint by a reflector to facets' centroids [m]."""
        if reflector == DIRECT:
            return np.asarray(self._distance[index])
        image = -2.0 * self._heights[reflector] * self._normals[reflector]
        return np.asarray(np.linalg.norm(self._centre[index] - image, axis=1))

    def candidates(self, reflector: int) -> NDArray[np.intp]:
        """Facets in the reflector's cone, regardless of occlusion, ascending."""
        found = []
        for index, middle, radius in self._bodies:
            for sides, offsets in self._shadows[reflector]:
                if (sides @ middle - offsets > -radius).all():
                    inside = self._centre[index] @ sides.T - offsets
                    found.append(index[(inside > -self._radius[index, None]).all(axis=1)])
        return np.unique(np.concatenate(found)) if found else np.zeros(0, np.intp)

    @cached_property
    def _bodies(self) -> list[tuple[NDArray[np.intp], FloatArray, float]]:
        """Facets of each surface and a sphere around them."""
        found = []
        for number in np.unique(self._facets.surface):
            index = np.flatnonzero(self._facets.surface == number)
            points = self._corners[index].reshape(-1, 3)
            middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
            found.append((index, middle, float(np.linalg.norm(points - middle, axis=1).max())))
        return found

    def _cut(
        self, index: NDArray[np.intp], first: int, last: int
    ) -> tuple[NDArray[np.intp], FloatArray, NDArray[np.intp]]:
        """Facets `index` in range, their pieces in both reflectors' cones regardless of occlusion (piece, 3, 3) [m],
        relative to the viewpoint, and the facet of each piece."""
        index = index[self.lengths(first, index) + self.lengths(last, index) < self._reach]
        pieces, owner = self._corners[index], np.arange(len(index))
        for reflector in dict.fromkeys(each for each in (first, last) if each != DIRECT):
            parts = [clip_triangles(pieces, owner, *shadow) for shadow in self._shadows[reflector]]
            pieces = np.concatenate([part[0] for part in parts])
            owner = np.concatenate([part[1] for part in parts])
        return index, pieces, owner

    def clip_facets(self, index: NDArray[np.intp], first: int, last: int) -> ClippedFootprints:
        """Visible parts of the facets `index` by the reflectors `first` and `last`, either of which may be `DIRECT`."""
        index, pieces, owner = self._cut(index, first, last)
        if len(pieces) == 0:
            return ClippedFootprints.none()
        ways = (np.full(len(pieces), reflector, np.int32) for reflector in (first, last))
        share = self._share(pieces, index[owner], *ways)
        visible = np.flatnonzero(share > 0)
        used, owner = np.unique(owner[visible], return_inverse=True)
        count = len(used)
        return ClippedFootprints(
            index[used], np.full(count, first, np.int32), np.full(count, last, np.int32), pieces[visible] + self._view,
            owner.reshape(-1), share[visible],
        )  # fmt: skip

    def _share(self, pieces: FloatArray, facet: NDArray[np.intp], first: IntArray, last: IntArray) -> FloatArray:
        """(piece,) share that both legs reach, by reflectors (piece,): three guiding points, and a lattice where they
        disagree. Rays of all legs are sent together, as there may be hundreds of pairs with few pieces."""

        def share(chosen: NDArray[np.intp], weights: FloatArray) -> FloatArray:
            targets = np.tensordot(weights, pieces[chosen], axes=(1, 1)).reshape(-1, 3)
            piece = np.tile(chosen, len(weights))
            through = self._through(targets, facet[piece], first[piece])
            left = np.flatnonzero(through & (last[piece] != first[piece]))
            through[left] = self._through(targets[left], facet[piece[left]], last[piece[left]])
            return np.asarray(through.reshape(len(weights), -1).mean(axis=0))

        found = share(np.arange(len(pieces)), GUIDE_POINTS)
        mixed = np.flatnonzero((found > 0) & (found < 1))
        if len(mixed):
            found[mixed] = share(mixed, FINE_LATTICE)
        return found

    def left(self, footprints: ClippedFootprints) -> FloatArray:
        """(entry,) bound of the amplitude after slabs on both legs."""
        return np.ones(len(footprints.facet))

    def near(self, pieces: ClippedFootprints, bodies: Sequence[FloatArray]) -> NDArray[np.intp]:
        """Pieces with a leg near one of the `bodies` at (vertex, 3) positions [m]."""
        middle = pieces.pieces.mean(axis=1) - self._view
        touched = np.zeros(len(middle), np.bool_)
        radius = np.linalg.norm(pieces.pieces - self._view - middle[:, None], axis=2).max(axis=1, initial=0.0)
        spheres = []
        for points in bodies:
            centre = 0.5 * (points.min(axis=0) + points.max(axis=0)) - self._view
            spheres.append((centre, float(np.linalg.norm(points - self._view - centre, axis=1).max())))
        for side in (pieces.first[pieces.owner], pieces.last[pieces.owner]):
            normal, here = self._normals[side], self._heights[side][:, None]
            straight = (side == DIRECT)[:, None]
            there = np.einsum("pi,pi->p", middle, normal)[:, None] + here
            place = (there * (-here * normal) + here * (middle - there * normal)) / np.maximum(here + there, 1e-12)
            turn = np.where(straight, 0.0, place)
            for centre, size in spheres:
                for start, end in ((np.zeros_like(turn), turn), (turn, middle)):
                    leg = end - start
                    along = np.einsum("pi,pi->p", centre - start, leg)
                    along = np.clip(along / np.maximum((leg**2).sum(axis=1), 1e-12), 0.0, 1.0)
                    gap = np.linalg.norm(start + along[:, None] * leg - centre, axis=1)
                    touched |= gap < size + radius
        return np.flatnonzero(touched)

    def resample(self, rays: RayScene, pieces: ClippedFootprints, chosen: NDArray[np.intp]) -> tuple[FloatArray, int]:
        """(chosen,) visible share of pieces in another ray scene, and the number of rays sent."""
        other = copy(self)
        other._rays, other.sent = rays, 0
        entry = pieces.owner[chosen]
        given = pieces.pieces[chosen] - self._view, pieces.facet[entry], pieces.first[entry], pieces.last[entry]
        return other._share(*given), other.sent

    def _through(self, targets: FloatArray, facet: NDArray[np.intp], reflector: IntArray) -> NDArray[np.bool_]:
        """(target,) whether the leg from the viewpoint by a reflector (target,) to points of facets, relative to it, is
        free."""
        number, free = self._facets.number[facet], np.zeros(len(targets), np.bool_)
        self.sent += len(targets)
        straight = np.flatnonzero(reflector == DIRECT)
        if len(straight):
            free[straight] = ~self._rays.occluded(self._view, targets[straight] + self._view, number[straight])
        sent = np.flatnonzero(reflector != DIRECT)
        if len(sent):
            place, before = self._reflection_points(targets[sent], reflector[sent])
            sent, place = sent[before], place[before]
            hit = self._rays.first_facet(self._view, place)
            on = (hit >= 0) & (self._owner[hit] == reflector[sent])
            sent, place, hit = sent[on], place[on], hit[on]
            self.sent += len(sent)
            free[sent] = ~self._rays.occluded(place + self._view, targets[sent] + self._view, number[sent], hit)
        return free

    def _reflection_points(self, targets: FloatArray, reflector: IntArray) -> tuple[FloatArray, NDArray[np.bool_]]:
        """(target, 3) reflection points of the legs at a reflector (target,), relative to the viewpoint [m], and
        whether the targets lie in front of it."""
        normal, here = self._normals[reflector], self._heights[reflector][:, None]
        height = np.einsum("ti,ti->t", targets, normal)[:, None] + here
        before = height > ON_PLANE
        foot, other = -here * normal, targets - height * normal
        return (height * foot + here * other) / np.where(before, here + height, 1.0), before[:, 0]


class FreeLegs:
    """Reflected legs through free space: how footprints are clipped, joined and integrated."""

    @property
    def band(self) -> Callable[[Radar, float, Sequence[Mirror], bool, bool], ImageBand]:
        """Constructor of the band that integrates the facets."""
        return ReflectedBand

    def clipper(
        self,
        rays: RayScene,
        vertices: Sequence[FloatArray],
        reflectors: Sequence[PlanarReflector | None],
        owner: IntArray,
        viewpoint: FloatArray,
        facets: Facets,
        max_range: float,
    ) -> FootprintClipper:
        """As :class:`FootprintClipper`; `vertices` are the (vertex, 3) positions [m] of all surfaces."""
        return FootprintClipper(rays, reflectors, owner, viewpoint, facets, max_range)

    def directly_visible(self, facets: Facets, fraction: FloatArray) -> NDArray[np.bool_]:
        """(facet,) whether each may be visible on the straight leg, from its visible `fraction` (facet,)."""
        return np.asarray(fraction > 0)

    def joined(self, footprint_sets: Sequence[ClippedFootprints]) -> ClippedFootprints:
        """All entries, in ascending order of their keys, each of them unique."""
        return ClippedFootprints.merge(footprint_sets)

    def over_time(
        self,
        facets: Sequence[Facets],
        keys: NDArray[np.int64],
        footprint_sets: Sequence[ClippedFootprints],
        swapped: bool,
    ) -> Sequence[ReflectedFacets]:
        """Facets by sorted `keys` at each sample time, with the legs `swapped` or not."""
        both = zip(facets, footprint_sets, strict=True)
        return [ReflectedFacets.clipped(there, keys, footprints, swapped) for there, footprints in both]

    def imaging(
        self, planar_parts: Sequence[PlanarPart], reflectors: Sequence[PlanarReflector | None], static: int
    ) -> list[int]:
        """Reflectors whose images choose the knots: an even selection of those on surfaces from number `static` on."""
        both = enumerate(zip(planar_parts, reflectors, strict=True))
        moving = [n for n, (part, reflector) in both if part.surface >= static and reflector is not None]
        return moving[:: max(1, -(-len(moving) // MAX_IMAGES))]
