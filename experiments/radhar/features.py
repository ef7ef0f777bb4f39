"""Plain features of windows of 2 s of a point cloud, without levels.

Of the points outside of Doppler bin 0: their histogram over Doppler, spectra over time of their number and of their
summed Doppler, and statistics of the course of the number, of Doppler, range, height and lateral place. The number
itself is left out: it follows from level and threshold.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from experiments.radhar.recordings import CloudRecording

WINDOW_FRAMES = 54
"""Frames of a window: 2 s at the rate of RadHAR's files."""
FEATURES = 64
"""Number of features."""
_LINES = 12
"""Spectral lines of a series over time, from 0.5 Hz in steps of 0.5 Hz."""


def window_features(recording: CloudRecording, step: int = 27) -> NDArray[np.float64]:
    """(window, 64) features of all whole windows, `step` frames apart."""
    starts = range(0, recording.frames - WINDOW_FRAMES + 1, step)
    return np.array([_features(recording, start) for start in starts]).reshape(-1, FEATURES)


def _features(recording: CloudRecording, start: int) -> NDArray[np.float64]:
    chosen = recording.moving & (recording.frame >= start) & (recording.frame < start + WINDOW_FRAMES)
    frame, doppler = recording.frame[chosen] - start, recording.doppler[chosen]
    position, distance = recording.position[chosen], recording.distance[chosen]
    count = np.bincount(frame, minlength=WINDOW_FRAMES).astype(float)
    total = np.bincount(frame, weights=doppler, minlength=WINDOW_FRAMES)
    size = np.bincount(frame, weights=np.abs(doppler), minlength=WINDOW_FRAMES)
    histogram = np.bincount(doppler + 8, minlength=16)[:16] / max(1, len(doppler))
    taper = np.hanning(WINDOW_FRAMES)
    spectra = []
    for series in (count, total):
        lines = np.abs(np.fft.rfft((series - series.mean()) * taper))[1 : _LINES + 1]
        spectra.append(lines / max(1e-9, lines.sum()))
    places = np.column_stack([distance, position[:, 2], position[:, 1]])
    spreads = []
    for values in places.T:
        low, middle, high = np.percentile(values, [10, 50, 90]) if len(values) else (0.0, 0.0, 0.0)
        spreads += [high - low, values.std() if len(values) else 0.0, middle - low]
    along = np.corrcoef(doppler, places.T)[0, 1:] if len(doppler) > 4 and doppler.std() > 0 else np.zeros(3)
    by_frame = distance_course(frame, distance)
    statistics = [
        count.std() / (1 + count.mean()), (count > 0).mean(),
        np.abs(doppler).mean() if len(doppler) else 0.0, doppler.std() if len(doppler) else 0.0,
        doppler.mean() if len(doppler) else 0.0, (np.abs(doppler) > 1).mean() if len(doppler) else 0.0,
        (np.abs(doppler) > 3).mean() if len(doppler) else 0.0, size.std() / (1 + size.mean()),
        np.abs(total).mean() / max(1e-9, size.mean()), *by_frame, *spreads, *np.nan_to_num(along),
    ]  # fmt: skip
    return np.concatenate([histogram, *spectra, statistics])


def distance_course(frame: NDArray[np.int64], distance: NDArray[np.float64]) -> tuple[float, float, float]:
    """Of the distance of points [m]: standard deviation over time of a frame's mean, mean extent within a frame, and
    magnitude of the trend over the window."""
    numbers = np.unique(frame)
    if len(numbers) < 3:
        return 0.0, 0.0, 0.0
    means = np.array([distance[frame == number].mean() for number in numbers])
    within = np.array([np.ptp(distance[frame == number]) for number in numbers])
    slope = np.polyfit(numbers, means, 1)[0] * WINDOW_FRAMES
    return float(means.std()), float(within.mean()), float(abs(slope))
