"""What is seen of facets through chains of slabs, whose rims may cut them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.tracing.shadows.visible_polygons import bisect_edges
from rfgen_sionna.tracing.transmission.slab_crossings import SlabTracer


class SlabVisibility:
    """Tells what of facets is seen through slabs, as :class:`rfgen_sionna.tracing.shadows.visible_polygons.Look` has
    it.

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
        self,
        slab_tracer: SlabTracer,
        viewpoint: FloatArray,
        corners: FloatArray,
        number: IntArray,
        crossings: NDArray[np.int64],
    ) -> None:
        self._slab_tracer, self._viewpoint = slab_tracer, viewpoint
        self._corners, self._number, self._crossings = corners, number, crossings

    def visible(self, of: NDArray[np.intp], places: FloatArray) -> NDArray[np.bool_]:
        """As :class:`rfgen_sionna.tracing.shadows.visible_polygons.Look` has it."""
        if not len(of):
            return np.zeros(0, np.bool_)
        targets = np.einsum("rc,rci->ri", places, np.take(self._corners, of, axis=0))
        found = self._slab_tracer(self._viewpoint, targets, None, self._number[of])
        return np.asarray((found.crossed == self._crossings[of]).all(axis=1))

    def edges(
        self, of: NDArray[np.intp], unoccluded: FloatArray, occluded: FloatArray, halvings: NDArray[np.intp]
    ) -> tuple[FloatArray, FloatArray]:
        """As there; how far off the slabs' rims are nobody asks for."""
        return bisect_edges(self.visible, of, unoccluded, occluded, halvings)
