"""Peaks at or beyond the ends of the Doppler axis, from transforms at their own speeds.

A map corrects the migration of each Doppler bin for the speed of the bin. The return of a folded, faster target stays
smeared in range, and a peak at the end of the axis is split between both ends, one half of it with the wrong sign.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.processing.detection import refine_peaks
from rfgen_sionna.processing.multiplexing import ComplexChannels, Samples
from rfgen_sionna.processing.spectrum import range_transform

if TYPE_CHECKING:
    from rfgen_sionna.radar import Radar

_STEPS, _TIE = 2, 1.01  # half velocity cells on either side of a speed; power ratio of a clearly higher peak


@dataclass(frozen=True)
class FocusedPeak:
    """One peak."""

    range: float
    """Position in the range spectrum [m], range-Doppler coupling included."""
    velocity: float
    """[m/s]"""
    power: float
    """Mean over the channels."""
    channels: ComplexChannels
    """(tx, rx)"""


def focus_peak(
    tapered: Samples, radar: Radar, place: float, velocities: FloatArray, smear: float, bins: int
) -> FocusedPeak:
    """Highest peak near one of the `velocities` (n,) [m/s], of which a later one must have a clearly higher peak.

    `tapered` (chirp, tx, rx, sample) includes both windows. The peak is at most `smear` [m] from `place` [m] in range;
    `bins` is the length of the range transform.
    """
    step = radar.waveform.range_window / bins
    count = bins // 2 + 1 if radar.adc.real else bins
    near = np.arange(max(0, int((place - smear) / step)), min(count, int((place + smear) / step) + 2))
    spacing = 0.5 * radar.velocity_resolution
    peaks: list[FocusedPeak] = []
    for velocity in velocities.tolist():
        grid = velocity + spacing * np.arange(-_STEPS, _STEPS + 1)
        spectra = np.stack([at_velocity(tapered, radar, v, bins) for v in grid])
        power = np.mean(np.square(np.abs(spectra)), axis=(1, 2))  # (velocity, range)
        row, column = np.unravel_index(power[1:-1, near].argmax(), (len(grid) - 2, len(near)))
        cell = np.array([[near[column], row + 1]])
        (found,), (peak,) = refine_peaks(power.T, cell)
        if not peaks or peak > _TIE * peaks[-1].power:
            speed = float(grid[0] + spacing * found[1])
            channels = at_velocity(tapered, radar, speed, bins)[..., cell[0, 0]]
            peaks.append(FocusedPeak(float(found[0] * step), speed, float(peak), channels))
    return peaks[-1]


def at_velocity(tapered: Samples, radar: Radar, velocity: float, bins: int) -> ComplexChannels:
    """(tx, rx, range) spectra at `velocity` [m/s], with corrected migration."""
    chirps, samples = tapered.shape[0], tapered.shape[-1]
    step = radar.waveform.slope / radar.waveform.sample_rate
    scale = 1 + step * (np.arange(samples) - 0.5 * (samples - 1)) / radar.center_frequency
    cycles = 2 * velocity / radar.wavelength * radar.waveform.loop_period
    middle = 0.5 * (chirps - 1)
    # The middle of the frame keeps its range.
    turn = np.exp(-2j * np.pi * cycles * (scale * (np.arange(chirps)[:, None] - middle) + middle))
    turn = turn.astype(np.result_type(tapered.dtype, np.complex64))
    return range_transform(np.einsum("ctrs,cs->trs", tapered, turn), radar, bins)
