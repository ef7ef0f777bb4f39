"""Fidelity of point clouds (section 8.2): Hausdorff and Chamfer distance, counts, levels and Doppler, with controls.

    python -m experiments.paper.cloud_fidelity --output FOLDER

The scenes and the two kinds of simulation are those of `experiments.paper.signal_fidelity`, which see: what is called
measured is a denser simulation with impairments. The same output folder keeps the scenes for both programs. Clouds are
those of the package's own detection, and of TI's out-of-box chain with removal of static clutter.
Result files of real recordings are named, where they are.
"""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import numpy as np

from experiments.paper.fidelity_scenes import made_scenes, opened, real_results, recipe, settings, summary
from experiments.paper.reports import experiment_parser, progress, run_experiment
from rfgen_sionna._types import FloatArray
from rfgen_sionna.dataset import Run
from rfgen_sionna.evaluation import CloudStatistics, compare_clouds, compare_statistics, shifted_in_time
from rfgen_sionna.processing import point_cloud, velocity_axis
from rfgen_sionna.processing.boards import OutOfBoxChain, out_of_box_points

CHAINS = ("package", "out of box")
"""Ways from samples to points."""


@dataclass(frozen=True)
class CloudSeries:
    """Clouds of a recording, frame by frame."""

    points: list[FloatArray]
    """(point, 3) of each frame [m]."""
    statistics: CloudStatistics


def clouds(run: Run, chain: str) -> CloudSeries:
    """Clouds of a run by one of `CHAINS`."""
    cube, radar = run.cube().data, run.radar
    if chain == "out of box":
        found = out_of_box_points(cube, radar, OutOfBoxChain(clutter_removal=True))
        points = [found.position[found.frame == number] for number in range(len(cube))]
        statistics = CloudStatistics(found.counts.astype(float), found.snr_db, found.doppler_bin.astype(float))
        return CloudSeries(points, statistics)
    frames = [point_cloud(frame, radar) for frame in cube]
    cell = abs(float(np.diff(velocity_axis(radar, cube.shape[1]))[0]))
    bins = np.round(np.concatenate([each.velocity for each in frames]) / cell)
    levels = np.concatenate([each.snr_db for each in frames])
    counts = np.array([len(each) for each in frames], float)
    return CloudSeries([each.position for each in frames], CloudStatistics(counts, levels, bins))


def compared(series: dict[str, CloudSeries]) -> dict[str, Any]:
    """Metrics by their names; positions also against the candidate half a recording later."""
    reference, candidate = series["measured"], series["default"]
    others = {name: series[name] for name in ("other scene", "other body")}
    order = shifted_in_time(np.arange(len(candidate.points)))
    shifted = {"shifted in time": [candidate.points[int(index)] for index in order]}
    found = compare_clouds(
        reference.points, candidate.points, {name: each.points for name, each in others.items()} | shifted
    )
    return found | compare_statistics(
        reference.statistics, candidate.statistics, {name: each.statistics for name, each in others.items()}
    )


def cloud_fidelity(arguments: Namespace) -> dict[str, Any]:
    """Metrics by radar and chain, means over the scenes that have points in all of their clouds."""
    quick, seed = arguments.quick, arguments.seed
    scenes = made_scenes(quick, seed, arguments.output / "fidelity")
    found: dict[str, Any] = {}
    for radar in recipe(quick, seed).recording(0).radars:
        for chain in CHAINS:
            metrics: dict[str, list[Any]] = {}
            left_out = []
            for number, files in enumerate(scenes):
                with ExitStack() as stack:
                    runs = opened(stack, files, scenes[(number + 1) % len(scenes)], radar.name)
                    series = {name: clouds(run, chain) for name, run in runs.items()}
                try:
                    own = compared(series)
                except ValueError as error:  # a series without points
                    left_out.append(f"{files.name}: {error}")
                    progress(left_out[-1])
                    continue
                for name, metric in own.items():
                    metrics.setdefault(name, []).append(metric)
            found[f"{radar.radar} {radar.preset}, {chain}"] = {
                "metrics": {name: summary(each) for name, each in metrics.items()}, "left out": left_out
            }  # fmt: skip
    return {**settings(quick, seed), "radars": found, "real recordings": real_results()}


def main(argv: Sequence[str] | None = None) -> None:
    run_experiment("cloud_fidelity", experiment_parser(__doc__), cloud_fidelity, argv)


if __name__ == "__main__":
    main()
