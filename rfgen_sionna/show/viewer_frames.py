"""Frames and spectrograms for viewers: of a run's samples, or of the representations that it stores instead."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.dataset import Run
from rfgen_sionna.dataset.representations import POINT_FIELDS
from rfgen_sionna.processing.pointcloud import PointCloud
from rfgen_sionna.processing.spectrogram import DopplerTime, RangeTime
from rfgen_sionna.processing.spectrum import watts_to_dbm
from rfgen_sionna.show.displayable import Displayable
from rfgen_sionna.show.run_view import FrameView, RunView, view_frame, view_run


def viewed_frame(run: Displayable, frame: int) -> FrameView:
    """Range-Doppler map and moving points of a frame, static returns removed; what a recording without samples does
    not store is empty."""
    if not isinstance(run, Run) or _stores(run, "adc"):
        return view_frame(run, frame, static=False)
    power, distance, speed = np.empty((0, 0)), np.empty(0), np.empty(0)
    if _stores(run, "range_doppler"):
        maps = run.representation("range_doppler", slice(frame, frame + 1))
        power, distance, speed = maps.frame(0), maps.axes["range"], maps.axes["velocity"]
    points = {name: np.empty(0) for name in POINT_FIELDS}
    if _stores(run, "point_cloud"):
        cloud = run.representation("point_cloud", slice(frame, frame + 1))
        names = map(str, cloud.axes["field"])
        points = dict(zip(names, cloud.frame(0).T.astype(np.float64), strict=True))
    return FrameView(watts_to_dbm(power), True, distance, speed, None, _cloud(run, points))


def viewed_run(run: Displayable) -> RunView:
    """Spectrograms of a run, static returns removed where they are computed from its samples; what a recording without
    samples does not store is empty."""
    if not isinstance(run, Run) or _stores(run, "adc"):
        return view_run(run)
    count, times = len(run), run.frame_times
    power, distance = np.zeros((count, 0)), np.empty(0)
    if _stores(run, "range_doppler"):
        maps = [run.representation("range_doppler", slice(frame, frame + 1)) for frame in range(count)]
        power, distance = np.stack([each.frame(0).sum(axis=-1) for each in maps]), maps[0].axes["range"]
    spectra, windows, speed = np.zeros((count, 1, 0)), np.zeros(1), np.empty(0)
    if _stores(run, "micro_doppler"):
        stored = run.representation("micro_doppler")
        spectra, windows, speed = stored.values, stored.axes["window"], stored.axes["velocity"]
    moments = (times[:, None] + windows).ravel()
    doppler = DopplerTime(spectra.reshape(len(moments), -1), moments, speed, 0.0)
    return RunView(RangeTime(power, times, distance), doppler, False, 0, static=True)


def _cloud(run: Run, points: Mapping[str, FloatArray]) -> PointCloud:
    position = np.stack([points[name] for name in "xyz"], axis=1)
    return PointCloud(
        **{name: points[name] for name in ("range", "velocity", "azimuth", "elevation", "power", "snr_db")},
        device=(position - np.asarray(run.radar.position)) @ run.radar.rotation, position=position, time=0.0,
    )  # fmt: skip


def _stores(run: Run, name: str) -> bool:
    return name in run.contents
