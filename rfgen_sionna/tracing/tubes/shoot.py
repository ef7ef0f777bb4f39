"""The ray mode: tubes from the radar through the scene, integrated where they land, as paths."""

from __future__ import annotations

import numbers
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rfgen_sionna.parallel import one_blas_thread
from rfgen_sionna.records import SPEED_OF_LIGHT, ComplexArray, FloatArray, PathKind, RadarPaths
from rfgen_sionna.tracing.gains import BandTracer
from rfgen_sionna.tracing.relative import to_world
from rfgen_sionna.tracing.tubes import lattice
from rfgen_sionna.tracing.tubes.bands import band_nodes, over_band
from rfgen_sionna.tracing.tubes.footprints import Integrals, integrate, landed
from rfgen_sionna.tracing.tubes.guides import Marks
from rfgen_sionna.tracing.tubes.hits import Hits, Index, Setting
from rfgen_sionna.tracing.tubes.media import Optics
from rfgen_sionna.tracing.tubes.sampling import Pieces, Sampler
from rfgen_sionna.tracing.tubes.skin import Skin
from rfgen_sionna.tracing.veils import MOST_SLABS

if TYPE_CHECKING:
    from rfgen_sionna.tracing.tracer import Tracer

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
    """What the ray mode took."""

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
    """What the ray mode found at an instant."""

    paths: RadarPaths
    """One path for each footprint and way round; a single knot."""
    report: RayReport


def check_options(max_bounces: Any, rtol: Any, sampling: Any, level: Any) -> None:
    """Raise a ValueError that names what of :func:`shoot`'s options is out of range."""

    def whole(value: Any, most: int) -> bool:
        return isinstance(value, numbers.Integral) and not isinstance(value, bool) and 1 <= value <= most

    if not whole(max_bounces, MOST_BOUNCES):
        raise ValueError(f"max_bounces is {max_bounces!r}: a whole number of 1 … {MOST_BOUNCES} is needed")
    if isinstance(rtol, bool) or not isinstance(rtol, numbers.Real) or not 1e-4 <= rtol <= LOOSEST:
        raise ValueError(f"rtol is {rtol!r}: a value in 1e-4 … {LOOSEST} is needed")
    if sampling not in get_args(Sampling):
        raise ValueError(f"sampling is {sampling!r}: allowed are {', '.join(map(repr, get_args(Sampling)))}")
    if level is not None and sampling != "uniform":
        raise ValueError(f"level is {level!r} with {sampling!r} sampling: only uniform tubes have one, None is needed")
    if sampling == "uniform" and not whole(level, 11):
        raise ValueError(f"level is {level!r}: uniform tubes need a whole number of 1 … 11")


@one_blas_thread()
def shoot(
    tracer: Tracer,
    t: float,
    max_bounces: int = 3,
    rtol: float = 1e-2,
    sampling: Sampling = "adaptive",
    level: int | None = None,
) -> RayTrace:
    """Paths at instant `t` [s] by rays alone.

    Tubes of rays leave the radar's phase centre in all directions. At every surface they are reflected, with its
    curvature, and integrated by physical optics towards all elements; where the tracer has `transmission` they also go
    through slabs. Paths have two ways round: Tx sends by way of the tube and Rx sees the footprint, and the other way
    round. Both count half, but where just one of the first and the last surface is plane the mirror is the plane one.

    What rough surfaces return diffusely is left out; their coherent part is in.

    Parameters
    ----------
    tracer
        Scene, actors, radar, and whether slabs are seen through.
    max_bounces
        Most surfaces on a path. A tube also ends where Fresnel's coefficients have left less than `rtol`^2 of its
        power.
    rtol
        What sampling may cost in accuracy, of the return of each actor and of the static scene.
    sampling
        "adaptive" or "uniform", which is there to compare with.
    level
        Of uniform tubes: every right angle is divided in 2^level.

    Raises
    ------
    ValueError
        Naming what is out of range.
    """
    check_options(max_bounces, rtol, sampling, level)
    return _Shot(tracer, float(t), int(max_bounces), float(rtol), level).trace()


