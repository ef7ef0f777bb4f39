"""Index of a data set: an SQLite file with a row for each recording, rebuilt from its shards at any time."""

from __future__ import annotations

import hashlib
import json
import re
import sqlite3
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import h5py

from rfgen_sionna.dataset.recording_digest import check_dataset, objects_of
from rfgen_sionna.dataset.run_file import check_format, json_names, open_hdf5
from rfgen_sionna.dataset.schema import RADARS, SHARD_FORMAT, RunFormatError
from rfgen_sionna.dataset.shards import file_digest, recording_name, shard_recordings
from rfgen_sionna.dataset.whole_files import whole_file

INDEX = "index.sqlite"
"""Name of the index in the folder of a set."""
NAME_FORM = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,39}")
"""Form of the names of splits and radars in recipes; a split's name becomes that of files and folders."""
INDEX_VERSION = "1"
"""Version of the index's tables."""
_TABLES = {
    "meta": "key TEXT PRIMARY KEY, value TEXT NOT NULL",
    "shards": "name TEXT PRIMARY KEY, digest TEXT NOT NULL, bytes INTEGER NOT NULL",
    "recordings": (
        "number INTEGER PRIMARY KEY, shard TEXT NOT NULL, digest TEXT NOT NULL, split TEXT NOT NULL, "
        "prompt TEXT NOT NULL, actions TEXT NOT NULL, bodies TEXT NOT NULL, place TEXT NOT NULL, place_seed INTEGER, "
        "people INTEGER, distance_m REAL, azimuth_deg REAL, orientation_deg REAL, duration_s REAL, "
        "frames INTEGER NOT NULL, seed INTEGER, attempt INTEGER, spec TEXT NOT NULL"
    ),
    "failures": "number INTEGER NOT NULL, seed INTEGER, kind TEXT NOT NULL, reason TEXT NOT NULL",
}
_SHARD_NAME = re.compile(r"shard-[^/\\\0\n]*\.h5")
_LISTS = ("actions", "bodies")


@dataclass(frozen=True)
class IndexRow:
    """Row of one recording; None is what the recipe leaves to the prompt."""

    number: int
    """Number in the set, from 0."""
    shard: str
    """File with the recording."""
    digest: str
    """SHA-256 of the recording's contents (:func:`rfgen_sionna.dataset.shards.recording_digest`)."""
    split: str
    prompt: str
    actions: tuple[str, ...]
    """Action of each actor, in the order of the run's actors: that of most frames."""
    bodies: tuple[int, ...]
    """Seed of each body."""
    place: str
    place_seed: int | None
    people: int
    distance_m: float | None
    """Distance from the first radar [m]."""
    azimuth_deg: float | None
    """Azimuth from the first radar's boresight, positive to its left [degrees]."""
    orientation_deg: float | None
    """Orientation, 0 faces the radar [degrees]."""
    duration_s: float | None
    """Length [s]."""
    frames: int
    """Number of frames of the first radar."""
    seed: int | None
    """Seed of the noise."""
    attempt: int
    """Number of draws that could not be made."""
    spec_text: str
    """Specification (JSON)."""

    @property
    def name(self) -> str:
        """Name of the recording in its shard, "000123"."""
        return recording_name(self.number)

    @cached_property
    def spec(self) -> dict[str, Any]:
        """Specification of the recording; empty if it has none."""
        return dict(json.loads(self.spec_text))


@dataclass(frozen=True)
class Failure:
    """Recording that could not be made."""

    number: int
    seed: int | None
    kind: str
    """Kind of the fault, such as "placement"."""
    reason: str


@dataclass(frozen=True)
class SetIndex:
    """Contents of an index (:func:`read_index`)."""

    meta: Mapping[str, str]
    """Facts of the set, such as the digest of its recipe."""
    shards: Mapping[str, str]
    """SHA-256 of each shard, by its name."""
    rows: tuple[IndexRow, ...]
    failures: tuple[Failure, ...]


