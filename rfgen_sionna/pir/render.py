"""Rendering the PIR of a traced scene."""

from __future__ import annotations

import operator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray
from rfgen_sionna.pir.mirrored_returns import trace_mirrored
from rfgen_sionna.pir.pixel_patches import DiffuseReturns, SceneSnapshot, trace_diffuse, trace_patches
from rfgen_sionna.pir.projection import check_fov, check_projection
from rfgen_sionna.pir.raster import Indices, Raster
from rfgen_sionna.radar import ElementPattern, Radar, Slot
from rfgen_sionna.radar.pose import POLARIZATIONS, Vector, rotation_matrix
from rfgen_sionna.radar.profile import is_number
from rfgen_sionna.records import Pir
from rfgen_sionna.tracing.max_bounces import MOST_BOUNCES
from rfgen_sionna.tracing.tracer import Tracer

PATCH_WAVELENGTHS = 1.5
"""Edge of the patch that one ray stands for, at `PATCH_RANGE`: smaller than the facets and the bends of a body."""
DIFFUSE_RAYS = 3
"""Beams along each edge of a pixel for what rough surfaces return diffusely."""
INDIRECT = 1e-2
"""Tolerance of returns by several surfaces or through slabs, relative to the direct ones."""
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
    bounces: int = 1,
    indirect: bool = True,
    projection: str = "perspective",
) -> Pir:
    """Energy, time of arrival and radial velocity per pixel at instant `t` [s].

    A pixel's energy is what its surfaces return to isotropic elements, coherently to vertically polarised ones and
    diffusely in the mean of both polarisations.

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
        Horizontal field of view [degrees], with square pixels, or (horizontal, vertical): below 180 in perspective, up
        to (360, 180) in an equirectangular image.
    position, orientation
        Viewpoint [m] and its yaw, pitch, roll [rad]; those of the radar if None.
    patch_wavelengths
        Edge of the patches at 3 m [wavelengths]. The default resolves the bends of a body; flat surfaces take several
        times as much without harm, and the time falls with its square.
    bounces
        Most surfaces on a path, 1 … 3. From 2 on the image has coherent returns by several surfaces, which are facet
        paths (:meth:`rfgen_sionna.tracing.tracer.Tracer.instant`) within the radar's range window, each in the pixel
        that it comes from, and diffuse returns of rough surfaces that smooth ones reflect
        (:mod:`rfgen_sionna.pir.mirrored_returns`). Where the tracer has `transmission`, returns through slabs are in.
    indirect
        False leaves these facet paths out, which take long in a furnished room.
    projection
        "perspective", or "equirectangular": azimuth and elevation evenly
        (:class:`~rfgen_sionna.pir.projection.ImagePlane`).

    Raises
    ------
    ValueError
        If the resolution, the projection, the field of view, `patch_wavelengths` or `bounces` is out of range.
    """
    shape = check_projection(projection)
    rows, columns, fov = check_view(resolution, fov_deg, shape)
    if not (is_number(patch_wavelengths) and 0.25 <= patch_wavelengths <= 100.0):
        raise ValueError(f"patch_wavelengths is {patch_wavelengths!r}: a number of 0.25 … 100 is needed")
    check_bounces(bounces)
    position = tracer.radar.position if position is None else position
    orientation = tracer.radar.orientation if orientation is None else orientation
    view = Raster(rows, columns, fov, rotation_matrix(orientation), shape)
    snapshot = SceneSnapshot.of(tracer, t, np.asarray(position, dtype=np.float64))
    field = rotation_matrix(orientation) @ np.asarray(POLARIZATIONS["V"])
    counts, beams = np.ones(view.size, dtype=np.bool_), PixelReturns.none()
    if any(material.scattering_coefficient for material in snapshot.materials):
        directions, solid_angles, pixel = view.beams(DIFFUSE_RAYS)
        diffuse_returns = trace_diffuse(snapshot, directions, solid_angles)
        counts = _coherence_counts(diffuse_returns, pixel[diffuse_returns.ray], view, tracer.radar.wavelength)
        beams = PixelReturns(
            pixel[diffuse_returns.ray], diffuse_returns.energy, diffuse_returns.distance, diffuse_returns.velocity
        )
        if bounces > 1:
            more = trace_mirrored(snapshot, diffuse_returns, directions, solid_angles, columns * DIFFUSE_RAYS)
            beams = beams.extended(PixelReturns(view.pixels(more.arrival), more.energy, more.distance, more.velocity))
    traced = np.flatnonzero(view.around(counts))
    split = view.split(patch_wavelengths * tracer.radar.wavelength, len(traced))
    found = trace_patches(snapshot, field, *view.patches(traced, split))
    patch, place = np.divmod(found.ray, split * split)
    patches = PixelReturns(traced[patch], np.abs(found.a) ** 2, found.distance, found.velocity)
    row, column = view.places(patches.pixel, place, split)
    total = _blend(found.a, row, column, patches.pixel, view) * counts
    placed = patches.weighted(np.abs(total) ** 2)
    if indirect and (bounces > 1 or tracer.transmission):
        gains, others = _indirect(tracer, t, bounces, view, position, orientation)
        # Each weighs what it returns by itself: single returns of a wall off its mirror direction cancel.
        placed += PixelReturns.none().extended(others).weighted(np.abs(gains) ** 2)
        total += gains
    coherent = np.abs(total) ** 2
    diffuse = beams.total(beams.energy, view.size)
    weight, distance, speed = placed + beams.weighted(diffuse)
    arrival, velocity = np.full(view.size, np.nan), np.zeros(view.size)
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
        projection=shape,
        time=float(t),
    )


