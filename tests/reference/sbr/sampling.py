"""RF adaptive sampling: guiding rays, then more where they are needed.

A tube is divided in four

* while what its seven rays (corners, middles of the edges, centre) hit differs, or their distances differ by more than
  `UNEVEN`, unless its return is below the tolerance or the rim can be cut by a straight line;
* where the path length through its centre, or its slope at a corner, is not what the quadratic through the other six
  rays says, and its return is large enough for that to matter;
* where it holds vertices of something seen so small that no guiding ray need have met it.

Uniform sampling, to compare with, has tubes of one size, and at rims gives all of a tube to what its centre hits.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray, IntArray
from tests.reference.sbr import lattice
from tests.reference.sbr.cutting import MOST_HALVINGS, cut, with_middles
from tests.reference.sbr.footprints import ENDS
from tests.reference.sbr.guides import Marks
from tests.reference.sbr.hits import Hits, Index
from tests.reference.sbr.rims import Rims

UNEVEN = 0.05
"""Difference of neighbouring rays' distances, relative, that calls for more rays."""
NARROW = 0.25
"""Tubes whose footprint is narrower than this are not divided any further [wavelengths]."""
RIM = 0.3
"""What the return of a tube that hits two things may be off by, before it is cut, relative to itself."""
AGAIN = 0.08
"""Share of what a division into four has changed that each of the four may still be off by."""
WIDEST = 2.0
"""Longest way in or out of a footprint, in wavelengths of the sampled bandwidth: beyond, gains change too fast over
the band to be told by a few frequencies."""
FAINT = 0.01
"""What a group's return is taken for at least, relative to a target that scatters all it meets in all directions: of a
plate off its lobes or a matt board tubes need not find the last of nothing."""
_CLOSER, _CLOSER_HALVINGS = 4, 5
"""How often tubes in which several things meet are divided to find what begins there before another, and halvings of
their edges; if distances within them differ by `_APART`, relative."""
_APART = 0.01
MOST_ROUNDS = 14
MOST_TUBES = 2_000_000
"""Tubes of one bounce; where more are asked for the tolerance is given up."""

Level = Callable[[Hits, Index], ComplexArray]
"""Hits and rows (tube, 6) to the return (tube,) of each footprint."""


@dataclass(frozen=True)
class Pieces:
    """Tubes that each hit one thing."""

    corners: lattice.Nodes
    """(piece, 3, 3)"""
    rows: Index
    """(piece, 6) rows of the hits."""
    error: FloatArray
    """(piece,) estimated error of the return of each, absolute."""
    terminator: Rims
    """Where they end before one another."""

    def __len__(self) -> int:
        return len(self.corners)

    @staticmethod
    def joined(parts: list[Pieces]) -> Pieces:
        if not parts:
            return Pieces(np.zeros((0, 3, 3), np.int64), np.zeros((0, 6), np.intp), np.zeros(0), Rims.none())
        return Pieces(
            np.concatenate([each.corners for each in parts]),
            np.concatenate([each.rows for each in parts]),
            np.concatenate([each.error for each in parts]),
            Rims.joined([each.terminator for each in parts]),
        )


