"""Shooting and bouncing rays: tubes of rays leave the radar, are reflected or go through slabs, and land as paths.

A second opinion for tests and benchmarks. It shares the scene, the materials, the closed-form means over triangles, the
smooth surface under a mesh, waves by way of bent mirrors and the rule which of two flat parts is the mirror with the
facet tracer: neither facets nor visibility nor expansions. It has more bounces by bent surfaces than the facet tracer,
and integrates where that takes geometrical optics.

==============  =====================================================================================================
module          what
==============  =====================================================================================================
`lattice`       directions as whole numbers on an octahedron, so that neighbours share rays
`skin`          where rays meet the smooth surface under a mesh
`hits`          rays followed from hit to hit, each traced once
`sampling`      where more rays go: the tubes, cut where what they hit changes
`terminator`          where one thing ends before another: shadows' edges
`boundary_correction`      what pairs of elements see otherwise beside these than the phase centre
`media`         transmission through slabs, in NumPy
`passage`       field and path length from an element to a point by way of bent mirrors and slabs
`footprints`    integrals over where tubes land, for every element pair over the band
`memory`        room for uniform tubes
`paths`         footprints as paths
`shoot`         all of it
==============  =====================================================================================================
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import ComplexArray, FloatArray
from rfgen_sionna.parallel import one_blas_thread
from rfgen_sionna.radar.profile import is_number
from rfgen_sionna.records import RadarPaths
from rfgen_sionna.tracing.curved.array_elements import ArrayElements, band_nodes, fit_over_band
from rfgen_sionna.tracing.integral.propagation import phasors
from rfgen_sionna.tracing.relative_scene import to_world
from rfgen_sionna.tracing.routes.planar_parts import mirror_weight
from rfgen_sionna.tracing.tracer import Tracer
from rfgen_sionna.tracing.visibility.slab_layers import MAX_SLABS
from tests.reference.sbr import lattice
from tests.reference.sbr.footprints import integrate, landed
from tests.reference.sbr.guides import Marks
from tests.reference.sbr.hits import Hits, Index, Setting
from tests.reference.sbr.media import SlabOptics
from tests.reference.sbr.memory import GAIN_BYTES, TUBE_BYTES, check_memory
from tests.reference.sbr.parallax import correction, doubts
from tests.reference.sbr.paths import Scenery, ends
from tests.reference.sbr.rims import Rims
from tests.reference.sbr.sampling import Pieces, Sampler
from tests.reference.sbr.skin import RaySkin

Sampling = Literal["adaptive", "uniform"]
MOST_BOUNCES = 6
"""Surfaces on the longest paths."""
GUIDES = 3
"""Level of the guiding tubes: every right angle in 2^3."""
LOOSEST = 0.03
"""Largest tolerance: with fewer rays their errors are not those that the sampler reckons with."""
_TILT = (0.2, 0.35, 0.1)
"""Rotation vector of the lattice against the radar [rad]: its edges shall not run along walls."""
_CHUNK = 4096
"""Footprints that are integrated at once for all pairs."""
_NEGLIGIBLE = 1e-3
"""Footprints that together return less than this share of the tolerance make no paths."""


@dataclass(frozen=True)
class RayReport:
    """Cost and estimated error of shooting and bouncing rays."""

    rays: int
    """Rays sent, those that look back at the radar included."""
    hits: int
    """Rays' hits on surfaces."""
    by_bounce: tuple[int, ...]
    """Rays sent on the way to the first surface, from there to the second, ..."""
    guiding: int
    """Rays of the first round."""
    tubes: tuple[int, ...]
    """Footprints that were integrated, after so many bounces."""
    error: float
    """Estimated error of the return of the worst actor or of the static scene, relative to it."""


@dataclass(frozen=True)
class RayTrace:
    """Paths of an instant by shooting and bouncing rays."""

    paths: RadarPaths
    """One path for each footprint and way round; a single knot."""
    report: RayReport


