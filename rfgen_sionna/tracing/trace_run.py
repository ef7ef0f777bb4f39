"""A run of traces, whose facets and settings persist."""

from __future__ import annotations

import numpy as np

from rfgen_sionna.tracing.curved.curved_reflections import CurvedReflections
from rfgen_sionna.tracing.direct.planner import plan_run
from rfgen_sionna.tracing.direct.run_scene import RunScene
from rfgen_sionna.tracing.direct.trace_plan import TracePlan
from rfgen_sionna.tracing.routes.route_trace import RouteTracer

ROUTE_TIMES = 5
"""Times of a run that decide on the expansion of its routes."""


class TraceRun:
    """A run of :meth:`Tracer.follow`."""

    def __init__(self, cull: bool, span: tuple[float, float] | None) -> None:
        self._cull, self._span = cull, span
        self.routes: RouteTracer | None = None
        """Tracer of routes by mirrors; None until the first interval or without any."""
        self.curved: CurvedReflections | None = None
        """Tracer of specular double bounces; likewise."""
        self._plans: dict[float, TracePlan] = {}

    def plan(self, scene: RunScene, start: float, stop: float) -> TracePlan:
        """Plan for an interval from `start` to `stop` [s]."""
        length = round(stop - start, 9)
        known = self._plans.get(length)
        if self._span is not None and start >= self._span[0] - 1e-9 and stop <= self._span[1] + 1e-9:
            if known is None:
                known = self._plans[length] = plan_run(scene, *self._span, length, self._cull)
        elif known is None or not known.holds(start):
            known = self._plans[length] = plan_run(scene, start, stop, length, self._cull)
        return known

    def first(self, start: float) -> float:
        """Time [s] at which the planar parts of an interval from `start` are those of the run."""
        return start if self._span is None else self._span[0]

    def times(self, start: float) -> list[float]:
        """Times [s] that decide on the expansion of routes, for an interval from `start`."""
        return [start] if self._span is None else np.linspace(*self._span, ROUTE_TIMES).tolist()
