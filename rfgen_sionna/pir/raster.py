"""Pixels of an image plane and the rays through them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.pir.projection import ImagePlane, Projection

Indices: TypeAlias = NDArray[np.integer[Any]]

PATCH_RANGE = 3.0
MAX_RAYS = 4_000_000
"""Beyond it patches grow: memory stays under 2 GiB."""


@dataclass(frozen=True)
class Raster:
    """Pixels of an image plane and the rays through them; pixels are numbered row by row."""

    rows: int
    columns: int
    fov_deg: tuple[float, float]
    """Horizontal, vertical."""
    rotation: FloatArray
    """(3, 3) from the viewpoint's frame, which looks along +x with +y to the left, to the world."""
    projection: Projection = "perspective"

    @property
    def size(self) -> int:
        return self.rows * self.columns

    @cached_property
    def _plane(self) -> ImagePlane:
        return ImagePlane(self.projection, self.fov_deg)

    @property
    def pixel(self) -> float:
        """Longer edge of a pixel in the middle of the image, about its angle [rad]."""
        half = self._plane.half
        return float(2 * max(half[0] / self.columns, half[1] / self.rows))

    def split(self, patch: float, pixels: int) -> int:
        """Into how many patches, `patch` [m] wide at `PATCH_RANGE`, each edge of `pixels` of the pixels is split."""
        return max(1, min(math.ceil(self.pixel * PATCH_RANGE / patch), math.isqrt(MAX_RAYS // max(pixels, 1))))

    def around(self, pixels: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """(pixel,) those pixels and their neighbours."""
        image = pixels.reshape(self.rows, self.columns)
        wide = image.copy()
        wide[1:] |= image[:-1]
        wide[:-1] |= image[1:]
        out = wide.copy()
        out[:, 1:] |= wide[:, :-1]
        out[:, :-1] |= wide[:, 1:]
        return out.ravel()

    def pixels(self, directions: FloatArray) -> Indices:
        """(ray,) the pixels that directions (ray, 3) fall into, -1 for those outside of the image."""
        return self._plane.cells(*self._plane.places(directions @ self.rotation), (self.rows, self.columns))

    def directions(self, row: FloatArray, column: FloatArray) -> FloatArray:
        """(..., 3) unit vectors through places in pixels from the upper left corner of the image."""
        return np.asarray(self._plane.directions(*self._places(row, column)) @ self.rotation.T)

    def _places(self, row: FloatArray, column: FloatArray) -> tuple[FloatArray, FloatArray]:
        return 1 - 2 * column / self.columns, 1 - 2 * row / self.rows

    def beams(self, split: int) -> tuple[FloatArray, FloatArray, Indices]:
        """Directions (beam, 3), solid angles (beam,) [sr] and pixels (beam,) of `split` times `split` beams each."""
        down, right = ((np.arange(count * split) + 0.5) / split for count in (self.rows, self.columns))
        row, column = (grid.ravel() for grid in np.meshgrid(down, right, indexing="ij"))
        cell = 4 / (self.size * split**2) * self._plane.density(*self._places(row, column))
        pixel = row.astype(np.int64) * self.columns + column.astype(np.int64)
        return self.directions(row, column), cell, pixel

    def places(self, pixel: Indices, place: Indices, split: int) -> tuple[FloatArray, FloatArray]:
        """Row and column of patches in pixels from the first pixel's centre; `place` is a patch's number within."""
        row, column = np.divmod(pixel, self.columns)
        down, right = np.divmod(place, split)
        return row + (down + 0.5) / split - 0.5, column + (right + 0.5) / split - 0.5

    def patches(self, pixels: Indices, split: int) -> tuple[FloatArray, FloatArray, Indices]:
        """Directions through the middles of the patches of some pixels (patch, 3), through corners (corner, 3), and the
        four corners of each patch (patch, 4); patches count on within each pixel, row by row."""
        place = np.arange(split * split)
        row, column = (
            values + 0.5 for values in self.places(np.repeat(pixels, len(place)), np.tile(place, len(pixels)), split)
        )
        # Neighbours share corners: of pixels all side by side, one grid; of scattered pixels, a grid for each.
        side = split + 1
        if len(pixels) == self.size:
            wide = self.columns * split + 1
            r, c = np.meshgrid(np.arange(self.rows * split + 1), np.arange(wide), indexing="ij")
            first = np.round(row * split - 0.5).astype(np.int64) * wide + np.round(column * split - 0.5).astype(
                np.int64
            )
            nodes = self.directions(r.ravel() / split, c.ravel() / split)
        else:
            wide = side
            r, c = np.divmod(pixels, self.columns)
            down, right = np.divmod(np.arange(side * side), side)
            nodes = self.directions((r[:, None] + down / split).ravel(), (c[:, None] + right / split).ravel())
            own = np.arange(len(pixels))[:, None] * side * side
            first = (own + (place // split) * side + place % split).ravel()
        node = np.stack([first, first + 1, first + wide + 1, first + wide], axis=1)
        return self.directions(row, column), nodes, node
