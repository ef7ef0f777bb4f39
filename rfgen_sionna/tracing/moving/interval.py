"""Data of an interval of time during its trace, from sample times to paths."""

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
    """An interval of time."""

    knots: FloatArray
    """(knot,) times of the delays [s]."""
    positions: Positions
    rays: Callable[[float], RayScene]
    """Updates the ray scene to a sample time [s]."""
    ray_scene: RayScene
    rays_between: Callable[[float], RayScene]
    """Ray scene at any time [s], without side effects."""
    planar: list[PlanarReflections]
    """Active planar reflectors."""


class ReturnedFacets(NamedTuple):
    """Facets that are visible at any sample time, and their returns at each."""

    selected: NDArray[np.intp]
    """(facet,) index among all facets."""
    facets: list[Facets]
    cluster_head: NDArray[np.intp]
    """(facet,) index of the cluster head among all facets."""
    shares: FloatArray
    """(facet, time) visible fraction, the mean over the element pairs."""
    values: list[ComplexArray]
    """(value, facet) integrals of the expansion, shadow weight applied, at each sample time."""
    boundary_correction: list[BoundaryCorrection | None]

    def take(self, rest: NDArray[np.intp]) -> ReturnedFacets:
        """The facets with indices `rest`."""
        return ReturnedFacets(
            self.selected[rest],
            Facets.taken(self.facets, rest),
            self.cluster_head[rest],
            self.shares[rest],
            [np.take(each, rest, axis=1) for each in self.values],
            [None if each is None else each.within(rest) for each in self.boundary_correction],
        )


class IntervalVisibility(NamedTuple):
    """Visibility and returns over an interval."""

    sample_times: FloatArray
    """(time,) [s]"""
    visible: list[VisibleFacets]
    """Direct visibility at each sample time."""
    returned: ReturnedFacets
    references: list[FloatArray]
    """(facet, 3) points [m] of the delays, at each sample time."""
    sampled_returns: SampledReturns
    expansion: Expansion
    indirect: IndirectVisibility
    moved_shadow_error: float
    """Time error of two sample times for moving shadows."""
    discarded: list[VisibleFacets]
    """Visibility at two sample times that did not suffice."""


class RefinedFacets(NamedTuple):
    """Facets under temporal refinement."""

    found: RefinedGains
    paths: RadarPaths
    facets: NDArray[np.intp]


@dataclass(frozen=True)
class MovingTrace:
    """Moving surfaces over an interval of time."""

    paths: RadarPaths
    refined: RadarPaths | None
    """Direct returns of facets under temporal refinement, at their own knots; None without any."""
    error: float
    """Estimated relative error of the worst surface's return at the sample times
    (:mod:`rfgen_sionna.tracing.gains.error_estimate`)."""
    time_error: float
    """Estimated relative error of the worst surface's direct return between sample times, for moving shadows
    (:mod:`rfgen_sionna.tracing.moving.temporal_refinement`)."""
    facets: int
    """Facets tested for visibility."""
    rays: int
    places: Callable[[float], FloatArray]
    """Time [s] to the (path, 3) facet centres [m] of the first paths, the direct returns; valid until the next interval
    is traced."""
    refined_places: Callable[[float], FloatArray]
    """Likewise of `refined`."""
    sample_times: FloatArray
    """(time,) at which gains were traced [s]."""
