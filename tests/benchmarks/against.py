"""CPU time and error of two checkouts, measured in turns on the same machine.

    python -m tests.benchmarks.against OLD NEW                          frames of all scenes
    python -m tests.benchmarks.against OLD NEW --scenes walk room       of some, see the list below
    python -m tests.benchmarks.against OLD NEW --rtol 0.01              both at one tolerance
    python -m tests.benchmarks.against OLD NEW --error                  samples against those of OLD at 0.001
    python -m tests.benchmarks.against OLD NEW --long --batch           10 s of a walk, recordings of a recipe
    python -m tests.benchmarks.against OLD                              OLD alone
    git worktree add ../old 9501ae7                                     makes a checkout of a commit

Every figure is of a fresh process with its checkout on the path, the same interpreter and packages, no CUDA device; the
checkouts take turns. Times of frames are CPU seconds of the process with all its threads, each checkout at the default
tolerance of its `generate` unless --rtol gives one. `first` is the first frame, with its Simulator, of the process;
`later` the median of later ones. The least of --repeats processes counts, as other work only adds: the first process of
a checkout may also compile kernels. `holds` tells whether NEW is as much faster as is asked of it.

--error runs NEW at two tolerances, the defaults of its Simulator and of its `generate`, without noise. `rms` is the
error of all samples relative to theirs, `moving` that of the samples less their mean over the chirps, `stated` the
error in the report of NEW, and `mesh` the change of NEW's samples where the quads of people's bodies are cut along the
other diagonal. The samples of OLD at 0.001 take minutes; --cache keeps them.

Results go into a JSON file. What it holds of the same commits and machine stays, other results are replaced.
"""

from __future__ import annotations

import argparse
import json
import os
import shlex
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tests.benchmarks.against_scenes import ERROR, LONG, SPEED, WORKERS_FACTOR
from tests.benchmarks.measuring import machine, versions

Result = dict[str, Any]
ROOT = Path(__file__).resolve().parents[2]
CHILD = Path(__file__).with_name("against_child.py")
OUTPUT = Path(__file__).with_name("results") / "against.json"
RECIPE = ROOT / "examples" / "recipes" / "thousand.toml"
REFERENCE = 1e-3
"""Tolerance of the samples of the old checkout."""
TOLERANCES = ("simulator", "generate")
"""Whose default is the tolerance of the new one."""
MESH_SHARE = 1 / 3
"""Largest share of the error of the mesh, the change by its diagonals, that an error may have."""
SECONDS, BATCH, RECORDINGS = 10.0, 8, 1000
ENVIRONMENT = {"CUDA_VISIBLE_DEVICES": "", "PYTHONHASHSEED": "0"}


def say(line: str) -> None:
    print(time.strftime("%H:%M:%S"), line, file=sys.stderr, flush=True)


def child(checkout: Path, work: str, **arguments: Any) -> Result:
    """Answer of a fresh process of a checkout."""
    with tempfile.TemporaryDirectory() as folder:
        request, answer = Path(folder) / "request.json", Path(folder) / "answer.json"
        request.write_text(json.dumps({"checkout": str(checkout), "work": work, "arguments": arguments}))
        done = subprocess.run(
            [sys.executable, "-P", "-W", "ignore", str(CHILD), str(request), str(answer)],
            env=os.environ | ENVIRONMENT | {"PYTHONPATH": str(checkout)}, cwd=folder, capture_output=True, text=True,
            check=False,
        )  # fmt: skip
        if done.returncode or not answer.is_file():
            raise RuntimeError(f"{work} {arguments} of {checkout.name}:\n{done.stderr[-3000:]}")
        found: Result = json.loads(answer.read_text())
    return found


def commit(checkout: Path) -> str:
    """Hash of its commit, with a plus where files differ from it."""

    def git(*words: str) -> str:
        asked = subprocess.run(["git", *words], cwd=checkout, capture_output=True, text=True, check=False)
        return asked.stdout.strip()

    changed = git("status", "--porcelain", "--untracked-files=no", "--", "rfgen_sionna", "radars", "scenes")
    return (git("rev-parse", "HEAD") or "unknown") + ("+" if changed else "")


