"""Rendering the PIR of a traced scene."""

from __future__ import annotations

import math
import operator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.radar.pose import POLARIZATIONS, Vector, rotation_matrix
from rfgen_sionna.records import SPEED_OF_LIGHT, ComplexArray, FloatArray, IntArray, Pir
from rfgen_sionna.tracing.footprints import Footprints, Shades, Stage, shade, trace_footprints

if TYPE_CHECKING:
    from rfgen_sionna.tracing.tracer import Tracer

PATCH_WAVELENGTHS = 1.5
"""Edge of the patch that one ray stands for, at `PATCH_RANGE`: smaller than the facets and the bends of a body."""
PATCH_RANGE = 3.0
MAX_RAYS = 4_000_000
"""Beyond it patches grow: memory stays under 2 GiB."""
SHADES = 3
"""Beams along each edge of a pixel for what rough surfaces return diffusely."""
NEGLIGIBLE = 0.02
"""Where surfaces are rough, the coherent return of a pixel is left out if it cannot be more than this share of the
diffuse one."""
NEGLIGIBLE_EDGE = 1.0
"""The same for the return of an edge that happens to lie exactly across the line of sight: few do."""


def render_pir(
    tracer: Tracer,
    t: float,
    resolution: tuple[int, int] = (128, 128),
    fov_deg: float | tuple[float, float] = 60.0,
    position: Vector | None = None,
    orientation: Vector | None = None,
    patch_wavelengths: float = PATCH_WAVELENGTHS,
) -> Pir:
    """Energy, time of arrival and radial velocity per pixel at instant `t` [s].

    A pixel's energy is what its surfaces return coherently and diffusely, isotropic and vertically polarised.

    Coherent, (1 - S^2) of the energy: each pixel is split into patches a few wavelengths wide, the return of each is
    integrated in closed form, and the energy is |sum of the pixel's patches' gains|^2. Pixels overlap by linear weights
    that add up to 1: a hard rim would itself return a cross of side lobes from every smooth wall. Away from the
    specular direction rough surfaces return hardly any of it: pixels where it cannot count are not split.

    Diffuse, S^2 of the energy: the expected sum over the pixel's beams, as their phases are independent.

    Time of arrival and velocity are weighted with the energies of the pixel's own patches and beams.

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
    patch_wavelengths
        Edge of the patches at 3 m [wavelengths]. The default resolves the bends of a body; flat surfaces take several
        times as much without harm, and the time falls with its square.

    Raises
    ------
    ValueError
        If the resolution or the field of view is out of range.
    """
    rows, columns, fov = check_view(resolution, fov_deg)
    position = tracer.radar.position if position is None else position
    orientation = tracer.radar.orientation if orientation is None else orientation
    view = Raster(rows, columns, fov, rotation_matrix(orientation))
    stage = Stage.of(tracer, t, np.asarray(position, dtype=np.float64))
    field = rotation_matrix(orientation) @ np.asarray(POLARIZATIONS["V"])
    diffuse, counts = np.zeros(view.size), np.ones(view.size, dtype=np.bool_)
    own, shades = np.zeros(0, np.int64), None
    if any(material.scattering_coefficient for material in stage.materials):
        directions, solid_angles, pixel = view.beams(SHADES)
        shades = shade(stage, directions, solid_angles)
        own = pixel[shades.ray]
        diffuse = _sum(own, shades.energy, view.size)
        counts = _coherence_counts(shades, own, view, tracer.radar.wavelength)
    split = view.split(patch_wavelengths * tracer.radar.wavelength, int(np.count_nonzero(view.around(counts))))
    traced = np.flatnonzero(view.around(counts))
    found = trace_footprints(stage, field, *view.patches(traced, split))
    patch, place = np.divmod(found.ray, split * split)
    row, column = view.places(traced[patch], place, split)
    coherent = np.abs(_blend(found.a, row, column, traced[patch], view)) ** 2 * counts
    arrival, velocity = np.full(view.size, np.nan), np.zeros(view.size)
    weight, distance, speed = _weighted(traced[patch], np.abs(found.a) ** 2, found, coherent)
    if shades is not None:
        more = _weighted(own, shades.energy, shades, diffuse)
        weight, distance, speed = weight + more[0], distance + more[1], speed + more[2]
    hit = weight > 0
    arrival[hit] = (2 / SPEED_OF_LIGHT) * distance[hit] / weight[hit]
    velocity[hit] = speed[hit] / weight[hit]
    return Pir(
        energy=(coherent + diffuse).reshape(rows, columns),
        time_of_arrival=arrival.reshape(rows, columns),
        velocity=velocity.reshape(rows, columns),
        fov_deg=fov,
        position=position,
        orientation=orientation,
        time=float(t),
    )


def _sum(pixel: IntArray, weights: FloatArray, size: int) -> FloatArray:
    return np.bincount(pixel, weights=weights, minlength=size).astype(np.float64, copy=False)


