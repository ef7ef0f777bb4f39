"""Vertex normals of the smooth surface that a mesh samples.

Between vertices with normals n_i, n_k the middle of an edge p_k - p_i is displaced by a circle's sagitta, about (n_k -
n_i) . (p_k - p_i) / 8, and a facet by the quadratic of its three edges. Neighbours share edges and normals, so the
surface stays closed. At creases each side has its own normals, and plane parts between bent edges stay plane
(:mod:`rfgen_sionna.scene.faceting`). The surface's slope is that of the patches, not of the vertex normals.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.faceting import FLATNESS_ANGLE, SMOOTH, PlaneParts, find_plane_parts
from rfgen_sionna.scene.kernels import FrozenKernel, concatenate_aligned, drjit_types, upload
from rfgen_sionna.scene.mesh import corner_columns, face_normals, lengths
from rfgen_sionna.tracing.surface.quadratic_patch import QuadraticPatch, edge_sagittas

_MIN_TIP_SLOPE, _MIN_TIP_RATIO = 0.02, 10.0
"""Mean slope of the edges against the normal at the tip of a cone, and its ratio to that at their other ends."""


@dataclass(frozen=True)
class Smoothing:
    """Groups of face corners with a common normal."""

    group: IntArray
    """(face, 3) index of the normal of each corner."""
    gather: csr_array
    """(normal, 3 face) sum of the corners' contributions to each normal; some corners contribute nothing."""

    def normals(self, vertices: FloatArray, faces: IntArray) -> FloatArray:
        """(face, 3, 3) unit normals at the corners of each face, for vertices (vertex, 3) [m]. Weights are sin / (|a|
        |b|) of the edges a, b at the corner, exact on a sphere (N. Max, Weights for computing vertex normals from facet
        normals, Journal of Graphics Tools 4(2), 1999)."""
        p = corner_columns(vertices, faces)
        one, other, third = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0], p[:, 2] - p[:, 1]
        cross = np.stack([one[i - 2] * other[i - 1] - one[i - 1] * other[i - 2] for i in range(3)])
        square = [e[0] * e[0] + e[1] * e[1] + e[2] * e[2] for e in (third, other, one)]  # opposite corner
        weight = np.empty((p.shape[2], 3))
        for i in range(3):
            weight[:, i] = 1.0 / np.maximum(square[i - 2] * square[i - 1], 1e-60)
        total = np.stack([self.gather @ (weight * axis[:, None]).reshape(-1) for axis in cross])
        total /= np.maximum(np.sqrt(total[0] ** 2 + total[1] ** 2 + total[2] ** 2), 1e-300)
        return np.ascontiguousarray(np.take(total, self.group.T, axis=1).transpose(2, 1, 0))

    def patch(self, vertices: FloatArray, faces: IntArray) -> QuadraticPatch:
        """Patches of the faces, for vertices (vertex, 3) [m]."""
        return QuadraticPatch(edge_sagittas(vertices[faces], self.normals(vertices, faces)))

    def patches(
        self, vertices: Sequence[FloatArray], faces: IntArray, chosen: NDArray[np.intp] | None = None
    ) -> list[QuadraticPatch]:
        """:meth:`patch` at several times, by Dr.Jit. Only the faces `chosen` need patches; None means all."""
        count, times, size = len(faces) if chosen is None else len(chosen), len(vertices), len(faces)
        if not count:
            return [QuadraticPatch(np.zeros((size, 3, 3))) for _ in range(times)]
        dr, types = drjit_types()
        Float, UInt32, normals = types.Float64, types.UInt32, self.gather.shape[0]
        sagittas = dr.zeros(Float, 9 * times * size)
        dr.make_opaque(sagittas)
        given = {
            "places": upload(Float, vertices[0] if times == 1 else concatenate_aligned(vertices)),
            "ends": upload(UInt32, faces),
            "members": upload(UInt32, self.gather.indices),
            "starts": upload(UInt32, self.gather.indptr),
            "group": upload(UInt32, self.group),
            # Vertices, normals, faces, and chosen faces of each time.
            "counts": [dr.opaque(UInt32, each) for each in (len(vertices[0]), normals, size, count)],
            "normals": dr.arange(UInt32, times * normals),
            "faces": dr.arange(UInt32, times * count),
            "sagittas": sagittas,
        }
        if chosen is not None:
            given["chosen"] = upload(UInt32, chosen)
        _BENDS(given)
        return [QuadraticPatch(each) for each in sagittas.numpy().reshape(times, size, 3, 3)]


