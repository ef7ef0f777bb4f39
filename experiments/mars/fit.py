"""Where MARS's radar stands, which the data set leaves open: pose, clock and level, fitted on one person.

    python -m experiments.mars.fit --data DATA --work FOLDER --output pose.json

Of subject 2 alone. The lag of the clocks is that at which a stick figure's mean Doppler is likest the radar's. For each
height and tilt of a grid, part of every movement is simulated; the gain follows from the summed intensities, the depth
from the median range, and the best place has the least sum of squared errors of mean Doppler, its spread, range and
level, each over its variance in the recordings.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.mars.body import MarsPose, pose_record
from experiments.mars.clouds import clouds_of
from experiments.mars.courses import MarsCourse, StickFigure, course_of_clouds
from experiments.mars.recordings import MarsClouds, MarsMovement, read_subject
from experiments.mars.synthesis import simulate
from rfgen_sionna.evaluation.doppler_course import correlation

SUBJECT = 2
HEIGHTS_M = (-0.2, -0.1, 0.0, 0.1)
TILTS_DEG = (0.0, 8.0, 16.0)
LAGS_S = (-0.1, -0.06, -0.04, -0.02, 0.0, 0.02)
LATERAL_M = 0.2
"""Radar to the right of the Kinect: the median of the points' x against that of the joints [m]."""
PART_ROWS = 240
"""Rows of each movement that are simulated, from its middle."""
EVERY = 12


@dataclass(frozen=True)
class FitErrors:
    """How far a simulated part is from the recorded one."""

    centroid_rms: float
    """[m/s]"""
    spread_rms: float
    """[m/s]"""
    range_rms: float
    """After the depth is fitted [m]."""
    level_rms: float
    """Of a frame's summed intensity, after the gain is fitted [dB]."""
    centroid_correlation: float
    """Mean over movements."""
    points: float
    """Points a frame, simulated over recorded."""
    score: float
    """Sum of the four squared errors over the variances of the recorded values."""


def levels_db(clouds: MarsClouds) -> NDArray[np.float64]:
    """(frame,) 20 log10 of the summed intensity [dB]; NaN without points."""
    total = np.bincount(clouds.frame, weights=clouds.intensity, minlength=len(clouds.row))
    return 20 * np.log10(np.where(total > 0, total, np.nan))


def fitted_lag(movements: Sequence[MarsMovement], pose: MarsPose) -> dict[float, float]:
    """Mean correlation over movements of a stick figure's mean Doppler, by lag [s]."""
    found = {}
    for lag in LAGS_S:
        at = replace(pose, lag_s=lag)
        figure = StickFigure.fit(movements, at)
        found[lag] = float(
            np.mean(
                [
                    correlation(
                        course_of_clouds(item.clouds).doppler.centroid,
                        figure.course(item, at, item.clouds.row).doppler.centroid,
                    )
                    for item in movements
                ]
            )
        )
    return found


def fitted_gain_and_depth(
    parts: Sequence[tuple[MarsMovement, NDArray[np.int64], NDArray[np.complex64]]], pose: MarsPose, rounds: int = 3
) -> tuple[MarsPose, FitErrors]:
    """The pose with the gain and the depth that fit best, and what is left."""
    radar = pose.radar()
    for _ in range(rounds):
        clouds = [
            (item.clouds.at_rows(rows), clouds_of(rows, samples, radar, pose.gain_db, item.movement))
            for item, rows, samples in parts
        ]
        steps = np.concatenate([levels_db(theirs) - levels_db(ours) for theirs, ours in clouds])
        pose = replace(pose, gain_db=pose.gain_db + float(np.nanmedian(steps)))
    courses = [(course_of_clouds(theirs), course_of_clouds(ours)) for theirs, ours in clouds]
    away = np.concatenate([theirs.range - ours.range for theirs, ours in courses])
    shift = float(np.nanmedian(away))
    seen = _joined([theirs for theirs, _ in courses])
    errors = _joined([_difference(theirs, ours) for theirs, ours in courses]) - [0.0, 0.0, shift]
    level = np.concatenate([levels_db(theirs) for theirs, _ in clouds])
    rms = np.sqrt(np.nanmean(errors**2, axis=0))
    level_rms = float(np.nanstd(steps))
    score = float(np.sum(rms**2 / np.nanvar(seen, axis=0)) + level_rms**2 / np.nanvar(level))
    likeness = [correlation(theirs.doppler.centroid, ours.doppler.centroid) for theirs, ours in courses]
    counts = [sum(len(each[index].frame) for each in clouds) for index in (0, 1)]
    mean_rms, spread_rms, range_rms = (float(each) for each in rms)
    found = FitErrors(
        mean_rms, spread_rms, range_rms, level_rms, float(np.mean(likeness)), counts[1] / counts[0], score
    )
    return replace(pose, depth_m=pose.depth_m - shift), found


