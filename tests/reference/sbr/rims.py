"""Where something ends before something else: the edges of shadows, as the source sees them."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.scene.mesh import lengths
from tests.reference.sbr import lattice
from tests.reference.sbr.hits import Hits, Index

_APART = 1e-3
"""Least difference of distances, relative, of what hides and what is hidden."""
_ON = 0.1
"""Surfaces go on as planes from the last ray to the rim by no more than this, relative to the distance."""


@dataclass(frozen=True)
class Rims:
    """Straight pieces of them, one in each tube that was cut."""

    ends: FloatArray
    """(rim, 2, 3) unit vectors from the source."""
    front: FloatArray
    """(rim, 2) how far what hides is there [m]."""
    back: FloatArray
    """(rim, 2) how far what is hidden is [m]."""
    occluder: Index
    """(rim,) a row that hits what hides."""
    like: Index
    """(rim, 2) rows that hit what is hidden, just beside it."""
    unoccluded: FloatArray
    """(rim, 3) unit vector to the side on which that is seen."""

    def __len__(self) -> int:
        return len(self.ends)

    def take(self, chosen: NDArray[np.bool_] | NDArray[np.intp]) -> Rims:
        """Those that `chosen` counts out."""
        return Rims(*(getattr(self, each.name)[chosen] for each in fields(self)))

    @staticmethod
    def none() -> Rims:
        """No rims at all."""
        pairs, rows = np.zeros((0, 2)), np.zeros((0, 2), np.intp)
        return Rims(np.zeros((0, 2, 3)), pairs, pairs, rows[:, 0], rows, np.zeros((0, 3)))

    @staticmethod
    def joined(parts: list[Rims]) -> Rims:
        """One after the other."""
        return Rims(*(np.concatenate([getattr(each, one.name) for each in parts]) for one in fields(Rims)))

    @staticmethod
    def between(hits: Hits, side: lattice.Nodes, near: lattice.Nodes, far: lattice.Nodes) -> tuple[Rims, Index]:
        """Those of some lines, from nodes `near` (line, 2, 3) on the side of `side` (line, 3) and `far` on the other,
        beside which one thing is before another; and of which lines (rim,) they are. Where what is hidden is one thing
        at one end and another, or nothing, at the other, there is a rim for either, each as if it went on."""
        rows = np.stack([hits.rows(each.reshape(-1, 3)).reshape(-1, 2) for each in (near, far)])
        rays = lattice.directions(lattice.middle(near, far), hits.setting.rotation)
        met = hits.facet[rows] >= 0
        sheet = np.where(met, hits.setting.skin.sheet[hits.facet[rows]], -1)
        reach = np.where(met, _onward(hits, rows, np.stack([rays, rays])), np.inf)
        both = met[0] & met[1]
        found, lines = [], []
        for one, other in ((0, 1), (1, 0)):
            before: NDArray[np.bool_] = reach[one] * (1.0 + _APART) < reach[other]
            first = before.all(axis=1) & (sheet[one, :, 0] == sheet[one, :, 1])
            alike = both.all(axis=1) & (sheet[other, :, 0] == sheet[other, :, 1])
            for end in (0, 1):
                line = np.flatnonzero(first & met[other, :, end] & (~alike | (end == 0)))
                like = np.where(alike[line, None], rows[other, line], rows[other, line, end, None])
                across = np.cross(rays[line, 0], rays[line, 1])
                across /= np.maximum(lengths(across), 1e-300)[:, None]
                aside = np.einsum("ri,ri->r", across, lattice.directions(side[line], hits.setting.rotation))
                sign = np.sign(aside) * (1.0 if other == 0 else -1.0)
                back = _onward(hits, like, rays[line])
                kept = (back > (1.0 + _APART) * reach[one, line]).all(axis=1) & (lengths(across) > 0.5)
                found.append(
                    Rims(rays[line], reach[one, line], back, rows[one, line, 0], like, sign[:, None] * across).take(
                        kept
                    )
                )
                lines.append(line[kept])
        return Rims.joined(found), np.concatenate(lines)


def _onward(hits: Hits, rows: Index, rays: FloatArray) -> FloatArray:
    """(...,) how far rays (..., 3) from the source come to the planes through the hits `rows` (...,) [m]: what meets
    in a fold is as far from either side of it."""
    normal = hits.normal[rows]
    height = np.einsum("...i,...i->...", hits.point[rows] - hits.setting.source, normal)
    slope = np.einsum("...i,...i->...", rays, normal)
    leg = hits.leg[rows]
    there = height / np.where(np.abs(slope) > 1e-9, slope, -1e-9)
    return np.asarray(np.clip(there, (1.0 - _ON) * leg, (1.0 + _ON) * leg))
