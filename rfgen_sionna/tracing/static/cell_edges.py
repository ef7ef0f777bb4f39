"""Outlines of cells of flat faces, as segments that are short enough for one integral each."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.tracing.surface.facets import mix_bits

QUADRATIC_PHASE = 0.5
"""Largest quadratic phase [rad] in the middle of a segment, for an expansion to second order."""
RELATIVE_LENGTH, FOOT_LENGTH = 0.15, 0.5
"""Length of a segment over its distance from the radar, for the pattern gain, and from the foot point."""
_GRID = 1e-6
"""Distance [m] below which two points are one."""
_MAX_SPLITS = 40


class Segments(NamedTuple):
    """Parts of outlines."""

    start: FloatArray
    """(segment, 3) [m] relative to the viewpoint; counter-clockwise seen from the radar."""
    stop: FloatArray
    """(segment, 3) [m]"""
    cell: NDArray[np.intp]
    """(segment,) a cell that each bounds."""

    @property
    def middle(self) -> FloatArray:
        """(segment, 3) [m]"""
        return 0.5 * (self.start + self.stop)

    def take(self, index: NDArray[np.intp]) -> Segments:
        """Those of an `index` (segment,)."""
        return Segments(self.start[index], self.stop[index], self.cell[index])

    def halved(self) -> Segments:
        """Both halves of each."""
        middle = self.middle
        return Segments(
            np.concatenate([self.start, middle]), np.concatenate([middle, self.stop]), np.tile(self.cell, 2)
        )


def towards(corners: FloatArray) -> FloatArray:
    """(cell, 3) unit normals towards the viewpoint of triangles `corners` (cell, 3, 3) [m] relative to it."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(lengths(normal), 1e-30)[:, None]
    return np.asarray(normal * -np.sign(np.einsum("fi,fi->f", normal, corners[:, 0]))[:, None])


def outlines(corners: FloatArray, group: IntArray) -> Segments:
    """Edges of the union of cells `corners` (cell, 3, 3) [m] relative to the viewpoint: those that two coplanar cells
    of one `group` (cell,) share are left out. Cells come from bisection: long edges meet halves of themselves."""
    if not len(corners):
        return Segments(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, np.intp))
    normal = towards(corners)
    front = np.einsum("fi,fi->f", np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), normal) > 0
    turned = np.where(front[:, None, None], corners, corners[:, ::-1])
    plane = np.column_stack([group, np.rint(normal * 1e5), np.rint(np.einsum("fi,fi->f", normal, corners[:, 0]) * 1e4)])
    number = np.unique(plane, axis=0, return_inverse=True)[1].reshape(-1)
    start, stop = turned.reshape(-1, 3), turned[:, [1, 2, 0]].reshape(-1, 3)
    cell = np.repeat(np.arange(len(corners)), 3)
    known = np.unique(_keys(turned.reshape(-1, 3), number[cell]))
    whole: list[tuple[FloatArray, FloatArray, NDArray[np.intp]]] = []
    for _ in range(_MAX_SPLITS):
        middle = 0.5 * (start + stop)
        split = np.isin(_keys(middle, number[cell]), known)
        whole.append((start[~split], stop[~split], cell[~split]))
        start, stop = np.concatenate([start[split], middle[split]]), np.concatenate([middle[split], stop[split]])
        cell = np.tile(cell[split], 2)
        if not len(cell):
            break
    start, stop, cell = (np.concatenate(each) for each in zip(*whole, strict=True))
    one, other = (_keys(each, number[cell]) for each in (start, stop))
    low, high = np.minimum(one, other), np.maximum(one, other)
    key = mix_bits(low + np.uint64(3) * mix_bits(high))
    _, first, edge = np.unique(key, return_index=True, return_inverse=True)
    turns = np.bincount(edge.reshape(-1), np.where(one < other, 1.0, -1.0))
    # Both directions cancel; what remains is taken once, in the direction of the rest.
    kept = np.flatnonzero(turns != 0)
    index = first[kept]
    along = (one[index] < other[index]) == (turns[kept] > 0)
    start, stop = (
        np.where(along[:, None], start[index], stop[index]),
        np.where(along[:, None], stop[index], start[index]),
    )
    return Segments(start, stop, cell[index])


def _keys(points: FloatArray, number: NDArray[np.integer[Any]]) -> NDArray[np.uint64]:
    """(point,) hashes of positions (point, 3) [m] on a grid, and of a `number` (point,)."""
    cells = np.floor(points / _GRID + 0.3217).astype(np.int64).view(np.uint64)
    with np.errstate(over="ignore"):
        found = mix_bits(cells[:, 0] + np.uint64(0x9E3779B97F4A7C15))
        found = mix_bits(found ^ (cells[:, 1] + np.uint64(0x7F4A7C15)))
        found = mix_bits(found ^ (cells[:, 2] + np.uint64(0x9E3779B9)))
        return mix_bits(found + number.astype(np.uint64))


def divide(segments: Segments, normal: FloatArray, wavenumber: float, swing: float, phase: float) -> Segments:
    """The `segments` divided until each has a quadratic phase of at most `phase` [rad] in its middle at `wavenumber`
    [rad/m] and a phase over half the band of at most 1 per `swing` [m]. `normal` (cell, 3) are unit normals."""
    done: list[Segments] = []
    for _ in range(_MAX_SPLITS):
        start, stop = segments.start, segments.stop
        along, middle = stop - start, segments.middle
        length = lengths(along)
        unit = along / np.maximum(length, 1e-30)[:, None]
        distance = lengths(middle)
        beside = np.sqrt(np.maximum(distance**2 - np.einsum("si,si->s", middle, unit) ** 2, 1e-12))
        near = np.maximum(distance - 0.5 * length, beside)
        own = normal[segments.cell]
        from_foot = middle - np.einsum("si,si->s", middle, own)[:, None] * own
        lateral = lengths(from_foot)
        line = np.sqrt(np.maximum(lateral**2 - np.einsum("si,si->s", from_foot, unit) ** 2, 1e-12))
        coarse = wavenumber * beside**2 / near**3 * (0.5 * length) ** 2 > phase
        coarse |= length > RELATIVE_LENGTH * near
        coarse |= length > FOOT_LENGTH * np.maximum(lateral - 0.5 * length, line)
        coarse |= swing * np.abs(lengths(stop) - lengths(start)) > 1.0
        coarse &= length > 1e-4
        done.append(segments.take(np.flatnonzero(~coarse)))
        segments = segments.take(np.flatnonzero(coarse)).halved()
        if not len(segments.cell):
            break
    done.append(segments)
    return Segments(*(np.concatenate(each) for each in zip(*done, strict=True)))
