"""Data sets, from a recipe to a training loop: sizes, times, the same bits, faults, damage and loading.

    python tests/benchmarks/dataset.py --output tests/benchmarks/results

Every section writes its part of `dataset.json` when it is done; ratios are of one run. `--sections` chooses some, and
those of an earlier run stay. The whole takes about an hour on two quiet cores, and 15 GB on the disk.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import re
import signal
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

from tests.benchmarks.measuring import ROOT, code, machine, timed, versions
from tests.unit.recipes.small_recipes import write_small_recipe

COMMAND = "python tests/benchmarks/dataset.py --output tests/benchmarks/results"
RFGEN = [sys.executable, "-c", "from rfgen_sionna.cli import main; main()"]
"""Command line of this checkout."""
RECIPES = ROOT / "examples" / "recipes"


def _recipe(text: str) -> Any:
    from rfgen_sionna.recipes.recipe import Recipe

    return Recipe.parse(text)


def _small(folder: Path) -> Path:
    """Recipe of balls before a tiny radar, whose recordings take less than a second each, in several shards."""
    return write_small_recipe(folder / "recipe", 12, shard_size="1 MB")


def _thousand(count: int, place: str | None = None) -> Any:
    """The recipe of a thousand recordings with another count, of all places or of one."""
    text = (RECIPES / "thousand.toml").read_text(encoding="utf-8")
    text = re.sub(r"^count = .*$", f"count = {count}", text, flags=re.M)
    if count < 100:  # too few for three splits
        text = re.sub(r"^shares = .*$", "shares = {train = 1.0}", text, flags=re.M)
    if place is not None:
        text = re.sub(r"^places = .*$", f"places = {json.dumps(place)}", text, flags=re.M)
    return _recipe(text)


def _sums(folder: Path) -> str:
    return (folder / "SHA256SUMS").read_text(encoding="ascii")


def _shard_bytes(folder: Path) -> int:
    return sum(path.stat().st_size for path in folder.iterdir() if path.is_file())


def plan(folder: Path, count: int, workers: int) -> dict[str, Any]:
    """Size and time that the plan of a thousand recordings states, and those of a part of it."""
    from rfgen_sionna.recipes.building import build_dataset
    from rfgen_sionna.recipes.planning import plan_dataset

    whole = _thousand(1000)
    spent, stated = timed(lambda: plan_dataset(whole, workers=workers))
    seconds, report = timed(lambda: build_dataset(_thousand(count), folder / "part", workers=workers))
    share = count / 1000
    size = _shard_bytes(folder / "part")
    return {
        "plan_s": spent, "plan": str(stated).splitlines(), "count": count, "workers": workers, "seconds": seconds,
        "bytes": size, "failed": len(report.failures), "bytes_of_a_thousand": size / share,
        "stated_bytes_over_bytes": stated.bytes * share / size,
        "stated_seconds_over_seconds": (stated.start_seconds + (stated.seconds - stated.start_seconds) * share)
        / seconds,
    }  # fmt: skip


def rates(folder: Path, count: int, workers: int) -> dict[str, Any]:
    """Recordings an hour in free space and in furnished rooms, and two processes of one core beside one."""
    from rfgen_sionna.recipes.building import build_dataset

    found: dict[str, Any] = {"count": count}
    for name, place in (("free_space", "free space"), ("furnished", "furnished: an office")):
        recipe = _thousand(count, place)
        for number in dict.fromkeys((workers, 1) if name == "free_space" else (workers,)):
            out = folder / f"{name}-{number}"
            seconds, _ = timed(lambda recipe=recipe, out=out, number=number: build_dataset(recipe, out, workers=number))
            found[f"{name}_per_hour_{number}"] = 3600 * count / seconds
    if workers > 1:
        found["times_as_quick"] = found[f"free_space_per_hour_{workers}"] / found["free_space_per_hour_1"]
        found["machine_times_as_quick"] = machine_scaling(workers)
    return found


def machine_scaling(workers: int, seconds: float = 10.0) -> float:
    """Work of several processes of one thread over that of one, for Fourier transforms of a frame's size in memory."""
    work = (
        "import sys, time, numpy as np\n"
        "cube = np.ones((64, 12, 64, 256), np.complex64); count, end = 0, time.monotonic() + float(sys.argv[1])\n"
        "while time.monotonic() < end: np.fft.fft(cube[count % 64]).sum(); count += 1\n"
        "print(count)"
    )
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}

    def count(processes: int) -> int:
        command = [sys.executable, "-c", work, str(seconds)]
        running = [subprocess.Popen(command, stdout=subprocess.PIPE, env=environment) for _ in range(processes)]
        return sum(int(each.communicate()[0]) for each in running)

    return count(workers) / count(1)


