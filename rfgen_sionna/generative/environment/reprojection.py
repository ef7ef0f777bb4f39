"""Reprojection: an image's points seen from another viewpoint, and the patches that stay unknown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, map_coordinates

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray
from rfgen_sionna.pir.view import View
from rfgen_sionna.records import Pir

NATIVE = (64, 64)
"""Pixels of the image models; other resolutions are resampled."""
PATCH = 4
"""Edge of a patch [pixels], as in the autoencoder."""
SPLIT = 4
"""Points along a pixel's edge; closes surfaces that are seen from closer by."""
EDGE = 0.12
"""Relative difference in range of neighbours of two surfaces."""
KNOWN = 0.75
"""Least share of seen pixels in a known patch."""


def reproject(images: Sequence[Pir], view: View) -> tuple[FloatArray, FloatArray]:
    """Images as seen from `view`.

    Each pixel becomes a few points of its surface; the nearest surface in a new pixel counts. Energy is taken to be
    diffuse: it falls with the square of the range and grows with the pixel's solid angle. Specular returns do not
    follow.

    Args:
        images: PIRs of one environment.
        view: the new view.

    Returns:
        energies (row, column), 0 for unknown pixels, and ranges (row, column) [m], NaN for unknown pixels.
    """
    rows, columns = view.resolution
    best = np.full(view.size, np.inf)
    parts = []
    for pir in images:
        old = View.of(pir)
        reach, level = _split(0.5 * SPEED_OF_LIGHT * pir.time_of_arrival, pir.energy)
        points = np.asarray(old.position) + reach[..., None] * old.subpixels(SPLIT)
        there = np.isfinite(reach) & (level > 0)
        offset = points[there] - np.asarray(view.position)
        away = np.linalg.norm(offset, axis=-1)
        target = view.pixels(offset)
        inside = (target >= 0) & (away > 1e-3)
        angle = view.solid_angles.ravel()[target] / np.kron(old.solid_angles, np.ones((SPLIT, SPLIT)))[there]
        power = level[there] * (reach[there] / np.maximum(away, 1e-3)) ** 2 * angle
        np.minimum.at(best, target[inside], away[inside])
        parts.append((target[inside], away[inside], power[inside]))
    count, decibels, distance = np.zeros(view.size), np.zeros(view.size), np.zeros(view.size)
    for target, away, power in parts:
        front = away <= best[target] * (1 + EDGE)
        count += np.bincount(target[front], minlength=view.size)
        decibels += np.bincount(target[front], weights=np.log(power[front]), minlength=view.size)
        distance += np.bincount(target[front], weights=away[front], minlength=view.size)
    seen = count > 0
    out = np.exp(np.divide(decibels, count, out=np.zeros(view.size), where=seen)) * seen
    reach = np.divide(distance, count, out=np.full(view.size, np.nan), where=seen)
    return out.reshape(rows, columns), reach.reshape(rows, columns)


@dataclass(frozen=True)
class KnownView:
    """Parts of a view that other views show."""

    pir: Pir
    """The whole view; unknown pixels copy the nearest known one."""
    patches: NDArray[np.bool_]
    """(row / PATCH, column / PATCH) known patches."""


