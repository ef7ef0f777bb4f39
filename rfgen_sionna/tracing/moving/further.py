"""What moves, seen by further ways than the straight one: in walls, by flat and bent parts, through slabs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import chain
from typing import NamedTuple

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.records import RadarPaths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.bounces.bounces import Bounced, Bounces
from rfgen_sionna.tracing.curved.round_bounces import RoundBounces, RoundSeen
from rfgen_sionna.tracing.gains.band import BandTracer
from rfgen_sionna.tracing.ghosts.ghosts import Ghosts, GhostView
from rfgen_sionna.tracing.ghosts.image_returns import Centroids
from rfgen_sionna.tracing.moving.facets import Positions
from rfgen_sionna.tracing.moving.slab_edges import SlabEdges
from rfgen_sionna.tracing.moving.views import Seen
from rfgen_sionna.tracing.surface.facets import Facets
from rfgen_sionna.tracing.surface.surfaces import Surfaces
from rfgen_sionna.tracing.veils.veils import Veiled, Veils


class SeenFurther(NamedTuple):
    """What is seen by further ways at the instants of a stretch, of each kind that there is."""

    facets: list[Facets]
    """What was looked at, at each instant."""
    mirrored: list[GhostView]
    bounced: list[list[Bounced]]
    """Of all bounces that there are, at each instant."""
    rounded: list[RoundSeen]
    veiled: list[Veiled]

    @property
    def views(self) -> list[GhostView | Bounced | RoundSeen | Veiled]:
        """All of them."""
        return [*self.mirrored, *chain(*self.bounced), *self.rounded, *self.veiled]


class FurtherWays:
    """Finds what the radar sees of moving surfaces by further ways, and traces it.

    Parameters
    ----------
    surfaces, band
        The surfaces, and the radar's gains.
    ghosts, bounces, rounds, veils
        What there may be: ghosts in walls, what flat parts show, plainly and through slabs, what bent surfaces do, and
        what is behind slabs.
    """

    def __init__(
        self,
        surfaces: Surfaces,
        band: BandTracer,
        ghosts: Ghosts | None = None,
        bounces: Sequence[Bounces] = (),
        rounds: RoundBounces | None = None,
        veils: Veils | None = None,
    ) -> None:
        self._still = surfaces.static_vertices
        self.ghosts, self._bounces, self._rounds, self._veils = ghosts, tuple(bounces), rounds, veils
        self._slab_edges = None if veils is None else SlabEdges(veils, band)

    def __bool__(self) -> bool:
        """Whether mirrors show what looks away from the radar, or slabs: the back of a hollow body."""
        return self.ghosts is not None or bool(self._bounces) or self._veils is not None

    @property
    def through_slabs(self) -> bool:
        """Whether slabs may show what is behind them."""
        return self._veils is not None

    @property
    def _mirrored(self) -> Ghosts | None:
        return self.ghosts if self.ghosts is not None and self.ghosts.active else None

    def consider(self, positions: Positions, times: Sequence[float]) -> Positions:
        """Choose the mirrors whose ghosts matter at `times` [s]; returns what delays are to follow in time."""
        if self.ghosts is not None:
            self.ghosts.consider([positions(t) for t in times])
        ghosts, bounces = self._mirrored, self.over(positions, times[0])
        if ghosts is None and not bounces:
            return positions

        def followed(t: float) -> list[FloatArray]:
            found = list(positions(t))
            if ghosts is not None:
                found = ghosts.followed(found)
            return [*found, *(points for each in bounces for points in each.followed(positions(t)))]

        return followed

    def over(self, positions: Positions, start: float) -> list[Bounces]:
        """The bounces that there may be in a stretch that begins at `start` [s]."""
        return [each for each in self._bounces if each.follow(positions, start)]

    def weights(
        self, rays: Callable[[], RayScene], vertices: Sequence[FloatArray], facets: Facets, fraction: FloatArray
    ) -> FloatArray:
        """(facet,) share that is seen, `fraction` (facet,) directly, and what gets through slabs: as fine as that asks
        for facets have to be. `rays` gives the ray scene, in which the moving surfaces have their `vertices` [m]."""
        if self._veils is None:
            return fraction
        veiled = self._veils.see(rays(), self._everything(vertices), facets, fraction)
        return np.asarray(fraction + self._veils.weights(veiled, len(fraction)))

    def see(
        self,
        bounces: Sequence[Bounces],
        instants: Sequence[float],
        positions: Positions,
        rays: Callable[[float], RayScene],
        facets: Sequence[Facets],
        seen: Sequence[Seen],
    ) -> tuple[SeenFurther, list[Seen]]:
        """What is seen of the `facets`, those from all sides, at each of the `instants` [s], of which so much is `seen`
        directly; and that again, with what slabs let through beside their shadows' edges.

        `rays` gives the ray scene as it stands at an instant, and takes it on to that from where it stood.
        """
        further, direct = SeenFurther(list(facets), [], [[] for _ in bounces], [], []), list(seen)
        for k, (t, own, there) in enumerate(zip(instants, facets, seen, strict=True)):
            if not self:
                break
            scene, everything = rays(t), self._everything(positions(t))
            if (ghosts := self._mirrored) is not None:
                further.mirrored.append(ghosts.see(scene, own, there.fraction))
            for plates, shown in zip(bounces, further.bounced, strict=True):
                shown.append(plates.see(t, scene, own, there.fraction))
            if self._rounds is not None:
                further.rounded.append(self._rounds.see(scene, everything, own.number[there.fraction > 0]))
            if self._veils is not None:
                further.veiled.append(self._veils.see(scene, everything, own, there.fraction))
            if self._slab_edges is not None:
                direct[k] = self._slab_edges.beside(scene, everything, there)
        return further, direct

    def trace(
        self,
        bounces: Sequence[Bounces],
        knots: FloatArray,
        instants: FloatArray,
        positions: Positions,
        centroids: Centroids,
        seen: SeenFurther,
        level: FloatArray,
    ) -> tuple[list[RadarPaths], float]:
        """Paths by all of these ways, with delays at the `knots` [s], and what may be off of them, relative to the
        `level` (surface,) of direct returns."""
        given = knots, instants, seen.facets
        paths, error = list[RadarPaths](), 0.0
        if self._veils is not None:
            through, missed, _ = self._veils.trace(*given, seen.veiled, centroids, level)
            paths, error = [] if through is None else [through], missed
        if (ghosts := self._mirrored) is not None:
            found, missed = ghosts.trace(*given, seen.mirrored, centroids, level)
            paths, error = paths + found, error + missed
        for plates, shown in zip(bounces, seen.bounced, strict=True):
            found, missed = plates.trace(*given, shown, centroids, level)
            paths, error = paths + found, error + missed
        if self._rounds is not None:
            around, missed = self._rounds.trace(knots, instants, seen.rounded, positions, level)
            paths, error = paths if around is None else [*paths, around], error + missed
        return paths, error

    def _everything(self, vertices: Sequence[FloatArray]) -> list[FloatArray]:
        """(vertex, 3) positions [m] of all surfaces."""
        return [*self._still, *vertices]
