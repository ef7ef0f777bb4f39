"""What a process of one checkout measures for `against.py`: one request, one answer in a JSON file.

    python -P against_child.py REQUEST.json ANSWER.json

with the checkout on PYTHONPATH. A request names the checkout, one of :data:`WORK` and its arguments.
"""

from __future__ import annotations

import inspect
import json
import re
import resource
import sys
import tempfile
import time
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).resolve().parent))  # last: modules beside this file hide no others

import numpy as np
from against_scenes import ERROR, SPEED, walk, with_other_diagonals

Answer = dict[str, Any]


def tolerance(wanted: float | str) -> float | None:
    """A tolerance by number, or the default of `generate` or of the Simulator (None)."""
    if isinstance(wanted, (int, float)):
        return float(wanted)
    if wanted == "simulator":
        return None
    from rfgen_sionna.pipeline import generate

    return float(inspect.signature(generate).parameters["rtol"].default)


def frames(name: str, rtol: float | str, count: int) -> Answer:
    """CPU and wall seconds of the first frame of this process and of `count` later ones.

    The first frame is a run of its own: its Simulator and its samples. While one frame of the second run is summed, the
    next one is traced: its first step takes two traces, its last one none, and neither counts. `before` has the CPU
    seconds of the process until then: imports, people, surroundings.
    """
    setting = SPEED[name].make()
    made, clock = time.process_time(), time.perf_counter()
    simulator = setting.simulator(tolerance(rtol))
    period = simulator.radar.waveform.frame_period
    simulator.adc(period, start=setting.start)
    first, first_clock = time.process_time() - made, time.perf_counter() - clock
    marks, clocks = [], []
    for _ in simulator.frames((count + 2) * period, start=setting.start + period):
        marks.append(time.process_time())
        clocks.append(time.perf_counter())
    later, later_clock = np.diff(marks)[:count], np.diff(clocks)[:count]
    return {
        "rtol": simulator.rtol, "before": made, "first": first,
        "later": later.tolist(), "later_median": float(np.median(later)),
        "first_wall": first_clock, "later_median_wall": float(np.median(later_clock)),
    }  # fmt: skip


def samples(name: str, rtol: float | str, flip: bool, output: str) -> Answer:
    """Samples without noise of a scene, in an `.npz` file, and the errors that the report states."""
    scene = ERROR[name]
    setting, changed = scene.make(), 0.0
    if flip:
        flipped = [with_other_diagonals(actor) for actor in setting.actors]
        setting, changed = replace(setting, actors=tuple(each for each, _ in flipped)), min(c for _, c in flipped)
    begin = time.process_time()
    simulator = setting.simulator(tolerance(rtol))
    duration = scene.frames * simulator.radar.waveform.frame_period
    found = list(simulator.frames(duration, start=setting.start, noise=False))
    stated = max(float(np.hypot(each.report.error, each.report.time_error)) for each in found)
    facts = {
        "rtol": simulator.rtol, "stated": stated, "seconds": time.process_time() - begin, "flipped": changed,
        "facets": found[0].report.facets, "rays": found[0].report.rays,
    }  # fmt: skip
    target = Path(output)
    part = target.with_suffix(".part.npz")
    np.savez(part, samples=np.stack([each.samples for each in found]), facts=json.dumps(facts))
    part.replace(target)
    return facts


def recording(surroundings: str | None, rtol: float | str, seconds: float, whole: bool) -> Answer:
    """Wall and CPU seconds of `seconds` of a walking adult: its samples, or the `whole` file of `generate`."""
    setting = walk(scene=surroundings, duration=seconds)
    clock, cpu = time.perf_counter(), time.process_time()
    if whole:
        from rfgen_sionna.pipeline import generate

        with tempfile.TemporaryDirectory() as folder:
            run = generate(
                actors=setting.actors, environment=setting.scene or "none", radar=setting.radar, duration=seconds,
                output=Path(folder) / "run.h5", collisions="ignore", rtol=tolerance(rtol) or 1e-2,
            )  # fmt: skip
            run.close()
    else:
        setting.simulator(tolerance(rtol)).adc(seconds)
    return {"wall": time.perf_counter() - clock, "cpu": time.process_time() - cpu}


def batch(recipe: str, count: int, workers: int) -> Answer:
    """Seconds of the wall clock in which so many workers make `count` recordings of a recipe, and CPU seconds."""
    import rfgen_sionna as rfgen

    text = Path(recipe).read_text(encoding="utf-8")
    shortened = re.sub(r"^count = \d+$", f"count = {count}", text, count=1, flags=re.MULTILINE)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "recipe.toml"
        file.write_text(shortened, encoding="utf-8")
        clock = time.perf_counter()
        rfgen.build_dataset(file, Path(folder) / "set", workers=workers)
        wall = time.perf_counter() - clock
    used = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return {"wall": wall, "cpu": sum(each.ru_utime + each.ru_stime for each in used)}


WORK = {"frames": frames, "samples": samples, "recording": recording, "batch": batch}


def main() -> None:
    request = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    import rfgen_sionna

    home, checkout = Path(str(rfgen_sionna.__file__)).resolve(), Path(request["checkout"])
    if not home.is_relative_to(checkout):
        raise SystemExit(f"{home} is not in {checkout}")
    warnings.simplefilter("ignore")
    answer = WORK[request["work"]](**request["arguments"])
    Path(sys.argv[2]).write_text(json.dumps(answer), encoding="utf-8")


if __name__ == "__main__":
    main()
