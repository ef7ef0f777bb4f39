"""The lit parts of facets that a shadow's edge passes.

Points of a lattice on the facet are looked at; where two neighbours differ, the shadow's edge between them is found by
halving, and straight lines join what is found (marching triangles). What is cut off where the edge is bent falls
with the square of the lattice's spacing. As the facet moves its lit part changes with the shadow, not cell by cell.

Most facets have one edge on them that is straight as far as the lattice tells, such as that of a table: their lit part
is a triangle or two instead of dozens, which all that follows is spared.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray

SPACINGS = (1, 2, 4, 8, 16, 32)
"""Cells along a facet's edge, level by level."""
_HALVINGS = (5, 5, 6, 7, 8, 9)
"""How often the edge of a cell is halved at least to find the shadow's edge on it, level by level: so often that three
of them tell whether the edge is straight to `_BOWED`."""
_MOST_HALVINGS = 9
_STRAY = 0.05
"""Phase that the place found may be off by before it is halved again [rad, root mean square]."""

_BOWED = 0.1
"""How far an edge may be from straight on its way over a facet, times the square of the cells along its edge: as much
counts for what lines from cell to cell miss (:mod:`rfgen_sionna.tracing.shadows.sampling`)."""

RIM = 0.05
"""Rays that tell whether a facet is seen go to points so much nearer to its middle: of a face that looks away, behind
the rim of its body, the very corner may be taken for seen."""
_INSET = 5e-4
_ALONG = 3.0
"""How many times as far from a side the other end of a line has to be for it to be followed as far as that side."""
_TURNS_FROM, _SHARP = 2, 0.35
"""Level of lattice from which on corners of shadows are looked for, and the sine of the least angle of one: a bent edge
that turns by less from cell to cell is cut off by straight lines, which miss half as much of it."""
_AIM = np.array([0.36, 0.31, 0.33])
"""Rays go to points that much nearer to this one of the facet, barycentric: a ray in the very plane of an edge before
it may get through between the two faces that meet there, as rays to corners of symmetric bodies do."""


class Look(Protocol):
    """Tells what is seen of facets: :class:`rfgen_sionna.scene.point_visibility.Targets` does, by rays."""

    def seen(self, of: NDArray[np.intp], places: FloatArray, /) -> NDArray[np.bool_]:
        """(ray,) whether the points at barycentric `places` (ray, 3) on facets `of` (ray,) are seen."""

    def edges(
        self, of: NDArray[np.intp], lit: FloatArray, dark: FloatArray, halvings: NDArray[np.intp], /
    ) -> tuple[FloatArray, FloatArray]:
        """(ray, 3) where on facets `of` (ray,) the shadow's edge is between the points `lit` (ray, 3), which are seen,
        and `dark` (ray, 3), after so many `halvings` (ray,); and (ray,) how far it is to what casts it, over the way
        there."""


class Lit(NamedTuple):
    """What is seen of facets."""

    fraction: FloatArray
    """(facet,) share of the area."""
    owner: NDArray[np.intp]
    """(piece,) facet that each piece is of; those that are seen as a whole, or not at all, have none."""
    pieces: FloatArray
    """(piece, corner, 3) barycentric coordinates of the triangles that are seen."""
    hider: FloatArray
    """(piece, 2) how far it is to what casts the shadow whose edge goes from the second corner of a piece to the third,
    over the way there, 0 … 1, at either end; NaN where none does. The lit side is the left one, seen from where the
    corners go round counterclockwise."""
    rays: int


class _Lattice(NamedTuple):
    points: FloatArray
    """(point, 3) barycentric."""
    cells: NDArray[np.intp]
    """(cell, 3) points at the corners, in the facet's sense; four by four they make up a cell of the level above."""
    edges: NDArray[np.intp]
    """(edge, 2) points."""
    sides: NDArray[np.intp]
    """(cell, 3) edge from each corner to the next."""
    beside: NDArray[np.intp]
    """(cell, 3) the cell across each of these edges, -1 beside the facet."""
    rim: NDArray[np.intp]
    """(edge,) corner of the facet opposite the side that an edge lies on, -1 within the facet."""
    tips: NDArray[np.intp]
    """(3,) points in the facet's corners."""


@cache
def _aimed(level: int, share: float) -> FloatArray:
    """(point, 3) where rays go that look at the points of the lattice of a `level`, by that share nearer to the
    middle."""
    return inset(_lattice(level).points, share)


