"""Power against range and azimuth: range-azimuth maps and dynamic range-angle images (DRAI)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rfgen_sionna._short_repr import ShortRepr
from rfgen_sionna._types import FloatArray
from rfgen_sionna.processing.angle import compensate_tdm, steering, unit_vectors
from rfgen_sionna.processing.array_namespace import array_namespace, as_type, complex_type, constant
from rfgen_sionna.processing.demultiplex import as_beams
from rfgen_sionna.processing.spectrum import (
    Window,
    check_cube,
    range_axis,
    range_doppler,
    squared_magnitude,
    taper,
)

if TYPE_CHECKING:
    from rfgen_sionna.radar import Radar


def row_weights(radar: Radar, window: str = "none") -> FloatArray:
    """(tx, rx) weights of azimuth maps, of sum 1: the horizontal row with most virtual elements, others 0.

    Elements off that row would change azimuth by elevation. `window` over the element positions is "none" or "hamming"
    (lower side lobes, a wider beam); another one is a ValueError.
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
        # One element pitch longer, so that no element has the weight of the window's end.
        aperture = (high - low) + radar.wavelength / 2
        shape = 0.54 + 0.46 * np.cos(2 * np.pi * (y - (low + high) / 2) / aperture)
    else:
        raise ValueError(f"window is {window!r}; allowed: 'none', 'hamming'")
    weights = np.where(row, shape, 0.0)
    return weights / weights.sum()


@dataclass(frozen=True, repr=False)
class RangeAzimuth(ShortRepr):
    """Power against range and azimuth."""

    power: FloatArray
    """(..., range, azimuth) sum over Doppler: |amplitude|² of the samples for one target."""
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
    """Range-azimuth map: beams of the array's main row, each Doppler bin compensated for the times of its slots.

    Parameters
    ----------
    cube
        (..., chirp, tx, rx, sample), an array, or a tensor of PyTorch, which has a power on its device.
    azimuth
        (azimuth,) [rad]; None takes 128 directions, even in their sine, within ±90°.
    max_range
        Largest range of the map [m]; None takes all bins.
    static
        Whether static returns are kept.
    array_window
        "hamming" or "none", see :func:`row_weights`.
    """
    angles = np.arcsin((np.arange(128) + 0.5) / 64 - 1) if azimuth is None else np.asarray(azimuth, np.float64)
    array, radar = as_beams(cube, radar)
    maps = range_doppler(array, radar, range_window=range_window, correct_coupling=True, static=static)
    # At least one bin: the nearest.
    bins = len(maps.range) if max_range is None else max(1, int(np.searchsorted(maps.range, max_range, side="right")))
    xp = array_namespace(array)
    spectrum = xp.moveaxis(maps.spectrum[..., :bins], -1, -4)
    spectrum = compensate_tdm(spectrum, radar, maps.velocity)
    beams = steering(radar, unit_vectors(angles, 0.0)).conj() * row_weights(radar, array_window)
    used = row_weights(radar) > 0
    # One matrix product instead of one for each range bin.
    chosen = spectrum[..., constant(used, spectrum)]
    matrix = constant(np.ascontiguousarray(beams[:, used].T.astype(complex_type(spectrum))), spectrum)
    beam = (chosen.reshape(-1, chosen.shape[-1]) @ matrix).reshape(*chosen.shape[:-1], len(angles))
    # Parseval: power of the bins of a windowed tone over its own power.
    chirps = array.shape[-4]
    spread = chirps * np.sum(np.square(taper("hann", chirps)))
    power = squared_magnitude(beam).sum(axis=-2) / spread
    return RangeAzimuth(power=power, range=maps.range[:bins], azimuth=angles)


@dataclass(frozen=True, repr=False)
class DynamicRangeAngle(ShortRepr):
    """Dynamic range-angle images (DRAI), the input of gesture networks such as DI-Gesture's."""

    image: NDArray[np.float32]
    """(frame, range, angle) power of moving returns."""
    range: FloatArray
    """(range,) [m]"""
    angle: FloatArray
    """(angle,) azimuth [rad], ascending from right to left, even in its sine."""


def drai(cube: ArrayLike, radar: Radar, *, range_bins: int = 32, angle_bins: int = 32) -> DynamicRangeAngle:
    """One image a frame of the moving scene: the first `range_bins` against `angle_bins` beams.

    Range FFT, removal of static returns by the mean over the chirps, angle spectrum, as for the published images; here
    also with compensation of the TDM phase of each Doppler bin.

    Parameters
    ----------
    cube
        (frame, chirp, tx, rx, sample), an array, or a tensor of PyTorch, which has images on its device.

    Raises
    ------
    ValueError
        For another number of axes or an invalid number of bins.
    """
    array = check_cube(cube, radar, frames=True, tensors=True)
    most = len(range_axis(radar, array.shape[-1])) if radar.waveform.slope else array.shape[-1]
    if not 1 <= range_bins <= most or angle_bins < 2:
        raise ValueError(
            f"range_bins is {range_bins} and angle_bins {angle_bins}: 1 … {most} (the range axis) and at least 2 are "
            "needed"
        )
    angle = np.arcsin((np.arange(angle_bins) + 0.5) * (2 / angle_bins) - 1)
    limit = (range_bins - 0.5) * radar.waveform.range_window / array.shape[-1]
    maps = [range_azimuth(frame, radar, azimuth=angle, max_range=limit, static=False) for frame in array]
    images = array_namespace(array).stack([item.power for item in maps])
    return DynamicRangeAngle(image=as_type(images, "float32"), range=maps[0].range, angle=angle)
