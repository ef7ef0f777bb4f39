"""Ghosts: what moves, seen by way of the flat surfaces of the static scene.

A plane mirror makes an image of the radar, and the facet integral is then that between the images of the elements and
the elements themselves: radar, mirror, body, radar; the same backwards; and by the mirror both times. Which mirrors
matter is estimated from their Fresnel coefficients, spreading and antenna pattern; the integral is as accurate as a
weaker return needs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.radar import Radar
from rfgen_sionna.records import FloatArray, RadarPaths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.facets import Facets
from rfgen_sionna.tracing.ghost_levels import ghost_levels
from rfgen_sionna.tracing.image_band import ImageBand, MirroredFacets
from rfgen_sionna.tracing.image_returns import WAYS, Centroids, ImageReturns, image_tolerance
from rfgen_sionna.tracing.mirror_sight import MirroredView, MirrorSight
from rfgen_sionna.tracing.mirrors import Mirror
from rfgen_sionna.tracing.surfaces import Surfaces

SKIPPED = 0.5
"""Share of the tolerance that the mirrors left out may make up together."""
KNOT_SAMPLES = 2000
"""Vertices of an image that tell how many knots its delays need."""


class Ghosts:
    """Finds and traces the ghosts of moving surfaces.

    Parameters
    ----------
    surfaces
        All of the scene.
    radar
        Where it stands.
    rtol
        Tolerance, relative to the direct return of each actor.
    max_bounces
        2 or 3.
    mirrors
        The flat parts of the static scene, asked for at first use.
    """

    def __init__(
        self,
        surfaces: Surfaces,
        radar: Radar,
        rtol: float,
        max_bounces: int,
        mirrors: Callable[[], tuple[Mirror, ...]],
    ) -> None:
        self._surfaces, self._radar, self._rtol, self._max_bounces = surfaces, radar, rtol, max_bounces
        self._find = mirrors
        self._viewpoint = np.asarray(radar.position)
        self._kept: NDArray[np.intp] = np.zeros(0, np.intp)
        self._used = np.zeros((0, 2), np.bool_)
        self._level = np.zeros((0, 2))
        names = surfaces.object_names, surfaces.part_names
        self._returns = ImageReturns(surfaces.moving, names, radar, rtol, lambda _: self.mirrors)

    @cached_property
    def mirrors(self) -> tuple[Mirror, ...]:
        """Flat parts of the static scene that may show ghosts."""
        return self._find()

    @property
    def active(self) -> bool:
        """Whether there are ghosts to be traced, after :meth:`consider`."""
        return len(self._kept) > 0

    def forget(self) -> None:
        """Choose the expansions anew."""
        self._returns.forget()

    def consider(self, poses: Sequence[Sequence[FloatArray]]) -> None:
        """Choose the mirrors that matter while the (vertex, 3) positions [m] of the actors are those of `poses`."""
        if not self.mirrors:
            return
        levels = np.max(
            [
                ghost_levels(self._radar, self._probe.importance, self.mirrors, points, self._max_bounces)
                for pose in poses
                for points in pose
            ],
            axis=0,
        )
        order = np.argsort(levels, axis=None)
        total = np.cumsum(levels.ravel()[order])
        used = np.zeros(levels.size, np.bool_)
        used[order[total > SKIPPED * self._rtol]] = True
        used = used.reshape(levels.shape) & (levels > 0)
        if (used & ~self._used if self._used.size else used).any():
            self.forget()
        self._used, self._level = used, levels
        self._kept = np.flatnonzero(used.any(axis=1))

    def images(self, vertices: Sequence[FloatArray]) -> list[list[tuple[FloatArray, float]]]:
        """For every actor its images in the mirrors in use and the tolerance of their returns."""
        found = []
        for points in vertices:
            found.append(
                [(self.mirrors[m].image(points), image_tolerance(self._rtol, self._level[m].max())) for m in self._kept]
            )
        return found

    def followed(self, vertices: Sequence[FloatArray]) -> list[FloatArray]:
        """The actors and a choice of their images' vertices, whose distances the delays follow."""
        few = [points[:: max(1, len(points) // KNOT_SAMPLES)] for points in vertices]
        return [*vertices, *(self.mirrors[m].image(points) for m in self._kept for points in few)]

    @cached_property
    def _probe(self) -> ImageBand:
        return ImageBand(self._radar, self._rtol, self.mirrors, True, True)

    def see(self, rays: RayScene, facets: Facets, fraction: FloatArray) -> MirroredView:
        """What the mirrors in use show of the facets, of which `fraction` (facet,) is seen directly."""
        return self._sight(rays, facets, fraction, self._kept, self._used)

    @cached_property
    def _sight(self) -> MirrorSight:
        return MirrorSight(self.mirrors, self._surfaces, self._viewpoint, self._radar.max_range)

    def trace(
        self,
        knots: FloatArray,
        instants: FloatArray,
        facets: Sequence[Facets],
        seen: Sequence[MirroredView],
        centroids: Centroids,
        usual: FloatArray,
    ) -> tuple[list[RadarPaths], float]:
        """Paths of the ghosts and their error, relative to the actors' direct returns `usual` (surface,).

        `facets` and `seen` are those of each of the `instants` [s]; delays are for the `knots` [s].
        """
        paths, error = [], 0.0
        for way in WAYS:
            tx, rx = way
            shares = np.stack([each.twice if tx and rx else each.once for each in seen])
            row, column = np.nonzero((shares > 0).any(axis=0))
            if len(row) == 0:
                continue
            mirror: NDArray[np.int32] = self._kept[row].astype(np.int32)
            shown = [MirroredFacets.of(each, column, mirror, mirror) for each in facets]
            more, missed = self._returns(way, knots, instants, shown, shares[:, row, column], column, centroids, usual)
            paths.append(more)
            error += missed
        self._returns.finish(error)
        return paths, error
