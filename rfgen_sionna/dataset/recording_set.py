"""Data sets: the recordings in the shards of a folder."""

from __future__ import annotations

import operator
import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import SupportsIndex, overload

from rfgen_sionna._short_repr import ShortRepr, name_list
from rfgen_sionna.dataset.checksums import read_sums
from rfgen_sionna.dataset.open_shards import OpenShards
from rfgen_sionna.dataset.reader import Run
from rfgen_sionna.dataset.run_file import RunFile
from rfgen_sionna.dataset.schema import RECORDINGS
from rfgen_sionna.dataset.set_index import INDEX, Failure, IndexRow, SetIndex, read_index
from rfgen_sionna.dataset.shards import extract_recording, file_digest
from rfgen_sionna.dataset.store import OutputError
from rfgen_sionna.dataset.verified_files import SUMS, ChecksumError, VerifiedFiles


class RecordingSet(ShortRepr):
    """Recordings of a data set, or a part of them: `recordings[3]` is the :class:`Run` of the fourth one.

    Nothing is read before it is needed. A set can be pickled, for processes of any start method; a pickled or forked
    copy opens the files again.
    """

    def __init__(self, folder: Path, index: SetIndex, shards: OpenShards) -> None:
        self.folder = folder
        self.index, self._shards = index, shards
        self._places = {row.number: place for place, row in enumerate(index.rows)}

    def _facts(self) -> Iterable[str]:
        yield repr(str(self.folder))
        yield f"{len(self)} recording{'' if len(self) == 1 else 's'}"
        yield f"splits {name_list(self.splits)}" if self.splits else ""
        yield f"places {name_list(dict.fromkeys(row.place for row in self.rows))}"
        yield f"{len(self.failures)} could not be made" if self.failures else ""

    @property
    def rows(self) -> tuple[IndexRow, ...]:
        """What the index has of each recording, in the order of the recordings."""
        return self.index.rows

    @property
    def failures(self) -> tuple[Failure, ...]:
        """Recordings of the recipe that could not be made."""
        return self.index.failures

    @property
    def splits(self) -> tuple[str, ...]:
        """Names of the splits."""
        return tuple(dict.fromkeys(row.split for row in self.rows if row.split))

    @cached_property
    def radars(self) -> tuple[str, ...]:
        """Names of the radars of each recording."""
        return tuple(self[0].radars) if len(self) else ()

    @cached_property
    def recipe_text(self) -> str:
        """The recipe (TOML); empty without one. ChecksumError if it is not the one that was written."""
        path = self.folder / "recipe.toml"
        if not path.is_file():
            return ""
        if file_digest(path) != read_sums(self.folder).get(path.name):
            raise ChecksumError(
                f"'{path}' is damaged: its checksum is not that in {SUMS}; `rfgen dataset repair {self.folder}` writes "
                "it again"
            )
        return path.read_text(encoding="utf-8")

    def __len__(self) -> int:
        return len(self.rows)

    @overload
    def __getitem__(self, position: SupportsIndex) -> Run: ...
    @overload
    def __getitem__(self, position: slice) -> RecordingSet: ...
    def __getitem__(self, position: SupportsIndex | slice) -> Run | RecordingSet:
        if isinstance(position, slice):
            return self._part(self.rows[position])
        place = operator.index(position)
        if not -len(self) <= place < len(self):
            raise IndexError(f"position {place}: the set has {len(self)} recordings")
        row = self.rows[place]
        return Run(RunFile(self.folder / row.shard, f"{RECORDINGS}/{row.name}", self._shards))

    def __iter__(self) -> Iterator[Run]:
        return (self[place] for place in range(len(self)))

    def recording(self, number: int) -> Run:
        """Run of the recording with that number in the recipe; KeyError if the set does not have it."""
        if number not in self._places:
            failed = next((each for each in self.failures if each.number == number), None)
            why = f": it could not be made ({failed.reason})" if failed else ""
            raise KeyError(f"'{self.folder}' has no recording {number}{why}")
        return self[self._places[number]]

    def split(self, name: str) -> RecordingSet:
        """Recordings of one split, such as "train"; ValueError if there is none of that name."""
        if name not in self.splits:
            raise ValueError(f"split is {name!r}: '{self.folder}' has {name_list(self.splits) or 'no splits'}")
        return self.where(lambda row: row.split == name)

    def where(self, condition: Callable[[IndexRow], bool]) -> RecordingSet:
        """Recordings whose row of the index meets a condition."""
        return self._part(tuple(row for row in self.rows if condition(row)))

    def _part(self, rows: tuple[IndexRow, ...]) -> RecordingSet:
        return RecordingSet(self.folder, replace(self.index, rows=rows), self._shards)

    def extract(self, number: int, path: str | os.PathLike[str]) -> None:
        """Write the recording of that number to a run file of its own (:func:`rfgen_sionna.dataset.open_run`).

        KeyError if the set does not have it; OutputError if the file exists.
        """
        run, target = self.recording(number), Path(path)
        if target.exists():
            raise OutputError(f"output '{target}' exists; choose another name")
        extract_recording(run.path, number, target)

    def close(self) -> None:
        """Close the shards that are open, for all parts of the set; the next access opens them again."""
        self._shards.close()

    def __enter__(self) -> RecordingSet:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def open_dataset(folder: str | os.PathLike[str]) -> RecordingSet:
    """Open the data set in a folder.

    Files need not be trusted: each shard is compared with its checksum, and read in a process of its own, before it is
    first opened here. A machine remembers that (`.verified` in the folder), as it does of sets that it made.

    Raises
    ------
    FileNotFoundError, NotADirectoryError
        If there is no such folder, or no set in it.
    ChecksumError
        If a file is not the one that was written; the message names the file and the cure. A shard is checked when a
        recording in it is first read.
    RunFormatError
        If the index is damaged, or of another version.
    TypeError
        If `folder` is not a path.
    """
    if not isinstance(folder, str | os.PathLike):
        raise TypeError(f"folder is {folder!r}: the path of the folder of a data set is needed")
    path = Path(folder)
    if not path.is_dir():
        error = NotADirectoryError if path.exists() else FileNotFoundError
        raise error(f"'{path}' is no folder of a data set")
    path = path.absolute()  # the working folder may change
    digests = read_sums(path)
    index = read_index(path)
    if file_digest(path / INDEX) != digests.get(INDEX):
        raise ChecksumError(
            f"'{path / INDEX}' is damaged: its checksum is not that in {SUMS}; `rfgen dataset repair {path}` makes it "
            "again"
        )
    return RecordingSet(path, index, OpenShards(VerifiedFiles(path, digests)))
