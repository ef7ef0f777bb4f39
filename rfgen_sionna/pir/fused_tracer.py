"""Traced actors in imagined surroundings, frame by frame."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.pir.fusion import Refinement, image, mix_paths
from rfgen_sionna.pir.image_surroundings import ImageSurroundings
from rfgen_sionna.records import Pir, RadarPaths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.report import Traced, TraceReport

if TYPE_CHECKING:
    from rfgen_sionna.tracing.trace_run import TraceRun
    from rfgen_sionna.tracing.tracer import Tracer

KEY_SPACING = 0.5
"""Time between refined images [s]; gains are blended in between."""


class Refiner(Protocol):
    """Correction of image sequences, such as a path diffusion model."""

    def refine_sequence(self, frames: Sequence[Pir]) -> Sequence[Pir]:
        """Corrected images of the same view and times, consistent over time."""


@dataclass(frozen=True)
class FusedFrame:
    """Paths over an interval; the channel is the sum of all parts, each with its own knots."""

    parts: tuple[RadarPaths, ...]
    report: TraceReport


class FusedTracer:
    """Tracer of actors in imagined surroundings.

    Parameters
    ----------
    tracer
        Actors in free space.
    environment
        PIR of the surroundings.
    seed
        Seed of the random phases.
    refiner
        Correction of the images of actors and surroundings; None omits it.

    Raises
    ------
    ValueError
        If the tracer has static surfaces, the radar of a refined run moves, or the image has impossible values.
    """

    def __init__(self, tracer: Tracer, environment: Pir, seed: int, refiner: Refiner | None = None) -> None:
        if tracer.surfaces.static:
            names = ", ".join(repr(surface.name) for surface in tracer.surfaces.static[:3])
            raise ValueError(f"environment: the scene has surfaces of its own ({names} …); an image needs scene=None")
        if refiner is not None and tracer.radar.trajectory is not None:
            raise ValueError("refiner: the radar moves; a static radar, or None, is needed")
        self._tracer, self._refiner, self._seed = tracer, refiner, seed
        self.surroundings = ImageSurroundings(environment, tracer.radar, seed)
        self._viewpoint = np.asarray(tracer.radar.position)

    def images(self, times: Sequence[float]) -> list[Pir]:
        """PIRs of actors and surroundings at times [s], before refinement."""
        run = self._tracer.follow(cull=False, span=(float(min(times)), float(max(times))))
        return [image(self._mixed(float(t), run), self.surroundings.view, float(t)) for t in times]

    def refinement(self, start: float, stop: float) -> Refinement | None:
        """Refinement of the interval `start` … `stop` [s]; None without a refiner."""
        if self._refiner is None:
            return None
        count = 1 + int(np.ceil((stop - start) / KEY_SPACING - 1e-9)) if stop > start else 1
        mixed = self.images(np.linspace(start, stop, count).tolist())
        return Refinement(mixed, list(self._refiner.refine_sequence(mixed)), self._tracer.radar, self._seed)

    def instant(self, t: float) -> list[RadarPaths]:
        """All paths at `t` [s]: of the actors, of the surroundings, and added by the refiner."""
        parts = self._mixed(t)
        refinement = self.refinement(t, t)
        if refinement is None:
            return parts
        changed = [refinement(part, self._positions_of(part)) for part in parts]
        return [*changed, *refinement.added(np.array([t]))]

    def trace(self, start: float, stop: float, moving: TraceRun, refinement: Refinement | None) -> FusedFrame:
        """Paths from `start` to `stop` [s].

        Parameters
        ----------
        start, stop
            Ends of the interval [s].
        moving
            Kept state of the run (:meth:`Tracer.follow`).
        refinement
            Refinement of the interval; None omits it.
        """
        visible_share: dict[float, FloatArray] = {}

        def watch(t: float, rays: RayScene) -> None:
            visible_share[t] = self.surroundings.visible_share(rays, t)

        traced = self._tracer.trace(start, stop, moving, watch if len(self._unoccluded_share) else None)
        sampled = np.array(sorted(visible_share) or [start])
        share = np.stack([visible_share.get(t, self._unoccluded_share) for t in sampled.tolist()], axis=1)
        times, report = sampled, traced.report
        if self.surroundings.moves:
            times, time_error = self._tracer.knots(lambda t: [self.surroundings.points(t)], start, stop)
            report = replace(report, time_error=max(report.time_error, time_error))
            share = np.stack([np.interp(times, sampled, row) for row in share]) if len(share) else share[:, :0]
        actors, *around = mix_paths(traced.moving, self.surroundings, times, share)
        if refinement is not None:
            actors = refinement(actors, self._facet_centres(traced))
            around = [refinement(part, self._positions_of(part)) for part in around]
            around += refinement.added(np.linspace(start, stop, 4) if stop > start else np.array([start]))
        return FusedFrame((actors, *around), report)

    @property
    def _unoccluded_share(self) -> FloatArray:
        return np.ones(len(self.surroundings.pixel))

    def _mixed(self, t: float, run: TraceRun | None = None) -> list[RadarPaths]:
        """Paths of actors and surroundings at `t` [s]; a `run` keeps its state from time to time."""
        paths = self._tracer.instant(t) if run is None else self._tracer.trace(t, t, run).moving
        visible_share = (
            self.surroundings.visible_share(self._tracer.rays_at(t), t)
            if self._tracer.actors
            else self._unoccluded_share
        )
        return mix_paths(paths, self.surroundings, np.array([t]), visible_share[:, None])

    def _positions_of(self, paths: RadarPaths) -> Callable[[float], FloatArray]:
        """Constant positions: of the surroundings' paths, or of any paths at one time."""
        points = self._viewpoint + paths.range[:, :1] * paths.arrival[:, 0]
        return lambda _: points

    def _facet_centres(self, traced: Traced) -> Callable[[float], FloatArray]:
        """Centres of the facets of direct paths; paths by several surfaces have constant positions."""
        count = len(traced.places(traced.moving.times[0]))
        others = self._positions_of(traced.moving.select(np.arange(count, traced.moving.num_paths)))
        return lambda t: np.concatenate([traced.places(t), others(t)])