def known_from_views(images: Sequence[Pir], view: View) -> KnownView | None:
    """Reprojection of `images` into `view`; None without a known patch."""
    energy, distance = reproject(images, view)
    seen = energy > 0
    rows, columns = view.resolution
    patches = seen.reshape(rows // PATCH, PATCH, columns // PATCH, PATCH).mean(axis=(1, 3)) >= KNOWN
    if not patches.any():
        return None
    nearest = tuple(distance_transform_edt(~seen, return_distances=False, return_indices=True))
    arrival = 2 / SPEED_OF_LIGHT * distance[nearest]
    return KnownView(empty_pir(view, energy[nearest], arrival), patches)


def empty_pir(view: View, energy: FloatArray, arrival: FloatArray) -> Pir:
    """A static PIR of `view`."""
    still = np.zeros_like(energy)
    return Pir(energy, arrival, still, view.fov_deg, view.position, view.orientation, view.projection)


def resize_pir(pir: Pir, resolution: tuple[int, int]) -> Pir:
    """The view with other pixels; total energy stays, ranges are never averaged over an edge.

    Args:
        pir: the image.
        resolution: (rows, columns).
    """
    rows, columns = pir.energy.shape
    if (rows, columns) == tuple(resolution):
        return pir
    row = np.minimum((np.arange(resolution[0]) + 0.5) * rows / resolution[0], rows - 0.5).astype(np.intp)
    column = np.minimum((np.arange(resolution[1]) + 0.5) * columns / resolution[1], columns - 0.5).astype(np.intp)
    pick = np.ix_(row, column)
    energy, arrival, velocity = (x[pick].copy() for x in (pir.energy, pir.time_of_arrival, pir.velocity))
    if resolution[0] <= rows and resolution[1] <= columns:
        target = (np.arange(rows) * resolution[0] // rows)[:, None] * resolution[1]
        target = (target + (np.arange(columns) * resolution[1] // columns)[None, :]).ravel()

        def total(x: FloatArray) -> FloatArray:
            sums = np.bincount(target, weights=x.ravel(), minlength=resolution[0] * resolution[1])
            return np.asarray(sums.reshape(resolution))

        energy = total(pir.energy)
        weights = np.divide(1.0, energy, out=np.zeros_like(energy), where=energy > 0)
        arrival = total(pir.energy * np.nan_to_num(pir.time_of_arrival)) * weights
        arrival[energy <= 0] = np.nan
        velocity = total(pir.energy * pir.velocity) * weights
    else:
        energy, arrival = _finer(pir, resolution, energy, arrival)
    return replace(pir, energy=energy, time_of_arrival=arrival, velocity=velocity)


def _finer(
    pir: Pir, resolution: tuple[int, int], energy: FloatArray, arrival: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Energies and times of arrival, interpolated within surfaces, from the nearest pixel at edges."""
    rows, columns = pir.energy.shape
    where = np.meshgrid(
        (np.arange(resolution[0]) + 0.5) * rows / resolution[0] - 0.5,
        (np.arange(resolution[1]) + 0.5) * columns / resolution[1] - 0.5,
        indexing="ij",
    )
    filled = np.where(np.isfinite(pir.time_of_arrival), pir.time_of_arrival, 0.0)
    smooth = map_coordinates(filled, where, order=1, mode="nearest")
    one = np.abs(smooth - arrival) < EDGE * np.nan_to_num(arrival)
    arrival = np.where(one, smooth, arrival)
    level = np.log(np.maximum(pir.energy, 1e-30))
    energy = np.where(one & (energy > 0), np.exp(map_coordinates(level, where, order=1, mode="nearest")), energy)
    # keep each coarse pixel's energy: interpolation in decibels lowers single bright ones
    coarse = min(rows, resolution[0]), min(columns, resolution[1])

    def place_points(shape: tuple[int, int]) -> NDArray[np.intp]:
        row, column = (np.arange(n) * m // n for n, m in zip(shape, coarse, strict=True))
        return np.asarray(row[:, None] * coarse[1] + column)

    before = np.bincount(place_points((rows, columns)).ravel(), pir.energy.ravel(), coarse[0] * coarse[1])
    after = np.bincount(place_points(resolution).ravel(), energy.ravel(), coarse[0] * coarse[1])
    scale = np.divide(before, after, out=np.zeros(len(before)), where=after > 0)
    return energy * scale[place_points(resolution)], arrival


def _split(distance: FloatArray, energy: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Ranges and energies of `SPLIT` × `SPLIT` points a pixel, interpolated within surfaces."""
    rows, columns = distance.shape
    where = np.meshgrid(
        (np.arange(rows * SPLIT) + 0.5) / SPLIT - 0.5, (np.arange(columns * SPLIT) + 0.5) / SPLIT - 0.5, indexing="ij"
    )
    nearest = np.repeat(np.repeat(distance, SPLIT, axis=0), SPLIT, axis=1)
    smooth = map_coordinates(np.nan_to_num(distance), where, order=1, mode="nearest")
    one = np.abs(smooth - nearest) < EDGE * np.nan_to_num(nearest)
    level = np.repeat(np.repeat(energy, SPLIT, axis=0), SPLIT, axis=1)
    return np.where(one, smooth, nearest), level
