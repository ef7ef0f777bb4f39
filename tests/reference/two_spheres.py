"""Slow, readable oracle for what returns by way of two metal spheres: geometrical optics at the first, dense quadrature
of physical optics over the second.

Nothing is shared with the ray mode: where the first sphere reflects is found for each point of the second one by
bisection in the plane of the source, the point and the centre (Alhazen's problem), and the wave spreads from there with
the textbook's two radii of curvature (Balanis, Advanced Engineering Electromagnetics, section 13.2).
"""

from __future__ import annotations

import numpy as np

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray
from tests.reference.physical_optics import dot, obliquity


def _unit(vectors: FloatArray) -> FloatArray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def reflection_points(centre: FloatArray, radius: float, source: FloatArray, points: FloatArray) -> FloatArray:
    """(point, 3) where a sphere reflects a ray from `source` (3,) to `points` (point, 3)."""
    one, other = _unit(source - centre), _unit(points - centre)
    opening = np.arccos(np.clip(dot(one, other), -1, 1))
    across = other - dot(one, other) * one
    across = across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-300)
    low, high = np.zeros_like(opening), opening.copy()
    for _ in range(60):
        angle = 0.5 * (low + high)
        normal = np.cos(angle) * one + np.sin(angle) * across
        place = centre + radius * normal
        # Steeper towards the source than towards the point: the angle is too small.
        small = dot(_unit(source - place), normal) > dot(_unit(points - place), normal)
        low, high = np.where(small, angle, low), np.where(small, high, angle)
    return centre + radius * (np.cos(angle) * one + np.sin(angle) * across)


def by_way_of(
    first: tuple[FloatArray, float],
    second: tuple[FloatArray, float],
    tx: FloatArray,
    rx: FloatArray,
    tx_field: FloatArray,
    rx_field: FloatArray,
    frequency: float,
    n: int = 500,
    taper: float = 0.0,
) -> complex:
    """Channel from `tx` by the `first` sphere (centre, radius), then the `second`, to `rx`: (j / 4 pi) integral of
    F exp(-j k (L + R)) spread / R over what of the second sphere both see.

    Where light falls in below a cosine of `taper` the integrand falls off smoothly, with two derivatives: then nothing
    comes from the rims of what is seen, where physical optics invents something, and what is left is the stationary
    place's, to all orders."""
    k = 2 * np.pi * frequency / SPEED_OF_LIGHT
    centre, radius = second
    axis = _unit(_unit(first[0] - centre) + _unit(rx - centre))
    side = _unit(np.cross(axis, [0.3, 0.5, 0.8]))
    node, weight = np.polynomial.legendre.leggauss(n)
    polar = 0.25 * np.pi * (node + 1)
    azimuth = (np.arange(2 * n) + 0.5) * np.pi / n
    ring = np.cos(azimuth)[:, None] * side + np.sin(azimuth)[:, None] * np.cross(axis, side)
    normal = (np.cos(polar)[:, None, None] * axis + np.sin(polar)[:, None, None] * ring).reshape(-1, 3)
    area = np.repeat(radius**2 * np.sin(polar) * 0.25 * np.pi * weight, 2 * n) * np.pi / n
    points = centre + radius * normal
    place = reflection_points(*first, tx, points)
    mirror = (place - first[0]) / first[1]
    k_1, k_2, k_out = _unit(place - tx), _unit(points - place), _unit(rx - points)
    s_1, s_2, r = (np.linalg.norm(x, axis=1, keepdims=True) for x in (place - tx, points - place, rx - points))
    cos = -dot(k_1, mirror)
    # Lit by the first sphere, seen by the receiver, and the reflection is on the side of the first that Tx sees.
    unoccluded = (dot(k_2, normal) < 0) & (dot(k_out, normal) > 0) & (cos > 0) & (dot(k_2, mirror) > 0)
    cos = np.maximum(cos, 1e-9)
    rho = [1 / (1 / s_1 + patch) for patch in (2 / (first[1] * cos), 2 * cos / first[1])]
    spread = np.sqrt(rho[0] * rho[1] / ((rho[0] + s_2) * (rho[1] + s_2))) / s_1
    field = _unit(tx_field - dot(tx_field, k_1) * k_1)
    field = 2 * dot(field, mirror) * mirror - field  # a conductor
    e_out = _unit(rx_field - dot(rx_field, k_out) * k_out)
    f = obliquity(normal, k_2, field, k_out, e_out, complex(np.inf), 1.0)
    if taper:
        for aslant in (-dot(k_2, normal), dot(k_out, normal), cos, dot(k_2, mirror)):
            x = np.clip(aslant / taper, 0, 1)
            f = f * (x**3 * (10 - 15 * x + 6 * x**2)).reshape(f.shape)
    values = np.where(unoccluded, f * spread * np.exp(-1j * k * (s_1 + s_2 + r)) / r, 0.0)
    return complex(1j / (4 * np.pi) * (values[:, 0] * area).sum())
