"""Reflections within the static scene by its planar reflectors: room corners, shelves, table tops.

Relevant pairs and triples of surfaces are estimated before integration. Between planar surfaces the estimate is the
image of the image: Fresnel coefficients, spreading, size against the Fresnel zone, and distance of the reflection point
from the outline. A curved surface returns by a reflector as much as directly, at the image's distance.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import RadarPaths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.gains.band import BandTracer
from rfgen_sionna.tracing.gains.expansion import PROBES
from rfgen_sionna.tracing.ghosts.ghost_levels import GhostLevels, ghost_levels
from rfgen_sionna.tracing.ghosts.image_returns import LEG_COMBINATIONS, ImageReturns
from rfgen_sionna.tracing.reflectors.clipped_footprints import (
    DIRECT,
    ClippedFootprints,
    ReflectedFacets,
)
from rfgen_sionna.tracing.reflectors.corner_returns import CornerReturnEstimate
from rfgen_sionna.tracing.reflectors.edge_diffraction import EdgeDiffractionError
from rfgen_sionna.tracing.reflectors.footprint_clipper import FootprintClipper, FreeLegs
from rfgen_sionna.tracing.reflectors.planar_reflectors import (
    adjacent_parts,
    face_owners,
    find_planar_parts,
    mirror_weights,
    wide_reflectors,
)
from rfgen_sionna.tracing.static.actor_shadows import StaticIndirectPaths
from rfgen_sionna.tracing.static.static_facets import static_facets
from rfgen_sionna.tracing.static.static_trace import StaticTrace
from rfgen_sionna.tracing.surface.clip import triangle_areas
from rfgen_sionna.tracing.surface.facets import Facets, sum_by_surface
from rfgen_sionna.tracing.surface.surfaces import Surfaces

MIN_REFLECTOR_WIDTH = 1.0
"""Least width of a planar reflector [wavelengths]; narrower parts count as curved."""
OMITTED_SHARE = 0.5
"""Share of the tolerance below which a pair or triple of surfaces is left out."""
NEGLIGIBLE = 0.2
"""Share of the tolerance that the facets left out of the others may make up together."""


@dataclass(frozen=True)
class StaticReflections(StaticIndirectPaths):
    """Paths of two and three bounces within the static scene without actors, single knot."""

    footprint_sets: tuple[ClippedFootprints, ...]
    """Pieces of the paths, by leg combination."""
    clipper: FootprintClipper

    @cached_property
    def _pieces(self) -> ClippedFootprints:
        """All pieces; entries are paths."""
        return type(self.footprint_sets[0]).concatenate(self.footprint_sets)

    def visible(self, rays: RayScene, actors: Sequence[FloatArray]) -> tuple[FloatArray, int]:
        """(path,) visible share with the actors in `rays`, relative to the scene without them, and the number of rays
        sent. `actors` are the (vertex, 3) positions [m] of each."""
        found, pieces = np.ones(self.paths.num_paths), self._pieces
        near = self.clipper.near(pieces, actors)
        if len(near) == 0:
            return found, 0
        share, sent = self.clipper.resample(rays, pieces, near)
        size = triangle_areas(pieces.pieces)
        whole = np.bincount(pieces.owner, size * pieces.share, len(found))
        lost = np.bincount(pieces.owner[near], size[near] * (pieces.share[near] - share), len(found))
        found = 1.0 - lost / np.maximum(whole, 1e-300)
        return np.clip(found, 0.0, None), sent


class ReflectionSetup(NamedTuple):
    """Parts of the reflection trace that differ with and without slabs."""

    facets: Facets
    """Facets that face the radar, as candidates for one mirrored leg."""
    levels: FloatArray
    """(surface,) direct return of each."""
    legs: FreeLegs


def trace_static_reflections(
    surfaces: Surfaces,
    rays: RayScene,
    radar: Radar,
    band: BandTracer,
    static: StaticTrace,
    rtol: float,
    max_bounces: int,
    setup: ReflectionSetup | None = None,
) -> StaticReflections | None:
    """Paths of two bounces, and of three with `max_bounces` 3, within the static scene; None without any. `rays` holds
    static surfaces alone. `setup` None traces legs through free space."""
    setup = setup or ReflectionSetup(static.facets, static.levels, FreeLegs())
    view, facets = np.asarray(radar.position), setup.facets
    points = surfaces.static_vertices
    planar_parts = find_planar_parts(surfaces.static, points, [MIN_REFLECTOR_WIDTH * radar.wavelength] * len(points))
    reflectors = [flat.at(points[flat.surface], view) for flat in planar_parts]
    owner = face_owners(planar_parts, (*surfaces.static, *surfaces.moving))
    possible = [number for number, reflector in enumerate(reflectors) if reflector is not None]
    wide = wide_reflectors(planar_parts, reflectors, points, view, radar.wavelength, radar.max_range)
    if not possible or len(facets) == 0:
        return None
    allowed = OMITTED_SHARE * rtol * static.level
    own = owner[facets.number]
    order = np.argsort(own, kind="stable")
    starts = np.searchsorted(own[order], np.arange(-1, len(planar_parts) + 1))
    facets_of = [order[starts[f + 1] : starts[f + 2]] for f in range(len(planar_parts))]
    bent = order[starts[0] : starts[1]]
    levels = CornerReturnEstimate(reflectors, radar)
    mirrors = [reflector for m in wide if (reflector := reflectors[m]) is not None]
    curved_surfaces = [
        _CurvedSurface(
            number, setup.levels[number], ghost_levels(radar, band.pattern_gain, mirrors, points[number], max_bounces)
        )
        for number in np.unique(facets.surface[bent]).tolist()
    ]
    # Two mirrored legs reach the far side as well.
    by_two_mirrors = [each.number for each in curved_surfaces if each.by_two.max(initial=0.0) > allowed]
    if by_two_mirrors:
        around = static_facets(surfaces, band, view, static.tolerance, radar.max_range, by_two_mirrors)
        around = around.take(np.flatnonzero(owner[around.number] < 0))
        facets = Facets.joined([facets, around])
    every = np.arange(len(setup.facets), len(facets))
    clipper = setup.legs.clipper(rays, all_vertices(surfaces), reflectors, owner, view, facets, radar.max_range)

    @cache
    def unoccluded(mirror: int) -> NDArray[np.bool_]:
        """(facet,) whether each may be visible by the mirror."""
        found = np.zeros(len(facets), np.bool_)
        found[clipper.candidates(mirror)] = True
        return found

    def clip_facets(index: NDArray[np.intp], level: float, first: int, last: int) -> ClippedFootprints:
        """Footprints on the facets `index`, of about `level` by these reflectors, that are above the tolerance."""
        index = index[unoccluded(first)[index]]
        found = clipper.clip_facets(index if last == DIRECT else index[unoccluded(last)[index]], first, last)
        return found.take(level * clipper.left(found) > allowed)

    once: list[ClippedFootprints] = []
    twice: list[ClippedFootprints] = []
    area = np.array([flat.area for flat in planar_parts])
    present = np.array([f for f in possible if len(facets_of[f])], dtype=np.intp)
    for m in possible:
        others = present[(present != m) & (mirror_weights(area, present, m, DIRECT) > 0)]
        for f, level in _above(allowed, others, levels(others, m, DIRECT)):
            once.append(clip_facets(facets_of[f], level, m, DIRECT))
    if max_bounces > 2:
        # Two narrow reflectors matter where they are adjacent, as in corner reflectors.
        across = adjacent_parts(planar_parts, points)
        for m in wide:
            across[m].update(wide)
        for m in possible:
            for other in sorted(each for each in {m, *across[m]} if each >= m and reflectors[each] is not None):
                others = present[(present != m) & (present != other)]
                for f, level in _above(allowed, others, levels(others, m, other)):
                    found = clip_facets(facets_of[f], level, m, other)
                    twice += [found] if other == m else [found, found.swapped()]
    for each in curved_surfaces:
        index = bent[facets.surface[bent] == each.number]
        for m, level in zip(wide, each.by_one.tolist(), strict=True):
            if level > allowed:
                once.append(clip_facets(index, level, m, DIRECT))
        index = every[facets.surface[every] == each.number]
        for one, other in np.argwhere(each.by_two > allowed).tolist():
            found = clip_facets(index, each.by_two[one, other], wide[one], wide[other])
            twice += [found] if one == other else [found, found.swapped()]
    footprint_sets = setup.legs.joined(once), setup.legs.joined(twice)

    def weighted(footprints: ClippedFootprints, swapped: bool) -> ReflectedFacets:
        shares = mirror_weights(area, clipper.owner(footprints.facet), footprints.first, footprints.last)
        (found,) = setup.legs.over_time([facets], footprints.keys, [footprints], swapped)
        return found.times(shares)

    blank = next(each for each in reflectors if each is not None)
    every_mirror = tuple(reflector or blank for reflector in reflectors)
    names = surfaces.object_names, surfaces.part_names
    returns = ImageReturns(surfaces.static, names, radar, rtol, lambda _: every_mirror, setup.legs.band)
    least = NEGLIGIBLE * rtol * static.level
    footprint_sets, omitted = _cull_weak(weighted, facets, returns, clipper, footprint_sets, least)
    # The static scene is one tolerance group.
    materials = [each.material for each in surfaces.static]
    edges = EdgeDiffractionError(radar, materials, np.zeros(len(materials), np.int32))
    reference_level, now, paths, used = np.full(len(materials), static.level), np.zeros(1), [], []
    error, total = omitted / max(static.level, 1e-300), np.zeros(1, np.complex128)
    for way in LEG_COMBINATIONS:
        footprints = footprint_sets[1] if all(way) else footprint_sets[0]
        if len(footprints.facet) == 0:
            continue
        visible = weighted(footprints, way == (False, True))
        found_paths, missed = returns(
            way, now, now, [visible], np.ones((1, len(visible))), footprints.facet,
            lambda _, chosen: facets.centroids[chosen], reference_level,
        )  # fmt: skip
        paths.append(found_paths)
        used.append(footprints)
        error += missed
        total += edges.returned(found_paths, visible.surface)
    if not paths:
        return None
    level = max(static.level, float(np.abs(total[0])), 1e-300)
    left = [(footprints, clipper.left(footprints)) for footprints in footprint_sets]
    off = edges(planar_parts, reflectors, points, facets, owner[facets.number], area, left)[0]
    error = float(np.hypot(error, off / level))
    return StaticReflections(RadarPaths.concatenate(paths), error, clipper.sent, tuple(used), clipper)


def all_vertices(surfaces: Surfaces) -> list[FloatArray]:
    """(vertex, 3) of all surfaces [m]; moving ones are not in the static ray scene and get placeholders."""
    moving = [np.zeros((int(each.faces.max()) + 1, 3)) for each in surfaces.moving]
    return [*surfaces.static_vertices, *moving]


class _CurvedSurface(NamedTuple):
    """A curved surface and its ghosts' levels."""

    number: int
    level: float
    """Its direct return."""
    ghosts: GhostLevels
    """Relative to that."""

    @property
    def by_one(self) -> FloatArray:
        """(mirror,) levels with one mirrored leg, both directions."""
        return self.level * self.ghosts.single[:, 0]

    @property
    def by_two(self) -> FloatArray:
        """(mirror, mirror) levels with two mirrored legs, by the same mirror on the diagonal."""
        return self.level * (np.diag(self.ghosts.single[:, 1]) + self.ghosts.across)


