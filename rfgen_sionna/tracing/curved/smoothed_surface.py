"""Smooth surface of a mesh: quadratic patches over triangles (:mod:`rfgen_sionna.tracing.surface.smoothing`), normals
and curvatures. Faces that join smoothly form one sheet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.faceting import SMOOTH
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.tracing.surface.quadratic_patch import edge_sagittas
from rfgen_sionna.tracing.surface.surfaces import Surface

_FLAT = 1e-3
"""Turn of the normals below which a sheet is plane [rad]."""
_WELD = 1e-6
"""Distance below which vertices are one [m]."""


@dataclass(frozen=True)
class SmoothedSurface:
    """All faces of a scene at one time, numbered as in the ray scene."""

    corners: FloatArray
    """(facet, 3, 3) [m]"""
    normals: FloatArray
    """(facet, 3, 3) unit normals at the corners."""
    sagittas: FloatArray
    """(facet, 3, 3) distance of the middle of the edge opposite each corner from its chord [m]."""
    sheet: IntArray
    """(facet,) number of the smooth sheet."""
    plane: NDArray[np.bool_]
    """(sheet,) whether it is plane."""

    @staticmethod
    def one(surface: Surface, vertices: FloatArray, like: SmoothedSurface | None = None) -> SmoothedSurface:
        """Of one surface with `vertices` (vertex, 3) [m]; `like` is the same surface at another time, for its
        sheets."""
        faces = surface.faces
        vertices = np.asarray(vertices, np.float64)
        corners = vertices[faces]
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        face_normal = cross / np.maximum(lengths(cross), 1e-300)[:, None]
        if surface.smooth is None:
            normals, sagittas = np.repeat(face_normal[:, None], 3, axis=1), np.zeros_like(corners)
        else:
            normals = surface.smooth.normals(vertices, faces)
            sagittas = edge_sagittas(corners, normals)
        if like is not None:
            return SmoothedSurface(corners, normals, sagittas, like.sheet, like.plane)
        sheet = _smooth_sheets(vertices, faces, face_normal)
        count = int(sheet.max()) + 1
        turn = np.ones(count)
        first = np.zeros((count, 3))
        first[sheet[::-1]] = face_normal[::-1]
        for corner in range(3):
            np.minimum.at(turn, sheet, np.abs(np.einsum("fi,fi->f", first[sheet], normals[:, corner])))
        return SmoothedSurface(corners, normals, sagittas, sheet, turn > np.cos(_FLAT))

    @staticmethod
    def some(surfaces: Sequence[Surface], vertices: Sequence[FloatArray], facet: NDArray[np.int64]) -> SmoothedSurface:
        """Of the faces `facet` (n,) of the ray scene alone, in that order, without sheets."""
        count = len(facet)
        corners, normals, sagittas = (np.zeros((count, 3, 3)) for _ in range(3))
        for surface, points in zip(surfaces, vertices, strict=True):
            face = facet - surface.first_facet
            lane = np.flatnonzero((face >= 0) & (face < len(surface.faces)))
            if len(lane) == 0:
                continue
            own = surface.faces[face[lane]]
            corners[lane] = points[own]
            if surface.smooth is None:
                across = np.cross(corners[lane, 1] - corners[lane, 0], corners[lane, 2] - corners[lane, 0])
                normals[lane] = (across / np.maximum(lengths(across), 1e-300)[:, None])[:, None]
            else:
                normals[lane] = surface.smooth.normals(points, surface.faces)[face[lane]]
                sagittas[lane] = edge_sagittas(corners[lane], normals[lane])
        return SmoothedSurface(corners, normals, sagittas, np.zeros(count, np.int32), np.zeros(1, np.bool_))

    @staticmethod
    def joined(parts: Sequence[SmoothedSurface]) -> SmoothedSurface:
        """All surfaces, in order."""
        first = np.cumsum([0] + [len(part.plane) for part in parts])
        return SmoothedSurface(
            np.concatenate([part.corners for part in parts]),
            np.concatenate([part.normals for part in parts]),
            np.concatenate([part.sagittas for part in parts]),
            np.concatenate([part.sheet + at for part, at in zip(parts, first, strict=False)]).astype(np.int32),
            np.concatenate([part.plane for part in parts]),
        )

    def places(self, facet: NDArray[np.int64], weights: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Points (point, 3) on the mesh and on the smooth surface [m], at barycentric coordinates `weights` (point, 3)
        of faces `facet` (point,)."""
        flat = np.einsum("pc,pci->pi", weights, self.corners[facet])
        pairs = weights[:, [1, 2, 0]] * weights[:, [2, 0, 1]]
        return flat, flat + 4.0 * np.einsum("pc,pci->pi", pairs, self.sagittas[facet])


