"""Fidelity of signals (section 8.1): SSIM and PSNR of radar images, with controls.

    python -m experiments.paper.signal_fidelity --output FOLDER

Scenes of furnished rooms are simulated twice: as the package does by default, and in place of a measurement, which it
is not (`experiments.paper.fidelity_scenes`). Images of both are compared, each relative to its own peak: range-Doppler
with and without static returns, range-azimuth and micro-Doppler without. The same metrics against another scene, the
same scene half a recording later, and another person who does the same say what a value means. Result files of real
recordings are named, where they are.
"""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Sequence
from contextlib import ExitStack
from typing import Any

import numpy as np

from experiments.paper.fidelity_scenes import made_scenes, opened, real_results, recipe, settings, summary
from experiments.paper.reports import experiment_parser, run_experiment
from rfgen_sionna._types import FloatArray
from rfgen_sionna.dataset import Run
from rfgen_sionna.evaluation import compare_images, shifted_in_time
from rfgen_sionna.processing import micro_doppler, range_axis, range_azimuth, range_doppler_power

NEAR, FAR = 0.5, 5.0
"""Ranges of the images [m]."""
DIRECTIONS = np.arcsin((np.arange(48) + 0.5) / 24 - 1)
"""Azimuths of the images [rad]."""


def images(run: Run) -> dict[str, FloatArray]:
    """Powers (frame, row, column) by the name of the image; of micro-Doppler (1, window, velocity)."""
    cube, radar = run.cube().data, run.radar
    ranges = range_axis(radar, cube.shape[-1])
    near = (ranges >= NEAR) & (ranges <= FAR)
    azimuths = range_azimuth(cube, radar, azimuth=DIRECTIONS, max_range=FAR, static=False)
    courses = micro_doppler(cube, radar, range_limits=(NEAR, FAR))
    return {
        "range-Doppler": range_doppler_power(cube, radar)[:, near].astype(np.float64),
        "range-Doppler of what moves": range_doppler_power(cube, radar, static=False)[:, near].astype(np.float64),
        "range-azimuth of what moves": azimuths.power[:, azimuths.range >= NEAR],
        "micro-Doppler": courses.power[None],
    }


def signal_fidelity(arguments: Namespace) -> dict[str, Any]:
    """Metrics by radar and image, means over the scenes."""
    quick, seed = arguments.quick, arguments.seed
    scenes = made_scenes(quick, seed, arguments.output / "fidelity")
    found: dict[str, Any] = {}
    for radar in recipe(quick, seed).recording(0).radars:
        metrics: dict[str, dict[str, list[Any]]] = {}
        for number, files in enumerate(scenes):
            with ExitStack() as stack:
                runs = opened(stack, files, scenes[(number + 1) % len(scenes)], radar.name)
                powers = {name: images(run) for name, run in runs.items()}
            for image, reference in powers["measured"].items():
                candidate = powers["default"][image]
                controls = {name: powers[name][image] for name in ("other scene", "other body")}
                moved = candidate if len(candidate) > 1 else candidate[0]
                shifted = np.asarray(shifted_in_time(moved), np.float64).reshape(candidate.shape)
                compared = compare_images(reference, candidate, controls | {"shifted in time": shifted})
                for name, metric in compared.items():
                    metrics.setdefault(image, {}).setdefault(name, []).append(metric)
        found[f"{radar.radar} {radar.preset}"] = {
            image: {name: summary(each) for name, each in own.items()} for image, own in metrics.items()
        }
    return {**settings(quick, seed), "radars": found, "real recordings": real_results()}


def main(argv: Sequence[str] | None = None) -> None:
    run_experiment("signal_fidelity", experiment_parser(__doc__), signal_fidelity, argv)


if __name__ == "__main__":
    main()