def _joined(courses: Sequence[MarsCourse | NDArray[np.float64]]) -> NDArray[np.float64]:
    """(frame, 3) mean Doppler, spread, range."""
    return np.concatenate([each if isinstance(each, np.ndarray) else _columns(each) for each in courses])


def _columns(course: MarsCourse) -> NDArray[np.float64]:
    return np.column_stack([course.doppler.centroid, course.doppler.spread, course.range])


def _difference(first: MarsCourse, second: MarsCourse) -> NDArray[np.float64]:
    return _columns(first) - _columns(second)


def simulated_part(movement: MarsMovement, pose: MarsPose, folder: Path) -> tuple[NDArray[Any], NDArray[Any]]:
    """Rows and samples of a part at one height and tilt, kept in `folder`."""
    file = folder / f"{movement.name}-{pose.height_m:+.2f}m-{pose.tilt_deg:.0f}deg-{pose.lag_s * 1e3:.0f}ms.npz"
    if not file.exists():
        rows, samples = simulate(movement, pose, every=EVERY)
        np.savez(file, rows=rows, samples=samples)
    with np.load(file) as stored:
        return stored["rows"], stored["samples"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder with mars/subject2")
    parser.add_argument("--work", type=Path, required=True, help="folder for simulated samples, which are kept")
    parser.add_argument("--output", type=Path, required=True, help="JSON file")
    parser.add_argument("--heights", type=float, nargs="*", default=HEIGHTS_M, help="over the Kinect [m]")
    parser.add_argument("--tilts", type=float, nargs="*", default=TILTS_DEG, help="of the boresight [degrees]")
    arguments = parser.parse_args()
    arguments.work.mkdir(parents=True, exist_ok=True)
    movements = read_subject(arguments.data, SUBJECT)
    middle = MarsPose(0.0, LATERAL_M, 0.0, 0.0, 0.0, 9.0)
    lags = fitted_lag(movements, middle)
    middle = replace(middle, lag_s=max(lags, key=lambda lag: lags[lag]))
    print({lag: round(value, 3) for lag, value in lags.items()}, flush=True)
    centres = [len(item.number) // 2 for item in movements]
    cuts = [
        item.cut(centre - PART_ROWS // 2, centre + PART_ROWS // 2)
        for item, centre in zip(movements, centres, strict=True)
    ]
    table, best = [], None
    for height, tilt in product(arguments.heights, arguments.tilts):
        pose = replace(middle, height_m=height, tilt_deg=tilt)
        parts = [(cut, *simulated_part(cut, pose, arguments.work)) for cut in cuts]
        pose, errors = fitted_gain_and_depth(parts, pose)
        table.append({"pose": pose_record(pose), **{name: round(value, 3) for name, value in asdict(errors).items()}})
        print(json.dumps(table[-1]), flush=True)
        if best is None or errors.score < best[1].score:
            best = pose, errors
    if best is None:
        parser.error("--heights and --tilts: at least one of each is needed")
    result = {
        "pose": pose_record(best[0]),
        "subject": SUBJECT,
        "frames": sum(len(rows) for _, rows, _ in parts),
        "lags [s]": {str(lag): round(value, 4) for lag, value in lags.items()},
        "grid": table,
    }
    arguments.output.write_text(json.dumps(result, indent=1) + "\n")


if __name__ == "__main__":
    main()
