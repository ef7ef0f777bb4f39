"""How fast and how exact the synthesiser is, against the direct sum in vectorised NumPy.

    python tests/benchmarks/synthesis.py --output results/

writes `synthesis.json` and `synthesis.png`. Both methods use all cores and take turns within the run; of each the best
time counts. The direct sum is measured on some of the frame's chirps and element pairs, and scaled to all of them.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.radar import ElementPattern, Radar
from rfgen_sionna.records import RadarPaths
from rfgen_sionna.signal import synthesize

SEED = 0
PATHS = 8000
CASES = {"people": (0.5, 11.0, 5.0), "everything": (0.05, 200.0, 50.0)}
"""Nearest and farthest path [m] and largest radial speed [m/s]."""


def frame(name: str, preset: str, case: str, knots: int = 1) -> tuple[Radar, RadarPaths]:
    """A radar with isotropic elements, and random paths that are as far from each element as a place in space is."""
    radar = replace(Radar.load(name, preset), pattern=ElementPattern(0.0), tx_power_dbm=30.0)
    near, far, speed = CASES[case]
    rng = np.random.default_rng(SEED)
    shape = (len(radar.tx_names), len(radar.rx_names))
    sines = rng.uniform(-0.7, 0.7, (2, PATHS))
    towards = np.stack([np.sqrt(1 - (sines**2).sum(axis=0)), *sines], axis=1)
    gain = rng.normal(size=(*shape, PATHS, 1)) + 1j * rng.normal(size=(*shape, PATHS, 1))
    times = np.zeros(1) if knots == 1 else np.linspace(0, radar.waveform.frame_length, knots)
    length = 2 * (rng.uniform(near, far, PATHS)[:, None] + rng.uniform(-speed, speed, PATHS)[:, None] * times)
    aside = radar.virtual_positions @ towards.T
    tau = (np.maximum(length, 0.01) - aside[..., None]) / SPEED_OF_LIGHT
    rate = np.gradient(tau, times, axis=-1) if knots > 1 else np.zeros_like(tau)
    if knots == 1:
        rate += 2 * rng.uniform(-speed, speed, (PATHS, 1)) / SPEED_OF_LIGHT
    direction = np.broadcast_to(towards[:, None], (PATHS, knots, 3))
    zero = np.zeros(PATHS, np.int32)
    paths = RadarPaths(
        np.repeat(gain, knots, axis=-1), tau, rate, times, radar.center_frequency, direction, direction, zero, zero,
        zero.astype(np.uint8), zero.astype(np.uint8), ("thing",), ("thing",), zero,
    )  # fmt: skip
    return radar, paths


def direct(radar: Radar, paths: RadarPaths, parts: list[tuple[int, int, int]]) -> np.ndarray:
    """(part, sample) from the definition, for (chirp, tx, rx) each; single knots."""
    wave = radar.waveform
    t = wave.sample_times

    def one(part: tuple[int, int, int]) -> np.ndarray:
        chirp, tx, rx = part
        now = wave.chirp_times[chirp, tx] + t - paths.times[0]
        tau = paths.tau[tx, rx] + paths.tau_rate[tx, rx] * now
        cycles = tau * (wave.start_frequency + wave.slope * t - 0.5 * wave.slope * tau)
        cycles -= np.rint(cycles)
        return np.conj(paths.a[tx, rx, :, 0]) @ np.exp(2j * np.pi * cycles)

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return np.array(list(pool.map(one, parts)))


def some_parts(radar: Radar, count: int) -> list[tuple[int, int, int]]:
    """Chirps and element pairs all over the frame."""
    rng = np.random.default_rng(SEED)
    loops, tx, rx, _ = radar.frame_shape
    chosen = rng.choice(loops * tx * rx, size=count, replace=False)
    return [tuple(int(x) for x in np.unravel_index(index, (loops, tx, rx))) for index in chosen]  # type: ignore[misc]


def timed(work: Any) -> tuple[float, Any]:
    begin = time.perf_counter()
    result = work()
    return time.perf_counter() - begin, result


def compare(case: str, repeats: int, parts: int) -> dict[str, Any]:
    """The frame of 12 channels both ways."""
    radar, paths = frame("awr1843", "mmmesh", case)
    chosen = some_parts(radar, parts)
    loops, tx, rx, _ = radar.frame_shape
    synthesize(radar, paths, 0.0, device="cpu")  # compiles the kernel
    fast, slow = [], []
    for _ in range(repeats):
        elapsed, samples = timed(lambda: synthesize(radar, paths, 0.0, device="cpu"))
        fast.append(elapsed)
        elapsed, truth = timed(lambda: direct(radar, paths, chosen))
        slow.append(elapsed * loops * tx * rx / parts)
    found = np.array([samples[part] for part in chosen])
    return {
        "seconds": fast,
        "direct_sum_seconds": slow,
        "direct_sum_measured_share": parts / (loops * tx * rx),
        "times_faster": min(slow) / min(fast),
        "relative_error": float(np.linalg.norm(found - truth) / np.linalg.norm(truth)),
    }


def tolerances(parts: int) -> list[dict[str, float]]:
    """Error and time against the tolerance that is asked for."""
    radar, paths = frame("awr1843", "mmmesh", "everything")
    chosen = some_parts(radar, parts)
    truth = direct(radar, paths, chosen)
    rows = []
    for eps in (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9):
        synthesize(radar, paths, 0.0, eps=eps, device="cpu")
        trials = [timed(lambda eps=eps: synthesize(radar, paths, 0.0, eps=eps, device="cpu")) for _ in range(3)]
        found = np.array([trials[0][1][part] for part in chosen])
        error = float(np.linalg.norm(found - truth) / np.linalg.norm(truth))
        rows.append({"eps": eps, "relative_error": error, "seconds": min(elapsed for elapsed, _ in trials)})
    return rows


def peak_memory(name: str, preset: str) -> dict[str, float] | None:
    """What a frame takes beyond its paths, the output included [MB], in a process of its own; Linux tells."""
    command = [sys.executable, __file__, "--memory", name, preset]
    report = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    found: dict[str, float] | None = json.loads(report)
    return found


def report_memory(name: str, preset: str) -> None:
    """The child's part of :func:`peak_memory`."""
    status, refs = Path("/proc/self/status"), Path("/proc/self/clear_refs")

    def field(wanted: str) -> float:
        line = next(line for line in status.read_text().splitlines() if line.startswith(wanted))
        return float(line.split()[1]) / 1e3

    radar, paths = frame(name, preset, "people")
    few = paths.select(np.arange(64))
    short = replace(radar, waveform=replace(radar.waveform, num_loops=2))
    synthesize(short, few, 0.0, device="cpu")  # compiles the kernel
    held = sum(array.nbytes for array in (paths.a, paths.tau, paths.tau_rate)) / 1e6
    try:
        refs.write_text("5")  # the peak starts anew
    except OSError:
        print("null")
        return
    before = field("VmRSS")
    samples = synthesize(radar, paths, 0.0, device="cpu")
    output = samples.nbytes / 1e6
    print(json.dumps({"peak": field("VmHWM") - before, "output": output, "paths": held, "limit": 2 * output + held}))