class Store:
    """Results in a file, written as they come."""

    def __init__(self, path: Path, checkouts: dict[str, Path]) -> None:
        self.path = path
        self.checkouts = checkouts
        facts = {
            "commits": {who: commit(each) for who, each in checkouts.items()}, "machine": machine(),
            "versions": versions(),
        }  # fmt: skip
        before = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
        same = all(before.get(key) == value for key, value in facts.items())
        self.result: Result = before if same else facts

    def keep(self, part: str, name: str, found: Result) -> None:
        """Add a result of a part, with date and command."""
        words = " ".join(shlex.quote(Path(each).name if Path(each).is_absolute() else each) for each in sys.argv[1:])
        about = {"date": time.strftime("%Y-%m-%d"), "command": f"python -m tests.benchmarks.against {words}"}
        self.result.setdefault(part, {})[name] = found | about
        self.path.parent.mkdir(parents=True, exist_ok=True)
        beside = self.path.with_suffix(".part")
        beside.write_text(json.dumps(self.result, indent=1) + "\n", encoding="utf-8")
        beside.replace(self.path)


def speed(store: Store, name: str, rtol: float | str, count: int, repeats: int) -> Result:
    """Times of frames of a scene, in turns."""
    runs: dict[str, list[Result]] = {who: [] for who in store.checkouts}
    for turn in range(repeats):
        for who, checkout in store.checkouts.items():
            found = child(checkout, "frames", name=name, rtol=rtol, count=count)
            runs[who].append(found)
            say(f"{name}, {who}, {turn + 1}: first {found['first']:.2f}, later {found['later_median']:.3f} CPU-s")
    row: Result = {"runs": runs}
    for who, each in runs.items():
        row[who] = {key: min(run[key] for run in each) for key in ("before", "first", "later_median")}
        row[who]["rtol"] = each[0]["rtol"]
    if "new" in row:
        row["factor_first"], row["factor_later"] = (
            row["old"][key] / row["new"][key] for key in ("first", "later_median")
        )
        row["holds"], row["wanted"] = _judged(row, name)
    return row


def _judged(row: Result, name: str) -> tuple[bool, str] | tuple[None, None]:
    """Whether what is asked of a scene holds, and what is; None where nothing is."""
    asked, checks = SPEED[name], []
    if asked.factor is not None:
        checks.append((row["factor_later"] >= asked.factor, f"later {asked.factor:g}x"))
    for most, key, word in ((asked.most_first, "first", "first"), (asked.most_later, "later_median", "later")):
        if most is not None:
            checks.append((row["new"][key] <= most, f"{word} <= {most:g} s"))
    if not checks:
        return None, None
    return all(holds for holds, _ in checks), ", ".join(words for _, words in checks)


def reference(old: Path, name: str, cache: Path) -> tuple[Path, bool]:
    """File of the samples of the old checkout at :data:`REFERENCE`, and whether it was kept."""
    file = cache / f"{commit(old)[:12]}-{name}-{REFERENCE:g}.npz"
    if file.is_file():
        return file, True
    cache.mkdir(parents=True, exist_ok=True)
    child(old, "samples", name=name, rtol=REFERENCE, flip=False, output=str(file))
    return file, False


def error(store: Store, name: str, cache: Path) -> Result:
    """Errors of the samples of a scene at the defaults of the new checkout."""
    begin = time.perf_counter()
    file, kept = reference(store.checkouts["old"], name, cache)
    say(f"{name}, reference: {'kept' if kept else f'{time.perf_counter() - begin:.0f} s'}")
    true, _ = _load(file)
    row: Result = {"people": ERROR[name].people}
    if "new" not in store.checkouts:
        return row
    with tempfile.TemporaryDirectory() as folder:
        for whose in TOLERANCES:
            found: dict[bool, np.ndarray] = {}
            for flip in (False, True) if ERROR[name].people else (False,):
                target = Path(folder) / f"{whose}-{flip}.npz"
                facts = child(store.checkouts["new"], "samples", name=name, rtol=whose, flip=flip, output=str(target))
                found[flip], _ = _load(target)
                if not flip:
                    row[whose] = facts
            row[whose] |= {"rms": _rms(found[False], true), "moving": _rms(_moving(found[False]), _moving(true))}
            row[whose]["holds"] = row[whose]["rms"] <= row[whose]["stated"]
            if True in found:
                row[whose]["mesh"] = _rms(found[True], found[False])
                row[whose]["within_mesh"] = row[whose]["rms"] <= MESH_SHARE * row[whose]["mesh"]
            say(f"{name}, {whose}: rms {row[whose]['rms']:.2g}, stated {row[whose]['stated']:.2g}")
    return row


