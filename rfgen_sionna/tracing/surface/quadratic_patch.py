"""How facets are bent: quadratic displacements from their flat triangles, and pieces of them.

The edge between two vertices with normals rises in its middle by a circle's sagitta, and a facet by the quadratic that
its three edges fix (:mod:`rfgen_sionna.tracing.surface.smoothing` has the normals).
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
"""(quarter, corner, vertex) of a facet divided at the middles of its edges."""


def edge_sagittas(corners: FloatArray, normals: FloatArray) -> FloatArray:
    """(face, 3, 3) by how much the middle of the edge opposite each corner lies off its chord [m], for corners and unit
    normals (face, 3, 3)."""
    sagittas = np.empty_like(corners)
    for edge in range(3):
        first, last = (edge + 1) % 3, (edge + 2) % 3
        chord, turn = corners[:, last] - corners[:, first], normals[:, last] - normals[:, first]
        mean = normals[:, last] + normals[:, first]
        length = np.maximum(lengths(mean), 1e-9)
        # A circle's sagitta, exactly: turn . chord / 8 over cos^2 of a quarter of the angle between the normals.
        edge_curvature = np.einsum("fi,fi->f", turn, chord) / (2.0 * length * (2.0 + length))
        sagittas[:, edge] = edge_curvature[:, None] * mean
    return sagittas


@dataclass(frozen=True)
class QuadraticPatch:
    """By how much facets leave their flat triangles: a quadratic displacement, that of their face, fixed by the corners
    and the middles of the edges. Pieces of a facet inherit it exactly, so that however finely a face is split, the
    surface stays the same."""

    sagittas: FloatArray
    """(facet, 3, 3) of the middle of the edge opposite each corner, beyond the mean of its ends [m]."""
    corner_offsets: FloatArray | None = None
    """(facet, 3, 3) of the corners [m]; None where there is none, as all facets are whole faces."""

    def take(self, index: IntArray | NDArray[np.intp] | slice) -> QuadraticPatch:
        """Of the facets that `index` counts out; not a mask."""
        if isinstance(index, slice):
            return QuadraticPatch(
                self.sagittas[index], None if self.corner_offsets is None else self.corner_offsets[index]
            )
        corner_offsets = None if self.corner_offsets is None else np.take(self.corner_offsets, index, axis=0)
        return QuadraticPatch(np.take(self.sagittas, index, axis=0), corner_offsets)

    def within(self, weights: FloatArray) -> QuadraticPatch:
        """Of one piece of each facet, its corners at barycentric coordinates `weights` (facet, corner, vertex)."""
        along = weights[:, [2, 0, 1]] - weights[:, [1, 2, 0]]  # of the edge opposite each corner
        corner_offsets = 4.0 * _products(weights) @ self.sagittas
        if self.corner_offsets is not None:
            corner_offsets += weights @ self.corner_offsets
        return QuadraticPatch(-_products(along) @ self.sagittas, corner_offsets)

    def divided(self, weights: FloatArray) -> QuadraticPatch:
        """Of the same pieces of every facet, one facet's after the other's: their corners are at barycentric
        coordinates `weights` (piece, corner, vertex)."""
        along = weights[:, [2, 0, 1]] - weights[:, [1, 2, 0]]
        corner_offsets = split_values(4.0 * _products(weights), self.sagittas)
        if self.corner_offsets is not None:
            corner_offsets += split_values(weights, self.corner_offsets)
        return QuadraticPatch(split_values(-_products(along), self.sagittas), corner_offsets)

    def turned(self, weights: FloatArray, steps: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(facet, step, 3) how the displacement changes at barycentric `weights` (facet, vertex) along each of `steps`
        (facet, step, vertex) that add up to 0, and by how much more with their square."""
        here = weights[:, None]
        more = 4.0 * _products(steps)
        slope = (4.0 * (_products(here + steps) - _products(here)) - more) @ self.sagittas
        if self.corner_offsets is not None:
            slope = slope + steps @ self.corner_offsets
        return slope, more @ self.sagittas

    @staticmethod
    def blended(parts: Sequence[QuadraticPatch], weights: FloatArray) -> QuadraticPatch | None:
        """Of the same facets at other times, one time's after the other's: sums of the `parts` with `weights` (time,
        part); None of none."""
        if not parts:
            return None
        corner_offsets = [each.corner_offsets for each in parts if each.corner_offsets is not None]
        return QuadraticPatch(
            np.tensordot(weights, [each.sagittas for each in parts], 1).reshape(-1, 3, 3),
            np.tensordot(weights, corner_offsets, 1).reshape(-1, 3, 3) if corner_offsets else None,
        )

    def after(self, count: int) -> QuadraticPatch:
        """The same after so many facets that are flat."""
        sagittas = np.zeros((count + len(self.sagittas), 3, 3))
        sagittas[count:] = self.sagittas
        if self.corner_offsets is None:
            return QuadraticPatch(sagittas)
        corner_offsets = np.zeros_like(sagittas)
        corner_offsets[count:] = self.corner_offsets
        return QuadraticPatch(sagittas, corner_offsets)

    @staticmethod
    def stack(parts: Sequence[QuadraticPatch]) -> QuadraticPatch:
        """One after the other."""
        corner_offsets = [
            np.zeros_like(each.sagittas) if each.corner_offsets is None else each.corner_offsets for each in parts
        ]
        flat = all(each.corner_offsets is None for each in parts)
        return QuadraticPatch(
            concatenate_aligned([each.sagittas for each in parts]),
            None if flat else concatenate_aligned(corner_offsets),
        )


