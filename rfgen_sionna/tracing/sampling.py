"""RF adaptive sampling: how much of each facet the radar sees, by rays that go where they matter.

One guiding ray goes to the middle of every facet. Where those of facets that touch disagree, a shadow's edge passes,
and the shares of what it touches are found by more rays, the more the facet may return: one that lies aslant, over many
wavelengths, returns next to nothing and a few rays will do; one whose phase hardly changes counts in full.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.records import FloatArray, IntArray
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.visibility import lattice, lattice_corners

LEVELS = (2, 4, 8, 16, 32, 64)
"""Rays along a facet's edge, where a shadow's edge passes it."""
MIDDLE = lattice(1)
SHARE_PER_RTOL = 0.1
"""Error of a single facet's share that is allowed, times what it may return against what all may without interfering,
per unit of the tolerance."""
_ROUNDS = 2
_TABLE = np.concatenate([MIDDLE, *(lattice(n) for n in LEVELS)])
PIECES = np.concatenate([lattice_corners(n) for n in LEVELS])
"""(place, 3, 3) barycentric coordinates of the corners of the piece around each place."""
_FIRST = np.cumsum([1, *(n * n for n in LEVELS)])


class Sampled(NamedTuple):
    """What of facets is seen."""

    fraction: FloatArray
    """(facet,) share of the area that nothing hides, 0 … 1."""
    owner: NDArray[np.intp]
    """(piece,) facet that a piece is of, ascending: those that are seen of facets that are hidden in part."""
    place: NDArray[np.intp]
    """(piece,) which of `PIECES` each one is."""
    rays: int
    """Rays sent."""


def touching(corners: FloatArray) -> IntArray:
    """(facet, 3) numbers of the places where the `corners` (facet, 3, 3) [m] are: facets that share one touch."""
    points = corners.reshape(-1, 3)
    if not len(points):
        return np.zeros((0, 3), np.int32)
    size = max(float(np.ptp(points, axis=0).max()), 1e-9)
    cells = np.rint((points - points.min(axis=0)) * (2**20 / size)).astype(np.int64)
    key = (cells[:, 0] << 42) + (cells[:, 1] << 21) + cells[:, 2]
    return np.unique(key, return_inverse=True)[1].reshape(-1, 3).astype(np.int32)


def sampled_fraction(
    rays: RayScene,
    viewpoint: FloatArray,
    corners: FloatArray,
    facet: IntArray,
    places: IntArray,
    wavenumber: float,
    rtol: float,
) -> Sampled:
    """Share of each facet's area that nothing hides from the viewpoint, and which pieces of those in half shadow.

    The sample points are fixed in the facet: the share changes gradually while it moves.

    Parameters
    ----------
    rays
        The geometry.
    viewpoint
        (3,) [m].
    corners
        (facet, 3, 3) [m].
    facet
        (facet,) number of the ray scene's face that each facet is a piece of; it does not hide itself.
    places
        (facet, 3) of :func:`touching`.
    wavenumber
        At the highest frequency [rad/m].
    rtol
        Allowed error of the return of all together.
    """
    count, none = len(corners), np.zeros(0, np.intp)
    if not count:
        return Sampled(np.zeros(0), none, none, 0)
    every = np.arange(count)
    seen = rays.sees(viewpoint, corners, facet, every, MIDDLE, np.zeros(count, np.intp))
    fraction, sent = seen.astype(np.float64), count
    light, dark = np.zeros((2, int(places.max()) + 1), np.bool_)
    light[places[seen]] = True
    dark[places[~seen]] = True
    border, done = light & dark, np.zeros(count, np.bool_)
    if not border.any():
        return Sampled(fraction, none, none, sent)
    most = _most(corners - viewpoint, wavenumber)
    allowed = SHARE_PER_RTOL * rtol * float(np.sqrt(most[seen] @ most[seen]))
    # The share of n^2 rays on a lattice errs by about n^-1.5.
    wanted = (most / max(allowed, 1e-300)) ** (2 / 3)
    owners, pieces = [none], [none]
    for attempt in range(_ROUNDS):
        edge = np.flatnonzero(border[places].any(axis=1) & ~done & (wanted > attempt))
        if not len(edge):
            break
        done[edge] = True
        level = np.searchsorted(LEVELS[:-1], wanted[edge])
        number = np.array(LEVELS)[level] ** 2
        first = np.cumsum(number) - number
        of = np.repeat(np.arange(len(edge)), number)
        row = np.arange(len(of)) - first[of] + _FIRST[level][of]
        through = rays.sees(viewpoint, corners[edge], facet[edge], of, _TABLE, row)
        share = np.add.reduceat(through, first, dtype=np.float64) / number
        sent += len(of)
        # A shadow may pass a facet without changing what guiding rays say: those that touch one in half shadow.
        border = np.zeros(len(border), np.bool_)
        border[places[edge[(share > 0) & (share < 1) | (share != fraction[edge])]]] = True
        fraction[edge] = share
        lit = np.flatnonzero(through & (share < 1)[of])
        owners.append(edge[of[lit]])
        pieces.append(row[lit] - len(MIDDLE))
    owner, place = np.concatenate(owners), np.concatenate(pieces)
    order = np.argsort(owner, kind="stable")
    return Sampled(fraction, owner[order], place[order], sent)


def _most(corners: FloatArray, wavenumber: float) -> FloatArray:
    """(facet,) what facets may return at most, up to a factor: the solid angle that they take, less the more their
    `corners` (facet, 3, 3) [m] from the radar turn against each other in phase."""
    a, b, c = (np.ascontiguousarray(corners[:, i]) for i in range(3))
    near, middle, far = (lengths(each) for each in (a, b, c))
    spread = np.maximum(np.maximum(near, middle), far) - np.minimum(np.minimum(near, middle), far)
    angle = np.abs(np.einsum("fi,fi->f", a, np.cross(b - a, c - a))) / np.maximum(near, 1e-9) ** 3
    return np.asarray(angle / (1.0 + (wavenumber * spread) ** 2))
