"""Point clouds of simulated samples: gain, noise, the board's chain, and the data set's crop.

python -m experiments.mars.clouds --samples samples --output clouds
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.mars.body import POSE_FILE, MarsPose, read_pose
from experiments.mars.recordings import RANGE_STEP, VELOCITY_STEP, MarsClouds, write_clouds
from rfgen_sionna.processing.boards import out_of_box_points
from rfgen_sionna.signal.noise import noise_power

CROP = ((-1.0, 1.0), (0.0, 3.0), (-1.0, 1.0))
"""Bounds of x, y and z [m] of the points in the data set."""


def clouds_of(rows: NDArray[np.int64], samples: NDArray[np.complex64], pose: MarsPose, seed: int = 0) -> MarsClouds:
    """Clouds of noise-free samples (frame, chirp, tx, rx, sample) [sqrt(W)] at `rows`, in the board's own units."""
    radar = pose.radar()
    rng = np.random.default_rng(np.random.SeedSequence([54, seed]))
    parts = [rng.standard_normal(samples.shape, dtype=np.float32) for _ in range(2)]
    noise = np.float32(np.sqrt(noise_power(radar) / 2)) * (parts[0] + 1j * parts[1])
    cube = (samples * np.float32(10 ** (pose.gain_db / 20)) + noise).astype(np.complex64)
    points = out_of_box_points(cube, radar, pose.chain())
    wave = radar.waveform
    bins = 1 << (wave.num_samples - 1).bit_length()
    scale = RANGE_STEP * bins / wave.range_window * (1 + pose.range_bias_m / np.maximum(points.range, RANGE_STEP))
    xyz = np.stack([-points.position[:, 1], points.position[:, 0], points.position[:, 2]], axis=1) * scale[:, None]
    low, high = np.transpose(CROP)
    kept = np.all((xyz >= low) & (xyz <= high), axis=1)
    doppler = points.doppler_bin[kept].astype(np.float64) * VELOCITY_STEP
    return MarsClouds(rows, points.frame[kept], xyz[kept], doppler, np.asarray(points.peak[kept], np.float64))


def simulated_clouds(file: Path, pose: MarsPose, seed: int = 0) -> MarsClouds:
    """Clouds of the samples of one movement (:mod:`experiments.mars.synthesis`); its name and `seed` draw the noise."""
    with np.load(file) as stored:
        rows, samples = stored["rows"], stored["samples"]
    return clouds_of(rows, samples, pose, 1000 * seed + int("".join(filter(str.isdigit, file.stem))))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samples", type=Path, required=True, help="folder of experiments.mars.synthesis")
    parser.add_argument("--output", type=Path, required=True, help="folder for the clouds")
    parser.add_argument("--pose", type=Path, default=POSE_FILE, help="pose of the radar, of experiments.mars.fit")
    parser.add_argument("--gain-db", type=float, default=0.0, help="added to the gain of the pose [dB]")
    parser.add_argument("--seed", type=int, default=0, help="seed of the noise")
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    pose = read_pose(arguments.pose)
    pose = replace(pose, gain_db=pose.gain_db + arguments.gain_db)
    for file in sorted(arguments.samples.glob("subject*-??.npz")):
        clouds = simulated_clouds(file, pose, arguments.seed)
        write_clouds(arguments.output / file.name, clouds)
        print(f"{file.stem}: {len(clouds.frame) / max(1, len(clouds.row)):.1f} points a frame", flush=True)


if __name__ == "__main__":
    main()