def tangential(curvature: FloatArray, normal: FloatArray) -> FloatArray:
    """(n, 3, 3) tensors projected across `normal` (n, 3)."""
    flat = np.eye(3) - normal[:, :, None] * normal[:, None, :]
    return np.asarray(flat @ curvature @ flat)


def corner_curvatures(surface: Surface, corners: FloatArray, normals: FloatArray, face: NDArray[np.intp]) -> FloatArray:
    """(n, 3, 3, 3) change of the normal at the corners of the faces `face` (n,) of a surface [1/m]: mean of the faces
    around a corner, by area. `corners` [m] and `normals` (face, 3, 3) are of all its faces."""
    if surface.smooth is None:
        return np.zeros((len(face), 3, 3, 3))
    gather = surface.smooth.gather
    group, back = np.unique(surface.smooth.group[face], return_inverse=True)
    around = gather[group]
    used, column = np.unique(around.indices // 3, return_inverse=True)
    own = corners[used]
    cross = np.cross(own[:, 1] - own[:, 0], own[:, 2] - own[:, 0])
    weight = lengths(cross)
    curvatures = _curvatures(own, normals[used], cross / np.maximum(weight, 1e-300)[:, None])
    spread = csr_array((np.ones(len(column)), column.reshape(-1), around.indptr), shape=(len(group), len(used)))
    total = spread @ (weight[:, None, None] * curvatures).reshape(-1, 9)
    total /= np.maximum(spread @ weight, 1e-300)[:, None]
    return np.asarray(total[back.reshape(-1)].reshape(len(face), 3, 3, 3))


def _curvatures(corners: FloatArray, normals: FloatArray, across: FloatArray) -> FloatArray:
    """(face, 3, 3) symmetric tensors from steps along a face to the change of the normal."""
    edges = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=2)
    turns = np.stack([normals[:, 1] - normals[:, 0], normals[:, 2] - normals[:, 0]], axis=2)
    gram = edges.transpose(0, 2, 1) @ edges
    determinant = gram[:, 0, 0] * gram[:, 1, 1] - gram[:, 0, 1] ** 2
    thin = determinant <= 1e-12 * (gram[:, 0, 0] * gram[:, 1, 1] + 1e-300)
    gram[thin] = np.eye(2)
    dual = edges @ np.linalg.inv(gram)
    flat = np.eye(3) - across[:, :, None] * across[:, None, :]
    found = flat @ turns @ dual.transpose(0, 2, 1)
    found[thin] = 0.0
    return np.asarray(0.5 * (found + found.transpose(0, 2, 1)))


def _smooth_sheets(vertices: FloatArray, faces: IntArray, normals: FloatArray) -> IntArray:
    """(face,) number of the sheet: faces that turn by less than `SMOOTH` over a shared edge belong together."""
    _, welded = np.unique(np.round(vertices / _WELD).astype(np.int64), axis=0, return_inverse=True)
    edges = np.sort(welded.reshape(-1)[faces][:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1).astype(np.int64)
    key = edges[:, 0] * len(vertices) + edges[:, 1]
    order = np.argsort(key, kind="stable")
    same = np.flatnonzero(key[order][1:] == key[order][:-1])
    one, other = order[same] // 3, order[same + 1] // 3
    joined = np.abs(np.einsum("ei,ei->e", normals[one], normals[other])) > np.cos(SMOOTH)
    one, other = one[joined], other[joined]
    links = coo_array((np.ones(len(one), np.int8), (one, other)), shape=(len(faces), len(faces)))
    return np.asarray(connected_components(links, directed=False)[1], dtype=np.int32)
