"""Where MARS's radar stands, which the data set leaves open: pose, clock and level, fitted on one person.

    python -m experiments.mars.fit --data DATA --work FOLDER --output pose.json

Of subject 2 alone. The lag of the clocks is that at which a stick figure's mean Doppler is likest the radar's. For each
height and squint of a grid, parts of five movements are simulated; full scale and gain follow from the intensities, the
bias of the range from its median, and the best place has the least error of the mean Doppler. With `--samples`, whole
movements that were simulated from there give full scale, gain and bias once more.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.mars.body import MarsPose, pose_record
from experiments.mars.clouds import clouds_of
from experiments.mars.courses import MarsCourse, StickFigure, course_of_clouds
from experiments.mars.recordings import MarsClouds, MarsMovement, read_subject
from experiments.mars.synthesis import simulate
from rfgen_sionna.evaluation.doppler_course import correlation

SUBJECT = 2
HEIGHTS_M = (-0.4, -0.3, -0.2, -0.1, 0.0)
SQUINTS_DEG = (0.0, 6.0, 12.0)
LAGS_S = (-0.1, -0.06, -0.04, -0.02, 0.0, 0.02)
LATERAL_M = 0.2
"""Radar to the right of the Kinect: the median of the points' x against that of the joints [m]."""
PART_ROWS = 240
"""Rows of each movement that are simulated, from its middle."""
EVERY = 10
PART_MOVEMENTS = (3, 4, 6, 8, 10)
"""Movements that are simulated: arms, lunges to the front and the side, squats, a leg and an arm."""


SimulatedPart = tuple[MarsMovement, NDArray[np.int64], NDArray[np.complex64]]
"""Part of a movement, with rows and samples of its simulated frames."""


@dataclass(frozen=True)
class FitErrors:
    """How far a simulated part is from the recorded one."""

    centroid_rms: float
    """[m/s]"""
    spread_rms: float
    """[m/s]"""
    range_rms: float
    """After the bias is fitted [m]."""
    level_rms: float
    """Of a frame's summed intensity, after the gain is fitted [dB]."""
    centroid_correlation: float
    """Mean over movements."""
    points: float
    """Points a frame, simulated over recorded."""


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


def fitted_levels(parts: Sequence[SimulatedPart], pose: MarsPose, rounds: int = 6) -> MarsPose:
    """The pose with the full scale that gives the weakest points (5 %) their intensity, and the gain that gives the
    frames their summed intensity."""
    for _ in range(rounds):
        clouds = _clouds(parts, pose)
        level = float(np.nanmedian(np.concatenate([levels_db(theirs) - levels_db(ours) for theirs, ours in clouds])))
        theirs, ours = (np.concatenate([pair[index].intensity for pair in clouds]) for index in (0, 1))
        weakest = float(20 * np.log10(np.percentile(theirs, 5) / np.percentile(ours, 5)))
        pose = replace(pose, full_scale_dbm=pose.full_scale_dbm - weakest, gain_db=pose.gain_db + level - weakest)
    return pose


def fitted_range(parts: Sequence[SimulatedPart], pose: MarsPose) -> tuple[MarsPose, FitErrors]:
    """The pose with the bias that fits the median ranges, and what is left."""
    clouds = _clouds(parts, pose)
    courses = [(course_of_clouds(theirs), course_of_clouds(ours)) for theirs, ours in clouds]
    shift = float(np.nanmedian(np.concatenate([theirs.range - ours.range for theirs, ours in courses])))
    seen = _joined([theirs for theirs, _ in courses])
    away = seen - _joined([ours for _, ours in courses]) - [0.0, 0.0, shift]
    level = np.concatenate([levels_db(theirs) for theirs, _ in clouds])
    level_rms = float(np.nanstd(level - np.concatenate([levels_db(ours) for _, ours in clouds])))
    rms = np.sqrt(np.nanmean(away**2, axis=0))
    likeness = [correlation(theirs.doppler.centroid, ours.doppler.centroid) for theirs, ours in courses]
    counts = [sum(len(each[index].frame) for each in clouds) for index in (0, 1)]
    found = FitErrors(
        centroid_rms=float(rms[0]), spread_rms=float(rms[1]), range_rms=float(rms[2]), level_rms=level_rms,
        centroid_correlation=float(np.mean(likeness)), points=counts[1] / counts[0],
    )  # fmt: skip
    return replace(pose, range_bias_m=pose.range_bias_m + shift), found


