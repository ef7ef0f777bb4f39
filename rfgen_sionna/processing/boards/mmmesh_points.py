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
from rfgen_sionna.processing.boards.virtual_rows import VirtualRows, virtual_rows
from rfgen_sionna.processing.spectrum import check_cube

if TYPE_CHECKING:
    from rfgen_sionna.radar import Radar

FIELDS = ("x", "y", "z", "velocity", "energy", "range")
"""Columns of the points: x to the right, y ahead and z up [m], radial velocity [m/s], log10 of the magnitude, range
[m]."""


def mmmesh_points(
    cube: ArrayLike, radar: Radar, *, points: int = 128, range_bins: tuple[int, int] | None = None
) -> list[FloatArray]:
    """(point, 6) array of `FIELDS` of each frame (frame, chirp, tx, rx, sample), by range bin within velocity.

    Cells whose direction cosines have no solution are left out, so a frame has at most `points`.

    Parameters
    ----------
    range_bins
        First bin, and bin after the last, of the cells; None takes all.

    Raises
    ------
    ValueError
        For an array without a second row, or more points than cells.
    """
    array = check_cube(cube, radar, frames=True)
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
    return [_frame_points(frame, radar, rows, points, low, high) for frame in array]


def _frame_points(frame: NDArray[Any], radar: Radar, rows: VirtualRows, points: int, low: int, high: int) -> FloatArray:
    chirps, samples = frame.shape[0], frame.shape[-1]
    ranges = fft.fft(frame * get_window("hamming", samples, fftbins=False), axis=-1)
    ranges = ranges - ranges.mean(axis=0)
    slow = get_window("hamming", chirps, fftbins=False)[:, None, None, None]
    spectrum = fft.fftshift(fft.fft(ranges * slow, axis=0), axes=0)
    energy = np.log10(np.maximum(np.abs(spectrum.sum(axis=(1, 2))), np.finfo(np.float64).tiny))
    inside = energy[:, low:high]
    threshold = np.partition(inside.ravel(), -points - 1)[-points - 1]
    doppler, place = np.nonzero(inside > threshold)
    place = place + low
    right, up = _directions(spectrum[doppler, :, :, place], rows)
    ahead = 1 - right**2 - up**2
    distance = place * (radar.waveform.range_window / samples)
    velocity = (doppler - chirps // 2) * (radar.wavelength / 2 / (chirps * radar.waveform.loop_period))
    columns = [distance * right, distance * np.sqrt(np.maximum(ahead, 0.0)), distance * up, velocity]
    table = np.stack([*columns, energy[doppler, place], distance], axis=1)
    return np.asarray(table[ahead > 0])


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