class _Shot:
    def __init__(self, tracer: Tracer, t: float, max_bounces: int, rtol: float, level: int | None) -> None:
        rays, vertices, velocities = tracer.geometry(t)
        self.tracer, self.t, self.radar = tracer, t, tracer.radar
        self.surfaces = (*tracer.surfaces.static, *tracer.surfaces.moving)
        self.velocities = velocities
        self.max_bounces, self.rtol, self.level = max_bounces, rtol, level
        radar = tracer.radar
        self.centre, self.half_band = radar.center_frequency, 0.5 * radar.waveform.bandwidth
        optics = Optics.of([surface.material for surface in self.surfaces], self.centre, self.half_band)
        skin = Skin.of(self.surfaces, vertices)
        source = np.asarray(radar.position, np.float64)
        rotation = radar.rotation @ Rotation.from_rotvec(_TILT).as_matrix()
        whose = np.repeat(np.arange(len(self.surfaces)), [len(surface.faces) for surface in self.surfaces])
        self.setting = Setting(
            rays, skin, optics, whose.astype(np.int32), source, rotation, 2.0 * radar.max_range, rtol**2,
            tracer.transmission,
        )  # fmt: skip
        count = len(tracer.surfaces.static)
        group = np.maximum(np.arange(len(self.surfaces)) - count + 1, 0) if count else np.arange(len(self.surfaces))
        marks = None if level is not None else Marks.of(skin, source, rotation, GUIDES)
        self.sampler = Sampler(
            self._level, self.centre, 2 * self.half_band, group.astype(np.int32), rtol, level is not None, None, marks
        )
        self._importance = BandTracer(radar, rtol).importance
        self.tubes = [0] * max_bounces

    def trace(self) -> RayTrace:
        first = GUIDES if self.level is None else self.level
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
            pieces = sampler.land(hits, cells, first)
            row = pieces.rows[:, 0]
            a = self._level(hits, pieces.rows)
            group = self.sampler.group[hits.surface[row]]
            np.add.at(missed, group, pieces.error**2)
            own = np.abs(np.bincount(group, a.real, groups) + 1j * np.bincount(group, a.imag, groups))
            scale = np.maximum(scale, np.maximum(own, 0.03 * np.sqrt(np.bincount(group, np.abs(a) ** 2, groups))))
            self.tubes[hits.reflections] += int((np.abs(a) > 0).sum())
            found += self._paths(hits, pieces, a, scale[group])
            after = self.sampler.within(scale.copy()) if self.level is None else self.sampler
            if hits.reflections + 1 < self.max_bounces:
                stages.append((Hits(self.setting, hits), pieces.corners, after))
            if self.setting.transmission and hits.passages < MOST_SLABS:
                open_ = self.setting.optics.penetrable[hits.surface[row]]
                if open_.any():
                    stages.append((Hits(self.setting, hits, through=True), pieces.corners[open_], after))
        paths = RadarPaths.concatenate(found) if found else self._none()
        if self.radar.trajectory is not None:
            direction, arrival = (to_world(each, self.radar, self.t) for each in (paths.direction, paths.arrival))
            paths = replace(paths, direction=direction, arrival=arrival)
        by_bounce = tuple(self.setting.by_depth.get(depth + 1, 0) for depth in range(self.max_bounces))
        error = 2.0 * float(np.max(np.sqrt(missed) / np.maximum(scale, 1e-300), initial=0.0, where=scale > 0))
        report = RayReport(self.setting.sent, self.setting.met, by_bounce, guiding, tuple(self.tubes), error)
        return RayTrace(paths, report)

    def _weight(self, hits: Hits, row: Index) -> FloatArray:
        """(tube,) what the ways round through tubes count: 1/2 each, but where only one end is plane."""
        skin, first, own = self.setting.skin, row, hits
        last = skin.plane[skin.sheet[hits.facet[row]]]
        mirror = None
        while own.before is not None:
            first, through = own.parent[first], own.through
            own = own.before
            if not through:
                mirror = skin.plane[skin.sheet[own.facet[first]]]
        if mirror is None:
            return np.full(len(row), 0.5)
        return np.asarray(np.where(mirror == last, 0.5, np.where(mirror, 1.0, 0.0)))

    def _level(self, hits: Hits, rows: Index) -> ComplexArray:
        """(tube,) what footprints return to the phase centre in the middle of the band, times the elements' pattern."""
        a = np.zeros(len(rows), np.complex128)
        seen = np.flatnonzero(hits.lit[rows].any(axis=1) & (hits.facet[rows[:, 0]] >= 0))
        weight = self._weight(hits, rows[seen, 0])
        seen, weight = seen[weight > 0], weight[weight > 0]
        source, fields = self.setting.source[None], (self.radar.tx_field, self.radar.rx_field)
        for start in range(0, len(seen), 8 * _CHUNK):
            at = seen[start : start + 8 * _CHUNK]
            chosen = landed(hits, rows[at])
            there, back = integrate(chosen, self.setting.optics, source, source, fields, [self.centre])
            total = there.a[0, 0, 0] + (0.0 if back is None else back.a[0, 0, 0])
            total = total * np.exp(-2j * np.pi * np.mod(self.centre * there.tau[0, 0], 1.0))
            a[at] = total * (1.0 if back is None else weight[start : start + 8 * _CHUNK])
        ends = self._ends(hits, rows)
        return a * np.sqrt(self._importance(ends[0]) * self._importance(ends[1]))

    def _ends(self, hits: Hits, rows: Index) -> tuple[FloatArray, FloatArray]:
        """(tube, 3) unit vectors towards the first and the last surface."""
        row, own = rows[:, 3:], hits
        place = own.point[row].mean(axis=1)
        while own.before is not None:
            row, own = own.parent[row], own.before
        first = own.ray[row].mean(axis=1)
        span = place - self.setting.source
        return tuple(each / np.maximum(np.linalg.norm(each, axis=1, keepdims=True), 1e-12) for each in (first, span))  # type: ignore[return-value]

    def _paths(self, hits: Hits, pieces: Pieces, a: ComplexArray, scale: FloatArray) -> list[RadarPaths]:
        """Of the pieces that matter, in chunks."""
        size = np.abs(a)
        order = np.argsort(size)
        small = np.cumsum(size[order]) <= _NEGLIGIBLE * self.rtol * float(scale.max(initial=0.0))
        chosen = np.sort(order[~small & (size[order] > 0)])
        found = []
        for start in range(0, len(chosen), _CHUNK):
            rows = pieces.rows[chosen[start : start + _CHUNK]]
            found += self._chunk(hits, rows)
        return found

    def _chunk(self, hits: Hits, rows: Index) -> list[RadarPaths]:
        radar, landing = self.radar, landed(hits, rows)
        spread = np.ptp((hits.length[rows] + np.linalg.norm(hits.point[rows] - self.setting.source, axis=2)), axis=1)
        u = band_nodes(float(spread.max()), self.half_band, self.rtol)
        frequencies = [self.centre + self.half_band * float(each) for each in u]
        tx, rx = np.atleast_2d(radar.tx_world), np.atleast_2d(radar.rx_world)
        ways = integrate(landing, self.setting.optics, tx, rx, (radar.tx_field, radar.rx_field), frequencies)
        first, last = self._ends(hits, rows)
        weight, rate = self._weight(hits, rows[:, 0]), self._rates(hits, rows)
        found = []
        for each, ends in zip(ways, ((first, last), (last, first)), strict=True):
            if each is not None:
                coefficients = over_band(u, each.a) * (1.0 if ways[1] is None else weight)
                found.append(self._record(hits, rows, each, coefficients, rate, ends))
        return found

    def _record(
        self,
        hits: Hits,
        rows: Index,
        way: Integrals,
        coefficients: ComplexArray,
        rate: FloatArray,
        ends: tuple[FloatArray, FloatArray],
    ) -> RadarPaths:
        names, count = self.tracer.surfaces, len(rows)
        surface, facet = hits.surface[rows[:, 0]], hits.facet[rows[:, 0]]
        first = np.array([each.first_facet for each in self.surfaces])
        face = (facet - first[surface]).astype(np.int32)
        part = np.zeros(count, np.int32)
        for number in np.unique(surface):
            chosen = surface == number
            part[chosen] = self.surfaces[number].parts[face[chosen]]
        bounces = hits.reflections + 1
        order = len(coefficients)
        return RadarPaths(
            a=coefficients[0][..., None],
            tau=way.tau[..., None],
            tau_rate=np.broadcast_to(rate[:, None], (*way.tau.shape, 1)).copy(),
            times=np.array([self.t]),
            frequency=self.centre,
            direction=ends[0][:, None],
            arrival=ends[1][:, None],
            object_id=np.array([each.object_id for each in self.surfaces], np.int32)[surface],
            part_id=part,
            kind=np.full(count, PathKind.FACET if bounces == 1 else PathKind.MULTI_BOUNCE, np.uint8),
            bounces=np.full(count, bounces, np.uint8),
            object_names=names.object_names,
            part_names=names.part_names,
            facet=face,
            dispersion=coefficients[1:, ..., None] if order > 1 else None,
            half_band=self.half_band if order > 1 else 0.0,
        )

    def _rates(self, hits: Hits, rows: Index) -> FloatArray:
        """(tube,) rate of the delay [s/s]: every surface moves the path's length by its velocity along the turn that
        the path takes there."""
        rate, row, own = np.zeros(len(rows)), rows, hits
        back = self.setting.source - own.point[row]
        out = back / np.maximum(np.linalg.norm(back, axis=2, keepdims=True), 1e-12)
        while True:
            turn = own.ray[row] - out
            rate += np.einsum("pni,pni->pn", self._speed(own, row), turn)[:, 3:].mean(axis=1)
            if own.before is None:
                return rate / SPEED_OF_LIGHT
            out, row, own = own.ray[row], own.parent[row], own.before

    def _speed(self, hits: Hits, row: NDArray[np.intp]) -> FloatArray:
        """(..., 3) velocities of the points hit [m/s]."""
        found = np.zeros((*row.shape, 3))
        for number, speed in enumerate(self.velocities):
            if speed is None:
                continue
            at = hits.surface[row] == number
            face = hits.facet[row[at]] - self.surfaces[number].first_facet
            found[at] = np.einsum("rc,rci->ri", hits.weights[row[at]], speed[self.surfaces[number].faces[face]])
        return found

    def _none(self) -> RadarPaths:
        shape = (len(np.atleast_2d(self.radar.tx_world)), len(np.atleast_2d(self.radar.rx_world)), 0, 1)
        empty, names = np.zeros(0, np.int32), self.tracer.surfaces
        return RadarPaths(
            np.zeros(shape, np.complex128), np.zeros(shape), np.zeros(shape), np.array([self.t]), self.centre,
            np.zeros((0, 1, 3)), np.zeros((0, 1, 3)), empty, empty, empty.astype(np.uint8), empty.astype(np.uint8),
            names.object_names, names.part_names, empty,
        )  # fmt: skip
