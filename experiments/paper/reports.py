"""What the programs of this folder have in common: their arguments, and the JSON file with a result.

A program is a function that takes the arguments and returns its result as a dictionary:

    def main(argv: Sequence[str] | None = None) -> None:
        run_experiment("noise", experiment_parser(__doc__), noise, argv)
"""

from __future__ import annotations

import argparse
import json
import math
import os
import platform
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from rfgen_sionna.recipes.set_facts import processor_name

ROOT = Path(__file__).resolve().parents[2]
"""Folder of the checkout."""
PACKAGES = ("numpy", "scipy", "scikit-learn", "scikit-image", "torch", "sionna-rt", "mitsuba", "drjit", "anny")
"""Packages whose versions a report names."""


def experiment_parser(description: str | None) -> argparse.ArgumentParser:
    """Parser with `--quick`, `--output` and `--seed`; programs add their own arguments."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="few recordings and short training: a check, no result")
    parser.add_argument("--output", type=Path, required=True, metavar="FOLDER", help="for the JSON file and the sets")
    parser.add_argument("--seed", type=_seed, default=0, help="seed of all that is drawn (default 0)")
    return parser


def run_experiment(
    name: str,
    parser: argparse.ArgumentParser,
    experiment: Callable[[argparse.Namespace], Mapping[str, Any]],
    argv: Sequence[str] | None = None,
) -> Path:
    """Read the arguments, run the experiment, write and print `FOLDER/NAME.json`; its path.

    Wrong arguments end the program before anything is computed. Numbers that are not finite are written as null.
    """
    arguments = parser.parse_args(argv)
    if arguments.output.exists() and not arguments.output.is_dir():
        parser.error(f"--output is '{arguments.output}', a file: give a folder")
    arguments.output.mkdir(parents=True, exist_ok=True)
    begin = time.perf_counter()
    result = experiment(arguments)
    report = {
        "experiment": name,
        "form": "quick" if arguments.quick else "full",
        "seed": arguments.seed,
        "command": " ".join(["python", "-m", f"experiments.paper.{name}", *(sys.argv[1:] if argv is None else argv)]),
        "seconds": round(time.perf_counter() - begin, 1),
        "machine": machine(),
        "versions": versions(),
        "commit": commit(),
        "result": _plain(result),
    }
    file: Path = arguments.output / f"{name}.json"
    file.write_text(json.dumps(report, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    print(json.dumps(report["result"], indent=1))
    print(f"{report['seconds']} s; {file}")
    return file


def progress(text: str) -> None:
    """A line on the way, on standard error."""
    print(text, file=sys.stderr, flush=True)


def machine() -> dict[str, Any]:
    """Processor, number of usable cores, system."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return {"processor": processor_name(), "cores": cores, "system": f"{platform.system()} {platform.machine()}"}


def versions() -> dict[str, str]:
    """Versions of Python and of the packages that decide a result."""
    found = {"python": platform.python_version()}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


def commit() -> str | None:
    """Commit of the checkout, with "+" where tracked files of the package or the experiments are changed."""

    def git(*words: str) -> str:
        return subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=False).stdout.strip()

    try:
        head = git("rev-parse", "HEAD")
        changed = git("status", "--porcelain", "--untracked-files=no", "rfgen_sionna", "experiments")
    except OSError:  # no git
        return None
    return f"{head}{'+' if changed else ''}" if head else None


def _seed(text: str) -> int:
    try:
        value = int(text)
    except ValueError:
        value = -1
    if value < 0:
        raise argparse.ArgumentTypeError(f"'{text}' is no seed: give a whole number from 0")
    return value


def _plain(value: Any) -> Any:
    """The value in JSON's own types."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if hasattr(value, "tolist"):  # NumPy's arrays and numbers
        return _plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value
