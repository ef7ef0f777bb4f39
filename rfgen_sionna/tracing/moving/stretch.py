"""What is known of a stretch of time while it is traced: from its instants to the paths."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import ComplexArray, FloatArray
from rfgen_sionna.records import RadarPaths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.bounces.bounces import Bounces
from rfgen_sionna.tracing.gains.band import Expansion
from rfgen_sionna.tracing.moving.facets import Positions
from rfgen_sionna.tracing.moving.further import SeenFurther
from rfgen_sionna.tracing.moving.glances import Followed
from rfgen_sionna.tracing.moving.returns import Lit
from rfgen_sionna.tracing.moving.views import Seen
from rfgen_sionna.tracing.shadows.parallax import Parallax
from rfgen_sionna.tracing.surface.facets import Facets


class Stretch(NamedTuple):
    """A stretch of time."""

    knots: FloatArray
    """(knot,) at which delays are told [s]."""
    positions: Positions
    rays: Callable[[float], RayScene]
    """Takes the ray scene to an instant."""
    ray_scene: RayScene
    rays_between: Callable[[float], RayScene]
    """The same at any time, and nothing else."""
    bounces: list[Bounces]
    """Those that there may be."""


class Returned(NamedTuple):
    """Facets that are seen at some instant of a stretch, and what they return at each."""

    kept: NDArray[np.intp]
    """(facet,) which of all they are."""
    facets: list[Facets]
    leader: NDArray[np.intp]
    """(facet,) which of all each goes together with."""
    shares: FloatArray
    """(facet, instant) that are seen."""
    values: list[ComplexArray]
    """(value, facet) of the expansion."""
    parallax: list[Parallax | None]

    def take(self, rest: NDArray[np.intp]) -> Returned:
        """Those that `rest` counts out."""
        return Returned(
            self.kept[rest],
            Facets.taken(self.facets, rest),
            self.leader[rest],
            self.shares[rest],
            [np.take(each, rest, axis=1) for each in self.values],
            [None if each is None else each.within(rest) for each in self.parallax],
        )


class Look(NamedTuple):
    """What is seen in a stretch of time."""

    instants: FloatArray
    """(instant,) [s]"""
    seen: list[Seen]
    """Directly, at each."""
    returned: Returned
    references: list[FloatArray]
    """(facet, 3) points [m] that their delays go by."""
    lit: Lit
    expansion: Expansion
    further: SeenFurther
    steady: float
    """What two instants miss for shadows that move."""
    in_vain: list[Seen]
    """What was seen at two instants, which were not enough."""


class Glanced(NamedTuple):
    """Facets that were looked at between instants."""

    found: Followed
    paths: RadarPaths
    facets: NDArray[np.intp]