def _bend(given: dict[str, Any]) -> None:
    """Kernel of :meth:`Smoothing.patches`."""
    dr, types = drjit_types()
    Float, UInt32, Array3 = types.Float64, types.UInt32, types.Array3f64
    points, groups, every, count = given["counts"]

    def vector(flat: Any, index: Any) -> Any:
        return Array3(*(dr.gather(Float, flat, 3 * index + axis) for axis in range(3)))

    def vertex(time: Any, face: Any, corner: Any) -> Any:
        return vector(given["places"], time * points + dr.gather(UInt32, given["ends"], 3 * face + corner))

    def add(each: Any, total: Any) -> tuple[Any, Any]:
        corner = dr.gather(UInt32, given["members"], each)
        face, begin = corner // 3, corner % 3
        here, one, other = (vertex(time, face, (begin + k) % 3) for k in range(3))
        one, other = one - here, other - here
        weight = 1.0 / dr.maximum(dr.squared_norm(one) * dr.squared_norm(other), 1e-60)
        return each + 1, total + weight * dr.cross(one, other)

    lane = given["normals"]
    time, normal = lane // groups, lane % groups
    last = dr.gather(UInt32, given["starts"], normal + 1)
    begun = dr.gather(UInt32, given["starts"], normal), dr.zeros(Array3, dr.width(lane))
    total = dr.while_loop(begun, lambda each, _: each < last, add)[1]
    total /= dr.maximum(dr.norm(total), 1e-300)
    dr.eval(total)  # axis by axis: the size of one array would be frozen
    lane = given["faces"]
    later, face = lane // count, lane % count
    if "chosen" in given:
        face = dr.gather(UInt32, given["chosen"], face)
    for edge in range(3):
        (here, first), (there, second) = (
            (
                vertex(later, face, end),
                dr.gather(Array3, total, later * groups + dr.gather(UInt32, given["group"], 3 * face + end)),
            )
            for end in ((edge + 1) % 3, (edge + 2) % 3)
        )
        mean = first + second
        length = dr.maximum(dr.norm(mean), 1e-9)
        rise = mean * (dr.dot(second - first, there - here) / (2.0 * length * (2.0 + length)))
        for axis in range(3):
            place = 9 * (later * every + face) + 3 * edge + axis
            dr.scatter(given["sagittas"], rise[axis], place, mode=dr.ReduceMode.Permute)
    dr.eval(given["sagittas"])


_BENDS = FrozenKernel(_bend)


def find_smoothing(vertices: FloatArray, faces: IntArray, crease: float = SMOOTH) -> Smoothing | None:
    """Groups of face corners for `vertices` (vertex, 3) [m] and `faces` (face, 3); None for a mesh of plane parts only.
    Faces with an angle below `crease` [rad] over a shared edge are smooth; neighbours of opposite orientation are
    separate."""
    start, end = faces.ravel().astype(np.int64), faces[:, [1, 2, 0]].ravel().astype(np.int64)
    size = len(vertices)
    forward = start * size + end
    order = np.argsort(forward)
    # The single edge of opposite direction.
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
    little = turn < crease
    edge, other, turn = edge[little], other[little], turn[little]
    flats = find_plane_parts(vertices, faces, edge, other, turn)
    if not ((turn > FLATNESS_ANGLE) & flats.smooth).any():
        return None
    edge, other, flat = edge[flats.smooth], other[flats.smooth], flats.flat[flats.smooth]
    # Corner k begins edge k of a face; the neighbour's edge begins at the other end.
    ends = [(edge, _next(other)), (_next(edge), other)]
    row, column = (np.concatenate([pair[i] for pair in ends]) for i in (0, 1))
    corners = 3 * len(faces)
    links = coo_array((np.ones(len(row), np.int8), (row, column)), shape=(corners, corners))
    count, group = connected_components(links, directed=False)
    around = np.bincount(group[row], minlength=count) == 2 * np.bincount(group, minlength=count)
    found = _normal_groups(group, _contributing(group, flats, edge[flat], other[flat], links))
    tip = _tips(found, vertices, faces) & around[group]  # the faces close around a tip
    if not tip.any():
        return found
    group[tip] = count + np.arange(np.count_nonzero(tip))
    _, group = np.unique(group, return_inverse=True)
    return _normal_groups(group, _contributing(group, flats, edge[flat], other[flat], links))