def _indirect(
    tracer: Tracer, t: float, bounces: int, view: Raster, position: Vector, orientation: Vector
) -> tuple[ComplexArray, PixelReturns]:
    """(pixel,) gains of coherent returns by several surfaces or through slabs, and these returns."""
    radar = _one_element(tracer.radar, position, orientation)
    given = tracer.scene, radar, tracer.actors, INDIRECT
    paths = Tracer(*given, max_bounces=bounces, transmission=tracer.transmission).instant(t, indirect=True)
    a = paths.a[0, 0, :, 0] * np.exp(-2j * np.pi * np.mod(paths.frequency * paths.tau[0, 0, :, 0], 1.0))
    pixel = view.pixels(paths.arrival[:, 0])
    there = pixel >= 0
    gains = np.bincount(pixel[there], a.real[there], view.size) + 1j * np.bincount(
        pixel[there], a.imag[there], view.size
    )
    return gains, PixelReturns(pixel, np.abs(a) ** 2, paths.range[:, 0], paths.velocity[:, 0])


def _one_element(radar: Radar, position: Vector, orientation: Vector) -> Radar:
    """One isotropic, vertically polarised element that sends and receives, in the band of `radar`."""
    here, waveform = np.zeros((1, 3)), radar.waveform
    slots = tuple(Slot((0.0,), number) for number in range(len(waveform.profiles))) if waveform.slots else ()
    return replace(
        radar,
        waveform=replace(waveform, tx_order=() if slots else (0,), slots=slots, slot_starts=None),
        tx_names=radar.tx_names[:1],
        rx_names=radar.rx_names[:1],
        tx_positions=here,
        rx_positions=here,
        tx_polarization="V",
        rx_polarization="V",
        pattern=ElementPattern(0.0),
        position=position,
        orientation=orientation,
        trajectory=None,
    )


class PixelReturns(NamedTuple):
    """Energies that pixels receive."""

    pixel: Indices
    """(return,)"""
    energy: FloatArray
    """(return,)"""
    distance: FloatArray
    """(return,) half the way there and back [m]."""
    velocity: FloatArray
    """(return,) [m/s]"""

    @staticmethod
    def none() -> PixelReturns:
        return PixelReturns(np.zeros(0, np.int64), np.zeros(0), np.zeros(0), np.zeros(0))

    def extended(self, more: PixelReturns) -> PixelReturns:
        """These and others, but for those outside of the image (pixel -1)."""
        inside = more.pixel >= 0
        return PixelReturns(
            np.concatenate([self.pixel, more.pixel[inside]]),
            np.concatenate([self.energy, more.energy[inside]]),
            np.concatenate([self.distance, more.distance[inside]]),
            np.concatenate([self.velocity, more.velocity[inside]]),
        )

    def total(self, values: FloatArray, size: int) -> FloatArray:
        """(pixel,) sum of `values` (return,) over the returns of each of `size` pixels."""
        return np.bincount(self.pixel, weights=values, minlength=size).astype(np.float64, copy=False)

    def weighted(self, total: FloatArray) -> FloatArray:
        """(3, pixel) weights, times distance and times velocity: the weights add up to `total` (pixel,), shared among
        a pixel's returns as their energies are."""
        # What returns nothing at all (edge on) has a place all the same, where nothing else has.
        energy = self.energy + 1e-12 * self.energy.max(initial=1e-300)
        shares = self.total(energy, len(total))
        least = np.maximum(total, 1e-12 * total.max(initial=1e-300))
        weight = energy * (least / np.maximum(shares, 1e-300))[self.pixel]
        return np.stack([self.total(weight * each, len(total)) for each in (1.0, self.distance, self.velocity)])


