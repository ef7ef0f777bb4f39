"""Point clouds: CFAR detections of one frame with position, radial velocity and signal-to-noise ratio."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from rfgen_sionna.processing.angle import find_directions, unit_vectors
from rfgen_sionna.processing.demultiplex import as_beams
from rfgen_sionna.processing.detection import cfar, local_maxima, refine_peaks
from rfgen_sionna.processing.spectrum import (
    Window,
    check_cube,
    coupling,
    observation_time,
    range_doppler,
)
from rfgen_sionna.records import FloatArray

if TYPE_CHECKING:
    from rfgen_sionna.radar import Radar


_GUARD, _TRAIN = 2, 8
"""Resolution cells on either side that CFAR leaves out and trains on, where the map has room for them."""


@dataclass(frozen=True)
class PointCloud:
    """Detections of one frame, strongest first."""

    range: FloatArray
    """(point,) distance from the origin of the device frame [m]."""
    velocity: FloatArray
    """(point,) radial velocity [m/s]; positive is receding."""
    azimuth: FloatArray
    """(point,) [rad], device frame, positive to the left."""
    elevation: FloatArray
    """(point,) [rad], device frame, positive upwards; 0 where the array has no height."""
    power: FloatArray
    """(point,) mean power of a channel, in the unit of |sample|²."""
    snr_db: FloatArray
    """(point,) power over the local noise of the map after both transforms [dB]."""
    device: FloatArray
    """(point, 3) position in the device frame [m]: x boresight, y left, z up."""
    position: FloatArray
    """(point, 3) position in the world frame [m]."""
    time: float
    """Instant after the start of the frame that everything refers to [s]."""

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

    Detection runs on the power averaged over the channels, at twice the FFT lengths; `guard` and `train` count
    resolution cells. Every local maximum over the threshold becomes one point in its strongest direction.

    Parameters
    ----------
    static
        Whether what stands still within the frame is kept; otherwise the mean over the chirps is taken out.
    method, false_alarm, guard, train
        See :func:`rfgen_sionna.processing.detection.cfar`. None takes 2 guard and 8 training cells on either side of an
        axis, or as many as it has room for: of the 16 chirps of a Position2Go's frame 2 and 5.
    range_limits
        Nearest and farthest range [m] that count; by default all but the first two resolution cells.
    max_points
        The strongest so many are kept.
    dynamic_range_db
        Points so far below the strongest are dropped: noise-free data have no floor but that of the windows.
    window
        For both transforms. Side lobes are detections where CFAR trains along range only and targets stand far out
        of the noise: Hann's first lie 31 dB below the peak, Blackman's 58 dB.
    ambiguities
        See :func:`rfgen_sionna.processing.angle.find_directions`.
    """
    array, radar = as_beams(check_cube(frame, radar), radar)
    if radar.waveform.slope == 0:
        raise ValueError(
            f"radar '{radar.name}' with preset '{radar.preset}' keeps its frequency and tells no ranges: there are no "
            "points; range_doppler and micro_doppler give its velocities"
        )
    if array.ndim != 4:
        raise ValueError(f"frame has shape {array.shape}: one frame (chirp, tx, rx, sample) is needed")
    if max_points < 1:
        raise ValueError(f"max_points is {max_points}: at least 1 is needed")
    if not dynamic_range_db > 0:
        raise ValueError(f"dynamic_range_db is {dynamic_range_db!r}: more than 0 dB is needed")
    padding = 2
    chirps, _, _, samples = array.shape
    maps = range_doppler(
        array,
        radar,
        range_window=window,
        velocity_window=window,
        range_bins=padding * samples,
        velocity_bins=padding * chirps,
        correct_migration=True,
        static=static,
    )
    power = maps.power
    guard, train = _window(power.shape, padding, guard, train)
    # Neighbouring virtual elements share their noise-free signal, not their noise: every channel is a look.
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
    seen = place[:, 0] * (maps.range[1] - maps.range[0])
    velocity = maps.velocity[0] + place[:, 1] * (maps.velocity[1] - maps.velocity[0])
    channels = maps.spectrum[cells[:, 1], :, :, cells[:, 0]]
    found = find_directions(channels, radar, velocity, distance=np.maximum(seen, 1e-3), ambiguities=ambiguities)
    direction = unit_vectors(found.azimuth, found.elevation)
    distance = _distance(seen - coupling(radar, found.velocity), direction, radar)
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


def _window(
    shape: tuple[int, ...], padding: int, guard: tuple[int, int] | None, train: tuple[int, int] | None
) -> tuple[tuple[int, int], tuple[int, int]]:
    """Guard and training cells that a map of this shape has room for, where they are not given."""
    pairs = []
    for axis, bins in enumerate(shape):
        room = max(0, (bins - 1) // (2 * padding))
        own = guard[axis] if guard is not None else min(_GUARD, room // 3)
        pairs.append((own, train[axis] if train is not None else max(0, min(_TRAIN, room - own))))
    (up, above), (side, beside) = pairs
    return (up, side), (above, beside)


def _distance(seen: FloatArray, direction: FloatArray, radar: Radar) -> FloatArray:
    """Distance from the frame's origin where half the path, mean over the channels, is `seen` [m]."""
    distance = np.maximum(seen, 1e-3)
    for _ in range(4):
        point = (direction * distance[:, None])[:, None, :]
        out = np.linalg.norm(point - radar.tx_positions, axis=-1).mean(axis=1)
        back = np.linalg.norm(point - radar.rx_positions, axis=-1).mean(axis=1)
        distance = np.maximum(distance + seen - (out + back) / 2, 1e-3)
    return distance
