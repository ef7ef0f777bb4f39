"""Slow, readable oracle for corner reflectors: geometrical optics up to the last plate, dense quadrature over that one.

Every sequence of plates is followed by itself. A point of the last plate is lit where the line to the image of Tx
passes all plates before it, which is asked point by point; nothing is cut, nothing is linear, and Tx and Rx are not
treated alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise, product

import numpy as np

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray
from tests.reference.physical_optics import dot, obliquity


@dataclass(frozen=True)
class Side:
    """A metal parallelogram, or half of one, from a corner along two edges."""

    corner: FloatArray
    u: FloatArray
    v: FloatArray
    triangle: bool = False

    @property
    def normal(self) -> FloatArray:
        normal = np.cross(self.u, self.v)
        return normal / np.linalg.norm(normal)

    def points(self, n: int) -> tuple[FloatArray, float]:
        """(point, 3) middles of a grid of n x n, those inside, and the area that each stands for."""
        place = (np.arange(n) + 0.5) / n
        a, b = (each.ravel() for each in np.meshgrid(place, place))
        if self.triangle:
            a, b = a[a + b < 1], b[a + b < 1]
            area = 0.5 / len(a)
        else:
            area = 1.0 / len(a)
        return self.corner + np.outer(a, self.u) + np.outer(b, self.v), area * np.linalg.norm(np.cross(self.u, self.v))

    def image(self, point: FloatArray) -> FloatArray:
        return point - 2 * dot(point - self.corner, self.normal) * self.normal

    def holds(self, points: FloatArray) -> np.ndarray:
        a, b = np.linalg.lstsq(np.stack([self.u, self.v], axis=1), (points - self.corner).T, rcond=None)[0]
        return (a >= 0) & (b >= 0) & ((a + b <= 1) if self.triangle else (a <= 1) & (b <= 1))


def corner_gain(
    sides: Sequence[Side],
    bounces: int,
    tx: FloatArray,
    rx: FloatArray,
    tx_field: FloatArray,
    rx_field: FloatArray,
    frequency: float,
    n: int = 300,
) -> complex:
    """Channel by way of so many plates; Tx and Rx are on the side that all of them look to."""
    k = 2 * np.pi * frequency / SPEED_OF_LIGHT
    total = 0j
    for sequence in product(sides, repeat=bounces):
        if any(one is other for one, other in pairwise(sequence)):
            continue
        *mirrors, last = sequence
        images = [tx]
        for mirror in mirrors:
            images.append(mirror.image(images[-1]))
        points, area = last.points(n)
        # Backwards from the point: where each leg comes from.
        legs, at = [points], points
        unoccluded = np.ones(len(points), bool)
        for mirror, image in zip(mirrors[::-1], images[:0:-1], strict=True):
            towards = image - at
            share = dot(mirror.corner - at, mirror.normal) / np.where(
                dot(towards, mirror.normal) == 0, np.inf, dot(towards, mirror.normal)
            )
            at = at + share * towards
            unoccluded &= (share[:, 0] > 0) & (share[:, 0] < 1) & mirror.holds(at)
            legs.append(at)
        legs = [leg[unoccluded] for leg in legs]
        if not unoccluded.any():
            continue
        way = [np.broadcast_to(tx, legs[0].shape), *legs[::-1]]
        k_in = [(end - start) / np.linalg.norm(end - start, axis=1, keepdims=True) for start, end in pairwise(way)]
        field = tx_field - dot(tx_field, k_in[0]) * k_in[0]
        field = field / np.linalg.norm(field, axis=1, keepdims=True)
        for mirror in mirrors:  # a conductor keeps the field along its normal and turns the rest
            field = 2 * dot(field, mirror.normal) * mirror.normal - field
        to_rx = rx - way[-1]
        r_out = np.linalg.norm(to_rx, axis=1, keepdims=True)
        k_out = to_rx / r_out
        e_out = rx_field - dot(rx_field, k_out) * k_out
        e_out = e_out / np.linalg.norm(e_out, axis=1, keepdims=True)
        normal = np.where(dot(k_in[-1], last.normal) > 0, -last.normal, last.normal)
        f = obliquity(normal, k_in[-1], field, k_out, e_out, complex(np.inf), 1.0)
        r_in = np.linalg.norm(way[-1] - images[-1], axis=1, keepdims=True)
        total += 1j / (4 * np.pi) * area * (f * np.exp(-1j * k * (r_in + r_out)) / (r_in * r_out)).sum()
    return complex(total)
