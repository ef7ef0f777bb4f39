"""Pieces of bent faces, and where rays from the radar go from them: known to within what normals turn by."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.scene.kernels import empty_aligned
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.tracing.curved.double_bounces import unit_normals
from rfgen_sionna.tracing.curved.smoothed_surface import SmoothedSurface

ROUNDING = 2e-3, 1e-5
"""What single precision rounds directions by, and more [rad], and places over their distance."""
NEVER = -1e9
"""In place of a piece's least cosine: rays may leave it at any angle."""
COLUMNS = 24
"""Numbers that kernels know of a piece: middle, radius, outgoing direction, its spread, axis, height of the plane
across that below all of the piece, least cosine to it that rays leave at, bow, corners, distance."""


@dataclass(frozen=True)
class SurfacePatches:
    """Pieces of faces; places are relative to the source."""

    facet: NDArray[np.int64]
    """(piece,) face of the ray scene."""
    weights: FloatArray
    """(piece, corner, vertex) barycentric coordinates of the corners."""
    corners: FloatArray
    """(piece, 3, 3) their places on the smooth surface [m]."""
    normals: FloatArray
    """(piece, 3, 3) unit normals there."""
    middle: FloatArray
    """(piece, 3) of a ball around it [m]."""
    radius: FloatArray
    """(piece,) [m]"""
    out: FloatArray
    """(piece, 3) unit vector in which rays go on, about."""
    spread: FloatArray
    """(piece,) by how much they may differ from that [rad]."""
    rows: NDArray[np.float32]
    """(piece, COLUMNS) for kernels, in single precision, rounded to the safe side."""

    @staticmethod
    def of(
        surface_model: SmoothedSurface, source: FloatArray, facet: NDArray[np.int64], weights: FloatArray
    ) -> SurfacePatches:
        """Of faces `facet` (piece,), with corners at barycentric coordinates `weights` (piece, 3, 3), seen from the
        `source` (3,) [m]."""
        count = len(facet)
        lane, place = np.repeat(facet, 3), weights.reshape(-1, 3)
        corners = surface_model.places(lane, place)[1].reshape(count, 3, 3) - source
        normals = unit_normals(surface_model, lane, place).reshape(count, 3, 3)
        middle = corners.mean(axis=1)
        # What a quadratic patch rises by over a piece goes with the square of the piece's size.
        size = np.abs(weights - weights[:, [1, 2, 0]]).max(axis=(1, 2), initial=0.0)
        edge_curvature = 4 / 3 * size**2 * lengths(surface_model.sagittas[facet]).max(axis=1, initial=0.0)
        radius = lengths(corners - middle[:, None]).max(axis=1, initial=0.0) + edge_curvature
        axis = normals.mean(axis=1)
        axis /= np.maximum(lengths(axis), 1e-9)[:, None]
        turn = np.arccos(np.clip(np.einsum("pci,pi->pc", normals, axis).min(axis=1, initial=1.0), -1.0, 1.0))
        far = np.maximum(lengths(middle), 1e-9)
        towards_source = -middle / far[:, None]
        falls = np.einsum("pi,pi->p", axis, towards_source)
        axis *= np.where(falls < 0, -1.0, 1.0)[:, None]
        out = 2.0 * np.abs(falls)[:, None] * axis - towards_source
        aside = angular_radius(radius / far)
        spread = 2.0 * turn + aside
        # Rays leave at least at this cosine to their own normal, by that much less to the axis.
        least = np.cos(np.minimum(np.arccos(np.minimum(np.abs(falls), 1.0)) + turn + aside + ROUNDING[0], np.pi))
        least -= 2.0 * np.sin(0.5 * np.minimum(turn, np.pi))
        least[least <= 0] = NEVER
        rounded = ROUNDING[1] * far
        level = np.einsum("pi,pci->pc", axis, corners).min(axis=1, initial=np.inf) - edge_curvature - rounded
        rows = np.column_stack([
            middle, radius + rounded, out, spread + ROUNDING[0], axis, level, least, edge_curvature + rounded,
            corners.reshape(-1, 9), far,
        ])  # fmt: skip
        return SurfacePatches(facet, weights, corners, normals, middle, radius, out, spread, rows.astype(np.float32))

    def __len__(self) -> int:
        return len(self.facet)

    def take(self, index: NDArray[np.intp]) -> SurfacePatches:
        """Those that `index` counts out."""
        return SurfacePatches(*(getattr(self, each.name)[index] for each in fields(self)))

    def halves(self, surface_model: SmoothedSurface, source: FloatArray) -> SurfacePatches:
        """Twice as many, both halves of each side by side, cut across the edge along which rays change most."""
        turn = 2.0 * lengths(self.normals[:, [1, 2, 0]] - self.normals)
        width = lengths(self.corners[:, [1, 2, 0]] - self.corners) / np.maximum(lengths(self.middle), 1e-9)[:, None]
        row, edge = np.arange(len(self)), np.hypot(turn, width).argmax(axis=1)
        left, right, apex = (self.weights[row, (edge + k) % 3] for k in range(3))
        middle = 0.5 * (left + right)
        halves = np.stack([np.stack([apex, left, middle], axis=1), np.stack([apex, middle, right], axis=1)], axis=1)
        return SurfacePatches.of(surface_model, source, np.repeat(self.facet, 2), halves.reshape(-1, 3, 3))


def angular_radius(ratio: FloatArray) -> FloatArray:
    """Angle [rad] that a ball stands out by on all sides, by radius over distance; pi from inside."""
    return np.where(ratio < 1.0, np.arcsin(np.minimum(ratio, 1.0)), np.pi)


class PatchSubdivision:
    """SurfacePatches, and those that are halves of them once somebody asked."""

    def __init__(self, surface_model: SmoothedSurface, source: FloatArray, facet: NDArray[np.int64]) -> None:
        self._smoothed, self._source, self._count = surface_model, source, len(facet)
        whole = SurfacePatches.of(surface_model, source, facet, np.tile(np.eye(3), (len(facet), 1, 1)))
        self._room = SurfacePatches(
            *(_resized(getattr(whole, each.name), 2 * len(facet)) for each in fields(SurfacePatches))
        )
        self._halves = _resized(np.full(len(facet), -1, np.intp), 2 * len(facet))

    @property
    def pieces(self) -> SurfacePatches:
        """All of them so far."""
        return SurfacePatches(*(getattr(self._room, each.name)[: self._count] for each in fields(SurfacePatches)))

    def halves(self, index: NDArray[np.intp]) -> NDArray[np.intp]:
        """(n, 2) numbers of the halves of the pieces `index` (n,)."""
        whole = np.unique(index[self._halves[index] < 0])
        if len(whole):
            made, first = self._room.take(whole).halves(self._smoothed, self._source), self._count
            self._count = last = first + len(made)
            if last > len(self._halves):
                self._room = SurfacePatches(
                    *(_resized(getattr(self._room, each.name), 2 * last) for each in fields(SurfacePatches))
                )
                self._halves = _resized(self._halves, 2 * last)
            for each in fields(SurfacePatches):
                getattr(self._room, each.name)[first:last] = getattr(made, each.name)
            self._halves[whole] = np.arange(first, last, 2)
            self._halves[first:last] = -1
        return self._halves[index][:, None] + np.arange(2)


def _resized(values: NDArray[Any], count: int) -> NDArray[Any]:
    """The same at the beginning of an array of that length."""
    found = empty_aligned((count, *values.shape[1:]), values.dtype)
    found[: len(values)] = values
    return found
