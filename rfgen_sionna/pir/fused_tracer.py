"""Traced actors in surroundings from an image, frame by frame."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.pir.fusion import MAX_GAIN_DB, Refinement, image, mix_paths, occlude_traced
from rfgen_sionna.pir.image_surroundings import ImageSurroundings
from rfgen_sionna.records import Pir, RadarPaths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.report import TraceReport
from rfgen_sionna.tracing.traced import Traced
from rfgen_sionna.tracing.tracer import Tracer

if TYPE_CHECKING:
    from rfgen_sionna.tracing.moving.moving_trace import MovingTracer

KEY_SPACING = 0.5
"""Time between the images that are refined [s]."""


class Refiner(Protocol):
    """What repairs images, such as a path diffusion model."""

    def refine_sequence(self, frames: Sequence[Pir]) -> Sequence[Pir]:
        """The images as they should be; of the same view and instants, alike from one to the next."""
        ...


@dataclass(frozen=True)
class FusedFrame:
    """Paths over a stretch of time; the channel is the sum of all parts, which don't share knots."""

    parts: tuple[RadarPaths, ...]
    report: TraceReport


class FusedTracer:
    """Traces actors, and puts them into surroundings that an image shows.

    Parameters
    ----------
    tracer
        The actors in free space.
    environment
        Image of the surroundings, of energies for isotropic elements.
    seed
        Seed of the random phases.
    refiner
        What repairs images of both together; None leaves them.
    most_gain_db
        Largest change of traced energy by the refiner.

    Raises
    ------
    ValueError
        If the tracer has static surfaces as well, the radar of a refined run moves, or the image holds what no radar
        receives.
    """

    def __init__(
        self,
        tracer: Tracer,
        environment: Pir,
        seed: int,
        refiner: Refiner | None = None,
        most_gain_db: float = MAX_GAIN_DB,
    ) -> None:
        if tracer.surfaces.static:
            names = ", ".join(repr(surface.name) for surface in tracer.surfaces.static[:3])
            raise ValueError(
                f"environment: the scene has surfaces of its own ({names} …); scene=None goes with an image"
            )
        if refiner is not None and tracer.radar.trajectory is not None:
            raise ValueError("refiner: the radar moves, and images are refined for one that stands; None is allowed")
        self._tracer, self._refiner, self._seed, self._most_gain_db = tracer, refiner, seed, most_gain_db
        self.surroundings = ImageSurroundings(environment, tracer.radar, seed)
        self._viewpoint = np.asarray(tracer.radar.position)

    def images(self, times: Sequence[float]) -> list[Pir]:
        """Actors and surroundings together at instants [s], before they are refined."""
        run = self._tracer.follow(aimed=False)
        return [image(self._mixed(float(t), run), self.surroundings.view, float(t)) for t in times]

    def refinement(self, start: float, stop: float) -> Refinement | None:
        """What the refiner makes of `start` … `stop` [s]; None where there is none."""
        if self._refiner is None:
            return None
        count = 1 + int(np.ceil((stop - start) / KEY_SPACING - 1e-9)) if stop > start else 1
        mixed = self.images(np.linspace(start, stop, count).tolist())
        refined = list(self._refiner.refine_sequence(mixed))
        return Refinement(mixed, refined, self._tracer.radar, self._seed, self._most_gain_db)

    def instant(self, t: float) -> list[RadarPaths]:
        """All paths at `t` [s]: traced ones, those of the surroundings, and those that the refiner adds."""
        parts = self._mixed(t)
        refinement = self.refinement(t, t)
        if refinement is None:
            return parts
        changed = [refinement(part, self._positions_of(part)) for part in parts]
        return [*changed, *refinement.added(np.array([t]))]

    def trace(self, start: float, stop: float, moving: MovingTracer, refinement: Refinement | None) -> FusedFrame:
        """Paths from `start` to `stop` [s]; `moving` is the run's (:meth:`Tracer.follow`)."""
        visible_share: dict[float, FloatArray] = {}

        def watch(t: float, rays: RayScene) -> None:
            visible_share[t] = self.surroundings.visible_share(rays, t)

        traced = self._tracer.trace(start, stop, moving, watch if len(self._unoccluded_share) else None)
        instants = np.array(sorted(visible_share) or [start])
        share = np.stack([visible_share.get(t, self._unoccluded_share) for t in instants.tolist()], axis=1)
        times, report = instants, traced.report
        if self.surroundings.moves:
            times, missed = self._tracer.knots(lambda t: [self.surroundings.points(t)], start, stop)
            report = replace(report, time_error=max(report.time_error, missed))
            share = np.stack([np.interp(times, instants, row) for row in share]) if len(share) else share[:, :0]
        seen, *around = mix_paths(traced.moving, self.surroundings, times, share)
        refined = [] if traced.refined is None else [occlude_traced(traced.refined, self.surroundings)]
        if refinement is not None:
            seen = refinement(seen, self._facet_middles(traced))
            refined = [refinement(each, traced.refined_places) for each in refined]
            around = [refinement(part, self._positions_of(part)) for part in around]
            around += refinement.added(np.linspace(start, stop, 4) if stop > start else np.array([start]))
        return FusedFrame((seen, *refined, *around), report)

    @property
    def _unoccluded_share(self) -> FloatArray:
        """(path,) shares of surroundings that nothing hides."""
        return np.ones(len(self.surroundings.pixel))

    def _mixed(self, t: float, run: MovingTracer | None = None) -> list[RadarPaths]:
        """Traced paths and those of the surroundings at `t` [s]; those of a `run` share what it takes to find them."""
        paths = self._tracer.instant(t) if run is None else self._tracer.trace(t, t, run).moving
        visible_share = (
            self.surroundings.visible_share(self._tracer.rays_at(t), t)
            if self._tracer.actors
            else self._unoccluded_share
        )
        return mix_paths(paths, self.surroundings, np.array([t]), visible_share[:, None])

    def _positions_of(self, paths: RadarPaths) -> Callable[[float], FloatArray]:
        """Paths whose places stay: those of the surroundings, or any at one instant."""
        points = self._viewpoint + paths.range[:, :1] * paths.arrival[:, 0]
        return lambda _: points

    def _facet_middles(self, traced: Traced) -> Callable[[float], FloatArray]:
        """Middles of the facets that direct returns go by; paths by way of several surfaces stay where they are."""
        count = len(traced.places(traced.moving.times[0]))
        others = self._positions_of(traced.moving.select(np.arange(count, traced.moving.num_paths)))
        return lambda t: np.concatenate([traced.places(t), others(t)])
