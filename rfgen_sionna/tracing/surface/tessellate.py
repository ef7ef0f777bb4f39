"""Division of faces into facets of the size of :mod:`rfgen_sionna.tracing.surface.resolution`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.mesh import face_corners, lengths, max_component, triangle_centroids
from rfgen_sionna.tracing.surface.quadratic_patch import QuadraticPatch
from rfgen_sionna.tracing.surface.resolution import MAX_PARTS, SmoothPieces, required_splits
from rfgen_sionna.tracing.surface.smoothing import Smoothing

_LENGTH_TOLERANCE = 1e-9
"""Relative difference of edges that count as equal, so that rounding does not choose the one to divide."""
_MAX_SPLITS = 64
"""Largest number of bisections: 2^-32 of an edge, below the rounding of coordinates."""


@dataclass(frozen=True)
class Tessellation:
    """Facets as pieces of a mesh's faces, which move and deform with it."""

    face: IntArray
    """(facet,) face of each facet."""
    weights: FloatArray
    """(facet, corner, vertex) barycentric coordinates of the facet's corners in the face."""
    parts: IntArray
    """(facet,) parts per edge of the integral."""
    grains: FloatArray | None = None
    """(facet, corner, vertex) corners of the facet's grain, which scatters as one; None means the facet."""

    @cached_property
    def places(self) -> IntArray:
        """(facet,) number of each facet's grain within its face, by the grain's position."""
        own = self.weights if self.grains is None else self.grains
        middle = np.rint(own.mean(axis=1)[:, :2] * 2**15).astype(np.int32)
        return np.asarray(middle[:, 0] * 2**16 + middle[:, 1], dtype=np.int32)

    @cached_property
    def shares(self) -> FloatArray | None:
        """(facet, 4) share of the facet in its grain, barycentric coordinates of the grain's middle; None without
        grains."""
        if self.grains is None:
            return None
        share = np.abs(np.linalg.det(self.weights) / np.linalg.det(self.grains))
        middle = np.linalg.solve(self.weights.transpose(0, 2, 1), self.grains.mean(axis=1)[..., None])[..., 0]
        return np.column_stack([share, middle])

    @cached_property
    def pieces(self) -> NDArray[np.intp]:
        """Facets smaller than their face."""
        return np.flatnonzero((self.weights != np.eye(3)).any(axis=(1, 2)))

    @cached_property
    def _middles(self) -> FloatArray:
        """(facet, 3) barycentric coordinates of the centroids."""
        return triangle_centroids(self.weights)

    def are_the_faces(self, count: int) -> bool:
        """Whether the facets are the `count` faces, in order."""
        return len(self.face) == count and self._begin_the_faces

    @cached_property
    def _begin_the_faces(self) -> bool:
        return not len(self.pieces) and bool((self.face == np.arange(len(self.face))).all())

    def corners(self, vertices: FloatArray, faces: IntArray, chosen: NDArray[np.intp] | None = None) -> FloatArray:
        """(facet, 3, 3) corners [m] of all or of the `chosen` facets, for vertices (vertex, 3) [m]."""
        if chosen is not None:
            return np.asarray(self.weights[chosen] @ face_corners(vertices, faces[self.face[chosen]]), dtype=np.float64)
        corners = face_corners(vertices, faces if self.are_the_faces(len(faces)) else faces[self.face])
        pieces = self.pieces
        corners[pieces] = self.weights[pieces] @ corners[pieces]
        return np.asarray(corners, dtype=np.float64)

    def patches(
        self,
        vertices: Sequence[FloatArray],
        faces: IntArray,
        smooth: Smoothing | None,
        chosen: NDArray[np.intp] | None = None,
    ) -> list[QuadraticPatch]:
        """Patches of the facets at several times; only the `chosen` ones need any, None means all."""
        count, pieces = len(self.face), self.pieces
        if smooth is None or not count:
            return [QuadraticPatch(np.zeros((count, 3, 3))) for _ in vertices]
        whole = self.are_the_faces(len(faces))
        of_faces = chosen
        if not whole and chosen is not None:
            there = np.zeros(len(faces), np.bool_)
            there[self.face[chosen]] = True
            of_faces = np.flatnonzero(there)
        found = smooth.patches(vertices, faces, of_faces)
        if not whole:
            found = [patch.take(self.face) for patch in found]
        if len(pieces):
            weights = self.weights[pieces]
            for number, patch in enumerate(found):
                own, corner_offsets = patch.take(pieces).within(weights), np.zeros((count, 3, 3))
                patch.sagittas[pieces], corner_offsets[pieces] = own.sagittas, own.corner_offsets
                found[number] = QuadraticPatch(patch.sagittas, corner_offsets)
        return found

    def centroids(self, vertices: FloatArray, faces: IntArray, chosen: NDArray[np.intp]) -> FloatArray:
        """(chosen, 3) centroids [m] of the `chosen` facets, for vertices (vertex, 3) [m]."""
        ends, weights = np.take(faces, self.face[chosen], axis=0), np.take(self._middles, chosen, axis=0)
        shape = len(chosen), len(vertices)
        rows = csr_array((weights.ravel(), ends.ravel(), np.arange(0, 3 * len(chosen) + 1, 3)), shape=shape)
        return np.asarray(rows @ np.asarray(vertices, np.float64))


