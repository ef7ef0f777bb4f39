"""Rendering the PIR of a traced scene."""

from __future__ import annotations

import math
import operator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.radar.pose import POLARIZATIONS, Vector, rotation_matrix
from rfgen_sionna.records import SPEED_OF_LIGHT, ComplexArray, FloatArray, Pir
from rfgen_sionna.tracing.footprints import trace_footprints

if TYPE_CHECKING:
    from rfgen_sionna.tracing.tracer import Tracer

PATCH_WAVELENGTHS = 1.5
"""Edge of the patch that one ray stands for, at `PATCH_RANGE`: smaller than the facets and the bends of a body."""
PATCH_RANGE = 3.0
MAX_RAYS = 4_000_000
"""Beyond it patches grow: memory stays under 2 GiB."""


def render_pir(
    tracer: Tracer,
    t: float,
    resolution: tuple[int, int] = (128, 128),
    fov_deg: float | tuple[float, float] = 60.0,
    position: Vector | None = None,
    orientation: Vector | None = None,
) -> Pir:
    """Energy, time of arrival and radial velocity per pixel at instant `t` [s].

    Each pixel is split into patches a few wavelengths wide; the return of each is integrated in closed form,
    and a pixel's energy is |sum of its patches' gains|^2, isotropic and vertically polarised. Pixels overlap by linear
    weights that add up to 1: a hard rim would itself return a cross of side lobes from every smooth wall. Time of
    arrival and velocity are weighted with the energies of the pixel's own patches.

    Parameters
    ----------
    tracer
        The scene, the actors and the band.
    t
        Instant [s].
    resolution
        (rows, columns).
    fov_deg
        Horizontal field of view [degrees], with square pixels, or (horizontal, vertical).
    position, orientation
        Viewpoint [m] and its yaw, pitch, roll [rad]; those of the radar if None.

    Raises
    ------
    ValueError
        If the resolution or the field of view is out of range.
    """
    rows, columns, (horizontal, vertical) = check_view(resolution, fov_deg)
    position = tracer.radar.position if position is None else position
    orientation = tracer.radar.orientation if orientation is None else orientation
    half = np.tan(np.radians([horizontal, vertical]) / 2)
    pixel = 2 * max(half[0] / columns, half[1] / rows)
    patch = PATCH_WAVELENGTHS * tracer.radar.wavelength / PATCH_RANGE
    split = max(1, min(math.ceil(pixel / patch), math.isqrt(MAX_RAYS // (rows * columns))))
    directions, nodes = _grid(rows * split, columns * split, half, rotation_matrix(orientation))
    found = trace_footprints(
        tracer,
        t,
        np.asarray(position, dtype=np.float64),
        rotation_matrix(orientation) @ np.asarray(POLARIZATIONS["V"]),
        directions,
        nodes,
    )
    row, column = np.divmod(found.ray, columns * split)
    size = rows * columns
    own = (row // split) * columns + column // split

    def total(weights: FloatArray) -> FloatArray:
        return np.bincount(own, weights=weights, minlength=size).astype(np.float64, copy=False)

    # A patch may return nothing at all (edge on): its geometry counts a little all the same.
    power = np.abs(found.a) ** 2
    power = power + 1e-12 * power.max(initial=1e-300)
    weight = total(power)
    hit = weight > 0
    arrival, velocity = np.full(size, np.nan), np.zeros(size)
    arrival[hit] = (2 / SPEED_OF_LIGHT) * total(power * found.distance)[hit] / weight[hit]
    velocity[hit] = total(power * found.velocity)[hit] / weight[hit]
    field = _blend(found.a, (row + 0.5) / split - 0.5, (column + 0.5) / split - 0.5, own, hit.reshape(rows, columns))
    energy = np.abs(field) ** 2
    return Pir(
        energy=energy.reshape(rows, columns),
        time_of_arrival=arrival.reshape(rows, columns),
        velocity=velocity.reshape(rows, columns),
        fov_deg=(horizontal, vertical),
        position=position,
        orientation=orientation,
        time=float(t),
    )


def _blend(
    a: ComplexArray, row: FloatArray, column: FloatArray, own: NDArray[np.intp], hit: NDArray[np.bool_]
) -> ComplexArray:
    """(pixel,) sum of patch gains, each shared among the four nearest pixel centres by bilinear weights.

    `row`, `column` are in pixels from the first centre. Shares of pixels without a hit of their own, or outside, stay
    with the patch's own pixel.
    """
    rows, columns = hit.shape
    out = np.zeros(rows * columns, dtype=np.complex128)
    top, left = np.floor(row).astype(np.intp), np.floor(column).astype(np.intp)
    for r, by_row in ((top, top + 1 - row), (top + 1, row - top)):
        for c, by_column in ((left, left + 1 - column), (left + 1, column - left)):
            inside = (r >= 0) & (r < rows) & (c >= 0) & (c < columns)
            there = np.where(inside, r, 0) * columns + np.where(inside, c, 0)
            target = np.where(inside & hit.ravel()[there], there, own)
            share = by_row * by_column * a
            out += np.bincount(target, weights=share.real, minlength=out.size)
            out += 1j * np.bincount(target, weights=share.imag, minlength=out.size)
    return out


def check_view(
    resolution: tuple[int, int], fov_deg: float | tuple[float, float]
) -> tuple[int, int, tuple[float, float]]:
    """Rows, columns and (horizontal, vertical) field of view [degrees], or a ValueError that says what is allowed."""
    try:
        rows, columns = (operator.index(n) for n in resolution if not isinstance(n, bool))
    except (TypeError, ValueError):
        rows = columns = 0
    if not (1 <= rows <= 4096 and 1 <= columns <= 4096):
        raise ValueError(f"resolution is {resolution!r}: (rows, columns), whole numbers in 1 … 4096, are needed")
    try:
        angles = np.asarray(fov_deg, dtype=np.float64)
    except (TypeError, ValueError):
        angles = np.array([])
    if isinstance(fov_deg, bool) or angles.shape not in ((), (2,)) or not ((angles > 0) & (angles < 180)).all():
        raise ValueError(
            f"fov_deg is {fov_deg!r}: an angle above 0 and below 180 degrees, or (horizontal, vertical), is needed"
        )
    if angles.shape == (2,):
        return rows, columns, (float(angles[0]), float(angles[1]))
    horizontal = float(angles)
    vertical = math.degrees(2 * math.atan(math.tan(math.radians(horizontal) / 2) * rows / columns))
    return rows, columns, (horizontal, vertical)


def _grid(rows: int, columns: int, half: FloatArray, rotation: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Directions of pixels, (row, column, 3) through the middles and (row + 1, column + 1, 3) through the corners."""
    y = half[0] * (1 - 2 * np.arange(columns + 1) / columns)
    z = half[1] * (1 - 2 * np.arange(rows + 1) / rows)

    def unit(ys: FloatArray, zs: FloatArray) -> FloatArray:
        grid_z, grid_y = np.meshgrid(zs, ys, indexing="ij")
        vectors = np.stack([np.ones_like(grid_y), grid_y, grid_z], axis=-1)
        return np.asarray((vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)) @ rotation.T)

    return unit(0.5 * (y[1:] + y[:-1]), 0.5 * (z[1:] + z[:-1])), unit(y, z)
