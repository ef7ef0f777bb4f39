"""`rfgen bench`: benchmark of a checkout of the repository."""

from __future__ import annotations

import importlib
import sys
import types
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape

from rfgen_sionna.cli.console import out as _out
from rfgen_sionna.cli.console import report_written, warn

SCENES = "sphere, plate, dihedral, trihedral, person, living_room, car, hand"
_TEXT = """[bold]Parts[/bold]

scenes: run time and error of every method by scene, with pictures · doppler: Doppler floor of a translating adult ·
synthesiser: this package, NumPy, torch · skips: saved work of each culling rule · scaling: exponents over facets, rays,
paths, channels, chirps, frames, actors, bounces · pipeline: mesh to samples, a living room, start-up, memory

[bold]Examples[/bold]

rfgen bench --quick

rfgen bench --out bench/

rfgen bench --scene sphere --scene hand

rfgen bench --part skips --part scaling

All parts take about half an hour on two idle cores, --quick about five minutes. Results are written one by one; the
same command continues after an interruption, and further parts are added to the folder, if code, machine and seed are
the same.

bench.md has the claims with their results and all tables; bench.json has all figures with machine, versions and seed
(docs/benchmarks.md explains them). The benchmark needs a checkout of the repository."""
EPILOG = "\n\n".join(" ".join(paragraph.split()) for paragraph in _TEXT.split("\n\n"))


def bench(
    scene: Annotated[list[str] | None, typer.Option(help=f"One scene (repeatable; default: all): {SCENES}.")] = None,
    part: Annotated[list[str] | None, typer.Option(help="One part (repeatable; default: all), see below.")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Fewer scenes and points, five minutes.")] = False,
    out: Annotated[Path, typer.Option(help="Folder for JSON, tables and pictures.", file_okay=False)] = Path("bench"),
    seed: Annotated[int, typer.Option(min=0, help="Seed of jitter, paths and checked samples.")] = 0,
) -> None:
    """Benchmark time, memory and error against other methods and exact solutions."""
    benchmark = load()
    with _out.status("starting") as status:
        result = benchmark.run(
            out, scene or (), quick, seed,
            lambda text: status.update(escape(text)), part or (), lambda line: _out.print(escape(line)),
        )  # fmt: skip
    for name in ("bench.json", "bench.md"):
        report_written(out / name)
    for name, reason in result["failed"].items():
        warn(f"{name} failed: {reason}", UserWarning)
    held = [claim["holds"] for claim in result["claims"]]
    _out.print(f"{result['seconds']:.0f} s; {sum(held)} of {len(held)} claims hold; pictures in {escape(str(out))}")
    if result["failed"]:
        raise typer.Exit(1)


def load() -> Any:
    """Module of the benchmark in the checkout; FileNotFoundError if the package is not installed from one."""
    root = Path(__file__).resolve().parents[2]
    if not (root / "tests" / "benchmarks" / "bench.py").is_file():
        raise FileNotFoundError(
            "the benchmark is in tests/benchmarks of the repository, and this package is not installed from a checkout "
            "of it: clone the repository and install it with `pip install -e .[dev]`"
        )
    if "tests" not in sys.modules:  # by path, since another package may have this name
        tests = types.ModuleType("tests")
        tests.__path__ = [str(root / "tests")]
        sys.modules["tests"] = tests
    return importlib.import_module("tests.benchmarks.bench")