def row_of(number: int, recording: h5py.Group, shard: str) -> IndexRow:
    """Row of the recording in a group of the file `shard`.

    RunFormatError if its specification cannot be read, its split is none of a recipe, or values are in another file.
    """
    path = Path(recording.file.filename)
    text = str(recording.attrs.get("recording", "{}"))
    try:
        spec = dict(json.loads(text))
        bodies = tuple(int(each["seed"]) for each in spec.get("bodies") or ())
        split = _checked_split(str(spec.get("split", "")))
        for name, dataset in objects_of(recording)[1].items():
            check_dataset(name, dataset)
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise RunFormatError(f"'{path}': recording {number} cannot be read ({error})") from error
    names = json_names(path, recording, RADARS)
    run = recording[f"{RADARS}/{names[0]}"] if names else recording

    def number_of(name: str, kind: type) -> Any:
        value = spec.get(name)
        return kind(value) if isinstance(value, int | float) else None

    return IndexRow(
        number=number, shard=shard, digest=str(recording.attrs.get("digest", "")), split=split,
        prompt=str(run.attrs.get("prompt", "")), actions=_actions(run), bodies=bodies,
        place=str(spec.get("place", run.attrs.get("environment", ""))), place_seed=number_of("place_seed", int),
        people=len(bodies), distance_m=number_of("distance_m", float), azimuth_deg=number_of("azimuth_deg", float),
        orientation_deg=number_of("orientation_deg", float), duration_s=number_of("duration_s", float),
        frames=int(run["frame_time"].shape[0]), seed=number_of("seed", int), attempt=number_of("attempt", int) or 0,
        spec_text=text,
    )  # fmt: skip


def _checked_split(name: str) -> str:
    """The name of a split, or "" for none; ValueError if no recipe can have it."""
    if name and not NAME_FORM.fullmatch(name):
        raise ValueError(f"its split is {name[:60]!r}: a name of 1 to 40 letters, digits, - and _ is needed")
    return name


def _actions(run: h5py.Group) -> tuple[str, ...]:
    stored = run.get("labels/action")
    if not isinstance(stored, h5py.Dataset) or stored.ndim != 2 or h5py.check_string_dtype(stored.dtype) is None:
        return ()
    return tuple(Counter(column).most_common(1)[0][0] for column in stored.asstr()[:].T.tolist() if column)


def write_index(
    folder: Path, meta: Mapping[str, str] | None = None, failures: Sequence[Failure] = (),
    shards: Mapping[str, str] | None = None,
) -> SetIndex:  # fmt: skip
    """Write the index of all shards in a folder, in place of the one that is there, whole or not at all.

    Parameters
    ----------
    folder
        Folder of the set.
    meta
        Facts of the set, such as the digest of its recipe and the versions of software.
    failures
        Recordings that could not be made.
    shards
        SHA-256 of shards by their names, where they are known already; others are computed.

    Raises
    ------
    RunFormatError
        If a shard cannot be read.
    """
    rows: list[IndexRow] = []
    found, known = {}, dict(shards or {})
    for path in sorted(folder.glob("shard-*.h5")):
        with open_hdf5(path) as file:
            check_format(path, file, SHARD_FORMAT)
            rows += [row_of(number, group, path.name) for number, group in shard_recordings(file)]
        found[path.name] = known.get(path.name) or file_digest(path)
    rows.sort(key=lambda row: row.number)
    twice = [number for number, count in Counter(row.number for row in rows).items() if count > 1]
    if twice:
        raise RunFormatError(f"'{folder}': recordings {twice[:5]} are in two shards; delete one of them")
    texts = {"version": INDEX_VERSION} | {key: str(value) for key, value in (meta or {}).items()}
    index = SetIndex(texts, found, tuple(rows), tuple(sorted(failures, key=lambda each: each.number)))
    index = replace(index, meta={**texts, "contents": _contents_digest(index)})
    with whole_file(folder / INDEX) as temporary, closing(sqlite3.connect(temporary)) as base, base:
        base.execute("PRAGMA journal_mode = OFF")
        _fill(base, index, {name: (folder / name).stat().st_size for name in found})
    return index


