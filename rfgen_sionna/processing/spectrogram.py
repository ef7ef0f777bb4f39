"""Power against time: range-time and Doppler-time (micro-Doppler).

A frame is a burst of evenly spaced loops; a pause may follow. Hence two Doppler-time spectrograms:

- :func:`doppler_time`: one Doppler spectrum a frame, from all its loops, the finest in velocity.
- :func:`micro_doppler`: short-time Fourier transform with windows that include no pause.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import ShortTimeFFT

from rfgen_sionna._short_repr import ShortRepr
from rfgen_sionna._types import FloatArray
from rfgen_sionna.processing.multiplexing import occupied_bins, separate_bands, uses_doppler_bands
from rfgen_sionna.processing.spectrum import (
    Window,
    check_cube,
    range_axis,
    range_doppler,
    range_profiles,
    range_spectrum,
    remove_static,
    taper,
    velocity_axis,
)

if TYPE_CHECKING:
    from rfgen_sionna.radar import Radar


@dataclass(frozen=True, repr=False)
class RangeTime(ShortRepr):
    """Range profiles against time."""

    power: FloatArray
    """(time, range) power, mean over channels and over the chirps of a frame."""
    time: FloatArray
    """(time,) middle of each frame's observation [s]."""
    range: FloatArray
    """(range,) [m]"""


@dataclass(frozen=True, repr=False)
class DopplerTime(ShortRepr):
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
    """(frame,) start of the first ramp of each frame [s]: checked `frame_times`, or multiples of the frame period."""
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

    `static` keeps static returns; otherwise the mean over the chirps of each frame is subtracted. `frame_times` [s] are
    by default multiples of the frame period.
    """
    array = check_cube(cube, radar, frames=True)
    starts = frame_starts(len(array), radar, frame_times)
    rows = []
    for frame in array:
        if uses_doppler_bands(radar):  # the band of an element has its echoes
            maps = range_doppler(frame, radar, range_window=window, static=static)
            # Parseval: power of the bins of a windowed tone over its own power.
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
        Whether static returns are kept.
    range_limits
        Smallest and largest range [m]; None takes all.
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
    """Short-time Fourier transform over evenly spaced loops, summed over range.

    Parameters
    ----------
    cube
        (frame, chirp, tx, rx, sample).
    segment, hop
        Loops of a window and between windows; None takes half a frame and an eighth of a window.
    bins
        FFT length, at least `segment`; None takes twice the segment.
    static, range_limits
        As in :func:`doppler_time`.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed values.
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
            f"{len(groups)} intervals without a pause)"
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
        given = [frame if static else remove_static(frame) for frame in array[group]]
        profiles = [range_profiles(frame, radar, "hann", frame.shape[-1])[..., keep] for frame in given]
        profile = np.concatenate(profiles, axis=0)
        slow = profile.reshape(len(profile), -1).T
        # Only complete windows.
        first, last = transform.lower_border_end[1], transform.upper_border_begin(len(profile))[1]
        spectrum = transform.stft(slow, p0=first, p1=last)
        power = np.square(spectrum.real, dtype=np.float64) + np.square(spectrum.imag)
        columns.append(power.sum(axis=0).T[:, kept] / (array.shape[2] * array.shape[3]))
        times.append(starts[group[0]] + offset + transform.t(len(profile), p0=first, p1=last))
    # The time of a window in ShortTimeFFT is that of its sample segment // 2; an even one has its centre half a loop
    # earlier.
    shift = 0.0 if segment % 2 else -0.5 * wave.loop_period
    return DopplerTime(
        power=np.concatenate(columns),
        time=np.concatenate(times) + shift,
        velocity=transform.f[kept] * (radar.wavelength / 2),
        duration=segment * wave.loop_period,
    )


def _contiguous_frames(starts: FloatArray, length: float, slack: float) -> list[list[int]]:
    """Groups of frames without a pause between them."""
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
