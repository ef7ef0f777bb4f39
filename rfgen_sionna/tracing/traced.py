"""Paths over an interval of time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

from rfgen_sionna._types import FloatArray
from rfgen_sionna.parallel import one_blas_thread
from rfgen_sionna.records import RadarPaths
from rfgen_sionna.tracing.report import TraceReport
from rfgen_sionna.tracing.static.actor_shadows import Shadow


@dataclass(frozen=True)
class Traced:
    """Paths over a stretch of time. The channel is the sum of all parts, which don't share knots."""

    static: RadarPaths
    """The static scene as if there were no actors: one knot, traced once."""
    find_shadows: Callable[[], tuple[Shadow, ...]]
    """Works `shadows` out."""
    moving: RadarPaths
    """The actors, but for what is in `refined`."""
    refined: RadarPaths | None
    """Direct returns of actors' facets that shadows pass over between instants, at more knots
    (:mod:`rfgen_sionna.tracing.moving.temporal_refinement`); None where there are none."""
    report: TraceReport
    places: Callable[[float], FloatArray]
    """Time [s] to the (path, 3) middles [m] of the facets that the first paths of `moving`, the direct returns, go by.
    It holds until the next stretch is traced."""
    refined_places: Callable[[float], FloatArray]
    """The same of `refined`."""

    @cached_property
    def shadows(self) -> tuple[Shadow, ...]:
        """What the actors hide of the static scene; worked out when it is first asked for, on whatever thread."""
        with one_blas_thread():
            return self.find_shadows()

    def changing(self) -> tuple[RadarPaths, ...]:
        """All but the static scene."""
        return *self.actors, *(each.paths for each in self.shadows)

    @property
    def actors(self) -> tuple[RadarPaths, ...]:
        """All paths by way of actors."""
        return (self.moving,) if self.refined is None else (self.moving, self.refined)
