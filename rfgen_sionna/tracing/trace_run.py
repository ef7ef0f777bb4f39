"""A run of traces, whose facets and settings persist."""

from __future__ import annotations

from rfgen_sionna.tracing.direct.planner import plan_run
from rfgen_sionna.tracing.direct.trace_plan import RunScene, TracePlan
from rfgen_sionna.tracing.moving.moving_trace import MovingTracer


class TraceRun:
    """A run of :meth:`Tracer.follow`."""

    def __init__(self, indirect: MovingTracer | None, cull: bool, span: tuple[float, float] | None) -> None:
        self.indirect = indirect
        """Tracer of indirect paths, with direct ones; None traces direct ones alone."""
        self.cull = cull
        """Whether negligible facets are omitted."""
        self._span = span
        self._plans: dict[float, TracePlan] = {}

    def plan(self, scene: RunScene, start: float, stop: float) -> TracePlan:
        """Plan for an interval from `start` to `stop` [s]."""
        length = round(stop - start, 9)
        known = self._plans.get(length)
        if self._span is not None and start >= self._span[0] - 1e-9 and stop <= self._span[1] + 1e-9:
            if known is None:
                known = self._plans[length] = plan_run(scene, *self._span, length, self.cull)
        elif known is None or not known.holds(start):
            known = self._plans[length] = plan_run(scene, start, stop, length, self.cull)
        return known
