"""Which pixel of an image a direction falls into, and back."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.pir.projection import ImagePlane, Projection, check_projection
from rfgen_sionna.radar.pose import Vector, rotation_matrix
from rfgen_sionna.records import Pir


@dataclass(frozen=True)
class View:
    """A view: row 0 on top, column 0 on the left."""

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
        """The view that `pir` was taken from.

        Raises
        ------
        ValueError
            If its projection is unknown.
        """
        rows, columns = pir.energy.shape
        projection = check_projection(pir.projection)
        return cls((rows, columns), pir.fov_deg, pir.position, pir.orientation, projection)

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
        """(row, column) of the pixels [sr], as large all over as at their middles."""
        return np.asarray(4 / self.size * self.plane.density(*self._grid(1)))

    def subpixels(self, split: int) -> FloatArray:
        """(row * split, column * split, 3) unit vectors through the middles of pixels that are split evenly."""
        return np.asarray(self.plane.directions(*self._grid(split)) @ rotation_matrix(self.orientation).T)

    def coordinates(self, directions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Row and column of directions (..., 3), counted in pixels from the first pixel's middle; NaN where the
        projection has no place for them."""
        left, up = self.plane.places(directions @ rotation_matrix(self.orientation))
        return 0.5 * (1 - up) * self.resolution[0] - 0.5, 0.5 * (1 - left) * self.resolution[1] - 0.5

    def pixels(self, directions: FloatArray) -> NDArray[np.intp]:
        """(...,) index of the pixel, row by row, that directions (..., 3) fall into; -1 outside of the view."""
        return self.plane.cells(*self.plane.places(directions @ rotation_matrix(self.orientation)), self.resolution)

    @cached_property
    def plane(self) -> ImagePlane:
        """Where directions lie on the image."""
        return ImagePlane(self.projection, self.fov_deg)

    def _grid(self, split: int) -> tuple[FloatArray, FloatArray]:
        """(row * split, column * split) places (left, up) of the middles of pixels that are split evenly."""
        rows, columns = (split * count for count in self.resolution)
        left = 1 - (2 * np.arange(columns) + 1) / columns
        up = 1 - (2 * np.arange(rows) + 1) / rows
        return np.broadcast_to(left, (rows, columns)), np.broadcast_to(up[:, None], (rows, columns))
