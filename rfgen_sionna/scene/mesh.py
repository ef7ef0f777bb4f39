"""Triangle meshes: checks, geometry of faces, rigid meshes."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.scene_errors import MeshError
from rfgen_sionna.scene.vertex_welding import weld_vertices

MAX_COORDINATE = 1e10
"""Largest coordinate [m]: float64 resolves larger ones to more than a few micrometres."""
_THIRDS = np.tile(np.eye(3) / 3.0, (3, 1))


def face_normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """(face, 3) normals of twice the area's length [m²]; a face that is counter-clockwise from a side points there."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    return np.cross(b - a, c - a)


def lengths(vectors: FloatArray) -> FloatArray:
    """(...) lengths of vectors (..., 3), faster than `numpy.linalg.norm` along a short axis."""
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    return np.asarray(np.sqrt(x * x + y * y + z * z))


def unit(vectors: FloatArray) -> FloatArray:
    """(..., 3) `vectors` (..., 3) at length 1; vectors of length 0 stay."""
    return np.asarray(vectors / np.maximum(lengths(vectors), 1e-300)[..., None])


def max_component(values: FloatArray) -> FloatArray:
    """(...) largest of three values (..., 3), faster than `max(axis=-1)`."""
    return np.asarray(np.maximum(np.maximum(values[..., 0], values[..., 1]), values[..., 2]))


def bounds(points: FloatArray) -> FloatArray:
    """(2, 3) least and largest coordinates of at least one point (point, 3)."""
    return np.array([[axis.min() for axis in points.T], [axis.max() for axis in points.T]])


