"""Result of a trace: paths over an interval, cost and estimated errors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._deprecation import Renamed
from rfgen_sionna._short_repr import ShortRepr
from rfgen_sionna._types import FloatArray
from rfgen_sionna.parallel import one_blas_thread
from rfgen_sionna.records import RadarPaths

if TYPE_CHECKING:
    from rfgen_sionna.tracing.static.actor_shadows import Shadow


@dataclass(frozen=True, repr=False)
class TraceReport(ShortRepr):
    """Cost and estimated errors of a trace."""

    facets: int
    """Facets integrated."""
    rays: int
    """Visibility rays, including those of the static scene."""
    sample_times: int
    """Number of times at which visibility and gains were traced."""
    knots: int
    """Number of knots of the actors' paths."""
    error: float
    """Estimated error at the sample times: the larger of that of actors and that of the static scene.

    Reference: the actor's own return, at the time of best visibility where another object occludes it; of the static
    scene the return of its strongest surface or the incoherent sum of all, whichever is larger.

    Measured against finer settings for direct returns of actors (:mod:`rfgen_sionna.tracing.direct.planner`). Specular
    double bounces add omitted returns and the error of geometrical optics
    (:mod:`rfgen_sionna.tracing.curved.stationary_phase_error`), which no smaller `rtol` reduces. Routes have the
    settings of direct returns; the diffraction at the outlines of mirrors is not part of it.
    """
    time_error: float
    """Estimated error between the sample times and between the knots: the larger of that of actors and that of the
    static scene.

    Error of curves through the knots of all paths of an actor, relative to its return, by leaving one knot out
    (:mod:`rfgen_sionna.tracing.direct.time_error`).
    """

    surface: float = 0.0
    """What the meshes leave open, at any tolerance: change of the worst actor's return, relative to itself, if the
    quads of its smooth mesh were cut along the other diagonal. 0 for flat meshes, and where it was not measured."""

    between = Renamed("time_error")
    instants = Renamed("sample_times")


@dataclass(frozen=True, repr=False)
class Traced(ShortRepr):
    """Paths over an interval of time. The channel is the sum of all parts; each has its own knots."""

    static: RadarPaths
    """Static scene without actors: one knot, traced once."""
    find_shadows: Callable[[], tuple[Shadow, ...]]
    """Computes `shadows`."""
    moving: RadarPaths
    """Paths of the actors."""
    report: TraceReport
    places: Callable[[float], FloatArray]
    """Time [s] to the (path, 3) facet centres [m] of the first paths of `moving`, the direct returns; valid until the
    next interval is traced."""

    @cached_property
    def shadows(self) -> tuple[Shadow, ...]:
        """Shadows of the actors on the static scene; computed at first use, on any thread."""
        with one_blas_thread():
            return self.find_shadows()

    def shadowed_static(self) -> tuple[RadarPaths, NDArray[np.bool_]]:
        """Static scene with the shadows of the actors at a single sample time, and whether each path is visible."""
        static = self.static
        if not self.shadows:
            return static, np.ones(static.num_paths, np.bool_)
        a, dispersion = static.a.copy(), None if static.dispersion is None else static.dispersion.copy()
        for shadow in self.shadows:
            a[:, :, shadow.index] += shadow.paths.a
            if dispersion is not None and shadow.paths.dispersion is not None:
                more = shadow.paths.dispersion  # of another number of orders
                if len(more) > len(dispersion):
                    longer = np.zeros((len(more), *dispersion.shape[1:]), np.complex128)
                    longer[: len(dispersion)] = dispersion
                    dispersion = longer
                dispersion[: len(more), :, :, shadow.index] += more
        return replace(static, a=a, dispersion=dispersion), np.any(a != 0, axis=(0, 1, 3))

    def changing(self) -> tuple[RadarPaths, ...]:
        """All paths except those of the static scene."""
        return *self.actors, *(each.paths for each in self.shadows)

    @property
    def actors(self) -> tuple[RadarPaths, ...]:
        """All paths by way of actors."""
        return (self.moving,)
