"""Upper bounds on returns of facets and of shadow boundaries, and error budgets."""

from __future__ import annotations

from typing import Any

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.scene.kernels import FrozenKernel, drjit_types, upload
from rfgen_sionna.scene.mesh import lengths

MAX_BOUNDARY_WIDTH = 0.25
"""Boundary width, over the root of wavelength times distance, up to which it counts fully, and not at all at twice
that: beyond a quarter of a Fresnel zone the surface that far aside is unknown."""


def corners_of(given: dict[str, Any], name: str = "corners") -> list[Any]:
    """Corners of the facets of a kernel's lanes, from the array `name`."""
    dr, types = drjit_types()
    return [
        types.Array3f64(*(dr.gather(types.Float64, given[name], 9 * given["lanes"] + 3 * corner + k) for k in range(3)))
        for corner in range(3)
    ]


def max_returns(
    corners: FloatArray, wavenumber: float, other: FloatArray | None = None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(facet,) bounds on whole facets and on cut ones, up to a common factor, and the two-way phase range [rad].

    The bound is the facet's solid angle. A whole facet's integral falls with the square of its phase range, an integral
    along a straight edge with the phase range. `corners` are (facet, 3, 3) [m] from the radar, `wavenumber` is in
    [rad/m]; `other` (facet, 3, 3) [m] are the corners from the other leg's end, None repeats `corners`.
    """
    count = len(corners)
    if not count:
        nothing = np.zeros(0)
        return nothing, nothing, nothing
    dr, types = drjit_types()
    found = [dr.empty(types.Float64, count) for _ in range(3)]
    given = {
        "lanes": dr.arange(types.UInt32, count),
        "corners": upload(types.Float64, corners),
        "wavenumber": dr.opaque(types.Float64, wavenumber),
        "found": found,
    }
    if other is not None:
        given["other"] = upload(types.Float64, other)
    _RETURN_BOUNDS(given)
    most, cut, width = (each.numpy() for each in found)
    return most, cut, width


def _bound_returns(given: dict[str, Any]) -> None:
    """Kernel of :func:`max_returns`."""
    dr, _ = drjit_types()
    lane = given["lanes"]
    angles, ways = [], []
    for name in ("corners", "other") if "other" in given else ("corners",):
        a, b, c = corners_of(given, name)
        ways.append([dr.norm(each) for each in (a, b, c)])
        near = dr.maximum(dr.minimum(dr.minimum(ways[-1][0], ways[-1][1]), ways[-1][2]), 1e-9)
        angles.append(abs(dr.dot(a, dr.cross(b - a, c - a))) / (near * near * near))  # twice the solid angle, nearly
    total = [0.5 * (there + back) for there, back in zip(ways[0], ways[-1], strict=True)]
    low, high = (each(each(total[0], total[1]), total[2]) for each in (dr.minimum, dr.maximum))
    turn = given["wavenumber"] * (high - low)
    angle = angles[0] if len(angles) == 1 else dr.sqrt(angles[0] * angles[1])
    for values, where in zip(
        (angle / (1.0 + turn * turn), angle / (1.0 + turn), 2.0 * turn), given["found"], strict=True
    ):
        dr.scatter(where, values, lane, mode=dr.ReduceMode.Permute)
    dr.eval(*given["found"])


_RETURN_BOUNDS = FrozenKernel(_bound_returns)


def max_boundary_returns(
    offset: FloatArray, width: FloatArray, reach: float, occluder_distance: float, wavenumber: float
) -> FloatArray:
    """(facet,) bound on the return beside a boundary along the facet, up to the factor of :func:`max_returns`.

    Elements are within `reach` [m], occluders beyond `occluder_distance` [m]; `offset` (facet, corner, 3) [m] is from
    the viewpoint, `width` (facet,) the phase range [rad].
    """
    distance = np.maximum(lengths(offset).min(axis=1), 1e-9)
    wide = reach * np.maximum(distance / max(occluder_distance, 1e-9) - 1.0, 0.0)
    wide = np.minimum(wide, 2.0 * MAX_BOUNDARY_WIDTH * np.sqrt(2 * np.pi / wavenumber * distance))
    long = lengths(offset - offset[:, [1, 2, 0]]).max(axis=1)
    return np.asarray(2.0 * wide * long / distance**2 / (1.0 + 0.5 * width))


def error_budget(errors: FloatArray, total: float) -> float:
    """Largest error for each of `errors` such that their root sum of squares is `total`."""
    ordered = np.sort(errors) ** 2
    below = np.cumsum(ordered) - ordered
    rest = np.arange(len(ordered), 0, -1)
    enough = np.flatnonzero(below + rest * ordered > total**2)
    if not len(enough):
        return np.inf
    k = enough[0]
    return max(float(np.sqrt((total**2 - below[k]) / rest[k])), 1e-300)
