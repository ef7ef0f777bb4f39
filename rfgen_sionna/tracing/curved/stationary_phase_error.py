"""Error of geometrical optics at a specular double bounce.

At a point with phase k (h x^2 / 2 + c x^3 / 6 + q x^4 / 24) and amplitude a (1 + e x^2 / 2 + ...) the integral follows
from h alone, up to terms of the order 1 / k. The first of them, over each principal direction with unit x where the
quadratic phase is half a radian, are

    7.5 C^2 -+ 3 Q + E -+ 3 O C,

C and Q are the cubic and quartic phase at x = 1, O and E the odd and even change of the amplitude (R. Wong, Asymptotic
Approximations of Integrals, 2001, section II.3). An edge or shadow at distance x leaves an error of half the return at
x = 0 and of sqrt(1 / (2 pi)) / x beyond, the asymptote of Fresnel's integral.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.curved.arriving_waves import ArrivingWave, tangents
from rfgen_sionna.tracing.curved.double_bounces import DoubleBounces

EDGE_OFFSETS = (1.0, 2.0, 4.0)
"""Offsets of the edge tests, in units of x."""
MAX_OFFSET = 0.3
"""Most offset, as a share of the shortest leg."""
SURFACE_OFFSET, SURFACE_SLOPE = 2e-3, 0.25
"""Tolerated distance of the surface from its osculating quadric: constant [m] and share of the offset."""


def stationary_phase_errors(
    double_bounces: DoubleBounces, arrival: ArrivingWave, source: FloatArray, wavenumber: float, rays: RayScene
) -> FloatArray:
    """(double bounce,) relative error of each return, 0 … 1, for the phase centre at `source` (3,) [m] with the
    `arrival`; `wavenumber` [rad/m]."""
    count = len(double_bounces)
    if count == 0:
        return np.zeros(0)
    size, vectors = np.linalg.eigh(arrival.hessian)
    most = MAX_OFFSET * np.minimum.reduce(
        [lengths(each) for each in _legs(np.moveaxis(double_bounces.point, 1, 0), source)]
    )
    unit = np.minimum(1.0 / np.sqrt(wavenumber * np.maximum(np.abs(size), 1e-12)), most[:, None])
    axes = [tangents(double_bounces.normal[:, i]) @ vectors[:, 2 * i : 2 * i + 2] for i in range(2)]
    steps = np.moveaxis(np.stack(axes), 3, 0) * unit.T[:, None, :, None]  # (direction, point, double bounce, 3)
    length, amplitude = _path_length(double_bounces, np.zeros_like(steps[0]), source)
    higher = np.where((unit >= most[:, None]).any(axis=1), 1.0, 0.0)  # flat as far as its curvature is valid
    for along, step in enumerate(steps):
        (there, gain), (back, loss) = (_path_length(double_bounces, sign * step, source) for sign in (1.0, -1.0))
        odd, even = 0.5 * wavenumber * (there - back), wavenumber * (0.5 * (there + back) - length)
        change, edge_curvature = 0.5 * (gain - loss) / amplitude, 0.5 * (gain + loss) / amplitude - 1.0
        sign = np.sign(size[:, along])
        quartic = even - 0.5 * wavenumber * size[:, along] * unit[:, along] ** 2
        higher += np.abs(7.5 * odd**2 - 3.0 * sign * quartic + edge_curvature - 3.0 * sign * change * odd)
    around = np.concatenate([EDGE_OFFSETS, -np.array(EDGE_OFFSETS)])
    offsets = np.einsum("x,aigk->ixagk", around, steps).reshape(2, -1, 3)
    times = offsets.shape[1] // count
    lies = _on_surfaces(double_bounces.take(np.tile(np.arange(count), times)), offsets, source, rays).reshape(
        len(around), -1, count
    )
    ends = np.minimum(0.5, 1.0 / (np.sqrt(2.0 * np.pi) * np.abs(around)))
    edges = np.where(lies, 0.0, ends[:, None, None]).max(axis=(0, 1))
    return np.asarray(np.minimum(np.hypot(higher, edges), 1.0))


def _legs(points: FloatArray, source: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(double bounce, 3) the three legs by `points` (2, double bounce, 3) [m]."""
    return points[0] - source, points[1] - points[0], source - points[1]


def _displaced(double_bounces: DoubleBounces, step: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(2, double bounce, 3) points [m] on the two surfaces at `step` (2, double bounce, 3) [m] from the specular
    points, by curvature and its gradient, and normals there."""
    points, normals = np.empty_like(step), np.empty_like(step)
    for i, d in enumerate(step):
        turn = np.einsum("gij,gj->gi", double_bounces.curvature[:, i], d)
        edge_curvature = np.einsum("gi,gi->g", turn, d)
        curvature_gradient = np.einsum("gkij,gk,gi,gj->g", double_bounces.curvature_gradient[:, i], d, d, d)
        fall = (
            0.5 * edge_curvature
            + curvature_gradient / 6.0
            + edge_curvature**3 / (8.0 * np.maximum((d**2).sum(axis=1), 1e-30))
        )
        points[i] = double_bounces.point[:, i] + d - fall[:, None] * double_bounces.normal[:, i]
        normals[i] = double_bounces.normal[:, i] + turn
        normals[i] /= np.maximum(lengths(normals[i]), 1e-12)[:, None]
    return points, normals


def _path_length(double_bounces: DoubleBounces, step: FloatArray, source: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(double bounce,) path length [m] by points at `step` (2, double bounce, 3) [m] from the specular points, and the
    physical-optics amplitude there: two cosines over three legs."""
    points, normals = _displaced(double_bounces, step)
    spans = _legs(points, source)
    reach = [np.maximum(lengths(each), 1e-9) for each in spans]
    legs = [each / size[:, None] for each, size in zip(spans, reach, strict=True)]
    amplitude = 1.0 / np.prod(reach, axis=0)
    for normal, before, after in zip(normals, legs, legs[1:], strict=False):
        amplitude *= 0.5 * np.einsum("gi,gi->g", after - before, normal)
    return np.sum(reach, axis=0), amplitude


def _on_surfaces(
    double_bounces: DoubleBounces, step: FloatArray, source: FloatArray, rays: RayScene
) -> NDArray[np.bool_]:
    """(double bounce,) whether both surfaces exist at `step` (2, double bounce, 3) [m], visible from the `source` and
    from each other."""
    points, normals = _displaced(double_bounces, step)
    margin = SURFACE_OFFSET + SURFACE_SLOPE * np.sqrt((step**2).sum(axis=2)).max(axis=0)
    away, count = points + SURFACE_OFFSET * normals, len(double_bounces)
    origins = np.concatenate([np.broadcast_to(source, (count, 3))] * 2 + [away[0]])
    ends = np.concatenate([points[0], points[1], points[1]])
    span = ends - origins
    reach = np.maximum(lengths(span), 1e-9)
    hit = rays.first_hit(origins, span / reach[:, None])
    there = (hit.facet >= 0) & (np.abs(hit.distance - reach) < np.tile(margin, 3))
    return np.asarray(there.reshape(3, count).all(axis=0))