def _above(allowed: float, planar_parts: NDArray[np.intp], levels: FloatArray) -> list[tuple[int, float]]:
    """Planar parts that return more than `allowed`, with their levels."""
    strong = levels > allowed
    return list(zip(planar_parts[strong].tolist(), levels[strong].tolist(), strict=True))


def _cull_weak(
    weighted: Callable[[ClippedFootprints, bool], ReflectedFacets],
    facets: Facets,
    returns: ImageReturns,
    clipper: FootprintClipper,
    footprint_sets: tuple[ClippedFootprints, ClippedFootprints],
    allowed: float,
) -> tuple[tuple[ClippedFootprints, ClippedFootprints], float]:
    """The `footprint_sets` by one and by two reflectors, without the entries that together return at most `allowed`,
    and the sum left out: the energy sum, or the coherent sum of one planar part by the same reflectors where that is
    larger."""
    waves, kinds, keys = [], [], []
    for number, (footprints, ways) in enumerate(
        zip(footprint_sets, (LEG_COMBINATIONS[:2], LEG_COMBINATIONS[2:]), strict=True)
    ):
        if len(footprints.facet):
            # With one mirrored leg both directions count.
            each = [returns.estimate(way, 0.0, weighted(footprints, way == (False, True)), PROBES) for way in ways]
            waves.append(np.sum(each, axis=0))
            kinds.append(np.full(len(footprints.facet), number))
            own = facets.surface[footprints.facet], clipper.owner(footprints.facet)
            keys.append(np.stack([kinds[-1], *own, footprints.first, footprints.last]))
    if not waves:
        return footprint_sets, 0.0
    wave, kind = np.concatenate(waves, axis=1), np.concatenate(kinds)
    group = np.unique(np.concatenate(keys, axis=1), axis=1, return_inverse=True)[1].reshape(-1).astype(np.int32)
    energy, size = (np.abs(wave) ** 2).mean(axis=0), int(group.max()) + 1
    order, missed = np.argsort(energy), 0.0
    while len(order):
        left = order[: int(np.searchsorted(np.cumsum(energy[order]), allowed**2))]
        single = np.bincount(group[left], energy[left], size)
        in_phase = (np.abs(sum_by_surface(wave[:, left], group[left], size)) ** 2).mean(axis=0)
        missed = float(np.sqrt(np.maximum(single, in_phase).sum()))
        if missed <= allowed:
            break
        # The strongest coherent groups stay whole.
        more = in_phase - single
        order = order[(more < 0.5 * more.max())[group[order]]]
        left = order[:0]
    kept = np.ones(len(kind), np.bool_)
    kept[left] = False
    once, twice = (
        footprints.take(kept[kind == number]) if len(footprints.facet) else footprints
        for number, footprints in enumerate(footprint_sets)
    )
    return (once, twice), missed if len(left) else 0.0
