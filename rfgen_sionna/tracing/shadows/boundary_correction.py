"""What elements see of shadows' edges, each from its own place.

Shadows are cast from the array's phase centre. An element aside of it sees past what casts a shadow at another angle:
the edge falls elsewhere, by its own distance from the centre times that from what casts the shadow to where it falls,
over that from the radar to what casts it. Of a pair Tx and Rx both have to see a point, so that the edge is that of the
two which leaves less, unless a slab casts the shadow and lets some of it through
(:mod:`rfgen_sionna.tracing.shadows.boundary_integrals`, :mod:`rfgen_sionna.tracing.moving.slab_transmission`). Between
the centre's edge
and theirs is a strip: its integral, to the first order in its width but with its full phase, is what a pair returns
less, or more.

Small against the width of facets on bodies that hide themselves, it is a few parts in a thousand of what they return;
of a plate behind the edge of a screen half way it may be a quarter.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import ComplexArray


class BoundaryCorrection(NamedTuple):
    """What pairs see more, or less, of facets that shadows' edges fall on than what is seen from the phase centre."""

    owner: NDArray[np.intp]
    """(edge,) facet that each edge falls on."""
    gains: ComplexArray
    """(order, tx, rx, edge) as polynomials in u, by way of the facets' points."""

    def take(self, index: NDArray[np.intp] | slice) -> BoundaryCorrection:
        """Those of the edges that `index` counts out."""
        return BoundaryCorrection(self.owner[index], self.gains[..., index])

    def within(self, chosen: NDArray[np.intp]) -> BoundaryCorrection:
        """Those of the facets that `chosen` counts out, ascending, counted among these."""
        if not len(chosen):
            return BoundaryCorrection(np.zeros(0, np.intp), self.gains[..., :0])
        place = np.minimum(np.searchsorted(chosen, self.owner), len(chosen) - 1)
        mine = np.flatnonzero(chosen[place] == self.owner)
        return BoundaryCorrection(place[mine], self.gains[..., mine])

    def split(self, facets: int, times: int) -> list[BoundaryCorrection]:
        """Those of each of so many `times`, where as many `facets` of one time come after the other's."""
        return [self.within(np.arange(first, first + facets)) for first in range(0, facets * times, facets)]

    def of_first(self, facets: int) -> ComplexArray:
        """(facet,) of the first pair in the middle of the band."""
        gains = self.gains[0, 0, 0]
        return np.asarray(
            np.bincount(self.owner, gains.real, facets) + 1j * np.bincount(self.owner, gains.imag, facets), complex
        )

    def add_to(self, gains: ComplexArray) -> None:
        """Add to `gains` (order, tx, rx, facet)."""
        order = np.argsort(self.owner, kind="stable")
        facets, first = np.unique(self.owner[order], return_index=True)
        if len(facets):
            gains[..., facets] += np.add.reduceat(self.gains[..., order], first, axis=-1)

    @staticmethod
    def joined(parts: Sequence[BoundaryCorrection]) -> BoundaryCorrection:
        """One after the other."""
        owner, gains = (np.concatenate([each[k] for each in parts], axis=-1) for k in (0, 1))
        return BoundaryCorrection(owner, gains)
