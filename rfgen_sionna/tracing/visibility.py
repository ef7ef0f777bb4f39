"""What part of each facet the radar sees."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.records import FloatArray, IntArray
from rfgen_sionna.scene.rays import RayScene


def _lattice(n: int) -> FloatArray:
    """(n^2, 3) barycentric centroids of the n^2 equal triangles that a triangle splits into."""
    upright = [(i + 1 / 3, j + 1 / 3) for i in range(n) for j in range(n - i)]
    inverted = [(i + 2 / 3, j + 2 / 3) for i in range(n) for j in range(n - i - 1)]
    u = np.array(upright + inverted) / n
    return np.column_stack([u, 1 - u.sum(axis=1)])


_GUIDE = np.array([[2 / 3, 1 / 6, 1 / 6], [1 / 6, 2 / 3, 1 / 6], [1 / 6, 1 / 6, 2 / 3]])
_FINE = _lattice(4)


@dataclass(frozen=True)
class Visibility:
    """Visible share of facets and what it took to know it."""

    fraction: FloatArray
    """(facet,) share of the area that nothing hides, 0 … 1."""
    fine: NDArray[np.bool_]
    """(facet,) whether the dense lattice of sample points decided."""
    rays: int
    """Rays sent."""


def visible_fraction(
    rays: RayScene,
    viewpoint: FloatArray,
    corners: FloatArray,
    facet: IntArray,
    fine: NDArray[np.bool_] | None = None,
) -> Visibility:
    """Share of each facet's area that nothing hides from the viewpoint.

    Three guiding rays go to every facet; where they disagree, 16 on a lattice decide. The sample points are fixed in
    the facet, so that the share changes gradually while it moves.

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
    fine
        (facet,) facets that get the lattice in any case. Without it those get it whose neighbour in the list, most
        often a neighbour in the mesh, is seen differently: a shadow's edge can pass between guiding rays.
    """
    if len(corners) == 0:
        return Visibility(np.zeros(0), np.zeros(0, dtype=np.bool_), 0)

    def seen(index: NDArray[np.intp], weights: FloatArray) -> FloatArray:
        targets = np.einsum("sc,fci->fsi", weights, corners[index]).reshape(-1, 3)
        hidden = rays.occluded(viewpoint, targets, np.repeat(facet[index], len(weights)))
        return np.asarray(1.0 - hidden.reshape(len(index), len(weights)).mean(axis=1), dtype=np.float64)

    fraction = seen(np.arange(len(corners)), _GUIDE)
    mixed = (fraction > 0) & (fraction < 1)
    if fine is not None:
        mixed |= fine
    else:
        step = fraction[1:] != fraction[:-1]
        mixed[1:] |= step
        mixed[:-1] |= step
    index = np.flatnonzero(mixed)
    if len(index):
        fraction[index] = seen(index, _FINE)
    return Visibility(fraction, mixed, len(_GUIDE) * len(corners) + len(_FINE) * len(index))
