"""Facets at one time: positions, normals, visible fractions and gains."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray, IntArray
from rfgen_sionna.tracing.direct.return_bounds import bound_returns, significant
from rfgen_sionna.tracing.integral.patch_gains import patch_gains
from rfgen_sionna.tracing.surface.facet_mesh import FacetMesh
from rfgen_sionna.tracing.visibility.item_buffer import ItemBuffer, StaticItems, choose_views

Positions = Callable[[float], Sequence[FloatArray]]
"""Time [s] to the (vertex, 3) positions [m] of every moving surface."""
Shadows = tuple[NDArray[np.intp], FloatArray]
"""Occluded facets at rest, ascending, and the visible share of each."""


@dataclass(frozen=True)
class Sample:
    """All facets at one time."""

    points: FloatArray
    """(vertex, 3) [m] relative to the viewpoint, with those of pieces."""
    normals: FloatArray
    """(normal, 3)"""
    visible: FloatArray
    """(facet,) visible fraction; 0 beyond the range window."""
    shadows: Shadows
    """On facets at rest."""


@dataclass(frozen=True)
class Sampler:
    """Samples the facets of a `mesh` with vertices at `positions`, seen from the `viewpoint` (3,) [m] within `max_range`
    [m], with `resolution` pixels along an actor. The `static` items occlude and are occluded."""

    mesh: FacetMesh
    positions: Positions
    viewpoint: FloatArray
    max_range: float
    resolution: int
    static: StaticItems
    group: IntArray
    """(surface,) actor of each surface."""

    def at(self, times: Sequence[float]) -> list[Sample]:
        """Samples at `times` [s], in common views."""
        mesh = self.mesh
        points = [mesh.points(self.positions(t), self.viewpoint) for t in times]
        views = choose_views(points, mesh.meshes.vertex_range, self.resolution, self.group)
        buffer = ItemBuffer(mesh.meshes, views, self.static)
        found = []
        for each in points:
            visible = np.zeros(len(mesh))
            buffer.fractions(each, visible)
            self._limit_range(each, visible)
            shadows = buffer.shadows() if len(self.static) else (np.zeros(0, np.intp), np.zeros(0))
            found.append(Sample(each, mesh.normals(each), visible, shadows))
        return found

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
            each.visible[chosen], gain, wavenumber, bounds,
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


def integrate(
    mesh: FacetMesh,
    material: IntArray,
    sample: Sample,
    chosen: NDArray[np.intp],
    nodes: GainNodes,
    most_rise: float,
    gradient: FloatArray,
) -> tuple[ComplexArray, FloatArray]:
    """(node, chosen) gains with the shadow weight, and (chosen, 3) centroids [m] relative to the viewpoint; the arguments
    are those of :func:`rfgen_sionna.tracing.integral.patch_gains.patch_gains`."""
    gains = np.empty((len(nodes.table), len(chosen)), np.complex128)
    centroids = np.empty((len(chosen), 3))
    patch_gains(
        sample.points, mesh.faces, mesh.group, sample.normals, mesh.face_of, mesh.weights, chosen, sample.visible[chosen],
        material, mesh.single, nodes.table, nodes.fields, nodes.media, nodes.bistatic, most_rise, gradient, gains, centroids,
    )  # fmt: skip
    return gains, centroids


@njit(cache=True, nogil=True, error_model="numpy")
def pair_delays(centroids: Any, tx: Any, rx: Any, delays: Any) -> None:
    """Delays [s] into `delays` (tx, rx, facet, knot) by `centroids` (knot, facet, 3) [m] of elements `tx` (tx, 3) and `rx`
    (rx, 3) [m]."""
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
