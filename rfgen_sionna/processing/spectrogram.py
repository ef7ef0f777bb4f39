"""Pictures against time: range-time and Doppler-time (micro-Doppler).

The chirps of a run are not evenly spaced: a frame is a burst of loops, then the radar pauses until the next frame.
Two Doppler-time spectrograms follow from that:

- :func:`doppler_time`: one Doppler spectrum a frame, all its loops. Finest in velocity, one column a frame.
- :func:`micro_doppler`: short-time Fourier transform inside each stretch of evenly spaced loops. Windows never
  reach over a pause; frames that follow each other without a pause are one stretch.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import ShortTimeFFT

from rfgen_sionna._types import FloatArray
from rfgen_sionna.processing.multiplexing import occupied_bins, separate_bands, uses_doppler_bands
from rfgen_sionna.processing.spectrum import (
    Window,
    check_cube,
    range_axis,
    range_doppler,
    range_spectrum,
    remove_static,
    taper,
    velocity_axis,
)

if TYPE_CHECKING:
    from rfgen_sionna.radar import Radar


@dataclass(frozen=True)
class RangeTime:
    """Range profiles against time."""

    power: FloatArray
    """(time, range) power, mean over channels and over the chirps of a frame."""
    time: FloatArray
    """(time,) middle of each frame's observation [s]."""
    range: FloatArray
    """(range,) [m]"""


@dataclass(frozen=True)
class DopplerTime:
    """Doppler spectra against time."""

    power: FloatArray
    """(time, velocity) power, mean over channels, summed over the range bins."""
    time: FloatArray
    """(time,) middle of each window [s]."""
    velocity: FloatArray
    """(velocity,) [m/s], ascending; positive is receding."""
    duration: float
    """Length of each window [s]."""


def frame_starts(frames: int, radar: Radar, frame_times: ArrayLike | None = None) -> FloatArray:
    """(frame,) start of the first ramp of each frame [s]: `frame_times` checked, or multiples of the frame period."""
    if frame_times is None:
        return np.arange(frames, dtype=np.float64) * radar.waveform.frame_period
    times = np.asarray(frame_times, np.float64)
    if times.shape != (frames,) or not np.all(np.isfinite(times)) or np.any(np.diff(times) <= 0):
        raise ValueError(
            f"frame_times has shape {times.shape}: one ascending, finite start [s] for each of the {frames} frames "
            "is needed"
        )
    return times


def range_time(
    cube: ArrayLike,
    radar: Radar,
    *,
    frame_times: ArrayLike | None = None,
    static: bool = False,
    window: Window = "hann",
) -> RangeTime:
    """Power against range for every frame of a cube (frame, chirp, tx, rx, sample).

    Without `static` (the default) the mean over the chirps of each frame is taken out first.
    """
    array = check_cube(cube, radar, frames=True)
    starts = frame_starts(len(array), radar, frame_times)
    rows = []
    for frame in array:
        if uses_doppler_bands(radar):  # an element's echoes are those within its band
            maps = range_doppler(frame, radar, range_window=window, static=static)
            # Parseval: the bins of one windowed tone add up to its power times this.
            spread = len(frame) * np.sum(np.square(taper("hann", len(frame))))
            rows.append(maps.power.sum(axis=-1) / spread)
            continue
        profile = range_spectrum(frame if static else remove_static(frame), radar, window=window)
        rows.append(np.mean(np.square(profile.real, dtype=np.float64) + np.square(profile.imag), axis=(0, 1, 2)))
    middle = float(radar.waveform.chirp_times[: array.shape[1]].mean() + radar.waveform.sample_times.mean())
    return RangeTime(power=np.stack(rows), time=starts + middle, range=range_axis(radar, array.shape[-1]))


def doppler_time(
    cube: ArrayLike,
    radar: Radar,
    *,
    frame_times: ArrayLike | None = None,
    static: bool = False,
    range_limits: tuple[float, float] | None = None,
    window: Window = "hann",
) -> DopplerTime:
    """One Doppler spectrum a frame from all its loops, summed over range.

    Parameters
    ----------
    cube
        (frame, chirp, tx, rx, sample).
    static
        Whether what stands still within a frame is kept.
    range_limits
        Nearest and farthest range that count [m]; all by default.
    """
    array = check_cube(cube, radar, frames=True)
    starts = frame_starts(len(array), radar, frame_times)
    keep = _range_bins(radar, array.shape[-1], range_limits)
    rows = []
    for frame in array:
        maps = range_doppler(frame, radar, velocity_window=window, static=static)
        rows.append(maps.power[keep].sum(axis=0))
    loops, wave = array.shape[1], radar.waveform
    middle = float(wave.chirp_times[0].mean() + (loops - 1) / 2 * wave.loop_period + wave.sample_times.mean())
    return DopplerTime(
        power=np.stack(rows),
        time=starts + middle,
        velocity=velocity_axis(radar, loops),
        duration=loops * wave.loop_period,
    )


