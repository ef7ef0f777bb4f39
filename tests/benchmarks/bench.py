"""Run time against error of everything, side by side in one run.

    rfgen bench                             all of it, half an hour on two quiet cores
    rfgen bench --quick                     fewer scenes and points, five minutes
    rfgen bench --scene sphere --scene car  some scenes, without the rest
    rfgen bench --part skips --part scaling some parts

writes `bench.json`, `bench.md` and pictures, each result as soon as it is there. A run that was interrupted goes on
where it was when the same command is given again; a part that is asked for later is added to what the folder holds.
docs/benchmarks.md tells how to read it.
"""

from __future__ import annotations

import argparse
import json
import logging
import os
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.benchmarks import claims, doppler, pareto, pictures, pipeline, scaling, skips, synthesisers
from tests.benchmarks.measuring import code, default_rtol, machine, versions
from tests.benchmarks.stored import Store
from tests.benchmarks.subjects import BANDS, SUBJECTS
from tests.benchmarks.tables import markdown

PARTS = ("scenes", "doppler", "synthesiser", "skips", "scaling", "pipeline")
QUICK_SCENES = (("sphere", 77), ("person", 77), ("plate", 77), ("dihedral", 77), ("hand", 77))

Result = dict[str, Any]


@dataclass(frozen=True)
class Unit:
    """What is measured in one go and kept."""

    part: str
    name: str
    work: Callable[[], Any]
    keep: Callable[[Result, Any], None]
    """Puts what `work` found into a result, and draws it."""

    @property
    def key(self) -> str:
        return f"{self.part}: {self.name}"


def check(scenes: Sequence[str], parts: Sequence[str]) -> None:
    """Raises a ValueError that says which scenes and parts there are."""
    for what, names, allowed in (("scene", scenes, SUBJECTS), ("part", parts, PARTS)):
        for name in names:
            if name not in allowed:
                raise ValueError(f"{what} is {name!r}: allowed are {', '.join(allowed)}")


def run(
    out: Path,
    scenes: Sequence[str] = (),
    quick: bool = False,
    seed: int = 0,
    progress: Callable[[str], None] = print,
    parts: Sequence[str] = (),
    done: Callable[[str], None] = lambda line: None,
) -> Result:
    """Measure, and write results into the folder `out` as they come.

    Parameters
    ----------
    out
        Folder; it is made where it is missing. Results of the same code, machine and settings that it holds are added
        to, others are kept as `bench-before.json`.
    scenes
        Those of :data:`tests.benchmarks.subjects.SUBJECTS` to measure, and nothing else; none is all, and the rest.
    quick
        Fewer points, coarser truth, fewer scenes.
    seed
        Of jitter, of the paths that are synthesised and of what is checked.
    progress
        Called with what is being done.
    parts
        Those of :data:`PARTS` to do; none is all.
    done
        Called with a line about each result.
    """
    check(scenes, parts)
    out.mkdir(parents=True, exist_ok=True)
    result = _begun(out, _settings(quick, seed), done)
    wanted = tuple(parts) or (("scenes",) if scenes else PARTS)
    found = list(_units(out, wanted, tuple(scenes), quick, seed, progress))
    keys = [unit.key for unit in found]
    open_before = result.get("open", [])
    # What an interrupted run of the same things has left, and all of it otherwise.
    left = [unit for unit in found if unit.key in open_before] if set(open_before) <= set(keys) else []
    result["command"], result["load"] = _command(scenes, quick, seed, parts), _load()
    if left and len(left) < len(found):
        done(f"going on with an interrupted run: {len(found) - len(left)} of {len(found)} are there")
    left = left or found
    result["open"], result["failed"] = [unit.key for unit in left], {}
    # Coarse spheres and tolerances out of reach are part of what is measured.
    logger = logging.getLogger("rfgen_sionna")
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            for unit in left:
                progress(unit.key)
                begin = time.perf_counter()
                try:
                    unit.keep(result, unit.work())
                except Exception as reason:  # the others are of use all the same; this one stays open
                    result["failed"][unit.key] = f"{type(reason).__name__}: {reason}"
                    done(f"{unit.key} failed: {result['failed'][unit.key]}")
                    _store(result, out)
                    continue
                seconds = time.perf_counter() - begin
                result["open"].remove(unit.key)
                result["units"][unit.key] = {"seconds": seconds, "load": _load(), "commit": result["code"]["commit"]}
                _store(result, out)
                done(f"{unit.key}: {seconds:.0f} s")
    finally:
        logger.setLevel(level)
    return result


def _settings(quick: bool, seed: int) -> Result:
    return {
        "machine": machine(), "versions": versions(), "code": code(), "default_rtol": default_rtol(), "seed": seed,
        "quick": quick,
    }  # fmt: skip


def _begun(out: Path, settings: Result, done: Callable[[str], None]) -> Result:
    """What the folder holds, if it was measured with the same settings."""
    path = out / "bench.json"
    if path.is_file():
        try:
            before: Result = json.loads(path.read_text(encoding="utf-8"))
        except json.JSONDecodeError:
            before = {}
        same = json.loads(json.dumps(settings, default=float))
        differs = [key for key in same if _comparable(key, before.get(key)) != _comparable(key, same[key])]
        if not differs and "units" in before:
            return before
        path.replace(out / "bench-before.json")
        done(f"{path} is of another {', '.join(differs) or 'kind'}: kept as bench-before.json")
    return settings | {"units": {}, "open": []}


