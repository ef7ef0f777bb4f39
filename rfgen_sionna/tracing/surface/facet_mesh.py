"""Facets of several surfaces as pieces of their faces, in arrays for kernels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.tracing.surface.surfaces import Surface
from rfgen_sionna.tracing.surface.tessellate import Tessellation
from rfgen_sionna.tracing.visibility.item_buffer import Meshes


@dataclass(frozen=True)
class FacetMesh:
    """Faces of all surfaces, and the facets that they are divided into. Vertices of pieces follow those of each
    mesh."""

    faces: IntArray
    """(face, 3) vertex indices."""
    group: IntArray
    """(face, 3) index of the normal of each corner; -1 on flat surfaces."""
    contributes: NDArray[np.bool_]
    """(face, 3) whether a corner contributes to its normal."""
    num_normals: int
    surface: IntArray
    """(face,) index of the surface."""
    single: NDArray[np.bool_]
    """(face,) whether only the front is visible."""
    face_of: IntArray
    """(facet,)"""
    weights: FloatArray
    """(facet, 3, 3) barycentric coordinates of the corners; no rows where all facets are whole faces."""
    part: IntArray
    """(facet,) index of the part of the body."""
    face_in_surface: IntArray
    """(facet,) face within its surface."""
    place: IntArray
    """(facet,) persistent number of the facet, or of its grain, within the face."""
    grain: FloatArray | None
    """(facet, 4) :attr:`~rfgen_sionna.tracing.surface.tessellate.Tessellation.shares`; None: each facet is a grain."""
    meshes: Meshes
    """Flat facets, for visibility."""
    sources: tuple[tuple[NDArray[np.intp], FloatArray], ...]
    """Of each surface the (piece vertex, 3) vertices and (piece vertex, 3) weights of additional vertices."""

    def __len__(self) -> int:
        return len(self.face_of)

    @property
    def facet_surface(self) -> IntArray:
        """(facet,) index of the surface."""
        return np.asarray(self.surface[self.face_of])

    @staticmethod
    def of(
        surfaces: Sequence[Surface], tessellations: Sequence[Tessellation], num_vertices: Sequence[int]
    ) -> FacetMesh:
        """Facets of `surfaces` with `num_vertices` (surface) each, divided by `tessellations`."""
        columns: dict[str, list[Any]] = {name: [] for name in ("faces", "group", "contributes", "surface", "single")}
        facets: dict[str, list[Any]] = {
            name: [] for name in ("face_of", "weights", "part", "own", "place", "corners", "single")
        }
        sources, vertex_range, facet_range = [], [], []
        first_vertex = first_face = first_normal = first_facet = 0
        whole = True
        for number, (surface, pieces, count) in enumerate(zip(surfaces, tessellations, num_vertices, strict=True)):
            faces = np.asarray(surface.faces, np.int32)
            columns["faces"].append(faces + np.int32(first_vertex))
            if surface.smooth is None:
                columns["group"].append(np.full(faces.shape, -1, np.int32))
                columns["contributes"].append(np.zeros(faces.shape, np.bool_))
            else:
                columns["group"].append(surface.smooth.group + np.int32(first_normal))
                contributes = np.zeros(faces.size, np.bool_)
                contributes[surface.smooth.gather.indices] = True
                columns["contributes"].append(contributes.reshape(-1, 3))
                first_normal += surface.smooth.gather.shape[0]
            columns["surface"].append(np.full(len(faces), number, np.int32))
            single = np.full(len(faces), surface.closed)
            columns["single"].append(single)
            corners = faces[pieces.face]
            divided = pieces.pieces
            if len(divided):
                whole = False
                weights = pieces.weights[divided].reshape(-1, 3)
                ends = np.repeat(faces[pieces.face[divided]], 3, axis=0).astype(np.intp)
                sources.append((ends, np.ascontiguousarray(weights)))
                corners = corners.copy()
                corners[divided] = count + np.arange(3 * len(divided), dtype=np.int32).reshape(-1, 3)
            else:
                sources.append((np.zeros((0, 3), np.intp), np.zeros((0, 3))))
            facets["face_of"].append(pieces.face + np.int32(first_face))
            facets["weights"].append(pieces.weights)
            facets["part"].append(surface.parts[pieces.face])
            facets["own"].append(pieces.face)
            facets["place"].append(pieces.places)
            facets["corners"].append(corners + np.int32(first_vertex))
            facets["single"].append(single[pieces.face])
            total = count + 3 * len(divided)
            vertex_range.append((first_vertex, first_vertex + total))
            facet_range.append((first_facet, first_facet + len(pieces.face)))
            first_vertex, first_face, first_facet = first_vertex + total, first_face + len(faces), facet_range[-1][1]

        def joined(parts: list[Any], empty: Any) -> Any:
            return np.ascontiguousarray(np.concatenate([empty, *parts]))

        none3, none = np.zeros((0, 3), np.int32), np.zeros(0, np.int32)
        grain = None
        if any(each.shares is not None for each in tessellations):
            single_grain = np.array([[1.0, 1 / 3, 1 / 3, 1 / 3]])
            grain = np.concatenate([np.repeat(single_grain, len(each.face), axis=0) if each.shares is None else
            each.shares
                                    for each in tessellations])  # fmt: skip
        meshes = Meshes(
            joined(facets["corners"], none3), joined(facets["single"], none.astype(np.bool_)),
            np.array(vertex_range, np.int32).reshape(-1, 2), np.array(facet_range, np.int32).reshape(-1, 2),
        )  # fmt: skip
        return FacetMesh(
            joined(columns["faces"], none3), joined(columns["group"], none3),
            joined(columns["contributes"], none3.astype(np.bool_)), first_normal, joined(columns["surface"], none),
            joined(columns["single"], none.astype(np.bool_)), joined(facets["face_of"], none),
            np.zeros((0, 3, 3)) if whole else joined(facets["weights"], np.zeros((0, 3, 3))),
            joined(facets["part"], none), joined(facets["own"], none), joined(facets["place"], none), grain, meshes,
            tuple(sources),
        )  # fmt: skip

    def points(self, vertices: Sequence[FloatArray], viewpoint: FloatArray) -> FloatArray:
        """(vertex, 3) positions [m] relative to the `viewpoint`, of all vertices with those of the pieces, for
        `vertices` (vertex, 3) [m] of each surface."""
        ranges = self.meshes.vertex_range
        found = np.empty((int(ranges.max(initial=0)), 3))
        for own, (first, last), (ends, weights) in zip(vertices, ranges, self.sources, strict=True):
            np.subtract(own, viewpoint, out=found[first : first + len(own)])
            if len(ends):
                found[first + len(own) : last] = np.einsum("pk,pki->pi", weights, found[first + ends])
        return found

    def centroids(self, points: FloatArray, chosen: NDArray[np.intp]) -> FloatArray:
        """(chosen, 3) centroids [m] of the `chosen` flat facets, for `points` (vertex, 3) [m]."""
        found = np.empty((len(chosen), 3))
        facet_centroids(points, self.meshes.corners, chosen, found)
        return found

    def corner_normals(self, points: FloatArray, facets: slice) -> FloatArray:
        """(facet, 3, 3) unit normals at the corners of some `facets`, those of the smooth surface where there is
        one."""
        a, b, c = (points[self.meshes.corners[facets, k]] for k in range(3))
        found = np.repeat(np.cross(b - a, c - a)[:, None], 3, axis=1)
        group = self.group[self.face_of[facets]]
        smooth = group[:, 0] >= 0
        if smooth.any():
            of_face = self.normals(points)[group[smooth]]
            weights = self.weights[facets][smooth] if len(self.weights) else np.eye(3)
            found[smooth] = weights @ of_face
        return np.asarray(found / np.maximum(np.linalg.norm(found, axis=2, keepdims=True), 1e-30))

    def normals(self, points: FloatArray) -> FloatArray:
        """(normal, 3) unit normals of the smooth surfaces at `points` (vertex, 3) [m]."""
        found = np.zeros((max(self.num_normals, 1), 3))
        if self.num_normals:
            corner_normals(points, self.faces, self.group, self.contributes, found)
        return found


@njit(cache=True, nogil=True)
def facet_centroids(points: Any, corners: Any, chosen: Any, found: Any) -> None:
    """Centroids into `found` (chosen, 3) of the `chosen` facets with `corners` (facet, 3) among `points` (vertex,
    3)."""
    for q in range(chosen.shape[0]):
        f = chosen[q]
        for k in range(3):
            found[q, k] = (points[corners[f, 0], k] + points[corners[f, 1], k] + points[corners[f, 2], k]) / 3.0


@njit(cache=True, nogil=True, error_model="numpy")
def corner_normals(points: Any, faces: Any, group: Any, contributes: Any, normals: Any) -> None:
    """Unit normals of the groups of face corners into `normals` (normal, 3), which are zero before. Weights are sin /
    (|a| |b|) of the edges a, b at the corner, exact on a sphere (N. Max, Weights for computing vertex normals from
    facet normals, Journal of Graphics Tools 4(2), 1999)."""
    for f in range(faces.shape[0]):
        if group[f, 0] < 0:
            continue
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        ax, ay, az = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1], points[j, 2] - points[i, 2]
        bx, by, bz = points[k, 0] - points[i, 0], points[k, 1] - points[i, 1], points[k, 2] - points[i, 2]
        cx, cy, cz = bx - ax, by - ay, bz - az
        x, y, z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        a, b, c = ax * ax + ay * ay + az * az, bx * bx + by * by + bz * bz, cx * cx + cy * cy + cz * cz
        for corner, product in ((0, a * b), (1, a * c), (2, b * c)):
            if contributes[f, corner]:
                g, w = group[f, corner], 1.0 / max(product, 1e-60)
                normals[g, 0] += w * x
                normals[g, 1] += w * y
                normals[g, 2] += w * z
    for g in range(normals.shape[0]):
        size = np.sqrt(normals[g, 0] ** 2 + normals[g, 1] ** 2 + normals[g, 2] ** 2)
        w = 1.0 / max(size, 1e-300)
        normals[g, 0] *= w
        normals[g, 1] *= w
        normals[g, 2] *= w