def split_facets(
    corners: FloatArray, patch: QuadraticPatch | None, owner: NDArray[np.intp], weights: FloatArray
) -> tuple[FloatArray, QuadraticPatch | None, FloatArray]:
    """Pieces of facets with `corners` (facet, 3, 3) [m] and their `patch`: those that `owner` (piece,) counts out, the
    corners of each at barycentric coordinates `weights` (piece, corner, vertex) of its facet.

    Returns corners (piece, 3, 3) [m] and bend, and how wide each piece is against its facet (piece,), by the longest
    edges. By Dr.Jit, as of facets in half shadow there are thousands of pieces at every instant.
    """
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

    def products(w: list[Any]) -> list[Any]:  # of each two of three
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
    """(facet piece, 3, 3) of the same pieces of every facet, `weights` (piece, corner, vertex) of its `values` (facet,
    vertex, 3)."""
    return np.asarray((weights.reshape(-1, 3) @ values).reshape(-1, 3, 3))


def _products(weights: FloatArray) -> FloatArray:
    """(..., 3) of each two of three weights (..., 3), those of the corners opposite each."""
    x, y, z = weights[..., 0], weights[..., 1], weights[..., 2]
    found = np.empty_like(weights)
    found[..., 0], found[..., 1], found[..., 2] = y * z, z * x, x * y
    return found


def barycentric(points: FloatArray, corners: FloatArray) -> FloatArray:
    """(facet, point, corner) coordinates of `points` (facet, point, 3) [m] in the planes of facets with `corners`
    (facet, 3, 3) [m]; those of facets without area are at their first corner."""
    edges = corners[:, 1:] - corners[:, :1]
    offset = points - corners[:, :1]
    gram = np.einsum("pei,pfi->pef", edges, edges)
    along = np.einsum("pei,pci->pce", edges, offset)
    determinant = gram[:, 0, 0] * gram[:, 1, 1] - gram[:, 0, 1] ** 2
    scale = np.where(determinant > 0, 1.0 / np.where(determinant > 0, determinant, 1.0), 0.0)[:, None]
    second = scale * (along[..., 0] * gram[:, None, 1, 1] - along[..., 1] * gram[:, None, 0, 1])
    third = scale * (along[..., 1] * gram[:, None, 0, 0] - along[..., 0] * gram[:, None, 0, 1])
    return np.stack([1.0 - second - third, second, third], axis=2)
