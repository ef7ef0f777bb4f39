"""Candidate pairs of surface patches for a specular double bounce.

Directions of rays from a patch are known within twice the turn of its normals, directions to another patch within a
ball around each. A pair is excluded where one patch lies outside the rays of the other, where rays that leave both are
not opposite, or where one rises less above the other than rays that leave that. No ray is sent: blocks of patches are
tested first, then their patches, then halves of these.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.scene.kernels import FrozenKernel, drjit_types, upload
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.tracing.curved.surface_patches import (
    COLUMNS,
    NEVER,
    ROUNDING,
    PatchSubdivision,
    SurfacePatches,
    angular_radius,
)

MAX_SPREAD = 0.25
"""Directions are refined to this spread [rad], over which misses are about linear."""
MIN_PATCH_SIZE = 1 / 64
"""Smallest patch that is halved, as a share of the least distance of both points: opposite normals of a face turn over
the smallest patch, and near the radar any direction is possible."""
BLOCK_FANOUT, MAX_BLOCKS = 2, 256
"""Parts of each block, and most blocks of the first level."""
BATCH = 1 << 21
"""Pairs per batch, which bounds memory."""
_COSINE_ROUNDING = 1e-6
"""Above the rounding of cosines in single precision."""

Pairs = tuple[NDArray[np.intp], NDArray[np.intp]]
"""(pair,) numbers of both patches."""


@dataclass(frozen=True)
class PathLimits:
    """Limits of the path."""

    shortest: float
    """Least distance of both points [m]."""
    longest: float
    """Most path length, out and back [m]."""


def candidate_pairs(subdivision: PatchSubdivision, required: NDArray[np.bool_], limits: PathLimits) -> Iterator[Pairs]:
    """Pairs of patches with directions within `MAX_SPREAD`, in batches; at least one of each is on a `required` (face,)
    face."""
    waiting = [_initial_pairs(subdivision, required[subdivision.pieces.facet], limits)]
    while waiting:
        one, other = waiting.pop()
        if len(one) > BATCH // 4:
            waiting.append((one[BATCH // 4 :], other[BATCH // 4 :]))
            one, other = one[: BATCH // 4], other[: BATCH // 4]
        while waiting and len(one) + len(waiting[-1][0]) < BATCH // 4:
            one, other = (np.concatenate(each) for each in zip((one, other), waiting.pop(), strict=True))
        pieces = subdivision.pieces
        apart = lengths(pieces.middle[one] - pieces.middle[other])
        visible = angular_radius((pieces.radius[one] + pieces.radius[other]) / np.maximum(apart, 1e-9))
        known = np.maximum(pieces.spread[one], pieces.spread[other]) + visible < MAX_SPREAD
        small = [pieces.radius[each] < MIN_PATCH_SIZE * limits.shortest for each in (one, other)]
        known |= small[0] & small[1]
        if known.any():
            yield one[known], other[known]
            one, other, apart = one[~known], other[~known], apart[~known]
            small = [each[~known] for each in small]
        if len(one) == 0:
            continue
        # The patch of larger spread is halved.
        near = np.maximum(apart, limits.shortest)
        own, there = (
            np.where(tiny, -np.inf, pieces.spread[each] + 2.0 * pieces.radius[each] / near)
            for each, tiny in zip((one, other), small, strict=True)
        )
        one, other = np.where(there > own, other, one), np.where(there > own, one, other)
        halves = subdivision.halves(one).reshape(-1), np.repeat(other, 2)
        left = _visible_pairs(subdivision.pieces.rows, halves, limits)
        if len(left[0]):
            waiting.append(left)


def _initial_pairs(subdivision: PatchSubdivision, required: NDArray[np.bool_], limits: PathLimits) -> Pairs:
    """Candidate pairs of the whole faces, by blocks; `required` (patch,)."""
    pieces = subdivision.pieces
    order, count = _ordered(pieces, required), len(pieces)
    width = BLOCK_FANOUT
    while width * MAX_BLOCKS < count:
        width *= BLOCK_FANOUT
    one, other = (each.astype(np.intp) for each in np.triu_indices(-(-count // width)))
    anywhere = PathLimits(0.0, limits.longest)
    while True:
        first = np.arange(0, count, width)
        some = np.logical_or.reduceat(required[order], first)
        kept = some[one] | some[other]
        one, other = one[kept], other[kept]
        if width == 1:
            one, other = order[one], order[other]
            return _visible_pairs(subdivision.pieces.rows, (one, other), limits)
        one, other = _visible_pairs(_blocks(pieces, order, first), (one, other), anywhere)
        width //= BLOCK_FANOUT
        one, other = (
            (BLOCK_FANOUT * each[:, None] + lane).reshape(-1)
            for each, lane in (
                (one, np.repeat(np.arange(BLOCK_FANOUT), BLOCK_FANOUT)),
                (other, np.tile(np.arange(BLOCK_FANOUT), BLOCK_FANOUT)),
            )
        )
        kept = (one < other) | ((one == other) & (width > 1))
        kept &= other * width < count
        one, other = one[kept], other[kept]


def _ordered(pieces: SurfacePatches, required: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Patches ordered by nested blocks of 2, 4, 8, ... with similar positions and directions; required ones first."""
    size = max(float(np.ptp(pieces.middle, axis=0).max(initial=0.0)), 1e-9)
    places = np.column_stack([~required, pieces.out, 2.0 * pieces.middle / size])
    places[:, 0] *= 10.0  # blocks mix required and other patches only where they must
    order = np.arange(len(pieces))
    width = 1 << max(int(np.ceil(np.log2(max(len(order), 1)))), 0)
    while width > 1:
        first = np.arange(0, len(order), width)
        there = places[order]
        spans = np.maximum.reduceat(there, first) - np.minimum.reduceat(there, first)
        group = np.arange(len(order)) // width
        order = order[np.lexsort((there[np.arange(len(order)), spans.argmax(axis=1)[group]], group))]
        width //= 2
    return order