def face_corners(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """(face, corner, 3) positions of the faces' corners: `vertices[faces]`, faster."""
    return np.asarray(np.take(vertices, faces, axis=0))


def corner_columns(vertices: FloatArray, faces: IntArray | NDArray[np.uint32]) -> FloatArray:
    """(axis, corner, face) positions of the faces' corners, with long contiguous rows."""
    return np.asarray(np.take(np.ascontiguousarray(vertices.T), faces.T, axis=1))


def triangle_centroids(corners: FloatArray) -> FloatArray:
    """(..., 3) centroids of triangles (..., corner, 3)."""
    return np.asarray(corners.reshape(*corners.shape[:-2], 9) @ _THIRDS)


def check_mesh(vertices: ArrayLike, faces: ArrayLike, name: str = "mesh") -> tuple[FloatArray, IntArray]:
    """Check a surface of triangles, open or closed, and return it as float64 and int32.

    Doubled vertices along seams are welded (:func:`rfgen_sionna.scene.vertex_welding.weld_vertices`). Unused vertices
    are dropped. Faces without area are dropped, and a closed surface that faces inwards is reversed, with a warning.

    Args:
        vertices: (vertex, 3) positions [m]: an array, or a torch tensor, which is detached.
        faces: (face, 3) vertex indices, counter-clockwise from outside.
        name: name of the mesh in messages.

    Raises:
        MeshError: the mesh is empty or not of triangles, a coordinate is NaN, infinite, masked or above
            `MAX_COORDINATE`, an index has no vertex, more than two faces share an edge, or neighbouring faces have
            opposite orientations.
    """
    points = _vertex_array(vertices, name)
    triangles = _face_array(faces, len(points), name)
    _check_used_vertices(points, triangles, name)
    area = 0.5 * np.linalg.norm(face_normals(points, triangles), axis=1)
    extent = float(np.ptp(points[triangles.ravel()], axis=0).max())
    # A smaller triangle's normal is rounding noise: float64 resolves 1e-16 of a coordinate.
    reach = float(np.abs(points[triangles.ravel()]).max())
    keep = area > max(1e-14 * extent * extent, 1e-15 * reach * extent)
    if not keep.all():
        dropped = int(np.count_nonzero(~keep))
        if dropped == len(triangles):
            raise MeshError(f"{name}: all {dropped} faces have zero area")
        warnings.warn(f"{name}: dropped {dropped} of {len(triangles)} faces, their area is zero", stacklevel=3)
        triangles = triangles[keep]
    triangles = _check_edges(points, weld_vertices(triangles, [points]), name)
    used, triangles = used_vertices(triangles)
    return points[used], triangles


def check_soup(vertices: ArrayLike, faces: ArrayLike, name: str) -> tuple[FloatArray, IntArray]:
    """Check triangles of a scene, whose two sides are alike, and return them as of :func:`check_mesh`.

    Edges of more than two faces and any orientation are allowed. Faces without area are dropped without a warning.

    Raises:
        MeshError: there are no triangles with an area, a coordinate is not finite or an index has no vertex.
    """
    points = _vertex_array(vertices, name)
    triangles = _face_array(faces, len(points), name)
    _check_used_vertices(points, triangles, name)
    triangles = np.ascontiguousarray(triangles[lengths(face_normals(points, triangles)) > 0.0])
    if not len(triangles):
        raise MeshError(f"{name}: all {np.shape(faces)[0]} faces have zero area")
    used, triangles = used_vertices(weld_vertices(triangles, [points]))
    return points[used], triangles


def _vertex_array(vertices: ArrayLike, name: str) -> FloatArray:
    points = _numeric(vertices, f"{name}: vertices")
    if points.ndim != 2 or points.shape[1] != 3:
        raise MeshError(f"{name}: vertices have shape {points.shape}, (vertex, 3) is needed")
    if len(points) == 0:
        raise MeshError(f"{name}: the mesh is empty, it has no vertices")
    return points.astype(np.float64)


def _check_used_vertices(points: FloatArray, triangles: IntArray, name: str) -> None:
    """Refuse NaN, infinite or too large coordinates of used vertices."""
    used = np.arange(len(points))[used_vertices(triangles)[0]]
    places = points[used]
    limit = f"; coordinates of at most {MAX_COORDINATE:g} m are allowed"
    for wrong, what, needed in (
        (~np.isfinite(places).all(axis=1), "NaN or infinite", ""),
        ((np.abs(places) > MAX_COORDINATE).any(axis=1), "too far off", limit),
    ):
        bad = used[wrong]
        if len(bad):
            raise MeshError(
                f"{name}: {len(bad)} of {len(points)} vertices are {what}, the first is vertex {bad[0]} "
                f"= {tuple(points[bad[0]].tolist())}{needed}"
            )


def used_vertices(faces: IntArray) -> tuple[NDArray[np.intp] | slice, IntArray]:
    """Indices of the vertices that faces (face, 3) use, ascending, and the faces as indices into those."""
    used = np.zeros(int(faces.max(initial=-1)) + 1, np.bool_)
    used[faces] = True
    if used.all():
        return slice(len(used)), faces
    numbers = np.cumsum(used, dtype=np.int32) - np.int32(1)
    return np.flatnonzero(used), numbers[faces]


def _face_array(faces: ArrayLike, num_vertices: int, name: str) -> IntArray:
    raw = _numeric(faces, f"{name}: faces")
    if raw.size == 0:
        raise MeshError(f"{name}: the mesh is empty, it has no faces")
    if raw.ndim != 2 or raw.shape[1] != 3:
        raise MeshError(
            f"{name}: faces have shape {raw.shape}, only triangles (face, 3) are allowed: split larger polygons first"
        )
    if not (np.isfinite(raw).all() and np.array_equal(raw, np.round(raw))):
        raise MeshError(f"{name}: faces hold values that are not integers")
    outside = np.flatnonzero((raw < 0).any(axis=1) | (raw >= num_vertices).any(axis=1))
    if len(outside):
        raise MeshError(
            f"{name}: {len(outside)} faces use a vertex that does not exist, the first is face {outside[0]} "
            f"= {tuple(int(i) for i in raw[outside[0]])}; indices must lie in 0 … {num_vertices - 1}"
        )
    return np.ascontiguousarray(raw, dtype=np.int32)


def _numeric(values: Any, what: str) -> np.ndarray[Any, Any]:
    if np.ma.is_masked(values):
        raise MeshError(f"{what}: {np.ma.count_masked(values)} values are masked, fill them or leave them out")
    if hasattr(values, "detach") and hasattr(values, "cpu"):
        values = values.detach().cpu()
    try:
        array = np.asarray(values)
    except ValueError:
        raise MeshError(f"{what} are ragged: every row needs three numbers") from None
    if array.size and not (np.issubdtype(array.dtype, np.integer) or np.issubdtype(array.dtype, np.floating)):
        raise MeshError(f"{what} are of type {array.dtype}, numbers are needed")
    return array


def _check_edges(points: FloatArray, triangles: IntArray, name: str) -> IntArray:
    start = triangles.ravel()
    end = triangles[:, [1, 2, 0]].ravel()
    forward = start < end
    low, high = np.where(forward, start, end), np.where(forward, end, start)
    _, first, inverse, uses = np.unique(
        low.astype(np.int64) * len(points) + high, return_index=True, return_inverse=True, return_counts=True
    )
    crowded = np.flatnonzero(uses > 2)
    if len(crowded):
        edge = first[crowded].min()
        raise MeshError(
            f"{name}: not manifold, {len(crowded)} edges are shared by more than two faces; the first joins vertices "
            f"{low[edge]} and {high[edge]}"
            f"{_duplicate_faces(triangles) or ' (Edge Split of Blender or unmerge_vertices of trimesh parts them)'}"
        )
    # Two faces of one orientation run through their edge in opposite directions.
    balance = np.bincount(inverse, weights=np.where(forward, 1.0, -1.0), minlength=len(uses))
    twisted = np.flatnonzero((uses == 2) & (balance != 0))
    if len(twisted):
        edge = first[twisted].min()
        raise MeshError(
            f"{name}: neighbouring faces are oriented against each other at {len(twisted)} edges; the first joins "
            f"vertices {low[edge]} and {high[edge]}"
            f"{_duplicate_faces(triangles) or ' (trimesh.repair.fix_winding orients a mesh)'}"
        )
    if (uses == 2).all() and _signed_volume(points, triangles) < 0.0:
        warnings.warn(f"{name}: the faces point inwards, their orientation was reversed", stacklevel=4)
        return np.ascontiguousarray(triangles[:, ::-1])
    return triangles


def _duplicate_faces(triangles: IntArray) -> str:
    """Clause about faces with the same vertices as others; empty without such faces."""
    smallest = triangles.argmin(axis=1)[:, None]
    turned = np.take_along_axis(triangles, (smallest + np.arange(3)) % 3, axis=1)  # the same face, the same row
    again = len(triangles) - len(np.unique(np.sort(triangles, axis=1), axis=0))
    opposite = again - (len(triangles) - len(np.unique(turned, axis=0)))
    if not again:
        return ""
    sides = f", {opposite} of them reversed, as in a sheet of two sides" if opposite else ""
    return f"; {again} of {len(triangles)} faces are there a second time{sides}: leave one of each"


def _signed_volume(points: FloatArray, triangles: IntArray) -> float:
    centred = points - points[triangles.ravel()].mean(axis=0)
    a, b, c = (centred[triangles[:, i]] for i in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6.0
