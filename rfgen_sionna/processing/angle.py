"""Directions of arrival from the virtual array of a TDM-MIMO radar.

Everything works on the element positions as they are; no regular array is assumed. Directions are in the device
frame (boresight +x, y to the left, z up): azimuth atan2(y, x) grows to the left, elevation asin(z) upwards.
A target in direction u at a distance R shows the channel (tx, rx) with the path |R u - p_tx| + |R u - p_rx|, far
away 2 R - (p_tx + p_rx) . u, and the beat signal turns with +k times that path.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rfgen_sionna.processing.spectrum import Window, range_doppler, remove_static, taper
from rfgen_sionna.records import FloatArray

if TYPE_CHECKING:
    from rfgen_sionna.radar import Radar

ComplexChannels = NDArray[np.complexfloating[Any, Any]]


def unit_vectors(azimuth: ArrayLike, elevation: ArrayLike) -> FloatArray:
    """(..., 3) unit vectors in the device frame for angles [rad], broadcast against each other."""
    az, el = np.broadcast_arrays(np.asarray(azimuth, np.float64), np.asarray(elevation, np.float64))
    return np.stack([np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), np.sin(el)], axis=-1)


def steering(radar: Radar, direction: FloatArray, distance: FloatArray | None = None) -> NDArray[np.complex128]:
    """(..., tx, rx) phase factors of a target at unit vectors `direction` (..., 3), relative to the frame's origin.

    With `distance` (...) [m] the wave front is the true sphere, without it plane.
    """
    wavenumber = 2 * np.pi / radar.wavelength
    if distance is None:
        path = -np.einsum("trk,...k->...tr", radar.virtual_positions, direction)
    else:
        away = np.asarray(distance, np.float64)[..., None]
        point = (direction * away)[..., None, :]
        out = np.linalg.norm(point - radar.tx_positions, axis=-1) - away
        back = np.linalg.norm(point - radar.rx_positions, axis=-1) - away
        path = out[..., :, None] + back[..., None, :]
    return np.exp(1j * wavenumber * path)


def compensate_tdm(channels: ComplexChannels, radar: Radar, velocity: ArrayLike) -> ComplexChannels:
    """Turn every Tx back by the Doppler phase it gathered until its slot.

    Parameters
    ----------
    channels
        (..., tx, rx) values of one Doppler bin each.
    velocity
        (...) radial velocity [m/s] of that bin, positive receding. Add multiples of `2 radar.max_velocity` to try
        another Doppler ambiguity: the Doppler spectrum cannot tell them apart, the array can.
    """
    delay = radar.waveform.chirp_times[0]
    frequency = 2 * np.asarray(velocity, np.float64) / radar.wavelength
    turn = np.exp(-2j * np.pi * frequency[..., None] * delay).astype(channels.dtype, copy=False)
    return channels * turn[..., None]


def row_weights(radar: Radar, window: str = "none") -> FloatArray:
    """(tx, rx) weights for azimuth maps: the horizontal row with most virtual elements, others 0; their sum is 1.

    Elements off that row would bring the elevation of a target into its azimuth.

    Parameters
    ----------
    window
        "none" or "hamming" (over the true element positions: lower side lobes, a wider beam).
    """
    position = radar.virtual_positions
    height = np.round(position[..., 2] / (radar.wavelength / 16)).astype(int)
    rows, count = np.unique(height, return_counts=True)
    row = height == rows[np.argmax(count)]
    y = position[..., 1]
    low, high = y[row].min(), y[row].max()
    if window == "none":
        shape = np.ones_like(y)
    elif window == "hamming":
        # One element pitch more than the aperture, as a sampled window has.
        aperture = (high - low) + radar.wavelength / 2
        shape = 0.54 + 0.46 * np.cos(2 * np.pi * (y - (low + high) / 2) / aperture)
    else:
        raise ValueError(f"window is {window!r}; allowed: 'none', 'hamming'")
    weights = np.where(row, shape, 0.0)
    return weights / weights.sum()


@dataclass(frozen=True)
class Directions:
    """Direction estimates, one per channel vector."""

    azimuth: FloatArray
    """(n,) [rad], positive to the left."""
    elevation: FloatArray
    """(n,) [rad], positive upwards; 0 where the array has one row only."""
    velocity: FloatArray
    """(n,) [m/s] the radial velocity given, or the ambiguity of it that fits the array best."""
    power: FloatArray
    """(n,) power of the beam in that direction: that of one channel if all channels agree."""


def find_directions(
    channels: ComplexChannels,
    radar: Radar,
    velocity: ArrayLike,
    *,
    distance: ArrayLike | None = None,
    ambiguities: int = 0,
) -> Directions:
    """Strongest direction of each channel vector: the peak of the beam over all true element positions.

    For one target this is the maximum-likelihood estimate. A search over direction cosines, four steps a beam
    width, is followed by a local search down to 1/500 of a beam width.

    Parameters
    ----------
    channels
        (n, tx, rx) values at the range-Doppler peaks, not yet compensated for TDM.
    velocity
        (n,) radial velocity [m/s] of each peak.
    distance
        (n,) [m]; given, the wave front is a sphere. It matters where (aperture)² / (8 distance) nears λ/16.
    ambiguities
        Also try `velocity` plus up to so many multiples of `2 radar.max_velocity` on either side and keep the best.
        Needs several Tx elements in different slots.
    """
    channels = np.asarray(channels)
    count = len(channels)
    shape = (len(radar.tx_positions), len(radar.rx_positions))
    if channels.ndim != 3 or channels.shape[1:] != shape:
        raise ValueError(f"channels have shape {channels.shape}: (n, tx, rx) = (n, {shape[0]}, {shape[1]}) is needed")
    if ambiguities < 0 or (ambiguities > 0 and radar.waveform.num_slots == 1):
        raise ValueError(
            f"ambiguities is {ambiguities}: 0 or more is needed, and more than 0 only with several TDM slots "
            f"(radar '{radar.name}' has {radar.waveform.num_slots})"
        )
    speed = np.broadcast_to(np.asarray(velocity, np.float64), (count,))
    away = None if distance is None else np.broadcast_to(np.asarray(distance, np.float64), (count,))
    best = Directions(np.zeros(count), np.zeros(count), speed.copy(), np.full(count, -np.inf))
    for fold in sorted(range(-ambiguities, ambiguities + 1), key=abs):
        trial = speed + 2 * fold * radar.max_velocity
        found = _search(compensate_tdm(channels.astype(np.complex128), radar, trial), radar, away)
        # A tie (an array that cannot tell) stays with the smaller speed.
        better = found[2] > best.power * (1 + 1e-6) if fold else np.ones(count, bool)
        best = Directions(
            *(
                np.where(better, new, old)
                for new, old in (
                    (found[0], best.azimuth),
                    (found[1], best.elevation),
                    (trial, best.velocity),
                    (found[2], best.power),
                )
            )
        )
    return best


def _search(
    channels: ComplexChannels, radar: Radar, distance: FloatArray | None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    count, elements = len(channels), channels.shape[1] * channels.shape[2]
    flat = channels.reshape(count, elements)
    position = radar.virtual_positions.reshape(-1, 3)
    extent = np.ptp(position, axis=0)
    step = np.zeros(2)
    grids = []
    for axis in (1, 2):
        if extent[axis] < radar.wavelength / 20:
            grids.append(np.zeros(1))
            continue
        # Four steps a beam width of wavelength / aperture; the sum of positions counts one way.
        half = int(np.ceil(4 * (extent[axis] + radar.wavelength / 2) / radar.wavelength))
        step[axis - 1] = 1 / half
        grids.append(np.linspace(-1, 1, 2 * half + 1))
    uy, uz = (grid.ravel() for grid in np.meshgrid(*grids, indexing="ij"))
    visible = uy**2 + uz**2 <= 1
    uy, uz = uy[visible], uz[visible]
    beams = steering(radar, _direction(uy, uz)).reshape(len(uy), elements).conj()
    cosines = np.empty((count, 2))
    for start in range(0, count, 256):
        part = slice(start, start + 256)
        first = np.abs(flat[part] @ beams.T).argmax(axis=1)
        cosines[part] = np.stack([uy[first], uz[first]], axis=1)
    offset = np.array([(a, b) for a in (-1, -0.5, 0, 0.5, 1) for b in (-1, -0.5, 0, 0.5, 1)])
    power = np.empty(count)
    for _ in range(8):
        trial = cosines[:, None, :] + offset * step
        # Stay on the visible half sphere.
        trial /= np.maximum(1.0, np.linalg.norm(trial, axis=-1, keepdims=True))
        away = None if distance is None else np.broadcast_to(distance[:, None], trial.shape[:2])
        beam = steering(radar, _direction(trial[..., 0], trial[..., 1]), away).reshape(count, len(offset), elements)
        response = np.abs(np.einsum("ndc,nc->nd", beam.conj(), flat))
        pick = response.argmax(axis=1)
        cosines = np.take_along_axis(trial, pick[:, None, None], axis=1)[:, 0]
        power = np.square(np.take_along_axis(response, pick[:, None], axis=1)[:, 0] / elements)
        step = step / 2
    u = _direction(cosines[:, 0], cosines[:, 1])
    return np.arctan2(u[:, 1], u[:, 0]), np.arcsin(np.clip(u[:, 2], -1, 1)), power


def _direction(uy: FloatArray, uz: FloatArray) -> FloatArray:
    return np.stack([np.sqrt(np.maximum(0.0, 1 - uy**2 - uz**2)), uy, uz], axis=-1)


@dataclass(frozen=True)
class RangeAzimuth:
    """Power against range and azimuth."""

    power: FloatArray
    """(..., range, azimuth), summed over Doppler: |amplitude|² of the samples for one target."""
    range: FloatArray
    """(range,) [m]"""
    azimuth: FloatArray
    """(azimuth,) [rad], ascending from right to left."""


def range_azimuth(
    cube: ArrayLike,
    radar: Radar,
    *,
    azimuth: ArrayLike | None = None,
    max_range: float | None = None,
    static: bool = True,
    array_window: str = "hamming",
    range_window: Window = "hann",
) -> RangeAzimuth:
    """Range-azimuth map: beams on the array's main row, each Doppler bin compensated for its TDM phase.

    Parameters
    ----------
    cube
        (..., chirp, tx, rx, sample).
    azimuth
        (azimuth,) [rad]; by default 128 directions, even in their sine, within ±90°.
    max_range
        Range bins beyond it are left out [m].
    static
        Whether what does not move is kept.
    array_window
        "hamming" or "none", see :func:`row_weights`.
    """
    angles = np.arcsin((np.arange(128) + 0.5) / 64 - 1) if azimuth is None else np.asarray(azimuth, np.float64)
    maps = range_doppler(
        cube if static else remove_static(cube), radar, range_window=range_window, correct_coupling=True
    )
    # At least one bin: the nearest.
    bins = len(maps.range) if max_range is None else max(1, int(np.searchsorted(maps.range, max_range, side="right")))
    spectrum = np.moveaxis(maps.spectrum[..., :bins], -1, -4)
    spectrum = compensate_tdm(spectrum, radar, maps.velocity)
    beams = steering(radar, unit_vectors(angles, 0.0)).conj() * row_weights(radar, array_window)
    used = row_weights(radar) > 0
    beam = spectrum[..., used] @ beams[:, used].T.astype(spectrum.dtype)
    # Parseval: the bins of one windowed tone add up to its power times this.
    spread = len(maps.velocity) * np.sum(np.square(taper("hann", len(maps.velocity))))
    power = np.sum(np.square(beam.real, dtype=np.float64) + np.square(beam.imag, dtype=np.float64), axis=-2) / spread
    return RangeAzimuth(power=power, range=maps.range[:bins], azimuth=angles)


@dataclass(frozen=True)
class DynamicRangeAngle:
    """Dynamic range-angle images (DRAI), the input of gesture networks such as DI-Gesture's."""

    image: NDArray[np.float32]
    """(frame, range, angle) power of what moves."""
    range: FloatArray
    """(range,) [m]"""
    angle: FloatArray
    """(angle,) azimuth [rad], ascending from right to left, even in its sine."""


