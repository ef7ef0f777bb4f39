"""Point clouds: CFAR detections of one frame with position, radial velocity and signal-to-noise ratio."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rfgen_sionna._short_repr import ShortRepr
from rfgen_sionna._types import FloatArray
from rfgen_sionna.processing.angle import Directions, find_directions, unit_vectors
from rfgen_sionna.processing.demultiplex import as_beams
from rfgen_sionna.processing.detection import cfar, local_maxima, refine_peaks
from rfgen_sionna.processing.multiplexing import (
    Samples,
    empty_bands,
    occupied_bins,
    separate_bands,
    uses_doppler_bands,
)
from rfgen_sionna.processing.peak_focusing import focus_peak
from rfgen_sionna.processing.spectrum import (
    RangeDoppler,
    Window,
    check_cube,
    coupling,
    observation_time,
    range_doppler,
    remove_static,
    taper,
)

if TYPE_CHECKING:
    from rfgen_sionna.radar import Radar


_GUARD, _TRAIN = 2, 8
"""Default guard and training cells of CFAR on either side, in resolution cells; small maps have fewer."""
_HORIZON = 1e-6
"""Cosine of the angle to boresight up to which the search for a direction was stopped by the horizon."""


@dataclass(frozen=True, repr=False)
class PointCloud(ShortRepr):
    """Detections of one frame, strongest first."""

    range: FloatArray
    """(point,) distance from the origin of the device frame [m]."""
    velocity: FloatArray
    """(point,) radial velocity [m/s]; positive is receding."""
    azimuth: FloatArray
    """(point,) [rad], device frame, positive to the left."""
    elevation: FloatArray
    """(point,) [rad], device frame, positive upwards; 0 for an array of one row."""
    power: FloatArray
    """(point,) mean power of a channel, in the unit of |sample|²."""
    snr_db: FloatArray
    """(point,) power over the local noise of the map [dB]."""
    device: FloatArray
    """(point, 3) position in the device frame [m]: x boresight, y left, z up."""
    position: FloatArray
    """(point, 3) position in the world frame [m]."""
    time: float
    """Time of the estimates after the start of the frame [s]."""

    def __len__(self) -> int:
        return len(self.range)


def point_cloud(
    frame: ArrayLike,
    radar: Radar,
    *,
    static: bool = False,
    method: str = "ca",
    false_alarm: float = 1e-6,
    guard: tuple[int, int] | None = None,
    train: tuple[int, int] | None = None,
    range_limits: tuple[float, float] | None = None,
    max_points: int = 512,
    dynamic_range_db: float = 60.0,
    window: Window = "hann",
    ambiguities: int = 0,
) -> PointCloud:
    """Detect, refine and locate the targets of one frame (chirp, tx, rx, sample).

    CFAR runs on the mean power of the channels, at twice the FFT lengths. Every local maximum over the threshold
    becomes one point in its strongest direction. Points whose beam is strongest beyond 90° from boresight, where
    direction cosines would have u² + v² > 1, are left out: an echo in front of the array has no such phases, but noise
    and several targets in one cell do.

    Speeds beyond `radar.max_velocity` fold. With Tx elements in Doppler bands (DDM), an empty band determines the fold,
    up to `doppler_bands` times that speed, for one target per range. Elsewhere `ambiguities` compares folds by the
    array. Without either, migration determines the sign of a speed within a cell of the limit, and a faster target
    appears 2 `max_velocity` lower, with a range error by :func:`~rfgen_sionna.processing.spectrum.coupling`; with Tx
    elements in turn its direction is another one, or none, so that it is left out.

    Parameters
    ----------
    static
        Whether static returns are kept; otherwise the mean over the chirps is subtracted. That also lowers the power
        of targets within two Doppler cells of rest and adds noise to their velocity.
    method, false_alarm, guard, train
        See :func:`rfgen_sionna.processing.detection.cfar`; `guard` and `train` in resolution cells. None takes 2 guard
        and 8 training cells on either side of an axis, or fewer on a small map.
    range_limits
        Smallest and largest range [m]; None excludes the first two resolution cells.
    max_points
        Largest number of points, the strongest ones.
    dynamic_range_db
        Points weaker than the strongest by more than this are dropped: data without noise have no other floor.
    window
        Window of both transforms. Its side lobes may be detections of strong targets: Hann's are 31 dB below the peak,
        Blackman's 58 dB.
    ambiguities
        See :func:`rfgen_sionna.processing.angle.find_directions`. In Doppler bands a fold is one band, and 0 with an
        empty band takes all folds.

    Raises
    ------
    ValueError
        For a radar without a slope, a cube of another shape, or an argument out of its range.
    """
    array, radar = as_beams(check_cube(frame, radar), radar)
    if radar.waveform.slope == 0:
        raise ValueError(
            f"radar '{radar.name}' with preset '{radar.preset}' has a slope of 0, so that points have no ranges: "
            "range_doppler and micro_doppler give velocities"
        )
    if array.ndim != 4:
        raise ValueError(f"frame has shape {array.shape}: one frame (chirp, tx, rx, sample) is needed")
    if max_points < 1:
        raise ValueError(f"max_points is {max_points}: at least 1 is needed")
    if not dynamic_range_db > 0:
        raise ValueError(f"dynamic_range_db is {dynamic_range_db!r}: more than 0 dB is needed")
    padding = 2
    chirps, _, _, samples = array.shape
    whole = range_doppler(
        array,
        radar,
        range_window=window,
        velocity_window=window,
        range_bins=padding * samples,
        velocity_bins=padding * chirps,
        correct_migration=True,
        static=static,
        all_bands=True,
    )
    own = occupied_bins(radar, padding * chirps)
    maps = RangeDoppler(whole.spectrum[own], whole.range, whole.velocity[own])
    power = maps.power
    guard, train = _window(power.shape, padding, guard, train)
    # The noise of channels is independent: every channel is a look.
    detected, noise = cfar(
        power,
        method=method,
        false_alarm=false_alarm,
        guard=(padding * guard[0], padding * guard[1]),
        train=(padding * train[0], padding * train[1]),
        looks=maps.spectrum.shape[1] * maps.spectrum.shape[2],
    )
    low, high = (2 * radar.waveform.range_window / samples, np.inf) if range_limits is None else range_limits
    if not 0 <= low < high:
        raise ValueError(f"range_limits is {range_limits!r} m: two ascending ranges of at least 0 are needed")
    within = (maps.range >= low) & (maps.range <= high)
    detected &= power >= power[within].max(initial=0.0) * 10 ** (-dynamic_range_db / 10)
    cells = np.argwhere(detected & local_maxima(power) & within[:, None])
    order = np.argsort(power[cells[:, 0], cells[:, 1]], kind="stable")[::-1][:max_points]
    cells = cells[order]
    place, peak = refine_peaks(power, cells)
    apparent = place[:, 0] * (maps.range[1] - maps.range[0])
    velocity = maps.velocity[0] + place[:, 1] * (maps.velocity[1] - maps.velocity[0])
    if not static:
        velocity = _correct_notch_bias(velocity, padding * (maps.velocity[1] - maps.velocity[0]), window, chirps)
    found = _directions(whole, cells, own.start or 0, radar, apparent, velocity, ambiguities)
    found, apparent, peak = _refocus(array, radar, found, apparent, peak, window, static, ambiguities)
    direction = unit_vectors(found.azimuth, found.elevation)
    real = direction[:, 0] > _HORIZON
    direction, apparent, peak, cells = direction[real], apparent[real], peak[real], cells[real]
    found = found.selected(real)
    distance = _distance(apparent - coupling(radar, found.velocity), direction, radar)
    device = direction * distance[:, None]
    return PointCloud(
        range=distance,
        velocity=found.velocity,
        azimuth=found.azimuth,
        elevation=found.elevation,
        power=peak,
        snr_db=10 * np.log10(peak / noise[cells[:, 0], cells[:, 1]]),
        device=device,
        position=device @ radar.rotation.T + np.asarray(radar.position),
        time=observation_time(radar),
    )


def _correct_notch_bias(velocity: FloatArray, cell: float, window: Window, chirps: int) -> FloatArray:
    """Velocities of targets with peaks at `velocity` [m/s] after subtraction of the mean over the chirps.

    The mean includes a part of a slow target, which moves its peak away from rest by up to a `cell`.
    """
    count = np.arange(int(50 * min(4.0, chirps / 2)) + 1)
    steps = count / 50  # cells from rest: beyond four the mean has no significant part
    waves = np.cos(2 * np.pi / chirps * steps[:, None] * (np.arange(chirps) - (chirps - 1) / 2))
    peak, mean = waves @ taper(window, chirps), waves @ taper("hann", chirps)
    left = np.abs(peak[np.abs(count - count[:, None])] - mean[:, None] * peak)
    peaks = np.maximum.accumulate(steps[left.argmax(axis=1)])
    away = np.abs(velocity) / cell
    first = np.unique(peaks, return_index=True)[1]
    slow = away < peaks[-1]
    return np.asarray(np.where(slow, np.sign(velocity) * np.interp(away, peaks[first], steps[first]) * cell, velocity))


def _directions(
    whole: RangeDoppler,
    cells: NDArray[np.signedinteger[Any]],
    first: int,
    radar: Radar,
    apparent: FloatArray,
    velocity: FloatArray,
    ambiguities: int,
) -> Directions:
    """Directions of the peaks and folds of their speeds; `first` is the maps' first velocity bin in the `whole`."""
    distance = np.maximum(apparent, 1e-3)
    rows, columns = cells[:, 0], cells[:, 1] + first
    if not uses_doppler_bands(radar):
        channels = whole.spectrum[columns, :, :, rows]
        return find_directions(channels, radar, velocity, distance=distance, ambiguities=ambiguities)
    bins, bands = len(whole.velocity), radar.waveform.doppler_bands
    most = ambiguities if ambiguities or not empty_bands(radar) else int(bands / 2)
    best = find_directions(whole.spectrum[columns, :, :, rows], radar, velocity, distance=distance)
    for fold in sorted(range(-most, most + 1), key=abs)[1:]:
        there = columns + round(fold * bins / bands)
        inside = (there >= 0) & (there < bins)
        channels = whole.spectrum[np.clip(there, 0, bins - 1), :, :, rows]
        trial = find_directions(channels, radar, velocity + 2 * fold * radar.max_velocity, distance=distance)
        better = inside & (trial.power > best.power * (1 + 1e-6))
        best = best.replaced(better, trial)
    return best


