"""Lattices of sample points on facets, and the visible triangles of lattice cells that a shadow boundary cuts."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray

SPACINGS = (1, 2, 4, 8, 16, 32)
"""Cells along a facet's edge for each lattice level."""
INSET = 5e-4
"""Share of the way to `_INSET_CENTRE` by which ray targets are moved: far above rounding, far below a cell."""
_INSET_CENTRE = np.array([0.36, 0.31, 0.33])
"""Barycentric point towards which ray targets are moved: off every axis of symmetry, as a ray in the plane of an edge
may slip between two faces."""


class Lattice(NamedTuple):
    """Regular triangular lattice in barycentric coordinates."""

    points: FloatArray
    """(point, 3) barycentric coordinates."""
    cells: NDArray[np.intp]
    """(cell, 3) corner points in the facet's orientation; four consecutive cells form one cell of the level above."""
    edges: NDArray[np.intp]
    """(edge, 2) end points."""
    sides: NDArray[np.intp]
    """(cell, 3) edge from each corner to the next."""
    neighbours: NDArray[np.intp]
    """(cell, 3) cell across each of these edges; -1 outside the facet."""
    border: NDArray[np.intp]
    """(edge,) facet corner opposite the facet side that contains the edge; -1 inside the facet."""
    corner_points: NDArray[np.intp]
    """(3,) points at the facet's corners."""


@cache
def inset_lattice(level: int, share: float) -> FloatArray:
    """(point, 3) ray targets of a lattice, moved by `share` towards the facet's inside."""
    return inset_points(lattice_of(level).points, share)


@cache
def lattice_of(level: int) -> Lattice:
    """Lattice of a level, an index into `SPACINGS`."""
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
    border = np.full(len(edges), -1)
    for corner in range(3):
        border[(points[edges, corner] == 0).all(axis=1)] = corner
    sides = sides.reshape(-1, 3)
    both = np.full((len(edges), 2), -1)
    order = np.argsort(sides.ravel(), kind="stable")
    edge, cell = sides.ravel()[order], order // 3
    first = np.concatenate([[True], edge[1:] != edge[:-1]])
    both[edge[first], 0], both[edge[~first], 1] = cell[first], cell[~first]
    neighbours = np.where(both[sides, 0] == np.arange(len(sides))[:, None], both[sides, 1], both[sides, 0])
    return Lattice(points / n, index, edges, sides, neighbours, border, points.argmax(axis=0))


class LatticeGroup(NamedTuple):
    """Partly visible facets that share one lattice level."""

    facets: NDArray[np.intp]
    lattice: Lattice
    level: int
    unoccluded: NDArray[np.bool_]
    """(facet, point)"""
    corners: tuple[NDArray[np.bool_], ...]
    """(facet, cell) visibility of the first, second and third corner of each cell."""
    row: NDArray[np.intp]
    """(crossing,) facet of the group; `edge` is the lattice edge that the shadow boundary crosses."""
    edge: NDArray[np.intp]

    @staticmethod
    def of(facets: NDArray[np.intp], level: int, unoccluded: NDArray[np.bool_]) -> LatticeGroup:
        """Group with all lattice edges whose ends differ in visibility."""
        lattice = lattice_of(level)
        corners = tuple(np.take(unoccluded, each, axis=1) for each in lattice.cells.T)
        first, second = (np.take(unoccluded, each, axis=1) for each in lattice.edges.T)
        return LatticeGroup(facets, lattice, level, unoccluded, corners, *np.nonzero(first != second))


def inset_points(places: FloatArray, share: float = INSET) -> FloatArray:
    """Ray targets (ray, 3) for barycentric `places` (ray, 3), moved by `share` towards the facet's inside."""
    return np.asarray(places + share * (_INSET_CENTRE - places))


