"""Quadratic patches: displacements of facets from their flat triangles, and pieces of them.

The middle of an edge between two vertex normals (:mod:`rfgen_sionna.tracing.surface.smoothing`) is displaced by a
circle's sagitta, a facet by the quadratic of its three edges.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.kernels import concatenate_aligned, drjit_types, upload
from rfgen_sionna.scene.mesh import lengths

QUARTERS = 0.5 * np.array(
    [
        [[2, 0, 0], [1, 1, 0], [1, 0, 1]],
        [[1, 1, 0], [0, 2, 0], [0, 1, 1]],
        [[1, 0, 1], [0, 1, 1], [0, 0, 2]],
        [[0, 1, 1], [1, 0, 1], [1, 1, 0]],
    ]
)
"""(quarter, corner, vertex) barycentric coordinates of a facet divided at the middles of its edges."""


def edge_sagittas(corners: FloatArray, normals: FloatArray) -> FloatArray:
    """(face, 3, 3) displacement of the middle of each edge [m], for `corners` [m] and unit `normals` (face, 3, 3)."""
    sagittas = np.empty_like(corners)
    for edge in range(3):
        first, last = (edge + 1) % 3, (edge + 2) % 3
        chord, turn = corners[:, last] - corners[:, first], normals[:, last] - normals[:, first]
        mean = normals[:, last] + normals[:, first]
        length = np.maximum(lengths(mean), 1e-9)
        # Exact sagitta of a circle: turn . chord / 8 over cos^2 of a quarter of the angle between the normals.
        rise = np.einsum("fi,fi->f", turn, chord) / (2.0 * length * (2.0 + length))
        sagittas[:, edge] = rise[:, None] * mean
    return sagittas


@dataclass(frozen=True)
class QuadraticPatch:
    """Quadratic displacement of facets, by their corners and the middles of their edges. Pieces of a facet inherit it
    exactly: the surface does not depend on the division."""

    sagittas: FloatArray
    """(facet, 3, 3) displacement of the middle of the edge opposite each corner, over the mean of its ends [m]."""
    corner_offsets: FloatArray | None = None
    """(facet, 3, 3) displacement of the corners [m]; None means zero, as for whole faces."""

    def take(self, index: IntArray | NDArray[np.intp] | slice) -> QuadraticPatch:
        """Patches of the facets `index` (no mask)."""

        def some(values: FloatArray) -> FloatArray:
            return np.asarray(values[index] if isinstance(index, slice) else np.take(values, index, axis=0))

        return QuadraticPatch(some(self.sagittas), None if self.corner_offsets is None else some(self.corner_offsets))

    def within(self, weights: FloatArray) -> QuadraticPatch:
        """Patch of one piece of each facet, at barycentric coordinates `weights` (facet, corner, vertex)."""
        along = weights[:, [2, 0, 1]] - weights[:, [1, 2, 0]]  # of the edge opposite each corner
        corner_offsets = 4.0 * _products(weights) @ self.sagittas
        if self.corner_offsets is not None:
            corner_offsets += weights @ self.corner_offsets
        return QuadraticPatch(-_products(along) @ self.sagittas, corner_offsets)

    def divided(self, weights: FloatArray) -> QuadraticPatch:
        """Patches of equal pieces of every facet, facet by facet, at `weights` (piece, corner, vertex)."""
        along = weights[:, [2, 0, 1]] - weights[:, [1, 2, 0]]
        corner_offsets = split_values(4.0 * _products(weights), self.sagittas)
        if self.corner_offsets is not None:
            corner_offsets += split_values(weights, self.corner_offsets)
        return QuadraticPatch(split_values(-_products(along), self.sagittas), corner_offsets)

    def turned(self, weights: FloatArray, steps: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(facet, step, 3) linear and quadratic change of the displacement at `weights` (facet, vertex) along each of
        `steps` (facet, step, vertex), barycentric coordinates that sum to 0."""
        here = weights[:, None]
        more = 4.0 * _products(steps)
        slope = (4.0 * (_products(here + steps) - _products(here)) - more) @ self.sagittas
        if self.corner_offsets is not None:
            slope = slope + steps @ self.corner_offsets
        return slope, more @ self.sagittas

    @staticmethod
    def blended(parts: Sequence[QuadraticPatch], weights: FloatArray) -> QuadraticPatch | None:
        """Weighted sums of `parts` by `weights` (time, part), time by time; None without parts."""
        if not parts:
            return None
        corner_offsets = [each.corner_offsets for each in parts if each.corner_offsets is not None]
        return QuadraticPatch(
            np.tensordot(weights, [each.sagittas for each in parts], 1).reshape(-1, 3, 3),
            np.tensordot(weights, corner_offsets, 1).reshape(-1, 3, 3) if corner_offsets else None,
        )

    @staticmethod
    def stack(parts: Sequence[QuadraticPatch]) -> QuadraticPatch:
        """Patches one after the other."""
        sagittas = concatenate_aligned([each.sagittas for each in parts])
        if all(each.corner_offsets is None for each in parts):
            return QuadraticPatch(sagittas)
        offsets = [np.zeros_like(k.sagittas) if k.corner_offsets is None else k.corner_offsets for k in parts]
        return QuadraticPatch(sagittas, concatenate_aligned(offsets))


