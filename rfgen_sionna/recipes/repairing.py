"""Repair of data sets: recordings of damaged shards are made again, and files get their old bytes back."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from os import PathLike
from pathlib import Path

import h5py

from rfgen_sionna.dataset.card import CARD
from rfgen_sionna.dataset.checksums import Damage, damaged, read_sums
from rfgen_sionna.dataset.run_file import open_hdf5
from rfgen_sionna.dataset.schema import RunFormatError
from rfgen_sionna.dataset.set_index import INDEX, SetIndex, read_index
from rfgen_sionna.dataset.verified_files import SUMS, VerifiedFiles
from rfgen_sionna.recipes.build_progress import progress_steps
from rfgen_sionna.recipes.building import BuildReport, EngineName, chosen_engine, run_build
from rfgen_sionna.recipes.building_folder import BUILDING, SHARDS, UNFINISHED, BuildingFolder, shard_name
from rfgen_sionna.recipes.outcome import BuildJob
from rfgen_sionna.recipes.present_recordings import ExtractionJob, extract_whole, recordings_in
from rfgen_sionna.recipes.recipe import Recipe
from rfgen_sionna.recipes.recording_job import RecordingJob
from rfgen_sionna.recipes.set_facts import RECIPE, SetFacts, note_processor, recipe_of_set


def verify_dataset(folder: str | PathLike[str]) -> list[Damage]:
    """Files of a set that are not as they were written, down to one byte; none for a whole set.

    Raises
    ------
    NotADirectoryError
        If there is no such folder.
    ValueError
        If the folder is no set, or its build has not ended.
    """
    path = _set_folder(folder)
    if (path / BUILDING / UNFINISHED).is_file() or ((path / BUILDING).is_dir() and not (path / SUMS).is_file()):
        raise ValueError(f"the build of '{path}' has not ended: `rfgen dataset resume {path}` makes the rest")
    return damaged(path)


def repair_dataset(
    folder: str | PathLike[str],
    recipe: Recipe | str | PathLike[str] | None = None,
    *,
    workers: int | None = None,
    engine: EngineName = "processes",
    address: str | None = None,
    gpus_per_worker: float = 0.0,
    time_limit: float | None = None,
    progress: bool | Callable[[int, int], None] | None = None,
) -> BuildReport | None:
    """Give the damaged files of a set their old bytes back; None for a whole set.

    Whole recordings of a damaged shard are taken out of it; the others are made again by the recipe, with the digests
    that the index has. Index, card, recipe and checksums are written again.

    Parameters
    ----------
    folder
        Folder of the set.
    recipe
        The recipe, or its file, where that of the set names files by relative paths, or cannot be found any more.
    workers, engine, address, gpus_per_worker, time_limit, progress
        As of :func:`~rfgen_sionna.recipes.building.build_dataset`.

    Raises
    ------
    NotADirectoryError, ValueError
        If the folder is no set, its build has not ended, or the recipe is of another one.
    RunFormatError
        If a recording that is made again is not the one that was damaged.
    BuildError
        If the disk is full.
    """
    path = _set_folder(folder)
    found = verify_dataset(path)
    if not found:
        return None
    names = {each.file for each in found}
    sums, index = _known(path)
    text = _recipe_text(path, names, sums)
    facts = _facts(path, names, index, text, sums)
    chosen: Recipe | None = None
    if facts is None:
        chosen = recipe_of_set(path, recipe, text)
        facts = SetFacts.of(chosen, "cpu" if gpus_per_worker == 0 else "cuda")
    state = BuildingFolder(path, facts)
    shards = {shard_name(number): number for number in range(state.shard_count)}
    if unknown := sorted(each for each in names if each.endswith(".h5") and each not in shards):
        raise ValueError(f"'{path / unknown[0]}' is no shard of this set: move it to another folder")
    digests = {row.number: row.digest for row in index.rows} if index else {}
    whole = {
        each.file: set(state.numbers(shards[each.file])) & set(digests) - set(each.recordings)
        for each in found
        if each.file in shards
    }
    device = "cpu" if gpus_per_worker == 0 else "cuda"
    if _lost(state, index, whole, sums):  # only then the recipe's files are needed
        chosen = chosen or recipe_of_set(path, recipe, facts.text)
        SetFacts.of(chosen, device).check_unchanged(path, facts.meta)
        note_processor(path)
    made_by = chosen_engine(engine, workers, address, gpus_per_worker, state.path, time_limit)
    verified = {name: digest for name, digest in sums.items() if name in shards and name not in names}
    job: BuildJob = RecordingJob(chosen, state.path, device) if chosen else ExtractionJob(path, state.path, {})
    moved: dict[Path, Path] = {}
    with state.locked(), progress_steps(progress, facts.count) as step:
        try:
            for damage in found:
                if damage.file in shards:
                    moved |= _take_apart(state, shards[damage.file], whole[damage.file], digests)
                elif damage.file in (CARD, INDEX, RECIPE, SUMS):
                    (path / damage.file).unlink(missing_ok=True)
            numbers = range(facts.count) if chosen else ()
            report = run_build(state, made_by, job, numbers, step, digests, verified=verified, retry=False)
        except BaseException:
            for stored, target in moved.items():
                if stored.exists() and not target.exists():
                    stored.rename(target)
            raise
    if again := [each for each in report.failures if each.number in digests]:
        raise RunFormatError(
            f"recording {again[0].number} of '{path}' could not be made again: {again[0].reason}; "
            f"`rfgen dataset resume {path}` tries again"
        )
    new = read_sums(path)
    if other := sorted(name for name in shards if sums.get(name, new.get(name)) != new.get(name)):
        raise RunFormatError(
            f"'{path / other[0]}' has its recordings back, but not its old checksum: the HDF5 library is another one, "
            "or a recording was made now that had failed"
        )
    return report


def _lost(
    state: BuildingFolder, index: SetIndex | None, whole: Mapping[str, set[int]], sums: Mapping[str, str]
) -> set[int]:
    """Recordings that are to be made again; `whole` are those in each damaged shard that are not."""
    there = set().union(*whole.values())
    for number in range(state.shard_count):
        shard = state.shard(number)
        if shard.name not in whole and shard.is_file():
            VerifiedFiles(state.output, sums).check(shard.name)
            there |= recordings_in(shard)
    failed = {each.number for each in index.failures} if index else set()
    return set(range(state.facts.count)) - there - failed


def _facts(
    path: Path, damaged_files: set[str], index: SetIndex | None, text: str | None, sums: Mapping[str, str]
) -> SetFacts | None:
    """Facts of a set by its index or a whole shard; None where neither has them."""
    if text is None:
        return None
    found = SetFacts.stored(index.meta, text) if index else None
    for shard in sorted(path.glob(SHARDS)):
        if found is None and shard.name not in damaged_files:
            with suppress(OSError, ValueError, RuntimeError), _opened(shard, sums) as file:
                found = SetFacts.stored({key: str(value) for key, value in file.attrs.items()}, text)
    return found


def _opened(shard: Path, sums: Mapping[str, str]) -> h5py.File:
    """A shard that ends no process that reads it."""
    VerifiedFiles(shard.parent, sums).check(shard.name)
    return open_hdf5(shard)


def _set_folder(folder: str | PathLike[str]) -> Path:
    path = Path(folder).absolute()
    if not path.is_dir():
        raise NotADirectoryError(f"'{path}' is no folder of a data set")
    if not any((path / name).exists() for name in (SUMS, BUILDING, RECIPE)) and not any(path.glob(SHARDS)):
        raise ValueError(f"'{path}' is no data set: it has neither {SUMS} nor shards")
    return path


def _known(path: Path) -> tuple[dict[str, str], SetIndex | None]:
    """Checksums and index of a set, as far as they can be read."""
    sums: dict[str, str] = {}
    index: SetIndex | None = None
    with suppress(OSError, ValueError):
        index = read_index(path)
        sums = dict(index.shards)
    with suppress(OSError, ValueError):
        sums = read_sums(path)
    return sums, index


def _recipe_text(path: Path, damaged_files: set[str], sums: Mapping[str, str]) -> str | None:
    """Text of the recipe of a set, from its file or from a shard; None where neither has the old one."""
    stored = path / RECIPE
    if stored.is_file() and RECIPE not in damaged_files and (SUMS not in damaged_files or not sums):
        return stored.read_text(encoding="utf-8")
    texts = []
    for shard in sorted(path.glob(SHARDS)):
        if shard.name not in damaged_files:
            with suppress(OSError, ValueError, KeyError, RuntimeError), _opened(shard, sums) as file:
                texts.append(str(file.attrs["recipe"]))
    with suppress(OSError, UnicodeDecodeError):
        texts.append(stored.read_text(encoding="utf-8"))
    wanted = sums.get(RECIPE)
    for text in texts:
        if wanted is None or hashlib.sha256(text.encode()).hexdigest() == wanted:
            return text
    return None


def _take_apart(
    state: BuildingFolder, index: int, whole: Iterable[int], digests: Mapping[int, str]
) -> dict[Path, Path]:
    """Put the whole recordings of a damaged shard into parts, and the shard aside: its place there and its own one."""
    shard = state.shard(index)
    if not shard.is_file():
        return {}
    extract_whole(state, shard, whole, digests)
    stored = state.path / f"{shard.name}.damaged"
    shard.rename(stored)
    return {stored: shard}
