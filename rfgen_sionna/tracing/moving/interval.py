"""What is known of a stretch of time while it is traced: from its instants to the paths."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import ComplexArray, FloatArray
from rfgen_sionna.records import RadarPaths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.gains.band import Expansion
from rfgen_sionna.tracing.moving.facet_returns import SampledReturns
from rfgen_sionna.tracing.moving.indirect_paths import IndirectVisibility
from rfgen_sionna.tracing.moving.moving_facets import Positions
from rfgen_sionna.tracing.moving.temporal_refinement import RefinedGains
from rfgen_sionna.tracing.moving.visible_facets import VisibleFacets
from rfgen_sionna.tracing.reflectors.planar_reflections import PlanarReflections
from rfgen_sionna.tracing.shadows.boundary_edges import BoundaryCorrection
from rfgen_sionna.tracing.surface.facets import Facets


class TraceInterval(NamedTuple):
    """A stretch of time."""

    knots: FloatArray
    """(knot,) at which delays are told [s]."""
    positions: Positions
    rays: Callable[[float], RayScene]
    """Takes the ray scene to an instant."""
    ray_scene: RayScene
    rays_between: Callable[[float], RayScene]
    """The same at any time, and nothing else."""
    planar: list[PlanarReflections]
    """Those that there may be."""


class ReturnedFacets(NamedTuple):
    """Facets that are seen at some instant of a stretch, and what they return at each."""

    selected: NDArray[np.intp]
    """(facet,) which of all they are."""
    facets: list[Facets]
    cluster_head: NDArray[np.intp]
    """(facet,) which of all each goes together with."""
    shares: FloatArray
    """(facet, instant) that are seen."""
    values: list[ComplexArray]
    """(value, facet) of the expansion."""
    boundary_correction: list[BoundaryCorrection | None]

    def take(self, rest: NDArray[np.intp]) -> ReturnedFacets:
        """Those that `rest` counts out."""
        return ReturnedFacets(
            self.selected[rest],
            Facets.taken(self.facets, rest),
            self.cluster_head[rest],
            self.shares[rest],
            [np.take(each, rest, axis=1) for each in self.values],
            [None if each is None else each.within(rest) for each in self.boundary_correction],
        )


class IntervalVisibility(NamedTuple):
    """What is seen in a stretch of time."""

    sample_times: FloatArray
    """(instant,) [s]"""
    visible: list[VisibleFacets]
    """Directly, at each."""
    returned: ReturnedFacets
    references: list[FloatArray]
    """(facet, 3) points [m] that their delays go by."""
    sampled_returns: SampledReturns
    expansion: Expansion
    indirect: IndirectVisibility
    moved_shadow_error: float
    """What two instants miss for shadows that move."""
    discarded: list[VisibleFacets]
    """What was seen at two instants, which were not enough."""


class RefinedFacets(NamedTuple):
    """Facets that were looked at between instants."""

    found: RefinedGains
    paths: RadarPaths
    facets: NDArray[np.intp]


@dataclass(frozen=True)
class MovingTrace:
    """The moving surfaces over a stretch of time."""

    paths: RadarPaths
    refined: RadarPaths | None
    """Direct returns of facets that were looked at between instants, at their own knots; None where there are none."""
    error: float
    """Estimated relative error of the return of the worst of them; see
    :mod:`rfgen_sionna.tracing.gains.error_estimate`."""
    time_error: float
    """Estimated relative error between knots of the direct return of the worst of them, for shadows that move on; see
    :mod:`rfgen_sionna.tracing.moving.temporal_refinement`."""
    facets: int
    """Facets looked at."""
    rays: int
    places: Callable[[float], FloatArray]
    """Time [s] to the (path, 3) middles [m] of the facets that the first paths, the direct returns, go by. It holds
    until the next stretch is traced."""
    refined_places: Callable[[float], FloatArray]
    """The same of `refined`."""
    sample_times: FloatArray
    """(instant,) at which gains were traced [s]."""
