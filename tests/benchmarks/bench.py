"""Run time against error of everything, side by side in one run.

    rfgen bench                             all of it, half an hour on two cores
    rfgen bench --quick                     fewer points
    rfgen bench --scene sphere --scene car  some scenes, without the rest

writes `bench.json`, `bench.md` and pictures. docs/benchmarks.md tells how to read them.
"""

from __future__ import annotations

import argparse
import json
import logging
import time
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from tests.benchmarks import doppler, pareto, pictures, pipeline, scaling, skips, synthesisers
from tests.benchmarks.measuring import machine, versions
from tests.benchmarks.subjects import BANDS, SUBJECTS
from tests.benchmarks.tables import markdown

PARTS = ("scenes", "doppler", "synthesiser", "sampling", "skips", "scaling", "pipeline")
QUICK_SCENES = (("sphere", 77), ("plate", 77), ("hand", 77), ("dihedral", 77))


def check_scenes(names: Sequence[str]) -> None:
    """Raises a ValueError that says which scenes there are."""
    for name in names:
        if name not in SUBJECTS:
            raise ValueError(f"scene is {name!r}: allowed are {', '.join(SUBJECTS)}")


def run(
    out: Path,
    scenes: Sequence[str] = (),
    quick: bool = False,
    seed: int = 0,
    progress: Callable[[str], None] = print,
    parts: Sequence[str] = (),
) -> dict[str, Any]:
    """Measure, and write results into the folder `out` as they come.

    Parameters
    ----------
    out
        Folder; it is made where it is missing.
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
    """
    check_scenes(scenes)
    for part in parts:
        if part not in PARTS:
            raise ValueError(f"part is {part!r}: allowed are {', '.join(PARTS)}")
    out.mkdir(parents=True, exist_ok=True)
    begin = time.perf_counter()
    wanted = tuple(parts) or (("scenes",) if scenes else PARTS)
    result: dict[str, Any] = {
        "command": _command(scenes, quick, seed, parts), "machine": machine(), "versions": versions(), "seed": seed,
        "quick": quick,
    }  # fmt: skip
    # Coarse spheres and tolerances out of reach are part of what is measured.
    logging.getLogger("rfgen_sionna").setLevel(logging.ERROR)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for part in PARTS:
            if part in wanted:
                _part(part, result, out, tuple(scenes), quick, seed, progress)
                _store(result, out)
    result["seconds"] = time.perf_counter() - begin
    _store(result, out)
    return result


def _part(
    part: str, result: dict[str, Any], out: Path, scenes: tuple[str, ...], quick: bool, seed: int,
    progress: Callable[[str], None],
) -> None:  # fmt: skip
    """Measure one part into `result`, and draw it."""
    if part == "scenes":
        chosen = [(name, band) for name in scenes or SUBJECTS for band in BANDS[name]]
        if quick:
            chosen = [(name, BANDS[name][-1]) for name in scenes] or list(QUICK_SCENES)
        result["scenes"] = []
        for name, band in chosen:
            found = pareto.run(name, band, quick, seed, progress)
            found["comparison"] = pareto.compare(found["rows"])
            result["scenes"].append(found)
            pictures.pareto(found, out / f"pareto-{name}-{band}.png")
            _store(result, out)
    elif part == "doppler":
        rows, series = doppler.run(quick, seed, progress)
        result["doppler"] = rows
        doppler.draw(series, rows, out / "doppler-floor.png")
    elif part == "synthesiser":
        result["synthesiser"] = synthesisers.run(quick, progress)
        pictures.synthesisers(result["synthesiser"], out / "synthesiser.png")
    elif part == "sampling":
        result["sampling"] = skips.sampling(quick, progress)
    elif part == "skips":
        result["skips"] = skips.run(quick, progress)
    elif part == "scaling":
        result["scaling"] = scaling.run(quick, progress)
        pictures.scaling(result["scaling"], out / "scaling.png")
    else:
        result["pipeline"] = pipeline.run(quick, progress)


def _command(scenes: Sequence[str], quick: bool, seed: int, parts: Sequence[str]) -> str:
    words = ["rfgen bench", *(f"--scene {each}" for each in scenes), *(f"--part {each}" for each in parts)]
    return " ".join([*words, *(["--quick"] if quick else []), f"--seed {seed}"])


def _store(result: dict[str, Any], out: Path) -> None:
    (out / "bench.json").write_text(json.dumps(result, indent=1, default=float) + "\n", encoding="utf-8")
    (out / "bench.md").write_text(markdown(result), encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("bench"), help="folder for the results")
    parser.add_argument("--scene", action="append", default=[], help="one of " + ", ".join(SUBJECTS))
    parser.add_argument("--part", action="append", default=[], help="one of " + ", ".join(PARTS))
    parser.add_argument("--quick", action="store_true", help="fewer points")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    run(options.out, options.scene, options.quick, options.seed, parts=options.part)


if __name__ == "__main__":
    main()
