"""Returns of cells of large flat faces: paths by the edges of their outline, and facets where actors occlude them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray, IntArray
from rfgen_sionna.records import PathKind, RadarPaths
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.tracing.gains.band import MONOSTATIC, BandTracer
from rfgen_sionna.tracing.gains.expansion import PROBES, Expansion
from rfgen_sionna.tracing.integral.fresnel import media_table
from rfgen_sionna.tracing.integral.obliquity import Media
from rfgen_sionna.tracing.integral.polygon import edge_gains
from rfgen_sionna.tracing.static.cell_edges import QUADRATIC_PHASE, Segments, divide, outlines, towards
from rfgen_sionna.tracing.static.flat_cells import FlatCells, find_cells, is_divided
from rfgen_sionna.tracing.surface.facets import Facets
from rfgen_sionna.tracing.surface.resolution import BAND_SWING
from rfgen_sionna.tracing.surface.surfaces import Surfaces

SAFETY = 2.0
"""Factor on the error at one pair and a few frequencies, for all others."""
EXPANSION_SHARE = 0.3
"""Share of the tolerance for an expansion over array and band."""
MAX_ORDER, MAX_DEGREE = 8, 6
"""Bounds of that expansion: interpolation at more nodes is ill-conditioned."""


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
        found = CellReturns(
            surfaces, band, rtol, cells, surface, band.expansions.through([(0, 0, 0, 0, 0)]),
            outlines(cells.corners, surface),
        )  # fmt: skip
        segments = found._divided(found.edges)
        return CellReturns(surfaces, band, rtol, cells, surface, found._expansion(segments, level), found.edges)

    def __len__(self) -> int:
        return len(self.surface)

    @cached_property
    def returns(self) -> EdgeReturns:
        """Those of all cells."""
        return self._integrated(self.edges)

    def without(self, some: NDArray[np.intp]) -> EdgeReturns:
        """Returns of all cells but `some`."""
        left = np.setdiff1d(np.arange(len(self)), some)
        found = outlines(self.cells.corners[left], self.surface[left])
        return self._integrated(found._replace(cell=left[found.cell]))

    def paths(self, returns: EdgeReturns, names: tuple[tuple[str, ...], tuple[str, ...]]) -> RadarPaths:
        """One path per segment; `names` are those of objects and parts."""
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
            object_names=names[0],
            part_names=names[1],
            facet=face,
            dispersion=gains[1:, ..., None] if several else None,
            half_band=band.half_band if several else 0.0,
        )

    def error(self) -> tuple[float, float]:
        """Estimated error of the first pair's return by segments of half the length, and the level of the returns, the
        larger of their coherent and incoherent sums."""
        segments, probes = self.returns.segments, PROBES
        pairs = np.zeros(len(probes), np.int32)
        gains = np.einsum(
            "po,os->ps", np.vander(probes, len(self.returns.gains), increasing=True), self.returns.gains[:, 0, 0]
        )
        coarse, fine = gains * self._waves(segments, probes, pairs), segments.halved()
        exact = self._exact(fine, probes, pairs) * self._waves(fine, probes, pairs)
        whole = coarse.sum(axis=1)
        off = SAFETY * _rms(whole - exact.sum(axis=1))
        return off, max(_rms(whole), float(np.sqrt((np.abs(coarse) ** 2).mean(axis=0).sum())))

    def _divided(self, edges: Segments) -> Segments:
        phase = QUADRATIC_PHASE * min((10.0 * self.rtol) ** (1.0 / 3.0), 1.0)
        return divide(edges, self._normal, _wavenumber(self.band), _swing(self.band), phase)

    @cached_property
    def _normal(self) -> FloatArray:
        return towards(self.cells.corners)

    def _integrated(self, edges: Segments) -> EdgeReturns:
        segments = self._divided(edges)
        return EdgeReturns(segments, self.band.combined(self.expansion, self._values(segments, self.expansion)))

    def _values(self, segments: Segments, expansion: Expansion) -> ComplexArray:
        nodes = expansion.nodes
        return self._gains(segments, nodes.tx, nodes.rx, nodes.frequency)

    def _exact(self, segments: Segments, u: FloatArray, pairs: IntArray) -> ComplexArray:
        nodes = self.band.expansions.nodes(u, pairs)
        return self._gains(segments, nodes.tx, nodes.rx, nodes.frequency)

    def _gains(self, segments: Segments, tx: FloatArray, rx: FloatArray, frequency: FloatArray) -> ComplexArray:
        """(node, segment) gains."""
        band = self.band
        materials = [each.material for each in self.surfaces.static]
        media = media_table(Media.at(materials, frequency, band.half_band))
        nodes = np.ascontiguousarray(np.hstack([tx, rx, 2 * np.pi / SPEED_OF_LIGHT * frequency[:, None]]))
        gradient = band.pattern_gradients(segments.middle) if len(segments.cell) else None
        found = np.zeros((len(nodes), len(segments.cell)), np.complex128)
        edge_gains(
            segments.start, segments.stop, self._normal[segments.cell], self.surface[segments.cell], nodes,
            np.stack(band.fields), media, not band.alike, np.zeros((0, 3)) if gradient is None else gradient, found,
        )  # fmt: skip
        return found

    def _waves(self, segments: Segments, u: FloatArray, pairs: IntArray) -> ComplexArray:
        """(probe, segment) propagation phasors with the pattern gain."""
        band, middle = self.band, segments.middle
        tx, rx = (each - band.viewpoint for each in band.elements)
        one, other = np.divmod(pairs, len(rx))
        path = lengths(middle - tx[one][:, None]) + lengths(middle - rx[other][:, None])
        cycles = band.frequency(u)[:, None] * path / SPEED_OF_LIGHT
        weight = band.pattern_gain(middle / np.maximum(lengths(middle), 1e-12)[:, None])
        return np.asarray(weight * np.exp(-2j * np.pi * (cycles - np.rint(cycles))))

    def _expansion(self, segments: Segments, level: float) -> Expansion:
        """Smallest expansion whose coherent sums are right to a share of the tolerance."""
        expansions = self.band.expansions
        outer = expansions.representative()
        known: dict[tuple[bytes, bytes], tuple[ComplexArray, ComplexArray, float]] = {}

        def fits(u: FloatArray, pairs: IntArray, tried: Expansion) -> bool:
            key = u.tobytes(), pairs.tobytes()
            if key not in known:
                exact, waves = self._exact(segments, u, pairs), self._waves(segments, u, pairs)
                energy = float((np.abs(exact * waves) ** 2).mean(axis=0).sum())
                known[key] = exact, waves, max(_rms((exact * waves).sum(axis=1)), np.sqrt(energy + level**2))
            exact, waves, scale = known[key]
            weights = tried.weights.reshape(tried.order, -1, tried.weights.shape[-1])[:, pairs]
            weights = np.einsum("pk,kpn->pn", np.vander(u, tried.order, increasing=True), weights)
            off = (weights @ self._values(segments, tried) - exact) * waves
            return _rms(off.sum(axis=1)) <= EXPANSION_SHARE * self.rtol * scale

        order, degree, first = 1, 0, np.zeros(len(PROBES), np.int32)
        while order < MAX_ORDER and not fits(PROBES, first, expansions.over_band(order)):
            order += 1
        middle, ends = np.zeros(len(outer)), np.repeat([-1.0, 1.0], len(outer))
        if len(outer) > 1:
            while degree < MAX_DEGREE and not fits(
                middle, outer, expansions.through(expansions.basis(1, degree, full=True))
            ):
                degree += 1
        found = expansions.through(expansions.basis(order, degree, full=False))
        if degree and order > 1 and not fits(ends, np.tile(outer, 2), found):
            found = expansions.through(expansions.basis(order, degree, full=True))
        return found


@dataclass
class DividedCells:
    """Facets of those cells that actors have occluded, found when needed and kept."""

    divide: Callable[[NDArray[np.intp]], tuple[Facets, NDArray[np.intp], RadarPaths]]
    """Cells to their facets, the (facet,) index of the cell among these, and paths."""
    viewpoint: FloatArray
    pattern_gain: Callable[[FloatArray], FloatArray]
    _number: dict[int, int] = field(default_factory=dict)
    """Cell to its place among the divided ones."""
    _lists: list[NDArray[np.intp]] = field(default_factory=list)
    """Facets of each divided cell."""
    _places: list[FloatArray] = field(default_factory=list)
    _paths: list[RadarPaths] = field(default_factory=list)
    _weights: list[FloatArray] = field(default_factory=list)
    _strengths: list[FloatArray] = field(default_factory=list)
    _count: int = 0

    def facets(self, cells: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.intp], FloatArray]:
        """Numbers of the facets of `cells`, the cell of each, and (facet, 3, 3) corners [m] from the viewpoint."""
        fresh = np.array([each for each in cells.tolist() if each not in self._number], np.intp)
        if len(fresh):
            facets, owner, paths = self.divide(fresh)
            for k, cell in enumerate(fresh.tolist()):
                self._number[cell] = len(self._lists)
                self._lists.append(self._count + np.flatnonzero(owner == k))
            self._count += len(facets)
            self._places.append(facets.corners - self.viewpoint)
            self._paths.append(paths)
            self._weights.append(self.pattern_gain(facets.directions(self.viewpoint)))
            self._strengths.append(np.abs(paths.a[..., 0]).max(axis=(0, 1)) * self._weights[-1])
        own = [self._lists[self._number[each]] for each in cells.tolist()]
        index = np.concatenate([np.zeros(0, np.intp), *own])
        if len(self._places) > 1:
            self._places = [np.concatenate(self._places)]
        owner = np.repeat(cells, [len(each) for each in own])
        return index, owner, self._places[0][index] if len(index) else np.zeros((0, 3, 3))

    def around(self, index: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Cells of facets by their numbers, and all facets of these cells, both ascending."""
        own = [
            (cell, self._lists[k])
            for cell, k in self._number.items()
            if len(index) and np.isin(self._lists[k], index).any()
        ]
        facets = np.concatenate([np.zeros(0, np.intp), *(each for _, each in own)])
        return np.array(sorted(cell for cell, _ in own), np.intp), np.sort(facets)

    def paths(self, index: NDArray[np.intp]) -> tuple[RadarPaths, FloatArray]:
        """Paths of facets by their numbers, and their (facet,) pattern gains."""
        self._join()
        return self._paths[0].select(index), self._weights[0][index]

    def strength(self, index: NDArray[np.intp]) -> FloatArray:
        """(facet,) largest magnitude of the gains of any pair, with the element pattern."""
        self._join()
        return self._strengths[0][index]

    def _join(self) -> None:
        if len(self._paths) > 1:
            self._paths, self._weights = [RadarPaths.concatenate(self._paths)], [np.concatenate(self._weights)]
            self._strengths = [np.concatenate(self._strengths)]


def _rms(values: ComplexArray) -> float:
    return float(np.sqrt((np.abs(values) ** 2).mean()))
