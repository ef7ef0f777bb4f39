"""Recordings that the folder of a build has: nothing in a shard counts before the shard was compared with its digest.

Damaged shards are taken apart in a process of their own, which they may end.
"""

from __future__ import annotations

import logging
from collections.abc import Collection, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import h5py

from rfgen_sionna.dataset.checksums import read_sums
from rfgen_sionna.dataset.disk_space import DiskSpaceError
from rfgen_sionna.dataset.recording_digest import recording_digest
from rfgen_sionna.dataset.run_file import open_hdf5
from rfgen_sionna.dataset.schema import RECORDINGS, RunFormatError
from rfgen_sionna.dataset.set_index import read_index
from rfgen_sionna.dataset.shards import extract_recording, file_digest, recording_name, shard_recordings
from rfgen_sionna.dataset.verified_files import ChecksumError, VerifiedFiles
from rfgen_sionna.recipes.building_folder import BuildingFolder
from rfgen_sionna.recipes.outcome import Outcome, is_disk_full
from rfgen_sionna.recipes.process_engine import LocalProcesses
from rfgen_sionna.recipes.recording_job import part_name

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class ExtractionJob:
    """Takes whole recordings out of a shard."""

    shard: Path
    folder: Path
    """Folder of the recordings."""
    digests: Mapping[int, str]
    """Digests of recordings by their numbers; those of others are in the shard."""

    def __call__(self, number: int) -> Outcome:
        part = self.folder / part_name(number)
        try:
            extract_recording(self.shard, number, part)
            with h5py.File(part) as file:
                if recording_digest(file) == (self.digests.get(number) or self._stored(number)):
                    return Outcome(number, "made")
            part.unlink()
        except Exception as error:
            part.unlink(missing_ok=True)
            return Outcome(number, "disk full" if is_disk_full(error) else "error", f"{type(error).__name__}: {error}")
        return Outcome(number, "error", "it is damaged")

    def _stored(self, number: int) -> str:
        with open_hdf5(self.shard) as file:
            return str(file[f"{RECORDINGS}/{recording_name(number)}"].attrs["digest"])

    def seed(self, number: int) -> int:
        """Zero: nothing is drawn."""
        return 0


def extract_whole(state: BuildingFolder, shard: Path, numbers: Iterable[int], digests: Mapping[int, str]) -> None:
    """Put the whole ones of the recordings `numbers` of a shard into parts.

    Raises
    ------
    DiskSpaceError
        If the disk is full; the shard is as it was.
    """
    for outcome in LocalProcesses(1).outcomes(ExtractionJob(shard, state.path, digests), sorted(numbers)):
        if outcome.kind == "disk full":
            raise DiskSpaceError(outcome.reason)
        if outcome.kind != "made":
            state.part(outcome.number).unlink(missing_ok=True)


def present_recordings(state: BuildingFolder, failed: Collection[int], verified: Mapping[str, str]) -> set[int]:
    """Numbers of the recordings that are there and whole; shards that lack one, or are damaged, go back into parts.

    Parameters
    ----------
    state
        The locked folder.
    failed
        Recordings that are not to be there.
    verified
        Digests of shards that were compared with them just now.
    """
    noted, sums, digests = state.shard_digests, *_written(state.output)
    done: set[int] = set()
    for index in range(state.shard_count):
        shard, wanted = state.shard(index), set(state.numbers(index)) - set(failed)
        if not shard.is_file():
            continue
        digest = noted.get(shard.name) or verified.get(shard.name) or sums.get(shard.name)
        parts = {number for number in wanted if state.part(number).is_file()}
        if digest is not None and (shard.name in verified or _is_whole(shard, digest, made_here=shard.name in noted)):
            there = recordings_in(shard)
            if wanted <= there:
                for number in there:
                    state.part(number).unlink(missing_ok=True)
                state.note_shard(shard.name, digest)
                done |= wanted
                continue
            for number in there & wanted - parts:
                extract_recording(shard, number, state.part(number))
        else:
            # A shard without a digest is one that a build was ended at, with all of its parts, or lost its digest.
            extract_whole(state, shard, wanted - parts, digests if digest else {})
            lost = sorted(number for number in wanted if not state.part(number).is_file())
            if digest is not None:
                _LOG.warning("'%s' is damaged: %d of its recordings are made again", shard, len(lost))
        shard.unlink()
        state.forget_shard(shard.name)
    return done | set(state.parts)


def _written(folder: Path) -> tuple[dict[str, str], dict[int, str]]:
    """Digests of the shards and of the recordings of a set that was ended, as far as they can be read."""
    sums: dict[str, str] = {}
    digests: dict[int, str] = {}
    with suppress(OSError, ValueError):
        index = read_index(folder)
        sums, digests = dict(index.shards), {row.number: row.digest for row in index.rows}
    with suppress(OSError, ValueError):
        sums |= read_sums(folder)
    return sums, digests


def _is_whole(shard: Path, digest: str, made_here: bool) -> bool:
    """Whether a shard is the one of this digest and, if it may come from elsewhere, ends no process that reads it."""
    if file_digest(shard) != digest:
        return False
    try:
        if not made_here:
            VerifiedFiles(shard.parent, {shard.name: digest}).check(shard.name)
    except ChecksumError:
        return False
    return True


def recordings_in(shard: Path) -> set[int]:
    """Numbers of the recordings in a shard.

    Raises
    ------
    RunFormatError
        If it cannot be read.
    """
    try:
        with open_hdf5(shard) as file:
            return {number for number, _ in shard_recordings(file)}
    except (KeyError, ValueError, RuntimeError, OSError) as error:
        raise RunFormatError(
            f"'{shard}' is damaged ({error}): `rfgen dataset repair {shard.parent}` makes its recordings again"
        ) from error
