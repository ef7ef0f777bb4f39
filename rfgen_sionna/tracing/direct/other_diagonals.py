"""Meshes whose quads are cut along the other diagonal: as good a sample of the same smooth surface.

How much a return changes by it is what the mesh itself leaves open, whatever the tolerance.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.mesh import face_normals, lengths
from rfgen_sionna.tracing.surface.smoothing import Smoothing
from rfgen_sionna.tracing.surface.surfaces import Surface

LONGEST = 0.999
"""Length of an edge over the longest of its face from which it counts as a diagonal."""


def with_other_diagonals(surface: Surface, vertices: FloatArray) -> Surface:
    """The surface with `vertices` (vertex, 3) [m] and quads cut along the other diagonal: pairs of faces with a common
    edge that is the longest of both and smooth. Quads that would fold stay, and so do flat surfaces."""
    smooth, faces = surface.smooth, np.asarray(surface.faces)
    if smooth is None or not len(faces):
        return surface
    one, edge, other, back = _quads(faces, smooth.group, vertices)
    a, b, c = (faces[one, (edge + k) % 3] for k in range(3))
    d = faces[other, (back + 2) % 3]
    ends = [(one, (edge + k) % 3) for k in range(3)]
    fourth = other, (back + 2) % 3
    size = len(vertices)
    known = np.sort(np.stack([faces, faces[:, [1, 2, 0]]], axis=2), axis=2).reshape(-1, 2)
    taken = np.isin(np.minimum(c, d) * np.int64(size) + np.maximum(c, d), known[:, 0] * np.int64(size) + known[:, 1])
    whole = face_normals(vertices, np.stack([a, b, c], axis=1)) + face_normals(vertices, np.stack([b, a, d], axis=1))
    first, second = np.stack([a, d, c], axis=1), np.stack([d, b, c], axis=1)
    turned = [np.einsum("fi,fi->f", face_normals(vertices, each), whole) > 0 for each in (first, second)]
    kept = np.flatnonzero(turned[0] & turned[1] & ~taken)
    cut, group = faces.copy(), smooth.group.copy()
    contributes = np.zeros(faces.shape, np.bool_)
    contributes.reshape(-1)[smooth.gather.indices] = True
    counted = contributes.copy()
    for rows, corners, places in (
        (one, first, (ends[0], fourth, ends[2])),
        (other, second, (fourth, ends[1], ends[2])),
    ):
        cut[rows[kept]] = corners[kept]
        for k, place in enumerate(places):
            group[rows[kept], k] = smooth.group[place][kept]
            counted[rows[kept], k] = contributes[place][kept]
    chosen = np.flatnonzero(counted.reshape(-1))
    gather = csr_array((np.ones(len(chosen)), (group.reshape(-1)[chosen], chosen)), shape=smooth.gather.shape)
    return replace(surface, faces=cut, smooth=Smoothing(group, gather))


def _quads(
    faces: IntArray, group: IntArray, vertices: FloatArray
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Faces and their edges, and the faces beyond these and their edges; each face once at most."""
    start, end = faces.ravel().astype(np.int64), faces[:, [1, 2, 0]].ravel().astype(np.int64)
    size = int(faces.max()) + 1
    forward = start * size + end
    order = np.argsort(forward)
    place = np.minimum(np.searchsorted(forward[order], end * size + start), len(order) - 1)
    opposite = order[place]
    long = lengths(vertices[end] - vertices[start]).reshape(-1, 3)
    long = (long >= LONGEST * long.max(axis=1, keepdims=True)).ravel()
    groups, after = group.ravel(), group[:, [1, 2, 0]].ravel()
    edge = np.flatnonzero(
        (forward[opposite] == end * size + start) & long & long[opposite] & (groups == after[opposite])
        & (after == groups[opposite]) & (np.arange(len(opposite)) < opposite)
    )  # fmt: skip
    used, found = np.zeros(len(faces), np.bool_), []
    for k in edge.tolist():
        one, other = k // 3, int(opposite[k]) // 3
        if not (used[one] or used[other]):
            used[one] = used[other] = True
            found.append(k)
    chosen = np.array(found, np.intp)
    beyond = opposite[chosen]
    return chosen // 3, chosen % 3, beyond // 3, beyond % 3
