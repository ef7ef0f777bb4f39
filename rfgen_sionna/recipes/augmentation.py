"""Further recordings of a data set from its stored paths: other noise, receivers and presets, without a trace."""

from __future__ import annotations

import hashlib
import json
import shutil
import tomllib
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, fields
from functools import cached_property
from os import PathLike, getpid
from pathlib import Path
from typing import Any

import numpy as np

from rfgen_sionna.dataset.reader import Run
from rfgen_sionna.dataset.recording_set import RecordingSet, open_dataset
from rfgen_sionna.dataset.schema import software_versions
from rfgen_sionna.dataset.set_index import IndexRow, read_index
from rfgen_sionna.dataset.store import OutputError
from rfgen_sionna.radar import Radar
from rfgen_sionna.recipes.build_progress import progress_steps
from rfgen_sionna.recipes.building import BuildError, run_build
from rfgen_sionna.recipes.building_folder import BUILDING, BuildingFolder
from rfgen_sionna.recipes.outcome import MAX_REASON, Outcome, is_disk_full
from rfgen_sionna.recipes.process_engine import LocalProcesses
from rfgen_sionna.recipes.recording_job import WORKER_FOLDER, part_name, prepare_worker, publish
from rfgen_sionna.recipes.set_facts import AUGMENTATION, RECIPE, SetFacts
from rfgen_sionna.resynthesis import Resynthesis, resynthesize


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
    """Seed from which each recording has its own of noise and receiver, by its number in the set with the paths; None
    takes the recording's seed and the variant's number."""


def augment_dataset(
    folder: str | PathLike[str],
    output: str | PathLike[str],
    variants: Sequence[Variant],
    *,
    keep: Collection[str] | None = None,
    device: str = "cpu",
    workers: int | None = 1,
    resume: bool = False,
    progress: bool | Callable[[int, int], None] | None = None,
) -> RecordingSet:
    """Write a data set with each of the `variants` of every recording of another one that keeps its paths.

    Recordings stay in their splits. Recording i of n is number `v n + i` of variant v, counted by its place in the set.
    The new set says in its card and its index that it is derived, and from what. Where recordings of it are lost, the
    same call with `resume` makes them again, with the same bytes.

    Parameters
    ----------
    folder
        Folder of a set whose recordings were made with keep "paths".
    output
        Folder of the new set; it is made, and must be empty without `resume`.
    variants
        What differs.
    keep, device
        As of :func:`rfgen_sionna.resynthesis.resynthesize`.
    workers
        Number of processes; None takes one for each core, within the free memory.
    resume
        Whether a set in `output` that was begun by the same call is continued: what is missing is made.
    progress
        True shows a bar; a function is called with the numbers of finished recordings and of all.

    Returns
    -------
    The new set.

    Raises
    ------
    OutputError
        If `output` is not empty, or was begun with other recordings, variants, software or another device.
    BusyError
        If another process works in `output`.
    RunFormatError
        If a recording has no paths.
    BuildError
        If the disk is full, or a recording could not be made; the set can be continued.
    ValueError, TypeError
        Before any sum: a preset is beyond what was traced, or there are no variants.
    """
    target, variants = Path(output).absolute(), tuple(variants)
    if not variants or not all(isinstance(each, Variant) for each in variants):
        raise TypeError(f"variants is {variants!r}: a list of Variant is needed, with at least one")
    there = {path.name for path in target.iterdir()} - {BUILDING} if target.is_dir() else set()
    if (target.exists() and not target.is_dir()) or (there and not resume):
        raise OutputError(f"output '{target}' is not empty: choose another folder, or continue it with resume=True")
    engine = LocalProcesses(workers, gpu=device != "cpu")
    with open_dataset(folder) as source:
        kept = None if keep is None else tuple(keep)
        facts = _facts(source, variants, kept, device)
        stored = target / RECIPE
        if there and not (stored.is_file() and stored.read_text(encoding="utf-8", errors="replace") == facts.text):
            raise OutputError(
                f"output '{target}' holds no set of this one, these variants and keep: choose another one"
            )
        for variant in variants:
            for recording in source:
                for run in recording.radars.values():
                    Resynthesis(run, _radar(run, variant))
        state = BuildingFolder(target, facts)
        job = AugmentationJob(source.folder, variants, kept, device, state.path)
        with state.locked(), progress_steps(progress, facts.count) as step:
            begun = state.begun_with
            with suppress(OSError, ValueError):
                begun = begun or dict(read_index(target).meta)
            facts.check_unchanged(target, begun)
            report = run_build(state, engine, job, range(facts.count), step)
    if report.failures:
        failed = report.failures[0]
        raise BuildError(
            f"{len(report.failures)} recordings of '{target}' could not be made, such as {failed.number}: "
            f"{failed.reason}; resume=True tries them again"
        )
    return open_dataset(target)


def read_variants(path: str | PathLike[str]) -> list[Variant]:
    """The variants in a TOML file, tables `[[variants]]` with the fields of :class:`Variant`; paths are relative to it.

    ValueError if there are none, or one has another key.
    """
    file, known = Path(path), [each.name for each in fields(Variant)]
    tables = tomllib.loads(file.read_text(encoding="utf-8")).get("variants")
    if not isinstance(tables, list) or not tables or not all(isinstance(each, dict) for each in tables):
        raise ValueError(f"'{file}' has no tables [[variants]]: one for each variant is needed")
    if other := sorted(set().union(*tables) - set(known)):
        raise ValueError(f"'{file}': a variant has the key '{other[0]}'; allowed are {', '.join(known)}")
    for each in tables:
        if (beside := file.parent / str(each.get("radar"))).is_file():
            each["radar"] = str(beside)
    return [Variant(**each) for each in tables]


