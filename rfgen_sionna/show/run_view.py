"""Processed data of one frame and of a whole run, for pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray
from rfgen_sionna.processing.azimuth import RangeAzimuth, range_azimuth
from rfgen_sionna.processing.demultiplex import select_profile, select_slot
from rfgen_sionna.processing.pointcloud import PointCloud, point_cloud
from rfgen_sionna.processing.spectrogram import DopplerTime, RangeTime, doppler_time, micro_doppler, range_time
from rfgen_sionna.processing.spectrum import range_axis, range_doppler, watts_to_dbm
from rfgen_sionna.radar import Radar
from rfgen_sionna.show.actor_shapes import ActorShape, actor_shapes
from rfgen_sionna.show.displayable import Displayable, power_unit


class NoPictureError(ValueError):
    """The run's samples have no such picture."""


def check_frame(run: Displayable, frame: int) -> int:
    """`frame` as an index from 0, from the end if negative; ValueError if the run has no such frame."""
    if isinstance(frame, bool) or not isinstance(frame, int | np.integer) or not -len(run) <= frame < len(run):
        raise ValueError(f"frame is {frame!r}; '{run.path}' has the frames 0 … {len(run) - 1}")
    return int(frame) % len(run)


def displayed_samples(run: Displayable, samples: ArrayLike) -> tuple[NDArray[np.complexfloating[Any, Any]], Radar]:
    """Samples (..., chirp, tx, rx, sample) for pictures, and their radar: the first profile, the first beam.

    Raises
    ------
    NoPictureError
        If the frequency is constant.
    """
    array, radar = np.asarray(samples), run.radar
    if radar.waveform.other_profiles:
        array, radar = select_profile(array, radar, 0)
    if radar.waveform.multiplexing == "beam":
        array, radar = select_slot(array, radar, 0)
    if radar.waveform.slope == 0:
        raise NoPictureError(
            f"'{run.path}': radar '{radar.name}' with preset '{radar.preset}' has a constant frequency and no ranges: "
            "it has no pictures; processing.range_doppler and micro_doppler give velocities"
        )
    return array, radar


@dataclass(frozen=True)
class RunView:
    """Spectrograms of a whole run, static returns removed."""

    range_time: RangeTime
    doppler_time: DopplerTime
    per_frame: bool
    """Whether the Doppler-time picture has one column a frame (pauses between frames)."""
    most_active_frame: int
    """Frame with the largest mean speed, weighted with the power above the noise."""
    unit: str = "dBm"
    """Of levels."""
    static: bool = False
    """Whether the range profiles include static returns."""


def view_run(run: Displayable) -> RunView:
    """Spectrograms of a run."""
    radar, times = displayed_samples(run, run.adc[:1])[1], run.frame_times
    gaps = np.diff(times)
    # One spectrum a frame where a short-time transform would have empty windows in the pauses.
    per_frame = len(times) > 1 and bool(np.any(gaps > 1.05 * radar.waveform.frame_length))
    if per_frame:
        ranges, dopplers = [], []
        for index, start in enumerate(times):
            cube, _ = displayed_samples(run, run.adc[index : index + 1])
            ranges.append(range_time(cube, radar, frame_times=[start]))
            dopplers.append(doppler_time(cube, radar, frame_times=[start]))
        power, time = (np.concatenate([getattr(r, name) for r in ranges]) for name in ("power", "time"))
        distance = RangeTime(power, time, ranges[0].range)
        power, time = (np.concatenate([getattr(d, name) for d in dopplers]) for name in ("power", "time"))
        doppler = DopplerTime(power, time, dopplers[0].velocity, dopplers[0].duration)
    else:
        cube, _ = displayed_samples(run, run.adc[:])
        distance = range_time(cube, radar, frame_times=times)
        doppler = micro_doppler(cube, radar, frame_times=times)
    return RunView(distance, doppler, per_frame, _most_active_frame(doppler, times), power_unit(run))


def _most_active_frame(spectrum: DopplerTime, times: FloatArray) -> int:
    power = np.maximum(spectrum.power - 3 * np.median(spectrum.power, axis=1, keepdims=True), 0.0)
    # A thousandth of the run's peak suppresses the noise of columns without motion.
    weight = power.sum(axis=1) + 1e-3 * power.sum(axis=1).max() + np.finfo(float).tiny
    speed = power @ np.abs(spectrum.velocity) / weight
    return int(np.searchsorted(times, spectrum.time[speed.argmax()], side="right")) - 1


@dataclass(frozen=True)
class FrameView:
    """Processed data of one frame."""

    range_doppler: FloatArray
    """(range, velocity) level [`unit`], mean over the channels."""
    static: bool
    """Whether the maps include static returns."""
    range: FloatArray
    """(range,) [m]"""
    velocity: FloatArray
    """(velocity,) [m/s]"""
    azimuth: RangeAzimuth | None
    """None where a recording stores maps and no samples."""
    cloud: PointCloud
    """Moving detections."""
    unit: str = "dBm"
    """Of levels."""


def view_frame(run: Displayable, frame: int, *, static: bool = True) -> FrameView:
    """Range-Doppler and range-azimuth maps and the point cloud of one frame; `static` keeps static returns."""
    samples, radar = displayed_samples(run, run.adc[frame])
    # At most 12 training cells, fewer in short frames.
    rows = len(range_axis(radar, 2 * samples.shape[-1]))
    train = (min(12, (rows // 2 - 1) // 4), 0)
    guard = (train[0] // 3, 0)
    maps = range_doppler(
        samples, radar, static=static, velocity_bins=2 * samples.shape[0], range_bins=2 * samples.shape[3]
    )
    return FrameView(
        range_doppler=watts_to_dbm(maps.power), static=static, range=maps.range, velocity=maps.velocity,
        azimuth=range_azimuth(samples, radar, static=static),
        # A body fills many range cells, few of them at one speed: order statistics along range separate its parts.
        cloud=point_cloud(
            samples, radar, method="os", guard=guard, train=train, dynamic_range_db=45.0, window="blackman"
        ),
        unit=power_unit(run),
    )  # fmt: skip


def display_range(run: Displayable, frame: int, shapes: Sequence[ActorShape] | None = None) -> float:
    """Largest range in pictures [m]: of the PIR's farthest return, else beyond the actors' `shapes`, else the
    radar's. None takes the shapes from the run."""
    limit = run.radar.max_range
    if run.has_pir:
        delay = run.pir(frame).time_of_arrival
        if np.any(np.isfinite(delay)):
            return float(min(limit, 1.05 * np.nanmax(delay) * SPEED_OF_LIGHT / 2))
    places = [
        points
        for shape in (actor_shapes(run) if shapes is None else shapes)
        for index in {0, frame, len(run) - 1}
        if len(points := shape.points(index))
    ]
    distances = [np.linalg.norm(points - np.asarray(run.radar.position), axis=1).max() for points in places]
    return float(min(limit, 1.5 * max(distances))) if distances else limit
