"""What a recipe will make, how large it will be and how long it takes, from a few recordings made on this machine."""

from __future__ import annotations

import math
import os
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cache
from os import PathLike
from pathlib import Path

import numpy as np

from rfgen_sionna._short_repr import ShortRepr
from rfgen_sionna.dataset import check_output
from rfgen_sionna.dataset.shards import assemble_shard
from rfgen_sionna.recipes.outcome import Outcome
from rfgen_sionna.recipes.partitions import stream
from rfgen_sionna.recipes.process_engine import LocalProcesses, chosen_workers
from rfgen_sionna.recipes.recipe import Recipe
from rfgen_sionna.recipes.recording_job import RecordingJob, collected_warnings, part_name, prepare_worker
from rfgen_sionna.recipes.recording_spec import RecordingSpec
from rfgen_sionna.recipes.set_radars import load_radar

INDEX_BYTES = 2_500
"""Size of a recording in the index and of its part of a shard's tables [bytes]."""
MIN_PROBES = 2
"""Probes of each kind of recordings."""
MAX_COUNTED = 20_000
"""Most recordings that are drawn to be counted; of larger sets the counts of kinds and actions are about right."""
PICTURES = (".png", ".pdf", ".svg")
"""Endings of pictures."""

Stratum = tuple[str, int, float]
"""Place, number of sources and duration [s] of recordings that take about the same time."""


@dataclass(frozen=True)
class Probe:
    """A recording that was made to see how long it takes."""

    number: int
    seconds: float
    """Time of one process [s]."""
    size: int
    """Size in a shard [bytes]; 0 if it could not be made."""
    attempt: int = 0
    """Draws before it that could not be made."""
    reason: str = ""
    """Why it could not be made."""


@dataclass(frozen=True)
class StratumPlan:
    """Estimate for recordings of one kind."""

    stratum: Stratum
    count: int
    probes: tuple[Probe, ...]

    @property
    def seconds(self) -> float:
        """Mean time of a recording in one process [s]."""
        return float(np.mean([probe.seconds for probe in self.probes])) if self.probes else 0.0

    @property
    def size(self) -> float:
        """Mean size of a recording [bytes]."""
        made = [probe.size for probe in self.probes if not probe.reason]
        return float(np.mean(made)) if made else 0.0

    @property
    def share_made(self) -> float:
        """Share of the probes that could be made."""
        return 1.0 - sum(bool(probe.reason) for probe in self.probes) / max(1, len(self.probes))

    @property
    def spread(self) -> float:
        """Standard error of `seconds` [s]."""
        if len(self.probes) < 2:
            return self.seconds
        return float(np.std([probe.seconds for probe in self.probes], ddof=1)) / math.sqrt(len(self.probes))