def split_facets(
    corners: FloatArray, patch: QuadraticPatch | None, owner: NDArray[np.intp], weights: FloatArray
) -> tuple[FloatArray, QuadraticPatch | None, FloatArray]:
    """Pieces of facets with `corners` (facet, 3, 3) [m] and `patch`, at barycentric coordinates `weights` (piece,
    corner, vertex) of the facets `owner` (piece,). Returns corners (piece, 3, 3) [m], the pieces' patch, and their
    longest edge over that of the facet (piece,). Dr.Jit handles thousands of pieces per sample time."""
    count = len(owner)
    if not count:
        none = np.zeros((0, 3, 3))
        return none, None if patch is None else QuadraticPatch(none, none), np.zeros(0)
    dr, types = drjit_types()
    Float, UInt32, Array3 = types.Float64, types.UInt32, types.Array3f64
    lane, facet, share = dr.arange(UInt32, count), upload(UInt32, owner), upload(Float, weights)

    def vertices(values: FloatArray) -> list[Any]:
        flat = upload(Float, values)
        return [Array3(*(dr.gather(Float, flat, 9 * facet + 3 * v + axis) for axis in range(3))) for v in range(3)]

    def sums(terms: list[Any], of: list[Any]) -> Any:
        return terms[0] * of[0] + terms[1] * of[1] + terms[2] * of[2]

    def products(w: list[Any]) -> list[Any]:
        return [w[1] * w[2], w[2] * w[0], w[0] * w[1]]

    def longest(p: list[Any]) -> Any:
        return dr.sqrt(dr.maximum(dr.maximum(*(dr.squared_norm(p[i] - p[i - 1]) for i in (0, 1))),
                                  dr.squared_norm(p[2] - p[1])))  # fmt: skip

    def written(vectors: list[Any]) -> Any:
        flat = dr.empty(Float, 9 * count)
        for k, vector in enumerate(vectors):
            for axis in range(3):
                dr.scatter(flat, vector[axis], 9 * lane + 3 * k + axis, mode=dr.ReduceMode.Permute)
        return flat

    place = [[dr.gather(Float, share, 9 * lane + 3 * k + v) for v in range(3)] for k in range(3)]
    given = vertices(corners)
    cut = [sums(each, given) for each in place]
    found = [written(cut), longest(cut) / dr.maximum(longest(given), 1e-300)]
    if patch is not None:
        sagittas = vertices(patch.sagittas)
        along = [[a - b for a, b in zip(place[k - 1], place[k - 2], strict=True)] for k in range(3)]  # opposite edges
        corner_offsets = [4.0 * sums(products(each), sagittas) for each in place]
        if patch.corner_offsets is not None:
            more = vertices(patch.corner_offsets)
            corner_offsets = [each + sums(w, more) for each, w in zip(corner_offsets, place, strict=True)]
        found += [written([-sums(products(each), sagittas) for each in along]), written(corner_offsets)]
    dr.eval(*found)
    parts, width, *bent = (each.numpy() for each in found)
    shape = (count, 3, 3)
    return parts.reshape(shape), QuadraticPatch(*(each.reshape(shape) for each in bent)) if bent else None, width


def split_values(weights: FloatArray, values: FloatArray) -> FloatArray:
    """(facet x piece, 3, 3) values at `weights` (piece, corner, vertex) of facets' `values` (facet, vertex, 3)."""
    return np.asarray((weights.reshape(-1, 3) @ values).reshape(-1, 3, 3))


def _products(weights: FloatArray) -> FloatArray:
    """(..., 3) products of the two other weights of each of three (..., 3)."""
    x, y, z = weights[..., 0], weights[..., 1], weights[..., 2]
    found = np.empty_like(weights)
    found[..., 0], found[..., 1], found[..., 2] = y * z, z * x, x * y
    return found


def barycentric(points: FloatArray, corners: FloatArray) -> FloatArray:
    """(facet, point, corner) barycentric coordinates of `points` (facet, point, 3) [m] in facets with `corners` (facet,
    3, 3) [m]. Points of a facet without area are at its first corner."""
    edges = corners[:, 1:] - corners[:, :1]
    offset = points - corners[:, :1]
    gram = np.einsum("pei,pfi->pef", edges, edges)
    along = np.einsum("pei,pci->pce", edges, offset)
    determinant = gram[:, 0, 0] * gram[:, 1, 1] - gram[:, 0, 1] ** 2
    scale = np.where(determinant > 0, 1.0 / np.where(determinant > 0, determinant, 1.0), 0.0)[:, None]
    second = scale * (along[..., 0] * gram[:, None, 1, 1] - along[..., 1] * gram[:, None, 0, 1])
    third = scale * (along[..., 1] * gram[:, None, 0, 0] - along[..., 0] * gram[:, None, 0, 1])
    return np.stack([1.0 - second - third, second, third], axis=2)
