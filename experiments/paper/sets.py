"""Data sets of the experiments: built or continued from a recipe, and what two of them have in common."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import combinations
from pathlib import Path

from experiments.paper.reports import progress
from rfgen_sionna.recipes import Recipe, RecordingSpec, build_dataset
from rfgen_sionna.recipes.recording_spec import FREE_SPACE


def built_set(recipe: Recipe, folder: Path, workers: int | None = None) -> Path:
    """The folder with the recipe's set: a set that is there is continued, one of another recipe refused."""
    begun = folder.is_dir() and any(folder.iterdir())
    report = build_dataset(recipe, folder, workers=workers, resume=begun)
    progress(str(report))
    return folder


def specs_of(recipe: Recipe, split: str | None = None) -> list[RecordingSpec]:
    """The recordings of a split, by default of all, as they are first drawn."""
    return [spec for spec in recipe if split in (None, spec.split)]


def shared(first: Iterable[RecordingSpec], second: Iterable[RecordingSpec]) -> dict[str, set[object]]:
    """What recordings of both have: "bodies", "places" (layouts of rooms), "motions" and "noise" (seeds), "clips".

    Only names with something in common are there. Free space is no place that can be learned, and counts for nothing.
    Recordings of prompts are of captured clips unless their motion is "kinematic": "clips" then has "library".
    """
    one, other = _owned(first), _owned(second)
    common = {name: one[name] & other[name] for name in one}
    return {name: found for name, found in common.items() if found}


def check_disjoint(parts: Mapping[str, Sequence[RecordingSpec]], allowed: Collection[str] = ()) -> None:
    """ValueError if two parts have something in common that is not `allowed`; it names both, and what."""
    for (name, first), (another, second) in combinations(parts.items(), 2):
        if common := [what for what in shared(first, second) if what not in allowed]:
            raise ValueError(f"'{name}' and '{another}' share {', '.join(common)}: disjoint sets are needed")


def _owned(specs: Iterable[RecordingSpec]) -> dict[str, set[object]]:
    found: dict[str, set[object]] = {name: set() for name in ("bodies", "places", "motions", "noise", "clips")}
    for spec in specs:
        found["bodies"] |= {body.seed for body in spec.bodies}
        if spec.place != FREE_SPACE:
            found["places"].add((spec.place, spec.place_seed))
        found["motions"].add(spec.motion_seed)
        found["noise"].add(spec.seed)
        found["clips"] |= {source.file for source in spec.sources if source.file is not None}
        if spec.motion != "kinematic" and any(source.kind == "prompt" for source in spec.sources):
            found["clips"].add("library")
    return found
