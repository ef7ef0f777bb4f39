"""The smooth surface that a mesh samples: normals at the corners of its facets.

A mesh of a ball, of a body or of a car door stands for something round. Between vertices with normals n_i, n_k an edge
p_k - p_i rises in its middle by a circle's sagitta, about (n_k - n_i) . (p_k - p_i) / 8, and a facet by the quadratic
that its three edges fix. Neighbours share edges and normals, so that the surface stays closed. Where faces meet at an
angle, as those of a box do, each side has normals of its own and stays as it is.

That surface alone is what returns: its slope is its own, which where neighbours turn by tens of degrees is not quite
that of the vertices' normals it was made from.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components

from rfgen_sionna.records import FloatArray, IntArray
from rfgen_sionna.scene.faceting import SMOOTH
from rfgen_sionna.scene.mesh import face_normals, lengths

_FLAT = 1e-3
"""Faces that turn by less [rad] are one plane: 1 cm of it rises by a micrometre."""


@dataclass(frozen=True)
class Smoothing:
    """Which corners of a mesh's faces share a normal."""

    group: IntArray
    """(face, 3) number of the normal of each corner."""
    gather: csr_array
    """(normal, 3 face) sums what the corners add to each normal."""

    def normals(self, vertices: FloatArray, faces: IntArray) -> FloatArray:
        """(face, 3, 3) unit normals at the corners of each face, for vertices (vertex, 3) [m].

        A face counts by sin / (|a| |b|) of its edges a, b at the corner, which is exact on a sphere (N. Max, Weights
        for computing vertex normals from facet normals, Journal of Graphics Tools 4(2), 1999).
        """
        p = [vertices[faces[:, corner]] for corner in range(3)]
        cross = np.cross(p[1] - p[0], p[2] - p[0])
        square = [np.einsum("fi,fi->f", e, e) for e in (p[2] - p[1], p[0] - p[2], p[1] - p[0])]  # opposite corner
        scale = np.stack([square[1] * square[2], square[2] * square[0], square[0] * square[1]], axis=1)
        weight = 1.0 / np.maximum(scale, 1e-60)
        total = self.gather @ (weight[:, :, None] * cross[:, None]).reshape(-1, 3)
        total /= np.maximum(lengths(total), 1e-300)[:, None]
        return np.asarray(total[self.group])

    def bend(self, vertices: FloatArray, faces: IntArray) -> Bend:
        """How the faces are bent, for vertices (vertex, 3) [m]."""
        return Bend(edge_rises(vertices[faces], self.normals(vertices, faces)))


def smoothing(vertices: FloatArray, faces: IntArray, crease: float = SMOOTH) -> Smoothing | None:
    """What of a mesh is smooth: faces that turn by less than `crease` [rad] over a shared edge; None if all is flat.

    Parameters
    ----------
    vertices, faces
        (vertex, 3) [m] and (face, 3); edges that neighbours run through in the same direction separate them.
    """
    start, end = faces.ravel().astype(np.int64), faces[:, [1, 2, 0]].ravel().astype(np.int64)
    size = len(vertices)
    forward = start * size + end
    order = np.argsort(forward)
    # The edge that runs the other way, where there is just one.
    place = np.searchsorted(forward[order], end * size + start)
    place = np.minimum(place, len(order) - 1)
    other = order[place]
    single = np.ones(len(order), dtype=np.bool_)
    single[1:] &= forward[order][1:] != forward[order][:-1]
    single[:-1] &= forward[order][:-1] != forward[order][1:]
    shared = (forward[other] == end * size + start) & single[place]
    edge = np.flatnonzero(shared)
    other = other[edge]
    normals = face_normals(vertices, faces)
    normals /= np.maximum(lengths(normals), 1e-300)[:, None]
    one, two = normals[edge // 3], normals[other // 3]
    turn = np.arctan2(lengths(np.cross(one, two)), np.einsum("ei,ei->e", one, two))
    if not ((turn > _FLAT) & (turn < crease)).any():
        return None
    smooth = turn < crease
    edge, other = edge[smooth], other[smooth]
    # Corner k of a face begins its edge k; the neighbour's edge begins where this one ends.
    ends = [(edge, _next(other)), (_next(edge), other)]
    row, column = (np.concatenate([pair[i] for pair in ends]) for i in (0, 1))
    corners = 3 * len(faces)
    links = coo_array((np.ones(len(row), np.int8), (row, column)), shape=(corners, corners))
    count, group = connected_components(links, directed=False)
    gather = csr_array((np.ones(corners), (group, np.arange(corners))), shape=(count, corners))
    return Smoothing(group.reshape(-1, 3).astype(np.int32), gather)


def _next(corner: NDArray[np.int64]) -> NDArray[np.int64]:
    """The corner after each within its face."""
    return corner // 3 * 3 + (corner + 1) % 3


def edge_rises(corners: FloatArray, normals: FloatArray) -> FloatArray:
    """(face, 3, 3) by how much the middle of the edge opposite each corner lies off its chord [m], for corners and unit
    normals (face, 3, 3)."""
    first, last = [1, 2, 0], [2, 0, 1]
    chord, turn = corners[:, last] - corners[:, first], normals[:, last] - normals[:, first]
    mean = normals[:, last] + normals[:, first]
    length = np.maximum(lengths(mean), 1e-9)
    # A circle's sagitta, exactly: turn . chord / 8 over cos^2 of a quarter of the angle between the normals.
    size = np.einsum("fei,fei->fe", turn, chord) / (2.0 * length * (2.0 + length))
    return np.asarray(size[..., None] * mean)


@dataclass(frozen=True)
class Bend:
    """By how much facets leave their flat triangles: a quadratic displacement, that of their face, fixed by the corners
    and the middles of the edges. Pieces of a facet inherit it exactly, so that however finely a face is split, the
    surface stays the same."""

    rises: FloatArray
    """(facet, 3, 3) of the middle of the edge opposite each corner, beyond the mean of its ends [m]."""
    lifts: FloatArray | None = None
    """(facet, 3, 3) of the corners [m]; None where there is none, as all facets are whole faces."""

    def take(self, index: IntArray | NDArray[np.intp] | slice) -> Bend:
        return Bend(self.rises[index], None if self.lifts is None else self.lifts[index])

    def within(self, weights: FloatArray) -> Bend:
        """Of one piece of each facet, its corners at barycentric coordinates `weights` (facet, corner, vertex)."""
        middle = 4.0 * weights[:, :, [1, 2, 0]] * weights[:, :, [2, 0, 1]]
        along = weights[:, [2, 0, 1]] - weights[:, [1, 2, 0]]  # of the edge opposite each corner
        lifts = middle @ self.rises
        if self.lifts is not None:
            lifts += weights @ self.lifts
        return Bend(-(along[:, :, [1, 2, 0]] * along[:, :, [2, 0, 1]]) @ self.rises, lifts)

    @staticmethod
    def stack(parts: Sequence[Bend]) -> Bend:
        """One after the other."""
        lifts = [np.zeros_like(each.rises) if each.lifts is None else each.lifts for each in parts]
        flat = all(each.lifts is None for each in parts)
        return Bend(np.concatenate([each.rises for each in parts]), None if flat else np.concatenate(lifts))


def barycentric(points: FloatArray, corners: FloatArray) -> FloatArray:
    """(facet, 3, corner) coordinates of three `points` (facet, 3, 3) [m] in the planes of facets with `corners`
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