@cache
def _lattice(level: int) -> _Lattice:
    cells = np.eye(3)[None]
    for _ in range(level):
        a, b, c = (cells[:, i] for i in range(3))
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        four = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (bc, ca, ab))
        cells = np.stack([np.stack(each, axis=1) for each in four], axis=1).reshape(-1, 3, 3)
    n = SPACINGS[level]
    points, index = np.unique(np.rint(n * cells.reshape(-1, 3)), axis=0, return_inverse=True)
    index = index.reshape(-1, 3)
    pairs = np.sort(np.stack([index, np.roll(index, -1, axis=1)], axis=2), axis=2).reshape(-1, 2)
    edges, sides = np.unique(pairs, axis=0, return_inverse=True)
    rim = np.full(len(edges), -1)
    for corner in range(3):
        rim[(points[edges, corner] == 0).all(axis=1)] = corner
    sides = sides.reshape(-1, 3)
    both = np.full((len(edges), 2), -1)
    order = np.argsort(sides.ravel(), kind="stable")
    edge, cell = sides.ravel()[order], order // 3
    first = np.concatenate([[True], edge[1:] != edge[:-1]])
    both[edge[first], 0], both[edge[~first], 1] = cell[first], cell[~first]
    beside = np.where(both[sides, 0] == np.arange(len(sides))[:, None], both[sides, 1], both[sides, 0])
    return _Lattice(points / n, index, edges, sides, beside, rim, points.argmax(axis=0))


class _Group(NamedTuple):
    """Facets of one level that are seen in part."""

    facets: NDArray[np.intp]
    lattice: _Lattice
    level: int
    lit: NDArray[np.bool_]
    """(facet, point)"""
    corners: tuple[NDArray[np.bool_], ...]
    """(facet, cell) whether the first, the second and the third corner of each cell is seen."""
    row: NDArray[np.intp]
    """(crossing,) facet of the group, and the edge that the shadow's edge crosses."""
    edge: NDArray[np.intp]

    @staticmethod
    def of(facets: NDArray[np.intp], level: int, lit: NDArray[np.bool_]) -> _Group:
        lattice = _lattice(level)
        corners = tuple(np.take(lit, each, axis=1) for each in lattice.cells.T)
        first, second = (np.take(lit, each, axis=1) for each in lattice.edges.T)
        return _Group(facets, lattice, level, lit, corners, *np.nonzero(first != second))


def inset(places: FloatArray, share: float = _INSET) -> FloatArray:
    """Barycentric coordinates of where rays go that look at `places` (ray, 3)."""
    return np.asarray(places + share * (_AIM - places))