def _blocks(pieces: SurfacePatches, order: NDArray[np.intp], first: NDArray[np.intp]) -> NDArray[np.float32]:
    """(block, COLUMNS) bounds of the patches of blocks that begin at `first` (block,) in their `order`."""
    counts = np.diff(np.append(first, len(order)))
    whole = np.repeat(np.arange(len(first)), counts)
    places, out = pieces.middle[order], pieces.out[order]
    middle, axis = (np.add.reduceat(each, first) / counts[:, None] for each in (places, out))
    axis /= np.maximum(lengths(axis), 1e-9)[:, None]
    radius = np.maximum.reduceat(lengths(places - middle[whole]) + pieces.radius[order], first)
    turn = np.arccos(np.clip(np.einsum("pi,pi->p", out, axis[whole]), -1.0, 1.0))
    spread = np.maximum.reduceat(turn + pieces.spread[order], first)
    far = lengths(middle)
    rows = np.zeros((len(first), COLUMNS), np.float32)
    rows[:, :8] = np.column_stack([middle, radius + ROUNDING[1] * far, axis, spread + ROUNDING[0]])
    rows[:, 12], rows[:, 23] = NEVER, far
    return rows


def _visible_pairs(rows: NDArray[np.float32], pairs: Pairs, limits: PathLimits) -> Pairs:
    """The candidates among pairs of patches with `rows` (patch, COLUMNS)."""
    if len(pairs[0]) == 0:
        return pairs
    if len(pairs[0]) > BATCH:
        chunks = np.arange(BATCH, len(pairs[0]), BATCH)
        parts = [
            _visible_pairs(rows, each, limits) for each in zip(*(np.split(side, chunks) for side in pairs), strict=True)
        ]
        return np.concatenate([one for one, _ in parts]), np.concatenate([other for _, other in parts])
    count = len(pairs[0])
    dr, types = drjit_types()
    found = dr.empty(types.UInt32, count)
    given = {
        "lanes": dr.arange(types.UInt32, count),
        "pairs": [upload(types.UInt32, each) for each in pairs],
        "rows": upload(types.Float, rows),
        "limits": [dr.opaque(types.Float, each) for each in (limits.shortest, limits.longest)],
        "found": found,
    }
    _MAY_REFLECT(given)
    kept = np.flatnonzero(found.numpy())
    return pairs[0][kept], pairs[1][kept]


def _may_reflect(given: dict[str, Any]) -> None:
    """Kernel of :func:`_visible_pairs`."""
    dr, types = drjit_types()
    shortest, longest = given["limits"]
    p, q = (
        [dr.gather(types.Float, given["rows"], COLUMNS * which + k) for k in range(COLUMNS)] for which in given["pairs"]
    )
    span = [b - a for a, b in zip(p[:3], q[:3], strict=True)]
    apart = dr.sqrt(span[0] * span[0] + span[1] * span[1] + span[2] * span[2])
    around = p[3] + q[3]
    ratio = around / dr.maximum(apart, 1e-9)
    visible = dr.select(ratio < 1.0, ratio + 0.571 * ratio * ratio * ratio, float(np.pi))  # no less than the arcsine
    least = dr.maximum(apart - around, shortest)
    found = (apart + around >= shortest) & (p[23] + q[23] + apart - 2.0 * around <= longest)
    opposed = -(p[4] * q[4] + p[5] * q[5] + p[6] * q[6])
    found &= opposed >= dr.cos(dr.minimum(p[7] + q[7], float(np.pi))) - _COSINE_ROUNDING
    for a, b, sign in ((p, q, 1.0), (q, p, -1.0)):
        along = sign * (a[4] * span[0] + a[5] * span[1] + a[6] * span[2])
        found &= along >= (dr.cos(dr.minimum(a[7] + visible, float(np.pi))) - _COSINE_ROUNDING) * apart
        heights = [a[8] * b[14 + 3 * c] + a[9] * b[15 + 3 * c] + a[10] * b[16 + 3 * c] for c in range(3)]
        rise = dr.maximum(dr.maximum(heights[0], heights[1]), heights[2]) + b[13] - a[11]
        found &= rise >= least * a[12]
    dr.scatter(given["found"], dr.select(found, types.UInt32(1), types.UInt32(0)), given["lanes"],
               mode=dr.ReduceMode.Permute)  # fmt: skip
    dr.eval(given["found"])


_MAY_REFLECT = FrozenKernel(_may_reflect)
