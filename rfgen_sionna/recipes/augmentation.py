"""Further recordings of a data set from its stored paths: other noise, receivers and presets, without a trace."""

from __future__ import annotations

import json
import shutil
import tomllib
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import asdict, dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from rfgen_sionna.dataset.card import write_card
from rfgen_sionna.dataset.checksums import write_sums
from rfgen_sionna.dataset.reader import Run
from rfgen_sionna.dataset.recording_set import RecordingSet, open_dataset
from rfgen_sionna.dataset.schema import software_versions
from rfgen_sionna.dataset.set_index import IndexRow, write_index
from rfgen_sionna.dataset.shards import assemble_shard
from rfgen_sionna.dataset.store import OutputError
from rfgen_sionna.radar import Radar
from rfgen_sionna.recipes.building_folder import shard_name
from rfgen_sionna.recipes.set_facts import RECIPE
from rfgen_sionna.resynthesis import Resynthesis, resynthesize

_PARTS = ".augmenting"


@dataclass(frozen=True)
class Variant:
    """What differs in one further recording of each recording of a set."""

    preset: str | None = None
    """Preset of the recorded radars; None is the recorded one."""
    radar: str | None = None
    """Name or file of the radar with the preset; None is the recorded name."""
    receiver: Mapping[str, Any] | None = None
    """Table of the receiver's impairments; None is the recorded receiver."""
    seed: int | None = None
    """Seed of noise and receiver; None draws one for each recording from its own seed and the variant's number."""


def augment_dataset(
    folder: str | PathLike[str],
    output: str | PathLike[str],
    variants: Sequence[Variant],
    *,
    keep: Collection[str] | None = None,
    device: str = "cpu",
    progress: Callable[[int, int], None] | None = None,
) -> RecordingSet:
    """Write a data set with each of the `variants` of every recording of another one that keeps its paths.

    Recordings stay in their splits. Recording i of n is number `v n + i` of variant v, counted by its place in the set.

    Parameters
    ----------
    folder
        Folder of a set whose recordings were made with keep "paths".
    output
        Folder of the new set; it is made, and must be empty.
    variants
        What differs.
    keep, device
        As of :func:`rfgen_sionna.resynthesis.resynthesize`.
    progress
        Called with the numbers of finished recordings and of all.

    Returns
    -------
    The new set.

    Raises
    ------
    OutputError
        If `output` is not empty.
    RunFormatError
        If a recording has no paths.
    ValueError, TypeError
        Before any sum: a preset is beyond what was traced, or there are no variants.
    """
    target = Path(output).absolute()
    if target.exists() and (not target.is_dir() or any(target.iterdir())):
        raise OutputError(f"output '{target}' is not empty: choose another folder")
    variants = tuple(variants)
    if not variants or not all(isinstance(each, Variant) for each in variants):
        raise TypeError(f"variants is {variants!r}: a list of Variant is needed, with at least one")
    with open_dataset(folder) as source:
        for variant in variants:
            for recording in source:
                for run in recording.radars.values():
                    Resynthesis(run, _radar(run, variant))
        target.mkdir(parents=True, exist_ok=True)
        shards = tuple(dict.fromkeys(row.shard for row in source.rows))
        total, done = len(variants) * len(source), 0
        try:
            for number, variant in enumerate(variants):
                for place, shard in enumerate(shards):
                    parts = {}
                    for position, row in enumerate(source.rows):
                        if row.shard != shard:
                            continue
                        spec = _spec(row, variant, number, number * len(source) + position, keep)
                        path = target / _PARTS / f"{spec['number']:06d}.h5"
                        path.parent.mkdir(exist_ok=True)
                        runs = source[position].radars
                        radars = {name: _radar(run, variant) for name, run in runs.items()}
                        resynthesize(
                            source[position], path, radar=radars, receiver=variant.receiver, seed=spec["seed"],
                            keep=keep, device=device, words=True, compressed=True, dated=False, recording=spec,
                        ).close()  # fmt: skip
                        parts[int(spec["number"])] = path
                        done += 1
                        if progress is not None:
                            progress(done, total)
                    assemble_shard(target / shard_name(number * len(shards) + place), parts)
                    shutil.rmtree(target / _PARTS)
        finally:
            shutil.rmtree(target / _PARTS, ignore_errors=True)
        (target / RECIPE).write_text(_recipe_text(source, variants), encoding="utf-8")
    write_index(target, {"software": json.dumps(software_versions(), sort_keys=True)})
    write_card(target)
    write_sums(target)
    return open_dataset(target)


def _radar(run: Run, variant: Variant) -> Radar:
    recorded = run.radar
    if variant.preset is None and variant.radar is None:
        return recorded
    place: dict[str, Any] = {"trajectory": recorded.trajectory, "orientation": recorded.orientation}
    return Radar.load(variant.radar or recorded.name, variant.preset, position=recorded.position, **place)


def _spec(
    row: IndexRow, variant: Variant, number: int, new: int, keep: Collection[str] | None
) -> dict[str, Any]:  # fmt: skip
    """Specification of the new recording: that of the old one with what differs."""
    drawn = np.random.SeedSequence([row.seed or 0, number + 1]).generate_state(1)[0]
    seed = int(drawn) if variant.seed is None else variant.seed
    spec = row.spec | {"number": new, "seed": seed}
    spec["keep"] = [each for each in (spec.get("keep", ()) if keep is None else keep) if each != "paths"]
    if variant.receiver is not None:
        spec["receiver"] = dict(variant.receiver)
    if variant.preset is not None or variant.radar is not None:
        radar = {} if variant.radar is None else {"radar": Path(variant.radar).name}
        spec["radars"] = [each | radar | {"preset": variant.preset} for each in spec.get("radars", ())]
    return spec


def _recipe_text(source: RecordingSet, variants: Sequence[Variant]) -> str:
    """Text (TOML) of what the set was made from: no recipe that is built."""
    recipe = tomllib.loads(source.recipe_text)
    title = recipe.get("title")
    lines = [f"title = {json.dumps(f'{title}, other samples of its paths')}"] if isinstance(title, str) else []
    lines += [f"{name} = {json.dumps(recipe[name])}" for name in ("licence",) if isinstance(recipe.get(name), str)]
    lines += ["", "[augmentation]", f"variants = {json.dumps(json.dumps([asdict(each) for each in variants]))}"]
    lines += [f"recipe = {json.dumps(source.recipe_text)}"]
    return "\n".join(lines) + "\n"