def _load(file: Path) -> tuple[np.ndarray, Result]:
    with np.load(file) as held:
        return held["samples"], json.loads(str(held["facts"]))


def _rms(found: np.ndarray, true: np.ndarray) -> float:
    """Root mean square of a difference relative to that of what is true."""
    if found.shape != true.shape:
        raise ValueError(f"samples of shape {found.shape}, {true.shape} in the other checkout")
    return float(np.linalg.norm(found - true) / np.linalg.norm(true))


def _moving(samples: np.ndarray) -> np.ndarray:
    """What changes from chirp to chirp of (frame, chirp, tx, rx, sample)."""
    return np.asarray(samples - samples.mean(axis=1, keepdims=True))


def long(store: Store, name: str, rtol: float | str) -> Result:
    """Seconds of the wall clock for 10 s of a walking adult: samples, and the file of `generate`."""
    surroundings, most = LONG[name]
    row: Result = {"wanted": f"samples <= {most:g} s"}
    for whole in (False, True):
        for who, checkout in store.checkouts.items():
            given = {"surroundings": surroundings, "rtol": rtol, "seconds": SECONDS, "whole": whole}
            found = child(checkout, "recording", **given)
            row.setdefault(who, {})["file" if whole else "samples"] = found
            say(f"{name}, {who}, {'file' if whole else 'samples'}: {found['wall']:.1f} s, {found['cpu']:.1f} CPU-s")
    if "new" in row:
        row["holds"] = row["new"]["samples"]["wall"] <= most
    return row


def batch(store: Store) -> Result:
    """Rates of one worker and of two, and hours for a thousand recordings."""
    row: Result = {"recipe": RECIPE.name, "recordings": BATCH, "wanted": f"two workers {WORKERS_FACTOR}x one"}
    for workers in (1, 2):
        for who, checkout in store.checkouts.items():
            found = child(checkout, "batch", recipe=str(RECIPE), count=BATCH, workers=workers)
            row.setdefault(who, {})[str(workers)] = found
            say(f"{BATCH} recordings, {who}, {workers} workers: {found['wall']:.0f} s, {found['cpu']:.0f} CPU-s")
    for who in store.checkouts:
        one, two = (row[who][each]["wall"] for each in "12")
        row[who] |= {"two_to_one": one / two, "hours_for_a_thousand": two / BATCH * RECORDINGS / 3600}
    if "new" in row:
        row["holds"] = row["new"]["two_to_one"] >= WORKERS_FACTOR
    return row