def check_options(max_bounces: Any, rtol: Any, sampling: Any, level: Any) -> None:
    """Raise a ValueError that names what of :func:`shoot`'s options is out of range."""

    def whole(value: Any, most: int) -> bool:
        return isinstance(value, (int, np.integer)) and not isinstance(value, bool) and bool(1 <= value <= most)

    if not whole(max_bounces, MOST_BOUNCES):
        raise ValueError(f"max_bounces is {max_bounces!r}: a whole number of 1 … {MOST_BOUNCES} is needed")
    if not (is_number(rtol) and 1e-4 <= rtol <= LOOSEST):
        raise ValueError(f"rtol is {rtol!r}: a value in 1e-4 … {LOOSEST} is needed")
    if not isinstance(sampling, str) or sampling not in get_args(Sampling):
        raise ValueError(f"sampling is {sampling!r}: allowed are {', '.join(map(repr, get_args(Sampling)))}")
    if level is not None and sampling != "uniform":
        raise ValueError(f"level is {level!r} with {sampling!r} sampling: only uniform tubes have one, None is needed")
    if sampling == "uniform" and not whole(level, 11):
        raise ValueError(f"level is {level!r}: uniform tubes need a whole number of 1 … 11")


@one_blas_thread()
def shoot(
    tracer: Tracer,
    t: float = 0.0,
    max_bounces: int | None = None,
    rtol: float = 1e-2,
    sampling: Sampling = "adaptive",
    level: int | None = None,
) -> RayTrace:
    """Paths at instant `t` [s] by rays alone.

    Tubes of rays leave the radar's phase centre in all directions. At every surface they are reflected, with its
    curvature, and integrated by physical optics towards all elements; where the tracer has `transmission` they also go
    through slabs. Paths have two ways round: Tx sends by way of the tube and Rx sees the footprint, and the other way
    round. Both count half, but where just one of the first and the last surface is plane the mirror is the plane one,
    and of two plane ones of unlike areas the larger (:mod:`rfgen_sionna.tracing.routes.planar_parts`).

    Tubes end sharply where mirrors do, however far from there they land. By way of three surfaces what lies between two
    walls is a mirror, too: of a plate, seen by a wall there and back, 7.9 dB (5 cm wide) to 2.5 dB (30 cm) too much
    returns, which the facets have to 0.1 %. All that comes so is in the stated error.

    What rough surfaces return diffusely is left out; their coherent part is in. Of what returns directly each pair sees
    shadows from its own places (:mod:`~tests.reference.sbr.parallax`), where one thing hides another that the
    phase centre sees a part of; what that may be off by is in the stated error. Shadows on further bounces, beside
    and behind slabs that are seen through, of a smooth body on itself, and with uniform tubes are the phase centre's,
    in no stated error.

    Parameters
    ----------
    tracer
        Scene, actors, radar, and whether slabs are seen through.
    max_bounces
        Most surfaces on a path; None takes the tracer's. A tube also ends where Fresnel's coefficients have left less
        than `rtol`^2 of its power.
    rtol
        What sampling may cost in accuracy, of the return of each actor and of the static scene.
    sampling
        "adaptive" or "uniform", which is there to compare with.
    level
        Of uniform tubes: every right angle is divided in 2^level. All 8 4^level of them are in memory at once, some
        3 kB each, and those that are reflected again.

    Raises
    ------
    ValueError
        Naming what is out of range, or a level whose tubes have no room in memory.
    """
    max_bounces = tracer.max_bounces if max_bounces is None else max_bounces
    check_options(max_bounces, rtol, sampling, level)
    if not (tracer.surfaces.static or tracer.surfaces.moving):
        nothing = Scenery.of(tracer, [], float(t)).none(ArrayElements.of(tracer.radar))
        return RayTrace(nothing, RayReport(0, 0, (0,) * max_bounces, 0, (0,) * max_bounces, 0.0))
    found = _Shot(tracer, float(t), int(max_bounces), float(rtol), level, ArrayElements.of(tracer.radar)).trace()
    if tracer.radar.trajectory is None:
        return found
    paths = found.paths
    direction, arrival = (to_world(each, tracer.radar, float(t)) for each in (paths.direction, paths.arrival))
    return replace(found, paths=replace(paths, direction=direction, arrival=arrival))