def micro_doppler(
    cube: ArrayLike,
    radar: Radar,
    *,
    frame_times: ArrayLike | None = None,
    static: bool = False,
    range_limits: tuple[float, float] | None = None,
    segment: int | None = None,
    hop: int | None = None,
    bins: int | None = None,
    window: Window = "hann",
) -> DopplerTime:
    """Short-time Fourier transform over the loops, within evenly spaced stretches only, summed over range.

    Parameters
    ----------
    cube
        (frame, chirp, tx, rx, sample).
    segment, hop
        Loops a window and loops between windows; by default half a frame and an eighth of a window.
    bins
        FFT length, at least `segment`; by default twice the segment.
    static, range_limits
        As in :func:`doppler_time`.
    """
    array = check_cube(cube, radar, frames=True)
    starts = frame_starts(len(array), radar, frame_times)
    frames, loops, wave = len(array), array.shape[1], radar.waveform
    array = separate_bands(array, radar)
    groups = _contiguous_frames(starts, loops * wave.loop_period, 0.5 * wave.loop_period)
    longest = min(len(group) for group in groups) * loops
    segment = max(2, loops // 2) if segment is None else segment
    hop = max(1, segment // 8) if hop is None else hop
    bins = 2 * segment if bins is None else bins
    if not 2 <= segment <= longest:
        raise ValueError(
            f"segment is {segment} loops; 2 … {longest} is allowed ({frames} frames of {loops} loops, "
            f"{len(groups)} stretches without a pause)"
        )
    if not 1 <= hop <= segment or bins < segment:
        raise ValueError(f"hop is {hop} and bins {bins}: 1 … {segment} and at least {segment} are needed")
    keep = _range_bins(radar, array.shape[-1], range_limits)
    transform = ShortTimeFFT(
        taper(window, segment), hop=hop, fs=1 / wave.loop_period, mfft=bins, fft_mode="centered", phase_shift=None
    )
    kept = occupied_bins(radar, len(transform.f))
    offset = float(wave.chirp_times[0].mean() + wave.sample_times.mean())
    columns, times = [], []
    for group in groups:
        profiles = [range_spectrum(f if static else remove_static(f), radar)[..., keep] for f in array[group]]
        profile = np.concatenate(profiles, axis=0)
        slow = profile.reshape(len(profile), -1).T
        # Only windows that lie inside the stretch.
        first, last = transform.lower_border_end[1], transform.upper_border_begin(len(profile))[1]
        spectrum = transform.stft(slow, p0=first, p1=last)
        power = np.square(spectrum.real, dtype=np.float64) + np.square(spectrum.imag)
        columns.append(power.sum(axis=0).T[:, kept] / (array.shape[2] * array.shape[3]))
        times.append(starts[group[0]] + offset + transform.t(len(profile), p0=first, p1=last))
    # ShortTimeFFT counts a window by its sample segment // 2; its centre lies half a loop earlier where even.
    shift = 0.0 if segment % 2 else -0.5 * wave.loop_period
    return DopplerTime(
        power=np.concatenate(columns),
        time=np.concatenate(times) + shift,
        velocity=transform.f[kept] * (radar.wavelength / 2),
        duration=segment * wave.loop_period,
    )


def _contiguous_frames(starts: FloatArray, length: float, slack: float) -> list[list[int]]:
    """Frames that follow each other without a pause, grouped."""
    groups = [[0]]
    for index in range(1, len(starts)):
        if abs(starts[index] - starts[index - 1] - length) <= slack:
            groups[-1].append(index)
        else:
            groups.append([index])
    return groups


def _range_bins(radar: Radar, bins: int, limits: tuple[float, float] | None) -> slice:
    if limits is None:
        return slice(None)
    axis = range_axis(radar, bins)
    first, last = np.searchsorted(axis, limits)
    if not (0 <= limits[0] < limits[1]) or last <= first:
        raise ValueError(
            f"range_limits is {limits!r} m: two ascending ranges within 0 … {axis[-1]:.2f} m, at least "
            f"{axis[1]:.3f} m apart, are needed"
        )
    return slice(int(first), int(last))
