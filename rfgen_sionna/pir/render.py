"""PIR of a traced scene."""

from __future__ import annotations

import operator
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray
from rfgen_sionna.pir.mirrored_returns import trace_mirrored
from rfgen_sionna.pir.pixel_patches import DiffuseReturns, SceneSnapshot, trace_diffuse, trace_patches
from rfgen_sionna.pir.projection import check_fov, check_projection
from rfgen_sionna.pir.view import Indices, View
from rfgen_sionna.radar import ElementPattern, Radar, Slot
from rfgen_sionna.radar.pose import POLARIZATIONS, Vector, rotation_matrix
from rfgen_sionna.radar.profile import is_number
from rfgen_sionna.records import Pir
from rfgen_sionna.tracing.max_bounces import MOST_BOUNCES

if TYPE_CHECKING:
    from rfgen_sionna.tracing.tracer import Tracer

PATCH_WAVELENGTHS = 1.5
"""Edge of a patch at `PATCH_RANGE` [wavelengths]: smaller than the facets of a body and its radii of curvature."""
DIFFUSE_RAYS = 3
"""Rays along each edge of a pixel for diffuse returns."""
INDIRECT = 1e-2
"""Tolerance of indirect paths, relative to the direct ones."""
NEGLIGIBLE = 0.02
"""Upper bound of a rough pixel's coherent return, relative to its diffuse return, below which it is left out."""
NEGLIGIBLE_EDGE = 1.0
"""The same bound for the return of an edge across the line of sight: such edges are rare."""


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
    """Energy, time of arrival and radial velocity per pixel at time `t` [s].

    A pixel's energy is the return of its surfaces between isotropic elements: the coherent part for vertical
    polarisation, the diffuse part in the mean of both polarisations.

    Coherent part, (1 - S^2) of the energy: \\|sum of the gains of the pixel's patches\\|^2, each integrated in closed
    form. Pixels overlap by linear weights that add up to 1, since a hard border has side lobes on every smooth wall.
    Pixels of rough surfaces away from the specular direction are not split into patches.

    Diffuse part, S^2 of the energy: expected sum over the pixel's rays, whose phases are independent.

    Time of arrival and velocity are means, weighted with the energies of the pixel's own patches and rays.

    Parameters
    ----------
    tracer
        Scene, actors and band.
    t
        Time [s].
    resolution
        (rows, columns).
    fov_deg
        Horizontal field of view [degrees], with square pixels, or (horizontal, vertical): below 180 in perspective, up
        to (360, 180) in an equirectangular image.
    position, orientation
        Viewpoint [m] and its yaw, pitch, roll [rad]; None takes the radar's.
    patch_wavelengths
        Edge of the patches at 3 m [wavelengths]; the run time falls with its square.
    bounces
        Most surfaces on a path, 1 … 3. From 2 on the image includes facet paths by several surfaces within the radar's
        range window, and diffuse returns in mirrors (:mod:`rfgen_sionna.pir.mirrored_returns`). A tracer with
        `transmission` adds returns through slabs.
    indirect
        False leaves the facet paths by several surfaces or through slabs out.
    projection
        "perspective" or "equirectangular" (:class:`~rfgen_sionna.pir.projection.ImagePlane`).

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
    view = View((rows, columns), fov, position, orientation, shape)
    snapshot = SceneSnapshot.of(tracer, t, np.asarray(position, dtype=np.float64))
    field = rotation_matrix(orientation) @ np.asarray(POLARIZATIONS["V"])
    coherent_pixels, scattered = np.ones(view.size, dtype=np.bool_), PixelReturns.none()
    if any(material.scattering_coefficient for material in snapshot.materials):
        directions, solid_angles, pixel = view.rays(DIFFUSE_RAYS)
        found = trace_diffuse(snapshot, directions, solid_angles)
        coherent_pixels = _coherent_pixels(found, pixel[found.ray], view, tracer.radar.wavelength)
        scattered = PixelReturns(pixel[found.ray], found.energy, found.distance, found.velocity)
        if bounces > 1:
            more = trace_mirrored(snapshot, found, directions, solid_angles, columns * DIFFUSE_RAYS)
            mirrored = PixelReturns(view.pixels(more.arrival), more.energy, more.distance, more.velocity)
            scattered = scattered.extended(mirrored)
    traced = np.flatnonzero(view.neighbourhood(coherent_pixels))
    split = view.patch_split(patch_wavelengths * tracer.radar.wavelength, len(traced))
    parts = trace_patches(snapshot, field, *view.patches(traced, split))
    own, patch = np.divmod(parts.ray, split * split)
    patches = PixelReturns(traced[own], np.abs(parts.a) ** 2, parts.distance, parts.velocity)
    row, column = view.patch_coordinates(patches.pixel, patch, split)
    total = _blend(parts.a, row, column, patches.pixel, view) * coherent_pixels
    weights = patches.weighted(np.abs(total) ** 2)
    if indirect and (bounces > 1 or tracer.transmission):
        gains, others = _indirect(tracer, t, bounces, view)
        # Apart from the direct returns: those of a wall off its specular direction cancel in their sum.
        weights += PixelReturns.none().extended(others).weighted(np.abs(gains) ** 2)
        total += gains
    coherent = np.abs(total) ** 2
    diffuse = scattered.total(scattered.energy, view.size)
    weight, distance, speed = weights + scattered.weighted(diffuse)
    arrival, velocity = np.full(view.size, np.nan), np.zeros(view.size)
    hit = weight > 0
    arrival[hit] = (2 / SPEED_OF_LIGHT) * distance[hit] / weight[hit]
    velocity[hit] = speed[hit] / weight[hit]
    return view.pir(coherent + diffuse, arrival, velocity, t)


def _indirect(tracer: Tracer, t: float, bounces: int, view: View) -> tuple[ComplexArray, PixelReturns]:
    """(pixel,) gains of coherent returns by several surfaces or through slabs, and these returns."""
    radar = _one_element(tracer.radar, view.position, view.orientation)
    given = tracer.scene, radar, tracer.actors, INDIRECT
    paths = type(tracer)(*given, max_bounces=bounces, transmission=tracer.transmission).instant(t, indirect=True)
    a = paths.a[0, 0, :, 0] * np.exp(-2j * np.pi * np.mod(paths.frequency * paths.tau[0, 0, :, 0], 1.0))
    pixel = view.pixels(paths.arrival[:, 0])
    there = pixel >= 0
    gains = np.bincount(pixel[there], a.real[there], view.size) + 1j * np.bincount(
        pixel[there], a.imag[there], view.size
    )
    return gains, PixelReturns(pixel, np.abs(a) ** 2, paths.range[:, 0], paths.velocity[:, 0])


def _one_element(radar: Radar, position: Vector, orientation: Vector) -> Radar:
    """Radar of one isotropic, vertically polarised element for both Tx and Rx, in the band of `radar`."""
    here, waveform = np.zeros((1, 3)), radar.waveform
    slots = tuple(Slot((0.0,), number) for number in range(len(waveform.profiles))) if waveform.slots else ()
    return replace(
        radar, waveform=replace(waveform, tx_order=() if slots else (0,), slots=slots, slot_starts=None),
        tx_names=radar.tx_names[:1], rx_names=radar.rx_names[:1], tx_positions=here, rx_positions=here,
        tx_polarization="V", rx_polarization="V", pattern=ElementPattern(0.0), position=position,
        orientation=orientation, trajectory=None,
    )  # fmt: skip


class PixelReturns(NamedTuple):
    """Energies in pixels."""

    pixel: Indices
    """(return,)"""
    energy: FloatArray
    """(return,)"""
    distance: FloatArray
    """(return,) half the path length [m]."""
    velocity: FloatArray
    """(return,) [m/s]"""

    @staticmethod
    def none() -> PixelReturns:
        return PixelReturns(np.zeros(0, np.int64), np.zeros(0), np.zeros(0), np.zeros(0))

    def extended(self, more: PixelReturns) -> PixelReturns:
        """These returns and those of `more` inside the image (pixel 0 or more)."""
        inside = more.pixel >= 0
        return PixelReturns(*(np.concatenate([a, b[inside]]) for a, b in zip(self, more, strict=True)))

    def total(self, values: FloatArray, size: int) -> FloatArray:
        """(pixel,) sum of `values` (return,) over the returns of each of `size` pixels."""
        return np.bincount(self.pixel, weights=values, minlength=size).astype(np.float64, copy=False)

    def weighted(self, total: FloatArray) -> FloatArray:
        """(3, pixel) weights, weights times distance, weights times velocity; `total` (pixel,) is shared by energy."""
        # Surfaces seen edge-on have no energy, and still a distance where nothing else has one.
        energy = self.energy + 1e-12 * self.energy.max(initial=1e-300)
        shares = self.total(energy, len(total))
        least = np.maximum(total, 1e-12 * total.max(initial=1e-300))
        weight = energy * (least / np.maximum(shares, 1e-300))[self.pixel]
        return np.stack([self.total(weight * each, len(total)) for each in (1.0, self.distance, self.velocity)])


def _coherent_pixels(found: DiffuseReturns, pixel: Indices, view: View, wavelength: float) -> NDArray[np.bool_]:
    """(pixel,) whether the coherent return may exceed a small share of the diffuse one.

    On a flat surface the linear weights of a pixel of width w leave (lambda / (2 pi w tan(theta)))^4 of its return at
    normal incidence, which is pi w^2 (1 - S^2) / (lambda S)^2 of the diffuse energy. An edge within the pixel returns
    up to (1 - S^2) / (4 pi S^2 tan^2(theta)) of it.
    """
    rough = np.maximum(found.roughness, 1e-12)
    tangent2 = np.maximum(1.0 - found.cos**2, 0.0) / np.maximum(found.cos, 1e-9) ** 2
    width = view.pixel_width * found.distance
    lobe = np.minimum(1.0, (wavelength / (2 * np.pi * width)) ** 2 / np.maximum(tangent2, 1e-12))
    flat = np.pi * (width / wavelength) ** 2 * (1 - rough) / rough * lobe**2
    counts = np.zeros(view.size, dtype=np.bool_)
    counts[pixel[flat > NEGLIGIBLE]] = True
    edge = (1 - rough) / (4 * np.pi * rough * np.maximum(tangent2, 1e-12)) > NEGLIGIBLE_EDGE
    number = np.bincount(pixel, minlength=view.size)
    mean = np.stack(
        [np.bincount(pixel, weights=found.normal[:, axis], minlength=view.size) for axis in range(3)], axis=1
    )
    curved = np.linalg.norm(mean, axis=1) < 0.995 * number
    first = np.full(view.size, -1)
    first[pixel] = found.object
    several = np.zeros(view.size, dtype=np.bool_)
    several[pixel[found.object != first[pixel]]] = True
    has_edge = curved | several | ((number > 0) & (number < DIFFUSE_RAYS**2))
    counts[pixel[edge & has_edge[pixel]]] = True
    return counts


def _blend(a: ComplexArray, row: FloatArray, column: FloatArray, own: Indices, view: View) -> ComplexArray:
    """(pixel,) sum of patch gains, each shared among the four nearest pixel centres by bilinear weights.

    `row`, `column` are in pixels from the first centre. Pixels without a hit leave their shares to the patch's own one.
    """
    rows, columns = view.resolution
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
    """Raise a ValueError unless `bounces` is a whole number in 1 … 3."""
    whole = isinstance(bounces, (int, np.integer)) and not isinstance(bounces, bool)
    if not (whole and 1 <= bounces <= MOST_BOUNCES):
        raise ValueError(f"bounces is {bounces!r}: a whole number of 1 … {MOST_BOUNCES} is needed")


def check_view(
    resolution: tuple[int, int], fov_deg: float | tuple[float, float], projection: str = "perspective"
) -> tuple[int, int, tuple[float, float]]:
    """Rows, columns and (horizontal, vertical) field of view [degrees] of valid arguments; ValueError otherwise."""
    try:
        rows, columns = (operator.index(n) for n in resolution if not isinstance(n, bool))
    except (TypeError, ValueError):
        rows = columns = 0
    if not (1 <= rows <= 4096 and 1 <= columns <= 4096):
        raise ValueError(f"resolution is {resolution!r}: (rows, columns), whole numbers in 1 … 4096, are needed")
    return rows, columns, check_fov(fov_deg, check_projection(projection), (rows, columns))
