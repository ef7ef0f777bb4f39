"""Projection of directions onto an image."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray

Projection = Literal["perspective", "equirectangular"]
PROJECTIONS: tuple[Projection, ...] = get_args(Projection)
_MAX_FOV: dict[Projection, tuple[float, float]] = {"perspective": (180.0, 180.0), "equirectangular": (360.0, 180.0)}
"""Largest fields of view, horizontal and vertical [degrees]; a perspective view stays below."""
_MIN_FORWARD = 1e-9
"""Least forward component of a direction on a perspective image: a direction at 90° has no finite place."""


@dataclass(frozen=True)
class ImagePlane:
    """Projection of directions in the viewpoint's frame: +x forward, +y left, +z up.

    A perspective image is a plane normal to the boresight; straight edges stay straight. An equirectangular image has
    even steps of azimuth and elevation, up to the full sphere.
    """

    projection: Projection
    fov_deg: tuple[float, float]
    """Horizontal and vertical field of view [degrees]."""

    @property
    def half(self) -> FloatArray:
        """Half extents, horizontal and vertical: tangents, or angles [rad]."""
        angles = np.radians(self.fov_deg) / 2
        return np.asarray(np.tan(angles) if self.projection == "perspective" else angles)

    def directions(self, left: FloatArray, up: FloatArray) -> FloatArray:
        """(..., 3) unit vectors through positions from -1 (right, lower edge) to 1 (left, upper edge)."""
        y, z = self.half[0] * left, self.half[1] * up
        if self.projection == "perspective":
            vectors = np.stack([np.ones_like(y), y, z], axis=-1)
            return np.asarray(vectors / np.sqrt(1 + y**2 + z**2)[..., None])
        horizontal = np.cos(z)
        return np.stack([horizontal * np.cos(y), horizontal * np.sin(y), np.sin(z)], axis=-1)

    def places(self, directions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Positions (left, up) of directions (..., 3) of any length; NaN behind a perspective image."""
        x, y, z = np.moveaxis(np.asarray(directions), -1, 0)
        if self.projection == "perspective":
            ahead = np.where(x > _MIN_FORWARD, x, np.nan)
            return y / ahead / self.half[0], z / ahead / self.half[1]
        return np.arctan2(y, x) / self.half[0], np.arctan2(z, np.hypot(x, y)) / self.half[1]

    @property
    def closed(self) -> tuple[bool, bool]:
        """Whether the left edge is the right one, and the upper and lower edges are the poles."""
        around = self.projection == "equirectangular"
        return around and self.fov_deg[0] == 360.0, around and self.fov_deg[1] == 180.0

    def cells(self, left: FloatArray, up: FloatArray, resolution: tuple[int, int]) -> NDArray[np.intp]:
        """(...) pixels, row by row, of positions on an image of `resolution` (rows, columns); -1 outside."""
        rows, columns = resolution
        with np.errstate(invalid="ignore"):
            row, column = np.floor(0.5 * (1 - up) * rows), np.floor(0.5 * (1 - left) * columns)
        around, poles = self.closed
        if around:
            column = column % columns
        if poles:
            row = np.clip(row, 0, rows - 1)
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        return np.where(inside, np.where(inside, row * columns + column, 0), -1).astype(np.intp)

    def density(self, left: FloatArray, up: FloatArray) -> FloatArray:
        """(...) solid angle [sr] per unit of `left` times `up`."""
        y, z = self.half[0] * left, self.half[1] * up
        jacobian = (1 + y**2 + z**2) ** -1.5 if self.projection == "perspective" else np.cos(z) * np.ones_like(y)
        return np.asarray(self.half[0] * self.half[1] * jacobian)


def check_projection(projection: str) -> Projection:
    """`projection` as one of :data:`PROJECTIONS`; ValueError if it is none of them."""
    for known in PROJECTIONS:
        if isinstance(projection, str) and projection == known:
            return known
    raise ValueError(f"projection is {projection!r}: {' or '.join(map(repr, PROJECTIONS))} is needed")


def check_fov(
    fov_deg: float | tuple[float, float], projection: Projection, resolution: tuple[int, int]
) -> tuple[float, float]:
    """(horizontal, vertical) field of view [degrees].

    A single number is the horizontal one; pixels of an image of `resolution` (rows, columns) are square in the middle.

    Raises
    ------
    ValueError
        If the angles are out of the projection's range.
    """
    wide, high = _MAX_FOV[projection]
    try:
        angles = np.asarray(fov_deg)
    except ValueError:  # ragged lists
        angles = np.array([])
    right = angles.dtype.kind in "iuf" and angles.shape in ((), (2,)) and bool((angles > 0).all())
    if right and angles.shape == ():
        rows, columns = resolution
        across = float(angles)
        if projection == "perspective" and across < wide:
            down = math.degrees(2 * math.atan(math.tan(math.radians(across) / 2) * rows / columns))
        else:
            down = across * rows / columns
        angles = np.array([across, down])
    flat = projection == "perspective"
    if not right or not ((angles < (wide, high)) if flat else (angles <= (wide, high))).all():
        allowed = f"below {wide:g} degrees" if flat else f"up to {wide:g} degrees horizontally and {high:g} vertically"
        why = ""
        if right and angles[0] <= wide and np.ndim(fov_deg) == 0 and not flat:
            rows, columns = resolution
            why = (
                f"; {angles[0]:g} degrees across are {angles[1]:g} from top to bottom with {rows} x {columns} square "
                "pixels: take fewer rows, or give both angles"
            )
        raise ValueError(
            f"fov_deg is {fov_deg!r}: an angle above 0 and {allowed}, or (horizontal, vertical), is needed for "
            f"{'a' if flat else 'an'} {projection} view{why}"
        )
    return float(angles[0]), float(angles[1])
