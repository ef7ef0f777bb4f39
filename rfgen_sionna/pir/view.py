"""Pixels of an image and the rays through them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.pir.projection import ImagePlane, Projection, check_projection
from rfgen_sionna.radar.pose import Vector, rotation_matrix
from rfgen_sionna.records import Pir

Indices: TypeAlias = NDArray[np.integer[Any]]

PATCH_RANGE = 3.0
"""Range at which a patch has its stated width [m]: the middle of a room."""
MAX_RAYS = 4_000_000
"""Upper bound of the patches of an image, which grow beyond it: memory stays under 2 GiB."""


@dataclass(frozen=True)
class View:
    """Geometry of an image: row 0 on top, column 0 on the left, pixels counted row by row."""

    resolution: tuple[int, int]
    """(rows, columns)."""
    fov_deg: tuple[float, float]
    """Horizontal and vertical field of view [degrees]."""
    position: Vector
    """Viewpoint, world frame [m]."""
    orientation: Vector
    """Yaw, pitch, roll [rad], Sionna's convention."""
    projection: Projection = "perspective"

    @classmethod
    def of(cls, pir: Pir) -> View:
        """View of a PIR; ValueError if its projection is unknown."""
        rows, columns = pir.energy.shape
        return cls((rows, columns), pir.fov_deg, pir.position, pir.orientation, check_projection(pir.projection))

    def pir(self, energy: FloatArray, time_of_arrival: FloatArray, velocity: FloatArray, t: float) -> Pir:
        """PIR of this view at time `t` [s] from values (pixel,)."""
        first, second, third = (values.reshape(self.resolution) for values in (energy, time_of_arrival, velocity))
        return Pir(first, second, third, self.fov_deg, self.position, self.orientation, self.projection, float(t))

    @property
    def size(self) -> int:
        """Number of pixels."""
        return self.resolution[0] * self.resolution[1]

    @property
    def directions(self) -> FloatArray:
        """(row, column, 3) unit vectors through the pixels' centres, world frame."""
        return self.subpixels(1)

    @property
    def solid_angles(self) -> FloatArray:
        """(row, column) solid angles of the pixels [sr], by the density at their centres."""
        return np.asarray(4 / self.size * self.plane.density(*self._grid(1)))

    def subpixels(self, split: int) -> FloatArray:
        """(row * split, column * split, 3) unit vectors through the centres of evenly divided pixels."""
        return np.asarray(self.plane.directions(*self._grid(split)) @ self._rotation.T)

    def coordinates(self, directions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Row and column of directions (..., 3), in pixels from the first pixel's centre; NaN behind a flat image."""
        left, up = self.plane.places(directions @ self._rotation)
        return 0.5 * (1 - up) * self.resolution[0] - 0.5, 0.5 * (1 - left) * self.resolution[1] - 0.5

    def pixels(self, directions: FloatArray) -> NDArray[np.intp]:
        """(...,) index of the pixel of directions (..., 3); -1 outside of the view."""
        return self.plane.cells(*self.plane.places(directions @ self._rotation), self.resolution)

    @cached_property
    def plane(self) -> ImagePlane:
        """Projection of directions onto the image."""
        return ImagePlane(self.projection, self.fov_deg)

    @cached_property
    def _rotation(self) -> FloatArray:
        return rotation_matrix(self.orientation)

    def _grid(self, split: int) -> tuple[FloatArray, FloatArray]:
        """(row * split, column * split) positions (left, up) of the centres of evenly divided pixels."""
        rows, columns = (split * count for count in self.resolution)
        left = 1 - (2 * np.arange(columns) + 1) / columns
        up = 1 - (2 * np.arange(rows) + 1) / rows
        return np.broadcast_to(left, (rows, columns)), np.broadcast_to(up[:, None], (rows, columns))

    @property
    def pixel_width(self) -> float:
        """Longer edge of a pixel in the middle of the image, about its angle [rad]."""
        half = self.plane.half
        return float(2 * max(half[0] / self.resolution[1], half[1] / self.resolution[0]))

    def patch_split(self, patch: float, pixels: int) -> int:
        """Patches along each edge of `pixels` pixels, each `patch` [m] wide at `PATCH_RANGE`."""
        return max(1, min(math.ceil(self.pixel_width * PATCH_RANGE / patch), math.isqrt(MAX_RAYS // max(pixels, 1))))

    def neighbourhood(self, pixels: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """(pixel,) mask of the pixels of a mask and of their eight neighbours."""
        image = pixels.reshape(self.resolution)
        wide = image.copy()
        wide[1:] |= image[:-1]
        wide[:-1] |= image[1:]
        out = wide.copy()
        out[:, 1:] |= wide[:, :-1]
        out[:, :-1] |= wide[:, 1:]
        return out.ravel()

    def _corner_grid(self, row: FloatArray, column: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Positions (left, up) of rows and columns counted in pixels from the upper left corner."""
        return 1 - 2 * column / self.resolution[1], 1 - 2 * row / self.resolution[0]

    def _directions_at(self, row: FloatArray, column: FloatArray) -> FloatArray:
        """(..., 3) unit vectors through rows and columns counted in pixels from the upper left corner."""
        return np.asarray(self.plane.directions(*self._corner_grid(row, column)) @ self._rotation.T)

    def rays(self, split: int) -> tuple[FloatArray, FloatArray, Indices]:
        """Directions (ray, 3), solid angles (ray,) [sr] and pixels (ray,) of `split` times `split` rays a pixel."""
        down, right = ((np.arange(count * split) + 0.5) / split for count in self.resolution)
        row, column = (grid.ravel() for grid in np.meshgrid(down, right, indexing="ij"))
        cell = 4 / (self.size * split**2) * self.plane.density(*self._corner_grid(row, column))
        pixel = row.astype(np.int64) * self.resolution[1] + column.astype(np.int64)
        return self._directions_at(row, column), cell, pixel

    def patch_coordinates(self, pixel: Indices, patch: Indices, split: int) -> tuple[FloatArray, FloatArray]:
        """Row and column of patches, in pixels from the first pixel's centre; `patch` counts within the pixel."""
        row, column = np.divmod(pixel, self.resolution[1])
        down, right = np.divmod(patch, split)
        return row + (down + 0.5) / split - 0.5, column + (right + 0.5) / split - 0.5

    def patches(self, pixels: Indices, split: int) -> tuple[FloatArray, FloatArray, Indices]:
        """Patches of some pixels, counted row by row within each pixel.

        Returns
        -------
        (patch, 3) unit vectors through the centres, (corner, 3) unit vectors through the corners, and (patch, 4) the
        corners of each patch, in a cycle.
        """
        rows, columns = self.resolution
        patch = np.arange(split * split)
        row, column = (
            values + 0.5
            for values in self.patch_coordinates(np.repeat(pixels, len(patch)), np.tile(patch, len(pixels)), split)
        )
        # Neighbours share corners: one grid for a whole image, one grid a pixel otherwise.
        side = split + 1
        if len(pixels) == self.size:
            wide = columns * split + 1
            r, c = np.meshgrid(np.arange(rows * split + 1), np.arange(wide), indexing="ij")
            down, right = (np.round(values * split - 0.5).astype(np.int64) for values in (row, column))
            first = down * wide + right
            nodes = self._directions_at(r.ravel() / split, c.ravel() / split)
        else:
            wide = side
            r, c = np.divmod(pixels, columns)
            down, right = np.divmod(np.arange(side * side), side)
            nodes = self._directions_at((r[:, None] + down / split).ravel(), (c[:, None] + right / split).ravel())
            own = np.arange(len(pixels))[:, None] * side * side
            first = (own + (patch // split) * side + patch % split).ravel()
        node = np.stack([first, first + 1, first + wide + 1, first + wide], axis=1)
        return self._directions_at(row, column), nodes, node