def tessellate(
    vertices: FloatArray,
    faces: IntArray,
    viewpoint: FloatArray,
    frequency: float,
    rtol: float,
    pattern_gain: Callable[[FloatArray], FloatArray] | None = None,
    max_range: float = np.inf,
    half_band: float = 0.0,
    limit: int = 5_000_000,
    smooth: Smoothing | None = None,
    still: bool = False,
    grain: float | None = None,
) -> Tessellation:
    """Bisect the longest edges until every facet is small enough to be integrated in few parts.

    A facet has one visibility and one motion; each part of its integral has its own quadratic phase at `rtol`.

    Parameters
    ----------
    vertices, faces, viewpoint
        (vertex, 3) [m], (face, 3), and (3,) phase centre of the radar [m].
    frequency, half_band
        Highest frequency and half the sampled band [Hz]; :data:`BAND_SWING` bounds the facets' depth.
    rtol
        Error relative to the surface's return in the direction of the highest gain.
    pattern_gain
        Weights in 0 … 1 of unit vectors (..., 3) from the viewpoint; None means 1. Small weights need coarser facets,
        steep ones finer facets.
    max_range
        Facets beyond it [m] are omitted.
    limit
        Largest number of facets.
    smooth, still
        Normals of the smooth surface, None means flat faces; whether it is static.
    grain
        Longest edge of grains [m], which do not depend on the viewpoint and bound the facets; None means no grains.

    Raises
    ------
    ValueError
        If `rtol` takes more than `limit` facets.
    """
    face = np.arange(len(faces), dtype=np.int32)
    height, sagittas = np.zeros(len(faces)), None
    if smooth is not None:
        # The middle of a face rises by 4/9 of the sum over its edges.
        sagittas = smooth.patch(vertices, faces).sagittas
        height = lengths(sagittas).sum(axis=1) * (4 / 9)
    weights = np.broadcast_to(np.eye(3), (len(faces), 3, 3))
    grains = np.full(weights.shape, np.nan)
    done: list[tuple[NDArray[Any], ...]] = []  # face, weights, parts, parts for the height, grains
    count = 0
    for times in range(_MAX_SPLITS):
        corners = np.asarray(weights @ vertices[faces[face]], dtype=np.float64)
        if np.isfinite(max_range):
            centre = triangle_centroids(corners)
            radius = max_component(lengths(corners - centre[:, None]))
            near = lengths(centre - viewpoint) - radius < max_range
            if not near.all():
                face, weights, grains, corners = face[near], weights[near], grains[near], corners[near]
        # Heights go with the area of a piece.
        patch = None
        if sagittas is not None:
            patch = SmoothPieces(height[face] * 0.5**times, weights, sagittas[face])
        known = pattern_gain, half_band
        coarse, parts, high = required_splits(corners, viewpoint, frequency, rtol, *known, patch, still)
        sides = lengths(corners[:, [1, 2, 0]] - corners[:, [2, 0, 1]])  # opposite corner
        if grain is not None:
            fresh = np.isnan(grains[:, 0, 0]) & (max_component(sides) <= (1.0 + _LENGTH_TOLERANCE) * grain)
            grains[fresh] = weights[fresh]
            coarse |= np.isnan(grains[:, 0, 0])
        done.append(tuple(each[~coarse] for each in (face, weights, parts, high, grains)))
        count += int(np.count_nonzero(~coarse))
        face, weights, grains, sides = face[coarse], weights[coarse], grains[coarse], sides[coarse]
        if len(face) == 0:
            break
        if count + 2 * len(face) > limit:
            raise ValueError(
                f"rtol is {rtol:g}: this scene takes more than {limit:,} facets; raise rtol, or remove large surfaces "
                "near the radar"
            )
        longest = sides >= (1.0 - _LENGTH_TOLERANCE) * max_component(sides)[:, None]
        edge = longest.argmax(axis=1) if grain is not None else 2 - longest[:, ::-1].argmax(axis=1)
        row = np.arange(len(face))
        apex, left, right = weights[row, edge], weights[row, (edge + 1) % 3], weights[row, (edge + 2) % 3]
        middle = 0.5 * (left + right)
        face, grains = np.concatenate([face, face]), np.concatenate([grains, grains])
        weights = np.concatenate([np.stack([apex, left, middle], axis=1), np.stack([apex, middle, right], axis=1)])
    else:
        most = np.full(len(face), MAX_PARTS, dtype=np.int32)
        done.append((face, weights, most, np.zeros(len(face)), np.where(np.isnan(grains), weights, grains)))
    order = np.argsort(np.concatenate([each[0] for each in done]), kind="stable")
    columns = list(zip(*done, strict=True))[: 4 if grain is None else 5]
    face, weights, flat, high, *own = (np.concatenate(each)[order] for each in columns)
    return Tessellation(face, weights, np.maximum(flat, np.ceil(high).astype(np.int32)), *own)
