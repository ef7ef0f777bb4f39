"""Facets of the static scene on which shadows fall."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.records import RadarPaths
from rfgen_sionna.tracing.static.actor_shadows import Shadow
from rfgen_sionna.tracing.static.static_trace import StaticTrace
from rfgen_sionna.tracing.visibility.static_items import Divided, StaticItems


class ShadowedFacets:
    """Facets of a `static` trace, and after them those of cells, which are divided where a shadow falls, and kept."""

    def __init__(self, static: StaticTrace) -> None:
        self._static, facets = static, static.facets
        self._count = len(facets)
        self.corners = facets.corners - static.viewpoint
        """(facet, 3, 3) [m] relative to the viewpoint."""
        self.surface = np.asarray(facets.surface, np.int32)
        """(facet,)"""
        self.curved = np.zeros(self._count, np.bool_) if facets.curved is None else facets.curved
        """(facet,)"""
        self.paths = static.paths if static.cells is None else static.paths.select(np.arange(self._count))
        """One of each facet."""
        self.weight = static.weight
        """(facet,) field gain of the element pattern."""
        self._cell = np.zeros(0, np.intp)  # of each facet of a cell

    @property
    def items(self) -> StaticItems:
        """What occludes actors and is occluded by them."""
        cells = self._static.cells
        if cells is None:
            return StaticItems(self.corners)
        corners = np.concatenate([self.corners[: self._count], cells.cells.corners])
        return StaticItems(corners, len(cells), self._divide)

    def _divide(self, cells: NDArray[np.intp]) -> Divided:
        """Facets of `cells`."""
        static, fresh = self._static, np.setdiff1d(cells, self._cell)
        if static.cells is not None and len(fresh):
            facets, owner, paths = static.facets_of(static.cells.cells.take(fresh))
            self.corners = np.concatenate([self.corners, facets.corners - static.viewpoint])
            self.surface = np.concatenate([self.surface, np.asarray(facets.surface, np.int32)])
            self.curved = np.concatenate([self.curved, np.zeros(len(facets), np.bool_)])
            self.paths = RadarPaths.concatenate([self.paths, paths])
            weight = static.returns.band.pattern_gain(facets.directions(static.viewpoint))
            self.weight = np.concatenate([self.weight, weight])
            self._cell = np.concatenate([self._cell, fresh[owner]])
        own = np.flatnonzero(np.isin(self._cell, cells))
        number = self._count + own
        return number, self._cell[own], self.corners[number]

    def in_place(self, shadows: Sequence[Shadow]) -> tuple[RadarPaths, tuple[Shadow, ...]]:
        """Static paths with facets in place of the cells on which `shadows` fall, and these shadows on them."""
        static = self._static
        index = np.concatenate([np.zeros(0, np.intp), *(each.index for each in shadows)])
        cells = np.unique(self._cell[index[index >= self._count] - self._count])
        if static.cells is None or not len(cells):
            return static.paths, tuple(shadows)
        chosen = np.append(np.arange(self._count), self._count + np.flatnonzero(np.isin(self._cell, cells)))
        place = np.zeros(len(self.corners), np.intp)
        place[chosen] = np.arange(len(chosen))
        others = static.cells.paths(static.cells.without(cells))
        return RadarPaths.concatenate([self.paths.select(chosen), others]), tuple(each.at(place) for each in shadows)
