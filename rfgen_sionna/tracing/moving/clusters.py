"""Clusters: small neighbouring facets that share one path.

A mesh has facets of a few millimetres next to facets ten times as wide. Each is integrated by itself. The sum over a
patch no wider than the larger facets is as smooth over band, array and time as the return of one of these: with the
phase of one facet, the *cluster head*, the returns add up to one path.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray, IntArray
from rfgen_sionna.scene.mesh import face_normals, lengths, triangle_centroids
from rfgen_sionna.tracing.gains.band import BandTracer
from rfgen_sionna.tracing.moving.knots import max_phase_step
from rfgen_sionna.tracing.moving.visible_facets import VisibleFacets
from rfgen_sionna.tracing.surface.surfaces import Surface
from rfgen_sionna.tracing.surface.tessellate import Tessellation

CLUSTER_SHARE = 1.9
"""Cluster width over the area-weighted mean of the facets' longest edges, per fourth root of the tolerance, as the
error of cubics grows with the fourth power."""
BAND_PHASE = 3.2
"""Largest phase [rad] between the near and the far end of a cluster at an end of the band, per fourth root of the
tolerance."""
ARRAY_PHASE = 1.0
"""Largest phase [rad] between the ends of a cluster at an outermost element, per fourth root of the tolerance."""

CLUSTERED_PER_RTOL = 0.3
"""Allowed error of a facet's return on another facet's path between sample times, per unit of the tolerance; below 1,
as the errors of a spinning body add up."""


class FacetClusters:
    """Cluster heads of the facets of moving surfaces, for a phase centre `viewpoint` (3,) [m] and a relative tolerance
    `rtol`."""

    def __init__(self, band: BandTracer, viewpoint: FloatArray, rtol: float) -> None:
        self._band, self._viewpoint, self._rtol = band, viewpoint, rtol
        self.cluster_head: NDArray[np.intp] = np.zeros(0, np.intp)
        """(facet,) head of each facet's cluster: the facet itself on rough surfaces, as each facet has a phase of its
        own."""

    def form(
        self,
        surfaces: Sequence[Surface],
        pieces: Sequence[Tessellation],
        vertices: Sequence[FloatArray],
        distance: FloatArray,
    ) -> None:
        """Form clusters of all facets, `pieces` of each of the `surfaces` with `vertices` (vertex, 3) [m] at least at a
        `distance` (surface,) [m]."""
        band, found, first = self._band, [np.zeros(0, np.intp)], 0
        for piece, points, surface, nearest in zip(pieces, vertices, surfaces, distance.tolist(), strict=True):
            own = np.arange(len(piece.face))
            if surface.material.scattering_coefficient == 0:
                whole = np.setdiff1d(own, piece.pieces, assume_unique=True)
                most = max_cluster_width(band.highest, band.half_band, band.aperture, nearest, self._rtol)
                cluster_head = cluster_heads(points, surface.faces, surface.parts, piece.face[whole], most, self._rtol)
                facet = np.zeros(len(surface.faces), np.intp)
                facet[piece.face[whole]] = whole
                own[whole] = facet[cluster_head[piece.face[whole]]]
            found.append(first + own)
            first += len(own)
        self.cluster_head = np.concatenate(found)

    def heads_over_interval(self, centroids: Sequence[FloatArray], selected: NDArray[np.intp]) -> NDArray[np.intp]:
        """(selected,) cluster head of each of the `selected` facets over an interval with `centroids` (facet, 3) [m] at
        the sample times. Facets whose phase against the head changes too fast for a spline head their own path, as do
        all facets at a single sample time, where each path has its own delay rate."""
        if len(centroids) == 1:
            return selected
        cluster_head = self.cluster_head[selected]
        ranges = [lengths(each - self._viewpoint) for each in centroids]
        swing = np.zeros(len(selected))
        for before, after in pairwise([each[selected] - each[cluster_head] for each in ranges]):
            np.maximum(swing, np.abs(after - before), out=swing)
        most = max_phase_step(CLUSTERED_PER_RTOL * self._rtol, len(centroids) - 1) / (
            4 * np.pi * self._band.highest / SPEED_OF_LIGHT
        )
        return np.where(swing <= most, cluster_head, selected)

    def relative_pattern_gain(
        self, visible: VisibleFacets, selected: NDArray[np.intp], cluster_head: NDArray[np.intp]
    ) -> FloatArray:
        """(selected,) antenna field gain towards each of the `selected` facets over that towards its `cluster_head`
        (selected,)."""
        found, other = np.ones(len(selected)), np.flatnonzero(cluster_head != selected)
        heads = cluster_head[other]
        own, there = visible.weight[selected[other]], visible.weight[heads]
        unknown = np.flatnonzero(there == 0)  # heads that face away
        there[unknown] = self._band.pattern_gain(visible.facets.directions(self._viewpoint, heads[unknown]))
        found[other] = np.where(there > 0, own / np.where(there > 0, there, 1.0), 1.0)
        return found


def max_cluster_width(frequency: float, half_band: float, aperture: float, distance: float, rtol: float) -> float:
    """Largest width [m] of a cluster, for the highest `frequency` and half the sampled band, `half_band` [Hz], the
    largest sum of Tx and Rx displacement from the phase centre, `aperture` [m], and the `distance` of the nearest
    facets [m]."""
    by_band = BAND_PHASE * SPEED_OF_LIGHT / (4 * np.pi * max(half_band, 1e-9))
    by_array = ARRAY_PHASE * SPEED_OF_LIGHT * distance / (2 * np.pi * frequency * max(aperture, 1e-9))
    return float(rtol**0.25 * min(by_band, by_array))


def cluster_heads(
    vertices: FloatArray, faces: IntArray, parts: IntArray, whole: IntArray, most: float, rtol: float
) -> IntArray:
    """(face,) head of each face's cluster; the face itself where it is alone.

    `vertices` (vertex, 3) [m], `faces` (face, 3) and body `parts` (face,), which clusters do not span; faces in `whole`
    are one facet each, others stay alone; `most` is the largest width of a cluster [m]. Clusters are the connected
    parts of the mesh within the cells of a lattice in the frame of the widest face, so that they do not depend on the
    pose.
    """
    alone = np.arange(len(faces), dtype=np.int32)
    if len(whole) < 2:
        return alone
    corners = vertices[faces]
    edges = corners[:, [1, 2, 0]] - corners
    longest = lengths(edges).max(axis=1)
    area = 0.5 * lengths(face_normals(vertices, faces))
    typical = float((area[whole] * longest[whole]).sum() / max(area[whole].sum(), 1e-300))
    width = min(CLUSTER_SHARE * rtol**0.25 * typical, most)
    small = np.zeros(len(faces), np.bool_)
    small[whole] = longest[whole] < width
    if np.count_nonzero(small) < 2:
        return alone
    centres = triangle_centroids(corners)
    first = int(np.flatnonzero(area >= (1.0 - 1e-6) * area.max())[0])  # independent of the pose
    cells = np.floor((centres - corners[first, 0]) @ _frame(edges[first]).T / width).astype(np.int64)
    one, other = _neighbours(faces, np.flatnonzero(small))
    together = (cells[one] == cells[other]).all(axis=1) & (parts[one] == parts[other])
    links = coo_array((np.ones(together.sum(), np.int8), (one[together], other[together])), shape=(len(faces),) * 2)
    patch = connected_components(links, directed=False)[1]
    # The head is the face nearest to the centre.
    weight = np.bincount(patch, area)
    middle = np.stack([np.bincount(patch, area * axis) for axis in centres.T], axis=1)
    away = lengths(centres - (middle / np.maximum(weight, 1e-300)[:, None])[patch])
    order = np.lexsort((alone, np.round(away / width, 6), patch))
    begin = np.flatnonzero(np.diff(patch[order], prepend=-1))
    return alone[order[begin]][patch]


def _frame(edges: FloatArray) -> FloatArray:
    """(3, 3) unit vectors, rows, along a face's `edges` (3, 3) [m] and across it."""
    along = edges[0] / max(float(np.linalg.norm(edges[0])), 1e-300)
    across = np.cross(along, edges[1])
    across /= max(float(np.linalg.norm(across)), 1e-300)
    return np.stack([along, across, np.cross(along, across)])


def _neighbours(faces: IntArray, chosen: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Pairs of `chosen` faces that share an edge."""
    run = np.sort(np.concatenate([faces[chosen][:, pair] for pair in combinations(range(3), 2)]), axis=1)
    own = np.tile(chosen, 3)
    order = np.lexsort((run[:, 1], run[:, 0]))
    same = (run[order[1:]] == run[order[:-1]]).all(axis=1)
    return own[order[:-1][same]], own[order[1:][same]]
