"""Reflections of moving surfaces by planar reflectors: corner reflectors, body to board, furniture.

Of two surfaces on a path one is the mirror (geometrical optics: image of the radar, clipped to the outline's cone), the
other is integrated (physical optics): radar, mirror, facet, radar, and reversed. Of three the middle one is integrated,
between the images of Tx and Rx. Both orders are traced, for reciprocity. Of two planar parts each is the mirror once,
or the much larger one alone (:func:`~rfgen_sionna.tracing.reflectors.planar_reflectors.mirror_weights`).

For a moving radar the scene moves (:mod:`rfgen_sionna.tracing.relative_scene`): walls are reflectors like any other,
and ghosts in them, furniture and corners of the room are traced here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import RadarPaths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.ghosts.image_returns import LEG_COMBINATIONS, Centroids, ImageReturns
from rfgen_sionna.tracing.ghosts.mirror_images import Mirror
from rfgen_sionna.tracing.reflectors.clipped_footprints import (
    DIRECT,
    ClippedFootprints,
    ReflectedFacets,
)
from rfgen_sionna.tracing.reflectors.edge_diffraction import EdgeDiffractionError
from rfgen_sionna.tracing.reflectors.footprint_clipper import FreeLegs
from rfgen_sionna.tracing.reflectors.planar_reflectors import (
    UNBOUNDED,
    PlanarPart,
    PlanarReflector,
    adjacent_parts,
    face_owners,
    find_planar_parts,
    min_widths,
    mirror_weights,
    wide_reflectors,
)
from rfgen_sionna.tracing.surface.facets import Facets
from rfgen_sionna.tracing.surface.surfaces import Surfaces, tolerance_groups

OMITTED_SHARE = 0.5
"""Share of the tolerance that the omitted returns may make up together."""
IMAGE_SAMPLES = 200
"""Vertices per image that choose the knots: distances of neighbouring vertices are alike."""
REST_INTERVALS = 3
"""Intervals for which a negligible reflector or group is skipped, up to twice that, in turns."""
WAKE_GROWTH = 1.1
"""Growth of its number of facets that ends a skip."""

_Groups = tuple[set[tuple[int, ...]], set[tuple[int, ...]]]
"""Groups (surface, first, last) with one and with two reflected legs."""


@dataclass(frozen=True)
class ReflectionVisibility:
    """Footprints of reflectors at a sample time."""

    once: ClippedFootprints
    """With one reflected leg."""
    twice: ClippedFootprints
    """With two reflected legs, in either order."""
    sampled_facets: int
    rays: int
    left: Callable[[ClippedFootprints], FloatArray]
    """(entry,) bound of the amplitude after slabs."""


class PlanarReflections:
    """Finds and traces reflections of moving surfaces, except ghosts in static walls.

    Parameters
    ----------
    surfaces, radar
        Scene and radar.
    rtol
        Tolerance, relative to the return of each actor.
    max_bounces
        2 or 3.
    walls
        Returns the mirrors of traced ghosts; called at first use.
    legs
        Free space or slabs on the legs; None is free space.
    """

    def __init__(
        self,
        surfaces: Surfaces,
        radar: Radar,
        rtol: float,
        max_bounces: int,
        walls: Callable[[], tuple[Mirror, ...]] = tuple,
        legs: FreeLegs | None = None,
    ) -> None:
        self._surfaces, self._radar, self._rtol, self._max_bounces = surfaces, radar, rtol, max_bounces
        self._walls, self._legs = walls, legs or FreeLegs()
        self._viewpoint = np.asarray(radar.position)
        self._planar_parts: tuple[PlanarPart, ...] | None = None
        self._positions: Callable[[float], Sequence[FloatArray]] = lambda _: ()
        self._adjacent: list[set[int]] = []  # (reflector,) those with a common edge
        self._interval = 0
        # Interval until which a negligible reflector, or group (kind, surface, reflectors), is skipped.
        self._rests_until: dict[tuple[int, ...], int] = {}
        # (reflector, surface) candidate facets: now, and at the start of each skip.
        self._counts: IntArray = np.zeros((0, len(surfaces.moving)), np.int32)
        self._rested: dict[tuple[int, ...], IntArray] = {}
        self._skipped = set[tuple[int, ...]]()  # in this interval
        self._imaging: list[int] = []
        self._reflectors: dict[float, tuple[PlanarReflector | None, ...]] = {}
        # (moving surface,) whether it is at rest in the world and the radar moves.
        self._still = np.array([surface.still for surface in surfaces.moving], np.bool_)
        names = surfaces.object_names, surfaces.part_names
        self._returns = ImageReturns(surfaces.moving, names, radar, rtol, self._mirrors, self._legs.band)
        self._edges = EdgeDiffractionError(
            radar, [each.material for each in surfaces.moving], tolerance_groups(surfaces.moving)
        )

    def follow(self, positions: Callable[[float], Sequence[FloatArray]], t: float) -> bool:
        """Take the moving surfaces' vertices from `positions` for the interval of `t` [s]. Returns whether there is any
        planar part."""
        self._positions = positions
        self._reflectors.clear()
        if self._planar_parts is None:
            vertices = [*self._surfaces.static_vertices, *positions(t)]
            every = (*self._surfaces.static, *self._surfaces.moving)
            counts = len(self._surfaces.static), len(self._surfaces.moving)
            self._planar_parts = find_planar_parts(every, vertices, min_widths(*counts, self._radar.wavelength))
            self._counts = np.zeros((len(self._planar_parts), len(self._surfaces.moving)), np.int32)
            if self._still.any():
                self._adjacent = adjacent_parts(self._planar_parts, vertices)
        self._imaging = self._legs.imaging(self.planar_parts, self.at(t), len(self._surfaces.static))
        return len(self._planar_parts) > 0

    def delay_points(self, vertices: Sequence[FloatArray]) -> list[FloatArray]:
        """Selected images of the actors' `vertices`, which choose the knots; in the same reflectors throughout an
        interval."""
        every = [*self._surfaces.static_vertices, *vertices]
        few = [points[:: max(1, len(points) // IMAGE_SAMPLES)] for points in vertices]
        planar_parts = [self.planar_parts[number] for number in self._imaging]
        return [flat.image(every[flat.surface], points) for flat in planar_parts for points in few]

    @property
    def planar_parts(self) -> tuple[PlanarPart, ...]:
        """Planar parts of all surfaces, after :meth:`follow`."""
        return self._planar_parts or ()

    def at(self, t: float) -> tuple[PlanarReflector | None, ...]:
        """Reflectors at `t` [s]; None for parts that reflect nothing to the radar."""
        if t not in self._reflectors:
            count, moving = len(self._surfaces.static), self._positions(t)
            self._reflectors[t] = tuple(
                self._fixed[number] if flat.surface < count else flat.at(moving[flat.surface - count], self._viewpoint)
                for number, flat in enumerate(self.planar_parts)
            )
        return self._reflectors[t]

    def _mirrors(self, t: float) -> tuple[Mirror, ...]:
        """Reflectors at `t` [s], with empty ones in place of None."""
        return tuple(
            blind if reflector is None else reflector
            for reflector, blind in zip(self.at(t), self._no_reflectors, strict=True)
        )

    @cached_property
    def _no_reflectors(self) -> list[PlanarReflector]:
        up, none = np.array([0.0, 0.0, 1.0]), np.zeros(2)
        return [
            PlanarReflector(f.name, f.material, f.faces[:0], up, 0.0, np.eye(3)[:2], none, none, ())
            for f in self.planar_parts
        ]

    @cached_property
    def _fixed(self) -> list[PlanarReflector | None]:
        points, view = self._surfaces.static_vertices, self._viewpoint
        return [
            flat.at(points[flat.surface], view) if flat.surface < len(points) else None for flat in self.planar_parts
        ]

    @cached_property
    def owner(self) -> IntArray:
        """(face,) reflector of each face of the ray scene, -1 for none."""
        return face_owners(self.planar_parts, (*self._surfaces.static, *self._surfaces.moving))

    @cached_property
    def _wall(self) -> NDArray[np.bool_]:
        """(reflector,) whether it is a wall of traced ghosts."""
        of_walls = {int(number) for wall in self._walls() for number in wall.faces}
        return np.array([int(flat.faces[0]) in of_walls for flat in self.planar_parts], np.bool_)

    @cached_property
    def _stays(self) -> NDArray[np.bool_]:
        """(reflector,) whether it is at rest in the world."""
        every = (*self._surfaces.static, *self._surfaces.moving)
        return np.array([every[flat.surface].still for flat in self.planar_parts], np.bool_)

    @cached_property
    def _area(self) -> FloatArray:
        """(reflector,) [m^2]; `UNBOUNDED` for static parts, which have no facets to integrate."""
        fixed = len(self._surfaces.static)
        return np.array([UNBOUNDED if flat.surface < fixed else flat.area for flat in self.planar_parts])

    def trace_visibility(self, t: float, rays: RayScene, facets: Facets, fraction: FloatArray) -> ReflectionVisibility:
        """Footprints at `t` [s] on the facets, of which `fraction` (facet,) is directly visible."""
        wall, still = self._wall, self._stays
        vertices = [*self._surfaces.static_vertices, *self._positions(t)]
        given = self.at(t), self.owner, self._viewpoint, facets, self._radar.max_range
        clipper, visible = self._legs.clipper(rays, vertices, *given), self._legs.directly_visible(facets, fraction)
        own = self.owner[facets.number]
        unoccluded, once = {}, []
        for number, reflector in enumerate(self.at(t)):
            reached = clipper.candidates(number) if reflector is not None else np.zeros(0, np.intp)
            reached = reached[own[reached] != number]
            self._counts[number] = np.bincount(facets.surface[reached], minlength=self._counts.shape[1])
            if len(reached) == 0 or self._is_resting((number,), self._counts[number]):
                continue
            unoccluded[number] = reached
            if not wall[number]:
                chosen = reached[visible[reached] & (mirror_weights(self._area, own[reached], number, DIRECT) > 0)]
                once.append(clipper.clip_facets(self._strong(chosen, facets, number, DIRECT), number, DIRECT))
        twice = []
        if self._max_bounces > 2:
            across = self._partners(t)
            for number, first in unoccluded.items():
                for other, last in unoccluded.items():
                    walls = still[number] and still[other]
                    if other < number or (walls and (wall[number] or other not in across[number])):
                        continue
                    both = np.intersect1d(first, last, assume_unique=True)
                    found = clipper.clip_facets(self._strong(both, facets, number, other), number, other)
                    twice.append(found)
                    if other != number:
                        twice.append(found.swapped())
        sampled_facets = sum(len(each) for each in unoccluded.values())
        return ReflectionVisibility(
            self._legs.joined(once), self._legs.joined(twice), sampled_facets, clipper.sent, clipper.left
        )

    def _partners(self, t: float) -> list[set[int]]:
        """(reflector,) partners at rest in the world for two reflected legs: itself; for a moving radar also adjacent
        ones, and among wide ones all others."""
        found = [{number} for number in range(len(self.planar_parts))]
        if not self._still.any():
            return found
        for number, others in enumerate(self._adjacent):
            found[number] |= others
        scene = [points for points, still in zip(self._positions(t), self._still, strict=True) if still]
        radar = self._radar
        wide = wide_reflectors(self.planar_parts, self.at(t), scene, self._viewpoint, radar.wavelength, radar.max_range)
        for number in wide:
            found[number].update(wide)
        return found

    def _strong(self, index: NDArray[np.intp], facets: Facets, first: int, last: int) -> NDArray[np.intp]:
        """Facets `index` whose surface is not skipped by these reflectors."""
        surface = facets.surface[index]
        keys = [(int(last != DIRECT), number, first, last) for number in np.unique(surface).tolist()]
        resting = [key[1] for key in keys if self._is_resting(key, self._facets_reached(key))]
        return index[~np.isin(surface, resting)] if resting else index

    def _is_resting(self, key: tuple[int, ...], count: IntArray) -> bool:
        """Whether a reflector or group with `count` candidate facets is skipped."""
        rests = self._rests_until.get(key, -1) > self._interval and bool(
            (count <= WAKE_GROWTH * self._rested[key]).all()
        )
        if rests:
            self._skipped.add(key)
        return rests

    def _facets_reached(self, key: tuple[int, ...]) -> IntArray:
        """Candidate facets of a reflector, by surface, or of a group's reflectors."""
        if len(key) == 1:
            return self._counts[key[0]]
        return np.array([self._counts[reflector, key[1]] for reflector in key[2:] if reflector != DIRECT], np.int32)

    def trace(
        self,
        knots: FloatArray,
        sample_times: FloatArray,
        facets: Sequence[Facets],
        visible: Sequence[ReflectionVisibility],
        centroids: Centroids,
        reference_level: FloatArray,
    ) -> tuple[list[RadarPaths], float]:
        """Paths and their error, relative to the direct returns `reference_level` (surface,) or to their own. `facets`
        and `visible` are of each of the `sample_times` [s]; delays are for the `knots` [s]."""
        middle, paths, error, used = len(sample_times) // 2, [], 0.0, set[int]()
        reference_level = self._shared_levels(reference_level)
        weak, reference_level = self._weak(
            float(sample_times[middle]), facets[middle], visible[middle], reference_level
        )
        total, knot = np.zeros(1, np.complex128), int(np.abs(knots - sample_times[middle]).argmin())
        for way in LEG_COMBINATIONS:
            footprint_sets = [each.twice if all(way) else each.once for each in visible]
            keys = np.unique(np.concatenate([each.keys for each in footprint_sets]), axis=0)
            groups = _surface_and_reflectors(keys, facets[middle])
            keys = keys[[tuple(group) not in weak[all(way)] for group in groups.tolist()]]
            if len(keys) == 0:
                continue
            visible_facets = self._weighted_facets(facets, keys, footprint_sets, way == (False, True))
            used.update(keys[:, 1:3].ravel().tolist())
            ones = np.ones((len(sample_times), len(keys)))
            column = keys[:, 0].astype(np.intp)
            more, missed = self._returns(
                way, knots, sample_times, visible_facets, ones, column, centroids, reference_level
            )
            paths.append(more)
            error += missed
            total = total + self._edges.returned(more, facets[middle].surface[column], knot)
        self._returns.finish(error)
        self._interval += 1
        idle = [(number,) for number in range(len(self.planar_parts)) if number not in used]
        for key in (*idle, *((kind, *group) for kind, those in enumerate(weak) for group in those)):
            if key not in self._skipped:
                # Skips end in turns.
                self._rests_until[key] = self._interval + REST_INTERVALS + sum(key) % REST_INTERVALS
                self._rested[key] = self._facets_reached(key).copy()
        self._skipped.clear()
        # Finer facets do not reduce the error of the outlines.
        if paths:
            level = np.abs(total)
            np.maximum.at(level, tolerance_groups(self._surfaces.moving), reference_level)
            edge_error = self._edge_error(float(sample_times[middle]), facets[middle], visible[middle], weak)
            error = float(np.hypot(error, (edge_error / np.maximum(level, 1e-300)).max()))
        return paths, error

    def _edge_error(
        self,
        t: float,
        facets: Facets,
        visible: ReflectionVisibility,
        weak: _Groups,
    ) -> FloatArray:
        """(tolerance group,) diffraction error of the outlines at `t` [s]."""
        points = [*self._surfaces.static_vertices, *self._positions(t)]
        footprint_sets = []
        for footprints, those in zip((visible.once, visible.twice), weak, strict=True):
            groups = _surface_and_reflectors(footprints.keys, facets).tolist()
            strong = footprints.take(np.array([tuple(group) not in those for group in groups], np.bool_))
            footprint_sets.append((strong, visible.left(strong)))
        return self._edges(
            self.planar_parts, self.at(t), points, facets, self.owner[facets.number], self._area, footprint_sets
        )

    def _weighted_facets(
        self,
        facets: Sequence[Facets],
        keys: NDArray[np.int64],
        footprint_sets: Sequence[ClippedFootprints],
        swapped: bool,
    ) -> list[ReflectedFacets]:
        """Facets over time with mirror weights."""
        shares = mirror_weights(self._area, self.owner[facets[0].number[keys[:, 0]]], keys[:, 1], keys[:, 2])
        return [each.times(shares) for each in self._legs.over_time(facets, keys, footprint_sets, swapped)]

    def _shared_levels(self, reference_level: FloatArray) -> FloatArray:
        """(surface,) reference levels; of surfaces at rest in the world the strongest."""
        return np.where(self._still, reference_level[self._still].max(initial=0.0), reference_level)

    def _weak(
        self, t: float, facets: Facets, visible: ReflectionVisibility, reference_level: FloatArray
    ) -> tuple[_Groups, FloatArray]:
        """Negligible groups (surface, first, last) of `visible.once` and `visible.twice`, and the level of each
        surface's strongest return, direct or not."""
        found: list[tuple[NDArray[np.int64], FloatArray]] = []
        reference_level = reference_level.copy()
        for footprints, way in ((visible.once, (True, False)), (visible.twice, (True, True))):
            groups, index = np.unique(_surface_and_reflectors(footprints.keys, facets), axis=0, return_inverse=True)
            if len(groups) == 0:
                continue
            (visible_facets,) = self._weighted_facets([facets], footprints.keys, [footprints], False)
            coherent, single = self._returns.levels(way, t, visible_facets, index.reshape(-1), len(groups))
            np.maximum.at(reference_level, groups[:, 0], coherent)
            times = 1 if all(way) else 2  # both directions
            keys = np.column_stack([np.full(len(groups), all(way)), groups])
            found.append((keys, times * np.maximum(coherent, single)))
        reference_level = self._shared_levels(reference_level)
        weak: _Groups = (set(), set())
        if found:
            groups, levels = (np.concatenate([each[part] for each in found]) for part in (0, 1))
            # Surfaces at rest share one tolerance.
            tolerance_group = np.where(self._still, -1, np.arange(len(reference_level)))
            for each in np.unique(tolerance_group):
                index = np.flatnonzero(tolerance_group[groups[:, 1]] == each)
                index = index[np.argsort(levels[index], kind="stable")]
                level = reference_level[tolerance_group == each].max()
                for number in index[np.cumsum(levels[index]) <= OMITTED_SHARE * self._rtol * level]:
                    weak[groups[number, 0]].add(tuple(groups[number, 1:].tolist()))
        return weak, reference_level


def _surface_and_reflectors(keys: NDArray[np.int64], facets: Facets) -> NDArray[np.int64]:
    """(entry, 3) surface and reflectors of entries by their keys."""
    return np.column_stack([facets.surface[keys[:, 0]], keys[:, 1:3]]).astype(np.int64)
