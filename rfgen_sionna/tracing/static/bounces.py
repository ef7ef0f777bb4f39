"""What the static scene's flat parts show of one another and of the furniture: room corners, shelves, table tops.

Which pairs and triples of surfaces count is estimated before anything is integrated. Between flat parts it is the image
of the image: Fresnel coefficients, spreading, the size of the plate against the Fresnel zone, and how far beside the
plates' outlines the point of reflection lies, where only a wave from the rim is left. What is bent returns by way of a
plate as much as it does directly, at the image's distance.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import RadarPaths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.bounces.landing import DIRECT, LandedFacets, Landing, LandingBand, joined
from rfgen_sionna.tracing.bounces.mirror_edges import MirrorEdges
from rfgen_sionna.tracing.bounces.plate_images import PlateImages
from rfgen_sionna.tracing.bounces.plates import Plate, find_flats, meeting, wide_plates
from rfgen_sionna.tracing.bounces.roles import role_shares
from rfgen_sionna.tracing.bounces.shower import Shower
from rfgen_sionna.tracing.gains.band import BandTracer
from rfgen_sionna.tracing.gains.probes import PROBES
from rfgen_sionna.tracing.ghosts.image_band import ImageBand
from rfgen_sionna.tracing.ghosts.image_returns import WAYS, ImageReturns
from rfgen_sionna.tracing.ghosts.levels import GhostLevels, ghost_levels
from rfgen_sionna.tracing.ghosts.mirrors import Mirror
from rfgen_sionna.tracing.static.facets import static_facets
from rfgen_sionna.tracing.static.shadows import Shadow, cast
from rfgen_sionna.tracing.static.trace import StaticTrace
from rfgen_sionna.tracing.surface.clip import areas
from rfgen_sionna.tracing.surface.facets import Facets, sums
from rfgen_sionna.tracing.surface.surfaces import Surfaces

PLATE = 1.0
"""How many wavelengths a flat part that others show is wide at least; narrower ones count as bent."""
SKIPPED = 0.5
"""Share of the tolerance that each of the pairs and triples of surfaces that are left out may make up."""
FAINT = 0.2
"""Share of the tolerance that all the facets may make up that are left out of the others."""


@dataclass(frozen=True)
class StaticBounces:
    """Paths of two and three bounces within the static scene without actors, a single knot."""

    paths: RadarPaths
    error: float
    """Relative to what the error of :class:`~rfgen_sionna.tracing.static.trace.StaticTrace` is relative to."""
    rays: int
    landings: tuple[Landing, ...]
    """Pieces of the paths, way by way."""
    shower: Shower

    @cached_property
    def _pieces(self) -> Landing:
        return self._all_pieces()

    def _all_pieces(self) -> Landing:
        """All pieces, `owner` being the path."""
        firsts = np.cumsum([0] + [len(each.facet) for each in self.landings])
        return Landing(
            np.concatenate([each.facet for each in self.landings]),
            np.concatenate([each.first for each in self.landings]),
            np.concatenate([each.last for each in self.landings]),
            np.concatenate([each.pieces for each in self.landings]),
            np.concatenate([each.owner + first for each, first in zip(self.landings, firsts, strict=False)]),
            np.concatenate([each.share for each in self.landings]),
        )

    def visible(self, rays: RayScene, actors: Sequence[FloatArray]) -> tuple[FloatArray, int]:
        """(path,) what is left of each with the actors where `rays` has them, against what there is without; and the
        number of rays sent. `actors` are the (vertex, 3) positions [m] of each."""
        found, pieces = np.ones(self.paths.num_paths), self._pieces
        near = self.shower.near(pieces, actors)
        if len(near) == 0:
            return found, 0
        share, sent = self.shower.again(rays, pieces, near)
        size = areas(pieces.pieces)
        whole = np.bincount(pieces.owner, size * pieces.share, len(found))
        lost = np.bincount(pieces.owner[near], size[near] * (pieces.share[near] - share), len(found))
        found = 1.0 - lost / np.maximum(whole, 1e-300)
        return np.clip(found, 0.0, None), sent

    def shadows(self, knots: FloatArray, fraction: FloatArray) -> tuple[Shadow, Shadow]:
        """As :meth:`rfgen_sionna.tracing.static.trace.StaticTrace.shadows`, for (path, time) of :meth:`visible`."""
        return cast(self.paths, fraction, knots)


@dataclass(frozen=True)
class Showing:
    """What plates may show, and how; that is another thing where slabs are seen through."""

    facets: Facets
    """What the radar sees directly, and may see by one plate as well."""
    levels: FloatArray
    """(surface,) what each of the bent ones returns directly."""
    shower: Callable[[Sequence[Plate | None], IntArray, Facets], Shower]
    """Made for the plates, the number of the plate of each face of the ray scene, and what is looked at."""
    band: Callable[[Radar, float, Sequence[Mirror], bool, bool], ImageBand]
    joined: Callable[[Sequence[Landing]], Landing]
    landed: Callable[[Facets, Landing, bool], LandedFacets]
    """All entries, the ways swapped or not, of what was looked at."""
    made: Callable[[RadarPaths, float, int, tuple[Landing, ...], Shower], StaticBounces]


def trace_static_bounces(
    surfaces: Surfaces, rays: RayScene, radar: Radar, band: BandTracer, static: StaticTrace, rtol: float, most: int
) -> StaticBounces | None:
    """Paths of two, and with `most` of 3 of three, bounces within the static scene, of which `rays` holds nothing else;
    None where there are none."""
    view = np.asarray(radar.position)

    def shower(plates: Sequence[Plate | None], owner: IntArray, facets: Facets) -> Shower:
        return Shower(rays, plates, owner, view, facets, radar.max_range)

    def landed(facets: Facets, landing: Landing, swapped: bool) -> LandedFacets:
        return LandedFacets.landed(facets, landing.keys, landing, swapped)

    showing = Showing(static.facets, static.levels, shower, LandingBand, joined, landed, StaticBounces)
    return trace_shown(showing, surfaces, radar, band, static, rtol, most)


def trace_shown(
    showing: Showing, surfaces: Surfaces, radar: Radar, band: BandTracer, static: StaticTrace, rtol: float, most: int
) -> StaticBounces | None:
    """As :func:`trace_static_bounces`, of what is shown."""
    view, facets = np.asarray(radar.position), showing.facets
    points = surfaces.static_vertices
    flats = find_flats(surfaces.static, points, [PLATE * radar.wavelength] * len(points))
    plates = [flat.at(points[flat.surface], view) for flat in flats]
    owner = np.full(sum(len(each.faces) for each in (*surfaces.static, *surfaces.moving)), -1, np.int32)
    for number, flat in enumerate(flats):
        owner[flat.faces] = number
    possible = [number for number, plate in enumerate(plates) if plate is not None]
    wide = wide_plates(flats, plates, points, view, radar.wavelength, radar.max_range)
    if not possible or len(facets) == 0:
        return None
    allowed = SKIPPED * rtol * static.level
    own = owner[facets.number]
    order = np.argsort(own, kind="stable")
    starts = np.searchsorted(own[order], np.arange(-1, len(flats) + 1))
    of_flat = [order[starts[f + 1] : starts[f + 2]] for f in range(len(flats))]
    bent = order[starts[0] : starts[1]]
    levels = PlateImages(plates, radar)
    mirrors = [plate for m in wide if (plate := plates[m]) is not None]
    round_ones = [
        _Round(number, showing.levels[number], ghost_levels(radar, band.importance, mirrors, points[number], most))
        for number in np.unique(facets.surface[bent]).tolist()
    ]
    # By two plates they are seen from elsewhere: their far side, too.
    twice_shown = [each.number for each in round_ones if each.by_two.max(initial=0.0) > allowed]
    if twice_shown:
        around = static_facets(surfaces, band, view, static.tolerance, radar.max_range, twice_shown)
        around = around.take(np.flatnonzero(owner[around.number] < 0))
        facets = Facets.joined([facets, around])
    every = np.arange(len(showing.facets), len(facets))
    shower = showing.shower(plates, owner, facets)

    @cache
    def lit(mirror: int) -> NDArray[np.bool_]:
        """(facet,) whether the mirror may show each."""
        found = np.zeros(len(facets), np.bool_)
        found[shower.candidates(mirror)] = True
        return found

    def land(index: NDArray[np.intp], level: float, first: int, last: int) -> Landing:
        """Of the facets `index`, which return about `level` by these plates, those of which enough is left."""
        index = index[lit(first)[index]]
        found = shower.land(index if last == DIRECT else index[lit(last)[index]], first, last)
        return found.take(level * shower.left(found) > allowed)

    once: list[Landing] = []
    twice: list[Landing] = []
    area = np.array([flat.area for flat in flats])
    present = np.array([f for f in possible if len(of_flat[f])], dtype=np.intp)
    for m in possible:
        others = present[(present != m) & (role_shares(area, present, m, DIRECT) > 0)]
        for f, level in _above(allowed, others, levels(others, m, DIRECT)):
            once.append(land(of_flat[f], level, m, DIRECT))
    if most > 2:
        # By way of two narrow plates these matter in corner reflectors, where they meet.
        across = meeting(flats, points)
        for m in wide:
            across[m].update(wide)
        for m in possible:
            for other in sorted(each for each in {m, *across[m]} if each >= m and plates[each] is not None):
                others = present[(present != m) & (present != other)]
                for f, level in _above(allowed, others, levels(others, m, other)):
                    found = land(of_flat[f], level, m, other)
                    twice += [found] if other == m else [found, found.swapped()]
    for each in round_ones:
        index = bent[facets.surface[bent] == each.number]
        for m, level in zip(wide, each.by_one.tolist(), strict=True):
            if level > allowed:
                once.append(land(index, level, m, DIRECT))
        index = every[facets.surface[every] == each.number]
        for one, other in np.argwhere(each.by_two > allowed).tolist():
            found = land(index, each.by_two[one, other], wide[one], wide[other])
            twice += [found] if one == other else [found, found.swapped()]
    landings = showing.joined(once), showing.joined(twice)

    def counted(facets: Facets, landing: Landing, swapped: bool) -> LandedFacets:
        shares = role_shares(area, shower.owner(landing.facet), landing.first, landing.last)
        return showing.landed(facets, landing, swapped).times(shares)

    def beside(landings: Sequence[Landing], edges: MirrorEdges) -> FloatArray:
        left = [(landing, shower.left(landing)) for landing in landings]
        return edges(flats, plates, points, facets, owner[facets.number], area, left)

    return _integrated(
        replace(showing, landed=counted), facets, surfaces, radar, static, rtol, shower, plates, landings, beside
    )


class _Round(NamedTuple):
    """A surface that is bent, and what mirrors show of it."""

    number: int
    level: float
    """What it returns directly."""
    ghosts: GhostLevels
    """Relative to that."""

    @property
    def by_one(self) -> FloatArray:
        """(mirror,) levels of both ways round."""
        return self.level * self.ghosts.alone[:, 0]

    @property
    def by_two(self) -> FloatArray:
        """(mirror, mirror) levels by the same mirror there and back, and by two."""
        return self.level * (np.diag(self.ghosts.alone[:, 1]) + self.ghosts.across)


def _above(allowed: float, flats: NDArray[np.intp], levels: FloatArray) -> list[tuple[int, float]]:
    """Those of the flat parts that return more than is `allowed`, with their levels."""
    strong = levels > allowed
    return list(zip(flats[strong].tolist(), levels[strong].tolist(), strict=True))


def _integrated(
    showing: Showing,
    facets: Facets,
    surfaces: Surfaces,
    radar: Radar,
    static: StaticTrace,
    rtol: float,
    shower: Shower,
    plates: Sequence[Plate | None],
    landings: tuple[Landing, Landing],
    beside: Callable[[Sequence[Landing], MirrorEdges], FloatArray],
) -> StaticBounces | None:
    mirrors = tuple(plate or next(each for each in plates if each is not None) for plate in plates)
    names = surfaces.object_names, surfaces.part_names
    returns = ImageReturns(surfaces.static, names, radar, rtol, lambda _: mirrors, showing.band)
    usual, now = np.full(len(surfaces.static), static.level), np.zeros(1)
    landings, error = _without_faint(showing, facets, returns, shower, landings, FAINT * rtol * static.level)
    paths, error, used = [], error / max(static.level, 1e-300), []
    # All that stays returns together.
    edges = MirrorEdges(radar, [each.material for each in surfaces.static], np.zeros(len(usual), np.int32))
    total = np.zeros(1, np.complex128)
    for way in WAYS:
        landing = landings[1] if all(way) else landings[0]
        if len(landing.facet) == 0:
            continue
        shown = showing.landed(facets, landing, way == (False, True))

        def centroids(_: float, chosen: NDArray[np.intp]) -> FloatArray:
            return facets.centroids[chosen]

        found, missed = returns(way, now, now, [shown], np.ones((1, len(shown))), landing.facet, centroids, usual)
        paths.append(found)
        used.append(landing)
        error += missed
        total += edges.returned(found, shown.surface)
    if not paths:
        return None
    level = max(static.level, float(np.abs(total[0])), 1e-300)
    error = float(np.hypot(error, beside(landings, edges)[0] / level))
    return showing.made(RadarPaths.concatenate(paths), error, shower.sent, tuple(used), shower)


def _without_faint(
    showing: Showing,
    facets: Facets,
    returns: ImageReturns,
    shower: Shower,
    landings: tuple[Landing, Landing],
    allowed: float,
) -> tuple[tuple[Landing, Landing], float]:
    """The `landings` by one plate and by two without those entries that all together return no more than is `allowed`,
    and what they return: one by one, and those of one flat part by the same plates in phase, whichever is more, as the
    faces of a fine mesh are faint only by themselves."""
    waves, kinds, keys = [], [], []
    for number, (landing, ways) in enumerate(zip(landings, (WAYS[:2], WAYS[2:]), strict=True)):
        if len(landing.facet):
            # What goes by one plate does both ways round, either of which counts: Tx and Rx may be changed over.
            each = [
                returns.roughly(way, 0.0, showing.landed(facets, landing, way == (False, True)), PROBES) for way in ways
            ]
            waves.append(np.sum(each, axis=0))
            kinds.append(np.full(len(landing.facet), number))
            own = facets.surface[landing.facet], shower.owner(landing.facet)
            keys.append(np.stack([kinds[-1], *own, landing.first, landing.last]))
    if not waves:
        return landings, 0.0
    wave, kind = np.concatenate(waves, axis=1), np.concatenate(kinds)
    group = _numbered(np.concatenate(keys, axis=1))
    energy, size = (np.abs(wave) ** 2).mean(axis=0), int(group.max()) + 1
    order, missed = np.argsort(energy), 0.0
    while len(order):
        left = order[: int(np.searchsorted(np.cumsum(energy[order]), allowed**2))]
        single = np.bincount(group[left], energy[left], size)
        in_phase = (np.abs(sums(wave[:, left], group[left], size)) ** 2).mean(axis=0)
        missed = float(np.sqrt(np.maximum(single, in_phase).sum()))
        if missed <= allowed:
            break
        # Of those that return in phase the strongest stay as a whole.
        more = in_phase - single
        order = order[(more < 0.5 * more.max())[group[order]]]
        left = order[:0]
    kept = np.ones(len(kind), np.bool_)
    kept[left] = False
    once, twice = (
        landing.take(kept[kind == number]) if len(landing.facet) else landing for number, landing in enumerate(landings)
    )
    return (once, twice), missed if len(left) else 0.0


def _numbered(rows: NDArray[np.integer[Any]]) -> IntArray:
    """(column,) number of each of the columns of `rows` (row, column), the same of those alike."""
    found = np.zeros(rows.shape[1], np.int64)
    for row in rows:
        _, found = np.unique(found * (int(row.max()) + 2) + row + 1, return_inverse=True)
    return found.astype(np.int32)
