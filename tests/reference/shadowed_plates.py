"""Slow, readable oracle for half shadow: physical optics of metal triangles behind convex bodies, each pair of elements
with its own shadows.

What an element does not see of a triangle is a convex polygon in its plane, the hull of the body's corners as they are
cast there. What a pair sees is the triangle without both, cut into triangles and integrated to the last digit.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import ConvexHull

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray
from rfgen_sionna.radar import Radar
from tests.reference.physical_optics import po_gain

TINY = 1e-14


def split(polygon: FloatArray, normal: FloatArray, offset: float) -> tuple[FloatArray | None, FloatArray | None]:
    """What of a convex `polygon` (corner, 2) lies where normal . x is at most the offset, and what beyond."""
    height = polygon @ normal - offset
    height[np.abs(height) < 1e-12] = 0.0  # corners on the line are on both sides
    parts: tuple[list[FloatArray], list[FloatArray]] = [], []
    for k, (here, h) in enumerate(zip(polygon, height, strict=True)):
        there, other = polygon[(k + 1) % len(polygon)], height[(k + 1) % len(polygon)]
        for part, there_too in zip(parts, (h <= 0, h >= 0), strict=True):
            if there_too:
                part.append(here)
        if h * other < 0:
            for part in parts:
                part.append(here + (there - here) * h / (h - other))
    inside, outside = (np.array(part) if len(part) > 2 else None for part in parts)
    return inside, outside


def without(polygons: Sequence[FloatArray], shadow: FloatArray) -> list[FloatArray]:
    """What a convex `shadow` (corner, 2), counterclockwise, leaves of convex polygons."""
    left = []
    for polygon in polygons:
        rest: FloatArray | None = polygon
        for start, stop in zip(shadow, np.roll(shadow, -1, axis=0), strict=True):
            along = stop - start
            if rest is None or np.hypot(*along) < 1e-12:
                continue
            normal = np.array([along[1], -along[0]]) / np.hypot(*along)
            rest, beyond = split(rest, normal, float(normal @ start))
            if beyond is not None:
                left.append(beyond)
    return left


def returned(
    radar: Radar, triangles: Sequence[FloatArray], occluders: Sequence[FloatArray], points_per_wavelength: float = 6.0
) -> ComplexArray:
    """(tx, rx) channel by way of metal `triangles` (corner, 3), of the side that looks at the radar, behind convex
    bodies with corners `occluders` (corner, 3) [m].

    Raises
    ------
    ValueError
        If a body is on both sides of a triangle's plane, or not before the elements.
    """
    elements = np.concatenate([radar.tx_world, radar.rx_world])
    wavelength = SPEED_OF_LIGHT / radar.center_frequency
    total = np.zeros((len(radar.tx_world), len(radar.rx_world)), np.complex128)
    for corners in triangles:
        normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        normal *= np.sign((elements.mean(axis=0) - corners[0]) @ normal) / np.linalg.norm(normal)
        across = (corners[1] - corners[0]) / np.linalg.norm(corners[1] - corners[0])
        axes = np.stack([across, np.cross(normal, across)])
        shadows = []
        for element in elements:
            own, high = [], (element - corners[0]) @ normal
            for body in occluders:
                height = (body - corners[0]) @ normal
                if (height <= 0).all():
                    continue
                if (height <= 0).any() or (height >= high).any():
                    raise ValueError("hiders: a body is not between the radar and a triangle's plane")
                cast = element + (high / (high - height))[:, None] * (body - element) - corners[0]
                flat = cast @ axes.T
                own.append(flat[ConvexHull(flat).vertices])
            shadows.append(own)
        for i, tx in enumerate(radar.tx_world):
            for j, rx in enumerate(radar.rx_world):
                unoccluded = [(corners - corners[0]) @ axes.T]
                for shadow in shadows[i] + shadows[len(radar.tx_world) + j]:
                    unoccluded = without(unoccluded, shadow)
                for polygon in unoccluded:
                    for k in range(1, len(polygon) - 1):
                        piece = polygon[[0, k, k + 1]]
                        (a, b), (c, d) = piece[1] - piece[0], piece[2] - piece[0]
                        if abs(a * d - b * c) < TINY:
                            continue
                        side = np.linalg.norm(piece - np.roll(piece, 1, axis=0), axis=1).max()
                        n = int(np.clip(points_per_wavelength * side / wavelength, 8, 400))
                        ends = (corners[0] + piece @ axes)[None]
                        total[i, j] += po_gain(
                            ends, tx, rx, radar.tx_field, radar.rx_field, radar.center_frequency, n=n
                        )
    return total
