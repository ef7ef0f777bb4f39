"""What the radar sees of moving facets at an instant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.records import SPEED_OF_LIGHT, FloatArray, IntArray
from rfgen_sionna.scene.looks import Looks
from rfgen_sionna.scene.mesh import lengths, middles, widest
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.facets import Facets
from rfgen_sionna.tracing.gains import BandTracer
from rfgen_sionna.tracing.outlines import APART, STILL_APART, Outline, Passing, Places
from rfgen_sionna.tracing.sampling import Corners, sampled_fraction
from rfgen_sionna.tracing.surfaces import Surfaces

NEAREST_APART = 2.5e-4
"""Least angle between rays past one edge [rad]."""
_PER_FACET, _SMALL = 0.3, 0.1
"""Angle between them at a tolerance of 1 %, over the width of facets such that smaller ones make up so small a share of
the view."""


@dataclass(frozen=True)
class Seen:
    """Facets at an instant and how much of them is seen."""

    facets: Facets
    fraction: FloatArray
    """(facet,) share of the area."""
    weight: FloatArray
    """(facet,) the antennas' two-way field gain towards each, over the largest; 0 for those that were not looked at, as
    they look away or are too far."""
    owner: NDArray[np.intp]
    """(piece,) facet that a piece is of: what is seen of those hidden in part."""
    pieces: FloatArray
    """(piece, corner, 3) barycentric coordinates of its corners."""
    outline: FloatArray
    """(facet,) length of outlines that fall on each [rad], as rays' points tell."""
    level: FloatArray
    """(surface,) what its facets may return without interfering, in units of
    :attr:`rfgen_sionna.tracing.sampling.Sampled.returned`."""
    missed: FloatArray
    """(surface,) estimated error of what its facets return for what is not known of shadows' edges, relative to what
    they return without interfering."""
    looked_at: int
    rays: int

    def of(self, chosen: NDArray[np.intp]) -> Seen:
        """The facets that `chosen` counts out, in ascending order."""
        place = np.minimum(np.searchsorted(chosen, self.owner), max(len(chosen) - 1, 0))
        mine = chosen[place] == self.owner if len(chosen) else np.zeros(len(self.owner), np.bool_)
        return replace(
            self,
            facets=self.facets.take(chosen),
            fraction=self.fraction[chosen],
            weight=self.weight[chosen],
            owner=place[mine],
            pieces=self.pieces[mine],
            outline=self.outline[chosen],
        )

    @staticmethod
    def joined(parts: Sequence[Seen]) -> Seen:
        """One after the other; of `level` and `missed` the least and the largest."""
        first = np.cumsum([0, *(len(each.fraction) for each in parts)])
        fraction, weight, pieces, outline = (
            np.concatenate([getattr(each, name) for each in parts])
            for name in ("fraction", "weight", "pieces", "outline")
        )
        return Seen(
            Facets.joined([each.facets for each in parts]),
            fraction,
            weight,
            np.concatenate([each.owner + start for each, start in zip(parts, first[:-1], strict=True)]),
            pieces,
            outline,
            np.min([each.level for each in parts], axis=0),
            np.max([each.missed for each in parts], axis=0),
            sum(each.looked_at for each in parts),
            sum(each.rays for each in parts),
        )