def _refocus(
    array: Samples,
    radar: Radar,
    found: Directions,
    apparent: FloatArray,
    peak: FloatArray,
    window: Window,
    static: bool,
    ambiguities: int,
) -> tuple[Directions, FloatArray, FloatArray]:
    """Points again, with peaks of their own for speeds at or beyond the ends of the maps' Doppler axis."""
    limit, cell = radar.max_velocity, radar.velocity_resolution
    fast = np.flatnonzero(np.abs(found.velocity) > limit - cell)
    if not len(fast):
        return found, apparent, peak
    samples = separate_bands(array, radar)
    samples = samples if static else remove_static(samples)
    chirps, count = samples.shape[0], samples.shape[-1]
    real = samples.real.dtype
    tapered = samples * (taper(window, chirps).astype(real)[:, None, None, None] * taper(window, count).astype(real))
    apparent, peak = apparent.copy(), peak.copy()
    parts = {name: values.copy() for name, values in vars(found).items()}
    known = ambiguities > 0 or empty_bands(radar) > 0
    for index in fast:
        speed = float(found.velocity[index])
        fold = 0.0 if known else -np.sign(speed) * 2 * limit
        away = abs(speed) if known else 2 * limit
        smear = 0.5 * away * radar.waveform.frame_length + 2 * radar.range_resolution
        velocities = np.array([speed, speed + fold] if fold else [speed])
        point = focus_peak(tapered, radar, float(apparent[index]), velocities, smear, 2 * count)
        apparent[index], peak[index] = point.range, point.power
        again = find_directions(point.channels[None], radar, [point.velocity], distance=np.maximum([point.range], 1e-3))
        for name, values in parts.items():
            values[index] = getattr(again, name)[0]
    return Directions(**parts), apparent, peak


def _window(
    shape: tuple[int, ...], padding: int, guard: tuple[int, int] | None, train: tuple[int, int] | None
) -> tuple[tuple[int, int], tuple[int, int]]:
    """Guard and training cells, by default as many as fit on a map of this shape."""
    pairs = []
    for axis, bins in enumerate(shape):
        room = max(0, (bins - 1) // (2 * padding))
        own = guard[axis] if guard is not None else min(_GUARD, room // 3)
        pairs.append((own, train[axis] if train is not None else max(0, min(_TRAIN, room - own))))
    (up, above), (side, train_columns) = pairs
    return (up, side), (above, train_columns)


def _distance(apparent: FloatArray, direction: FloatArray, radar: Radar) -> FloatArray:
    """Distance from the frame's origin for which half the path, mean over the channels, is `apparent` [m]."""
    distance = np.maximum(apparent, 1e-3)
    for _ in range(4):
        point = (direction * distance[:, None])[:, None, :]
        out = np.linalg.norm(point - radar.tx_positions, axis=-1).mean(axis=1)
        back = np.linalg.norm(point - radar.rx_positions, axis=-1).mean(axis=1)
        distance = np.maximum(distance + apparent - (out + back) / 2, 1e-3)
    return distance