def _coherence_counts(
    diffuse_returns: DiffuseReturns, pixel: Indices, view: Raster, wavelength: float
) -> NDArray[np.bool_]:
    """(pixel,) whether the coherent return may be more than a small share of the diffuse one.

    Over a flat surface the linear weights of a pixel that is w wide leave (lambda / (2 pi w tan(theta)))^4 of what it
    returns at normal incidence, and that is pi w^2 (1 - S^2) / (lambda S)^2 of the diffuse energy. Where the surface
    ends within the pixel, or has a bend, up to (1 - S^2) / (4 pi S^2 tan^2(theta)) of it comes from that edge.
    """
    rough = np.maximum(diffuse_returns.roughness, 1e-12)
    tangent2 = np.maximum(1.0 - diffuse_returns.cos**2, 0.0) / np.maximum(diffuse_returns.cos, 1e-9) ** 2
    width = view.pixel * diffuse_returns.distance
    lobe = np.minimum(1.0, (wavelength / (2 * np.pi * width)) ** 2 / np.maximum(tangent2, 1e-12))
    flat = np.pi * (width / wavelength) ** 2 * (1 - rough) / rough * lobe**2
    counts = np.zeros(view.size, dtype=np.bool_)
    counts[pixel[flat > NEGLIGIBLE]] = True
    edge = (1 - rough) / (4 * np.pi * rough * np.maximum(tangent2, 1e-12)) > NEGLIGIBLE_EDGE
    number = np.bincount(pixel, minlength=view.size)
    mean = np.stack(
        [np.bincount(pixel, weights=diffuse_returns.normal[:, axis], minlength=view.size) for axis in range(3)], axis=1
    )
    bent = np.linalg.norm(mean, axis=1) < 0.995 * number
    first = np.full(view.size, -1)
    first[pixel] = diffuse_returns.object
    several = np.zeros(view.size, dtype=np.bool_)
    several[pixel[diffuse_returns.object != first[pixel]]] = True
    torn = bent | several | ((number > 0) & (number < DIFFUSE_RAYS**2))
    counts[pixel[edge & torn[pixel]]] = True
    return counts


def _blend(a: ComplexArray, row: FloatArray, column: FloatArray, own: Indices, view: Raster) -> ComplexArray:
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


def check_bounces(bounces: int) -> None:
    """Raise a ValueError that says what is allowed unless `bounces` may be most surfaces on a path."""
    whole = isinstance(bounces, (int, np.integer)) and not isinstance(bounces, bool)
    if not (whole and 1 <= bounces <= MOST_BOUNCES):
        raise ValueError(f"bounces is {bounces!r}: a whole number of 1 … {MOST_BOUNCES} is needed")


def check_view(
    resolution: tuple[int, int], fov_deg: float | tuple[float, float], projection: str = "perspective"
) -> tuple[int, int, tuple[float, float]]:
    """Rows, columns and (horizontal, vertical) field of view [degrees], or a ValueError that says what is allowed."""
    try:
        rows, columns = (operator.index(n) for n in resolution if not isinstance(n, bool))
    except (TypeError, ValueError):
        rows = columns = 0
    if not (1 <= rows <= 4096 and 1 <= columns <= 4096):
        raise ValueError(f"resolution is {resolution!r}: (rows, columns), whole numbers in 1 … 4096, are needed")
    return rows, columns, check_fov(fov_deg, check_projection(projection), (rows, columns))
