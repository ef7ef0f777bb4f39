"""Shadows' edges as each pair of elements sees them.

Tubes leave the phase centre, which sees what is hidden begin at a rim. An element aside of it looks past the rim at
another angle, and sees it begin elsewhere: what lies between is a strip along the rim. It is divided where the edges of
the elements' own shadows fall, so that each part of it is seen by an element as a whole or not at all, unless what
hides is narrower than the strip, whose other edge does not divide it. Rays from the elements tell by its middle, and a
part is a footprint like all others, which counts for a pair once if Tx and Rx see it and the centre doesn't, and minus
once if the centre sees it and one of them does not.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import ComplexArray, FloatArray, IntArray
from tests.reference.sbr import lattice
from tests.reference.sbr.footprints import ENDS
from tests.reference.sbr.hits import Hits, Index
from tests.reference.sbr.rims import Rims

_LOOKS = 16
"""Rays across twice the widest strip that tell how far light or shadow reaches to either side of a rim, and how often
the way between two of them is halved where it ends."""
_HALVINGS = 5
_WIDEST = 0.5
"""Strips are no wider than this [rad]."""
_FINE = 1e-3
"""Parts of strips narrower than this share of the widest are left out."""
_ASLANT = 4.0
"""Planes that are seen so far aslant that an element sees an edge this many times further than it would upright are not
followed beyond."""
_OFF, _ENDS = 0.05, 0.2
"""What strips return may be off by, all together, and each by the ends of its rim, relative to itself."""
_PAIRS = 1 << 26
"""Pairs of elements times parts of strips that are reckoned at once."""
LIT, DARK, ABSENT = 0, 1, 2


@dataclass(frozen=True)
class Strips:
    """Parts of strips."""

    rows: Index
    """(part, 6)"""
    rim: Index
    """(part,)"""
    more: NDArray[np.int8]
    """(tx, rx, part) how often each counts for a pair, -1 … 1."""

    @staticmethod
    def joined(parts: list[Strips]) -> Strips:
        """One after the other."""
        rows, rim = (np.concatenate([getattr(each, name) for each in parts]) for name in ("rows", "rim"))
        return Strips(rows, rim, np.concatenate([each.more for each in parts], axis=2))

    def take(self, chosen: Index) -> Strips:
        """Those that `chosen` counts out."""
        return Strips(self.rows[chosen], self.rim[chosen], self.more[..., chosen])


def shifts(terminator: Rims, normal: FloatArray, elements: FloatArray) -> FloatArray:
    """(rim, 2, element) where elements (element, 3) [m] from the source see the ends of rims fall on what is hidden,
    planes with `normal` (rim, 2, 3): tangent of the angle from the rim, towards what is lit."""
    place = terminator.front[..., None] * terminator.ends
    height = terminator.back * np.einsum("rki,rki->rk", terminator.ends, normal)
    own = normal @ elements.T
    below = np.einsum("rki,rki->rk", place, normal)[..., None] - own
    times = (height[..., None] - own) / np.where(np.abs(below) > 1e-12, below, 1e-12)
    straight = (terminator.back / terminator.front)[..., None]
    times = np.clip(times, 1.0, _ASLANT * straight)
    # From the element e by way of the rim: e + times (place - e).
    across = (1.0 - times) * (terminator.unoccluded @ elements.T)[:, None]
    along = times * terminator.front[..., None] + (1.0 - times) * (terminator.ends @ elements.T)
    return np.asarray(np.clip(across / np.maximum(along, 1e-9), -_WIDEST, _WIDEST))


def correction(hits: Hits, terminator: Rims, tx: FloatArray, rx: FloatArray) -> Strips:
    """Beside `terminator` of first hits, for elements `tx` (tx, 3) and `rx` (rx, 3) [m]. Where slabs are seen through,
    there
    are none beside them: a strip of the light that they leave is no strip of light."""
    setting, every = hits.setting, np.arange(len(terminator))
    if setting.transmission:
        every = np.flatnonzero(~setting.optics.penetrable[hits.surface[terminator.occluder]])
    some = max(1, _PAIRS // (len(tx) * len(rx) * 4 * (len(tx) + len(rx))))
    found = [Strips(np.zeros((0, 6), np.intp), every[:0], np.zeros((len(tx), len(rx), 0), np.int8))]
    for begun in range(0, len(every), some):
        chosen = every[begun : begun + some]
        each = _correction_error(hits, terminator.take(chosen), tx, rx)
        found.append(replace(each, rim=chosen[each.rim]))
    return Strips.joined(found)


def _correction_error(hits: Hits, terminator: Rims, tx: FloatArray, rx: FloatArray) -> Strips:
    """As :func:`correction`, of few and opaque ones."""
    source = hits.setting.source
    elements = np.concatenate([tx, rx])
    moved = shifts(terminator, hits.normal[terminator.like], elements - source)
    moved = _within(hits, terminator, moved)
    bounds = np.concatenate([moved, np.zeros_like(moved[..., :1])], axis=2)
    bounds = np.sort(bounds, axis=2)
    width = np.diff(bounds, axis=2).mean(axis=1)
    rim, part = np.nonzero(width > _FINE * np.maximum(np.ptp(bounds, axis=2).max(axis=1), 1e-7)[:, None])
    if len(rim) == 0:
        return Strips(np.zeros((0, 6), np.intp), rim, np.zeros((len(tx), len(rx), 0), np.int8))
    low, high = bounds[rim, :, part], bounds[rim, :, part + 1]
    corner = [
        terminator.ends[rim, end] + each[:, end, None] * terminator.unoccluded[rim]
        for end, each in ((0, low), (1, low), (1, high), (0, high))
    ]
    triangles = [np.stack([corner[each] for each in three], axis=1) for three in ((0, 1, 2), (0, 2, 3))]
    ray = np.concatenate(triangles)
    rim, unoccluded = np.concatenate([rim, rim]), np.tile((low + high).sum(axis=1) > 0, 2)
    halves = [0.5 * (ray[:, i] + ray[:, j])[:, None] for i, j in ENDS]
    ray = np.concatenate([ray, *halves, ray.mean(axis=1)[:, None]], axis=1)
    like = terminator.like[rim, 0]
    centre, there = hits.behind(_nodes(hits, ray[:, 6]), like)
    facet, target = hits.facet[centre], hits.flat[centre]
    visible = np.zeros((len(elements), len(rim)), np.bool_)
    lane = np.flatnonzero(there)
    for number, eye in enumerate(elements):
        visible[number, lane] = ~hits.setting.rays.occluded(eye, target[lane], facet[lane])
        hits.count(len(lane))
    # What the source sees was counted up to the rim as it was found, not as it is, where nothing else hides it.
    first, sheet = hits.facet[hits.rows(_nodes(hits, ray[:, 6]))], hits.setting.skin.sheet
    alone = (sheet[first] == sheet[hits.facet[like]]) | (sheet[first] == sheet[hits.facet[terminator.occluder[rim]]])
    counted = there & unoccluded & alone & (first >= 0)
    more = (visible[: len(tx), None] & visible[len(tx) :]).astype(np.int8) - counted.astype(np.int8)
    used = np.flatnonzero((more != 0).any(axis=(0, 1)))
    rows, _ = hits.behind(_nodes(hits, ray[used, :6]).reshape(-1, 3), np.repeat(like[used], 6))
    return Strips(rows.reshape(-1, 6), rim[used], more[..., used])


def doubts(found: Strips, a: ComplexArray, group: IntArray, groups: int) -> FloatArray:
    """(group,) what may be missed beside rims for the worst pair, where parts of strips return `a` (part,) to the
    source and are of `group` (part,)."""
    worst = np.zeros(groups)
    order = np.lexsort((found.rim, group))
    rim, own, a = found.rim[order], group[order], a[order]
    first = np.flatnonzero(np.diff(rim, prepend=-1) | np.diff(own, prepend=-1))
    if len(first) == 0:
        return worst
    for by_rx in found.more[..., order]:
        each = np.add.reduceat(by_rx * a, first, axis=1)
        for one in np.unique(own):
            mine = each[:, own[first] == one]
            off = _OFF**2 * np.abs(mine.sum(axis=1)) ** 2 + _ENDS**2 * (np.abs(mine) ** 2).sum(axis=1)
            worst[one] = max(worst[one], float(np.sqrt(off.max())))
    return worst


def _nodes(hits: Hits, rays: FloatArray) -> lattice.Nodes:
    return lattice.nearest(rays @ hits.setting.rotation)


def _within(hits: Hits, terminator: Rims, moved: FloatArray) -> FloatArray:
    """`moved` (rim, 2, element) as far as the light or the shadow beside each rim reaches: of what another rim ends as
    well each has half, so that nothing counts twice."""
    like, middle = terminator.like[:, 0], terminator.ends.mean(axis=1)
    limits = []
    for side, own, other in ((1.0, LIT, DARK), (-1.0, DARK, LIT)):
        widest = np.maximum(side * moved, 0.0).max(axis=(1, 2), initial=0.0)
        step = 2.0 * (np.arange(_LOOKS) + 1.0) / _LOOKS

        def state(share: FloatArray, lane: Index, side: float = side, widest: FloatArray = widest) -> NDArray[np.int8]:
            rays = middle[lane] + (side * share * widest[lane])[:, None] * terminator.unoccluded[lane]
            return _state(hits, _nodes(hits, rays), like[lane])

        lane = np.flatnonzero(widest > 0)
        found = np.full((len(terminator), _LOOKS), own, np.int8)
        if len(lane):
            every = np.repeat(lane, _LOOKS)
            found[lane] = state(np.tile(step, len(lane)), every).reshape(-1, _LOOKS)
        # Next to the rim the first ray may be on its wrong side, as far as it is not known. Where the second one is as
        # well, light or shadow is narrower than the first ray tells.
        ends = (found != own) & np.maximum.accumulate(found != ABSENT, axis=1)
        ends[found[:, 1] == own, 0] = False
        first, ended = np.argmax(ends, axis=1), np.flatnonzero(ends.any(axis=1))
        low, high = step[first[ended]] - step[0], step[first[ended]]
        what = found[ended, first[ended]]
        for _ in range(_HALVINGS):
            if len(ended) == 0:
                break
            half = 0.5 * (low + high)
            now = state(half, ended)
            low, high = np.where(now == own, half, low), np.where(now == own, high, half)
            what = np.where(now == own, what, now)
        limit = np.full(len(terminator), np.inf)
        limit[ended] = np.where(what == other, 0.5, 1.0) * 0.5 * (low + high) * widest[ended]
        limits.append(limit[:, None, None])
    return np.asarray(np.clip(moved, -limits[1], limits[0]))


def _state(hits: Hits, nodes: lattice.Nodes, like: Index) -> NDArray[np.int8]:
    """(node,) whether what rows `like` hit is seen from the source along nodes, hidden, or not there."""
    first = hits.rows(nodes)
    sheet, facet = hits.setting.skin.sheet, hits.facet[first]
    unoccluded = (facet >= 0) & (sheet[facet] == sheet[hits.facet[like]])
    found = np.where(unoccluded, LIT, ABSENT).astype(np.int8)
    lane = np.flatnonzero(~unoccluded & (facet >= 0))
    _, there = hits.behind(nodes[lane], like[lane])
    found[lane[there]] = DARK
    return found