class Sight:
    """Looks at moving surfaces from one place, as far as the range window."""

    def __init__(
        self, surfaces: Surfaces, band: BandTracer, viewpoint: FloatArray, max_range: float, rtol: float
    ) -> None:
        self._surfaces, self._viewpoint, self._max_range, self._rtol = surfaces, viewpoint, max_range, rtol
        self._wavenumber = 2 * np.pi * band.highest / SPEED_OF_LIGHT
        self._importance = band.importance
        self._outlines = [Outline(surface.faces) for surface in surfaces.moving]
        self._latest: tuple[Sequence[FloatArray], Passing] | None = None
        self._apart = APART
        self._static: tuple[FloatArray, FloatArray, FloatArray] | None = None

    def __call__(self, rays: RayScene, facets: Facets, places: IntArray, vertices: Sequence[FloatArray]) -> Seen:
        """What is seen of `facets`, all those of the moving surfaces, which have their `vertices` (vertex, 3) [m] there
        and in `rays`; `places` are those of :func:`rfgen_sionna.tracing.sampling.touching`."""
        near = lengths(facets.centroids - self._viewpoint) < self._max_range
        facing = np.flatnonzero(facets.facing & near)
        passing = self.passing(rays, vertices)
        outline = np.zeros(len(facets))
        corners = np.take(facets.corners, facing, axis=0) - self._viewpoint
        outline[facing] = Places(corners, facets.number[facing]).holding(passing)
        found = self._sampled(rays, facets, facets.number, facing, places, outline, 0.0)
        return replace(found, rays=found.rays + len(passing.hit))

    def glance(self, looks: Looks, facets: Facets, places: IntArray, outline: FloatArray, level: FloatArray) -> Seen:
        """What is seen at several times of some facets, all of which face the radar: `places` (facet, 3), so much
        `outline` (facet,) [rad] falls on each, and `level` (surface,) is that of all facets. `facets` are those of one
        time after the other, and so is what is seen; of its `level` and `missed` the least and the largest count."""
        near = np.flatnonzero(lengths(facets.centroids - self._viewpoint) < self._max_range)
        times, surfaces = len(facets) // len(outline), len(self._surfaces.moving)
        time = np.arange(times, dtype=np.int32)[:, None]
        own, local = np.unique(places, return_inverse=True)
        every = (local.ravel().astype(np.int32) + np.int32(len(own)) * time).reshape(-1, 3)
        apart = replace(facets, surface=facets.surface + surfaces * np.repeat(time, len(outline)))
        number = looks.numbered(facets.number[: len(outline)], times)
        found = self._sampled(looks, apart, number, near, every, np.tile(outline, times), np.tile(level, times))
        low, high = (each.reshape(times, surfaces) for each in (found.level, found.missed))
        return replace(found, facets=facets, level=low.min(axis=0), missed=high.max(axis=0))

    def _sampled(
        self,
        rays: RayScene | Looks,
        facets: Facets,
        numbers: IntArray | NDArray[np.int64],
        facing: NDArray[np.intp],
        places: IntArray,
        outline: FloatArray,
        least: FloatArray | float,
    ) -> Seen:
        """What is seen of `facets`, of those that are `facing` the radar and that `rays` know by their `numbers`."""
        fraction, weights = np.zeros((2, len(facets)))
        corners, number = np.take(facets.corners, facing, axis=0), numbers[facing]
        surface = facets.surface[facing]
        count = len(self._surfaces.moving) if np.ndim(least) == 0 else len(np.asarray(least))
        weight = self._importance(facets.directions(self._viewpoint, facing))
        guided, guides = Corners(self._viewpoint, corners, number, places[facing]).seen(rays)
        found = sampled_fraction(
            rays,
            self._viewpoint,
            corners,
            number,
            guided,
            self._wavenumber,
            self._rtol,
            outline[facing],
            weight,
            surface,
            level=least,
            times=max(1, count // max(1, len(self._surfaces.moving))),
        )
        fraction[facing], weights[facing] = found.fraction, weight
        error, level = (np.sqrt(np.bincount(surface, each**2, count)) for each in (found.missed, found.returned))
        missed = np.where(level > 0, error / np.where(level > 0, level, 1.0), 0.0)
        owner, sent = facing[found.owner], guides + found.rays
        return Seen(facets, fraction, weights, owner, found.pieces, outline, level, missed, len(facing), sent)

    def look_for(self, corners: Sequence[FloatArray]) -> None:
        """Let rays past outlines find light on the facets with `corners` (facet, 3, 3) [m], those of each surface."""
        apart = apart_for(corners, self._viewpoint, self._rtol)
        if apart != self._apart:
            self._apart, self._latest, self._static = apart, None, None

    def passing(self, rays: RayScene, vertices: Sequence[FloatArray]) -> Passing:
        """Rays that just pass the outlines of what moves, with its `vertices` (vertex, 3) [m] there and in `rays`, and
        of what stands before it."""
        if self._latest is None or self._latest[0] is not vertices:
            self._latest = vertices, self._past(rays, vertices)
        return self._latest[1]

    def _past(self, rays: RayScene, vertices: Sequence[FloatArray]) -> Passing:
        offsets = [points - self._viewpoint for points in vertices]
        passing = [outline.passing(each, self._apart) for outline, each in zip(self._outlines, offsets, strict=True)]
        if self._static is None:
            # Directions (ray, 3) as long as the way there (ray,) [m], and what each stands for.
            past, stands_for = static_outlines(self._surfaces, self._viewpoint, self._apart)
            self._static = past, stands_for, lengths(past)
        static, span, distance = self._static
        before = np.zeros(len(static), np.bool_)
        for each in offsets:
            far = np.maximum(lengths(each), 1e-12)
            axis = (each / far[:, None]).mean(axis=0)
            axis /= max(float(np.linalg.norm(axis)), 1e-12)
            opening = float((each @ axis / far).min())
            before |= (static @ axis > (opening - 1e-3) * distance) & (distance < far.max())
        found = [(static[before], span[before]), *passing]
        directions, spans = (np.concatenate(each) for each in zip(*found, strict=True))
        hit = rays.first_facet(self._viewpoint, directions)
        return Passing(directions, hit, spans, int(np.count_nonzero(before)))


def static_outlines(
    surfaces: Surfaces, viewpoint: FloatArray, apart: float = STILL_APART
) -> tuple[FloatArray, FloatArray]:
    """Directions (ray, 3) that just pass the outlines of what stays, as long as the way there [m], and the length of
    outline (ray,) [rad] that each stands for, `apart` at most."""
    placed = zip(surfaces.static, surfaces.static_vertices, strict=True)
    found = [Outline(surface.faces).passing(points - viewpoint, apart) for surface, points in placed]
    rays, span = (np.concatenate(each) for each in zip((np.zeros((0, 3)), np.zeros(0)), *found, strict=True))
    return rays, span


def apart_for(corners: Sequence[FloatArray], viewpoint: FloatArray, rtol: float) -> float:
    """Angle [rad] between rays past an edge, so close that few of the facets with `corners` (facet, 3, 3) [m], those of
    each surface, lie between two of them: where light through a gap crosses a facet and reaches no corner, such a ray
    alone tells."""
    apart = APART
    for each in corners:
        if not len(each):
            continue
        edges = each - each[:, [1, 2, 0]]
        away = np.maximum(lengths(middles(each) - viewpoint), 1e-9)
        size, area = widest(lengths(edges)) / away, lengths(np.cross(edges[:, 0], edges[:, 1])) / away**2
        order = np.argsort(size)
        share = np.cumsum(area[order])
        typical = float(size[order[np.searchsorted(share, _SMALL * share[-1])]])
        # What lies between two rays goes with the square of their distance.
        apart = min(apart, max(_PER_FACET * typical * np.sqrt(rtol / 1e-2), NEAREST_APART))
    return float(apart)
