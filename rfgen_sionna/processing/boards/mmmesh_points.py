"""mmMesh's points: the strongest 128 cells of each frame, with six fields.

The steps are those of the published processing (H. Xue et al., MobiSys 2021): Hamming windows, the mean over the chirps
subtracted from range profiles, the coherent sum of all channels as the energy of a cell, azimuth by a 64-point
transform of the eight channels of the azimuth row, elevation by the phase of the other row's strongest bin. That row's
transform has four bins, which puts heights off by up to 0.4 in the direction cosine between its bins; channels are not
compensated for the times of their slots, so fast points lie off, too. Both are the published data's own.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import fft
from scipy.signal import get_window

from rfgen_sionna._types import FloatArray
from rfgen_sionna.processing.array_namespace import array_namespace, constant, fast_fourier, is_tensor, to_numpy
from rfgen_sionna.processing.boards.virtual_rows import VirtualRows, virtual_rows
from rfgen_sionna.processing.spectrum import check_cube

if TYPE_CHECKING:
    from rfgen_sionna.radar import Radar

_BATCH = 8
"""Frames that are transformed at once, which bounds the memory."""
FIELDS = ("x", "y", "z", "velocity", "energy", "range")
"""Columns of the points: x to the right, y ahead and z up [m], radial velocity [m/s], log10 of the magnitude, range
[m]."""


def mmmesh_points(
    cube: ArrayLike, radar: Radar, *, points: int = 128, range_bins: tuple[int, int] | None = None
) -> list[FloatArray]:
    """(point, 6) array of `FIELDS` of each frame, by range bin within velocity.

    Cells whose direction cosines have no solution are left out, so a frame has at most `points`.

    Parameters
    ----------
    cube
        (frame, chirp, tx, rx, sample) complex samples in any unit, a NumPy array or a tensor of PyTorch, whose spectra
        are made on its device; the points are NumPy arrays.
    range_bins
        First bin, and bin after the last, of the cells; None takes all.

    Raises
    ------
    ValueError
        For an array without a second row, or more points than cells.
    """
    array = check_cube(cube, radar, frames=True, tensors=True)
    rows = virtual_rows(radar)
    if not len(rows.elevation):
        raise ValueError(f"radar '{radar.name}' has one row of elements: mmMesh's points need a second one for z")
    samples, chirps = array.shape[-1], array.shape[1]
    low, high = (0, samples) if range_bins is None else range_bins
    if not 0 <= low < high <= samples or not 1 <= points < (high - low) * chirps:
        raise ValueError(
            f"range_bins is {range_bins} and points {points}: bins within 0 … {samples}, and fewer points than cells, "
            "are needed"
        )
    found: list[FloatArray] = []
    for start in range(0, len(array), _BATCH):
        found += _tables(array[start : start + _BATCH], radar, rows, points, low, high)
    return found


def _tables(array: Any, radar: Radar, rows: VirtualRows, points: int, low: int, high: int) -> list[FloatArray]:
    """Points of a batch of frames."""
    spectrum = _spectra(array)
    xp = array_namespace(spectrum)
    chirps, samples = spectrum.shape[1], spectrum.shape[-1]
    energy = xp.log10(xp.clip(xp.abs(spectrum.sum(axis=(2, 3))), float(np.finfo(np.float64).tiny), None))
    inside = energy[..., low:high]
    threshold = _order_statistic(inside.reshape(len(inside), -1), points + 1)
    frame, doppler, place = np.nonzero(to_numpy(inside > threshold[:, None, None]))
    place = place + low
    right, up = _directions(to_numpy(spectrum[frame, doppler, :, :, place]), rows)
    ahead = 1 - right**2 - up**2
    distance = place * (radar.waveform.range_window / samples)
    velocity = (doppler - chirps // 2) * (radar.wavelength / 2 / (chirps * radar.waveform.loop_period))
    columns = [distance * right, distance * np.sqrt(np.maximum(ahead, 0.0)), distance * up, velocity]
    table = np.stack([*columns, to_numpy(energy[frame, doppler, place]), distance], axis=1)
    return [np.asarray(table[(frame == number) & (ahead > 0)]) for number in range(len(array))]


def _spectra(array: Any) -> Any:
    """(frame, Doppler, tx, rx, range) spectra of moving returns, Doppler ascending."""
    chirps, samples = array.shape[1], array.shape[-1]
    fast, slow = (constant(get_window("hamming", count, fftbins=False), array) for count in (samples, chirps))
    ranges = fast_fourier(array * fast, samples, -1)
    ranges = ranges - ranges.mean(axis=1, keepdims=True)
    doppler = fast_fourier(ranges * slow[:, None, None, None], chirps, 1)
    return array_namespace(doppler).fft.fftshift(doppler, 1)


def _order_statistic(values: Any, rank: int) -> Any:
    """(row,) value of `rank` from the largest on, 1, of each row (row, value)."""
    if is_tensor(values):
        return values.topk(rank, 1).values[:, -1]
    return np.partition(values, -rank, axis=1)[:, -rank]


def _directions(channels: NDArray[np.complexfloating[Any, Any]], rows: VirtualRows) -> tuple[FloatArray, FloatArray]:
    """Direction cosines (n,) to the right and up of channels (n, tx, rx)."""
    bins = 64
    azimuth = fft.fft(channels[:, rows.azimuth[:, 0], rows.azimuth[:, 1]], n=bins, axis=1)
    above = fft.fft(channels[:, rows.elevation[:, 0], rows.elevation[:, 1]], axis=1)
    index = np.arange(len(channels))
    best = np.abs(azimuth).argmax(axis=1)
    first = azimuth[index, best]
    second = above[index, np.abs(above).argmax(axis=1)]
    right = np.where(best >= bins // 2, best - bins, best) * (2 / bins)
    up = np.angle(first * np.conj(second) * np.exp(1j * np.pi * rows.offset * right)) / np.pi
    return np.asarray(right), np.asarray(up / rows.height)