def _comparable(key: str, value: Any) -> Any:
    """Of the code its files count: a commit may change nothing but words."""
    return value["digest"] if key == "code" and isinstance(value, dict) else value


def _load() -> list[float] | None:
    return [round(each, 2) for each in os.getloadavg()] if hasattr(os, "getloadavg") else None


def _units(
    out: Path, wanted: Sequence[str], scenes: Sequence[str], quick: bool, seed: int, progress: Callable[[str], None]
) -> Iterator[Unit]:
    """Everything that is to be measured, in turn."""
    if "scenes" in wanted:
        store = Store(out / "truth.json")
        for name, band in _bands(scenes, quick):
            yield Unit(
                "scenes", f"{name} {band} GHz",
                lambda name=name, band=band: pareto.run(name, band, quick, seed, progress, store),
                lambda result, found: _keep_scene(result, found, out),
            )  # fmt: skip
    if "doppler" in wanted:
        yield Unit(
            "doppler", "adult", lambda: doppler.run(quick, seed, progress),
            lambda result, found: _keep_doppler(result, found, out),
        )  # fmt: skip
    if "synthesiser" in wanted:
        yield Unit(
            "synthesiser", "people", lambda: synthesisers.run(quick, progress),
            lambda result, found: _keep_drawn(result, "synthesiser", found, pictures.synthesisers, out),
        )  # fmt: skip
    if "skips" in wanted:
        for name, make in skips.rows(quick).items():
            yield Unit("skips", name, make, _keep_skips)
        yield Unit("skips", "import", skips.imports, lambda result, found: result.update(imports=found))
    if "scaling" in wanted:
        for name in scaling.CURVES:
            yield Unit(
                "scaling", name, lambda name=name: scaling.run(name, quick),
                lambda result, found, name=name: _keep_drawn(
                    result, "scaling", result.get("scaling", {}) | {name: found}, pictures.scaling, out
                ),
            )  # fmt: skip
    if "pipeline" in wanted:
        for name, work in pipeline.pieces(quick, progress).items():
            yield Unit(
                "pipeline", name, work,
                lambda result, found, name=name: result.setdefault("pipeline", {}).update({name: found}),
            )  # fmt: skip


def _bands(scenes: Sequence[str], quick: bool) -> list[tuple[str, int]]:
    if quick:
        return [(name, BANDS[name][-1]) for name in scenes] or list(QUICK_SCENES)
    return [(name, band) for name in scenes or SUBJECTS for band in BANDS[name]]


def _keep_scene(result: Result, found: Result, out: Path) -> None:
    name = found["scene"], found["band_ghz"]
    others = [each for each in result.get("scenes", []) if (each["scene"], each["band_ghz"]) != name]
    order = list(SUBJECTS)
    result["scenes"] = sorted([*others, found], key=lambda each: (order.index(each["scene"]), each["band_ghz"]))
    pictures.pareto(found, out / f"pareto-{name[0]}-{name[1]}.png")


def _keep_doppler(result: Result, found: Any, out: Path) -> None:
    rows, series = found
    result["doppler"] = rows
    doppler.draw(series, rows, out / "doppler-floor.png")


def _keep_drawn(result: Result, part: str, found: Any, draw: Callable[[Any, Path], None], out: Path) -> None:
    result[part] = found
    draw(found, out / f"{part}.png")


def _keep_skips(result: Result, found: list[Result]) -> None:
    new = [row["skip"] for row in found]
    result["skips"] = [row for row in result.get("skips", []) if row["skip"] not in new] + found


def _command(scenes: Sequence[str], quick: bool, seed: int, parts: Sequence[str]) -> str:
    words = ["rfgen bench", *(f"--scene {each}" for each in scenes), *(f"--part {each}" for each in parts)]
    return " ".join([*words, *(["--quick"] if quick else []), f"--seed {seed}"])


def _store(result: Result, out: Path) -> None:
    result["seconds"] = sum(each["seconds"] for each in result["units"].values())
    result["claims"] = claims.claims(result)
    part = out / "bench.json.part"
    part.write_text(json.dumps(result, indent=1, default=float) + "\n", encoding="utf-8")
    part.replace(out / "bench.json")  # whole, or as before
    (out / "bench.md").write_text(markdown(result), encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("bench"), help="folder for the results")
    parser.add_argument("--scene", action="append", default=[], help="one of " + ", ".join(SUBJECTS))
    parser.add_argument("--part", action="append", default=[], help="one of " + ", ".join(PARTS))
    parser.add_argument("--quick", action="store_true", help="fewer scenes and points")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()

    def say(line: str) -> None:
        print(time.strftime("%H:%M:%S"), line, flush=True)

    run(options.out, options.scene, options.quick, options.seed, lambda line: None, options.part, say)


if __name__ == "__main__":
    main()