def _contributing(
    group: NDArray[np.integer[Any]],
    flats: PlaneParts,
    edge: NDArray[np.int64],
    other: NDArray[np.int64],
    links: coo_array,
) -> NDArray[np.intp]:
    """Face corners that contribute to the normal of their group: those of plane parts beside edges `edge` to bent parts
    (`other`), not the bent ones, nor parts linked to them alone. `links` join corners of neighbouring faces."""
    if not len(edge):
        return np.arange(len(group))
    count = int(flats.part.max()) + 1
    member = group.astype(np.int64) * count + np.repeat(flats.part, 3)
    flat, bent = (np.unique(member[np.concatenate([each, _next(each)])]) for each in (edge, other))
    flat = np.setdiff1d(flat, bent)
    has_flat = np.zeros(int(group.max()) + 1, np.bool_)
    has_flat[flat // count] = True
    silent = has_flat[group] & np.isin(member, bent)
    kept = ~silent[links.row] & ~silent[links.col]
    joined = coo_array((links.data[kept], (links.row[kept], links.col[kept])), shape=links.shape)
    fans, fan = connected_components(joined, directed=False)
    from_flat = np.zeros(fans, np.bool_)
    from_flat[fan[np.isin(member, flat)]] = True
    return np.flatnonzero(~has_flat[group] | from_flat[fan])


def _normal_groups(group: NDArray[np.integer[Any]], contributing: NDArray[np.intp]) -> Smoothing:
    """Smoothing of corners in groups (face corner,), of which some are `contributing`."""
    shape = (int(group.max()) + 1, len(group))
    gather = csr_array((np.ones(len(contributing)), (group[contributing], contributing)), shape=shape)
    return Smoothing(group.reshape(-1, 3).astype(np.int32), gather)


def _tips(smooth: Smoothing, vertices: FloatArray, faces: IntArray) -> NDArray[np.bool_]:
    """(face corner,) corners at the tip of a cone, where a mean normal would bulge the sides: edges leave it at an
    angle to its normal and arrive at right angles to the normals at their other ends. On a round surface both angles
    are equal."""
    normals, places = smooth.normals(vertices, faces), vertices[faces]
    leaving, arriving = np.zeros((2, *faces.shape))
    for on in (1, 2):
        other = np.roll(np.arange(3), -on)
        edge = places[:, other] - places
        edge /= np.maximum(np.linalg.norm(edge, axis=2, keepdims=True), 1e-300)
        leaving += 0.5 * np.einsum("fci,fci->fc", normals, edge)
        arriving += 0.5 * np.abs(np.einsum("fci,fci->fc", normals[:, other], edge))
    group = smooth.group.ravel()
    count = np.bincount(group)
    here, there = (np.bincount(group, weights=each.ravel()) / count for each in (leaving, arriving))
    return np.asarray(((count > 2) & (np.abs(here) > np.maximum(_MIN_TIP_SLOPE, _MIN_TIP_RATIO * there)))[group])


def _next(corner: NDArray[np.int64]) -> NDArray[np.int64]:
    """Next corner within the face."""
    return corner // 3 * 3 + (corner + 1) % 3