def points_of(level: NDArray[np.intp]) -> NDArray[np.intp]:
    """How many points lattices of the `level` have."""
    cells = np.array(SPACINGS)[level]
    return np.asarray((cells + 1) * (cells + 2) // 2, np.intp)


def lit_parts(look: Look, level: NDArray[np.intp], width: FloatArray) -> Lit:
    """What is seen of facets, with lattices of the `level` (facet,) of each: places in :data:`SPACINGS`. Between the
    ends of each the phase differs by its `width` (facet,) [rad]."""
    groups, sent = [], 0
    fraction = np.zeros(len(level))
    for each, facets, lit in _points(look, level):
        sent += lit.size
        seen = lit.sum(axis=1)
        fraction[facets[seen == lit.shape[1]]] = 1.0
        if len(mixed := np.flatnonzero((seen > 0) & (seen < lit.shape[1]))):
            groups.append(_Group.of(facets[mixed], each, lit[mixed]))
    if not groups:
        return Lit(fraction, np.zeros(0, np.intp), np.zeros((0, 3, 3)), np.zeros((0, 2)), sent)
    # Where an edge crosses a side is known to the root of a twelfth of what is left of it.
    stray = width / (np.array(SPACINGS)[level] * np.sqrt(12.0) * _STRAY)
    asked = np.ceil(np.log2(np.maximum(stray, 1.0)))
    halvings = np.clip(asked, np.array(_HALVINGS)[level], _MOST_HALVINGS).astype(np.intp)
    crossings, hider, halved = _crossings(look, groups, halvings)
    owners, pieces, hiders, first = [], [], [], 0
    for group in groups:
        last = first + len(group.row)
        own, before = crossings[first:last], hider[first:last]
        straight, found = _straight(group, own, before)
        if not straight.all():
            rest = np.flatnonzero(~straight)
            bent = _Group.of(group.facets[rest], group.level, group.lit[rest])
            others = ~straight[group.row]
            cut, bitten = _cut(bent, own[others], before[others])
            more = (*_whole(bent, bitten), *cut)
            found += [(rest[owner], piece, ends) for owner, piece, ends in more]
        owners += [group.facets[owner] for owner, _, _ in found]
        pieces += [piece for _, piece, _ in found]
        hiders += [ends for _, _, ends in found]
        first = last
    owner, piece = np.concatenate(owners), np.concatenate(pieces)
    # The third coordinate follows from the others, whose determinant is the share of the area.
    (a, b), (c, d) = (piece[:, k, :2].T - piece[:, 0, :2].T for k in (1, 2))
    fraction += np.bincount(owner, np.abs(a * d - b * c), len(level))
    return Lit(np.minimum(fraction, 1.0), owner, piece, np.concatenate(hiders), sent + halved)


def halved(
    seen: Callable[[NDArray[np.intp], FloatArray], NDArray[np.bool_]],
    of: NDArray[np.intp],
    lit: FloatArray,
    dark: FloatArray,
    halvings: NDArray[np.intp],
) -> tuple[FloatArray, FloatArray]:
    """:meth:`Look.edges` by whether points are :meth:`Look.seen`, where nobody knows what casts a shadow."""
    lit, dark = lit.copy(), dark.copy()
    for step in range(int(halvings.max(initial=0))):
        some = np.flatnonzero(halvings > step)
        middle = 0.5 * (lit[some] + dark[some])
        light = seen(of[some], middle)
        lit[some[light]], dark[some[~light]] = middle[light], middle[~light]
    return 0.5 * (lit + dark), np.full(len(of), np.nan)


def crossed(look: Look, level: NDArray[np.intp], taken: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(facet,) whether there are points on each one's lattice, of its `level`, that are not what it is `taken` (facet,)
    for, seen or not."""
    found = np.zeros(len(level), np.bool_)
    for _, facets, lit in _points(look, level, RIM):
        found[facets] = (lit != taken[facets, None]).any(axis=1)
    return found


def _points(
    look: Look, level: NDArray[np.intp], share: float = _INSET
) -> Iterator[tuple[int, NDArray[np.intp], NDArray[np.bool_]]]:
    """Level by level the facets of it, and (facet, point) which of their lattice's points are seen, each by that
    `share` nearer to the middle."""
    members = [(int(each), np.flatnonzero(level == each)) for each in np.flatnonzero(np.bincount(level))]
    sizes = [(len(facets), len(_lattice(each).points)) for each, facets in members]
    of, places = np.empty(sum(n * m for n, m in sizes), np.intp), np.empty((sum(n * m for n, m in sizes), 3))
    first = 0
    for (each, facets), (count, points) in zip(members, sizes, strict=True):
        own = slice(first, first + count * points)
        of[own].reshape(count, points)[...] = facets[:, None]
        places[own].reshape(count, points, 3)[...] = _aimed(each, share)
        first = own.stop
    seen = look.seen(of, places)
    first = 0
    for (each, facets), (count, points) in zip(members, sizes, strict=True):
        yield each, facets, seen[first : first + count * points].reshape(count, points)
        first += count * points


def _crossings(look: Look, groups: list[_Group], halvings: NDArray[np.intp]) -> tuple[FloatArray, FloatArray, int]:
    """(crossing, 3) barycentric coordinates of where the shadow's edge crosses those of cells, (crossing,) how far off
    what casts it is, and the rays sent, with so many `halvings` (facet,)."""
    of, lit, dark = [], [], []
    for group in groups:
        ends, points = np.take(group.lattice.edges, group.edge, axis=0), group.lattice.points
        start = group.lit[group.row, ends[:, 0]]
        of.append(group.facets[group.row])
        lit.append(np.take(points, np.where(start, ends[:, 0], ends[:, 1]), axis=0))
        dark.append(np.take(points, np.where(start, ends[:, 1], ends[:, 0]), axis=0))
    owner = np.concatenate(of)
    often = halvings[owner]
    found = look.edges(owner, inset(np.concatenate(lit)), inset(np.concatenate(dark)), often)
    return *found, int(often.sum()) + len(owner)


def _straight(
    group: _Group, crossings: FloatArray, hider: FloatArray
) -> tuple[NDArray[np.bool_], list[tuple[NDArray[np.intp], FloatArray, FloatArray]]]:
    """(facet,) which facets a single straight edge, through the `crossings` (crossing, 3), cuts in two, and what is
    seen of those, in triangles, with their :attr:`Lit.hider`."""
    lattice, cells = group.lattice, SPACINGS[group.level]
    side = lattice.rim[group.edge]
    ends = np.flatnonzero(side >= 0)
    of = group.row[ends]  # ascending
    if not len(ends):  # islands alone
        return np.zeros(len(group.facets), np.bool_), []
    count = np.bincount(of, minlength=len(group.facets))
    begin = np.searchsorted(of, np.arange(len(group.facets)))
    first, second = (ends[np.minimum(begin + k, len(ends) - 1)] for k in (0, 1))
    straight = np.asarray((count == 2) & (side[first] != side[second]))
    # Distances from the line through both, in two of the barycentric coordinates.
    start = np.take(crossings, first, axis=0)
    along = np.take(crossings, second, axis=0) - start
    size = np.maximum(np.hypot(along[:, 0], along[:, 1]), 1e-12)
    offset, line = crossings - start[group.row], along[group.row]
    away = (offset[:, 0] * line[:, 1] - offset[:, 1] * line[:, 0]) / size[group.row]
    far = np.zeros(len(group.facets))
    np.maximum.at(far, group.row, np.abs(away))
    straight &= far <= _BOWED / cells**2
    # The line that leaves as much on either side: its ends move along the sides that they are on.
    mean = np.bincount(group.row, away, len(group.facets)) / np.bincount(group.row, minlength=len(group.facets))
    ends_moved = []
    for end in (first, second):
        run = np.eye(3)[side[end] - 2] - np.eye(3)[side[end] - 1]  # of the side
        turn = (run[:, 0] * along[:, 1] - run[:, 1] * along[:, 0]) / size
        step = np.divide(mean, turn, out=np.full(len(mean), np.inf), where=np.abs(turn) > 1e-6)
        moved = crossings[end] + np.where(np.abs(step) < 1.0, step, 0.0)[:, None] * run
        straight &= (np.abs(step) < 1.0) & (moved > -1e-3).all(axis=1)
        ends_moved.append(np.clip(moved, 0.0, 1.0))
    one, other = ends_moved  # rays went by a little within the facet
    ends_moved = [_onto_side(one, other, side[first]), _onto_side(other, one, side[second])]
    row = np.flatnonzero(straight)
    # The corner that both sides share, and those that come after it.
    tip = 3 - side[first[row]] - side[second[row]]
    turned = side[first[row]] == (tip + 1) % 3
    one, other = (each[row] for each in ends_moved)
    ab, ca = np.where(turned[:, None], other, one), np.where(turned[:, None], one, other)
    off = np.stack([hider[first[row]], hider[second[row]]], axis=1)
    off = np.where(turned[:, None], off[:, ::-1], off)  # at ab, at ca
    none = np.full(off.shape, np.nan)
    a, b, c = (np.eye(3)[(tip + k) % 3] for k in range(3))
    alone = group.lit[row, lattice.tips[tip]]
    found = []
    for some, triangle, there in (
        (alone, (a, ab, ca), off), (~alone, (b, c, ca), none), (~alone, (b, ca, ab), off[:, ::-1]),
    ):  # fmt: skip
        found.append((row[some], np.stack([corner[some] for corner in triangle], axis=1), there[some]))
    return straight, found


def _onto_side(points: FloatArray, others: FloatArray, corner: NDArray[np.intp]) -> FloatArray:
    """(point, 3) `points` (point, 3) just within a facet on lines that come from `others` (point, 3), on where these
    cross the side opposite a `corner` (point,); as they are where that is -1, or lines run along the side."""
    row = np.arange(len(points))
    here, there = points[row, corner], others[row, corner]
    step = np.where((corner >= 0) & (there > _ALONG * here), here / np.where(there > here, there - here, 1.0), 0.0)
    return np.asarray(np.clip(points + step[:, None] * (points - others), 0.0, 1.0))


def _whole(
    group: _Group, bitten: tuple[NDArray[np.intp], NDArray[np.intp]]
) -> list[tuple[NDArray[np.intp], FloatArray, FloatArray]]:
    """Cells that are seen as a whole, as large ones as there are, without those that are `bitten` (row, cell)."""
    one, two, three = group.corners
    full: NDArray[np.bool_] = one & two & three
    full[bitten] = False
    tree = [full]
    for _ in range(group.level):
        quarters = tree[-1].reshape(len(full), -1, 4)
        tree.append(quarters[..., 0] & quarters[..., 1] & quarters[..., 2] & quarters[..., 3])
    found = []
    for level, cells in enumerate(reversed(tree)):
        if level:  # those whose larger one is not seen as a whole
            cells = (cells.reshape(len(full), -1, 4) & ~tree[group.level - level + 1][..., None]).reshape(len(full), -1)
        row, cell = np.nonzero(cells)
        lattice = _lattice(level)
        found.append((row, np.take(lattice.points[lattice.cells], cell, axis=0), np.full((len(row), 2), np.nan)))
    return found


def _cut(
    group: _Group, crossings: FloatArray, hider: FloatArray
) -> tuple[list[tuple[NDArray[np.intp], FloatArray, FloatArray]], tuple[NDArray[np.intp], NDArray[np.intp]]]:
    """What is seen of cells that the shadow's edge cuts, in triangles, with their :attr:`Lit.hider`; and the row and
    the cell of those whose corners are all seen, and which a shadow's corner reaches into all the same."""
    lattice = group.lattice
    number = np.full((len(group.facets), len(lattice.edges)), -1)
    number[group.row, group.edge] = np.arange(len(group.row))
    one, two, three = group.corners
    count = one.astype(np.int8) + two + three
    found, bitten = [], (np.zeros(0, np.intp), np.zeros(0, np.intp))
    for corners in (1, 2):
        row, cell = np.nonzero(count == corners)
        # The corner that differs from the two others, and those that come after it.
        odd = np.where(two[row, cell] == (corners == 1), 1, np.where(three[row, cell] == (corners == 1), 2, 0))
        turns = [(odd + k) % 3 for k in range(3)]
        a, b, c = (np.take(lattice.points, lattice.cells[cell, each], axis=0) for each in turns)
        at = [number[row, lattice.sides[cell, turns[i]]] for i in (0, 2)]
        ab, ca = (np.take(crossings, each, axis=0) for each in at)
        of_ab, of_ca = (lattice.rim[lattice.sides[cell, turns[i]]] for i in (0, 2))
        ab, ca = _onto_side(ab, ca, of_ab), _onto_side(ca, ab, of_ca)
        off_ab, off_ca = (np.repeat(hider[each][:, None], 2, axis=1) for each in at)
        off = np.stack([hider[each] for each in at], axis=1)
        none = np.full(off.shape, np.nan)
        x, within, beyond = ab, *np.zeros((2, len(row)), np.bool_)
        if group.level >= _TURNS_FROM:
            before, after = (_before(group, number, crossings, row, cell, turns[i]) for i in (0, 2))
            x, within, beyond = _turn(ab, ca, before, after, (a, b, c))
        # Across the third side, where no corner of a cell tells of it.
        side = turns[1]
        there, beyond = _beyond(lattice, number, row, cell, side, x, beyond)
        straight = ~(within | beyond)
        if corners == 1:
            pieces = [
                ((a, ab, ca), off, straight), ((a, ab, x), off_ab, ~straight), ((a, x, ca), off_ca, ~straight),
            ]  # fmt: skip
        else:
            bitten = row[beyond], there[beyond]
            across = lattice.cells[there], lattice.sides[there] == lattice.sides[cell, side][:, None]
            d = np.take(lattice.points, across[0][np.arange(len(row)), (across[1].argmax(axis=1) + 2) % 3], axis=0)
            by_ab, by_ca = _met(ab, x, b, c), _met(ca, x, b, c)
            pieces = [
                ((b, c, ca), none, straight), ((b, ca, ab), off[:, ::-1], straight),
                ((x, b, c), none, within), ((c, ca, x), off_ca, within), ((b, x, ab), off_ab, within),
                ((b, by_ab, ab), off_ab, beyond), ((c, ca, by_ca), off_ca, beyond),
                ((b, x, by_ab), off_ab, beyond), ((c, by_ca, x), off_ca, beyond),
                ((x, b, d), none, beyond), ((x, d, c), none, beyond),
            ]  # fmt: skip
        for triangle, ends, some in pieces:
            piece = np.empty((np.count_nonzero(some), 3, 3))
            for k, corner in enumerate(triangle):
                piece[:, k] = corner[some]
            found.append((row[some], piece, ends[some]))
    return found, bitten


def _beyond(
    lattice: _Lattice,
    number: NDArray[np.intp],
    row: NDArray[np.intp],
    cell: NDArray[np.intp],
    side: NDArray[np.intp],
    tip: FloatArray,
    beyond: NDArray[np.bool_],
) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """(cut,) the cell across a `side` (cut,) of the `cell` (cut,), and whether a `tip` (cut, 3) that is `beyond` (cut,)
    that side lies in it, and nothing else is known to pass it."""
    there = lattice.beside[cell, side]
    known = (there >= 0) & (number[row[:, None], lattice.sides[there]] < 0).all(axis=1) & beyond
    a, b, c = np.moveaxis(lattice.points[lattice.cells[there]][..., :2], 1, 0)
    for u, v in ((a, b), (b, c), (c, a)):
        known &= _cross(v - u, tip[:, :2] - u) * _cross(b - a, c - a) > 0
    # Of two tips in a cell there is one.
    place = row * len(lattice.cells) + there
    chosen = np.flatnonzero(known)
    first = np.zeros(len(known), np.bool_)
    first[chosen[np.unique(place[chosen], return_index=True)[1]]] = True
    return there, first


def _met(start: FloatArray, tip: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """(cut, 3) where lines from `start` (cut, 3) to a `tip` meet those from `b` to `c`, all (cut, 3)."""
    along, side = (tip - start)[:, :2], (c - b)[:, :2]
    with np.errstate(invalid="ignore", divide="ignore"):
        share = _cross((start - b)[:, :2], along) / _cross(side, along)
    return np.asarray(b + np.where(np.isfinite(share), share, 0.0)[:, None] * (c - b))


def _cross(u: FloatArray, v: FloatArray) -> FloatArray:
    """(...,) of vectors (..., 2)."""
    return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])


def _before(
    group: _Group,
    number: NDArray[np.intp],
    crossings: FloatArray,
    row: NDArray[np.intp],
    cell: NDArray[np.intp],
    side: NDArray[np.intp],
) -> FloatArray:
    """(cut, 3) where the shadow's edge came into the cell before, that across a `side` (cut,) of the `cell` (cut,) of a
    facet in `row` (cut,); NaN where there is none."""
    lattice = group.lattice
    there = lattice.beside[cell, side]
    sides = lattice.sides[there]
    others = np.where(sides == lattice.sides[cell, side][:, None], -1, number[row[:, None], sides])
    found = np.take(crossings, others.max(axis=1), axis=0)
    found[(there < 0) | (others.max(axis=1) < 0)] = np.nan
    return found


def _turn(
    one: FloatArray, other: FloatArray, before: FloatArray, after: FloatArray, cell: tuple[FloatArray, ...]
) -> tuple[FloatArray, NDArray[np.bool_], NDArray[np.bool_]]:
    """(cut, 3) where lines that come in from `before` (cut, 3) by `one` (cut, 3), on the cell's side from its first
    corner to its second, and from `after` by the `other`, on that from the third to the first, meet; and (cut,) whether
    that is within the `cell` (corner) (cut, 3), or beyond its third side: a straight edge ends there, and another one
    goes on, as at a corner of what casts the shadow."""
    (p, q, back, on), (a, b, c) = ([each[:, :2] for each in some] for some in ((one, other, before, after), cell))
    into, out = p - back, q - on

    def size(u: FloatArray) -> FloatArray:  # of an equilateral triangle with sides of 1
        return np.asarray(np.sqrt(np.maximum(u[:, 0] ** 2 + u[:, 1] ** 2 + u[:, 0] * u[:, 1], 1e-300)))

    with np.errstate(invalid="ignore", divide="ignore"):
        turn, whole = _cross(into, out), _cross(b - a, c - a)
        x = p + (_cross(q - p, out) / turn)[:, None] * into
        found = np.abs(turn) * np.sqrt(0.75) > _SHARP * size(into) * size(out)
        found &= (_cross(q - p, out) / turn > 0) & (_cross(q - p, into) / turn > 0)
        found &= (_cross(b - a, x - a) / whole > 0) & (_cross(a - c, x - c) / whole > 0)
        within = _cross(c - b, x - b) / whole > 0
        # Both come by the third side, not by a corner.
        sides = [_cross(x - each, corner - each) / whole for each, corner in ((p, b), (q, c))]
        beyond = found & ~within & (sides[0] < 0) & (sides[1] > 0)
    x = np.where(found[:, None], x, 0.0)
    return np.column_stack([x, 1.0 - x.sum(axis=1)]), found & within, beyond