def drai(cube: ArrayLike, radar: Radar, *, range_bins: int = 32, angle_bins: int = 32) -> DynamicRangeAngle:
    """One image a frame of the moving scene: the first range bins against `angle_bins` beams, (T, 32, 32).

    Static returns are taken out by the mean over the chirps of a frame. The published images come from the same
    steps (range FFT, clutter removal, angle spectrum, rows range and columns angle); here each Doppler bin is
    also freed of its TDM phase, so that motion does not look like angle.

    Parameters
    ----------
    cube
        (frame, chirp, tx, rx, sample).
    """
    array = np.asarray(cube)
    if array.ndim != 5:
        raise ValueError(f"cube has shape {array.shape}: the axes (frame, chirp, tx, rx, sample) are needed")
    if not 1 <= range_bins <= array.shape[-1] or angle_bins < 2:
        raise ValueError(
            f"range_bins is {range_bins} and angle_bins {angle_bins}: 1 … {array.shape[-1]} (the samples of a chirp) "
            "and at least 2 are needed"
        )
    angle = np.arcsin((np.arange(angle_bins) + 0.5) * (2 / angle_bins) - 1)
    limit = (range_bins - 0.5) * radar.max_range / array.shape[-1]
    maps = [range_azimuth(frame, radar, azimuth=angle, max_range=limit, static=False) for frame in array]
    return DynamicRangeAngle(
        image=np.stack([item.power for item in maps]).astype(np.float32), range=maps[0].range, angle=angle
    )
