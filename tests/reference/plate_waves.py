"""Slow, readable oracle for corner reflectors: physical optics on every plate, by dense quadrature in float64.

The field at each plate induces its currents as if it were part of a plane, and these radiate on to the next one,
whatever the angles and distances: outlines diffract on all plates, not only on the last. Nothing is hidden.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise, product

import numpy as np

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray
from tests.reference.corners import Side

ROWS = 512


def nodes(side: Side, n: int) -> tuple[FloatArray, FloatArray]:
    """(point, 3) [m] and (point,) weights [m^2] of Gauss-Legendre quadrature, which is dense where plates meet."""
    place, weight = np.polynomial.legendre.leggauss(n)
    a, b = (each.ravel() for each in np.meshgrid(0.5 * (place + 1), 0.5 * (place + 1), indexing="ij"))
    share = 0.25 * np.outer(weight, weight).ravel()
    if side.triangle:  # a square folded onto one corner of its own
        b, share = b * (1 - a), share * (1 - a)
    return side.corner + np.outer(a, side.u) + np.outer(b, side.v), share * np.linalg.norm(np.cross(side.u, side.v))


def radiated(to: FloatArray, points: FloatArray, currents: ComplexArray, k: float) -> ComplexArray:
    """(point, 3) magnetic field at `to` (point, 3) of electric `currents` (source, 3) times area at `points`:
    the sum of grad G x J, G = exp(-jkr) / 4 pi r."""
    moment = np.concatenate([currents, np.cross(points, currents)], axis=1)
    found = []
    for there in np.array_split(to, -(-len(to) // ROWS)):
        square = (there**2).sum(1)[:, None] + (points**2).sum(1) - 2 * there @ points.T
        r = np.sqrt(square)
        kernel = -(1j * k + 1 / r) * (np.cos(k * r) - 1j * np.sin(k * r)) / (4 * np.pi * square)
        both = kernel @ moment  # grad G x J = kernel (there - point) x J
        found.append(np.cross(there, both[:, :3]) - both[:, 3:])
    return np.concatenate(found)


def corner_wave(
    sides: Sequence[Side],
    bounces: int,
    tx: FloatArray,
    rx: FloatArray,
    tx_field: FloatArray,
    rx_field: FloatArray,
    frequency: float,
    n: int,
) -> complex:
    """Channel by way of so many metal plates, n x n points on each; arguments as of
    :func:`tests.reference.corners.corner_gain`."""
    k = 2 * np.pi * frequency / SPEED_OF_LIGHT
    origin = np.mean([side.corner for side in sides], axis=0)  # small numbers have small rounding errors
    tx, rx = tx - origin, rx - origin
    grids = [nodes(side, n) for side in sides]
    points, areas = [each[0] - origin for each in grids], [each[1][:, None] for each in grids]
    normals = [side.normal * np.sign((tx - at[0]) @ side.normal) for side, at in zip(sides, points, strict=True)]

    def sent(place: FloatArray, field: FloatArray, at: FloatArray) -> tuple[FloatArray, ComplexArray]:
        """Directions (point, 3) and electric field (point, 3) of an element."""
        way = at - place
        r = np.linalg.norm(way, axis=1, keepdims=True)
        way = way / r
        across = field - (way @ field)[:, None] * way
        return way, across / np.linalg.norm(across, axis=1, keepdims=True) * np.exp(-1j * k * r) / r

    currents: dict[tuple[int, ...], ComplexArray] = {}
    for number, at in enumerate(points):
        way, field = sent(tx, tx_field, at)
        currents[(number,)] = 2 * np.cross(normals[number], np.cross(way, field)) * areas[number]
    for length in range(2, bounces + 1):
        for to, last in product(range(len(sides)), repeat=2):
            ways = [way for way in currents if len(way) == length - 1 and way[-1] == last and to != last]
            for way in ways:
                magnetic = radiated(points[to], points[last], currents[way], k)
                currents[(*way, to)] = 2 * np.cross(normals[to], magnetic) * areas[to]
    received = [sent(rx, rx_field, at)[1] for at in points]
    total = 0j
    for way, current in currents.items():
        if len(way) == bounces and all(one != other for one, other in pairwise(way)):
            total += (received[way[-1]] * current).sum()
    return complex(-0.5j / (4 * np.pi) * total)
