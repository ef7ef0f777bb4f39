"""Which of two flat parts is the mirror, and which one is integrated.

Physical optics integrates the last surface on a way. Of a way by two and that backwards it is the one and the other:
each has either role and counts half, both ways round, so that Tx and Rx may be changed over. A small plate before a
large one is better off integrated, as what the large one shows ends far from where waves go: that alone is enough.
Of facets and of tubes of rays alike.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.tracing.reflectors.clipped_footprints import DIRECT

SIMILAR_AREA = 8.0
"""Flat parts whose areas are in a smaller ratio have either role by half ..."""
DISSIMILAR_AREA = 32.0
"""... and of those in a larger one the larger is the mirror. What is in between goes over from the one to the other, so
that nothing jumps where a size changes a little."""
UNBOUNDED = 1e12
"""Area [m^2] of what is always the mirror."""


def mirror_weights(
    area: FloatArray, own: NDArray[np.integer], first: NDArray[np.integer] | int, last: NDArray[np.integer] | int
) -> FloatArray:
    """(entry,) how much facets count of which plates `first` and `last`, or `DIRECT`, show each.

    `area` (plate,) are those of the plates [m^2], `own` (entry,) is the plate that each facet lies on, -1 for none.
    What is bent, and what plates show on both ways, has no other role.
    """
    return np.where((own < 0) | (np.asarray(last) != DIRECT), 1.0, mirror_weight(area[first], area[own]))


def mirror_weight(mirror: FloatArray, integrated: FloatArray) -> FloatArray:
    """(...,) how much ways count of which a flat part of area `mirror` (...,) is the mirror and one of area
    `integrated` (...,) the one that is integrated [m^2]; with their roles changed over the rest to 1."""
    ratio = np.log(mirror) - np.log(integrated)
    return np.asarray(
        np.interp(
            ratio, np.log([1 / DISSIMILAR_AREA, 1 / SIMILAR_AREA, SIMILAR_AREA, DISSIMILAR_AREA]), [0.0, 0.5, 0.5, 1.0]
        )
    )
