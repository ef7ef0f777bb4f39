"""Ghosts: what moves, seen by way of the flat surfaces of the static scene.

A plane mirror makes an image of the radar, and the facet integral is then that between the images of the elements and
the elements themselves: radar, mirror, body, radar; the same backwards; and by a mirror both times, the same one or
another. A mirror that another one shows makes an image of the image: radar, mirror, mirror, body, radar. Which mirrors
matter is estimated from their Fresnel coefficients, spreading and antenna pattern; the integral is as accurate as a
weaker return needs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import RadarPaths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.ghosts.image_band import ImageBand, MirroredFacets
from rfgen_sionna.tracing.ghosts.image_returns import WAYS, Centroids, Cut, ImageReturns, image_tolerance
from rfgen_sionna.tracing.ghosts.levels import folded_levels, ghost_levels
from rfgen_sionna.tracing.ghosts.mirrors import Folded, Mirror
from rfgen_sionna.tracing.ghosts.sight import MirroredView, MirrorSight
from rfgen_sionna.tracing.surface.facets import Facets
from rfgen_sionna.tracing.surface.surfaces import Surfaces

SKIPPED = 0.5
"""Share of the tolerance that the mirrors left out may make up together."""
KNOT_SAMPLES = 2000
"""Vertices of an image that tell how many knots its delays need."""


@dataclass(frozen=True)
class GhostView:
    """What mirrors show of the facets at an instant."""

    mirrors: MirroredView
    folded: MirroredView | None
    """By way of two, one after the other; None where none matter."""

    @property
    def looked_at(self) -> int:
        """Facets that rays were sent for."""
        return self.mirrors.looked_at + (0 if self.folded is None else self.folded.looked_at)

    @property
    def rays(self) -> int:
        """Rays sent."""
        return self.mirrors.rays + (0 if self.folded is None else self.folded.rays)


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
        self._pairs: NDArray[np.intp] = np.zeros((0, 2), np.intp)  # one mirror there, the other back
        self._level = np.zeros(0)  # (mirror,) of the strongest ghost by way of it
        self._folds: dict[tuple[int, int], Folded] = {}  # all that ever mattered
        self._ways: list[tuple[int, int]] = []  # those in use
        self._folded: tuple[Folded, ...] = ()
        self._folded_level = np.zeros(0)
        self._sight_folded: MirrorSight | None = None
        names = surfaces.object_names, surfaces.part_names
        self._returns = ImageReturns(surfaces.moving, names, radar, rtol, lambda _: self.mirrors)
        self._folded_returns = ImageReturns(surfaces.moving, names, radar, rtol, lambda _: self._folded)

    @cached_property
    def mirrors(self) -> tuple[Mirror, ...]:
        """Flat parts of the static scene that may show ghosts."""
        return self._find()

    @property
    def active(self) -> bool:
        """Whether there are ghosts to be traced, after :meth:`consider`."""
        return len(self._kept) > 0 or len(self._folded) > 0

    def forget(self) -> None:
        """Choose the expansions anew."""
        self._returns.forget()
        self._folded_returns.forget()

    def consider(self, poses: Sequence[Sequence[FloatArray]]) -> None:
        """Choose the mirrors that matter while the (vertex, 3) positions [m] of the actors are those of `poses`."""
        if not self.mirrors:
            return
        known = self._radar, self._probe.importance, self.mirrors
        each_pose = [ghost_levels(*known, points, self._max_bounces) for points in chain(*poses)]
        levels, across = (np.max(some, axis=0) for some in zip(*each_pose, strict=True))
        folded = np.zeros_like(across)
        if self._max_bounces > 2:
            folded = np.max([folded_levels(*known, points) for points in chain(*poses)], axis=0)
        every = np.concatenate([levels.ravel(), across.ravel(), folded.ravel()])
        order = np.argsort(every)
        used = np.zeros(every.size, np.bool_)
        used[order[np.cumsum(every[order]) > SKIPPED * self._rtol]] = True
        used &= every > 0
        single, both, after = (
            each.reshape(shape.shape)
            for each, shape in zip(
                np.split(used, np.cumsum([levels.size, across.size])), (levels, across, folded), strict=True
            )
        )
        pairs = np.argwhere(both)
        new = (single & ~self._used if self._used.size else single).any()
        if new or not set(map(tuple, pairs.tolist())) <= set(map(tuple, self._pairs.tolist())):
            self.forget()
        self._used, self._pairs = single, pairs
        self._level = np.maximum(levels.max(axis=1), np.maximum(across.max(axis=0), across.max(axis=1)))
        self._kept = np.flatnonzero(single.any(axis=1) | both.any(axis=0) | both.any(axis=1))
        ways = [(one, other) for one, other in np.argwhere(after).tolist()]
        for way in ways:
            if way not in self._folds:
                self._folds[way] = Folded.of(*(self.mirrors[each] for each in way))
        if ways != self._ways:
            if not set(ways) <= set(self._ways):
                self._folded_returns.forget()
            self._ways, self._folded = ways, tuple(self._folds[way] for way in ways)
            self._sight_folded = self._sight_of(self._folded) if ways else None
        self._folded_level = np.array([folded[way] for way in ways])

    def images(self, vertices: Sequence[FloatArray]) -> list[list[tuple[FloatArray, float]]]:
        """For every actor its images in the mirrors in use and the tolerance of their returns."""
        found = []
        for points in vertices:
            found.append(
                [(mirror.unfolded(points), image_tolerance(self._rtol, level)) for mirror, level in self._in_use]
            )
        return found

    def followed(self, vertices: Sequence[FloatArray]) -> list[FloatArray]:
        """The actors and a choice of their images' vertices, whose distances the delays follow."""
        few = [points[:: max(1, len(points) // KNOT_SAMPLES)] for points in vertices]
        return [*vertices, *(mirror.unfolded(points) for mirror, _ in self._in_use for points in few)]

    @property
    def _in_use(self) -> list[tuple[Mirror, float]]:
        """Mirrors, and the level of the strongest ghost by way of each."""
        own = [(self.mirrors[m], float(self._level[m])) for m in self._kept]
        return own + list(zip(self._folded, self._folded_level.tolist(), strict=True))

    @cached_property
    def _probe(self) -> ImageBand:
        return ImageBand(self._radar, self._rtol, self.mirrors, True, True)

    def see(self, rays: RayScene, facets: Facets, fraction: FloatArray) -> GhostView:
        """What the mirrors in use show of the facets, of which `fraction` (facet,) is seen directly."""
        folded, count = None, len(self._folded)
        if self._sight_folded is not None:
            once, none = np.tile([True, False], (count, 1)), np.zeros((0, 2), np.intp)
            folded = self._sight_folded(rays, facets, fraction, np.arange(count), once, none)
        return GhostView(self._sight(rays, facets, fraction, self._kept, self._used, self._pairs), folded)

    @cached_property
    def _sight(self) -> MirrorSight:
        return self._sight_of(self.mirrors)

    def _sight_of(self, mirrors: Sequence[Mirror]) -> MirrorSight:
        highest = self._radar.center_frequency + 0.5 * self._radar.waveform.bandwidth
        wavenumber = 2 * np.pi * highest / SPEED_OF_LIGHT
        return MirrorSight(mirrors, self._surfaces, self._viewpoint, self._radar.max_range, wavenumber, self._rtol)

    def trace(
        self,
        knots: FloatArray,
        instants: FloatArray,
        facets: Sequence[Facets],
        views: Sequence[GhostView],
        centroids: Centroids,
        usual: FloatArray,
    ) -> tuple[list[RadarPaths], float]:
        """Paths of the ghosts and their error, relative to the actors' direct returns `usual` (surface,).

        `facets` and `views` are those of each of the `instants` [s]; delays are for the `knots` [s].
        """
        paths, error = list[RadarPaths](), 0.0
        single = _InUse(self._returns, self._kept, self._pairs, WAYS)
        folded = _InUse(self._folded_returns, np.arange(len(self._folded)), self._pairs[:0], WAYS[:2])
        by_one, by_two = [each.mirrors for each in views], [each.folded for each in views if each.folded is not None]
        for some, seen in ((single, by_one), (folded, by_two)):
            if seen:
                more, missed = some.trace(knots, instants, facets, seen, centroids, usual)
                paths, error = paths + more, error + missed
        return paths, error


class _InUse(NamedTuple):
    """Mirrors of one kind that show something."""

    returns: ImageReturns
    number: NDArray[np.intp]
    """(mirror,) which of those of `returns` each is."""
    pairs: NDArray[np.intp]
    """(pair, 2) those of them that count together, one there and the other back."""
    ways: Sequence[tuple[bool, bool]]
    """Some of `WAYS`."""

    def trace(
        self,
        knots: FloatArray,
        instants: FloatArray,
        facets: Sequence[Facets],
        seen: Sequence[MirroredView],
        centroids: Centroids,
        usual: FloatArray,
    ) -> tuple[list[RadarPaths], float]:
        """As :meth:`Ghosts.trace`, of what is `seen` by way of them at each of the instants."""
        paths, error = [], 0.0
        for way in self.ways:
            twice = all(way)
            shares = np.stack([each.twice if twice else each.once for each in seen])
            both = np.stack((self.number,) * 2)
            if twice and len(self.pairs):
                across = np.stack([each.across for each in seen])
                shares = np.concatenate([shares, across, across], axis=1)  # either first
                both = np.concatenate([both, self.pairs.T, self.pairs.T[::-1]], axis=1)
            row, column = np.nonzero((shares > 0).any(axis=0))
            if len(row) == 0:
                continue
            first, last = both[:, row].astype(np.int32)
            shown = [MirroredFacets.of(each, column, first, last) for each in facets]
            place = np.full(shares.shape[1:], -1, np.intp)
            place[row, column] = np.arange(len(row))
            cut = [self._cut(each, twice, place) for each in seen]
            own = shares[:, row, column]
            more, missed = self.returns(way, knots, instants, shown, own, column, centroids, usual, cut)
            paths.append(more)
            error += missed
        self.returns.finish(error)
        return paths, error + max(each.missed for each in seen)

    def _cut(self, seen: MirroredView, twice: bool, place: NDArray[np.intp]) -> Cut:
        """What is `seen` of facets of which a part is, once or `twice`; `place` (row, facet) tells which of all those
        that are shown each is, of the mirrors one after the other and of the pairs of them, either first."""
        own, across = seen.cut[1 if twice else 0], seen.cut[2]
        parts = [(own.row, own.column, own.pieces)]
        if twice and len(self.pairs):
            first = len(self.number)
            parts += [(row + across.row, across.column, across.pieces) for row in (first, first + len(self.pairs))]
        rows, columns, pieces = (np.concatenate(each) for each in zip(*parts, strict=True))
        owner = place[rows, columns]
        shown = owner >= 0  # of some next to nothing is
        return owner[shown], pieces[shown]