def _weighted(
    pixel: IntArray, energy: FloatArray, of: Footprints | Shades, total: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(pixel,) weights that are `total`, shared among what the pixel holds as its energy is; times distance; times
    velocity."""
    # What returns nothing at all (edge on) has a place all the same, where nothing else has.
    energy = energy + 1e-12 * energy.max(initial=1e-300)
    shares = _sum(pixel, energy, len(total))
    scale = np.where(shares > 0, np.maximum(total, 1e-12 * total.max(initial=1e-300)) / np.maximum(shares, 1e-300), 0.0)
    weight = energy * scale[pixel]
    return (
        _sum(pixel, weight, len(total)),
        _sum(pixel, weight * of.distance, len(total)),
        _sum(pixel, weight * of.velocity, len(total)),
    )


def _coherence_counts(shades: Shades, pixel: IntArray, view: Raster, wavelength: float) -> NDArray[np.bool_]:
    """(pixel,) whether the coherent return may be more than a small share of the diffuse one.

    Over a flat surface the linear weights of a pixel that is w wide leave (lambda / (2 pi w tan(theta)))^4 of what it
    returns at normal incidence, and that is pi w^2 (1 - S^2) / (lambda S)^2 of the diffuse energy. Where the surface
    ends within the pixel, or has a bend, up to (1 - S^2) / (4 pi S^2 tan^2(theta)) of it comes from that edge.
    """
    rough = np.maximum(shades.roughness, 1e-12)
    tangent2 = np.maximum(1.0 - shades.cos**2, 0.0) / np.maximum(shades.cos, 1e-9) ** 2
    width = view.pixel * shades.distance
    lobe = np.minimum(1.0, (wavelength / (2 * np.pi * width)) ** 2 / np.maximum(tangent2, 1e-12))
    flat = np.pi * (width / wavelength) ** 2 * (1 - rough) / rough * lobe**2
    counts = np.zeros(view.size, dtype=np.bool_)
    counts[pixel[flat > NEGLIGIBLE]] = True
    edge = (1 - rough) / (4 * np.pi * rough * np.maximum(tangent2, 1e-12)) > NEGLIGIBLE_EDGE
    number = _sum(pixel, np.ones(len(pixel)), view.size)
    mean = np.stack([_sum(pixel, shades.normal[:, axis], view.size) for axis in range(3)], axis=1)
    bent = np.linalg.norm(mean, axis=1) < 0.995 * number
    first = np.full(view.size, -1)
    first[pixel] = shades.object
    several = np.zeros(view.size, dtype=np.bool_)
    several[pixel[shades.object != first[pixel]]] = True
    torn = bent | several | ((number > 0) & (number < SHADES**2))
    counts[pixel[edge & torn[pixel]]] = True
    return counts


def _blend(a: ComplexArray, row: FloatArray, column: FloatArray, own: IntArray, view: Raster) -> ComplexArray:
    """(pixel,) sum of patch gains, each shared among the four nearest pixel centres by bilinear weights.

    `row`, `column` are in pixels from the first centre. Shares of pixels without a hit of their own, or outside, stay
    with the patch's own pixel.
    """
    rows, columns = view.rows, view.columns
    out = np.zeros(view.size, dtype=np.complex128)
    hit = np.zeros(view.size, dtype=np.bool_)
    hit[own] = True
    top, left = np.floor(row).astype(np.intp), np.floor(column).astype(np.intp)
    for r, by_row in ((top, top + 1 - row), (top + 1, row - top)):
        for c, by_column in ((left, left + 1 - column), (left + 1, column - left)):
            inside = (r >= 0) & (r < rows) & (c >= 0) & (c < columns)
            there = np.where(inside, r, 0) * columns + np.where(inside, c, 0)
            target = np.where(inside & hit[there], there, own)
            share = by_row * by_column * a
            out += np.bincount(target, weights=share.real, minlength=out.size)
            out += 1j * np.bincount(target, weights=share.imag, minlength=out.size)
    return out


@dataclass(frozen=True)
class Raster:
    """Pixels of an image plane and the rays through them; pixels are numbered row by row."""

    rows: int
    columns: int
    fov_deg: tuple[float, float]
    """Horizontal, vertical."""
    rotation: FloatArray
    """(3, 3) from the viewpoint's frame, which looks along +x with +y to the left, to the world."""

    @property
    def size(self) -> int:
        return self.rows * self.columns

    @cached_property
    def _half(self) -> FloatArray:
        """Half the extents (horizontal, vertical) of the image plane at distance 1."""
        return np.asarray(np.tan(np.radians(self.fov_deg) / 2))

    @property
    def pixel(self) -> float:
        """Longer edge of a pixel in the image plane at distance 1, about its angle [rad]."""
        return float(2 * max(self._half[0] / self.columns, self._half[1] / self.rows))

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

    def directions(self, row: FloatArray, column: FloatArray) -> FloatArray:
        """(..., 3) unit vectors through places in pixels from the upper left corner of the image."""
        y = self._half[0] * (1 - 2 * column / self.columns)
        z = self._half[1] * (1 - 2 * row / self.rows)
        vectors = np.stack([np.ones_like(y), y, z], axis=-1)
        vectors /= np.sqrt(1 + y**2 + z**2)[..., None]
        return np.asarray(vectors @ self.rotation.T)

    def beams(self, split: int) -> tuple[FloatArray, FloatArray, IntArray]:
        """Directions (beam, 3), solid angles (beam,) [sr] and pixels (beam,) of `split` times `split` beams each."""
        row, column = np.meshgrid(
            (np.arange(self.rows * split) + 0.5) / split, (np.arange(self.columns * split) + 0.5) / split, indexing="ij"
        )
        row, column = row.ravel(), column.ravel()
        y = self._half[0] * (1 - 2 * column / self.columns)
        z = self._half[1] * (1 - 2 * row / self.rows)
        cell = 4 * self._half[0] * self._half[1] / (self.size * split**2)
        pixel = row.astype(np.int64) * self.columns + column.astype(np.int64)
        return self.directions(row, column), cell / (1 + y**2 + z**2) ** 1.5, pixel

    def places(self, pixel: IntArray, place: IntArray, split: int) -> tuple[FloatArray, FloatArray]:
        """Row and column of patches in pixels from the first pixel's centre; `place` is a patch's number within."""
        row, column = np.divmod(pixel, self.columns)
        down, right = np.divmod(place, split)
        return row + (down + 0.5) / split - 0.5, column + (right + 0.5) / split - 0.5

    def patches(self, pixels: IntArray, split: int) -> tuple[FloatArray, FloatArray, IntArray]:
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
