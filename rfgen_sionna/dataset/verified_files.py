"""Files of a data set that were compared with their checksums and read once, in a process of their own."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from rfgen_sionna.dataset import recording_digest
from rfgen_sionna.dataset.shards import file_digest
from rfgen_sionna.dataset.whole_files import write_whole

SUMS = "SHA256SUMS"
"""Name of the file of checksums in the folder of a set."""


class ChecksumError(ValueError):
    """A file of a data set is not the one that was written."""


class VerifiedFiles:
    """Files of a set that were compared with their checksums and examined, on this machine.

    Each is known again by its size, times and number in the file system: in memory and, where the folder can be
    written, in the file `.verified`.
    """

    def __init__(self, folder: Path, digests: Mapping[str, str]) -> None:
        self.folder, self.digests = folder, dict(digests)
        self._marks: dict[str, list[int | str]] = {}

    def check(self, name: str) -> None:
        """Compare the shard `name` with its checksum and read it in a process of its own, unless that was done.

        Raises
        ------
        ChecksumError
            If it is another file, or cannot be read; the message names the cure.
        """
        path, digest = self.folder / name, self.digests.get(name)
        cure = f"`rfgen dataset repair {self.folder}` makes its recordings again"
        if digest is None:
            raise ChecksumError(f"'{path}' is not in {SUMS}; {cure}")
        if not path.is_file():
            raise ChecksumError(f"'{path}' is missing; {cure}")
        mark = _mark(path, digest)
        if mark in (self._marks.get(name), self._kept().get(name)):
            self._marks[name] = mark
            return
        if file_digest(path) != digest:
            raise ChecksumError(f"'{path}' is damaged: its checksum is not that in {SUMS}; {cure}")
        if fault := examined(path)[0]:
            raise ChecksumError(f"'{path}' cannot be read, with the checksum of {SUMS} ({fault}): take no such file")
        self.note({name: digest})

    def note(self, digests: Mapping[str, str]) -> None:
        """Take the files with these digests as verified."""
        self._marks |= {name: _mark(self.folder / name, digest) for name, digest in digests.items()}
        with suppress(OSError):  # a folder that cannot be written
            write_whole(self.folder / ".verified", json.dumps(self._kept() | self._marks))

    def _kept(self) -> dict[str, list[int | str]]:
        try:
            found = json.loads((self.folder / ".verified").read_bytes())
        except (OSError, ValueError, RecursionError):
            return {}
        return found if isinstance(found, dict) else {}


def _mark(path: Path, digest: str) -> list[int | str]:
    # Nobody sets the time of a change of the inode: a mark that came with the files is none.
    found = path.stat()
    return [digest, found.st_size, found.st_mtime_ns, found.st_ctime_ns, found.st_ino]


def examined(path: Path, seconds: float = 600.0) -> tuple[str, dict[int, str]]:
    """Read all of a shard in a process of its own, which a damaged file may end.

    Returns the fault, empty without one, and the digest of each recording that can be read, by its number.
    """
    command = [sys.executable, "-P", recording_digest.__file__, str(path)]
    try:
        done = subprocess.run(command, capture_output=True, timeout=seconds, check=False)
    except subprocess.TimeoutExpired:
        return f"not read in {seconds:.0f} s", {}
    digests = {}
    for line in done.stdout.decode(errors="replace").splitlines():
        number, _, digest = line.partition(" ")
        if number.isdigit() and digest:
            digests[int(number)] = digest
    if done.returncode == 0:
        return "", digests
    lines = done.stderr.decode(errors="replace").strip().splitlines() or ["no reason"]
    first = next((line for line in lines if line.startswith("recording ")), lines[-1])
    return (f"signal {-done.returncode}" if done.returncode < 0 else first)[:300], digests
