"""Facets at one time: positions, normals, visible fractions and gains."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray, IntArray
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.tracing.direct.facet_bounds import bound_returns, significant
from rfgen_sionna.tracing.integral.leg_fields import LegTables
from rfgen_sionna.tracing.integral.patch_gains import patch_gains
from rfgen_sionna.tracing.legs.leg import Leg
from rfgen_sionna.tracing.legs.leg_visibility import Crossings, see_along
from rfgen_sionna.tracing.legs.slab_scene import SlabScene
from rfgen_sionna.tracing.surface.facet_mesh import FacetMesh
from rfgen_sionna.tracing.visibility.item_buffer import (
    NO_CUTS,
    NO_SHADOWS,
    Cuts,
    ItemBuffer,
    Resolution,
    Shadows,
    choose_views,
)

Positions = Callable[[float], Sequence[FloatArray]]
"""Time [s] to the (vertex, 3) positions [m] of every moving surface."""


class SeenFacets(NamedTuple):
    """Facets as they are seen from one place of the array."""

    visible: FloatArray
    """(facet,) visible fraction; 0 beyond the range window."""
    cuts: Cuts
    """Visible pieces of facets that a shadow boundary crosses."""


@dataclass(frozen=True)
class Sample:
    """All facets at one time."""

    points: FloatArray
    """(vertex, 3) [m] relative to the viewpoint, with those of pieces."""
    normals: FloatArray
    """(normal, 3)"""
    seen: tuple[SeenFacets, ...]
    """From each place of the array, or from the phase centre alone."""
    shadows: Shadows
    """On facets at rest, from the place next to the phase centre."""
    crossed: Crossings | None = None
    """Slabs on the direct leg to each facet; None without transmission."""

    @property
    def visible(self) -> FloatArray:
        """(facet,) largest visible fraction from any place."""
        return self.seen[0].visible if len(self.seen) == 1 else np.max([each.visible for each in self.seen], axis=0)

    def seen_from(self, one: int, other: int, chosen: NDArray[np.intp]) -> tuple[FloatArray, NDArray[np.int32], Cuts]:
        """(chosen,) fraction of the `chosen` facets that is visible from two places, (chosen,) cut of each, -1 without
        one, and the cuts. One shadow boundary is assumed on a facet: the place that shows less of it counts."""
        share, cuts = self.seen[one]
        found = share[chosen]
        if one == other:
            return found, cuts.of(chosen), cuts
        share, more = self.seen[other]
        less = share[chosen] < found
        cut = np.where(less, more.of(chosen), np.int32(-1))
        cut[cut >= 0] += np.int32(len(cuts.facet))
        joined = Cuts(
            np.concatenate([cuts.facet, more.facet]), np.concatenate([cuts.pieces, more.pieces]),
            np.concatenate([cuts.triangles, more.triangles]),
        )  # fmt: skip
        return np.where(less, share[chosen], found), np.where(less, cut, cuts.of(chosen)), joined


@dataclass(frozen=True)
class Sampler:
    """Samples the facets of a `mesh` with vertices at `positions`, seen from the `viewpoint` (3,) [m] within
    `max_range` [m], in views of this `resolution`. Facets at rest, with corners `static` (facet, 3, 3) [m]
    relative to the viewpoint, occlude and are occluded."""

    mesh: FacetMesh
    positions: Positions
    viewpoint: FloatArray
    max_range: float
    resolution: Resolution
    static: FloatArray
    slabs: SlabScene | None = None
    """Slabs that transmit; None means that all surfaces occlude."""

    def at(self, times: Sequence[float], places: FloatArray) -> list[Sample]:
        """Samples at `times` [s] from `places` (place, 3) [m] of the array relative to the viewpoint, in common
        views. Slabs are looked for from the phase centre alone."""
        mesh = self.mesh
        points = [mesh.points(self.positions(t), self.viewpoint) for t in times]
        shares, crossed, shown_cuts = None, list[Crossings | None]([None] * len(times)), list[Cuts]()
        if self.slabs is not None:
            given = mesh.meshes, points, self.slabs.occluders, self.resolution, mesh.corner_normals
            shares, found, shown_cuts = see_along(Leg(()), *given)
            crossed = [*found]
        central = int(np.argmin(lengths(places)))
        seen, shadows = list[list[SeenFacets]](), [NO_SHADOWS for _ in times]
        for number, place in enumerate(places):
            moved = points if not place.any() else [each - place for each in points]
            views = choose_views(moved, mesh.meshes, self.resolution, self.max_range)
            buffer = ItemBuffer(mesh.meshes, views, self.static - place)
            seen.append([])
            for k, (each, own) in enumerate(zip(moved, points, strict=True)):
                visible, cuts = np.zeros(len(mesh)), NO_CUTS
                if shares is None or len(self.static):
                    cuts = buffer.fractions(each, visible)
                if shares is not None:
                    visible, cuts = shares[k].copy(), shown_cuts[k]
                self._limit_range(own, visible)
                seen[-1].append(SeenFacets(visible, cuts))
                if len(self.static) and number == central:
                    shadows[k] = buffer.shadows()
        from_places = zip(*seen, strict=True)
        return [
            Sample(each, mesh.normals(each), own, shadow, slabs)
            for each, own, shadow, slabs in zip(points, from_places, shadows, crossed, strict=True)
        ]

    def _limit_range(self, points: FloatArray, visible: FloatArray) -> None:
        """Set `visible` (facet,) to 0 beyond the range window."""
        if np.isfinite(self.max_range) and np.einsum("pi,pi->p", points, points).max(initial=0.0) >= self.max_range**2:
            centroids = self.mesh.centroids(points, np.arange(len(self.mesh)))
            visible[np.einsum("fi,fi->f", centroids, centroids) >= self.max_range**2] = 0.0


def choose_facets(
    mesh: FacetMesh,
    samples: Sequence[Sample],
    pattern_gain: Callable[[FloatArray], FloatArray],
    wavenumber: float,
    group: IntArray,
    omitted: float,
) -> NDArray[np.intp]:
    """Indices, ascending, of the facets that matter at any of the `samples`. `group` (surface,) is the tolerance group,
    `omitted` the share of each group's energy that may be left out, 0 keeps all visible facets."""
    most = samples[0].visible
    for each in samples[1:]:
        most = np.maximum(most, each.visible)
    chosen = np.flatnonzero(most)
    if omitted <= 0 or not len(chosen):
        return chosen
    middle = samples[len(samples) // 2].points
    centroids = mesh.centroids(middle, chosen)
    gain = pattern_gain(centroids / np.maximum(np.linalg.norm(centroids, axis=1, keepdims=True), 1e-12))
    bounds = np.zeros(len(chosen))
    for each in {0: samples[0], len(samples) // 2: samples[len(samples) // 2], len(samples) - 1: samples[-1]}.values():
        bound_returns(
            each.points, mesh.meshes.corners, mesh.faces, mesh.group, each.normals, mesh.face_of, chosen,
            each.visible[chosen], gain, wavenumber, np.zeros(3), np.zeros(3), bounds,
        )  # fmt: skip
    return chosen[significant(bounds, group[mesh.facet_surface[chosen]], len(group), omitted)]


@dataclass(frozen=True)
class GainNodes:
    """Element pairs and frequencies at which facets are integrated."""

    table: FloatArray
    """(node, 7) Tx and Rx position [m] relative to the viewpoint, wavenumber [rad/m]."""
    media: FloatArray
    """(node, material, 7) :func:`rfgen_sionna.tracing.integral.fresnel.media_table`."""
    fields: FloatArray
    """(2, 3) electric field of Tx and Rx."""
    bistatic: bool
    places: FloatArray
    """(place, 3) places [m] of the array relative to the viewpoint from which facets are looked at."""
    place: IntArray
    """(node, 2) places from which each node's facets have to be visible, those of Tx and Rx."""

    @staticmethod
    def of_one_place(table: FloatArray, media: FloatArray, fields: FloatArray, bistatic: bool) -> GainNodes:
        """Nodes that share the view from the phase centre."""
        place: IntArray = np.zeros((len(table), 2), np.int32)
        return GainNodes(np.ascontiguousarray(table), media, fields, bistatic, np.zeros((1, 3)), place)


def integrate(
    mesh: FacetMesh,
    material: IntArray,
    sample: Sample,
    chosen: NDArray[np.intp],
    nodes: GainNodes,
    sagitta: float,
    turn: float,
    gradient: FloatArray,
    visible: FloatArray | None = None,
    legs: LegTables | None = None,
) -> tuple[ComplexArray, FloatArray]:
    """(node, chosen) gains with the shadow weight `visible` (chosen,), that of the sample by default, and (chosen, 3)
    centroids [m] relative to the viewpoint; the arguments are those of
    :func:`rfgen_sionna.tracing.integral.patch_gains.patch_gains`."""
    gains = np.empty((len(nodes.table), len(chosen)), np.complex128)
    centroids = np.empty((len(chosen), 3))
    for one, other in np.unique(nodes.place, axis=0).tolist():
        own = np.flatnonzero((nodes.place == (one, other)).all(axis=1))
        share, cut_of, cuts = sample.seen_from(one, other, chosen)
        if visible is not None:
            share, cut_of, cuts = visible, NO_CUTS.of(chosen), NO_CUTS
        found = gains if len(own) == len(gains) else np.empty((len(own), len(chosen)), np.complex128)
        patch_gains(
            sample.points, mesh.faces, mesh.group, sample.normals, mesh.face_of, mesh.weights, chosen, share,
            cut_of, cuts.pieces, cuts.triangles, material, mesh.single, nodes.table[own], nodes.fields,
            nodes.media[own], nodes.bistatic, sagitta, turn, gradient, (legs or LegTables.direct()).at(own), found,
            centroids,
        )  # fmt: skip
        if found is not gains:
            gains[own] = found
    return gains, centroids


@njit(cache=True, nogil=True, error_model="numpy")
def pair_delays(centroids: Any, tx: Any, rx: Any, delays: Any) -> None:
    """Delays [s] into `delays` (tx, rx, facet, knot) by `centroids` (knot, facet, 3) [m] of elements `tx` (tx, 3) and
    `rx` (rx, 3) [m]."""
    knots, count = centroids.shape[0], centroids.shape[1]
    senders, receivers = tx.shape[0], rx.shape[0]
    out, back = np.empty(senders), np.empty(receivers)
    for f in range(count):
        for k in range(knots):
            x, y, z = centroids[k, f, 0], centroids[k, f, 1], centroids[k, f, 2]
            for i in range(senders):
                out[i] = np.sqrt((x - tx[i, 0]) ** 2 + (y - tx[i, 1]) ** 2 + (z - tx[i, 2]) ** 2) / SPEED_OF_LIGHT
            for j in range(receivers):
                back[j] = np.sqrt((x - rx[j, 0]) ** 2 + (y - rx[j, 1]) ** 2 + (z - rx[j, 2]) ** 2) / SPEED_OF_LIGHT
            for i in range(senders):
                for j in range(receivers):
                    delays[i, j, f, k] = out[i] + back[j]
