"""What part of each facet the radar sees."""

from __future__ import annotations

import numpy as np

from rfgen_sionna.records import FloatArray, IntArray
from rfgen_sionna.scene.rays import RayScene


def _lattice(n: int) -> FloatArray:
    """(n^2, 3) barycentric centroids of the n^2 equal triangles that a triangle splits into."""
    points = []
    for i in range(n):
        for j in range(n - i):
            points.append((i + 1 / 3, j + 1 / 3))
            if i + j < n - 1:
                points.append((i + 2 / 3, j + 2 / 3))
    u = np.array(points) / n
    return np.column_stack([u, 1 - u.sum(axis=1)])


_GUIDE = np.array([[2 / 3, 1 / 6, 1 / 6], [1 / 6, 2 / 3, 1 / 6], [1 / 6, 1 / 6, 2 / 3]])
_FINE = _lattice(4)


def visible_fraction(
    rays: RayScene,
    viewpoint: FloatArray,
    corners: FloatArray,
    facet: IntArray,
    neighbour_rule: bool = True,
) -> tuple[FloatArray, int]:
    """Share of each facet's area that nothing hides from the viewpoint.

    Three guiding rays go to every facet. Where they disagree, or where facets of the same face or next to it in the
    list disagree with each other, 16 rays on a lattice decide. The sample points are fixed in the facet, so that the
    fraction changes smoothly as it moves.

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
    neighbour_rule
        Whether a facet whose neighbours in the list differ is refined as well.

    Returns
    -------
    (facet,) fractions in 0 … 1, and the number of rays sent.
    """
    if len(corners) == 0:
        return np.zeros(0), 0

    def seen(chosen: FloatArray, own: IntArray, weights: FloatArray) -> FloatArray:
        targets = np.einsum("sc,fci->fsi", weights, chosen).reshape(-1, 3)
        hidden = rays.occluded(viewpoint, targets, np.repeat(own, len(weights)))
        return 1.0 - hidden.reshape(len(chosen), len(weights)).mean(axis=1)

    fraction = seen(corners, facet, _GUIDE)
    mixed = (fraction > 0) & (fraction < 1)
    if neighbour_rule and len(fraction) > 1:
        step = fraction[1:] != fraction[:-1]
        mixed[1:] |= step
        mixed[:-1] |= step
    index = np.flatnonzero(mixed)
    if len(index):
        fraction[index] = seen(corners[index], facet[index], _FINE)
    return fraction, len(_GUIDE) * len(corners) + len(_FINE) * len(index)
