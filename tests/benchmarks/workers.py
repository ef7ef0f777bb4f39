"""Samples of a recording by one process and by several: seconds, and how far they differ.

    python tests/benchmarks/workers.py --output tests/benchmarks/results

All numbers of workers take turns in one process, each twice; the shorter time counts.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import sys
from pathlib import Path
from typing import Any

import numpy as np

if __name__ == "__main__":  # as a script, from any folder
    sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from tests.benchmarks.measuring import code, machine, timed, versions

RTOL, REPEATS = 1e-2, 2
COMMAND = "python tests/benchmarks/workers.py --output tests/benchmarks/results"
SCENES = {"walker": None, "walker in room": "living_room"}


def measure(name: str, counts: list[int], duration: float) -> dict[str, Any]:
    """An adult who walks for a `duration` [s], by each number of workers."""
    import rfgen_sionna as rfgen

    radar = rfgen.Radar.load("awr1843", "mmmesh", position=(0, 0, 1), look_at=(3, 0, 1))
    prompt = "a person walking back and forth, at 3 m"
    person = rfgen.Actor.from_prompt(prompt, seed=0, radar=radar, duration=duration)
    scene = SCENES[name]
    simulator = rfgen.Simulator(rfgen.load_scene(scene) if scene else None, radar, [person], rtol=RTOL)
    simulator.adc(3 * radar.waveform.frame_period, noise=False)  # kernels are compiled, what stays is traced
    seconds: dict[int, list[float]] = {count: [] for count in counts}
    samples = {}
    for _ in range(REPEATS):
        for count in counts:
            spent, cube = timed(lambda count=count: simulator.adc(duration, noise=False, workers=count))
            seconds[count].append(spent)
            samples[count] = cube.data
    scale = np.abs(samples[1]).max()
    several = [count for count in counts if count > 1]
    return {
        "frames": len(samples[1]),
        "seconds": {str(count): each for count, each in seconds.items()},
        "times_as_quick": {str(count): min(seconds[1]) / min(seconds[count]) for count in several},
        "differ_from_one": {str(count): float(np.abs(samples[count] - samples[1]).max() / scale) for count in several},
        "alike": all(np.array_equal(samples[count], samples[several[0]]) for count in several),
        "largest_worker_mb": resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1e3,
    }


def draw(subjects: dict[str, Any], path: Path) -> None:
    """Frames per second over the number of workers."""
    import matplotlib

    matplotlib.use("agg")
    from matplotlib import pyplot as plt

    figure, axis = plt.subplots(figsize=(5.2, 3.6), constrained_layout=True)
    for (name, subject), colour in zip(subjects.items(), ("#30638e", "#d1495b"), strict=False):
        counts = [int(count) for count in subject["seconds"]]
        rate = [subject["frames"] / min(each) for each in subject["seconds"].values()]
        axis.plot(counts, rate, "o-", color=colour, label=name)
    axis.set(xlabel=f"workers, on {os.cpu_count()} cores", ylabel="frames per second", xticks=counts, ylim=(0, None))
    axis.legend(frameon=False)
    figure.savefig(path, dpi=130)


def main() -> int:
    cores = os.cpu_count() or 1
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", type=Path, default=Path("."), help="folder for workers.json and workers.png")
    parser.add_argument("--duration", type=float, default=4.0, help="of the recording [s]")
    options = parser.parse_args()
    counts = sorted({1, 2, *(2**k for k in range(2, cores.bit_length()) if 2**k <= cores), cores} - {0})
    options.output.mkdir(parents=True, exist_ok=True)
    subjects: dict[str, Any] = {}
    for name in SCENES:
        subjects[name] = measure(name, counts, options.duration)
        result = {
            "command": f"{COMMAND} --duration {options.duration:g}", "code": code(), "rtol": RTOL,
            "machine": machine(), "versions": versions(), "subjects": subjects,
        }  # fmt: skip
        (options.output / "workers.json").write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
        draw(subjects, options.output / "workers.png")
        print(f"{name}: {subjects[name]}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
