"""The lit parts of facets that a shadow's edge passes.

Points of a lattice on the facet are looked at; where two neighbours differ, the shadow's edge between them is found by
halving, and straight lines join what is found (marching triangles). What is cut off where the edge is bent falls
with the square of the lattice's spacing. As the facet moves its lit part changes with the shadow, not cell by cell.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.records import FloatArray

SPACINGS = (1, 2, 4, 8, 16, 32)
"""Cells along a facet's edge, level by level."""
_HALVINGS = (4, 8)
"""How often the edge of a cell is halved to find the shadow's edge on it, at least and at most."""
_STRAY = 0.05
"""Phase that the place found may be off by before it is halved again [rad, root mean square]."""

RIM = 0.05
"""Rays that tell whether a facet is seen go to points so much nearer to its middle: of a face that looks away, behind
the rim of its body, the very corner may be taken for seen."""
_INSET = 5e-4
_AIM = np.array([0.36, 0.31, 0.33])
"""Rays go to points that much nearer to this one of the facet, barycentric: a ray in the very plane of an edge before
it may get through between the two faces that meet there, as rays to corners of symmetric bodies do."""


class Look(Protocol):
    """Tells what is seen of facets: :class:`rfgen_sionna.scene.targets.Targets` does, by rays."""

    def seen(self, of: NDArray[np.intp], places: FloatArray, /) -> NDArray[np.bool_]:
        """(ray,) whether the points at barycentric `places` (ray, 3) on facets `of` (ray,) are seen."""

    def edges(
        self, of: NDArray[np.intp], lit: FloatArray, dark: FloatArray, halvings: NDArray[np.intp], /
    ) -> FloatArray:
        """(ray, 3) where on facets `of` (ray,) the shadow's edge is between the points `lit` (ray, 3), which are seen,
        and `dark` (ray, 3), after so many `halvings` (ray,)."""


class Lit(NamedTuple):
    """What is seen of facets."""

    fraction: FloatArray
    """(facet,) share of the area."""
    owner: NDArray[np.intp]
    """(piece,) facet that each piece is of; those that are seen as a whole, or not at all, have none."""
    pieces: FloatArray
    """(piece, corner, 3) barycentric coordinates of the triangles that are seen."""
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
    return _Lattice(points / n, index, edges, sides.reshape(-1, 3))


class _Group(NamedTuple):
    """Facets of one level."""

    facets: NDArray[np.intp]
    lattice: _Lattice
    level: int
    lit: NDArray[np.bool_]
    """(facet, point)"""
    row: NDArray[np.intp]
    """(crossing,) facet of the group, and the edge that the shadow's edge crosses."""
    edge: NDArray[np.intp]


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
    for each, facets, lit in _points(look, level):
        found = _lattice(each)
        sent += lit.size
        row, edge = np.nonzero(lit[:, found.edges[:, 0]] != lit[:, found.edges[:, 1]])
        groups.append(_Group(facets, found, each, lit, row, edge))
    # Where an edge crosses a side is known to the root of a twelfth of what is left of it.
    stray = width / (np.array(SPACINGS)[level] * np.sqrt(12.0) * _STRAY)
    crossings, more = _crossings(
        look, groups, np.clip(np.ceil(np.log2(np.maximum(stray, 1.0))), *_HALVINGS).astype(np.intp)
    )
    fraction = np.zeros(len(level))
    owners, pieces = [np.zeros(0, np.intp)], [np.zeros((0, 3, 3))]
    first = 0
    for group in groups:
        fraction[group.facets[group.lit.all(axis=1)]] = 1.0
        last = first + len(group.row)
        for owner, piece in (*_whole(group), *_cut(group, crossings[first:last])):
            owners.append(group.facets[owner])
            pieces.append(piece)
        first = last
    owner, piece = np.concatenate(owners), np.concatenate(pieces)
    fraction += np.bincount(owner, np.abs(np.linalg.det(piece)), len(level))
    return Lit(np.minimum(fraction, 1.0), owner, piece, sent + more)


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
    members = [(int(each), np.flatnonzero(level == each)) for each in np.unique(level)]
    of = [np.repeat(facets, len(_lattice(each).points)) for each, facets in members]
    places = [np.tile(_lattice(each).points, (len(facets), 1)) for each, facets in members]
    every = np.concatenate([np.zeros((0, 3)), *places])
    seen = look.seen(np.concatenate([np.zeros(0, np.intp), *of]), inset(every, share))
    first = 0
    for each, facets in members:
        last = first + len(facets) * len(_lattice(each).points)
        yield each, facets, seen[first:last].reshape(len(facets), -1)
        first = last


def _crossings(look: Look, groups: list[_Group], halvings: NDArray[np.intp]) -> tuple[FloatArray, int]:
    """(crossing, 3) barycentric coordinates of where the shadow's edge crosses those of cells, and the rays sent, with
    so many `halvings` (facet,)."""
    of, lit, dark = [np.zeros(0, np.intp)], [np.zeros((0, 3))], [np.zeros((0, 3))]
    for group in groups:
        ends = group.lattice.edges[group.edge]
        swapped = ~group.lit[group.row, ends[:, 0]]
        ends[swapped] = ends[swapped, ::-1]
        of.append(group.facets[group.row])
        lit.append(group.lattice.points[ends[:, 0]])
        dark.append(group.lattice.points[ends[:, 1]])
    owner = np.concatenate(of)
    often = halvings[owner]
    return look.edges(owner, inset(np.concatenate(lit)), inset(np.concatenate(dark)), often), int(often.sum())


def _whole(group: _Group) -> list[tuple[NDArray[np.intp], FloatArray]]:
    """Cells that are seen as a whole, as large ones as there are, of facets that are not."""
    all_cells = np.all(group.lit, axis=1, keepdims=True)
    full = np.asarray(group.lit[:, group.lattice.cells].all(axis=2) & ~all_cells)
    tree: list[NDArray[np.bool_]] = [full]
    for _ in range(group.level):
        tree.append(np.asarray(tree[-1].reshape(len(full), -1, 4).all(axis=2)))
    found = []
    for level, cells in enumerate(reversed(tree)):
        above: NDArray[np.bool_] = tree[group.level - level + 1] if level else np.zeros((len(full), 1), np.bool_)
        row, cell = np.nonzero(cells & ~np.repeat(above, 4 if level else 1, axis=1))
        lattice = _lattice(level)
        found.append((row, lattice.points[lattice.cells[cell]]))
    return found


def _cut(group: _Group, crossings: FloatArray) -> list[tuple[NDArray[np.intp], FloatArray]]:
    """What is seen of cells that the shadow's edge cuts, in triangles."""
    lattice = group.lattice
    number = np.full((len(group.facets), len(lattice.edges)), -1)
    number[group.row, group.edge] = np.arange(len(group.row))
    lit = group.lit[:, lattice.cells]
    count = lit.sum(axis=2)
    found = []
    for corners in (1, 2):
        row, cell = np.nonzero(count == corners)
        # The corner that differs from the two others, and those that come after it.
        odd = (lit[row, cell] == (corners == 1)).argmax(axis=1)
        turn = (odd[:, None] + np.arange(3)) % 3
        a, b, c = np.moveaxis(lattice.points[lattice.cells[cell[:, None], turn]], 1, 0)
        sides = lattice.sides[cell[:, None], turn]
        ab, ca = (crossings[number[row, sides[:, i]]] for i in (0, 2))
        if corners == 1:
            found.append((row, np.stack([a, ab, ca], axis=1)))
        else:
            found += [(row, np.stack([b, c, ca], axis=1)), (row, np.stack([b, ca, ab], axis=1))]
    return found