def _clouds(parts: Sequence[SimulatedPart], pose: MarsPose) -> list[tuple[MarsClouds, MarsClouds]]:
    """Recorded and simulated clouds of each part."""
    return [(item.clouds.at_rows(rows), clouds_of(rows, samples, pose, item.movement)) for item, rows, samples in parts]


def _joined(courses: Sequence[MarsCourse]) -> NDArray[np.float64]:
    """(frame, 3) mean Doppler, spread, range."""
    columns = [np.column_stack([each.doppler.centroid, each.doppler.spread, each.range]) for each in courses]
    return np.concatenate(columns)


def simulated_part(movement: MarsMovement, pose: MarsPose, folder: Path) -> SimulatedPart:
    """A part at one height and squint, its samples kept in `folder`."""
    file = folder / f"{movement.name}-{pose.height_m:+.2f}m-{pose.squint_deg:.0f}deg-{pose.lag_s * 1e3:.0f}ms.npz"
    if not file.exists():
        rows, samples = simulate(movement, pose, every=EVERY)
        np.savez(file, rows=rows, samples=samples)
    return simulated_movement(movement, file)


def simulated_movement(movement: MarsMovement, file: Path) -> SimulatedPart:
    """A movement with the samples of a file of :mod:`experiments.mars.synthesis`."""
    with np.load(file) as stored:
        return movement, stored["rows"], stored["samples"]


def _rounded(errors: FitErrors) -> dict[str, float]:
    return {name: round(float(value), 3) for name, value in asdict(errors).items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder with mars/subject2")
    parser.add_argument("--work", type=Path, required=True, help="folder for simulated samples, which are kept")
    parser.add_argument("--output", type=Path, required=True, help="JSON file")
    parser.add_argument("--heights", type=float, nargs="*", default=HEIGHTS_M, help="over the Kinect [m]")
    parser.add_argument(
        "--squints", type=float, nargs="*", default=SQUINTS_DEG, help="of the elevation pattern [degrees]"
    )
    parser.add_argument("--samples", type=Path, help="folder of experiments.mars.synthesis, at the best place")
    parser.add_argument("--place", type=float, nargs=2, metavar=("HEIGHT", "SQUINT"), help="place, without the grid")
    arguments = parser.parse_args()
    arguments.work.mkdir(parents=True, exist_ok=True)
    movements = read_subject(arguments.data, SUBJECT)
    middle = MarsPose(0.0, LATERAL_M, 0.0, 0.0, 0.0, 0.0, -13.0)
    lags = fitted_lag(movements, middle)
    middle = replace(middle, lag_s=max(lags, key=lambda lag: lags[lag]))
    print({lag: round(value, 3) for lag, value in lags.items()}, flush=True)
    centres = [len(item.number) // 2 for item in movements]
    cuts = [
        item.cut(centre - PART_ROWS // 2, centre + PART_ROWS // 2)
        for item, centre in zip(movements, centres, strict=True)
        if item.movement in PART_MOVEMENTS
    ]
    table: list[dict[str, object]] = []
    best: tuple[MarsPose, FitErrors | None] | None = None
    if arguments.place is not None:
        best = replace(middle, height_m=arguments.place[0], squint_deg=arguments.place[1]), None
    for height, squint in () if best else product(arguments.heights, arguments.squints):
        pose = replace(middle, height_m=height, squint_deg=squint)
        parts = [simulated_part(cut, pose, arguments.work) for cut in cuts]
        pose, errors = fitted_range(parts, fitted_levels(parts, pose))
        table.append({"pose": pose_record(pose), **_rounded(errors)})
        print(json.dumps(table[-1]), flush=True)
        if best is None or best[1] is None or errors.centroid_rms < best[1].centroid_rms:
            best = pose, errors
    if best is None:
        parser.error("--heights and --squints: at least one of each is needed")
    whole: dict[str, object] = {}
    if arguments.samples is not None:
        files = [(item, arguments.samples / f"{item.name}.npz") for item in movements]
        parts = [simulated_movement(item, file) for item, file in files if file.exists()]
        pose, errors = fitted_range(parts, fitted_levels(parts, best[0]))
        best = pose, errors
        frames = sum(len(rows) for _, rows, _ in parts)
        whole = {"movements": [item.movement for item, *_ in parts], "frames": frames, **_rounded(errors)}
    result = {
        "pose": pose_record(best[0]),
        "subject": SUBJECT,
        "lags [s]": {str(lag): round(value, 4) for lag, value in lags.items()},
        "grid of parts": table,
        "whole movements": whole,
    }
    arguments.output.write_text(json.dumps(result, indent=1) + "\n")


if __name__ == "__main__":
    main()