def _fill(base: sqlite3.Connection, index: SetIndex, sizes: Mapping[str, int]) -> None:
    for name, columns in _TABLES.items():
        base.execute(f"CREATE TABLE {name} ({columns})")
    base.executemany("INSERT INTO meta VALUES (?, ?)", sorted(index.meta.items()))
    base.executemany("INSERT INTO shards VALUES (?, ?, ?)", [(n, d, sizes[n]) for n, d in index.shards.items()])
    names = [each.name for each in fields(IndexRow)]
    marks = ", ".join("?" * len(names))
    values = ([_stored(getattr(row, name)) for name in names] for row in index.rows)
    base.executemany(f"INSERT INTO recordings VALUES ({marks})", values)
    failures = [(each.number, each.seed, each.kind, each.reason) for each in index.failures]
    base.executemany("INSERT INTO failures VALUES (?, ?, ?, ?)", failures)


def _stored(value: Any) -> Any:
    return json.dumps(list(value)) if isinstance(value, tuple) else value


def read_index(folder: Path) -> SetIndex:
    """The index of the set in a folder, from a file that is not trusted: nothing in it is executed.

    Raises
    ------
    FileNotFoundError
        If there is none.
    RunFormatError
        If it is damaged, of another version, or has views, triggers or other tables.
    """
    path = folder / INDEX
    if not path.is_file():
        raise FileNotFoundError(f"data set '{folder}' has no {INDEX}: `rfgen dataset repair {folder}` makes it again")
    cure = f"`rfgen dataset repair {folder}` makes it again from the shards"
    try:
        with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro&immutable=1", uri=True)) as base:
            return _read(base)
    except (sqlite3.Error, ValueError, TypeError, RecursionError, OverflowError, MemoryError) as error:
        raise RunFormatError(f"'{path}' is no index of a data set ({error}); {cure}") from error


def _read(base: sqlite3.Connection) -> SetIndex:
    for setting in ("trusted_schema = OFF", "query_only = ON", "cell_size_check = ON", "mmap_size = 0"):
        base.execute(f"PRAGMA {setting}")
    wanted = {("table", name, f"CREATE TABLE {name} ({columns})") for name, columns in _TABLES.items()}
    there = base.execute("SELECT type, name, sql FROM sqlite_schema WHERE sql IS NOT NULL").fetchall()
    if set(there) != wanted or len(there) != len(wanted):
        raise ValueError("it has other tables, or views or triggers")
    if (found := base.execute("PRAGMA quick_check(1)").fetchone()[0]) != "ok":
        raise ValueError(str(found))
    meta = {str(key): str(value) for key, value in base.execute("SELECT key, value FROM meta")}
    if meta.get("version") != INDEX_VERSION:
        raise ValueError(f"it has version {meta.get('version')!r}; this package reads {INDEX_VERSION}")
    shards = dict(base.execute("SELECT name, digest FROM shards ORDER BY name"))
    rows = tuple(map(_row, base.execute("SELECT * FROM recordings ORDER BY number")))
    failures = base.execute("SELECT number, seed, kind, reason FROM failures ORDER BY number")
    unknown = sorted({row.shard for row in rows} - set(shards))
    if unknown or not all(isinstance(each, str) and _SHARD_NAME.fullmatch(each) for each in shards):
        raise ValueError(f"shards {unknown or sorted(shards)} are no names of its shards")
    index = SetIndex(meta, shards, rows, tuple(Failure(*each) for each in failures))
    if meta.get("contents") != _contents_digest(index):
        raise ValueError("its contents are not those that were written")
    return index


def _contents_digest(index: SetIndex) -> str:
    """SHA-256 of all that an index has, but itself."""
    facts = {key: value for key, value in index.meta.items() if key != "contents"}
    rows = [[getattr(row, each.name) for each in fields(IndexRow)] for row in index.rows]
    everything = [facts, dict(index.shards), rows, [vars(each) for each in index.failures]]
    return hashlib.sha256(json.dumps(everything, sort_keys=True, default=repr).encode()).hexdigest()


def _row(values: Iterable[Any]) -> IndexRow:
    given = dict(zip((each.name for each in fields(IndexRow)), values, strict=True))
    for name in _LISTS:
        given[name] = tuple(json.loads(given[name]))
    row = IndexRow(**given)
    texts = (row.shard, row.digest, row.split, row.prompt, row.place, row.spec_text, *row.actions)
    numbers = (row.number, row.people, row.frames, row.attempt, *row.bodies)
    if not all(isinstance(each, str) for each in texts) or not all(isinstance(each, int) for each in numbers):
        raise ValueError(f"the row of recording {row.number} has other types")
    _checked_split(row.split)
    return row
