"""What is missed where a facet is partly hidden.

Such a facet counts by the share of its area that is seen. That is not the integral over the part that is seen: where
the phase turns over the facet, the part's middle is elsewhere and the shadow's edge returns a wave of its own. And the
share is sampled by a few rays. Both errors are estimated here, from shares, rays, strengths and phases alone: no ray is
sent.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rfgen_sionna.records import SPEED_OF_LIGHT, FloatArray, IntArray
from rfgen_sionna.scene.materials import Material
from rfgen_sionna.scene.mesh import lengths, middles
from rfgen_sionna.tracing.obliquity import strongest_reflection

SLOPE = 0.08
"""Root mean square, over the direction of a shadow's edge through the middle of a facet, of what is missed of its
uncancelled return per radian that its phase turns by: half of it is seen, and the middle of that half lies 0.22 of the
facet's width off, mostly aslant to the phase."""
EDGE = 4.0
"""Turn of phase [rad] from which on more of it means less that is missed: the edge's wave interferes with itself."""
SAMPLED = 0.3
"""Error of a share that n rays on a lattice tell of a facet with a straight shadow's edge, times n^(3/4)."""
SAFETY = 2.0
"""The estimate is a root mean square, and shadows' edges are long: facets along one err alike."""


def missed(fraction: FloatArray, rays: IntArray, strength: FloatArray, turn: FloatArray) -> FloatArray:
    """(facet,) estimated error of what facets return by the share of them that is seen, root mean squares.

    Parameters
    ----------
    fraction
        (facet,) share of the area that is seen, 0 … 1.
    rays
        (facet,) number that told it.
    strength
        (facet,) what the whole facet would return if its phase didn't turn.
    turn
        (facet,) by how much it turns [rad], from the nearest to the farthest corner and back to the radar.
    """
    mixed = 4.0 * fraction * (1.0 - fraction)
    by_share = SLOPE * turn / (1.0 + (turn / EDGE) ** 2) * mixed
    by_rays = SAMPLED * np.maximum(rays, 1) ** -0.75 * (mixed > 0) / (1.0 + turn / EDGE)
    return np.asarray(strength * np.hypot(by_share, by_rays))


def strengths(
    corners: FloatArray, viewpoint: FloatArray, material: IntArray, materials: Sequence[Material], frequency: float
) -> tuple[FloatArray, FloatArray]:
    """(facet,) what facets would return if their phase didn't turn, and by how much it does [rad].

    `corners` (facet, 3, 3) [m] are made of the `materials` that `material` (facet,) counts out.
    """
    if not len(corners):
        return np.zeros(0), np.zeros(0)
    offset = corners - viewpoint
    cross = np.cross(offset[:, 1] - offset[:, 0], offset[:, 2] - offset[:, 0])
    centre = middles(offset)
    distance = np.maximum(lengths(centre), 1e-9)
    facing = np.abs(np.einsum("fi,fi->f", cross, centre)) / distance
    cos = facing / np.maximum(lengths(cross), 1e-300)
    reflected = strongest_reflection(materials, material, cos, np.array([frequency]))
    turn = 4 * np.pi * frequency / SPEED_OF_LIGHT * np.ptp(lengths(offset), axis=1)
    return reflected * facing / (8 * np.pi * distance**2), turn


def sight_error(
    corners: FloatArray,
    fraction: FloatArray,
    rays: IntArray,
    weight: FloatArray,
    viewpoint: FloatArray,
    surface: IntArray,
    materials: Sequence[Material],
    frequency: float,
    level: FloatArray,
) -> FloatArray:
    """(surface,) error of coherent returns for what facets are hidden in part, relative to the returns' `level`.

    Parameters
    ----------
    corners
        (facet, 3, 3) [m], world.
    fraction, rays
        (facet,) share that is seen, and rays that told it.
    weight
        (facet,) gain of the antenna, relative to its peak.
    viewpoint
        (3,) [m].
    surface
        (facet,) position in the list of surfaces, which are of the `materials`.
    frequency
        [Hz]
    level
        (surface,) return of each surface (:class:`rfgen_sionna.tracing.accuracy.Accuracy`); those without one have no
        error.
    """
    mixed = np.flatnonzero((fraction > 0) & (fraction < 1))
    strength, turn = strengths(corners[mixed], viewpoint, surface[mixed], materials, frequency)
    each = missed(fraction[mixed], rays[mixed], strength * weight[mixed], turn)
    amount = SAFETY * np.sqrt(np.bincount(surface[mixed], each**2, len(level)))
    return np.asarray(np.divide(amount, level, out=np.zeros(len(level)), where=level > 0))
