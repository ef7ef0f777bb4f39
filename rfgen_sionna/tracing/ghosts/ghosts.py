"""Ghosts of moving surfaces via the flat parts of the static scene.

A plane mirror makes an image of the radar; the facet integral then runs between images of elements and elements.
Mirrors lie on the leg out, the leg back, or both, and a second-order image puts two on one leg. Levels estimated from
Fresnel coefficients, spreading and antenna pattern select the mirrors and the accuracy of each integral.
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
from rfgen_sionna.tracing.ghosts.ghost_levels import ghost_levels, second_order_levels
from rfgen_sionna.tracing.ghosts.ghost_visibility import GhostVisibilitySampler, MirroredVisibility
from rfgen_sionna.tracing.ghosts.image_band import ImageBand, MirroredFacets
from rfgen_sionna.tracing.ghosts.image_returns import (
    LEG_COMBINATIONS,
    Centroids,
    CutFacets,
    ImageReturns,
    image_tolerance,
)
from rfgen_sionna.tracing.ghosts.mirror_images import Mirror, SecondOrderImage
from rfgen_sionna.tracing.surface.facets import Facets
from rfgen_sionna.tracing.surface.surfaces import Surfaces

OMITTED_SHARE = 0.5
"""Share of the tolerance for all omitted mirrors together."""
IMAGE_VERTICES = 2000
"""Vertices of an image that set the number of delay knots; bounds the time."""


@dataclass(frozen=True)
class GhostVisibility:
    """Visibility of facets via mirrors at one sample time."""

    mirrors: MirroredVisibility
    second_order: MirroredVisibility | None
    """By way of second-order images; None without significant ones."""

    @property
    def sampled_facets(self) -> int:
        """Facets with visibility rays."""
        return self.mirrors.sampled_facets + (0 if self.second_order is None else self.second_order.sampled_facets)

    @property
    def rays(self) -> int:
        """Rays sent."""
        return self.mirrors.rays + (0 if self.second_order is None else self.second_order.rays)


class Ghosts:
    """Selects and traces the ghosts of moving surfaces.

    `rtol` is relative to the direct return of each actor, `max_bounces` 2 or 3; `mirrors` finds the mirrors of the
    static scene at first use.
    """

    def __init__(
        self, surfaces: Surfaces, radar: Radar, rtol: float, max_bounces: int, mirrors: Callable[[], tuple[Mirror, ...]]
    ) -> None:
        self._surfaces, self._radar, self._rtol, self._max_bounces = surfaces, radar, rtol, max_bounces
        self._find = mirrors
        self._viewpoint = np.asarray(radar.position)
        self._selected: NDArray[np.intp] = np.zeros(0, np.intp)
        self._used = np.zeros((0, 2), np.bool_)
        self._pairs: NDArray[np.intp] = np.zeros((0, 2), np.intp)  # one mirror out, the other back
        self._level = np.zeros(0)  # (mirror,) of the strongest ghost via it
        self._second_order_mirrors: dict[tuple[int, int], SecondOrderImage] = {}  # cache
        self._ways: list[tuple[int, int]] = []  # in use
        self._second_order: tuple[SecondOrderImage, ...] = ()
        self._second_order_level = np.zeros(0)
        self._second_order_sampler: GhostVisibilitySampler | None = None
        names = surfaces.object_names, surfaces.part_names
        self._returns = ImageReturns(surfaces.moving, names, radar, rtol, lambda _: self.mirrors)
        self._second_order_returns = ImageReturns(surfaces.moving, names, radar, rtol, lambda _: self._second_order)

    @cached_property
    def mirrors(self) -> tuple[Mirror, ...]:
        """Mirrors of the static scene."""
        return self._find()

    @property
    def active(self) -> bool:
        """Whether any mirror is in use after :meth:`prepare`."""
        return len(self._selected) > 0 or len(self._second_order) > 0

    def reset(self) -> None:
        """Discard the expansions."""
        self._returns.reset()
        self._second_order_returns.reset()

    def prepare(self, poses: Sequence[Sequence[FloatArray]]) -> None:
        """Select the significant mirrors for `poses`: for each, the (vertex, 3) positions [m] of every actor."""
        if not self.mirrors:
            return
        known = self._radar, self._probe.pattern_gain, self.mirrors
        each_pose = [ghost_levels(*known, points, self._max_bounces) for points in chain(*poses)]
        levels, across = (np.max(some, axis=0) for some in zip(*each_pose, strict=True))
        second_order = np.zeros_like(across)
        if self._max_bounces > 2:
            second_order = np.max([second_order_levels(*known, points) for points in chain(*poses)], axis=0)
        every = np.concatenate([levels.ravel(), across.ravel(), second_order.ravel()])
        order = np.argsort(every)
        used = np.zeros(every.size, np.bool_)
        used[order[np.cumsum(every[order]) > OMITTED_SHARE * self._rtol]] = True
        used &= every > 0
        single, both, after = (
            each.reshape(shape.shape)
            for each, shape in zip(
                np.split(used, np.cumsum([levels.size, across.size])), (levels, across, second_order), strict=True
            )
        )
        pairs = np.argwhere(both)
        new = (single & ~self._used if self._used.size else single).any()
        if new or not set(map(tuple, pairs.tolist())) <= set(map(tuple, self._pairs.tolist())):
            self.reset()
        self._used, self._pairs = single, pairs
        self._level = np.maximum(levels.max(axis=1), np.maximum(across.max(axis=0), across.max(axis=1)))
        self._selected = np.flatnonzero(single.any(axis=1) | both.any(axis=0) | both.any(axis=1))
        ways = [(one, other) for one, other in np.argwhere(after).tolist()]
        for one, other in set(ways) - set(self._second_order_mirrors):
            self._second_order_mirrors[one, other] = SecondOrderImage.of(self.mirrors[one], self.mirrors[other])
        if ways != self._ways:
            if not set(ways) <= set(self._ways):
                self._second_order_returns.reset()
            self._ways, self._second_order = ways, tuple(self._second_order_mirrors[way] for way in ways)
            self._second_order_sampler = self._sampler_of(self._second_order) if ways else None
        self._second_order_level = np.array([second_order[way] for way in ways])

    def images(self, vertices: Sequence[FloatArray]) -> list[list[tuple[FloatArray, float]]]:
        """Images of each actor in the mirrors in use, and the tolerance of their returns."""
        in_use = [(mirror, image_tolerance(self._rtol, level)) for mirror, level in self._in_use]
        return [[(mirror.unfolded(points), tolerance) for mirror, tolerance in in_use] for points in vertices]

    def delay_points(self, vertices: Sequence[FloatArray]) -> list[FloatArray]:
        """Vertices of the actors, and some of their images', whose distances set the delay knots."""
        few = [points[:: max(1, len(points) // IMAGE_VERTICES)] for points in vertices]
        return [*vertices, *(mirror.unfolded(points) for mirror, _ in self._in_use for points in few)]

    @property
    def _in_use(self) -> list[tuple[Mirror, float]]:
        """Mirrors, and the level of the strongest ghost via each."""
        own = [(self.mirrors[m], float(self._level[m])) for m in self._selected]
        return own + list(zip(self._second_order, self._second_order_level.tolist(), strict=True))

    @cached_property
    def _probe(self) -> ImageBand:
        return ImageBand(self._radar, self._rtol, self.mirrors, True, True)

    def trace_visibility(self, rays: RayScene, facets: Facets, fraction: FloatArray) -> GhostVisibility:
        """Visibility of facets via the mirrors in use; `fraction` (facet,) is the share visible directly."""
        second_order, count = None, len(self._second_order)
        if self._second_order_sampler is not None:
            once, none = np.tile([True, False], (count, 1)), np.zeros((0, 2), np.intp)
            second_order = self._second_order_sampler(rays, facets, fraction, np.arange(count), once, none)
        return GhostVisibility(
            self._visibility_sampler(rays, facets, fraction, self._selected, self._used, self._pairs), second_order
        )

    @cached_property
    def _visibility_sampler(self) -> GhostVisibilitySampler:
        return self._sampler_of(self.mirrors)

    def _sampler_of(self, mirrors: Sequence[Mirror]) -> GhostVisibilitySampler:
        highest = self._radar.center_frequency + 0.5 * self._radar.waveform.bandwidth
        wavenumber = 2 * np.pi * highest / SPEED_OF_LIGHT
        return GhostVisibilitySampler(
            mirrors, self._surfaces, self._viewpoint, self._radar.max_range, wavenumber, self._rtol
        )

    def trace(
        self,
        knots: FloatArray,
        sample_times: FloatArray,
        facets: Sequence[Facets],
        views: Sequence[GhostVisibility],
        centroids: Centroids,
        reference_level: FloatArray,
    ) -> tuple[list[RadarPaths], float]:
        """Ghost paths at `knots` [s], from `facets` and `views` at `sample_times` [s], and their error relative to the
        actors' direct returns `reference_level` (surface,)."""
        paths, error = list[RadarPaths](), 0.0
        single = _ActiveMirrors(self._returns, self._selected, self._pairs, LEG_COMBINATIONS)
        second_order = _ActiveMirrors(
            self._second_order_returns, np.arange(len(self._second_order)), self._pairs[:0], LEG_COMBINATIONS[:2]
        )
        by_one = [each.mirrors for each in views]
        by_two = [each.second_order for each in views if each.second_order is not None]
        for some, visible in ((single, by_one), (second_order, by_two)):
            if visible:
                more, missed = some.trace(knots, sample_times, facets, visible, centroids, reference_level)
                paths, error = paths + more, error + missed
        return paths, error


class _ActiveMirrors(NamedTuple):
    """Mirrors of one order in use."""

    returns: ImageReturns
    number: NDArray[np.intp]
    """(mirror,) index among the mirrors of `returns`."""
    pairs: NDArray[np.intp]
    """(pair, 2) mirrors used one out and the other back."""
    ways: Sequence[tuple[bool, bool]]
    """Some of `LEG_COMBINATIONS`."""

    def trace(
        self,
        knots: FloatArray,
        sample_times: FloatArray,
        facets: Sequence[Facets],
        visible: Sequence[MirroredVisibility],
        centroids: Centroids,
        reference_level: FloatArray,
    ) -> tuple[list[RadarPaths], float]:
        """As :meth:`Ghosts.trace`, with the visibility at each sample time."""
        paths, error = [], 0.0
        for way in self.ways:
            twice = all(way)
            shares = np.stack([each.twice if twice else each.once for each in visible])
            both = np.stack((self.number,) * 2)
            if twice and len(self.pairs):
                across = np.stack([each.across for each in visible])
                shares = np.concatenate([shares, across, across], axis=1)  # either first
                both = np.concatenate([both, self.pairs.T, self.pairs.T[::-1]], axis=1)
            row, column = np.nonzero((shares > 0).any(axis=0))
            if len(row) == 0:
                continue
            first, last = both[:, row].astype(np.int32)
            visible_facets = [MirroredFacets.of(each, column, first, last) for each in facets]
            place = np.full(shares.shape[1:], -1, np.intp)
            place[row, column] = np.arange(len(row))
            cut = [self._cut(each, twice, place) for each in visible]
            own = shares[:, row, column]
            more, missed = self.returns(
                way, knots, sample_times, visible_facets, own, column, centroids, reference_level, cut
            )
            paths.append(more)
            error += missed
        self.returns.finish(error)
        return paths, error + max(each.missed for each in visible)

    def _cut(self, visible: MirroredVisibility, twice: bool, place: NDArray[np.intp]) -> CutFacets:
        """Pieces of partly visible facets; `place` (row, facet) numbers the visible facets of mirrors, then of
        pairs."""
        own, across = visible.cut[1 if twice else 0], visible.cut[2]
        parts = [(own.row, own.column, own.pieces)]
        if twice and len(self.pairs):
            first = len(self.number)
            parts += [(row + across.row, across.column, across.pieces) for row in (first, first + len(self.pairs))]
        rows, columns, pieces = (np.concatenate(each) for each in zip(*parts, strict=True))
        owner = place[rows, columns]
        visible_facets = owner >= 0
        return owner[visible_facets], pieces[visible_facets]
