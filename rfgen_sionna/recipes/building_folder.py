"""State of a build on the disk: finished recordings, failures and the lock, in `.building` in the folder of the set."""

from __future__ import annotations

import os
import shutil
import sqlite3
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Any

from rfgen_sionna.dataset.set_index import Failure
from rfgen_sionna.dataset.shards import assemble_shard, file_digest
from rfgen_sionna.recipes.outcome import FINAL
from rfgen_sionna.recipes.recording_job import WORKER_FOLDER, part_name
from rfgen_sionna.recipes.set_facts import SetFacts

BUILDING = ".building"
"""Name of the folder of a build."""
SHARDS = "shard-*.h5"
"""Pattern of the names of shards."""
UNFINISHED = "unfinished"
"""Name of a file in the folder of a build: the set lacks recordings that only the build makes, no repair."""
_TABLES = (
    "failures (number INTEGER PRIMARY KEY, seed INTEGER, kind TEXT, reason TEXT)",
    "facts (name TEXT PRIMARY KEY, value TEXT NOT NULL)",
    "shards (name TEXT PRIMARY KEY, digest TEXT NOT NULL)",
)
_LEFTOVERS = (f"{WORKER_FOLDER}*", "*.tmp", "probe-*")


class BusyError(OSError):
    """A folder in which another build is at work."""


def shard_name(index: int) -> str:
    """File name of the shard number `index`."""
    return f"shard-{index:05d}.h5"


