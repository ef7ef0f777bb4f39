"""Tubes at the rim of things: where what their rays hit changes is found by bisection, and they are cut there.

Edges of meshes are straight seen from the source, and so is the cut then. A rim that is round is met in the middle of
the cut as well, and pieces follow it by a parabola.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tests.reference.sbr import lattice
from tests.reference.sbr.hits import Hits, Index
from tests.reference.sbr.rims import Rims

MOST_HALVINGS = 10
"""A rim is known to 2^-10 of an edge at best."""


class Cut(NamedTuple):
    """Pieces of tubes, each of which hits one thing only; pieces that hit nothing are left out."""

    nodes: lattice.Nodes
    """(piece, 6, 3) corners, then the middles of the edges opposite to them, which may be off the straight line."""
    sign: NDArray[np.int64]
    """(piece,) what is hit."""
    tube: Index
    """(piece,) the tube it is of."""
    off: NDArray[np.float64]
    """(tube,) by how much rims may be off the cut, relative to the tube's width; 1 where it isn't clear."""
    terminator: Rims
    """Where one thing is before another."""
    rim_of: Index
    """(rim,) the tube that each is in."""
    clear: NDArray[np.bool_]
    """(tube,) whether no third thing was met."""


def cut(hits: Hits, corners: lattice.Nodes, sign: NDArray[np.int64], halvings: NDArray[np.int64]) -> Cut:
    """Cut tubes (tube, 3, 3), at whose corners, middles of edges and centre the rays hit `sign` (tube, 7).

    Where the three corners hit three things, or all of them the same, tubes are not cut: each is whole and of what its
    centre hits. Rims are found with so many `halvings` (tube,) of the edges.
    """
    ends = sign[:, :3]
    alone = np.full(len(corners), -1)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        alone[(ends[:, j] == ends[:, k]) & (ends[:, i] != ends[:, j])] = i
    off, clear = np.ones(len(corners)), np.zeros(len(corners), np.bool_)
    plain = np.flatnonzero(alone < 0)
    kept = plain[sign[plain, 6] != 0]
    pieces, signs, tubes = [with_middles(corners[kept])], [sign[kept, 6]], [kept]
    tube = np.flatnonzero(alone >= 0)
    terminator, rim_of = _between_three(hits, corners, ends, halvings)
    if len(tube):
        own_corner, halvings = alone[tube], halvings[tube]
        a, b, c = (corners[tube, (own_corner + step) % 3] for step in range(3))
        own, others = sign[tube, own_corner], sign[tube, (own_corner + 1) % 3]
        near_b, far_b = _terminator_error(hits, a, b, own, halvings)
        near_c, far_c = _terminator_error(hits, a, c, own, halvings)
        # Half way along the cut: how far off is the rim there, on the way from the lone corner?
        foot = lattice.middle(near_b, near_c)
        near, far = _terminator_error(hits, a, _beyond(a, foot, 2.0), own, halvings)
        width = np.maximum(np.maximum(_span(b, c), np.maximum(_span(a, b), _span(a, c))), 1)
        edge_curvature = _span(near, foot) / width
        # A straight edge of a mesh is one but for the last halving.
        straight = edge_curvature < 2.0 ** (2.0 - halvings)
        near, far = (np.where(straight[:, None], lattice.middle(*pair), bent)
                     for pair, bent in (((near_b, near_c), near), ((far_b, far_c), far)))  # fmt: skip
        # Plane pieces end between the last ray that hits and the first one that doesn't; round ones at the former, as
        # nobody knows how they go on.
        inner = _ended(hits, a, (near_b, near_c, near), (far_b, far_c, far))
        outer = _ended(hits, b, (far_b, far_c, far), (near_b, near_c, near))
        triangles = [(a, inner[0], inner[1]), (outer[0], b, c), (outer[0], c, outer[1])]
        made = [with_middles(np.stack(triangle, axis=1)) for triangle in triangles]
        made[0][:, 3], made[2][:, 4] = inner[2], outer[2]
        pieces += made
        signs += [own, others, others]
        tubes += [tube, tube, tube]
        if hits.before is None:
            one, two = np.flatnonzero(straight), np.flatnonzero(~straight)
            lane = np.concatenate([one, two, two])
            lines = [
                np.stack([np.concatenate([p[one], p[two], m[two]]), np.concatenate([q[one], m[two], q[two]])], axis=1)
                for p, q, m in ((near_b, near_c, near), (far_b, far_c, far))
            ]
            more, line = Rims.between(hits, a[lane], *lines)
            terminator, rim_of = Rims.joined([terminator, more]), np.concatenate([rim_of, tube[lane[line]]])
        # What the other rays hit must be one of both.
        seven = sign[tube]
        known = ((seven == own[:, None]) | (seven == others[:, None])).all(axis=1)
        clear[tube] = known
        for each in (far_b, far_c):
            clear[tube] &= hits.sign[hits.rows(each)] == others
        off[tube] = np.where(
            known, np.minimum(2.0**-halvings + np.where(straight, 0.0, 2.0 * edge_curvature**2), 1.0), 1.0
        )
    piece, found, tube_of = np.concatenate(pieces), np.concatenate(signs), np.concatenate(tubes)
    kept = np.flatnonzero(found != 0)
    return Cut(piece[kept], found[kept], tube_of[kept], off, terminator, rim_of, clear)


def _between_three(
    hits: Hits, corners: lattice.Nodes, ends: NDArray[np.int64], halvings: NDArray[np.int64]
) -> tuple[Rims, Index]:
    """Rims of what is nearest, in tubes (tube, 3, 3) whose corners hit three things `ends` (tube, 3); and which tubes
    these are."""
    tube = np.flatnonzero((ends != ends[:, [1, 2, 0]]).all(axis=1) & (hits.before is None))
    leg = hits.leg[hits.rows(corners[tube].reshape(-1, 3))].reshape(-1, 3)
    own = np.argmin(np.where(ends[tube] != 0, leg, np.inf), axis=1)
    a, b, c = (corners[tube, (own + step) % 3] for step in range(3))
    sides = [_terminator_error(hits, a, each, ends[tube, own], halvings[tube]) for each in (b, c)]
    near, far = (np.stack([side[which] for side in sides], axis=1) for which in (0, 1))
    terminator, line = Rims.between(hits, a, near, far)
    return terminator, tube[line]


def _ended(
    hits: Hits, inside: lattice.Nodes, last: tuple[lattice.Nodes, ...], beyond: tuple[lattice.Nodes, ...]
) -> list[lattice.Nodes]:
    """Where pieces end whose rays hit what those through `inside` do, at the `last` of them and not `beyond`."""
    rows = hits.rows(inside)
    plane = (hits.patch[rows] == 0).all(axis=(1, 2))[:, None]
    return [np.where(plane, lattice.middle(*pair), pair[0]) for pair in zip(last, beyond, strict=True)]


def with_middles(corners: lattice.Nodes) -> lattice.Nodes:
    """(tube, 6, 3) corners (tube, 3, 3), and the middles of the edges opposite to them."""
    a, b, c = (corners[:, each] for each in range(3))
    return np.stack([a, b, c, lattice.middle(b, c), lattice.middle(c, a), lattice.middle(a, b)], axis=1)


def _terminator_error(
    hits: Hits, start: lattice.Nodes, end: lattice.Nodes, own: NDArray[np.int64], halvings: NDArray[np.int64]
) -> tuple[lattice.Nodes, lattice.Nodes]:
    """Nodes to both sides of the place between `start`, where rays hit `own`, and `end` where that changes."""
    start, end = start.copy(), end.copy()
    for step in range(int(halvings.max(initial=0))):
        # The places tried are the same from either end, so that neighbours share these rays.
        lane = np.flatnonzero(halvings > step)
        half = lattice.middle(start[lane], end[lane])
        rows = hits.rows(half)
        same = (hits.sign[rows] == own[lane])[:, None]
        start[lane], end[lane] = np.where(same, half, start[lane]), np.where(same, end[lane], half)
    return start, end


def _beyond(a: lattice.Nodes, b: lattice.Nodes, times: float) -> lattice.Nodes:
    """`times` as far from a as b is, on the same face of the octahedron if that reaches so far."""
    size = np.abs(a) + ((np.abs(b) - np.abs(a)) * times).astype(np.int64)
    sign = np.where(a + b < 0, -1, 1)
    size[:, :2] = np.clip(size[:, :2], 0, lattice.SIZE)
    over = np.maximum(size[:, 0] + size[:, 1] - lattice.SIZE, 0)
    size[:, 1] -= np.minimum(over, size[:, 1])
    size[:, 0] -= np.maximum(size[:, 0] + size[:, 1] - lattice.SIZE, 0)
    size[:, 2] = lattice.SIZE - size[:, 0] - size[:, 1]
    return np.asarray(size * sign)


def _span(a: lattice.Nodes, b: lattice.Nodes) -> NDArray[np.float64]:
    return np.asarray(np.sqrt(((a - b).astype(np.float64) ** 2).sum(axis=1)))
