"""Builds of data sets: the recordings of a recipe are made by an engine, in any order, and put into shards.

A recording's bits depend on the recipe and its number alone. An interrupted build is continued with what it has.
"""

from __future__ import annotations

import hashlib
import logging
import shutil
import time
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Literal, Protocol

from rfgen_sionna.dataset.card import CARD, write_card
from rfgen_sionna.dataset.checksums import read_sums, set_files, write_sums
from rfgen_sionna.dataset.recording_digest import recording_digest
from rfgen_sionna.dataset.run_file import open_hdf5
from rfgen_sionna.dataset.schema import RunFormatError
from rfgen_sionna.dataset.set_index import INDEX, Failure, read_index, write_index
from rfgen_sionna.dataset.store import OutputError
from rfgen_sionna.dataset.verified_files import SUMS
from rfgen_sionna.dataset.whole_files import write_whole
from rfgen_sionna.recipes.build_progress import BuildProgress, progress_steps
from rfgen_sionna.recipes.building_folder import BUILDING, SHARDS, BuildingFolder, is_final
from rfgen_sionna.recipes.outcome import BuildJob, Job, Outcome, is_disk_full
from rfgen_sionna.recipes.present_recordings import present_recordings
from rfgen_sionna.recipes.process_engine import LocalProcesses
from rfgen_sionna.recipes.recipe import Recipe
from rfgen_sionna.recipes.recording_job import RecordingJob
from rfgen_sionna.recipes.set_facts import (
    ORIGIN,
    PROCESSOR,
    RECIPE,
    SetFacts,
    note_origin,
    note_processor,
    with_plain_ends,
)

EngineName = Literal["processes", "ray"]
Order = Literal["forward", "reversed"] | Sequence[int]

_LOG = logging.getLogger(__name__)


class BuildEngine(Protocol):
    """Makes recordings on a machine or on several."""

    def outcomes(self, job: Job, numbers: Iterable[int]) -> Generator[Outcome, None, None]:
        """Outcomes of the recordings, in the order in which they end."""
        ...


class BuildError(OSError):
    """A build that stopped; what it has made is whole, and it can be continued."""


@dataclass(frozen=True)
class BuildReport:
    """What a build has made."""

    folder: Path
    count: int
    """Recordings in the set."""
    made: int
    """Recordings made by this call."""
    failures: tuple[Failure, ...] = ()
    """Recordings that could not be made."""
    warnings: dict[str, int] = field(default_factory=dict)
    """Warnings, and the number of recordings of each."""
    seconds: float = 0.0
    """Duration of this call [s]."""

    def __str__(self) -> str:
        rate = f", {3600.0 * self.made / self.seconds:.0f} an hour" if self.made and self.seconds else ""
        lines = [f"{self.count} recordings in '{self.folder}', {self.made} of them made now{rate}"]
        lines += [f"not made: {each.number:06d} (seed {each.seed}): {each.reason}" for each in self.failures]
        lines += [f"warning of {count} recordings: {text}" for text, count in self.warnings.items()]
        return "\n".join(lines)


def build_dataset(
    recipe: Recipe | str | PathLike[str],
    output: str | PathLike[str],
    *,
    workers: int | None = None,
    engine: EngineName = "processes",
    address: str | None = None,
    gpus_per_worker: float = 0.0,
    time_limit: float | None = None,
    order: Order = "forward",
    resume: bool = False,
    progress: bool | Callable[[int, int], None] | None = None,
) -> BuildReport:
    """Make the recordings of a recipe and write them as a data set.

    Parameters
    ----------
    recipe
        The recipe, or its file.
    output
        Folder of the set; it is made, and must be empty without `resume`.
    workers
        Number of processes, each on one core with one recording at a time; None takes one for each core (of the
        cluster), within the free memory.
    engine
        "processes" on this machine, or "ray": the cluster at `address`, which needs the extra `cluster`.
    address
        Cluster of Ray: "auto" for the running one, its address, or "local" (None) for one on this machine.
    gpus_per_worker
        GPUs of each worker, also a fraction; 0 computes on the CPU, whose samples are other ones within `rtol`.
    time_limit
        Longest time of one recording [s], with processes: its process is ended, and the recording listed as one that a
        later call tries again. None waits.
    order
        Order in which recordings are begun; the set is the same for all.
    resume
        Whether a build in `output` is continued: what is missing is made, and nothing else.
    progress
        True shows a bar; a function is called with the numbers of finished recordings and of all.

    Raises
    ------
    OutputError
        If `output` is not empty, holds a set of another recipe, or one that was begun with other files of the recipe,
        software or device.
    BusyError
        If another build works in `output`.
    BuildError
        If the disk is full; the build can be continued.
    ValueError, ImportError
        Before any work: an argument or the recipe is wrong, or Ray is missing.
    """
    source, recipe = recipe, recipe if isinstance(recipe, Recipe) else Recipe.load(recipe)
    folder = Path(output).absolute()
    _check_output(folder, recipe, resume)
    numbers, device = _ordered(order, recipe.count), "cpu" if gpus_per_worker == 0 else "cuda"
    state = BuildingFolder(folder, SetFacts.of(recipe, device))
    made_by = chosen_engine(engine, workers, address, gpus_per_worker, state.path, time_limit)
    with state.locked(), progress_steps(progress, recipe.count) as step:
        _check_output(folder, recipe, resume)  # again: another build may have been quicker
        _check_unchanged(state)
        note_processor(folder)
        if not isinstance(source, Recipe):
            note_origin(folder, source)
        job = RecordingJob(recipe, state.path, device)
        return run_build(state, made_by, job, numbers, step)