def table(head: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """Aligned columns; numbers to three digits, None as a dash."""

    def text(value: Any) -> str:
        if value is None:
            return "-"
        if isinstance(value, bool):
            return "yes" if value else "NO"
        return f"{value:.3g}" if isinstance(value, float) else str(value)

    cells = [list(head), *([text(each) for each in row] for row in rows)]
    widths = [max(len(row[column]) for row in cells) for column in range(len(head))]
    aligned = [[row[0].ljust(widths[0]), *map(str.rjust, row[1:], widths[1:])] for row in cells]
    lines = ["  ".join(row) for row in aligned]
    return "\n".join([lines[0], "-" * len(lines[0]), *lines[1:]])


def tables(result: Result) -> str:
    """All parts of a result as text."""
    made = []
    if "speed" in result:
        head = ("scene [CPU-s]", "old rtol", "first", "later", "new rtol", "first", "later", "x first", "x later",
                "wanted", "holds")  # fmt: skip
        rows = []
        for name, row in result["speed"].items():
            sides = [row.get(who, {}).get(key) for who in ("old", "new") for key in ("rtol", "first", "later_median")]
            rows.append((name, *sides, *(row.get(key) for key in ("factor_first", "factor_later", "wanted", "holds"))))
        made.append(table(head, rows))
    if "error" in result:
        keys = ("rtol", "rms", "moving", "stated", "holds", "mesh", "within_mesh")
        rows = [
            (f"{name}, {whose}", *(row[whose].get(key) for key in keys))
            for name, row in result["error"].items() for whose in TOLERANCES if whose in row
        ]  # fmt: skip
        made.append(table(("scene, default of", "rtol", "rms", "moving", "stated", "holds", "mesh", "<= mesh/3"), rows))
    if "long" in result:
        sides = [(who, what) for who in ("old", "new") for what in ("samples", "file")]
        rows = [
            (name, *(row.get(who, {}).get(what, {}).get("wall") for who, what in sides), row["wanted"],
             row.get("holds"))
            for name, row in result["long"].items()
        ]  # fmt: skip
        head = ("10 s of a walk [s]", "old samples", "old file", "new samples", "new file", "wanted", "holds")
        made.append(table(head, rows))
    for row in result.get("batch", {}).values():
        rows = [
            (who, *(row[who][each]["wall"] for each in "12"), row[who]["two_to_one"], row[who]["hours_for_a_thousand"])
            for who in ("old", "new") if who in row
        ]  # fmt: skip
        head = (f"{row['recordings']} recordings [s]", "one worker", "two", "two to one", f"hours for {RECORDINGS}")
        made.append(table(head, rows) + f"\nwanted: {row['wanted']}; holds: {row.get('holds', '-')}")
    return "\n\n".join(made)


def parsed(words: Sequence[str] | None) -> argparse.Namespace:
    scenes = "\n".join(f"  {name:<13} {each.title}" for name, each in SPEED.items())
    errors = "\n".join(f"  {name:<13} {each.title}" for name, each in ERROR.items())
    parser = argparse.ArgumentParser(
        prog="python -m tests.benchmarks.against", description=__doc__,
        epilog=f"scenes of frames:\n{scenes}\n\nscenes of --error:\n{errors}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    parser.add_argument("old", type=Path, help="folder of a checkout")
    parser.add_argument("new", type=Path, nargs="?", help="folder of another one; OLD is measured alone without it")
    parser.add_argument("--scenes", nargs="+", choices=sorted({*SPEED, *ERROR}), metavar="SCENE",
                        help="these alone; canyon, minutes of an old checkout, and tiny run only if named")  # fmt: skip
    parser.add_argument("--frames", type=int, default=6, help="number of later frames of a process (6)")
    parser.add_argument("--repeats", type=int, default=2, help="processes for each scene and checkout (2)")
    parser.add_argument("--rtol", type=float, help="tolerance of both; their own defaults without it")
    parser.add_argument("--error", action="store_true", help="errors of samples instead of times of frames")
    parser.add_argument("--long", action="store_true", help="10 s of a walking adult instead of single frames")
    parser.add_argument("--batch", action="store_true", help="recordings of a recipe instead of single frames")
    parser.add_argument("--cache", type=Path, help="folder for the samples of OLD at 0.001, which stay there")
    parser.add_argument("--output", type=Path, default=OUTPUT, help=f"JSON file ({OUTPUT.relative_to(ROOT)})")
    options = parser.parse_args(words)
    for folder in (options.old, options.new):
        if folder is not None and not (folder / "rfgen_sionna").is_dir():
            parser.error(f"{folder} is no checkout: it has no folder rfgen_sionna")
    known = ERROR if options.error else SPEED
    if unknown := [name for name in options.scenes or () if name not in known]:
        parser.error(f"{', '.join(unknown)}: the scenes here are {', '.join(known)}")
    return options


def main(words: Sequence[str] | None = None) -> int:
    options = parsed(words)
    given = {"old": options.old, "new": options.new}
    store = Store(options.output, {who: each.resolve() for who, each in given.items() if each is not None})
    rtol = "generate" if options.rtol is None else options.rtol
    beside = "" if options.rtol is None else f" at {options.rtol:g}"
    with tempfile.TemporaryDirectory() as folder:
        work = []
        if options.error:
            cache = (options.cache or Path(folder)).resolve()
            work += [("error", name, lambda name=name: error(store, name, cache)) for name in options.scenes or ERROR]
        if options.long:
            work += [("long", name + beside, lambda name=name: long(store, name, rtol)) for name in LONG]
        if options.batch:
            work += [("batch", RECIPE.stem, lambda: batch(store))]
        if not work:
            names = options.scenes or [name for name, each in SPEED.items() if not each.asked_for]
            work += [
                ("speed", name + beside, lambda name=name: speed(store, name, rtol, options.frames, options.repeats))
                for name in names
            ]
        failed = False
        for part, name, measure in work:
            try:
                store.keep(part, name, measure())
            except (RuntimeError, ValueError) as reason:  # the others are of use all the same
                failed = True
                say(f"{part}, {name} failed: {reason}")
    print(tables(store.result))
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
