"""Point clouds of simulated samples: gain, noise, the board's chain, and the data set's crop.

python -m experiments.mars.clouds --samples samples --output clouds
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.mars.body import POSE_FILE, MarsPose, read_pose
from experiments.mars.recordings import RANGE_STEP, VELOCITY_STEP, MarsClouds, write_clouds
from experiments.radhar.clouds import noisy
from rfgen_sionna.processing.boards import CHAINS, OutOfBoxChain, out_of_box_points
from rfgen_sionna.radar import Radar

CROP = ((-1.0, 1.0), (0.0, 3.0), (-1.0, 1.0))
"""Bounds of x, y and z [m] of the points in the data set."""


def clouds_of(
    rows: NDArray[np.int64], samples: NDArray[np.complex64], radar: Radar, gain_db: float, seed: int,
    chain: OutOfBoxChain = CHAINS["mars"],
) -> MarsClouds:  # fmt: skip
    """Clouds of samples (frame, chirp, tx, rx, sample) [sqrt(W)] at `rows`, with the steps of the board's own units."""
    points = out_of_box_points(noisy(samples, radar, seed, -gain_db), radar, chain)
    wave = radar.waveform
    bins = 1 << (wave.num_samples - 1).bit_length()
    scale = RANGE_STEP * bins / wave.range_window
    xyz = np.stack([-points.position[:, 1], points.position[:, 0], points.position[:, 2]], axis=1) * scale
    low, high = np.transpose(CROP)
    kept = np.all((xyz >= low) & (xyz <= high), axis=1)
    return MarsClouds(
        rows,
        points.frame[kept],
        xyz[kept],
        points.doppler_bin[kept] * VELOCITY_STEP,
        np.asarray(points.peak[kept], np.float64),
    )


def simulated_clouds(folder: Path, name: str, pose: MarsPose, chain: OutOfBoxChain = CHAINS["mars"]) -> MarsClouds:
    """Clouds of one movement of `folder` (:mod:`experiments.mars.synthesis`); its name seeds the noise."""
    with np.load(folder / f"{name}.npz") as stored:
        rows, samples = stored["rows"], stored["samples"]
    seed = int("".join(filter(str.isdigit, name)))
    return clouds_of(rows, samples, pose.radar(), pose.gain_db, seed, chain)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samples", type=Path, required=True, help="folder of experiments.mars.synthesis")
    parser.add_argument("--output", type=Path, required=True, help="folder for the clouds")
    parser.add_argument("--pose", type=Path, default=POSE_FILE, help="pose of the radar, of experiments.mars.fit")
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    pose = read_pose(arguments.pose)
    for file in sorted(arguments.samples.glob("subject*-??.npz")):
        clouds = simulated_clouds(arguments.samples, file.stem, pose)
        write_clouds(arguments.output / file.name, clouds)
        print(f"{file.stem}: {len(clouds.frame) / max(1, len(clouds.row)):.1f} points a frame", flush=True)


if __name__ == "__main__":
    main()