@dataclass(frozen=True, repr=False)
class DatasetPlan(ShortRepr):
    """What a recipe will make; its text is a table."""

    count: int
    """Number of recordings."""
    workers: int
    """Number of processes."""
    strata: tuple[StratumPlan, ...]
    """Estimates for each kind of recordings."""
    splits: Mapping[str, int]
    """Number of recordings of each split."""
    actions: Mapping[str, int]
    """Number of recordings of each text of a prompt or name of a file."""
    recordings_per_shard: int
    start_seconds: float = 0.0
    """Time until a process makes its first recording [s]."""
    sheet: Path | None = None
    """Picture of sample scenes."""
    counts: Mapping[tuple[str, str], int] = field(default_factory=dict)
    """Number of recordings of each place in each split."""

    @property
    def bytes(self) -> float:
        """Size of the set [bytes]."""
        return sum(each.count * (each.size * each.share_made + INDEX_BYTES) for each in self.strata)

    @property
    def seconds(self) -> float:
        """Time to make it [s]."""
        work = sum(each.count * each.seconds for each in self.strata)
        return self.start_seconds + work / self.workers

    @property
    def seconds_error(self) -> float:
        """Standard error of `seconds` [s], from the spread of the probes."""
        return math.sqrt(sum((each.count * each.spread) ** 2 for each in self.strata)) / self.workers

    @property
    def probes(self) -> tuple[Probe, ...]:
        """All probes."""
        return tuple(probe for each in self.strata for probe in each.probes)

    @property
    def failed(self) -> tuple[Probe, ...]:
        """Probes that could not be made, with their reasons."""
        return tuple(probe for probe in self.probes if probe.reason)

    def __str__(self) -> str:
        shards = -(-self.count // self.recordings_per_shard)
        lines = [
            f"{self.count} recordings in {shards} shard{'s' * (shards > 1)} of {self.recordings_per_shard} at most",
            f"about {_size(self.bytes)}, about {duration_text(self.seconds)} with {self.workers} "
            f"process{'es' * (self.workers > 1)} on this machine (± {100 * self.seconds_error / self.seconds:.0f} %)"
            if self.probes
            else "size and time are not known without probes",
            "",
        ]
        rows = [["place", "sources", "seconds", *self.splits, "total", "each takes", "each has"]]
        for each in self.strata:
            place, people, duration = each.stratum
            numbers = [self.counts.get((split, str(each.stratum)), 0) for split in self.splits]
            made = bool(each.probes)
            costs = (f"{each.seconds:.1f} s", _size(each.size)) if made else ("?", "?")
            rows.append([place, str(people), f"{duration:g}", *map(str, numbers), str(each.count), *costs])
        rows.append(["all", "", "", *map(str, self.splits.values()), str(self.count), "", ""])
        lines += _table(rows)
        lines += ["", *_table([[text, str(count)] for text, count in self.actions.items()])]
        lines += [f"recording {probe.number} cannot be made: {probe.reason}" for probe in self.failed]
        if self.sheet is not None:
            lines.append(f"sample scenes: {self.sheet}")
        return "\n".join(lines)

    def _facts(self) -> Iterable[str]:
        yield f"{self.count} recordings"
        yield f"{_size(self.bytes)}"
        yield f"{duration_text(self.seconds)} with {self.workers} processes"


def plan_dataset(
    recipe: Recipe,
    *,
    probes: int = 8,
    workers: int | None = None,
    sheet: str | PathLike[str] | None = None,
    overwrite: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> DatasetPlan:
    """Count the recordings of a recipe, and make a few of each kind to see how large they are and how long they take.

    Probes are made as a build makes recordings: by `workers` processes at once, each with one thread, so that what they
    wait for each other is in the times.

    Args:
        recipe: the recipe.
        probes: number of recordings that are made, at least two of each kind (place, people, duration); 0 makes none.
        workers: number of processes; None is that of the cores, within the free memory.
        sheet: picture to write (PNG, PDF or SVG) of sample scenes; None draws none.
        overwrite: whether an existing picture is replaced.
        progress: function of the number of finished and of all probes.

    Raises:
        ValueError: an argument is out of range.
    """
    workers = chosen_workers(workers)
    if probes < 0:
        raise ValueError(f"probes is {probes}: a whole number of at least 0 is needed")
    picture = None if sheet is None else check_output(sheet, overwrite)
    if picture is not None and picture.suffix.lower() not in PICTURES:
        raise ValueError(f"sheet is '{picture}': a file with one of the endings {', '.join(PICTURES)} is needed")
    specs = [recipe.recording(number) for number in _counted(recipe)]
    scale = recipe.count / len(specs)
    kinds: dict[Stratum, list[RecordingSpec]] = {}
    for spec in specs:
        kinds.setdefault((spec.place, len(spec.sources), spec.duration_s), []).append(spec)
    kinds = dict(sorted(kinds.items(), key=lambda item: -len(item[1])))
    chosen = chosen_probes(kinds, probes, recipe.tables.seed)
    start, made = _made(recipe, [number for each in chosen.values() for number in each], workers, progress)
    if picture is not None:
        from rfgen_sionna.recipes.plan_sheet import draw_sample_scenes

        draw_sample_scenes(recipe, picture)
    strata = tuple(
        StratumPlan(kind, round(scale * len(own)), tuple(made[number] for number in chosen[kind]))
        for kind, own in kinds.items()
    )
    actions = Counter(_words(spec) for spec in specs)
    counts = Counter((spec.split, str((spec.place, len(spec.sources), spec.duration_s))) for spec in specs)
    splits = Counter(recipe.split_of(number) for number in range(recipe.count))
    return DatasetPlan(
        recipe.count,
        workers,
        strata,
        {split: splits[split] for split in recipe.splits},
        {text: round(scale * count) for text, count in actions.most_common()},
        recipe.recordings_per_shard,
        start,
        picture,
        {key: round(scale * count) for key, count in counts.items()},
    )


def _counted(recipe: Recipe) -> list[int]:
    """Numbers of the recordings that are counted: all, or `MAX_COUNTED` drawn ones."""
    if recipe.count <= MAX_COUNTED:
        return list(range(recipe.count))
    drawn = stream(recipe.tables.seed, "counted").choice(recipe.count, MAX_COUNTED, replace=False)
    return [int(number) for number in np.sort(drawn)]


def chosen_probes(kinds: Mapping[Stratum, Sequence[RecordingSpec]], probes: int, seed: int) -> dict[Stratum, list[int]]:
    """Numbers of the recordings that are made of each kind: `MIN_PROBES` at least, the rest by their shares."""
    if probes == 0:
        return {kind: [] for kind in kinds}
    total = sum(map(len, kinds.values()))
    found = {}
    for index, (kind, specs) in enumerate(kinds.items()):
        count = min(len(specs), max(MIN_PROBES, round(probes * len(specs) / total)))
        picked = stream(seed, "probes", index).choice(len(specs), count, replace=False)
        found[kind] = [specs[int(each)].number for each in picked]
    return found


@dataclass(frozen=True)
class ProbeJob:
    """Makes recordings as a build does, each process after a frame that loads libraries and compiles kernels."""

    recipe: Recipe
    folder: Path
    first: int
    """Recording of that frame."""

    def __call__(self, number: int) -> Outcome:
        """Make one recording, and leave a shard of it alone, whose size counts."""
        warm_up(self)
        outcome, path = RecordingJob(self.recipe, self.folder)(number), self.folder / part_name(number)
        if outcome.kind == "made":
            assemble_shard(self.shard(number), {number: path}, {})
        path.unlink(missing_ok=True)
        return outcome

    def shard(self, number: int) -> Path:
        """Path of the shard of a recording."""
        return self.folder / f"shard-{number:06d}.h5"

    def seed(self, number: int) -> int:
        """Seed of a recording."""
        return self.recipe.recording(number).seed


@cache
def warm_up(job: ProbeJob) -> None:
    """Make one frame of a recording, once in a process."""
    from rfgen_sionna.recipes.making import make_recording

    prepare_worker()
    spec = job.recipe.recording(job.first)
    frame = max(load_radar(radar).waveform.frame_length for radar in spec.radars)
    path = job.folder / f"warm-{os.getpid()}.h5"
    with suppress(Exception), collected_warnings():  # the recording itself says what is wrong with it
        make_recording(replace(spec, duration_s=min(spec.duration_s, 1.01 * frame)), path)
    path.unlink(missing_ok=True)


def _made(
    recipe: Recipe, numbers: Sequence[int], workers: int, progress: Callable[[int, int], None] | None
) -> tuple[float, dict[int, Probe]]:
    """Time until a process makes its first recording [s], and the probes by number."""
    if not numbers:
        return 0.0, {}
    found: dict[int, Probe] = {}
    with tempfile.TemporaryDirectory(prefix="rfgen-plan-") as folder:
        job, before, start = ProbeJob(recipe, Path(folder), numbers[0]), time.perf_counter(), math.inf
        for done, made in enumerate(LocalProcesses(workers).outcomes(job, numbers), 1):
            start = min(start, time.perf_counter() - before - made.seconds)
            shard, reason = job.shard(made.number), "" if made.kind == "made" else made.reason or made.kind
            size = 0 if reason else shard.stat().st_size
            shard.unlink(missing_ok=True)
            found[made.number] = Probe(made.number, made.seconds, size, made.attempt, reason)
            if progress is not None:
                progress(done, len(numbers))
    return max(0.0, start), found


def _words(spec: RecordingSpec) -> str:
    return "; ".join(source.text or Path(source.file or "").name for source in spec.sources)


def _size(count: float) -> str:
    for unit, scale in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if count >= scale:
            return f"{count / scale:.3g} {unit}"
    return f"{count:.0f} B"


def duration_text(seconds: float) -> str:
    """A time in its two largest units."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    if seconds < 5400:
        return f"{seconds / 60:.0f} min"
    hours, minutes = divmod(round(seconds / 60), 60)
    return f"{hours} h {minutes} min" if hours < 48 else f"{hours / 24:.1f} days"


def _table(rows: Sequence[Sequence[str]]) -> list[str]:
    """Lines of a table, the first column to the left and the others to the right."""
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    return [
        "  ".join(
            cell.ljust(width) if column == 0 else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]
