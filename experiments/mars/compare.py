"""Simulated clouds of MARS's people against the recorded ones, frame by frame.

    python -m experiments.mars.compare --data DATA --clouds clouds --output compare.json --picture courses.png

Each figure stands beside those of three others on the same frames: the simulation shifted in time by a half of the
movement, and a stick figure without and with that shift. The stick figure's weights, scale and range are fitted on
subject 2; the simulation has no scale. Mean Doppler is that of the points by intensity, range the median.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.mars.body import POSE_FILE, read_pose
from experiments.mars.courses import MarsCourse, StickFigure, course_of_clouds
from experiments.mars.recordings import MOVEMENTS, VELOCITY_STEP, MarsClouds, MarsMovement, read_clouds, read_subject
from rfgen_sionna.evaluation import CloudStatistics, DopplerCourse, compare_statistics, shifted_in_time
from rfgen_sionna.evaluation.doppler_course import correlation, slope

FITTED_ON = 2
TARGETS: Mapping[str, float | tuple[float, float]] = {
    "centroid rms [m/s]": 0.11, "range rms [m]": 0.06, "slope of recorded on simulated": (0.9, 1.1),
    "spread, simulated over recorded": (0.95, 1.05), "Doppler histogram, total variation": 0.03,
    "centroid correlation over the stick figure's": 0.03, "spread correlation over the stick figure's": 0.1,
    "range correlation over the stick figure's": 0.1,
}  # fmt: skip
PREDICTORS = ("simulated", "simulated, shifted", "stick figure", "stick figure, shifted")
TOGETHER, OTHER = "simulated bodies together", "another simulated body"


@dataclass(frozen=True)
class MarsComparison:
    """One movement, recorded and predicted, on the same frames."""

    movement: MarsMovement
    recorded: MarsClouds
    simulated: MarsClouds
    course: MarsCourse
    """Of the recorded clouds."""
    predicted: Mapping[str, MarsCourse]
    """By name of `PREDICTORS`."""


def compared_movement(
    movement: MarsMovement, simulated: MarsClouds, figure: MarsCourse, others: Sequence[MarsClouds] = ()
) -> MarsComparison:
    """Courses of the recorded and simulated clouds and of the stick figure, with their shifted controls.

    With `others`, clouds of other bodies at the same rows, the points of all bodies together are a predictor, too.
    """
    ours = course_of_clouds(simulated)
    recorded = movement.clouds.at_rows(simulated.row)
    predicted = dict(zip(PREDICTORS, (ours, _shifted(ours), figure, _shifted(figure)), strict=True))
    if others:
        predicted[TOGETHER] = course_of_clouds(pooled_clouds([simulated, *others]))
        predicted[OTHER] = course_of_clouds(others[0])
    return MarsComparison(movement, recorded, simulated, course_of_clouds(recorded), predicted)


def pooled_clouds(draws: Sequence[MarsClouds]) -> MarsClouds:
    """The points of several simulations of the same rows in one cloud a frame.

    Raises
    ------
    ValueError
        If the rows differ.
    """
    if any(not np.array_equal(each.row, draws[0].row) for each in draws):
        raise ValueError("simulations have other rows: make them with the same --every and --rows")
    order = np.argsort(np.concatenate([each.frame for each in draws]), kind="stable")
    columns = [np.concatenate([getattr(each, name) for each in draws])[order] for name in
               ("frame", "xyz", "doppler", "intensity")]  # fmt: skip
    return MarsClouds(draws[0].row, *columns)


def figures(items: Sequence[MarsComparison]) -> dict[str, Any]:
    """Figures over the frames of all `items`, by predictor; correlations are means over them."""
    found: dict[str, Any] = {"frames": int(sum(len(item.recorded.row) for item in items))}
    for name in items[0].predicted:
        pooled = [(item.course, item.predicted[name]) for item in items]
        recorded, predicted = (_pooled([pair[index] for pair in pooled]) for index in (0, 1))
        found[name] = {
            "centroid rms [m/s]": _rms(recorded[:, 0], predicted[:, 0]),
            "range rms [m]": _rms(recorded[:, 2], predicted[:, 2]),
            "range bias [m]": float(np.nanmean(predicted[:, 2] - recorded[:, 2])),
            "slope of recorded on simulated": slope(recorded[:, 0], predicted[:, 0]),
            "spread, simulated over recorded": float(np.nanmean(predicted[:, 1]) / np.nanmean(recorded[:, 1])),
            **{
                f"{part} correlation": _mean_correlation(pooled, get)
                for part, get in (
                    ("centroid", lambda course: course.doppler.centroid),
                    ("spread", lambda course: course.doppler.spread),
                    ("range", lambda course: course.range),
                )
            },
        }
    if OTHER in items[0].predicted:
        bodies = [(item.predicted["simulated"], item.predicted[OTHER]) for item in items]
        found["one simulated body on another, centroid correlation"] = _mean_correlation(
            bodies, lambda course: course.doppler.centroid
        )
    return found


def cloud_figures(items: Sequence[MarsComparison]) -> dict[str, Any]:
    """Distances of the distributions of counts, levels and Doppler bins, with the next movement's as a control."""
    theirs = _statistics([item.recorded for item in items])
    ours = _statistics([item.simulated for item in items])
    metrics = compare_statistics(theirs, ours, {})
    return {
        "Doppler histogram, total variation": metrics["doppler"].value,
        "counts, Wasserstein [points]": metrics["counts"].value,
        "levels, Wasserstein [dB]": metrics["levels"].value,
        "points a frame": {"recorded": float(theirs.counts.mean()), "simulated": float(ours.counts.mean())},
        "Doppler histogram": {"recorded": _histogram(theirs), "simulated": _histogram(ours)},
        "height of points [m], 5, 50, 95 %": {
            "recorded": _quantiles([item.recorded for item in items]),
            "simulated": _quantiles([item.simulated for item in items]),
        },
    }


