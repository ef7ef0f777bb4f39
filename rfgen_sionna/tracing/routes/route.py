"""Routes of facets over the knots of an interval, and their returns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import ComplexArray, FloatArray
from rfgen_sionna.tracing.gains.expansion import Expansion
from rfgen_sionna.tracing.legs.leg import Leg
from rfgen_sionna.tracing.legs.leg_visibility import Crossings


@dataclass(frozen=True, eq=False)
class Route:
    """Facets by one leg out and one back over the knots."""

    out: tuple[Leg, ...]
    """Of each knot."""
    back: tuple[Leg, ...]
    facets: NDArray[np.intp]
    """(path,)"""
    visible: FloatArray
    """(knot, path) visible share times the weight of the roles."""
    bound: FloatArray
    """(path,) bound of the return."""
    crossed: tuple[tuple[Crossings, Crossings], ...] = ()
    """Slabs on both legs at each knot; empty without transmission."""

    @property
    def bounces(self) -> int:
        """Number of surfaces on a path."""
        return 1 + len(self.out[0].mirrors) + len(self.back[0].mirrors)

    def take(self, index: NDArray[np.intp]) -> Route:
        """Some of its facets."""
        crossed = tuple((out.take(index), back.take(index)) for out, back in self.crossed)
        return Route(self.out, self.back, self.facets[index], self.visible[:, index], self.bound[index], crossed)


@dataclass(frozen=True, eq=False)
class RouteReturns:
    """Integrated routes."""

    route: Route
    expansion: Expansion
    values: ComplexArray
    """(node, path, knot) of the expansion."""
    gains: ComplexArray
    """(path, knot) of the first pair in the middle of the band, with antennas."""
    delays: FloatArray
    """(tx, rx, path, knot) [s]"""

    @property
    def facets(self) -> NDArray[np.intp]:
        """(path,)"""
        return self.route.facets
