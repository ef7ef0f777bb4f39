"""What is seen of facets through chains of slabs, whose rims may cut them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.tracing.shadows.lines import halved
from rfgen_sionna.tracing.veils.walk import Walk


class Through:
    """Tells what of facets is seen through slabs, as :class:`rfgen_sionna.tracing.shadows.lines.Look` has it.

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
    """

    def __init__(
        self, walk: Walk, viewpoint: FloatArray, corners: FloatArray, number: IntArray, chains: NDArray[np.int64]
    ) -> None:
        self._walk, self._viewpoint = walk, viewpoint
        self._corners, self._number, self._chains = corners, number, chains

    def seen(self, of: NDArray[np.intp], places: FloatArray) -> NDArray[np.bool_]:
        """As :class:`rfgen_sionna.tracing.shadows.lines.Look` has it."""
        if not len(of):
            return np.zeros(0, np.bool_)
        targets = np.einsum("rc,rci->ri", places, np.take(self._corners, of, axis=0))
        found = self._walk(self._viewpoint, targets, None, self._number[of])
        return np.asarray((found.crossed == self._chains[of]).all(axis=1))

    def edges(
        self, of: NDArray[np.intp], lit: FloatArray, dark: FloatArray, halvings: NDArray[np.intp]
    ) -> tuple[FloatArray, FloatArray]:
        """As there; how far off the slabs' rims are nobody asks for."""
        return halved(self.seen, of, lit, dark, halvings)
