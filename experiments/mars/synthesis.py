"""Noise-free samples of MARS's people, moved by their joints, at every k-th radar frame.

    python -m experiments.mars.synthesis --data DATA --output samples --every 4

One file for each movement of each person: `rows` (frame,), and `samples` (frame, chirp, tx, rx, sample) in sqrt(W), of
the person in free space. Files that exist are kept, so a call continues after an interruption; `--part I N` makes every
N-th file, for several processes.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import rfgen_sionna as rfgen
from experiments.mars.body import POSE_FILE, MarsPose, frame_times, moving_body, read_pose
from experiments.mars.recordings import FRAME_PERIOD_S, MarsMovement, read_subject, subjects


def simulate(
    movement: MarsMovement, pose: MarsPose, *, every: int, rtol: float = 0.1, seed: int = 0,
) -> tuple[NDArray[np.int64], NDArray[np.complex64]]:  # fmt: skip
    """Rows (frame,) and noise-free samples (frame, chirp, tx, rx, sample) [sqrt(W)] of the radar frames whose number is
    a multiple of `every` after the first one, as far as the recording has them.
    """
    actor, start = moving_body(movement, seed)
    radar = pose.radar()
    radar = replace(radar, waveform=replace(radar.waveform, frame_period=every * FRAME_PERIOD_S))
    begin = pose.lag_s - start - radar.waveform.frame_length / 2
    steps = movement.number - movement.number[0]
    skipped = max(0, int(np.ceil(-begin / radar.waveform.frame_period - 1e-9)))
    last = min(float(frame_times(movement)[-1]) + begin, actor.duration - radar.waveform.frame_length)
    begin += skipped * radar.waveform.frame_period
    row_at = {int(step) // every: row for row, step in enumerate(steps) if step % every == 0}
    simulator = rfgen.Simulator(None, radar, [actor], rtol=rtol)
    rows, samples = [], []
    for frame in simulator.frames(last - begin + radar.waveform.frame_period, start=begin, noise=False):
        row = row_at.get(frame.index + skipped)
        if row is not None:
            rows.append(row)
            samples.append(frame.samples.astype(np.complex64))
    return np.array(rows), np.array(samples)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder with mars/subjectN")
    parser.add_argument("--output", type=Path, required=True, help="folder for the samples")
    parser.add_argument("--pose", type=Path, default=POSE_FILE, help="pose of the radar, of experiments.mars.fit")
    parser.add_argument("--subjects", type=int, nargs="*", help="people to simulate; all by default")
    parser.add_argument("--every", type=int, default=4, help="every k-th radar frame")
    parser.add_argument("--rows", type=int, help="rows of each movement, from its middle; all by default")
    parser.add_argument("--part", type=int, nargs=2, default=(0, 1), metavar=("I", "N"), help="every N-th from I on")
    parser.add_argument("--rtol", type=float, default=0.1)
    parser.add_argument("--seed", type=int, default=0, help="seed of the bodies")
    arguments = parser.parse_args()
    if arguments.every < 1:
        parser.error(f"--every is {arguments.every}: at least 1 is needed")
    arguments.output.mkdir(parents=True, exist_ok=True)
    pose = read_pose(arguments.pose)
    part, parts = arguments.part
    numbers = arguments.subjects or subjects(arguments.data)
    movements = [movement for number in numbers for movement in read_subject(arguments.data, number)]
    movements.sort(key=lambda movement: (movement.movement, movement.subject))  # any number of files is balanced
    for movement in movements[part::parts]:
        file = arguments.output / f"{movement.name}.npz"
        if file.exists():
            continue
        count = len(movement.number)
        first = 0 if arguments.rows is None else max(0, (count - arguments.rows) // 2)
        cut = movement.cut(first, count - first)
        rows, samples = simulate(cut, pose, every=arguments.every, rtol=arguments.rtol, seed=arguments.seed)
        unfinished = file.with_suffix(".part.npz")
        np.savez(unfinished, rows=rows + first, samples=samples)
        unfinished.rename(file)
        print(f"{movement.name}: {len(rows)} frames", flush=True)


if __name__ == "__main__":
    main()
