"""Surfaces at rest in an item buffer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray

Divided = tuple[NDArray[np.intp], NDArray[np.intp], FloatArray]
"""(facet,) numbers of facets, (facet,) triangle of each, and (facet, 3, 3) corners [m] relative to the viewpoint."""


def _no_facets(_: NDArray[np.intp]) -> Divided:
    return np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros((0, 3, 3))


@dataclass(frozen=True)
class StaticItems:
    """Surfaces at rest that occlude and are occluded: facets, and large triangles, divided where a shadow falls."""

    corners: FloatArray = field(default_factory=lambda: np.zeros((0, 3, 3)))
    """(item, 3, 3) [m] relative to the viewpoint, visible without actors; facets first."""
    triangles: int = 0
    """Number of large triangles."""
    divide: Callable[[NDArray[np.intp]], Divided] = _no_facets
    """Large triangles, numbered from 0 on, to their facets, whose numbers follow those of the other facets."""

    def __len__(self) -> int:
        return len(self.corners)

    def seen_from(self, place: FloatArray) -> StaticItems:
        """The same, relative to a `place` (3,) [m]."""
        if not place.any():
            return self

        def divide(triangles: NDArray[np.intp]) -> Divided:
            number, owner, corners = self.divide(triangles)
            return number, owner, corners - place

        return replace(self, corners=self.corners - place, divide=divide)
