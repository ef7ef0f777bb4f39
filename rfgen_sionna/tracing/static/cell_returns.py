"""Returns of cells of large flat faces: paths by the edges of their outline."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray, IntArray
from rfgen_sionna.records import PathKind, RadarPaths
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.tracing.direct.expansion_choice import choose_expansion, node_table, pair_waves
from rfgen_sionna.tracing.gains.band import MONOSTATIC, BandTracer
from rfgen_sionna.tracing.gains.expansion import PROBES, Expansion
from rfgen_sionna.tracing.integral.fresnel import media_table
from rfgen_sionna.tracing.integral.obliquity import Media
from rfgen_sionna.tracing.integral.polygon import edge_gains
from rfgen_sionna.tracing.static.cell_edges import QUADRATIC_PHASE, Segments, divide, outlines, towards
from rfgen_sionna.tracing.static.flat_cells import FlatCells, find_cells, is_divided
from rfgen_sionna.tracing.surface.resolution import BAND_SWING
from rfgen_sionna.tracing.surface.surfaces import Surfaces

SAFETY = 2.0
"""Factor on the error at one pair and a few frequencies, for all others."""
EXPANSION_SHARE = 0.3
"""Share of the tolerance for an expansion over array and band."""


def divide_faces(surfaces: Surfaces, band: BandTracer, rtol: float, max_range: float) -> FlatCells:
    """Cells of the flat surfaces at rest within `max_range` [m], and the pieces around them; the faces of others are
    left out."""
    corners = [points[each.faces] for points, each in zip(surfaces.static_vertices, surfaces.static, strict=True)]
    faces = np.concatenate([np.zeros((0, 3, 3)), *corners]) - band.viewpoint
    flat = [each.first_facet + np.arange(len(each.faces)) for each in surfaces.static if is_divided(each)]
    chosen = np.concatenate([np.zeros(0, np.intp), *flat]).astype(np.intp)
    nearest = band.baseline / np.sqrt(MONOSTATIC * rtol)
    return find_cells(faces, chosen, _wavenumber(band), _swing(band), max_range, nearest, band.reach)


def _wavenumber(band: BandTracer) -> float:
    """At the highest frequency [rad/m]."""
    return 2 * np.pi * band.highest / SPEED_OF_LIGHT


def _swing(band: BandTracer) -> float:
    """Parts of a depth for the band, as of facets [1/m]."""
    return 2 * np.pi * band.half_band / SPEED_OF_LIGHT / BAND_SWING


@dataclass(frozen=True)
class EdgeReturns:
    """Returns of the outline of some cells."""

    segments: Segments
    gains: ComplexArray
    """(order, tx, rx, segment) polynomials over the band."""


@dataclass(frozen=True)
class CellReturns:
    """Wholly visible cells of the static surfaces, and their returns."""

    surfaces: Surfaces
    band: BandTracer
    rtol: float
    cells: FlatCells
    """Wholly visible ones alone."""
    surface: IntArray
    """(cell,) index of the surface."""
    expansion: Expansion
    edges: Segments

    @staticmethod
    def of(surfaces: Surfaces, band: BandTracer, rtol: float, divided: FlatCells, level: float) -> CellReturns | None:
        """Returns of the visible cells among those `divided`; errors are relative to these and the `level` of all
        others. None without cells."""
        index = np.flatnonzero(divided.visible)
        if not len(index):
            return None
        cells = divided.take(index)
        first = np.array([each.first_facet for each in surfaces.static])
        surface = (np.searchsorted(first, cells.face, side="right") - 1).astype(np.int32)
        first_order = band.expansions.through([(0, 0, 0, 0, 0)])
        found = CellReturns(surfaces, band, rtol, cells, surface, first_order, outlines(cells.corners, surface))
        return found._with_expansion(level)

    def __len__(self) -> int:
        return len(self.surface)

    @cached_property
    def returns(self) -> EdgeReturns:
        """Those of all cells."""
        return self._integrated(self.edges)

    def without(self, some: IntArray) -> EdgeReturns:
        """Returns of all cells but `some`."""
        left = np.setdiff1d(np.arange(len(self)), some)
        found = outlines(self.cells.corners[left], self.surface[left])
        return self._integrated(found._replace(cell=left[found.cell]))

    def paths(self, returns: EdgeReturns) -> RadarPaths:
        """One path per segment."""
        band, middle, cell = self.band, returns.segments.middle, returns.segments.cell
        count, surface, gains = len(cell), self.surface[cell], returns.gains
        static = self.surfaces.static
        first = np.array([each.first_facet for each in static])
        face = (self.cells.face[cell] - first[surface]).astype(np.int32)
        parts = np.concatenate([np.zeros(0, np.int32), *(each.parts for each in static)])
        direction = (middle / np.maximum(lengths(middle), 1e-12)[:, None])[:, None]
        tau = band.delays(middle + band.viewpoint)[..., None]
        several = len(gains) > 1
        return RadarPaths(
            a=gains[0][..., None],
            tau=tau,
            tau_rate=np.zeros_like(tau),
            times=np.array([0.0]),
            frequency=band.centre,
            direction=direction,
            arrival=direction,
            object_id=np.array([each.object_id for each in static], np.int32)[surface],
            part_id=parts[self.cells.face[cell]].astype(np.int32),
            kind=np.full(count, PathKind.FACET, np.uint8),
            bounces=np.ones(count, np.uint8),
            object_names=self.surfaces.object_names,
            part_names=self.surfaces.part_names,
            facet=face,
            dispersion=gains[1:, ..., None] if several else None,
            half_band=band.half_band if several else 0.0,
        )

    def error(self) -> tuple[float, float]:
        """Estimated error of the first pair's return by segments of half the length, and the level of the returns, the
        larger of their coherent and incoherent sums."""
        segments, pairs = self.returns.segments, np.zeros(len(PROBES), np.int32)
        powers = np.vander(PROBES, len(self.returns.gains), increasing=True)
        coarse = (powers @ self.returns.gains[:, 0, 0]) * self.waves(segments, PROBES, pairs)
        fine, table = segments.halved(), node_table(self.band.expansions.nodes(PROBES, pairs))
        exact = self.gains(fine, table) * self.waves(fine, PROBES, pairs)
        whole = coarse.sum(axis=1)
        return SAFETY * _rms(whole - exact.sum(axis=1)), max(_rms(whole), _incoherent(coarse))

    def gains(self, segments: Segments, table: FloatArray) -> ComplexArray:
        """(node, segment) gains at the nodes of a `table` (node, 7)."""
        band = self.band
        materials = [each.material for each in self.surfaces.static]
        media = media_table(Media.at(materials, SPEED_OF_LIGHT / (2 * np.pi) * table[:, 6], band.half_band))
        gradient = band.pattern_gradients(segments.middle) if len(segments.cell) else None
        found = np.zeros((len(table), len(segments.cell)), np.complex128)
        edge_gains(
            segments.start, segments.stop, self._normal[segments.cell], self.surface[segments.cell],
            np.ascontiguousarray(table), np.stack(band.fields), media, not band.alike,
            np.zeros((0, 3)) if gradient is None else gradient, found,
        )  # fmt: skip
        return found

    def waves(self, segments: Segments, u: FloatArray, pairs: IntArray) -> ComplexArray:
        """(probe, segment) propagation phasors times pattern gain, at positions `u` of the band of `pairs`."""
        middle = segments.middle
        weight = self.band.pattern_gain(middle / np.maximum(lengths(middle), 1e-12)[:, None])
        return pair_waves(self.band, middle, u, pairs) * weight

    @cached_property
    def _normal(self) -> FloatArray:
        return towards(self.cells.corners)

    def _divided(self, edges: Segments) -> Segments:
        phase = QUADRATIC_PHASE * min((10.0 * self.rtol) ** (1.0 / 3.0), 1.0)
        return divide(edges, self._normal, _wavenumber(self.band), _swing(self.band), phase)

    def _integrated(self, edges: Segments) -> EdgeReturns:
        segments = self._divided(edges)
        values = self.gains(segments, node_table(self.expansion.nodes))
        return EdgeReturns(segments, self.band.combined(self.expansion, values))

    def _with_expansion(self, level: float) -> CellReturns:
        """The same with the smallest expansion whose coherent sums are right to a share of the tolerance."""
        expansions, segments = self.band.expansions, self._divided(self.edges)
        pairs = np.zeros(len(PROBES), np.int32)
        found = self.gains(segments, node_table(expansions.nodes(PROBES, pairs)))
        least = np.hypot(_incoherent(found * self.waves(segments, PROBES, pairs)), level)
        check = _Check(self, segments, np.zeros(len(segments.cell), np.int32), np.array([least]))
        return replace(self, expansion=choose_expansion(expansions, [check], self.rtol, EXPANSION_SHARE * self.rtol))


@dataclass(frozen=True)
class _Check:
    """Segments of all edges, to test expansions."""

    cells: CellReturns
    segments: Segments
    group: IntArray
    least: FloatArray

    def values(self, table: FloatArray) -> ComplexArray:
        """(node, segment) gains at the nodes of a `table` (node, 7)."""
        return self.cells.gains(self.segments, table)

    def waves(self, u: FloatArray, pairs: IntArray) -> ComplexArray:
        """(probe, segment) propagation phasors times pattern gain."""
        return self.cells.waves(self.segments, u, pairs)


def _incoherent(waves: ComplexArray) -> float:
    """Incoherent sum over segments of `waves` (probe, segment)."""
    return float(np.sqrt((np.abs(waves) ** 2).mean(axis=0).sum()))


def _rms(values: ComplexArray) -> float:
    return float(np.sqrt((np.abs(values) ** 2).mean()))
