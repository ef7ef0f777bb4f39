"""Cost and estimated errors of a trace."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from rfgen_sionna._deprecation import Renamed
from rfgen_sionna._types import FloatArray
from rfgen_sionna.parallel import one_blas_thread
from rfgen_sionna.records import RadarPaths

if TYPE_CHECKING:
    from rfgen_sionna.tracing.static.actor_shadows import Shadow


@dataclass(frozen=True)
class TraceReport:
    """What a trace cost."""

    facets: int
    """Facets integrated."""
    rays: int
    """Visibility rays sent, those of the static scene included."""
    sample_times: int
    """Instants at which visibility and gains were traced."""
    knots: int
    """Knots of the delays; facets that are looked at between instants have more."""
    error: float
    """Estimated error of an actor's return, relative to itself, or of the static scene's, relative to its strongest
    surface's or to what all of it returns without interfering; whichever is larger. Of an actor that goes behind
    another in the frame it is relative to when it is seen best.

    It is that of the integration (:mod:`rfgen_sionna.tracing.gains.error_estimate`), of what is not known of shadows'
    edges (:mod:`rfgen_sionna.tracing.shadows.adaptive_sampling`) and of where pairs see them
    (:mod:`rfgen_sionna.tracing.shadows.boundary_edges`), those of actors on the room among them, of direct
    returns; the
    tolerance is kept by each of the first two. With further bounces what is left out of these is added, and what
    geometrical optics may be off by: for outlines of flat things that show others
    (:mod:`rfgen_sionna.tracing.reflectors.edge_diffraction`; not of ghosts in walls), and where bent ones do
    (:mod:`rfgen_sionna.tracing.curved.stationary_phase_error`), of a walking person by two bounces 10 to 45 % of its
    direct return at
    77 GHz, as most of its glints are near an edge or a shadow. No smaller tolerance mends that."""
    time_error: float
    """Estimated error between the times that things were looked at: that of shadows of actors that move on, that of
    gains that turn with them, and that of phases and of the antennas' gain between knots, the root of the sum of their
    squares.

    Of an actor's direct return it is relative to that. For shadows
    (:mod:`rfgen_sionna.tracing.moving.temporal_refinement`), where
    it fades, to what it was, and above `BETWEEN_PER_RTOL` of the tolerance where as many looks as there may be do not
    suffice. For gains (:mod:`rfgen_sionna.tracing.moving.sample_times`) it is reckoned with some faces of a mesh, and
    above `GAIN_PER_RTOL` of the tolerance, with a warning, where they turn too fast for any instants. For knots
    (:mod:`rfgen_sionna.tracing.moving.knots`) it is reckoned with some vertices, those of mirror images among them, and
    above twice `PHASE_PER_RTOL` of the tolerance where things move too fast for any; over the stretch, of which its
    ends are the worst. Of the static scene it is relative to what its `error` is
    (:mod:`rfgen_sionna.tracing.static.static_refinement`). The larger of the two; what else mirrors and slabs show of
    actors is not in it.

    It is an estimate: of 88 frames of people more was off in six, up to twice as much."""

    between = Renamed("time_error")
    instants = Renamed("sample_times")


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

    glanced = Renamed("refined")
    glanced_places = Renamed("refined_places")

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