@dataclass(frozen=True)
class Sampler:
    """How tubes are divided."""

    level: Level
    frequency: float
    """[Hz]"""
    bandwidth: float
    """[Hz]"""
    group: IntArray
    """(surface,) surfaces whose returns are accurate together: all static ones, each actor."""
    rtol: float
    uniform: bool = False
    scale: FloatArray | None = None
    """(group,) returns that the tolerance is relative to, where a group's own is less."""
    marks: Marks | None = None
    """What tubes must not miss."""

    def land(self, hits: Hits, cells: lattice.Nodes, level: int) -> Pieces:
        """The pieces into which tubes `cells` (tube, 3, 3), of a lattice's `level`, come to land."""
        if self.uniform:
            return self._at_once(hits, cells)
        groups = int(self.group.max(initial=0)) + 1
        done: list[Pieces] = []
        total, power, count = np.zeros(groups, np.complex128), np.zeros(groups), np.zeros(groups)
        above: ComplexArray | None = None
        faint = np.zeros(groups)
        for turn in range(MOST_ROUNDS):
            if len(cells) == 0:
                break
            found = self._visibility(hits, cells)
            error = found.error
            if above is not None and len(above) * 4 == len(cells):
                # What the division into four has changed tells what another one would.
                four = found.a.reshape(4, -1).sum(axis=0)
                changed = np.where(found.whole.reshape(4, -1).all(axis=0), np.abs(four - above), 0.0)
                error = np.maximum(error, np.tile(np.nan_to_num(changed) * AGAIN, 4))
            a, group = found.a, np.where(found.whose >= 0, self.group[found.whose], 0)
            now = total + _sum(group, a, groups)
            scale = np.maximum(np.abs(now), 0.03 * np.sqrt(power + np.bincount(group, np.abs(a) ** 2, groups)))
            if above is None:
                faint = FAINT * np.sqrt(np.bincount(group, found.isotropic**2, groups))
            scale = np.maximum(scale, faint)
            if self.scale is not None:
                scale = np.maximum(scale, self.scale)
            shares = np.maximum(count + np.bincount(group, (np.abs(a) > 0).astype(float), groups), 100.0)
            allowed = (0.5 * self.rtol * scale / np.sqrt(shares))[group]
            last = turn >= MOST_ROUNDS - 1 or len(cells) > MOST_TUBES
            marked = np.zeros(len(cells), np.bool_)
            if self.marks is not None and not last:
                first = hits.before is None
                marked = self.marks.first(cells, level + turn) if first else self.marks.later(hits, cells)
            whole = found.whole & ((error <= allowed) | (found.width < NARROW)) & ~marked
            rim = ~found.whole & ~found.empty & ~marked
            ready = rim & ((found.error <= 30 * allowed) | (found.width < NARROW))
            if last:
                whole, ready = found.whole, ~found.whole & ~found.empty
            chosen = np.flatnonzero(whole)
            done.append(Pieces(cells[chosen], found.rows[chosen, :6], error[chosen], Rims.none()))
            total += _sum(group[chosen], a[chosen], groups)
            power += np.bincount(group[chosen], np.abs(a[chosen]) ** 2, groups)
            count += np.bincount(group[chosen], (np.abs(a[chosen]) > 0).astype(float), groups)
            again = ~found.empty & ~whole
            at = np.flatnonzero(ready)
            if len(at):
                pieces, fine = self._cut(hits, cells[at], found, at, allowed[at], last)
                own = np.where(hits.surface[pieces.rows[:, 0]] >= 0, self.group[hits.surface[pieces.rows[:, 0]]], 0)
                b = self.level(hits, pieces.rows)
                total += _sum(own, b, groups)
                power += np.bincount(own, np.abs(b) ** 2, groups)
                count += np.bincount(own, (np.abs(b) > 0).astype(float), groups)
                done.append(pieces)
                again[at[fine]] = False
            if not last:
                again |= marked
            above = np.where(found.whole[again], a[again], np.nan)
            cells = lattice.quarters(cells[again])
        return Pieces.joined(done)

    def _visibility(self, hits: Hits, cells: lattice.Nodes) -> _Seen:
        nodes = np.concatenate([with_middles(cells), lattice.centre(cells)[:, None]], axis=1)
        rows = hits.rows(nodes.reshape(-1, 3)).reshape(-1, 7)
        sign = hits.sign[rows]
        whole, empty = (sign == sign[:, :1]).all(axis=1), (sign == 0).all(axis=1)
        whole &= ~empty
        # Of tubes that hit several things, that which the centre hits, or any ray, as if it were all of it.
        like = np.where(sign[:, 6] != 0, 6, np.argmax(sign != 0, axis=1))
        rest = np.flatnonzero(~whole & ~empty)
        own = np.take_along_axis(sign, like[:, None], axis=1)
        tube, node = np.nonzero(sign[rest] != own[rest])
        rows = rows.copy()
        if len(tube):
            at = rest[tube]
            rows[at, node] = hits.extended(nodes[at, node], rows[at, like[at]])
        found = self.level(hits, rows[:, :6])
        found[empty] = 0.0
        point, leg, length = hits.point[rows], hits.leg[rows], hits.length[rows]
        span = np.sqrt(((point[:, :3] - point[:, [1, 2, 0]]) ** 2).sum(axis=2)).max(axis=1)
        out = np.sqrt(((point - hits.setting.source) ** 2).sum(axis=2))
        way = length + out
        k = 2 * np.pi * self.frequency / SPEED_OF_LIGHT
        expected = 4 / 9 * way[:, 3:6].sum(axis=1) - way[:, :3].sum(axis=1) / 9
        phase = k * np.maximum(np.abs(way[:, 6] - expected), _cubic(hits, rows, way, point))
        gap = np.sqrt(
            ((4 / 9 * point[:, 3:6].sum(axis=1) - point[:, :3].sum(axis=1) / 9 - point[:, 6]) ** 2).sum(axis=1)
        )
        nearest = np.maximum(leg.min(axis=1), 1e-9)
        size = np.abs(found)
        # A jump in depth within one sheet, or distances that differ too much for the tube to be told by seven rays.
        torn = whole & (gap > 0.1 * span)
        uneven = whole & (leg.max(axis=1) - nearest > UNEVEN * nearest)
        long = np.ptp(way, axis=1) > WIDEST * SPEED_OF_LIGHT / max(self.bandwidth, 1.0)
        width = span * self.frequency / SPEED_OF_LIGHT
        spread = k * np.ptp(way, axis=1)
        whose = hits.surface[np.take_along_axis(rows, like[:, None], axis=1)[:, 0]]
        full, isotropic = self._bounds(hits, nodes, rows)
        bound = full * hits.setting.optics.smoothness[whose] / (1.0 + 0.5 * spread)
        most = np.maximum(size, bound)
        error = most * np.minimum(0.5 * phase + _aslant(hits, rows[:, :6]), 1.0)
        error = np.where(torn | ~whole, RIM * most, error)
        error = np.where(uneven | long, np.maximum(error, 0.05 * size), error)
        isotropic[empty] = 0.0
        return _Seen(rows, sign, whole, empty, found, error, width, whose, most, spread, isotropic)

    def _bounds(self, hits: Hits, nodes: lattice.Nodes, rows: Index) -> tuple[FloatArray, FloatArray]:
        """(tube,) what footprints would return if the surface were a conductor: with all of it in phase, by
        conservation of energy sqrt(solid angle x area across) / (4 pi distance); and evenly into all directions,
        wavelength sqrt(solid angle) / ((4 pi)^1.5 distance)."""
        ray = lattice.directions(nodes[:, :3], hits.setting.rotation)
        point = hits.point[rows[:, :3]]

        def area(place: FloatArray) -> FloatArray:
            across = np.cross(place[:, 1] - place[:, 0], place[:, 2] - place[:, 0])
            return np.asarray(0.5 * np.sqrt((across**2).sum(axis=1)))

        cos = np.abs(np.einsum("tni,tni->tn", hits.ray[rows[:, :3]], hits.normal[rows[:, :3]])).mean(axis=1)
        back = np.maximum(np.sqrt(((point.mean(axis=1) - hits.setting.source) ** 2).sum(axis=1)), 1e-3)
        power = hits.power[rows[:, :3]].mean(axis=1)
        reach = np.sqrt(power * area(ray)) / (4 * np.pi * back)
        wavelength = SPEED_OF_LIGHT / self.frequency
        return np.asarray(reach * np.sqrt(area(point) * cos)), np.asarray(reach * wavelength / np.sqrt(4 * np.pi))

    def _cut(
        self, hits: Hits, cells: lattice.Nodes, found: _Seen, at: Index, allowed: FloatArray, last: bool
    ) -> tuple[Pieces, NDArray[np.bool_]]:
        """Pieces of the tubes `at` whose cuts are fine, and which those are."""
        narrow, most = found.width[at] < NARROW, RIM * found.most[at]
        # A rim out of place by a share of the width takes that share of the phase with it.
        turn = np.maximum(found.spread[at], 1.0)
        halvings = np.ceil(np.log2(np.maximum(2.0 * most * turn / np.maximum(allowed, 1e-300), 4.0)))
        made = cut(hits, cells, found.sign[at], halvings.clip(2, MOST_HALVINGS).astype(np.int64))
        error = most * np.minimum(made.off * turn, 1.0)
        fine = (error <= allowed) | narrow | last
        kept = fine[made.tube]
        nodes, tube = made.nodes[kept], made.tube[kept]
        rows = fitting(hits, nodes, made.sign[kept])
        k = 2 * np.pi * self.frequency / SPEED_OF_LIGHT
        way = hits.length[rows] + np.sqrt(((hits.point[rows] - hits.setting.source) ** 2).sum(axis=2))
        phase = 0.5 * k * _cubic(hits, rows, way, hits.point[rows])
        bent = found.most[at][tube] * np.minimum(phase + _aslant(hits, rows), 1.0)
        error = error + np.bincount(tube, bent, len(at))
        fine &= (error <= 2.0 * allowed) | narrow | last
        kept = fine[tube]
        nodes, rows, tube = nodes[kept], rows[kept], tube[kept]
        share = error[tube] / np.maximum(np.bincount(tube, minlength=len(at))[tube], 1)
        terminator = Rims.none()
        if hits.before is None:
            terminator = made.terminator.take((fine & made.clear)[made.rim_of])
            terminator = Rims.joined([terminator, self._closer(hits, cells[fine & ~made.clear])])
        return Pieces(nodes[:, :3], rows, share, terminator), fine

    def _closer(self, hits: Hits, cells: lattice.Nodes) -> Rims:
        """Rims in tubes where more than two things meet, which are narrow enough for what they return but not for what
        begins there: looked at more closely."""
        parts = [Rims.none()]
        for turn in range(_CLOSER):
            nodes = np.concatenate([with_middles(cells), lattice.centre(cells)[:, None]], axis=1)
            rows = hits.rows(nodes.reshape(-1, 3)).reshape(-1, 7)
            sign, leg = hits.sign[rows], hits.leg[rows]
            nearest = np.where(sign != 0, leg, np.inf).min(axis=1)
            jump = np.where(sign != 0, leg, 0.0).max(axis=1) > (1.0 + _APART) * nearest
            mixed = np.flatnonzero((sign != sign[:, :1]).any(axis=1) & jump)
            if len(mixed) == 0:
                break
            made = cut(hits, cells[mixed], sign[mixed], np.full(len(mixed), _CLOSER_HALVINGS))
            clear = made.clear | (turn == _CLOSER - 1)
            parts.append(made.terminator.take(clear[made.rim_of]))
            cells = lattice.quarters(cells[mixed[~clear]])
        return Rims.joined(parts)

    def _at_once(self, hits: Hits, cells: lattice.Nodes) -> Pieces:
        found = self._visibility(hits, cells)
        middle = found.whole | (found.sign[:, 6] != 0)
        return Pieces(cells[middle], found.rows[middle, :6], found.error[middle], Rims.none())

    def within(self, scale: FloatArray) -> Sampler:
        """The same with another `scale` (group,), for what comes after the first hits."""
        return replace(self, scale=scale)