def against_targets(result: Mapping[str, Any]) -> dict[str, Any]:
    """Value, target and whether it is met, of a subject's figures."""
    ours, stick = result["all"]["simulated"], result["all"]["stick figure"]
    values = {
        **{name: ours[name] for name in TARGETS if name in ours},
        "Doppler histogram, total variation": result["clouds"]["Doppler histogram, total variation"],
        **{
            f"{part} correlation over the stick figure's": ours[f"{part} correlation"] - stick[f"{part} correlation"]
            for part in ("centroid", "spread", "range")
        },
    }
    return {name: {"value": values[name], "target": TARGETS[name], "met": _met(name, values[name])} for name in TARGETS}


def draw(comparisons: Mapping[int, Sequence[MarsComparison]], file: Path, seconds: float = 40.0) -> None:
    """Write a picture of the mean Doppler of each person's middle movements."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    shown = [item for items in comparisons.values() for item in items if item.movement.movement in (3, 4, 6, 10)]
    figure, axes = pyplot.subplots(len(shown), 1, figsize=(9, 1.6 * len(shown)), sharex=True, squeeze=False)
    for axis, item in zip(axes[:, 0], shown, strict=True):
        number = item.movement.number[item.recorded.row]
        time = 0.1 * (number - number[0])
        part = time < seconds
        axis.plot(time[part], item.course.doppler.centroid[part], "k", lw=1.2, label="recorded")
        axis.plot(time[part], item.predicted["simulated"].doppler.centroid[part], "C0", lw=1.0, label="simulated")
        axis.plot(time[part], item.predicted["stick figure"].doppler.centroid[part], "C1", lw=0.7, label="stick figure")
        axis.set_title(f"subject {item.movement.subject}, {MOVEMENTS[item.movement.movement]}", fontsize=8, loc="left")
        axis.set_ylabel("m/s", fontsize=8)
        axis.tick_params(labelsize=7)
    axes[0, 0].legend(fontsize=7, ncols=3, loc="upper right")
    axes[-1, 0].set_xlabel("time [s]", fontsize=8)
    figure.tight_layout()
    figure.savefig(file, dpi=80)


def _shifted(course: MarsCourse) -> MarsCourse:
    parts = (course.doppler.centroid, course.doppler.spread, course.range)
    mean, spread, distance = (np.asarray(shifted_in_time(part), np.float64) for part in parts)
    return MarsCourse(DopplerCourse(mean, spread), distance)


def _pooled(courses: Sequence[MarsCourse]) -> NDArray[np.float64]:
    """(frame, 3) mean Doppler, spread, range."""
    columns = [np.column_stack([each.doppler.centroid, each.doppler.spread, each.range]) for each in courses]
    return np.concatenate(columns)


def _mean_correlation(
    pairs: Sequence[tuple[MarsCourse, MarsCourse]], get: Callable[[MarsCourse], NDArray[np.float64]]
) -> float:
    return float(np.nanmean([correlation(get(first), get(second)) for first, second in pairs]))


def _rms(first: NDArray[np.float64], second: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.nanmean((first - second) ** 2)))


def _statistics(clouds: Sequence[MarsClouds]) -> CloudStatistics:
    return CloudStatistics(
        np.concatenate([each.counts for each in clouds]).astype(np.float64),
        20 * np.log10(np.concatenate([each.intensity for each in clouds])),
        np.round(np.concatenate([each.doppler for each in clouds]) / VELOCITY_STEP),
    )


def _histogram(statistics: CloudStatistics) -> list[float]:
    """Shares of the bins -8 … 7."""
    counts = np.bincount(statistics.doppler_bin.astype(int) + 8, minlength=16)
    return [float(share) for share in counts / counts.sum()]


def _quantiles(clouds: Sequence[MarsClouds]) -> list[float]:
    return [float(each) for each in np.percentile(np.concatenate([item.xyz[:, 2] for item in clouds]), [5, 50, 95])]


def _met(name: str, value: float) -> bool:
    target = TARGETS[name]
    if isinstance(target, tuple):
        return target[0] <= value <= target[1]
    return value >= target if "over the stick" in name else value <= target


def _rounded(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _rounded(each) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [_rounded(each) for each in value]
    return round(value, 4) if isinstance(value, float) else value


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder with mars/subjectN")
    parser.add_argument("--clouds", type=Path, required=True, help="folder of experiments.mars.clouds")
    parser.add_argument("--others", type=Path, nargs="*", default=[], help="folders of other bodies, at the same rows")
    parser.add_argument("--output", type=Path, required=True, help="JSON file")
    parser.add_argument("--pose", type=Path, default=POSE_FILE, help="pose of the radar, of experiments.mars.fit")
    parser.add_argument("--picture", type=Path, help="PNG file with courses of the mean Doppler")
    arguments = parser.parse_args()
    names = sorted(file.stem for file in arguments.clouds.glob("subject*-??.npz"))
    if not names:
        parser.error(f"{arguments.clouds}: no subjectN-MM.npz; experiments.mars.clouds makes them")
    pose = read_pose(arguments.pose)
    stick = StickFigure.fit(read_subject(arguments.data, FITTED_ON), pose)
    comparisons: dict[int, list[MarsComparison]] = {}
    for subject in sorted({int(name.removeprefix("subject").split("-")[0]) for name in names}):
        for movement in read_subject(arguments.data, subject):
            if movement.name in names:
                clouds = read_clouds(arguments.clouds / f"{movement.name}.npz")
                figure = stick.course(movement, pose, clouds.row)
                others = [read_clouds(folder / f"{movement.name}.npz") for folder in arguments.others]
                comparisons.setdefault(subject, []).append(compared_movement(movement, clouds, figure, others))
    result: dict[str, Any] = {"fitted on subject": FITTED_ON, "subjects": {}}
    for subject, items in comparisons.items():
        own: dict[str, Any] = {"all": figures(items), "clouds": cloud_figures(items)}
        own["targets"] = against_targets(own)
        own["movements"] = {item.movement.movement: figures([item]) for item in items}
        result["subjects"][subject] = own
    arguments.output.write_text(json.dumps(_rounded(result), indent=1) + "\n")
    print(json.dumps(_rounded({number: own["targets"] for number, own in result["subjects"].items()}), indent=1))
    if arguments.picture:
        draw(comparisons, arguments.picture)


if __name__ == "__main__":
    main()