def engines(folder: Path, count: int) -> dict[str, Any]:
    """Checksums of one process, two, Ray with two local workers, and the reversed order."""
    from rfgen_sionna.recipes.building import build_dataset

    recipe = _thousand(count)
    ways: dict[str, dict[str, Any]] = {
        "one process": {"workers": 1},
        "two processes": {"workers": 2},
        "ray, two workers": {"workers": 2, "engine": "ray", "address": "local"},
        "reversed order": {"workers": 2, "order": range(recipe.count - 1, -1, -1)},
    }
    sums = {}
    for name, options in ways.items():
        out = folder / name.replace(" ", "-").replace(",", "")
        build_dataset(recipe, out, **options)
        sums[name] = _sums(out)
    return {"ways": list(ways), "same": len(set(sums.values())) == 1}


def kills(folder: Path, runs: int, seed: int = 0) -> dict[str, Any]:
    """Runs whose driver or worker is killed (SIGKILL) at a random moment, then resumed, beside a whole run."""
    from rfgen_sionna.recipes.building import build_dataset

    draw = random.Random(seed)
    path, whole = _small(folder), folder / "whole"
    seconds, _ = timed(lambda: build_dataset(path, whole, workers=2))
    expected, outcomes = _sums(whole), []
    for number in range(runs):
        out, target = folder / f"killed-{number}", ("driver", "worker")[number % 2]
        command = [*RFGEN, "dataset", "build", str(path), str(out), "--workers", "2"]
        driver = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        time.sleep(draw.uniform(0.3, 1.1) * seconds)
        killed = driver.pid if target == "driver" else draw.choice(_children(driver.pid) or [driver.pid])
        try:
            os.kill(killed, signal.SIGKILL)
        except ProcessLookupError:
            target = "nothing: it had ended"
        code_ = driver.wait(timeout=600)
        before = sorted(each.name for each in out.glob("shard-*.h5")) if out.is_dir() else []
        build_dataset(path, out, workers=2, resume=True)
        outcomes.append({"killed": target, "exit": code_, "shards_before": len(before), "same": _sums(out) == expected})
    return {"runs": runs, "same": sum(each["same"] for each in outcomes), "outcomes": outcomes}


def _children(process: int) -> list[int]:
    """Processes that a process has started, and theirs."""
    try:
        text = Path(f"/proc/{process}/task/{process}/children").read_text(encoding="ascii")
    except OSError:
        return []
    own = [int(each) for each in text.split()]
    return own + [each for child in own for each in _children(child)]


def full_disk(folder: Path) -> dict[str, Any]:
    """A build into a file system of a few megabytes, and its resumption with more space."""
    from rfgen_sionna.recipes.building import build_dataset
    from rfgen_sionna.recipes.repairing import verify_dataset

    recipe, whole = _small(folder), folder / "whole"
    build_dataset(recipe, whole, workers=2)
    size, small = _shard_bytes(whole), folder / "small"
    small.mkdir()
    kilobytes = max(64, int(0.6 * size / 1e3))
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={kilobytes}k", "tmpfs", str(small)], check=False)
    if mounted.returncode:
        return {"skipped": "a file system cannot be mounted here"}
    try:
        try:
            report = build_dataset(recipe, small / "out", workers=2)
            message = "; ".join(failure.reason for failure in report.failures)
        except Exception as error:
            message = f"{type(error).__name__}: {error}"
        subprocess.run(["mount", "-o", f"remount,size={8 * size // 1000 + 20_000}k", str(small)], check=True)
        build_dataset(recipe, small / "out", workers=2, resume=True)
        return {
            "kilobytes": kilobytes, "said": message[:600], "same": _sums(small / "out") == _sums(whole),
            "damaged": len(verify_dataset(small / "out")),
        }  # fmt: skip
    finally:
        subprocess.run(["umount", str(small)], check=False)


def damage(folder: Path, flips: int, seed: int = 0) -> dict[str, Any]:
    """Flipped bytes, one at a time in any file of a set, that `verify` finds; and `repair` of some of them."""
    from rfgen_sionna.recipes.building import build_dataset
    from rfgen_sionna.recipes.repairing import repair_dataset, verify_dataset

    draw, out = random.Random(seed), folder / "set"
    recipe = _small(folder)
    build_dataset(recipe, out, workers=2)
    expected = _sums(out)
    files = sorted(path for path in out.iterdir() if path.is_file() and not path.name.startswith("."))
    sizes = [path.stat().st_size for path in files]
    found, missed = 0, []
    for number in range(flips):
        # Every other one in a file drawn evenly, so that the small files are hit, too.
        path = draw.choice(files) if number % 2 else draw.choices(files, sizes)[0]
        place, bit = draw.randrange(path.stat().st_size), draw.randrange(8)
        _flip(path, place, bit)
        if verify_dataset(out):
            found += 1
        else:
            missed.append([path.name, place])
        _flip(path, place, bit)
    repaired = 0
    for path in files:
        _flip(path, draw.randrange(path.stat().st_size), draw.randrange(8))
        repair_dataset(out, recipe)
        repaired += _sums(out) == expected and not verify_dataset(out)
    return {"flips": flips, "found": found, "missed": missed, "repaired": [repaired, len(files)]}


