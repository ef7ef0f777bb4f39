"""Overhead (section 8.5): seconds of each stage, by radar.

    python -m experiments.paper.overhead --output FOLDER

Two tables: the package's own benchmark of whole runs (`rfgen bench --part pipeline`: an adult in free space and in the
living room before an AWR1843, start-up, memory), and the stages by radar, for an adult who walks in free space:

- "motion": three seconds of motion, and the body, of a prompt, the body model read before;
- "tracing": the paths of a frame;
- "PIR": an image of 128 x 128 pixels, with a trace of its own;
- "ADC": the samples of a frame from its paths, and their noise and quantisation;
- "chain": range-Doppler map and point cloud of a frame.

All are medians over frames, warm, one after the other, on the machine that the report names.
"""

from __future__ import annotations

import time
from argparse import Namespace
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from experiments.paper.reports import experiment_parser, progress, run_experiment
from rfgen_sionna import Actor, Radar, Simulator
from rfgen_sionna.cli.benchmark import load
from rfgen_sionna.processing import point_cloud, range_doppler_power
from rfgen_sionna.signal import Receiver, receive, synthesize

RADARS = (
    ("awr1843", "mmmesh"), ("awr1642boost", "sdk1"), ("iwr1443boost", "radhar"), ("iwr6843isk", "people_tracking"),
    ("bgt60tr13c", "range_doppler"),
)  # fmt: skip
"""Radar and preset of each row."""
RTOL = 1e-2
"""Tolerance of `rfgen generate`."""
PROMPT = "a person walks to and fro, at 3 m"
"""What is simulated."""
LENGTH = 3.0
"""Length of the motion [s]."""


def stages(name: str, preset: str, frames: int, seed: int) -> dict[str, Any]:
    """Median seconds of each stage for one radar."""
    radar = Radar.load(name, preset=preset, position=(0.0, 0.0, 1.0), look_at=(3.0, 0.0, 1.0))
    wave = radar.waveform

    def person(number: int) -> Actor:
        return Actor.from_prompt(PROMPT, seed=seed + number, radar=radar, duration=LENGTH)

    found: dict[str, list[float]] = {stage: [] for stage in ("motion", "tracing", "PIR", "ADC", "chain")}
    walker = person(0)
    for number in range(1, 4):
        with timed(found["motion"]):
            walker = person(number)
    simulator = Simulator(None, radar, [walker], rtol=RTOL)
    moving = simulator.tracer.follow()
    # the first frames compile kernels and choose facets
    starts = np.linspace(0.0, LENGTH - wave.frame_length, frames + 2).tolist()
    for number, start in enumerate(starts):
        own: dict[str, list[float]] = {stage: [] for stage in found}
        with timed(own["tracing"]):
            traced = simulator.tracer.trace(start, start + wave.frame_length, moving)
        with timed(own["ADC"]):
            parts = [synthesize(radar, each, start, eps=0.3 * RTOL, device="cpu") for each in traced.actors]
            cube = receive(np.sum(parts, axis=0), radar, Receiver(), seed=seed, frame=number).samples
        with timed(own["PIR"]):
            simulator.pir(start)
        with timed(own["chain"]):
            range_doppler_power(cube[None], radar)
            point_cloud(cube, radar)
        if number > 1:
            for stage, seconds in own.items():
                found[stage] += seconds
    medians = {stage: float(np.median(seconds)) for stage, seconds in found.items()}
    frame = medians["tracing"] + medians["ADC"]
    return {
        "seconds": medians, "frames": frames, "shape": radar.frame_shape, "seconds of a frame": frame,
        "frame period [s]": wave.frame_period, "frames a second": 1.0 / frame,
    }  # fmt: skip


@contextmanager
def timed(seconds: list[float]) -> Iterator[None]:
    """Append the seconds that the block takes."""
    begin = time.perf_counter()
    yield
    seconds.append(time.perf_counter() - begin)


def overhead(arguments: Namespace) -> dict[str, Any]:
    """Both tables."""
    quick = arguments.quick
    rows = {}
    for name, preset in RADARS[: 2 if quick else None]:
        progress(f"{name} {preset}")
        rows[f"{name} {preset}"] = stages(name, preset, 3 if quick else 9, arguments.seed)
    bench = load().run(arguments.output / "bench", (), quick, arguments.seed, progress, ("pipeline",), progress)
    if bench["failed"]:
        raise RuntimeError(f"the benchmark failed: {bench['failed']}")
    return {"rtol": RTOL, "prompt": PROMPT, "stages": rows, "benchmark": bench["pipeline"], "load": bench["load"]}


def main(argv: Sequence[str] | None = None) -> None:
    run_experiment("overhead", experiment_parser(__doc__), overhead, argv)


if __name__ == "__main__":
    main()
