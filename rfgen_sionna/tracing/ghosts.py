"""Ghosts: what moves, seen by way of the flat surfaces of the static scene.

A plane mirror makes an image of the radar, and the facet integral is then that between the images of the elements and
the elements themselves: radar, mirror, body, radar; the same backwards; and by the mirror both times. Which mirrors
matter is estimated from their Fresnel coefficients, spreading and antenna pattern; the integral is as accurate as a
weaker return needs.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.radar import Radar
from rfgen_sionna.records import FloatArray, RadarPaths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.accuracy import measure, sums
from rfgen_sionna.tracing.facets import Facets, facet_paths, over_time
from rfgen_sionna.tracing.gains import PROBES, Expansion
from rfgen_sionna.tracing.ghost_levels import ghost_levels
from rfgen_sionna.tracing.image_band import ImageBand, MirroredFacets
from rfgen_sionna.tracing.mirror_sight import MirroredView, MirrorSight
from rfgen_sionna.tracing.mirrors import Mirror
from rfgen_sionna.tracing.surfaces import Surfaces

SKIPPED = 0.5
"""Share of the tolerance that the mirrors left out may make up together."""
SHARE = 0.3
"""Share of the tolerance that the integral over the ghosts of one way may use up."""
LOOSEST = 0.03
"""Tolerance of a ghost, relative to itself, however weak it is."""
KNOT_SAMPLES = 2000
"""Vertices of an image that tell how many knots its delays need."""
WAYS = ((True, False), (False, True), (True, True))
"""Whether the way from Tx, and that to Rx, goes by the mirror."""
_LOG = logging.getLogger(__name__)

Centroids = Callable[[float, NDArray[np.intp]], FloatArray]
"""Time [s] and ascending numbers of facets to their centroids (facet, 3) [m]."""


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
        self._materials = tuple(surface.material for surface in surfaces.moving)
        self._kept: NDArray[np.intp] = np.zeros(0, np.intp)
        self._used = np.zeros((0, 2), np.bool_)
        self._level = np.zeros((0, 2))
        self._expansions: dict[tuple[bool, bool], tuple[ImageBand, Expansion]] = {}
        self._missed: dict[tuple[bool, bool], float] = {}
        self._turn = 0

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
        self._expansions.clear()
        self._missed.clear()

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
            found.append([(self.mirrors[m].image(points), self._tolerance(self._level[m].max())) for m in self._kept])
        return found

    def followed(self, vertices: Sequence[FloatArray]) -> list[FloatArray]:
        """The actors and a choice of their images' vertices, whose distances the delays follow."""
        few = [points[:: max(1, len(points) // KNOT_SAMPLES)] for points in vertices]
        return [*vertices, *(self.mirrors[m].image(points) for m in self._kept for points in few)]

    def _tolerance(self, level: float) -> float:
        return float(np.clip(SHARE * self._rtol / max(level, 1e-12), SHARE * min(self._rtol, LOOSEST), LOOSEST))

    @cached_property
    def _probe(self) -> ImageBand:
        return ImageBand(self._radar, self._rtol, self.mirrors, True, True)

    def _importance(self, offset: FloatArray) -> FloatArray:
        return self._probe.importance(offset / np.maximum(np.linalg.norm(offset, axis=1, keepdims=True), 1e-12))

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
        paths, error, middle = [], 0.0, len(instants) // 2
        for way in WAYS:
            tx, rx = way
            shares = np.stack([each.twice if tx and rx else each.once for each in seen])
            row, column = np.nonzero((shares > 0).any(axis=0))
            if len(row) == 0:
                continue
            mirror: NDArray[np.int32] = self._kept[row].astype(np.int32)
            share = shares[:, row, column]
            shown = [MirroredFacets.of(each, column, mirror, mirror) for each in facets]
            departing, arriving = self._directions(shown[middle].centroids, mirror, tx, rx)
            weight = share[middle] * np.sqrt(self._importance(departing) * self._importance(arriving))
            band, expansion = self._expansion(way, shown[middle], weight, usual)
            gains = [band(each, self._materials, expansion) for each in shown]
            error += self._error(band, shown[middle], weight, gains[middle], usual, way)
            for each, part in zip(gains, share, strict=True):
                each *= part
            paths.append(self._paths(knots, instants, shown, gains, (column, mirror), centroids, band))
        self._turn += 1
        if error > 1.5 * self._rtol:
            self.forget()
        return paths, error

    def _error(
        self,
        band: ImageBand,
        facets: MirroredFacets,
        weight: FloatArray,
        gains: NDArray[np.complex128],
        usual: FloatArray,
        way: tuple[bool, bool],
    ) -> float:
        """Error relative to the ghosts' own or the direct return, whichever is more: with a new expansion at two pairs
        and over the band, which is remembered, then at one place after the other."""
        pairs, probes = [(0, 0), (gains.shape[1] - 1, gains.shape[2] - 1)], PROBES
        if way in self._missed:
            pairs = [(self._turn % gains.shape[1], (self._turn // gains.shape[1]) % gains.shape[2])]
            probes = PROBES[[self._turn % len(PROBES)]]
        found = [
            measure(band, facets, self._materials, weight, gains[:, *pair], pair, probes, usual).error for pair in pairs
        ]
        error = float(np.max(found, initial=0.0))
        return max(error, self._missed.setdefault(way, error))

    def _expansion(
        self, way: tuple[bool, bool], facets: MirroredFacets, weight: FloatArray, usual: FloatArray
    ) -> tuple[ImageBand, Expansion]:
        if way not in self._expansions:
            lit = np.flatnonzero(weight > 0)
            facets, weight = facets.take(lit), weight[lit]
            rough = ImageBand(self._radar, LOOSEST, self.mirrors, *way)
            found = rough.at_probes(facets, self._materials, PROBES, (0, 0), facets.parts)
            phasor = np.exp(-2j * np.pi * np.mod(rough.frequency(PROBES)[:, None] * found.tau, 1.0))
            level = np.sqrt((np.abs(sums(found.a * phasor * weight, facets.surface, len(usual))) ** 2).mean(axis=0))
            # As accurate as the direct return of the actor whose ghosts are strongest against it asks for.
            share = float(np.max(level / np.maximum(np.maximum(usual, level), 1e-300), initial=0.0))
            band = ImageBand(self._radar, self._tolerance(share), self.mirrors, *way)
            reverse = self._expansions.get(way[::-1])
            if reverse is not None:  # what was enough for one way round
                expansion = band.expansion(reverse[1].basis)
            else:
                expansion = band.expansion_for(facets, self._materials, weight)
            self._expansions[way] = band, expansion
        return self._expansions[way]

    def _directions(
        self, centroids: FloatArray, mirror: NDArray[np.int32], tx: bool, rx: bool
    ) -> tuple[FloatArray, FloatArray]:
        """(facet, 3) unit vectors towards the first and the last interaction."""
        normals = np.stack([each.normal for each in self.mirrors])[mirror]
        heights = np.einsum("fi,fi->f", centroids, normals) - np.array([each.offset for each in self.mirrors])[mirror]
        direct, by = centroids - self._viewpoint, centroids - 2.0 * heights[:, None] * normals - self._viewpoint
        direct, by = (v / np.maximum(np.linalg.norm(v, axis=1, keepdims=True), 1e-12) for v in (direct, by))
        return (by if tx else direct), (by if rx else direct)

    def _paths(
        self,
        knots: FloatArray,
        instants: FloatArray,
        facets: Sequence[MirroredFacets],
        gains: Sequence[NDArray[np.complex128]],
        entries: tuple[NDArray[np.intp], NDArray[np.int32]],
        centroids: Centroids,
        band: ImageBand,
    ) -> RadarPaths:
        column, mirror = entries
        needed, back = np.unique(column, return_inverse=True)

        def places(t: float) -> FloatArray:
            return centroids(t, needed)[back]

        curves = over_time(knots, instants, gains, lambda t: band.lengths(places(t), mirror, mirror))
        directions = [self._directions(places(float(t)), mirror, band.tx, band.rx) for t in knots]
        departing, arriving = (np.stack([each[end] for each in directions], axis=1) for end in (0, 1))
        return facet_paths(
            self._surfaces.moving,
            facets[0],
            knots,
            *curves,
            departing,
            band.centre,
            band.half_band,
            (self._surfaces.object_names, self._surfaces.part_names),
            arriving,
            1 + band.tx + band.rx,
        )