@dataclass(frozen=True)
class _Seen:
    rows: Index
    sign: NDArray[np.int64]
    whole: NDArray[np.bool_]
    empty: NDArray[np.bool_]
    a: ComplexArray
    error: FloatArray
    width: FloatArray
    """(tube,) longest edge [wavelengths]."""
    whose: IntArray
    """(tube,) surface, -1 for none."""
    most: FloatArray
    """(tube,) largest return of a part of it."""
    spread: FloatArray
    """(tube,) by how much the phase differs over it [rad]."""
    isotropic: FloatArray
    """(tube,) return of a target that scatters all it meets evenly."""


def _cubic(hits: Hits, rows: Index, way: FloatArray, point: FloatArray) -> FloatArray:
    """(tube,) by how much path lengths along edges are off the parabola through three nodes, at most [m]: from their
    slopes at the corners, which are known from the rays' directions."""
    back = point - hits.setting.source
    slope = hits.ray[rows] + back / np.maximum(np.sqrt((back**2).sum(axis=2, keepdims=True)), 1e-9)
    most = np.zeros(len(rows))
    for middle, ends in enumerate(ENDS, start=3):
        for start, end in (ends, ends[::-1]):
            step = 4 * point[:, middle] - 3 * point[:, start] - point[:, end]
            missed = 4 * way[:, middle] - 3 * way[:, start] - way[:, end]
            missed = missed - np.einsum("ti,ti->t", slope[:, start], step)
            most = np.maximum(most, 0.096 * np.abs(missed))  # the largest value of x (x - 1/2) (x - 1), twice
    return most


