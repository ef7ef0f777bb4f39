"""Visible polygons of facets that a shadow boundary crosses.

Lattice points on the facet are tested. Between visible and occluded neighbours the boundary is bisected, and straight
lines join the crossings (marching triangles). Truncation of a curved boundary falls with the square of the spacing. A
facet with a single straight boundary becomes one or two triangles.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.tracing.shadows.lattices import (
    INSET,
    SPACINGS,
    LatticeGroup,
    cut_cells,
    extend_to_side,
    inset_lattice,
    inset_points,
    lattice_of,
)

_HALVINGS = (5, 5, 6, 7, 8, 9)
"""Least number of bisections per lattice level: enough to decide whether three crossings are straight to
`_MAX_SAGITTA`."""
_MOST_HALVINGS = 9
"""Most bisections: 1/512 of a cell is far below a wavelength on any facet."""
_MAX_STRAY = 0.05
"""Phase error of a crossing above which it is bisected again [rad, root mean square]."""

_MAX_SAGITTA = 0.1
"""Largest deviation of a straight boundary, times the squared number of cells along an edge: as much as lines from cell
to cell miss."""

EDGE_INSET = 0.05
"""Inset of the rays that test whole facets: near the silhouette a corner of a face that faces away may seem visible."""


class VisibilitySampler(Protocol):
    """Visibility test of points on facets, e.g. :class:`rfgen_sionna.scene.point_visibility.PointVisibility`."""

    def visible(self, of: NDArray[np.intp], places: FloatArray, /) -> NDArray[np.bool_]:
        """(ray,) visibility of barycentric `places` (ray, 3) on facets `of` (ray,)."""

    def edges(
        self, of: NDArray[np.intp], unoccluded: FloatArray, occluded: FloatArray, halvings: NDArray[np.intp], /
    ) -> tuple[FloatArray, FloatArray]:
        """(ray, 3) shadow boundary between `unoccluded` and `occluded` points (ray, 3) of facets `of`, barycentric, by
        bisection; and (ray,) the occluder's distance over the facet's."""


class VisiblePolygons(NamedTuple):
    """Visible parts of facets."""

    fraction: FloatArray
    """(facet,) visible share of the area."""
    owner: NDArray[np.intp]
    """(piece,) facet of each piece; fully visible and fully occluded facets have no pieces."""
    pieces: FloatArray
    """(piece, corner, 3) barycentric coordinates of the visible triangles."""
    occluder: FloatArray
    """(piece, 2) occluder's distance over the facet's, 0 … 1, at both ends of the shadow boundary, which runs from a
    piece's second corner to its third; NaN without a boundary. The visible side is on the left of the boundary."""
    rays: int


def find_visible_polygons(sampler: VisibilitySampler, level: NDArray[np.intp], width: FloatArray) -> VisiblePolygons:
    """Sample facets of phase range `width` (facet,) [rad] on lattices of their `level` (facet,), an index into
    `SPACINGS`."""
    groups, sent = [], 0
    fraction = np.zeros(len(level))
    for each, facets, unoccluded in _points(sampler, level):
        sent += unoccluded.size
        visible = unoccluded.sum(axis=1)
        fraction[facets[visible == unoccluded.shape[1]]] = 1.0
        if len(mixed := np.flatnonzero((visible > 0) & (visible < unoccluded.shape[1]))):
            groups.append(LatticeGroup.of(facets[mixed], each, unoccluded[mixed]))
    if not groups:
        return VisiblePolygons(fraction, np.zeros(0, np.intp), np.zeros((0, 3, 3)), np.zeros((0, 2)), sent)
    # Uniform error within the last bisected interval: its length over the root of 12.
    stray = width / (np.array(SPACINGS)[level] * np.sqrt(12.0) * _MAX_STRAY)
    asked = np.ceil(np.log2(np.maximum(stray, 1.0)))
    halvings = np.clip(asked, np.array(_HALVINGS)[level], _MOST_HALVINGS).astype(np.intp)
    crossings, occluder, bisect_edges = _crossings(sampler, groups, halvings)
    owners, pieces, occluders, first = [], [], [], 0
    for group in groups:
        last = first + len(group.row)
        own, before = crossings[first:last], occluder[first:last]
        straight, found = _straight(group, own, before)
        if not straight.all():
            rest = np.flatnonzero(~straight)
            bent = LatticeGroup.of(group.facets[rest], group.level, group.unoccluded[rest])
            others = ~straight[group.row]
            cut, entered = cut_cells(bent, own[others], before[others])
            more = (*_whole_cells(bent, entered), *cut)
            found += [(rest[owner], piece, ends) for owner, piece, ends in more]
        owners += [group.facets[owner] for owner, _, _ in found]
        pieces += [piece for _, piece, _ in found]
        occluders += [ends for _, _, ends in found]
        first = last
    owner, piece = np.concatenate(owners), np.concatenate(pieces)
    # The third coordinate follows from the others, whose determinant is the share of the area.
    (a, b), (c, d) = (piece[:, k, :2].T - piece[:, 0, :2].T for k in (1, 2))
    fraction += np.bincount(owner, np.abs(a * d - b * c), len(level))
    return VisiblePolygons(np.minimum(fraction, 1.0), owner, piece, np.concatenate(occluders), sent + bisect_edges)