def run_build(
    state: BuildingFolder,
    engine: BuildEngine,
    job: BuildJob,
    numbers: Iterable[int],
    step: BuildProgress,
    digests: Mapping[int, str] | None = None,
    *,
    verified: Mapping[str, str] | None = None,
    retry: bool = True,
) -> BuildReport:
    """Make what a locked folder lacks, and end the set.

    Parameters
    ----------
    state
        The folder.
    engine, job
        What makes the recordings.
    numbers
        All recordings, in the order in which they are begun.
    step
        Called after each recording.
    digests
        Digests of recordings that are made again; one that differs raises a RunFormatError.
    verified
        Digests of shards that were compared with them just now.
    retry
        Whether recordings are tried again that failed, but not for good.

    Raises
    ------
    BuildError
        If the disk is full.
    """
    begun = time.monotonic()
    made, warned = 0, Counter[str]()
    if _is_ended(state):
        state.remove()
        failed = read_index(state.output).failures
        step(state.facts.count, len(failed))
        return BuildReport(state.output, state.facts.count - len(failed), 0, failed)
    try:
        write_whole(state.output / RECIPE, state.facts.text)
        state.note_facts()
        state.mark(unfinished=retry)
        failures = _kept_failures(state, retry)
        done = present_recordings(state, failures, verified or {})
        missing = [number for number in numbers if number not in done and number not in failures]
        step(len(done) + len(failures), len(failures))
        for index in range(state.shard_count):
            _assemble_if_final(state, index, failures)
        with closing(_outcomes(engine, job, missing)) as outcomes:
            for outcome in outcomes:
                if outcome.kind == "disk full":
                    raise BuildError(outcome.reason)
                warned.update(outcome.warnings)
                if outcome.kind == "made":
                    made += 1
                    _check_digest(state, outcome.number, digests or {})
                    done.add(outcome.number)
                else:
                    failures[outcome.number] = _failure(job, outcome)
                    state.add_failure(failures[outcome.number])
                _assemble_if_final(state, state.shard_of(outcome.number), failures)
                step(len(done) + len(failures), len(failures))
        for index in range(state.shard_count):
            state.assemble(index, failures)
        count = finish(state, failures)
    except Exception as error:
        if isinstance(error, BuildError) or is_disk_full(error):
            raise _full(state, str(error)) from error
        raise
    state.remove()
    return BuildReport(
        state.output, count, made, tuple(failures.values()), dict(warned.most_common()), time.monotonic() - begun
    )


def _check_digest(state: BuildingFolder, number: int, digests: Mapping[int, str]) -> None:
    """RunFormatError if a recording that was made again is another one."""
    wanted, part = digests.get(number), state.part(number)
    if wanted is None:
        return
    with open_hdf5(part) as file:
        same = recording_digest(file) == wanted
    if not same:
        part.unlink()
        raise RunFormatError(
            f"recording {number} is not the one that was damaged: '{state.output}' was made by other software, on "
            "another processor, or with other files; the card of the set names its versions. Nothing was replaced"
        )


def finish(state: BuildingFolder, failures: dict[int, Failure]) -> int:
    """Write index, card and checksums of the shards in a folder; the number of its recordings."""
    folder = state.output
    index = write_index(folder, state.facts.meta, tuple(failures.values()), state.shard_digests)
    known = dict(index.shards)
    write_sums(folder, known)
    write_card(folder)
    write_sums(folder, known)
    return len(index.rows)


def _outcomes(engine: BuildEngine, job: Job, numbers: list[int]) -> Generator[Outcome, None, None]:
    return engine.outcomes(job, numbers) if numbers else _nothing()


def _nothing() -> Generator[Outcome, None, None]:
    yield from ()


def _assemble_if_final(state: BuildingFolder, index: int, failures: dict[int, Failure]) -> None:
    """Write a shard without recordings that a later call may make."""
    if all(is_final(failures[number]) for number in state.numbers(index) if number in failures):
        state.assemble(index, failures)


