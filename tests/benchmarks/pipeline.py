"""Whole runs: an adult in the living room from mesh to ADC cube, start-up, and memory over many frames."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from scipy.stats import theilslopes

from rfgen_sionna.radar import Radar
from rfgen_sionna.scene import MeshActor
from rfgen_sionna.signal import synthesize
from rfgen_sionna.simulation import Simulator
from rfgen_sionna.tracing.tracer import Tracer
from tests.benchmarks.measuring import ROOT, Peak, best_of, resident, timed
from tests.benchmarks.subjects import ball

RTOL = 0.1
"""What `rfgen generate` traces to, 0.1 dB and 0.6 degrees; a test holds that it does."""
LONG = 150.0
"""Frames of the living room end after so many seconds; their mean tells the rest."""
PASSES = 4
"""Walks that are timed."""
FIRST = """
import time
begin = time.perf_counter()
import rfgen_sionna as rfgen
imported = time.perf_counter() - begin
radar = rfgen.Radar.load("awr1843", "mmmesh", position=(0, 0, 1), look_at=(3, 0, 1))
person = rfgen.Actor.from_prompt("a person walking back and forth, at 3 m", seed=0, radar=radar, duration=1.0)
made = time.perf_counter() - begin
next(rfgen.Simulator(None, radar, [person], rtol={rtol}).frames(0.1))
print(imported, made, time.perf_counter() - begin)
"""


def _walk(duration: float, scene: Any) -> tuple[Radar, Simulator]:
    import rfgen_sionna as rfgen

    radar = Radar.load("awr1843", "mmmesh", position=(0, 0, 1), look_at=(3, 0, 1))
    person = rfgen.Actor.from_prompt("a person walking back and forth, at 3 m", seed=0, radar=radar, duration=duration)
    return radar, Simulator(rfgen.load_scene(scene) if scene else None, radar, [person], rtol=RTOL)


def person(quick: bool) -> dict[str, Any]:
    """An adult of 27,420 facets who walks in free space: an instant, a frame with its knots, its samples."""
    radar, simulator = _walk(2.0, None)
    tracer = Tracer(simulator.scene, radar, simulator.actors, simulator.rtol)
    run, length = tracer.follow(), radar.waveform.frame_length
    times = iter(np.arange(100) * 1e-3 + 0.2)

    def instant() -> None:
        t = float(next(times))
        tracer.trace(t, t, run)

    repeats = 3 if quick else 7
    instant_seconds = best_of(instant, repeats)
    starts = 0.1 * np.arange(1, 9 if quick else 19)

    def walk() -> list[tuple[float, Any]]:
        run = tracer.follow()
        return [timed(lambda t=t: tracer.trace(t, t + length, run)) for t in starts.tolist()]

    # Warm: each kind of frame has its kernels, which the first walk reads from the disk or compiles. Quiet frames, and
    # such in which an arm swings before the body; the first ones of a run choose its facets. Of several walks the
    # median of each is told, and what the quickest frame at each time takes: the machine does other things as well.
    walk()
    passes, traced = [], None
    for _ in range(1 if quick else PASSES):
        frames = walk()[2:]
        passes.append([each for each, _ in frames])
        traced = frames[-1][1]
    del frames
    seconds = np.min(passes, axis=0)

    def samples() -> Any:
        start = traced.moving.times[0]
        return [synthesize(radar, each, start, eps=0.3 * tracer.rtol, device="cpu") for each in traced.actors]

    whole = iter(simulator.frames(1.9))
    next(whole)
    mesh_to_samples = [timed(lambda: next(whole))[0] for _ in range(3 if quick else 9)]
    return {
        "mesh_to_samples_seconds": float(np.median(mesh_to_samples)), "rtol": tracer.rtol,
        "facets": len(simulator.actors[0].faces), "instant_seconds": instant_seconds,
        "frame_seconds": float(seconds.min()), "best_frames_median_seconds": float(np.median(seconds)),
        "best_frames_mean_seconds": float(np.mean(seconds)), "walks_median_seconds": np.median(passes, axis=1).tolist(),
        "instants": traced.report.sample_times, "knots": traced.report.knots, "paths": traced.moving.num_paths,
        "synthesis_seconds": best_of(samples, repeats),
    }  # fmt: skip


def room(quick: bool, progress: Callable[[str], None]) -> dict[str, Any]:
    """Frames of the walker in the living room, 12 x 128 x 256 samples, noise included: 100 of them unless quick, or as
    many as there is patience for."""
    wanted = 4 if quick else 100
    with Peak() as peak:
        (radar, simulator), made = _swapped(timed(lambda: _walk(0.1 * wanted + 0.1, "living_room")))
        frames = simulator.frames(0.1 * wanted)
        first, _ = timed(lambda: next(frames))
        seconds: list[float] = []
        while len(seconds) < wanted - 1 and sum(seconds) < LONG:
            seconds.append(timed(lambda: next(frames))[0])
            progress(f"living room: frame {len(seconds) + 1} of {wanted}")
    # After the run, so that its peak is the run's own.
    static = best_of(lambda: Tracer(simulator.scene, radar, [], simulator.rtol).static, 2 if quick else 4)
    return {
        "static_seconds": static, "frames": 1 + len(seconds), "scene_and_person_seconds": made,
        "first_frame_seconds": first,
        "frame_seconds": float(np.median(seconds)), "all_seconds": first + sum(seconds),
        "seconds_for_100": first + 99 * float(np.mean(seconds)), "peak_mb": peak.megabytes, "rtol": simulator.rtol,
    }  # fmt: skip


def _swapped(pair: tuple[float, Any]) -> tuple[Any, float]:
    return pair[1], pair[0]


def memory(frames: int) -> dict[str, Any]:
    """Resident memory over many frames of a ball that swings."""
    simulator = small_run()
    held = []
    for index, _ in enumerate(simulator.frames(frames * simulator.radar.waveform.frame_period)):
        if index % max(1, frames // 20) == 0:
            held.append(resident())
    known = [each for each in held if each is not None]
    if not known:
        return {"frames": frames, "grown_mb": None}
    settled = np.array(known[len(known) // 4 :])
    # It rises and falls by 20 MB as memory is given back: the median slope between any two times tells a trend.
    trend = float(theilslopes(settled).slope) * (len(settled) - 1)
    return {"frames": frames, "grown_mb": trend, "swing_mb": float(np.ptp(settled)), "resident_mb": known[-1]}


def small_run() -> Simulator:
    """A run that is quick for each frame: few loops, few samples, a coarse ball that swings beside one that stands, so
    that no other facets are asked for in the end than in the beginning."""
    radar = Radar.load("awr1843", "mmmesh")
    radar = replace(radar, waveform=replace(radar.waveform, num_loops=4, num_samples=32, frame_period=0.01))
    swinging = MeshActor.from_mesh(
        ball(2, 0.1), material="pec", name="ball", trajectory=lambda t: (2.0, 0.3 * np.sin(2 * np.pi * t), 0.0)
    )
    other = MeshActor.from_mesh(ball(2, 0.1), material="wood", position=(1.5, 0.6, 0), name="other")
    return Simulator(None, radar, [swinging, other])


def start_up() -> dict[str, Any]:
    """A fresh process: import, body, first frame. At first Dr.Jit finds no kernels kept, then those of the first time.

    Its cache is in the home folder: that of the processes is a new one, with all else that the true one holds.
    """
    found = []
    with TemporaryDirectory() as folder:
        for entry in Path.home().iterdir():
            if entry.name != ".drjit":
                (Path(folder) / entry.name).symlink_to(entry)
        for _ in range(2):
            text = subprocess.run(
                [sys.executable, "-c", FIRST.format(rtol=RTOL)], capture_output=True, text=True, check=True,
                env=os.environ | {"HOME": folder, "PYTHONPATH": str(ROOT)},
            ).stdout  # fmt: skip
            found.append([float(each) for each in text.split()[-3:]])
    keys = ("import_seconds", "with_person_seconds", "first_frame_seconds")
    return {"first": dict(zip(keys, found[0], strict=True)), "second": dict(zip(keys, found[1], strict=True))}


def memory_apart(frames: int) -> dict[str, Any]:
    """:func:`memory` in a process of its own: what other benchmarks hold doesn't count."""
    code = (
        f"import sys; sys.path.insert(0, {str(ROOT)!r}); import json, warnings; warnings.simplefilter('ignore');"
        f"from tests.benchmarks.pipeline import memory; print(json.dumps(memory({frames})))"
    )
    text = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT).stdout
    found: dict[str, Any] = json.loads(text.splitlines()[-1])
    return found


def pieces(quick: bool, progress: Callable[[str], None]) -> dict[str, Callable[[], dict[str, Any]]]:
    """What is measured, by name."""
    return {
        "person": lambda: person(quick),
        "living_room": lambda: room(quick, progress),
        "memory": lambda: memory_apart(60 if quick else 1000),
        "start_up": start_up,
    }
