"""Processed data of one frame and of a whole run, for pictures."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray
from rfgen_sionna.dataset import Run, open_run
from rfgen_sionna.processing.azimuth import RangeAzimuth, range_azimuth
from rfgen_sionna.processing.demultiplex import select_profile, select_slot
from rfgen_sionna.processing.pointcloud import PointCloud, point_cloud
from rfgen_sionna.processing.spectrogram import DopplerTime, RangeTime, doppler_time, micro_doppler, range_time
from rfgen_sionna.processing.spectrum import range_doppler, watts_to_dbm
from rfgen_sionna.radar import Radar


class NoPictureError(ValueError):
    """A run whose samples have no picture of the kind that was asked for."""


@contextmanager
def opened(run: Run | str | os.PathLike[str]) -> Iterator[Run]:
    """A run given as such or by its path; one that was opened here is closed again."""
    if isinstance(run, Run):
        yield run
    else:
        with open_run(run) as own:
            yield own


def check_frame(run: Run, frame: int) -> int:
    """`frame` as an index from 0; negative ones count from the end."""
    if isinstance(frame, bool) or not isinstance(frame, int | np.integer) or not -len(run) <= frame < len(run):
        raise ValueError(f"frame is {frame!r}; '{run.path}' has the frames 0 … {len(run) - 1}")
    return int(frame) % len(run)


def displayed_samples(run: Run, samples: ArrayLike) -> tuple[NDArray[np.complexfloating[Any, Any]], Radar]:
    """The samples (..., chirp, tx, rx, sample) that pictures are made of, and their radar.

    Of several profiles that is the first; of several beams the first. A constant frequency has no picture.

    Raises
    ------
    NoPictureError
        If the chirps tell no ranges.
    """
    array, radar = np.asarray(samples), run.radar
    if radar.waveform.other_profiles:
        array, radar = select_profile(array, radar, 0)
    if radar.waveform.multiplexing == "beam":
        array, radar = select_slot(array, radar, 0)
    if radar.waveform.slope == 0:
        raise NoPictureError(
            f"'{run.path}': radar '{radar.name}' with preset '{radar.preset}' keeps its frequency and tells no ranges: "
            "there are no pictures of it; processing.range_doppler and micro_doppler give velocities"
        )
    return array, radar


@dataclass(frozen=True)
class RunView:
    """Spectrograms of the whole run; what does not move within a frame is taken out."""

    range_time: RangeTime
    doppler_time: DopplerTime
    per_frame: bool
    """Whether the Doppler-time picture has one column a frame (frames with pauses between them)."""
    most_active_frame: int
    """Frame with the fastest motion: the largest mean speed, weighted with the power above the noise."""


def view_run(run: Run) -> RunView:
    """Spectrograms, one frame in memory at a time."""
    radar, times = displayed_samples(run, run.adc[:1])[1], run.frame_times
    gaps = np.diff(times)
    # With pauses a short-time transform has no windows to fill them: one spectrum a frame then says it all.
    per_frame = len(times) > 1 and bool(np.any(gaps > 1.05 * radar.waveform.frame_length))
    if per_frame:
        ranges, dopplers = [], []
        for index, start in enumerate(times):
            cube, _ = displayed_samples(run, run.adc[index : index + 1])
            ranges.append(range_time(cube, radar, frame_times=[start]))
            dopplers.append(doppler_time(cube, radar, frame_times=[start]))
        distance = RangeTime(
            np.concatenate([r.power for r in ranges]), np.concatenate([r.time for r in ranges]), ranges[0].range
        )
        doppler = DopplerTime(
            np.concatenate([d.power for d in dopplers]),
            np.concatenate([d.time for d in dopplers]),
            dopplers[0].velocity,
            dopplers[0].duration,
        )
    else:
        cube, _ = displayed_samples(run, run.adc[:])
        distance = range_time(cube, radar, frame_times=times)
        doppler = micro_doppler(cube, radar, frame_times=times)
    return RunView(distance, doppler, per_frame, _most_active_frame(doppler, times))


def _most_active_frame(seen: DopplerTime, times: FloatArray) -> int:
    power = np.maximum(seen.power - 3 * np.median(seen.power, axis=1, keepdims=True), 0.0)
    # Columns without motion have no mean speed; the run's peak keeps their noise out.
    weight = power.sum(axis=1) + 1e-3 * power.sum(axis=1).max() + np.finfo(float).tiny
    speed = power @ np.abs(seen.velocity) / weight
    return int(np.searchsorted(times, seen.time[speed.argmax()], side="right")) - 1


@dataclass(frozen=True)
class FrameView:
    """One frame, processed."""

    range_doppler: FloatArray
    """(range, velocity) level [dBm], mean over the channels."""
    static: bool
    """Whether that map includes what does not move."""
    range: FloatArray
    """(range,) [m]"""
    velocity: FloatArray
    """(velocity,) [m/s]"""
    azimuth: RangeAzimuth
    """With or without what does not move, as `static` says."""
    cloud: PointCloud
    """Detections that move."""


def view_frame(run: Run, frame: int, *, static: bool = True) -> FrameView:
    """Range-Doppler and range-azimuth maps and the point cloud of one frame; `static` keeps what does not move."""
    samples, radar = displayed_samples(run, run.adc[frame])
    # As long as the map allows: frames may be short.
    train = (min(12, (samples.shape[-1] - 1) // 4), 0)
    guard = (train[0] // 3, 0)
    maps = range_doppler(
        samples,
        radar,
        static=static,
        velocity_bins=2 * samples.shape[0],
        range_bins=2 * samples.shape[3],
    )
    return FrameView(
        range_doppler=watts_to_dbm(maps.power),
        static=static,
        range=maps.range,
        velocity=maps.velocity,
        azimuth=range_azimuth(samples, radar, static=static),
        # A body fills many range cells but few at one speed: order statistics along range alone keep its parts apart.
        cloud=point_cloud(
            samples, radar, method="os", guard=guard, train=train, dynamic_range_db=45.0, window="blackman"
        ),
    )


def display_range(run: Run, frame: int) -> float:
    """Largest range in the pictures [m]: to the farthest return of the PIR, else past the actors, else the radar's."""
    limit = run.radar.max_range
    if run.has_pir:
        delay = run.pir(frame).time_of_arrival
        if np.any(np.isfinite(delay)):
            return float(min(limit, 1.05 * np.nanmax(delay) * SPEED_OF_LIGHT / 2))
    distances = [
        np.linalg.norm(actor.vertices(index) - np.asarray(run.radar.position), axis=1).max()
        for actor in run.actors.values()
        for index in {0, frame, len(run) - 1}
    ]
    return float(min(limit, 1.5 * max(distances))) if distances else limit
