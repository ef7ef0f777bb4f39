"""Which pixel of an image a direction falls into, and back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.radar.pose import Vector, rotation_matrix
from rfgen_sionna.records import FloatArray, Pir


@dataclass(frozen=True)
class View:
    """A perspective view: square to the boresight, row 0 on top, column 0 on the left."""

    resolution: tuple[int, int]
    """(rows, columns)."""
    fov_deg: tuple[float, float]
    """Horizontal and vertical field of view [degrees]."""
    position: Vector
    """Viewpoint, world frame [m]."""
    orientation: Vector
    """Yaw, pitch, roll [rad], Sionna's convention."""

    @classmethod
    def of(cls, pir: Pir) -> View:
        """The view that `pir` was taken from.

        Raises
        ------
        ValueError
            If its projection is not perspective.
        """
        if pir.projection != "perspective":
            raise ValueError(f"pir.projection is {pir.projection!r}: 'perspective' is needed")
        rows, columns = pir.energy.shape
        return cls((rows, columns), pir.fov_deg, pir.position, pir.orientation)

    @property
    def size(self) -> int:
        """Number of pixels."""
        return self.resolution[0] * self.resolution[1]

    @property
    def directions(self) -> FloatArray:
        """(row, column, 3) unit vectors through the pixels' middles, world frame."""
        return self.subpixels(1)

    @property
    def solid_angles(self) -> FloatArray:
        """(row, column) of the pixels [sr]: of a small rectangle square to the boresight, at the pixel's middle."""
        rows, columns = self.resolution
        half = self._half
        y = half[0] * (1 - (2 * np.arange(columns) + 1) / columns)
        z = half[1] * (1 - (2 * np.arange(rows) + 1) / rows)
        stretch = (1 + y[None, :] ** 2 + z[:, None] ** 2) ** -1.5
        return np.asarray(4 * half[0] * half[1] / self.size * stretch)

    def subpixels(self, split: int) -> FloatArray:
        """(row * split, column * split, 3) unit vectors through the middles of pixels that are split evenly."""
        rows, columns = (split * count for count in self.resolution)
        half = self._half
        y = half[0] * (1 - (2 * np.arange(columns) + 1) / columns)
        z = half[1] * (1 - (2 * np.arange(rows) + 1) / rows)
        grid_z, grid_y = np.meshgrid(z, y, indexing="ij")
        vectors = np.stack([np.ones_like(grid_y), grid_y, grid_z], axis=-1)
        vectors /= np.linalg.norm(vectors, axis=-1, keepdims=True)
        return np.asarray(vectors @ rotation_matrix(self.orientation).T)

    def coordinates(self, directions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Row and column of directions (..., 3), counted in pixels from the first pixel's middle; NaN behind the
        viewpoint."""
        device = directions @ rotation_matrix(self.orientation)
        ahead = np.where(device[..., 0] > 1e-9, device[..., 0], np.nan)
        half = self._half
        column = 0.5 * (1 - device[..., 1] / ahead / half[0]) * self.resolution[1] - 0.5
        row = 0.5 * (1 - device[..., 2] / ahead / half[1]) * self.resolution[0] - 0.5
        return row, column

    def pixels(self, directions: FloatArray) -> NDArray[np.intp]:
        """(...,) index of the pixel, row by row, that directions (..., 3) fall into; -1 outside of the view."""
        row, column = (np.floor(place + 0.5) for place in self.coordinates(directions))
        rows, columns = self.resolution
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        return np.where(inside, np.where(inside, row, 0) * columns + np.where(inside, column, 0), -1).astype(np.intp)

    @property
    def _half(self) -> FloatArray:
        """Tangent of half the field of view, horizontal and vertical."""
        return np.asarray(np.tan(np.radians(self.fov_deg) / 2))