class _Shot:
    def __init__(
        self,
        tracer: Tracer,
        t: float,
        max_bounces: int,
        rtol: float,
        level: int | None,
        eyes: ArrayElements,
    ) -> None:
        rays, vertices, velocities = tracer.geometry(t)
        self.tracer, self.t, self.eyes = tracer, t, eyes
        self.max_bounces, self.rtol, self.level = max_bounces, rtol, level
        self.scenery = Scenery.of(tracer, velocities, t)
        self.centre, self.half_band = self.scenery.frequency, self.scenery.half_band
        surfaces = self.scenery.surfaces
        optics = SlabOptics.of([surface.material for surface in surfaces], self.centre, self.half_band)
        skin = RaySkin.of(surfaces, vertices)
        rotation = eyes.rotation @ Rotation.from_rotvec(_TILT).as_matrix()
        whose = np.repeat(np.arange(len(surfaces)), [len(surface.faces) for surface in surfaces])
        self.setting = Setting(
            rays, skin, optics, whose.astype(np.int32), eyes.position, rotation, 2.0 * tracer.radar.max_range, rtol**2,
            tracer.transmission,
        )  # fmt: skip
        count = len(tracer.surfaces.static)
        group = np.maximum(np.arange(len(surfaces)) - count + 1, 0) if count else np.arange(len(surfaces))
        marks = None if level is not None else Marks.of(skin, eyes.position, rotation, GUIDES)
        self.sampler = Sampler(
            self._level, self.centre, 2 * self.half_band, group.astype(np.int32), rtol, level is not None, None, marks
        )
        self.tubes = [0] * max_bounces

    def trace(self) -> RayTrace:
        """All paths."""
        first = GUIDES if self.level is None else self.level
        self._check_room(8 * 4**first, 0)
        hits = Hits(self.setting)
        cells = lattice.cells(first)
        if self.level is None:  # the guiding rays, which the sampler finds again
            hits.rows(np.unique(cells.reshape(-1, 3), axis=0))
        guiding = self.setting.sent
        groups = int(self.sampler.group.max(initial=0)) + 1
        scale, missed = np.zeros(groups), np.zeros(groups)
        found: list[RadarPaths] = []
        stages: list[tuple[Hits, lattice.Nodes, Sampler]] = [(hits, cells, self.sampler)]
        while stages:
            hits, cells, sampler = stages.pop(0)
            if hits.before is not None:
                self._check_room(len(cells), hits.reflections + hits.passages)
            pieces = sampler.land(hits, cells, first)
            row = pieces.rows[:, 0]
            a = self._level(hits, pieces.rows)
            group = self.sampler.group[hits.surface[row]]
            np.add.at(missed, group, pieces.error**2)
            if hits.reflections > 1:
                off = a * self._unlike(hits, row)
                missed += np.abs(np.bincount(group, off.real, groups) + 1j * np.bincount(group, off.imag, groups)) ** 2
            own = np.abs(np.bincount(group, a.real, groups) + 1j * np.bincount(group, a.imag, groups))
            scale = np.maximum(scale, np.maximum(own, 0.03 * np.sqrt(np.bincount(group, np.abs(a) ** 2, groups))))
            self.tubes[hits.reflections] += int((np.abs(a) > 0).sum())
            self._check_paths(int((np.abs(a) > 0).sum()) * (1 if hits.before is None else 2))
            found += self._paths(hits, pieces, a, scale[group])
            if hits.before is None and len(pieces.terminator):
                beside, doubt = self._beside(hits, pieces.terminator, scale)
                found += beside
                missed += doubt**2
            after = self.sampler.within(scale.copy()) if self.level is None else self.sampler
            if hits.reflections + 1 < self.max_bounces:
                stages.append((Hits(self.setting, hits), pieces.corners, after))
            if self.setting.transmission and hits.passages < MAX_SLABS:
                open_ = self.setting.optics.penetrable[hits.surface[row]]
                if open_.any():
                    stages.append((Hits(self.setting, hits, through=True), pieces.corners[open_], after))
        paths = RadarPaths.concatenate(found) if found else self.scenery.none(self.eyes)
        by_bounce = tuple(self.setting.by_depth.get(depth + 1, 0) for depth in range(self.max_bounces))
        error = 2.0 * float(np.max(np.sqrt(missed) / np.maximum(scale, 1e-300), initial=0.0, where=scale > 0))
        report = RayReport(self.setting.sent, self.setting.met, by_bounce, guiding, tuple(self.tubes), error)
        return RayTrace(paths, report)

    def _check_room(self, tubes: int, surfaces: int) -> None:
        if self.level is not None:
            what = f"{tubes:,} tubes" + (f" that go on beyond surface {surfaces}" if surfaces else "")
            check_memory(self.level, TUBE_BYTES * tubes, what)

    def _check_paths(self, paths: int) -> None:
        pairs = len(self.eyes.tx) * len(self.eyes.rx)
        if self.level is not None:
            check_memory(self.level, GAIN_BYTES * pairs * paths, f"{paths:,} paths of {pairs} pairs of elements")

    def _weight(self, hits: Hits, row: Index) -> FloatArray:
        """(tube,) what the ways round through tubes count: 1/2 each, but where only one end is plane, and by the areas
        of both where they are: the sharp edges that a small mirror's tubes have far from it no wave has."""
        skin, first, own = self.setting.skin, row, hits
        last = skin.sheet[hits.facet[row]]
        mirror = None
        while own.before is not None:
            first, through = own.parent[first], own.through
            own = own.before
            if not through:
                mirror = skin.sheet[own.facet[first]]
        if mirror is None:
            return np.full(len(row), 0.5)
        share = np.where(skin.plane[mirror] == skin.plane[last], 0.5, np.where(skin.plane[mirror], 1.0, 0.0))
        both = np.flatnonzero(skin.plane[mirror] & skin.plane[last])
        area = np.maximum(skin.area, 1e-300)
        share[both] = mirror_weight(area[mirror[both]], area[last[both]])
        return share

    def _unlike(self, hits: Hits, row: Index) -> FloatArray:
        """(tube,) which part of what comes by three surfaces or more is by a flat one in between that is much smaller
        than the two at the ends: it would have to be integrated, and may return anything."""
        skin, sheets, own = self.setting.skin, [self.setting.skin.sheet[hits.facet[row]]], hits
        while own.before is not None:
            row, through = own.parent[row], own.through
            own = own.before
            if not through:
                sheets.append(skin.sheet[own.facet[row]])
        area, found = np.maximum(skin.area, 1e-300), np.zeros(len(row))
        ends = np.minimum(area[sheets[0]], area[sheets[-1]])
        for middle in sheets[1:-1]:
            unlike = np.maximum(2.0 * mirror_weight(ends, area[middle]) - 1.0, 0.0)
            found = np.maximum(found, np.where(skin.plane[middle], unlike, 0.0))
        return np.where(skin.plane[sheets[0]] & skin.plane[sheets[-1]], found, 0.0)

    def _echo(self, hits: Hits, row: Index) -> FloatArray:
        """(tube,) by how much later echoes within the slabs come that are met on the way [m]."""
        late = np.append(self.setting.optics.table.round_trip_lengths, 0.0)  # the last is that of no slab
        total, own = late[hits.out[row]].sum(axis=1), hits
        while True:
            total += late[own.surface[row]]
            if own.before is None:
                return np.asarray(total)
            row, own = own.parent[row], own.before

    def _level(self, hits: Hits, rows: Index) -> ComplexArray:
        """(tube,) what footprints return to the phase centre in the middle of the band, times the elements' pattern."""
        a = np.zeros(len(rows), np.complex128)
        visible = np.flatnonzero(hits.unoccluded[rows].any(axis=1) & (hits.facet[rows[:, 0]] >= 0))
        weight = self._weight(hits, rows[visible, 0])
        visible, weight = visible[weight > 0], weight[weight > 0]
        source, fields = self.setting.source[None], self.eyes.fields
        for start in range(0, len(visible), 8 * _CHUNK):
            at = visible[start : start + 8 * _CHUNK]
            chosen = landed(hits, rows[at])
            there, back = integrate(chosen, self.setting.optics, source, source, fields, [self.centre])
            total = there.a[0, 0, 0] + (0.0 if back is None else back.a[0, 0, 0])
            total = total * phasors(self.centre * there.tau[0, 0])
            a[at] = total * (1.0 if back is None else weight[start : start + 8 * _CHUNK])
        first, last = ends(hits, rows)
        return a * np.sqrt(self.eyes.pattern_gain(first) * self.eyes.pattern_gain(last))

    def _paths(self, hits: Hits, pieces: Pieces, a: ComplexArray, scale: FloatArray) -> list[RadarPaths]:
        """Of the pieces that matter, in chunks."""
        chosen = self._that_matter(a, scale)
        found = []
        for start in range(0, len(chosen), _CHUNK):
            rows = pieces.rows[chosen[start : start + _CHUNK]]
            found += self._chunk(hits, rows)
        return found

    def _that_matter(self, a: ComplexArray, scale: FloatArray) -> Index:
        """Which of the footprints that return `a` (footprint,) matter, against `scale` (n,)."""
        size = np.abs(a)
        order = np.argsort(size)
        small = np.cumsum(size[order]) <= _NEGLIGIBLE * self.rtol * float(scale.max(initial=0.0))
        return np.asarray(np.sort(order[~small & (size[order] > 0)]))

    def _beside(self, hits: Hits, terminator: Rims, scale: FloatArray) -> tuple[list[RadarPaths], FloatArray]:
        """What pairs see beside `terminator` and the phase centre doesn't, or the reverse; and what of it may be missed
        (group,)."""
        found = correction(hits, terminator, self.eyes.tx, self.eyes.rx)
        a = self._level(hits, found.rows)
        group = self.sampler.group[hits.surface[found.rows[:, 0]]]
        chosen = self._that_matter(a, scale)
        paths = []
        for start in range(0, len(chosen), _CHUNK):
            part = found.take(chosen[start : start + _CHUNK])
            paths += self._chunk(hits, part.rows, part.more)
        return paths, doubts(found, a, group, len(scale))

    def _chunk(self, hits: Hits, rows: Index, more: NDArray[np.int8] | None = None) -> list[RadarPaths]:
        eyes, landing = self.eyes, landed(hits, rows)
        spread = np.ptp((hits.length[rows] + np.linalg.norm(hits.point[rows] - self.setting.source, axis=2)), axis=1)
        u = band_nodes(float((spread + self._echo(hits, rows[:, 0])).max()), self.half_band, self.rtol)
        frequencies = [self.centre + self.half_band * float(each) for each in u]
        there, back = integrate(landing, self.setting.optics, eyes.tx, eyes.rx, eyes.fields, frequencies)
        way = ends(hits, rows)
        if back is None:
            gains = fit_over_band(u, there.a)
            return [self.scenery.paths(hits, rows, gains if more is None else gains * more, there.tau, way)]
        weight = self._weight(hits, rows[:, 0])
        return [
            self.scenery.paths(hits, rows, fit_over_band(u, each.a) * weight, each.tau, ways)
            for each, ways in ((there, way), (back, way[::-1]))
        ]