def bisect_edges(
    visible: Callable[[NDArray[np.intp], FloatArray], NDArray[np.bool_]],
    of: NDArray[np.intp],
    unoccluded: FloatArray,
    occluded: FloatArray,
    halvings: NDArray[np.intp],
) -> tuple[FloatArray, FloatArray]:
    """:meth:`VisibilitySampler.edges` from visibility tests alone; the occluder's distance is NaN."""
    unoccluded, occluded = unoccluded.copy(), occluded.copy()
    for step in range(int(halvings.max(initial=0))):
        some = np.flatnonzero(halvings > step)
        middle = 0.5 * (unoccluded[some] + occluded[some])
        light = visible(of[some], middle)
        unoccluded[some[light]], occluded[some[~light]] = middle[light], middle[~light]
    return 0.5 * (unoccluded + occluded), np.full(len(of), np.nan)


def crossed_by_edges(
    sampler: VisibilitySampler, level: NDArray[np.intp], taken: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """(facet,) whether any lattice point differs in visibility from `taken` (facet,)."""
    found = np.zeros(len(level), np.bool_)
    for _, facets, unoccluded in _points(sampler, level, EDGE_INSET):
        found[facets] = (unoccluded != taken[facets, None]).any(axis=1)
    return found


def _points(
    sampler: VisibilitySampler, level: NDArray[np.intp], share: float = INSET
) -> Iterator[tuple[int, NDArray[np.intp], NDArray[np.bool_]]]:
    """For each level: level, facets, and (facet, point) visibility of their lattice points, inset by `share`."""
    members = [(int(each), np.flatnonzero(level == each)) for each in np.flatnonzero(np.bincount(level))]
    sizes = [(len(facets), len(lattice_of(each).points)) for each, facets in members]
    of, places = np.empty(sum(n * m for n, m in sizes), np.intp), np.empty((sum(n * m for n, m in sizes), 3))
    first = 0
    for (each, facets), (count, points) in zip(members, sizes, strict=True):
        own = slice(first, first + count * points)
        of[own].reshape(count, points)[...] = facets[:, None]
        places[own].reshape(count, points, 3)[...] = inset_lattice(each, share)
        first = own.stop
    visible = sampler.visible(of, places)
    first = 0
    for (each, facets), (count, points) in zip(members, sizes, strict=True):
        yield each, facets, visible[first : first + count * points].reshape(count, points)
        first += count * points


def _crossings(
    sampler: VisibilitySampler, groups: list[LatticeGroup], halvings: NDArray[np.intp]
) -> tuple[FloatArray, FloatArray, int]:
    """(crossing, 3) barycentric crossings of the shadow boundary, (crossing,) occluder ratio, and number of rays."""
    of, unoccluded, occluded = [], [], []
    for group in groups:
        ends, points = np.take(group.lattice.edges, group.edge, axis=0), group.lattice.points
        start = group.unoccluded[group.row, ends[:, 0]]
        of.append(group.facets[group.row])
        unoccluded.append(np.take(points, np.where(start, ends[:, 0], ends[:, 1]), axis=0))
        occluded.append(np.take(points, np.where(start, ends[:, 1], ends[:, 0]), axis=0))
    owner = np.concatenate(of)
    often = halvings[owner]
    found = sampler.edges(
        owner, inset_points(np.concatenate(unoccluded)), inset_points(np.concatenate(occluded)), often
    )
    return *found, int(often.sum()) + len(owner)


def _straight(
    group: LatticeGroup, crossings: FloatArray, occluder: FloatArray
) -> tuple[NDArray[np.bool_], list[tuple[NDArray[np.intp], FloatArray, FloatArray]]]:
    """(facet,) whether one straight boundary cuts the facet in two, and the visible triangles of those facets."""
    lattice, cells = group.lattice, SPACINGS[group.level]
    side = lattice.border[group.edge]
    ends = np.flatnonzero(side >= 0)
    of = group.row[ends]  # ascending
    if not len(ends):  # closed curves only
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
    straight &= far <= _MAX_SAGITTA / cells**2
    # Fitted line with zero mean deviation: its ends move along their sides.
    mean = np.bincount(group.row, away, len(group.facets)) / np.bincount(group.row, minlength=len(group.facets))
    ends_moved = []
    for end in (first, second):
        run = np.eye(3)[side[end] - 2] - np.eye(3)[side[end] - 1]  # of the side
        turn = (run[:, 0] * along[:, 1] - run[:, 1] * along[:, 0]) / size
        step = np.divide(mean, turn, out=np.full(len(mean), np.inf), where=np.abs(turn) > 1e-6)
        moved = crossings[end] + np.where(np.abs(step) < 1.0, step, 0.0)[:, None] * run
        straight &= (np.abs(step) < 1.0) & (moved > -1e-3).all(axis=1)
        ends_moved.append(np.clip(moved, 0.0, 1.0))
    one, other = ends_moved  # rays were inset
    ends_moved = [extend_to_side(one, other, side[first]), extend_to_side(other, one, side[second])]
    row = np.flatnonzero(straight)
    # The corner that both sides share, and those that come after it.
    tip = 3 - side[first[row]] - side[second[row]]
    turned = side[first[row]] == (tip + 1) % 3
    one, other = (each[row] for each in ends_moved)
    ab, ca = np.where(turned[:, None], other, one), np.where(turned[:, None], one, other)
    off = np.stack([occluder[first[row]], occluder[second[row]]], axis=1)
    off = np.where(turned[:, None], off[:, ::-1], off)  # at ab, at ca
    none = np.full(off.shape, np.nan)
    a, b, c = (np.eye(3)[(tip + k) % 3] for k in range(3))
    alone = group.unoccluded[row, lattice.corner_points[tip]]
    found = []
    for some, triangle, there in (
        (alone, (a, ab, ca), off), (~alone, (b, c, ca), none), (~alone, (b, ca, ab), off[:, ::-1]),
    ):  # fmt: skip
        found.append((row[some], np.stack([corner[some] for corner in triangle], axis=1), there[some]))
    return straight, found


def _whole_cells(
    group: LatticeGroup, entered: tuple[NDArray[np.intp], NDArray[np.intp]]
) -> list[tuple[NDArray[np.intp], FloatArray, FloatArray]]:
    """Fully visible cells, merged into the largest ones, without the `entered` (row, cell)."""
    one, two, three = group.corners
    full: NDArray[np.bool_] = one & two & three
    full[entered] = False
    tree = [full]
    for _ in range(group.level):
        quarters = tree[-1].reshape(len(full), -1, 4)
        tree.append(quarters[..., 0] & quarters[..., 1] & quarters[..., 2] & quarters[..., 3])
    found = []
    for level, cells in enumerate(reversed(tree)):
        if level:  # those whose larger cell is not fully visible
            cells = (cells.reshape(len(full), -1, 4) & ~tree[group.level - level + 1][..., None]).reshape(len(full), -1)
        row, cell = np.nonzero(cells)
        lattice = lattice_of(level)
        found.append((row, np.take(lattice.points[lattice.cells], cell, axis=0), np.full((len(row), 2), np.nan)))
    return found