def _aslant(hits: Hits, rows: Index) -> FloatArray:
    """(tube,) what the return of round things is off by, relative to itself, where the angle of incidence changes much:
    towards their rim places change as roots do, which parabolas do not follow far."""
    cos = np.abs(np.einsum("tni,tni->tn", hits.ray[rows], hits.normal[rows]))
    change = np.ptp(cos, axis=1) / np.maximum(cos.mean(axis=1), 1e-3)
    bent = (hits.patch[rows] != 0).any(axis=(1, 2, 3))
    return np.where(bent, RIM * np.minimum(0.5 * change, 1.0) ** 4, 0.0)


def fitting(hits: Hits, nodes: lattice.Nodes, sign: NDArray[np.int64]) -> Index:
    """(tube, 6) rows at the nodes (tube, 6, 3) of tubes that hit `sign` (tube,); where a ray hits something else, on
    the surface around the first corner that doesn't."""
    rows = hits.rows(nodes.reshape(-1, 3)).reshape(-1, 6)
    right = hits.sign[rows] == sign[:, None]
    like = np.take_along_axis(rows, np.argmax(right, axis=1)[:, None], axis=1)[:, 0]
    tube, node = np.nonzero(~right & right.any(axis=1)[:, None])
    if len(tube):
        rows = rows.copy()
        rows[tube, node] = hits.extended(nodes[tube, node], like[tube])
    return rows


def _sum(group: NDArray[np.intp], a: ComplexArray, count: int) -> ComplexArray:
    return np.asarray(np.bincount(group, a.real, count) + 1j * np.bincount(group, a.imag, count))
