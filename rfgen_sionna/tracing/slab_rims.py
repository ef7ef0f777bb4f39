"""What rims of slabs leave of facets: the parts that are seen through one and the same chain of slabs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.records import FloatArray, IntArray
from rfgen_sionna.tracing.sampling import BENT, CORNERS, MISSED_PER_RTOL, allowed, returns_at_most
from rfgen_sionna.tracing.shadow_lines import SPACINGS, lit_parts, points_of
from rfgen_sionna.tracing.walk import Walk

_BATCH = 300_000
"""Points that are looked at together."""


class Rims(NamedTuple):
    """What is seen of facets through slabs that cover them in part."""

    share: FloatArray
    """(facet,) of its area."""
    owner: NDArray[np.intp]
    """(piece,) facet that each is of, ascending; those that matter little are not cut."""
    pieces: FloatArray
    """(piece, corner, 3) barycentric coordinates of its corners."""
    missed: float
    """Estimated error of what they return, relative to `level`."""


def cut_by_rims(
    walk: Walk,
    viewpoint: FloatArray,
    corners: FloatArray,
    number: IntArray,
    chains: NDArray[np.int64],
    share: FloatArray,
    left: FloatArray,
    level: float,
    wavenumber: float,
    rtol: float,
) -> Rims:
    """Look at facets on lattices, the finer the more may be missed, as
    :func:`rfgen_sionna.tracing.sampling.sampled_fraction` does where shadows fall.

    Parameters
    ----------
    walk
        Finds the slabs on the way.
    viewpoint
        (3,) [m].
    corners, number
        (facet, 3, 3) [m] and (facet,) the ray scene's face that each is a piece of.
    chains
        (facet, depth) the slabs through which each is looked at.
    share
        (facet,) of each that guiding rays tell of.
    left
        (facet,) amplitude that slabs leave, there and back.
    level
        What all facets return without interfering, in units of
        :func:`rfgen_sionna.tracing.sampling.returns_at_most`.
    wavenumber
        At the highest frequency [rad/m].
    rtol
        Allowed error of the return of all together.
    """
    _, cut, width = returns_at_most(corners - viewpoint, wavenumber)
    bent, share = BENT * left * cut, share.copy()
    wanted = np.sqrt(bent / allowed(bent, MISSED_PER_RTOL * rtol * level))
    cells = np.searchsorted(SPACINGS[:-1], wanted)
    looked = wanted > np.sqrt(BENT / CORNERS)
    missed = np.where(looked, bent / np.array(SPACINGS)[cells] ** 2, CORNERS * left * cut)
    some = np.flatnonzero(looked)
    owners, pieces = [np.zeros(0, np.intp)], [np.zeros((0, 3, 3))]
    batch = np.cumsum(points_of(cells[some])) // _BATCH
    for own in np.split(some, np.flatnonzero(np.diff(batch)) + 1):
        look = _Through(walk, viewpoint, corners[own], number[own], chains[own])
        lit = lit_parts(look, cells[own], width[own])
        share[own] = lit.fraction
        order = np.argsort(lit.owner, kind="stable")
        owners.append(own[lit.owner[order]])
        pieces.append(lit.pieces[order])
    error = float(np.linalg.norm(missed)) / level if level > 0 else 0.0
    return Rims(share, np.concatenate(owners), np.concatenate(pieces), error)


class _Through:
    """Tells what of facets is seen through `chains` (facet, depth) of slabs; the arguments are those of
    :func:`cut_by_rims`."""

    def __init__(
        self, walk: Walk, viewpoint: FloatArray, corners: FloatArray, number: IntArray, chains: NDArray[np.int64]
    ) -> None:
        self._walk, self._viewpoint = walk, viewpoint
        self._corners, self._number, self._chains = corners, number, chains

    def seen(self, of: NDArray[np.intp], places: FloatArray) -> NDArray[np.bool_]:
        """As :class:`rfgen_sionna.tracing.shadow_lines.Look` has it."""
        if not len(of):
            return np.zeros(0, np.bool_)
        targets = np.einsum("rc,rci->ri", places, np.take(self._corners, of, axis=0))
        found = self._walk(self._viewpoint, targets, None, self._number[of])
        return np.asarray((found.crossed == self._chains[of]).all(axis=1))

    def edges(
        self, of: NDArray[np.intp], lit: FloatArray, dark: FloatArray, halvings: NDArray[np.intp]
    ) -> tuple[FloatArray, FloatArray]:
        """As there; how far off the slabs' rims are nobody asks for."""
        lit, dark = lit.copy(), dark.copy()
        for step in range(int(halvings.max(initial=0))):
            some = np.flatnonzero(halvings > step)
            middle = 0.5 * (lit[some] + dark[some])
            seen = self.seen(of[some], middle)
            lit[some[seen]], dark[some[~seen]] = middle[seen], middle[~seen]
        return 0.5 * (lit + dark), np.full(len(of), np.nan)