def variants_of(folder: str | PathLike[str]) -> list[Variant]:
    """The variants that the set in `folder` was made of; ValueError if it is not derived from another one."""
    table = tomllib.loads((Path(folder) / RECIPE).read_text(encoding="utf-8")).get(AUGMENTATION)
    if table is None:
        raise ValueError(f"'{folder}' is derived from no other set: `rfgen dataset repair` or `resume` makes it again")
    return [Variant(**each) for each in json.loads(table["variants"])]


@dataclass(frozen=True)
class AugmentationJob:
    """Makes recordings of variants from those of a set."""

    source: Path
    """Folder of the set with the paths."""
    variants: tuple[Variant, ...]
    keep: tuple[str, ...] | None
    device: str
    """Device that sums the paths."""
    folder: Path
    """Folder of finished recordings that are in no shard yet."""

    @cached_property
    def _recordings(self) -> RecordingSet:
        return open_dataset(self.source)

    def _spec(self, number: int) -> tuple[Variant, int, dict[str, Any]]:
        """Variant, place in the set with the paths, and specification of a recording."""
        variant, position = divmod(number, len(self._recordings))
        row = self._recordings.rows[position]
        return self.variants[variant], position, _spec(row, self.variants[variant], variant, number, self.keep)

    def __call__(self, number: int) -> Outcome:
        """Make one recording; its file is there whole or not at all."""
        own = self.folder / f"{WORKER_FOLDER}{getpid()}"
        prepare_worker()
        try:
            variant, position, spec = self._spec(number)
            own.mkdir(exist_ok=True)
            run, made = self._recordings[position], own / part_name(number)
            resynthesize(
                run, made, radar={name: _radar(each, variant) for name, each in run.radars.items()},
                receiver=variant.receiver, seed=spec["seed"], keep=self.keep, device=self.device, words=True,
                compressed=True, dated=False, overwrite=True, recording=spec,
            ).close()  # fmt: skip
            publish(made, self.folder / part_name(number))
        except Exception as error:
            shutil.rmtree(own, ignore_errors=True)
            reason = f"{type(error).__name__}: {error}"[:MAX_REASON]
            return Outcome(number, "disk full" if is_disk_full(error) else "error", reason)
        return Outcome(number, "made", seed=spec["seed"])

    def seed(self, number: int) -> int:
        """Seed of a recording."""
        return int(self._spec(number)[2]["seed"])


def _facts(source: RecordingSet, variants: Sequence[Variant], keep: Sequence[str] | None, device: str) -> SetFacts:
    """Facts of the derived set, by what it is made from."""
    made_from = source.index.meta.get("recipe_digest", "")
    recordings = [[row.number, row.digest] for row in source.rows]
    contents = [made_from, recordings, [asdict(each) for each in variants], keep]
    digest = hashlib.sha256(json.dumps(contents, sort_keys=True, default=str).encode()).hexdigest()
    per_shard = max(Counter(row.shard for row in source.rows).values(), default=1)
    software = json.dumps(software_versions(), sort_keys=True)
    text = _recipe_text(source, variants, keep, made_from)
    derived = f"augmentation of the set of recipe {made_from}"
    return SetFacts(text, digest, len(variants) * len(source), per_shard, software, device, derived)


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
    drawn = [row.seed or 0, number + 1] if variant.seed is None else [variant.seed, row.number]
    seed = int(np.random.SeedSequence(drawn).generate_state(1)[0])
    spec = row.spec | {"number": new, "seed": seed}
    spec["keep"] = [each for each in (spec.get("keep", ()) if keep is None else keep) if each != "paths"]
    if variant.receiver is not None:
        spec["receiver"] = dict(variant.receiver)
    if variant.preset is not None or variant.radar is not None:
        radar = {} if variant.radar is None else {"radar": Path(variant.radar).name}
        spec["radars"] = [each | radar | {"preset": variant.preset} for each in spec.get("radars", ())]
    return spec


def _recipe_text(source: RecordingSet, variants: Sequence[Variant], keep: Sequence[str] | None, made_from: str) -> str:
    """Text (TOML) of what the set was made from: no recipe that is built."""
    recipe = tomllib.loads(source.recipe_text)
    title = recipe.get("title")
    said = recipe.get("description")
    description = (
        f"Derived by augment_dataset from the stored paths of another set (SHA-256 of its recipe: {made_from}): the "
        f"same scenes with other noise, receivers or presets, {len(variants)} variants of {len(source)} recordings, "
        "each in the split of its recording. Do not count them as further scenes. The recipe below names the variants, "
        "and has the recipe of that set."
    )
    keys = {
        "title": f"{title}, other samples of its paths" if isinstance(title, str) else None,
        "description": f"{description}\n\n{said.strip()}" if isinstance(said, str) else description,
        "licence": recipe.get("licence"),
    }
    lines = [f"{name} = {_quoted(value)}" for name, value in keys.items() if isinstance(value, str)]
    lines += ["", f"[{AUGMENTATION}]", f"variants = {_quoted(json.dumps([asdict(each) for each in variants]))}"]
    lines += [] if keep is None else [f"keep = [{', '.join(map(_quoted, keep))}]"]
    lines += [f"recipe = {_quoted(source.recipe_text)}"]
    return "\n".join(lines) + "\n"


def _quoted(text: str) -> str:
    """A basic string of TOML: that of JSON, with all characters outside ASCII as they are."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