class BuildingFolder:
    """Folder of a build; :meth:`locked` opens it for one driver."""

    def __init__(self, output: Path, facts: SetFacts) -> None:
        self.output, self.facts = output, facts
        self.path = output / BUILDING

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Context of the only driver; leftovers of ended workers are removed.

        Raises
        ------
        BusyError
            If another driver is at work, on this machine or another one that shares the disk.
        """
        handle = self._locked_handle()
        try:
            self._remove_leftovers()
            self._open_state()
            yield
        finally:
            os.close(handle)

    def _locked_handle(self) -> int:
        while True:
            self.path.mkdir(parents=True, exist_ok=True)
            try:
                handle = os.open(self.path / "lock", os.O_RDWR | os.O_CREAT, 0o644)
            except FileNotFoundError:  # a build that has just ended removed the folder
                continue
            try:
                _lock(handle, self.output)
                if os.path.samestat(os.fstat(handle), os.stat(self.path / "lock")):
                    return handle
            except FileNotFoundError:
                pass  # the lock is that of a build that has just ended
            except BaseException:
                os.close(handle)
                raise
            os.close(handle)

    def _remove_leftovers(self) -> None:
        for pattern in _LEFTOVERS:
            for path in self.path.glob(pattern):
                shutil.rmtree(path, ignore_errors=True)
                path.unlink(missing_ok=True)
        for path in (*self.output.glob(".shard-*.tmp"), *self.output.glob(".*.tmp")):
            path.unlink(missing_ok=True)

    def _open_state(self) -> None:
        """Make the tables; a state that is damaged is begun anew, which costs a reading of the shards."""
        try:
            self._make_tables()
        except sqlite3.OperationalError:  # a full disk, for instance
            raise
        except sqlite3.DatabaseError:
            for path in self.path.glob("state.sqlite*"):
                path.unlink(missing_ok=True)
            self._make_tables()

    def _make_tables(self) -> None:
        for table in _TABLES:
            self._with_state(f"CREATE TABLE IF NOT EXISTS {table}")

    def _with_state(self, statement: str, values: Sequence[object] = ()) -> list[tuple[Any, ...]]:
        with closing(sqlite3.connect(self.path / "state.sqlite", timeout=30.0)) as base, base:
            return base.execute(statement, values).fetchall()

    @property
    def failures(self) -> dict[int, Failure]:
        """Recordings that could not be made, by their numbers."""
        rows = self._with_state("SELECT number, seed, kind, reason FROM failures ORDER BY number")
        return {row[0]: Failure(*row) for row in rows}

    def add_failure(self, failure: Failure) -> None:
        """Note that a recording could not be made."""
        values = (failure.number, failure.seed, failure.kind, failure.reason)
        self._with_state("INSERT OR REPLACE INTO failures VALUES (?, ?, ?, ?)", values)

    def forget_failure(self, number: int) -> None:
        """Note that a recording is to be made again."""
        self._with_state("DELETE FROM failures WHERE number = ?", (number,))

    @property
    def begun_with(self) -> dict[str, str]:
        """Facts that the build was begun with; empty for a new one."""
        return dict(self._with_state("SELECT name, value FROM facts"))

    def note_facts(self) -> None:
        """Note what a new build is begun with."""
        for name, value in self.facts.attributes.items():
            self._with_state("INSERT OR IGNORE INTO facts VALUES (?, ?)", (name, value))

    def mark(self, unfinished: bool) -> None:
        """Note whether the build is to be continued, rather than the set repaired."""
        if unfinished:
            (self.path / UNFINISHED).touch()
        else:
            (self.path / UNFINISHED).unlink(missing_ok=True)

    @property
    def shard_digests(self) -> dict[str, str]:
        """SHA-256 of the shards that this build has written or compared, by their names."""
        return dict(self._with_state("SELECT name, digest FROM shards"))

    def note_shard(self, name: str, digest: str) -> None:
        """Note the digest of a shard that is whole."""
        self._with_state("INSERT OR REPLACE INTO shards VALUES (?, ?)", (name, digest))

    def forget_shard(self, name: str) -> None:
        """Note that a shard is there no more."""
        self._with_state("DELETE FROM shards WHERE name = ?", (name,))

    @property
    def parts(self) -> dict[int, Path]:
        """Finished recordings that are in no shard yet."""
        return {int(path.stem): path for path in self.path.glob("[0-9]*.h5") if path.stem.isdecimal()}

    def part(self, number: int) -> Path:
        """File of a finished recording."""
        return self.path / part_name(number)

    def numbers(self, index: int) -> range:
        """Numbers of the recordings of a shard."""
        return range(
            index * self.facts.recordings_per_shard,
            min((index + 1) * self.facts.recordings_per_shard, self.facts.count),
        )

    @property
    def shard_count(self) -> int:
        """Number of shards of the recipe."""
        return -(-self.facts.count // self.facts.recordings_per_shard)

    def shard_of(self, number: int) -> int:
        """Number of the shard of a recording."""
        return number // self.facts.recordings_per_shard

    def shard(self, index: int) -> Path:
        """File of a shard."""
        return self.output / shard_name(index)

    def assemble(self, index: int, failures: Mapping[int, Failure]) -> bool:
        """Write a shard, once all of its recordings are made or failed, and remove its parts; whether it was written.

        A shard with recordings that a further try may make waits for the end of the build.
        """
        numbers = self.numbers(index)
        made = {number: path for number in numbers if (path := self.part(number)).is_file()}
        if not made or len(made) + sum(number in failures for number in numbers) < len(numbers):
            return False
        shard = self.shard(index)
        self.forget_shard(shard.name)
        assemble_shard(shard, made, self.facts.attributes)
        self.note_shard(shard.name, file_digest(shard))  # before its parts go
        for path in made.values():
            path.unlink(missing_ok=True)
        return True

    def remove(self) -> None:
        """Remove the state of a finished build."""
        shutil.rmtree(self.path, ignore_errors=True)


def is_final(failure: Failure) -> bool:
    """Whether a further try cannot make a recording."""
    return failure.kind in FINAL


def _lock(handle: int, output: Path) -> None:
    try:
        import fcntl
    except ImportError:  # Windows
        import msvcrt

        lock = lambda: msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]  # noqa: E731
    else:
        lock = lambda: fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)  # noqa: E731
    try:
        lock()
    except OSError:
        holder = ""
        with suppress(OSError, UnicodeDecodeError):
            holder = os.pread(handle, 200, 0).decode().strip()
        raise BusyError(
            f"'{output}' is being built by {holder or 'another process'}: wait for its end, or end it"
        ) from None
    with suppress(OSError):
        os.truncate(handle, 0)
        os.pwrite(handle, f"process {os.getpid()} on {os.uname().nodename}, since {time.ctime()}\n".encode(), 0)
