"""Positions of facets at several times, and whether they face the radar."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.kernels import FrozenKernel, concatenate_aligned, drjit_types, upload
from rfgen_sionna.tracing.surface.return_estimates import estimate_returns
from rfgen_sionna.tracing.surface.tessellate import Tessellation


class PlacedFacets(NamedTuple):
    """Facets at several times."""

    corners: FloatArray
    """(time, facet, 3, 3) corners of the flat triangle [m]"""
    centroids: FloatArray
    """(time, facet, 3) [m]"""
    towards: NDArray[np.bool_]
    """(time, facet) whether the face's front faces the radar."""
    return_estimate: FloatArray
    """(time, facet) estimated return of the flat triangle, by :func:`estimate_returns`."""


def place_facets(
    piece: Tessellation,
    faces: IntArray,
    vertices: Sequence[FloatArray],
    viewpoint: FloatArray,
    wavenumber: float,
) -> PlacedFacets:
    """Place the facets of a `piece` of a mesh with `faces` (face, 3) and `vertices` (vertex, 3) [m] at every time. The
    radar is at `viewpoint` (3,) [m], the `wavenumber` in rad/m."""
    times, count = len(vertices), len(piece.face)
    if not count:
        nothing = np.zeros((times, 0))
        return PlacedFacets(np.zeros((times, 0, 3, 3)), np.zeros((times, 0, 3)), nothing > 0, nothing)
    dr, types = drjit_types()
    Float, UInt32 = types.Float64, types.UInt32
    found = [dr.empty(Float, size * times * count) for size in (9, 3, 1)]
    towards = dr.empty(UInt32, times * count)
    given: dict[str, Any] = {
        "lanes": dr.arange(UInt32, times * count),
        "facets": dr.opaque(UInt32, count),
        "points": dr.opaque(UInt32, len(vertices[0])),
        "vertices": upload(Float, concatenate_aligned(vertices)),
        "faces": upload(UInt32, faces),
        "radar": upload(Float, [*viewpoint, wavenumber]),
        "found": found,
        "towards": towards,
    }
    if not piece.are_the_faces(len(faces)):
        given["face"] = upload(UInt32, piece.face)
        if len(piece.pieces):
            given["weights"] = upload(Float, piece.weights)
    _PLACED(given)
    corners, centroids, return_estimate = (each.numpy() for each in found)
    shape = times, count
    return PlacedFacets(
        corners.reshape(*shape, 3, 3),
        centroids.reshape(*shape, 3),
        towards.numpy().reshape(shape) > 0,
        return_estimate.reshape(shape),
    )


def _place(given: dict[str, Any]) -> None:
    """Kernel of :func:`place_facets`."""
    dr, types = drjit_types()
    Float, UInt32, lane = types.Float64, types.UInt32, given["lanes"]
    time, facet = lane // given["facets"], lane % given["facets"]
    face = dr.gather(UInt32, given["face"], facet) if "face" in given else facet
    radar = [dr.gather(Float, given["radar"], UInt32(k)) for k in range(4)]
    ends = [time * given["points"] + dr.gather(UInt32, given["faces"], 3 * face + k) for k in range(3)]
    corners = [[dr.gather(Float, given["vertices"], 3 * each + axis) for each in ends] for axis in range(3)]

    def from_radar(points: list[list[Any]]) -> list[list[Any]]:
        return [[each - start for each in axis] for axis, start in zip(points, radar[:3], strict=True)]

    # The face as a whole decides: for pieces near its edge rounding would.
    a, b, c = zip(*from_radar(corners), strict=True)
    volume = sum(a[i] * (b[i - 2] * c[i - 1] - b[i - 1] * c[i - 2]) for i in range(3))
    if "weights" in given:
        weights = [[dr.gather(Float, given["weights"], 9 * facet + 3 * k + m) for m in range(3)] for k in range(3)]
        corners = [[sum(w * each for w, each in zip(row, axis, strict=True)) for row in weights] for axis in corners]
    of_corners, of_centroids, of_estimate = given["found"]

    def write(values: Any, where: Any, place: Any) -> None:
        dr.scatter(where, values, place, mode=dr.ReduceMode.Permute)

    for axis in range(3):
        for k in range(3):
            write(corners[axis][k], of_corners, 9 * lane + 3 * k + axis)
        write((corners[axis][0] + corners[axis][1] + corners[axis][2]) / 3.0, of_centroids, 3 * lane + axis)
    write(estimate_returns(from_radar(corners), radar[3]), of_estimate, lane)
    write(dr.select(volume < 0, UInt32(1), UInt32(0)), given["towards"], lane)
    dr.eval(*given["found"], given["towards"])


_PLACED = FrozenKernel(_place)
