"""`rfgen bench`: the benchmark of the checkout that the package is installed from."""

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

scenes: run time against error of every method, scene by scene, with a picture each · doppler: the floor of an adult
who only translates · synthesiser: ours, NumPy, torch · sampling: adaptive rays against uniform ones · skips: what each
saves, with its proof · scaling: exponents of facets, rays, paths, channels, chirps, frames, actors, bounces ·
pipeline: mesh to samples, the living room, start-up, memory

[bold]Examples[/bold]

rfgen bench --quick

rfgen bench --out bench/

rfgen bench --scene sphere --scene hand

rfgen bench --part skips --part scaling

All of it takes about half an hour on two quiet cores, --quick about five minutes. Each result is written as soon as it
is there. After an interruption the same command goes on where it was; a part that is asked for later is added to what
the folder holds, as long as code, machine and seed are the same.

bench.md says first what is to hold and whether it does, then has all tables; bench.json has all figures with machine,
versions and seed. docs/benchmarks.md tells how to read them. It needs a checkout of the repository, as the benchmark is
no part of the installed package."""
EPILOG = "\n\n".join(" ".join(paragraph.split()) for paragraph in _TEXT.split("\n\n"))


def bench(
    scene: Annotated[
        list[str] | None, typer.Option(help=f"One scene, without the rest; may be repeated: {SCENES}.")
    ] = None,
    part: Annotated[
        list[str] | None, typer.Option(help="One part; may be repeated. The parts are named below.")
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Fewer scenes and points, five minutes.")] = False,
    out: Annotated[Path, typer.Option(help="Folder for JSON, tables and pictures.", file_okay=False)] = Path("bench"),
    seed: Annotated[int, typer.Option(min=0, help="Seed of all that is drawn: jitter, paths, samples checked.")] = 0,
) -> None:
    """Measure time, memory and error against other methods and independent truth, on this machine."""
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
    """The benchmark's module, from the checkout that this package is installed from."""
    root = Path(__file__).resolve().parents[2]
    if not (root / "tests" / "benchmarks" / "bench.py").is_file():
        raise FileNotFoundError(
            "the benchmark is in tests/benchmarks of the repository, and this package is not installed from a checkout "
            "of it: clone the repository and install it with `pip install -e .[dev]`"
        )
    if "tests" not in sys.modules:  # by its path: another package of that name may be installed
        tests = types.ModuleType("tests")
        tests.__path__ = [str(root / "tests")]
        sys.modules["tests"] = tests
    return importlib.import_module("tests.benchmarks.bench")
