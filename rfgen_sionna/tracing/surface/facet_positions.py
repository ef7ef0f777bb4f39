"""Positions of facets at several times, whether they face the radar, and estimates of their returns.

Estimates take `corners` relative to the radar, axis by axis and corner by corner: an array (axis, corner, facet) [m],
or nine arrays of Dr.Jit.
"""

from __future__ import annotations

from collections.abc import Sequence
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.kernels import FrozenKernel, concatenate_aligned, drjit_types, upload
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
    return_bound: FloatArray
    """(time, facet) bound of the return of the bent facet."""


def place_facets(
    piece: Tessellation,
    faces: IntArray,
    vertices: Sequence[FloatArray],
    viewpoint: FloatArray,
    wavenumber: float,
    turn: FloatArray | None = None,
) -> PlacedFacets:
    """Place the facets of a `piece` of a mesh with `faces` (face, 3) and `vertices` (vertex, 3) [m] at every time. The
    radar is at `viewpoint` (3,) [m], the `wavenumber` in rad/m, and `turn` (face,) the bend of faces by
    :meth:`rfgen_sionna.tracing.surface.smoothing.Smoothing.turn`; None means flat faces."""
    times, count = len(vertices), len(piece.face)
    if not count:
        nothing = np.zeros((times, 0))
        return PlacedFacets(np.zeros((times, 0, 3, 3)), np.zeros((times, 0, 3)), nothing > 0, nothing, nothing)
    dr, types = drjit_types()
    Float, UInt32 = types.Float64, types.UInt32
    found = [dr.empty(Float, size * times * count) for size in ((9, 3, 1) if turn is None else (9, 3, 1, 1))]
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
    if turn is not None:
        given["turn"] = upload(Float, turn)
    _PLACED(given)
    corners, centroids, return_estimate, *return_bound = (each.numpy() for each in found)
    shape = times, count
    return PlacedFacets(
        corners.reshape(*shape, 3, 3),
        centroids.reshape(*shape, 3),
        towards.numpy().reshape(shape) > 0,
        return_estimate.reshape(shape),
        (return_bound[0] if return_bound else return_estimate).reshape(shape),
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
    of_corners, of_centroids, of_estimate, *of_bound = given["found"]

    def write(values: Any, where: Any, place: Any) -> None:
        dr.scatter(where, values, place, mode=dr.ReduceMode.Permute)

    for axis in range(3):
        for k in range(3):
            write(corners[axis][k], of_corners, 9 * lane + 3 * k + axis)
        write((corners[axis][0] + corners[axis][1] + corners[axis][2]) / 3.0, of_centroids, 3 * lane + axis)
    write(estimate_returns(from_radar(corners), radar[3]), of_estimate, lane)
    if of_bound:
        turn = dr.gather(Float, given["turn"], face)
        write(estimate_returns(from_radar(corners), radar[3], 0.0, turn), of_bound[0], lane)
    write(dr.select(volume < 0, UInt32(1), UInt32(0)), given["towards"], lane)
    dr.eval(*given["found"], given["towards"])


_PLACED = FrozenKernel(_place)


def estimate_returns(corners: Any, wavenumber: Any, aside: Any = 0.0, turn: Any = None) -> Any:
    """(facet,) estimated returns up to a common factor: solid angle times :func:`mean_phasor`. With `turn` (facet,),
    the largest chord between the unit normals of a corner and of the flat facet, it is a bound: cosines exceed those of
    the flat facet by as much at most."""
    angles = abs(solid_angles(corners))
    if turn is not None:
        angles = angles + turn * facing_solid_angles(corners)
    return angles * mean_phasor(corners, wavenumber, aside)


def off_axis_phase(corners: Any, wavenumber: float, aperture: float) -> Any:
    """(facet,) bound of the change of the two-way phase [rad] over facets between elements within `aperture` [m]."""
    width, distance = width_and_distance(corners)
    return wavenumber * aperture * width / _array_module(width).maximum(distance, 1e-9)


def width_and_distance(corners: Any) -> tuple[Any, Any]:
    """(facet,) longest edge, and distance of the nearest corner [m]."""
    m = _array_module(corners[0][0])
    square = 0.0
    for k in range(3):
        x, y, z = (axis[k] - axis[k - 1] for axis in corners)
        square = m.maximum(square, x * x + y * y + z * z)
    near = _squares(corners)
    return m.sqrt(square), m.sqrt(m.minimum(m.minimum(near[0], near[1]), near[2]))


def solid_angles(corners: Any) -> Any:
    """(facet,) solid angles [sr] in the far field, negative for facets that face away."""
    m = _array_module(corners[0][0])
    a, one, other = ([axis[k] - (axis[0] if k else 0.0) for axis in corners] for k in range(3))
    volume = sum(a[i] * (one[i - 2] * other[i - 1] - one[i - 1] * other[i - 2]) for i in range(3))
    x, y, z = (axis[0] + axis[1] + axis[2] for axis in corners)
    square = m.maximum(x * x + y * y + z * z, 1e-18)  # of three times the distance of the middle
    return -13.5 * volume / (square * m.sqrt(square))


def facing_solid_angles(corners: Any) -> Any:
    """(facet,) solid angles [sr] of the facets turned to the radar."""
    m = _array_module(corners[0][0])
    one, other = ([axis[k] - axis[0] for axis in corners] for k in (1, 2))
    x, y, z = (one[i - 2] * other[i - 1] - one[i - 1] * other[i - 2] for i in range(3))
    a, b, c = (axis[0] + axis[1] + axis[2] for axis in corners)
    return 4.5 * m.sqrt(x * x + y * y + z * z) / m.maximum(a * a + b * b + c * c, 1e-18)


def mean_phasor(corners: Any, wavenumber: Any, aside: Any = 0.0) -> Any:
    """(facet,) estimated two-way mean phasor's magnitude, with phases [rad] less by `aside` (facet,). With phases a < b
    < c at the corners it is 2 / (c - a) times the difference of two phasors of lengths sinc((b - a) / 2) and sinc((c -
    b) / 2) (:mod:`rfgen_sionna.tracing.integral.simplex`): an edge across the wave returns more than a corner."""
    m = _array_module(corners[0][0])
    x, y, z = (m.sqrt(each) for each in _squares(corners))
    near, far = m.minimum(m.minimum(x, y), z), m.maximum(m.maximum(x, y), z)
    # Half the phases of the two-way path.
    total, first = wavenumber * (far - near), wavenumber * (x + y + z - 2.0 * near - far)
    second = total - first
    if not isinstance(aside, float) or aside:
        total, first, second = (m.maximum(each - 0.5 * aside, 0.0) for each in (total, first, second))
    edges = m.sqrt(1.0 / (1.0 + first * first) + 1.0 / (1.0 + second * second))
    return m.minimum(1.0, edges / m.maximum(total, 1e-9))


def _squares(corners: Any) -> list[Any]:
    """Squared distances of the three corners."""
    x, y, z = corners
    return [x[k] * x[k] + y[k] * y[k] + z[k] * z[k] for k in range(3)]


def _array_module(values: FloatArray | Any) -> ModuleType:
    """Module with `sqrt`, `minimum` and `maximum` for the array type."""
    if isinstance(values, np.ndarray):
        return np
    import drjit

    return drjit