def _failure(job: BuildJob, outcome: Outcome) -> Failure:
    seed = outcome.seed if outcome.kind != "crashed" else job.seed(outcome.number)
    return Failure(outcome.number, seed, outcome.kind, outcome.reason)


def _kept_failures(state: BuildingFolder, retry: bool) -> dict[int, Failure]:
    """Failures that stay: those for good, or all without a further try."""
    failures = state.failures
    if not failures:
        with suppress(OSError, ValueError):
            failures = {each.number: each for each in read_index(state.output).failures}
    for number, failure in list(failures.items()):
        if retry and not is_final(failure):
            state.forget_failure(number)
            del failures[number]
        else:
            state.add_failure(failure)
    return failures


def _full(state: BuildingFolder, reason: str) -> BuildError:
    free = shutil.disk_usage(state.output).free
    return BuildError(
        f"the disk of '{state.output}' is full ({free / 1e6:.0f} MB free): {reason}. What is there is whole: free some "
        f"space, then `rfgen dataset resume {state.output}` makes the rest"
    )


def _check_output(folder: Path, recipe: Recipe, resume: bool) -> None:
    if folder.exists() and not folder.is_dir():
        raise OutputError(f"output '{folder}' is a file: a folder is needed")
    there = {path.name for path in folder.iterdir()} if folder.is_dir() else set()
    if there <= {BUILDING, ORIGIN, PROCESSOR} and not any((folder / BUILDING).glob("[0-9]*.h5")):  # nothing was begun
        return
    stored = folder / RECIPE
    known = (folder / BUILDING).is_dir() or (folder / SUMS).is_file() or any(folder.glob(SHARDS))
    if not known or not stored.is_file():
        if known and resume:
            return
        raise OutputError(f"output '{folder}' is not empty: choose another folder")
    if not resume:
        raise OutputError(f"output '{folder}' holds a set: resume=True (`rfgen dataset resume`) makes what it lacks")
    if stored.read_text(encoding="utf-8", errors="replace") != with_plain_ends(recipe.text):
        raise OutputError(
            f"output '{folder}' holds a set of another recipe ('{stored}'): choose another folder, or that recipe"
        )


def _check_unchanged(state: BuildingFolder) -> None:
    """OutputError if a build is continued with other files, software or another device than it was begun with."""
    begun = state.begun_with
    if not begun:
        with suppress(OSError, ValueError):
            begun = dict(read_index(state.output).meta)
            if read_sums(state.output).get(RECIPE) != hashlib.sha256(state.facts.text.encode()).hexdigest():
                begun["recipe"] = ""  # not this one
    if state.facts.changes(begun) and _is_ended(state):  # nothing will be made
        begun = {key: value for key, value in begun.items() if key in ("recipe", "recipe_digest")}
    state.facts.check_unchanged(state.output, begun)


def _is_ended(state: BuildingFolder) -> bool:
    """Whether a set has all of its files, with every recording made or failed for good."""
    try:
        index, sums = read_index(state.output), read_sums(state.output)
    except (OSError, ValueError):
        return False
    numbers = {row.number for row in index.rows} | {each.number for each in index.failures if is_final(each)}
    files = {path.name for path in set_files(state.output)}
    return numbers == set(range(state.facts.count)) and files == set(sums) >= {CARD, INDEX, RECIPE, *index.shards}


def _ordered(order: Order, count: int) -> list[int]:
    names = {"forward": range(count), "reversed": range(count)[::-1]}
    numbers = list(names.get(order, ()) if isinstance(order, str) else map(int, order))
    if sorted(numbers) != list(range(count)):
        raise ValueError(f"order is {order!r}: 'forward', 'reversed' or all numbers from 0 to {count - 1} are needed")
    return numbers


def chosen_engine(
    name: str,
    workers: int | None,
    address: str | None,
    gpus_per_worker: float,
    folder: Path,
    time_limit: float | None = None,
) -> BuildEngine:
    if not (isinstance(gpus_per_worker, int | float) and 0.0 <= gpus_per_worker <= 64.0):
        raise ValueError(f"gpus_per_worker is {gpus_per_worker!r}: a number of at least 0 is needed")
    if name == "processes":
        if address is not None:
            raise ValueError(f"address is {address!r}, which belongs to the engine 'ray'")
        return LocalProcesses(workers, gpu=gpus_per_worker > 0, time_limit=time_limit)
    if name == "ray":
        if time_limit is not None:
            raise ValueError(f"time_limit is {time_limit!r}, which belongs to the engine 'processes'")
        from rfgen_sionna.recipes.ray_engine import RayCluster

        return RayCluster(workers, address=address, gpus_per_worker=gpus_per_worker, folder=folder)
    raise ValueError(f"engine is {name!r}: 'processes' or 'ray' is needed")
