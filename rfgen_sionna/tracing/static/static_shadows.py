"""Shadows of actors on the direct paths of the static scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import ComplexArray, FloatArray
from rfgen_sionna.records import RadarPaths
from rfgen_sionna.tracing.direct.expansion_choice import node_table
from rfgen_sionna.tracing.direct.time_error import leave_one_out
from rfgen_sionna.tracing.gains.band import BandTracer
from rfgen_sionna.tracing.integral.fresnel import media_table
from rfgen_sionna.tracing.integral.leg_fields import LegTables
from rfgen_sionna.tracing.integral.obliquity import Media
from rfgen_sionna.tracing.integral.patch_gains import patch_gains
from rfgen_sionna.tracing.static.actor_shadows import LEAVE_ONE_OUT_SCALE, Shadow, cast_shadow
from rfgen_sionna.tracing.static.static_trace import StaticTrace
from rfgen_sionna.tracing.visibility.item_buffer import Shadows

EXPANSION, FINE_EXPANSION, EXPANSION_RTOL = (3, 1), (4, 2), 0.02
"""Orders over the band and degrees over the array of the expansions of hidden pieces: static facets are several range
cells deep at most; the second below the tolerance given third."""


class StaticShadows:
    """Casts the shadows of actors on the direct paths of a `static` trace. Facets that a shadow boundary crosses lose
    the integral of their hidden pieces."""

    def __init__(self, static: StaticTrace, band: BandTracer, rtol: float) -> None:
        self._static, self._band = static, band
        facets = static.facets
        count = len(facets)
        self._points = np.ascontiguousarray((facets.corners - static.viewpoint).reshape(-1, 3))
        self._faces = np.arange(3 * count, dtype=np.int32).reshape(-1, 3)
        self._curved = np.zeros(count, np.bool_) if facets.curved is None else facets.curved
        order, degree = EXPANSION if rtol >= EXPANSION_RTOL else FINE_EXPANSION
        self._expansion = band.expansions.through(band.expansions.basis(order, degree, full=False))
        nodes = self._expansion.nodes
        media = media_table(Media.at(static.materials, nodes.frequency, band.half_band))
        self._nodes = np.ascontiguousarray(node_table(nodes)), np.stack(band.fields), media
        self._sagitta = float(np.clip(0.75 * np.sqrt(10.0 * rtol), 0.02, 0.75))

    @property
    def corners(self) -> FloatArray:
        """(facet, 3, 3) corners [m] of all facets relative to the viewpoint."""
        return self._points.reshape(-1, 3, 3)

    def __call__(self, times: FloatArray, shadows: Sequence[Shadows]) -> tuple[tuple[Shadow, ...], float]:
        """Shadows at each of the `times` [s], and their error between these, relative to the static reference level."""
        static = self._static
        every = np.unique(np.concatenate([np.zeros(0, np.intp), *(each.facet for each in shadows)]))
        if not len(every):
            return (), 0.0
        left = np.ones((len(every), len(times)))
        for k, each in enumerate(shadows):
            left[np.searchsorted(every, each.facet), k] = each.left
        cut = [self._hidden(each) for each in shadows]
        within = np.unique(np.concatenate([np.searchsorted(every, index) for index, _ in cut]))
        changing, steady = cast_shadow(static.paths.select(every), left, times, within)
        changing = replace(changing, paths=self._with_pieces(changing.paths, every[changing.index], cut))
        changing, steady = changing.at(every), steady.at(every)
        missed = 0.0
        if len(times) > 2 and static.level > 0 and changing.paths.num_paths:
            paths = changing.paths
            turns = np.exp(-2j * np.pi * np.mod(paths.frequency * paths.tau[0, 0, :, 0], 1.0))
            off = (paths.a[0, 0].T * turns * static.weight[changing.index]).sum(axis=1) @ leave_one_out(len(times)).T
            missed = LEAVE_ONE_OUT_SCALE * float(np.sqrt(np.mean(np.abs(off) ** 2))) / static.level
        return tuple(each for each in (changing, steady) if each.paths.num_paths), missed

    def _hidden(self, shadows: Shadows) -> tuple[NDArray[np.intp], ComplexArray]:
        """Facets with known hidden pieces, and the gains (order, tx, rx, facet) of these."""
        hidden = shadows.hidden
        chosen = hidden.facet[(hidden.triangles > 0) & ~self._curved[hidden.facet]]
        gains = np.zeros((len(self._nodes[0]), len(chosen)), np.complex128)
        if len(chosen):
            places = self.corners[chosen].mean(axis=1)
            gradient = self._band.pattern_gradients(places)
            flat, share = np.full(self._faces.shape, -1, np.int32), np.ones(len(chosen))
            patch_gains(
                self._points, self._faces, flat, np.zeros((1, 3)), np.arange(len(self._faces), dtype=np.int32),
                np.zeros((0, 3, 3)), chosen, share, hidden.of(chosen), hidden.pieces, hidden.triangles,
                np.asarray(self._static.facets.surface, np.int32), np.zeros(len(self._faces), np.bool_), self._nodes[0],
                self._nodes[1], self._nodes[2], not self._band.alike, self._sagitta, 0.0,
                np.zeros((0, 3)) if gradient is None else gradient, LegTables.direct(), gains, places,
            )  # fmt: skip
        return chosen, self._band.combined(self._expansion, gains)

    def _with_pieces(
        self, paths: RadarPaths, facet: NDArray[np.intp], cut: Sequence[tuple[NDArray[np.intp], ComplexArray]]
    ) -> RadarPaths:
        """Shadow `paths` of these static facets (facet,), with the gains of the hidden pieces at each time."""
        known = [paths.a, *(() if paths.dispersion is None else paths.dispersion)]
        gains = np.zeros((max(len(known), self._expansion.order), *paths.a.shape), np.complex128)
        gains[: len(known)] = known
        for k, (index, hidden) in enumerate(cut):
            gains[..., np.searchsorted(facet, index), k] = 0.0
            gains[: len(hidden), ..., np.searchsorted(facet, index), k] = -hidden
        several = len(gains) > 1
        return replace(
            paths, a=gains[0], dispersion=gains[1:] if several else None,
            half_band=self._band.half_band if several else 0.0,
        )  # fmt: skip
