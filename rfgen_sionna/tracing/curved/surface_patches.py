"""Patches of curved faces, with bounds of the rays that the radar's waves leave them by."""

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
"""Above the rounding in single precision of directions [rad], and of positions over their distance."""
NEVER = -1e9
"""In place of a patch's least cosine: rays may leave at any angle."""
COLUMNS = 24
"""Numbers per patch in kernels: centre, radius, outgoing direction, its spread, axis, height of the plane across it
below all of the patch, least cosine of outgoing rays to it, sagitta, corners, distance."""


@dataclass(frozen=True)
class SurfacePatches:
    """Patches of faces; positions are relative to the source."""

    facet: NDArray[np.int64]
    """(patch,) face of the ray scene."""
    weights: FloatArray
    """(patch, corner, vertex) barycentric coordinates of the corners."""
    corners: FloatArray
    """(patch, 3, 3) corners on the smooth surface [m]."""
    normals: FloatArray
    """(patch, 3, 3) unit normals there."""
    middle: FloatArray
    """(patch, 3) centre of a ball around it [m]."""
    radius: FloatArray
    """(patch,) [m]"""
    out: FloatArray
    """(patch, 3) unit vector, mean direction of outgoing rays."""
    spread: FloatArray
    """(patch,) most angle of outgoing rays to it [rad]."""
    rows: NDArray[np.float32]
    """(patch, COLUMNS) for kernels, in single precision, rounded to the safe side."""

    @staticmethod
    def of(
        surface_model: SmoothedSurface, source: FloatArray, facet: NDArray[np.int64], weights: FloatArray
    ) -> SurfacePatches:
        """Of faces `facet` (patch,), with corners at barycentric coordinates `weights` (patch, 3, 3), relative to the
        `source` (3,) [m]."""
        count = len(facet)
        lane, place = np.repeat(facet, 3), weights.reshape(-1, 3)
        corners = surface_model.places(lane, place)[1].reshape(count, 3, 3) - source
        normals = unit_normals(surface_model, lane, place).reshape(count, 3, 3)
        middle = corners.mean(axis=1)
        # The sagitta goes with the square of the patch's size.
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
        # Least cosine to the local normal, lowered to the axis.
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
        """Patches by `index`."""
        return SurfacePatches(*(getattr(self, each.name)[index] for each in fields(self)))

    def halves(self, surface_model: SmoothedSurface, source: FloatArray) -> SurfacePatches:
        """Both halves of each patch, side by side, cut across the edge of largest change of the rays."""
        turn = 2.0 * lengths(self.normals[:, [1, 2, 0]] - self.normals)
        width = lengths(self.corners[:, [1, 2, 0]] - self.corners) / np.maximum(lengths(self.middle), 1e-9)[:, None]
        row, edge = np.arange(len(self)), np.hypot(turn, width).argmax(axis=1)
        left, right, apex = (self.weights[row, (edge + k) % 3] for k in range(3))
        middle = 0.5 * (left + right)
        halves = np.stack([np.stack([apex, left, middle], axis=1), np.stack([apex, middle, right], axis=1)], axis=1)
        return SurfacePatches.of(surface_model, source, np.repeat(self.facet, 2), halves.reshape(-1, 3, 3))


def angular_radius(ratio: FloatArray) -> FloatArray:
    """Angle [rad] of a ball's outline, by radius over distance; pi from inside."""
    return np.where(ratio < 1.0, np.arcsin(np.minimum(ratio, 1.0)), np.pi)


class PatchSubdivision:
    """Patches and their halves, made on demand."""

    def __init__(self, surface_model: SmoothedSurface, source: FloatArray, facet: NDArray[np.int64]) -> None:
        self._smoothed, self._source, self._count = surface_model, source, len(facet)
        whole = SurfacePatches.of(surface_model, source, facet, np.tile(np.eye(3), (len(facet), 1, 1)))
        self._room = SurfacePatches(
            *(_resized(getattr(whole, each.name), 2 * len(facet)) for each in fields(SurfacePatches))
        )
        self._halves = _resized(np.full(len(facet), -1, np.intp), 2 * len(facet))

    @property
    def pieces(self) -> SurfacePatches:
        """All patches so far."""
        return SurfacePatches(*(getattr(self._room, each.name)[: self._count] for each in fields(SurfacePatches)))

    def halves(self, index: NDArray[np.intp]) -> NDArray[np.intp]:
        """(n, 2) numbers of the halves of the patches `index` (n,)."""
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
    """The same at the beginning of an array of length `count`."""
    found = empty_aligned((count, *values.shape[1:]), values.dtype)
    found[: len(values)] = values
    return found