def _flip(path: Path, place: int, bit: int) -> None:
    with path.open("r+b") as file:
        file.seek(place)
        byte = file.read(1)[0]
        file.seek(place)
        file.write(bytes([byte ^ (1 << bit)]))


def loading(folder: Path, gigabytes: float, workers: int) -> dict[str, Any]:
    """Random and sequential access of a large set, made of copies of the shards of a small one."""
    from rfgen_sionna.recipes.building import build_dataset
    from tests.benchmarks.dataset_loading import enlarge, measure_loading

    build_dataset(_thousand(8, "free space"), folder / "small", workers=workers)
    large = enlarge(folder / "small", folder / "large", gigabytes * 1e9)
    return {"bytes": _shard_bytes(large), **measure_loading(large, workers)}


def training_loop(folder: Path) -> dict[str, Any]:
    """The training loop of the README as it is written there, on the set of its recipe."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    blocks = [block for block in re.findall(r"```python\n(.*?)```", text, flags=re.S) if "RadarDataset" in block]
    if len(blocks) != 1:
        raise RuntimeError(f"the README has {len(blocks)} blocks of Python with RadarDataset: one is needed")
    build = re.search(r"rfgen dataset build (\S+) (\S+)", text)
    if build is None:
        raise RuntimeError("the README has no command 'rfgen dataset build RECIPE FOLDER'")
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    built = [*RFGEN, "dataset", "build", str(ROOT / build[1]), build[2]]
    subprocess.run(built, cwd=folder, check=True, stdout=subprocess.DEVNULL, env=environment)
    run = subprocess.run([sys.executable, "-c", blocks[0]], cwd=folder, check=False, capture_output=True, text=True,
                         env=environment)  # fmt: skip
    lines = [line for line in blocks[0].splitlines() if line.strip()]
    return {"lines": len(lines), "exit": run.returncode, "printed": run.stdout.splitlines()[-5:],
            "error": run.stderr.splitlines()[-3:]}  # fmt: skip


def main() -> int:
    """Run the chosen sections, each in a folder of its own, and keep what they find."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", type=Path, default=Path("."), help="folder for dataset.json")
    parser.add_argument("--work", type=Path, help="folder for the sets (default: a temporary one)")
    parser.add_argument("--sections", nargs="+", help="some of them (default: all)")
    parser.add_argument("--count", type=int, default=100, help="recordings of the part that is held against the plan")
    parser.add_argument("--rate-count", type=int, default=16, help="recordings of which rates are measured")
    parser.add_argument("--kills", type=int, default=20, help="runs that are killed")
    parser.add_argument("--flips", type=int, default=1000, help="bytes that are flipped")
    parser.add_argument("--gigabytes", type=float, default=10.0, help="size of the set that is loaded")
    parser.add_argument("--workers", type=int, default=2, help="processes")
    given = parser.parse_args()
    workers = given.workers
    sections: dict[str, Callable[[Path], dict[str, Any]]] = {
        "engines": lambda folder: engines(folder, 6),
        "kills": lambda folder: kills(folder, given.kills),
        "full_disk": full_disk,
        "damage": lambda folder: damage(folder, given.flips),
        "training_loop": training_loop,
        "loading": lambda folder: loading(folder, given.gigabytes, workers),
        "rates": lambda folder: rates(folder, given.rate_count, workers),
        "plan": lambda folder: plan(folder, given.count, workers),
    }
    chosen = given.sections or list(sections)
    if unknown := set(chosen) - set(sections):
        parser.error(f"sections {', '.join(sorted(unknown))}: there are {', '.join(sections)}")
    target = given.output / "dataset.json"
    kept = json.loads(target.read_text(encoding="utf-8")) if target.is_file() else {}
    for name in chosen:
        with TemporaryDirectory(dir=given.work) as folder:
            seconds, found = timed(lambda name=name, folder=folder: sections[name](Path(folder)))
        origin = {
            "code": code(),
            "machine": machine(),
            "versions": versions(),
            "took_s": seconds,
            "load": os.getloadavg(),
        }
        kept |= {"command": COMMAND, name: found | origin}
        target.write_text(json.dumps(kept, indent=1, default=_plain) + "\n", encoding="utf-8")
        print(f"{name} ({seconds:.0f} s): {json.dumps(found, default=_plain)[:2000]}", flush=True)
    return 0


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else str(value)


if __name__ == "__main__":
    sys.exit(main())