def draw(result: dict[str, Any], path: Path) -> None:
    import matplotlib

    matplotlib.use("agg")
    from matplotlib import pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.6), constrained_layout=True)
    names = [*result["cases"], "cascade"]
    fast = [min(case["seconds"]) for case in result["cases"].values()] + [min(result["cascade"]["seconds"])]
    slow = [min(case["direct_sum_seconds"]) for case in result["cases"].values()] + [np.nan]
    place = np.arange(len(names))
    left.bar(place - 0.2, slow, 0.4, label="direct sum", color="#9aa5b1")
    left.bar(place + 0.2, fast, 0.4, label="synthesize", color="#d1495b")
    for x, y in zip(place + 0.2, fast, strict=True):
        left.annotate(f"{y:.2f} s", (x, y), ha="center", va="bottom", fontsize=8)
    left.set(yscale="log", ylabel="time of a frame [s]", xticks=place, xticklabels=names)
    left.legend(frameon=False)
    rows = result["tolerances"]
    right.loglog([r["eps"] for r in rows], [r["relative_error"] for r in rows], "o-", color="#d1495b", label="error")
    right.loglog([r["eps"] for r in rows], [r["eps"] for r in rows], ":", color="k", label="asked for")
    right.set(xlabel="eps", ylabel="relative error")
    times = right.twinx()
    times.semilogx([r["eps"] for r in rows], [r["seconds"] for r in rows], "s--", color="#30638e")
    times.set_ylabel("time [s]", color="#30638e")
    times.set_ylim(0)
    right.legend(frameon=False)
    figure.savefig(path, dpi=130)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", type=Path, default=Path("."), help="folder for the JSON and the picture")
    parser.add_argument("--repeats", type=int, default=5, help="turns of each method")
    parser.add_argument("--parts", type=int, default=48, help="chirps of element pairs that the direct sum does")
    parser.add_argument("--memory", nargs=2, metavar=("RADAR", "PRESET"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.memory:
        report_memory(*options.memory)
        return
    options.output.mkdir(parents=True, exist_ok=True)
    load = os.getloadavg() if hasattr(os, "getloadavg") else None
    cases = {case: compare(case, options.repeats, options.parts) for case in CASES}
    small = min(min(case["seconds"]) for case in cases.values())
    radar, paths = frame("mmwcas", "ti_default", "people")
    synthesize(radar, paths, 0.0, device="cpu")
    cascade = [timed(lambda: synthesize(radar, paths, 0.0, device="cpu"))[0] for _ in range(options.repeats)]
    result = {
        "command": "python tests/benchmarks/synthesis.py --output tests/benchmarks/results",
        "seed": SEED,
        "paths": PATHS,
        "frame": {"awr1843": [128, 3, 4, 256], "mmwcas": list(radar.frame_shape)},
        "machine": {"cores": os.cpu_count(), "processor": platform.processor() or platform.machine(), "load": load},
        "versions": {name: version(name) for name in ("rfgen_sionna", "numpy", "scipy", "drjit", "finufft")}
        | {"python": platform.python_version()},
        "cases": cases,
        "cascade": {"seconds": cascade, "times_the_small_frame": min(cascade) / small},
        "memory_mb": {
            "awr1843": peak_memory("awr1843", "mmmesh"),
            "mmwcas": peak_memory("mmwcas", "ti_default"),
        },
        "tolerances": tolerances(16),
    }
    (options.output / "synthesis.json").write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
    draw(result, options.output / "synthesis.png")
    for name, case in cases.items():
        print(f"{name}: {min(case['seconds']):.3f} s, {case['times_faster']:.0f} times faster, error", end=" ")
        print(f"{case['relative_error']:.1e}")
    print(f"cascade: {min(cascade):.3f} s, {result['cascade']['times_the_small_frame']:.1f} times the small frame")
    print(f"memory [MB]: {json.dumps(result['memory_mb'])}")


if __name__ == "__main__":
    sys.exit(main())
