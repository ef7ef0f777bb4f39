"""Course of Doppler over time: centroid and spread of each frame, and their agreement with a reference."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rfgen_sionna._types import FloatArray
from rfgen_sionna.evaluation.controlled_metric import ControlledMetric, shifted_in_time, with_controls


@dataclass(frozen=True)
class DopplerCourse:
    """Doppler over the frames of a recording; NaN in frames without returns."""

    centroid: FloatArray
    """(frame,) mean velocity, weighted by power [m/s]."""
    spread: FloatArray
    """(frame,) standard deviation about it [m/s]."""


def course_of_spectra(power: ArrayLike, velocity: ArrayLike) -> DopplerCourse:
    """Course of Doppler spectra: `power` (frame, velocity) in any unit, on the axis `velocity` (velocity,) [m/s].

    Other shapes, and powers that are negative or not finite, are a ValueError.
    """
    weight, speed = np.asarray(power, np.float64), np.asarray(velocity, np.float64)
    if weight.ndim != 2 or weight.shape[1:] != speed.shape or np.any(weight < 0) or not np.all(np.isfinite(weight)):
        raise ValueError(
            f"power has shape {weight.shape} and velocity {speed.shape}: finite powers (frame, velocity) are needed"
        )
    return _course(weight.sum(axis=1), weight @ speed, weight @ speed**2)


def course_of_points(frame: ArrayLike, velocity: ArrayLike, weight: ArrayLike, frames: int) -> DopplerCourse:
    """Course of a point cloud, (point,) each: number of the frame, velocity [m/s], power; and the number of frames.

    Other shapes, and numbers of frames beyond `frames`, are a ValueError.
    """
    number, speed, power = np.asarray(frame), np.asarray(velocity, np.float64), np.asarray(weight, np.float64)
    if not number.shape == speed.shape == power.shape or (
        len(number) and not 0 <= number.min() <= number.max() < frames
    ):
        raise ValueError(
            f"frame, velocity and weight have shapes {number.shape}, {speed.shape}, {power.shape} for {frames} frames: "
            "one value a point, and numbers of frames from 0, are needed"
        )
    weights = (power, power * speed, power * speed**2)
    sums = [np.bincount(number, weights=each, minlength=frames).astype(np.float64) for each in weights]
    return _course(sums[0], sums[1], sums[2])


def compare_courses(
    reference: DopplerCourse,
    candidate: DopplerCourse,
    controls: Mapping[str, DopplerCourse] | None = None,
    *,
    shift: int | None = None,
) -> dict[str, ControlledMetric]:
    """Agreement over the frames that both have: "centroid_correlation", "spread_correlation" (1 is best),
    "centroid_rms" and "spread_rms" [m/s], and "centroid_slope", the distance of the least-squares slope of reference on
    candidate from 1.

    The candidate shifted in time by `shift` frames, by default by a half of them, is a control of every call. Fewer
    than 2 frames that both have, and courses of other lengths, are a ValueError.
    """
    others = dict(controls or {})
    others["shifted in time"] = DopplerCourse(
        *(np.asarray(shifted_in_time(part, shift), np.float64) for part in (candidate.centroid, candidate.spread))
    )
    results = {}
    for part in ("centroid", "spread"):
        series = {name: getattr(course, part) for name, course in others.items()}
        first, second = getattr(reference, part), getattr(candidate, part)
        results[f"{part}_correlation"] = with_controls(
            f"{part}_correlation", correlation, first, second, series, higher_is_better=True
        )
        results[f"{part}_rms"] = with_controls(f"{part}_rms", _rms, first, second, series, unit="m/s")
        if part == "centroid":
            results["centroid_slope"] = with_controls(
                "centroid_slope", lambda a, b: abs(slope(a, b) - 1), first, second, series
            )
    return results


def correlation(first: ArrayLike, second: ArrayLike) -> float:
    """Pearson's correlation over the frames where both are finite; NaN for a constant series."""
    a, b = _common(first, second)
    a, b = a - a.mean(), b - b.mean()
    scale = float(np.sqrt(np.sum(a**2) * np.sum(b**2)))
    return float(np.sum(a * b) / scale) if scale > 0 else float("nan")


def slope(first: ArrayLike, second: ArrayLike) -> float:
    """Least-squares slope of `first` on `second` over the frames where both are finite; NaN for a constant `second`."""
    a, b = _common(first, second)
    variance = float(np.sum((b - b.mean()) ** 2))
    return float(np.sum((a - a.mean()) * (b - b.mean())) / variance) if variance > 0 else float("nan")


def _rms(first: ArrayLike, second: ArrayLike) -> float:
    a, b = _common(first, second)
    return float(np.sqrt(np.mean((a - b) ** 2)))


def _common(first: ArrayLike, second: ArrayLike) -> tuple[FloatArray, FloatArray]:
    a, b = np.asarray(first, np.float64), np.asarray(second, np.float64)
    if a.shape != b.shape or a.ndim != 1:
        raise ValueError(f"series have shapes {a.shape} and {b.shape}: one value a frame, of as many frames, is needed")
    both = np.isfinite(a) & np.isfinite(b)
    if both.sum() < 2:
        raise ValueError(f"{both.sum()} frames have values in both series: at least 2 are needed")
    return a[both], b[both]


def _course(total: FloatArray, first: FloatArray, second: FloatArray) -> DopplerCourse:
    with np.errstate(invalid="ignore", divide="ignore"):
        centroid = np.where(total > 0, first / total, np.nan)
        spread = np.sqrt(np.maximum(second / total - centroid**2, 0.0))
    return DopplerCourse(centroid, np.where(total > 0, spread, np.nan))
