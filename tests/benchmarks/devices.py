"""The tracer on the CPU and on a CUDA device, side by side: what both find, and how long they take for it.

    python tests/benchmarks/devices.py --output tests/benchmarks/results

Each subject runs in a process of its own on each back end. What is compared is samples: those of the static scene and
of the actors, each relative to its largest, beside the errors that the tracer states. Without a CUDA device there is
nothing to compare, and that is said.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

if __name__ == "__main__":  # as a script, from any folder
    sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from rfgen_sionna.scene.mitsuba_backend import VARIANTS, ensure_llvm, has_cuda
from tests.benchmarks.measuring import ROOT, code, machine, timed, versions

RTOL = 1e-2
COMMAND = "python tests/benchmarks/devices.py --output tests/benchmarks/results"
FRAMES = {"walker": 24, "room": 6, "walker in room": 4}
"""Of each subject."""
KEPT = 3
"""Frames whose samples are compared: of all, as many, evenly spread."""
LOST = "more than one OptiX shader binding table"
"""What Dr.Jit says where a kernel asks two scenes."""


def _subject(name: str, radar: Any) -> tuple[Any, list[Any], int | None]:
    """Scene, actors and bounces: an adult of 27,420 facets in free space; a ball in the living room, hidden by its
    furniture, hiding it, and shown by its walls; and the adult there."""
    import trimesh

    import rfgen_sionna as rfgen

    if name == "room":
        mesh = trimesh.creation.icosphere(subdivisions=3, radius=0.2)
        ball = rfgen.Actor.from_mesh(mesh, material="metal", position=(2, 0.2, 1), velocity=(0.5, 0.6, 0), name="ball")
        return rfgen.load_scene("living_room"), [ball], None
    prompt = "a person walking back and forth, at 3 m"
    adult = rfgen.Actor.from_prompt(prompt, seed=0, radar=radar, duration=5.0)
    return (rfgen.load_scene("living_room") if name == "walker in room" else None), [adult], 1


def measure(name: str, variant: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """Of a subject on a back end: times, and samples to compare. For a process of its own."""
    if variant.startswith("llvm"):
        ensure_llvm()
    import mitsuba as mi

    mi.set_variant(variant)
    import drjit as dr

    from rfgen_sionna.radar import Radar
    from rfgen_sionna.signal import synthesize
    from rfgen_sionna.tracing.tracer import Tracer

    radar = Radar.load("awr1843", "mmmesh", position=(0, 0, 1), look_at=(3, 0, 1))
    scene, actors, bounces = _subject(name, radar)
    options = {} if bounces is None else {"max_bounces": bounces}
    length, count = radar.waveform.frame_length, FRAMES[name]

    def tracer() -> Any:
        return Tracer(scene, radar, actors, RTOL, **options)

    samples: dict[str, Any] = {}
    first_static, static = timed(lambda: tracer().static)
    seconds: dict[str, Any] = {"static": [first_static, timed(lambda: tracer().static)[0]]}
    if static.paths.num_paths:
        samples["static"] = synthesize(radar, static.paths, 0.0, eps=0.1 * RTOL, device="cpu")
    traced = tracer()
    _ = traced.static
    starts = 0.2 + 0.1 * np.arange(count)
    kept = np.unique(np.linspace(0, count - 1, KEPT).astype(int)).tolist()
    errors: list[float] = []
    for walk in ("first", "again"):
        run, frames, compiled, held = traced.follow(), [], 0, []
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            for index, start in enumerate(starts.tolist()):
                dr.kernel_history_clear()
                spent, found = timed(lambda start=start, run=run: traced.trace(start, start + length, moving=run))
                shadows, _ = timed(lambda found=found: found.shadows)
                frames.append(spent + shadows)
                fresh = [each for each in dr.kernel_history([dr.KernelType.JIT]) if not each["cache_hit"]]
                compiled += len(fresh)
                held.append(_held(variant))
                if walk == "again" and index in kept:
                    errors.append(float(found.report.error))
                    parts = [synthesize(radar, each, start, eps=0.1 * RTOL, device="cpu") for each in found.changing()]
                    samples[f"actors {index}"] = np.sum(parts, axis=0)
        seconds[f"frames {walk}"] = frames
    settled = [each for each in held[count // 3 :] if each is not None]
    sample_times = [
        timed(lambda t=t: traced.trace(t, t, moving=run))[0] for t in (starts[-1] + 1e-3 * np.arange(1, 12))
    ]
    seconds["instant"] = float(np.median(sample_times))
    report = {
        "seconds": seconds, "stated_errors": {"static": float(static.error), "actors": errors},
        "paths": {"static": static.paths.num_paths, "actors": found.moving.num_paths},
        "compiled_in_second_walk": compiled,
        "grown_mb": max(settled) - settled[0] if settled else None, "machine": machine(),
    }  # fmt: skip
    return report, samples


def _held(variant: str) -> float | None:
    """Memory [MB] in use on the CUDA device, by whomever; None elsewhere."""
    if not variant.startswith("cuda"):
        return None
    driver, context = ctypes.CDLL("libcuda.so.1"), ctypes.c_void_p()
    free, total = ctypes.c_size_t(), ctypes.c_size_t()
    driver.cuDevicePrimaryCtxRetain(ctypes.byref(context), 0)
    driver.cuCtxPushCurrent_v2(context)
    failed = driver.cuMemGetInfo_v2(ctypes.byref(free), ctypes.byref(total))
    driver.cuCtxPopCurrent_v2(ctypes.byref(context))
    driver.cuDevicePrimaryCtxRelease_v2(0)
    return None if failed else (total.value - free.value) / 1e6


def run(name: str, variant: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """:func:`measure` in a process of its own.

    Raises:
        RuntimeError: it failed, or rays were lost.
    """
    with TemporaryDirectory() as folder:
        found = Path(folder, "found.npz")
        command = [sys.executable, str(Path(__file__).resolve()), "--child", name, variant, str(found)]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
        if done.returncode or LOST in done.stderr + done.stdout:
            raise RuntimeError(f"{name} on {variant}: exit status {done.returncode}\n{done.stderr[-4000:]}")
        with np.load(found) as arrays:
            return json.loads(done.stdout.splitlines()[-1]), dict(arrays)


def compare(name: str, progress: Callable[[str], None] = lambda text: None) -> dict[str, Any]:
    """A subject on both back ends: their reports, and how far samples differ, relative to the largest."""
    found = {}
    for variant in VARIANTS:
        begin = time.perf_counter()
        found[variant] = run(name, variant)
        progress(f"{name} on {variant}: {time.perf_counter() - begin:.0f} s")
    (cuda, there), (cpu, here) = (found[variant] for variant in VARIANTS)
    differ = {key: float(np.abs(there[key] - here[key]).max() / np.abs(here[key]).max()) for key in here}
    return {
        "cuda": cuda,
        "cpu": cpu,
        "samples_differ": differ,
        "largest": {k: float(np.abs(v).max()) for k, v in here.items()},
    }


def draw(subjects: dict[str, Any], path: Path) -> None:
    """Seconds of frames, one after the other, on both."""
    import matplotlib

    matplotlib.use("agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(1, len(subjects), figsize=(4.4 * len(subjects), 3.6), constrained_layout=True)
    for axis, (name, subject) in zip(np.atleast_1d(axes), subjects.items(), strict=True):
        for device, colour in (("cpu", "#30638e"), ("cuda", "#d1495b")):
            for walk, style in (("first", ":"), ("again", "-")):
                seconds = subject[device]["seconds"][f"frames {walk}"]
                label = f"{device}, {'with kernels to compile' if walk == 'first' else 'once warm'}"
                axis.semilogy(1 + np.arange(len(seconds)), seconds, style, color=colour, label=label)
        worst = max(subject["samples_differ"].values())
        axis.set(title=f"{name}: samples differ by {100 * worst:.2g} %", xlabel="frame", ylabel="time [s]")
    np.atleast_1d(axes)[0].legend(frameon=False, fontsize=8)
    figure.savefig(path, dpi=130)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", type=Path, default=Path("."), help="folder for devices.json and devices.png")
    parser.add_argument("--subject", action="append", choices=list(FRAMES), help="one of them; all where none is named")
    parser.add_argument("--child", nargs=3, metavar=("SUBJECT", "VARIANT", "FILE"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        name, variant, path = options.child
        report, samples = measure(name, variant)
        np.savez(path, **samples)
        print(json.dumps(report))
        return 0
    if not has_cuda():
        print("There is no CUDA device here to compare with the CPU.", file=sys.stderr)
        return 1
    options.output.mkdir(parents=True, exist_ok=True)
    subjects = {}
    for name in options.subject or list(FRAMES):
        subjects[name] = compare(name, lambda text: print(text, file=sys.stderr))
        result = {"command": COMMAND, "code": code(), "rtol": RTOL, "versions": versions(), "subjects": subjects}
        (options.output / "devices.json").write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
        draw(subjects, options.output / "devices.png")
        for device in ("cpu", "cuda"):
            seconds = subjects[name][device]["seconds"]
            frames = np.median(seconds["frames again"])
            print(f"{name}, {device}: static {seconds['static'][1]:.2f} s, frames {frames:.3f} s, instants", end=" ")
            print(f"{seconds['instant']:.3f} s")
        print(f"{name}: samples differ by {subjects[name]['samples_differ']}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