def points_of(level: NDArray[np.intp]) -> NDArray[np.intp]:
    """Number of points of lattices of a `level`."""
    cells = np.array(SPACINGS)[level]
    return np.asarray((cells + 1) * (cells + 2) // 2, np.intp)


_ALONG = 3.0
"""Least ratio of the two ends' distances from a side for a line to be extended to that side."""
_TURNS_FROM, _SHARP = 2, 0.35
"""First lattice level at which shadow corners are sought, and the least sine of their angle: below it straight lines
miss half as much as at a smooth curve."""


def extend_to_side(points: FloatArray, others: FloatArray, corner: NDArray[np.intp]) -> FloatArray:
    """Extend lines from `others` (point, 3) through `points` (point, 3) just inside the facet to its border.

    The border is the side opposite a `corner` (point,); -1, or a line along the side, leaves the point.
    """
    row = np.arange(len(points))
    here, there = points[row, corner], others[row, corner]
    step = np.where((corner >= 0) & (there > _ALONG * here), here / np.where(there > here, there - here, 1.0), 0.0)
    return np.asarray(np.clip(points + step[:, None] * (points - others), 0.0, 1.0))


def cut_cells(
    group: LatticeGroup, crossings: FloatArray, occluder: FloatArray
) -> tuple[list[tuple[NDArray[np.intp], FloatArray, FloatArray]], tuple[NDArray[np.intp], NDArray[np.intp]]]:
    """Visible triangles of cells that a shadow boundary cuts, as (facet row, triangle, occluder); and the row and cell
    of fully visible cells that a shadow's corner enters."""
    lattice = group.lattice
    number = np.full((len(group.facets), len(lattice.edges)), -1)
    number[group.row, group.edge] = np.arange(len(group.row))
    one, two, three = group.corners
    count = one.astype(np.int8) + two + three
    found, entered = [], (np.zeros(0, np.intp), np.zeros(0, np.intp))
    for corners in (1, 2):
        row, cell = np.nonzero(count == corners)
        # The corner that differs from the two others, and those that come after it.
        odd = np.where(two[row, cell] == (corners == 1), 1, np.where(three[row, cell] == (corners == 1), 2, 0))
        turns = [(odd + k) % 3 for k in range(3)]
        a, b, c = (np.take(lattice.points, lattice.cells[cell, each], axis=0) for each in turns)
        at = [number[row, lattice.sides[cell, turns[i]]] for i in (0, 2)]
        ab, ca = (np.take(crossings, each, axis=0) for each in at)
        of_ab, of_ca = (lattice.border[lattice.sides[cell, turns[i]]] for i in (0, 2))
        ab, ca = extend_to_side(ab, ca, of_ab), extend_to_side(ca, ab, of_ca)
        off_ab, off_ca = (np.repeat(occluder[each][:, None], 2, axis=1) for each in at)
        off = np.stack([occluder[each] for each in at], axis=1)
        none = np.full(off.shape, np.nan)
        x, within, beyond = ab, *np.zeros((2, len(row)), np.bool_)
        if group.level >= _TURNS_FROM:
            before, after = (_entry_point(group, number, crossings, row, cell, turns[i]) for i in (0, 2))
            x, within, beyond = _corner_point(ab, ca, before, after, (a, b, c))
        # Across the third side, which no corner of the cell detects.
        side = turns[1]
        there, beyond = _neighbour_cell(lattice, number, row, cell, side, x, beyond)
        straight = ~(within | beyond)
        if corners == 1:
            pieces = [
                ((a, ab, ca), off, straight), ((a, ab, x), off_ab, ~straight), ((a, x, ca), off_ca, ~straight),
            ]  # fmt: skip
        else:
            entered = row[beyond], there[beyond]
            across = lattice.cells[there], lattice.sides[there] == lattice.sides[cell, side][:, None]
            d = np.take(lattice.points, across[0][np.arange(len(row)), (across[1].argmax(axis=1) + 2) % 3], axis=0)
            by_ab, by_ca = _line_crossing(ab, x, b, c), _line_crossing(ca, x, b, c)
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
    return found, entered


def _neighbour_cell(
    lattice: Lattice,
    number: NDArray[np.intp],
    row: NDArray[np.intp],
    cell: NDArray[np.intp],
    side: NDArray[np.intp],
    tip: FloatArray,
    beyond: NDArray[np.bool_],
) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """(cut,) cell across a `side`, and whether it contains the `tip` (cut, 3) and no other boundary."""
    there = lattice.neighbours[cell, side]
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


def _line_crossing(start: FloatArray, tip: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """(cut, 3) intersections of the lines from `start` to `tip` with those from `b` to `c`, all (cut, 3)."""
    along, side = (tip - start)[:, :2], (c - b)[:, :2]
    with np.errstate(invalid="ignore", divide="ignore"):
        share = _cross((start - b)[:, :2], along) / _cross(side, along)
    return np.asarray(b + np.where(np.isfinite(share), share, 0.0)[:, None] * (c - b))


def _cross(u: FloatArray, v: FloatArray) -> FloatArray:
    """(...,) cross products of vectors (..., 2)."""
    return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])


def _entry_point(
    group: LatticeGroup,
    number: NDArray[np.intp],
    crossings: FloatArray,
    row: NDArray[np.intp],
    cell: NDArray[np.intp],
    side: NDArray[np.intp],
) -> FloatArray:
    """(cut, 3) point where the shadow boundary entered the cell across a `side` (cut,); NaN without one."""
    lattice = group.lattice
    there = lattice.neighbours[cell, side]
    sides = lattice.sides[there]
    others = np.where(sides == lattice.sides[cell, side][:, None], -1, number[row[:, None], sides])
    found = np.take(crossings, others.max(axis=1), axis=0)
    found[(there < 0) | (others.max(axis=1) < 0)] = np.nan
    return found


def _corner_point(
    one: FloatArray, other: FloatArray, before: FloatArray, after: FloatArray, cell: tuple[FloatArray, ...]
) -> tuple[FloatArray, NDArray[np.bool_], NDArray[np.bool_]]:
    """(cut, 3) intersection of the lines `before`-`one` and `after`-`other`, (cut, 3) each; and (cut,) whether it lies
    within the `cell` or beyond the cell's third side."""
    (p, q, back, on), (a, b, c) = ([each[:, :2] for each in some] for some in ((one, other, before, after), cell))
    buffer, out = p - back, q - on

    def size(u: FloatArray) -> FloatArray:  # of an equilateral triangle with sides of 1
        return np.asarray(np.sqrt(np.maximum(u[:, 0] ** 2 + u[:, 1] ** 2 + u[:, 0] * u[:, 1], 1e-300)))

    with np.errstate(invalid="ignore", divide="ignore"):
        turn, whole = _cross(buffer, out), _cross(b - a, c - a)
        x = p + (_cross(q - p, out) / turn)[:, None] * buffer
        found = np.abs(turn) * np.sqrt(0.75) > _SHARP * size(buffer) * size(out)
        found &= (_cross(q - p, out) / turn > 0) & (_cross(q - p, buffer) / turn > 0)
        found &= (_cross(b - a, x - a) / whole > 0) & (_cross(a - c, x - c) / whole > 0)
        within = _cross(c - b, x - b) / whole > 0
        # Both come by the third side, not by a corner.
        sides = [_cross(x - each, corner - each) / whole for each, corner in ((p, b), (q, c))]
        beyond = found & ~within & (sides[0] < 0) & (sides[1] > 0)
    x = np.where(found[:, None], x, 0.0)
    return np.column_stack([x, 1.0 - x.sum(axis=1)]), found & within, beyond
