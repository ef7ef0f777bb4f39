"""Checksums of the files of a data set: `SHA256SUMS`, which `sha256sum -c` reads."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path

from rfgen_sionna.dataset.set_index import INDEX, SetIndex, read_index
from rfgen_sionna.dataset.shards import file_digest
from rfgen_sionna.dataset.verified_files import SUMS, ChecksumError, VerifiedFiles, examined
from rfgen_sionna.dataset.whole_files import write_whole

_OWN = "# SHA-256 of the lines above: "
_LINE = re.compile(r"([0-9a-f]{64})  ([^/\\\0\n]+)")
_UNFINISHED = ".building"
_PATTERNS = ("shard-*.h5", "index.sqlite", "recipe.toml", "README.md")


@dataclass(frozen=True)
class Damage:
    """File of a data set that is not as it was written."""

    file: str
    """Name in the folder."""
    reason: str
    recordings: tuple[int, ...] = ()
    """Numbers of the recordings in a shard that are not what the index has."""


def set_files(folder: Path) -> list[Path]:
    """Files of a set that have checksums, in alphabetical order."""
    return sorted(path for pattern in _PATTERNS for path in folder.glob(pattern) if path.is_file())


def file_digests(paths: list[Path]) -> dict[str, str]:
    """SHA-256 of each file by its name; several files at a time."""
    with ThreadPoolExecutor(min(4, os.cpu_count() or 1)) as pool:
        return dict(zip((path.name for path in paths), pool.map(file_digest, paths), strict=True))


def write_sums(folder: Path, known: Mapping[str, str] | None = None) -> dict[str, str]:
    """Write the checksums of all files of a set, whole or not at all, and return them by the names of the files.

    `known` are digests of files that need not be read again. The shards then count as verified on this machine.
    """
    paths, given = set_files(folder), dict(known or {})
    found = file_digests([path for path in paths if path.name not in given])
    digests = {path.name: given.get(path.name) or found[path.name] for path in paths}
    write_whole(folder / SUMS, _text(digests))
    VerifiedFiles(folder, digests).note({name: digest for name, digest in digests.items() if name.endswith(".h5")})
    return digests


def _text(digests: Mapping[str, str]) -> str:
    lines = "".join(f"{digest}  {name}\n" for name, digest in sorted(digests.items()))
    return f"{lines}{_OWN}{hashlib.sha256(lines.encode()).hexdigest()}\n"


def read_sums(folder: Path) -> dict[str, str]:
    """Checksums of a set by the names of the files.

    Raises
    ------
    FileNotFoundError
        If there are none.
    ChecksumError
        If a byte of the file is not as it was written, or it names files that no set has.
    """
    path, cure = folder / SUMS, f"`rfgen dataset repair {folder}` writes it again"
    if not path.is_file():
        cure = f"`rfgen dataset resume {folder}` ends its build" if (folder / _UNFINISHED).is_dir() else cure
        raise FileNotFoundError(f"data set '{folder}' has no {SUMS}: {cure}")
    try:
        text = path.read_bytes().decode()
    except UnicodeDecodeError:
        text = ""
    found = {}
    for line in text.splitlines()[:-1]:
        match = _LINE.fullmatch(line)
        if match is None or not any(fnmatchcase(match[2], pattern) for pattern in _PATTERNS):
            break
        found[match[2]] = match[1]
    if not text or text != _text(found):
        raise ChecksumError(f"'{path}' is damaged: its own checksum differs; {cure}")
    return found


def damaged(folder: Path) -> list[Damage]:
    """Files of a set that are not as they were written, down to one byte, also of the checksums and the index.

    Recordings of damaged shards are compared with the index one by one, in a process of their own.
    """
    found: list[Damage] = []
    index: SetIndex | None = None
    try:
        index = read_index(folder)
    except (ValueError, OSError) as error:
        found.append(Damage(INDEX, str(error)))
    try:
        wanted = read_sums(folder)
    except (ValueError, OSError) as error:
        found.append(Damage(SUMS, str(error)))
        wanted = dict(index.shards) if index else {}
    digests = file_digests(set_files(folder))
    for name in sorted({*wanted, *digests}):
        if name not in digests:
            numbers = tuple(row.number for row in index.rows if row.shard == name) if index else ()
            found.append(Damage(name, "missing", numbers))
        elif name.endswith(".h5"):
            known = wanted.get(name) or (index.shards.get(name) if index else None)
            if known is None:
                found.append(Damage(name, f"not in {SUMS}"))
            elif digests[name] != known:
                found.append(_damaged_shard(folder / name, index))
            elif index and index.shards.get(name) != known and not any(each.file == INDEX for each in found):
                found.append(Damage(INDEX, f"its checksum of {name} is not that in {SUMS}"))
        elif name in wanted and digests[name] != wanted[name] and not any(each.file == name for each in found):
            found.append(Damage(name, f"its checksum is not that in {SUMS}"))
        elif name not in wanted and SUMS not in {each.file for each in found}:
            found.append(Damage(name, f"not in {SUMS}"))
    return found


def _damaged_shard(path: Path, index: SetIndex | None) -> Damage:
    fault, there = examined(path)
    rows = [row for row in index.rows if row.shard == path.name] if index else []
    numbers = tuple(row.number for row in rows if there.get(row.number) != row.digest)
    text = f"; {fault}" if fault else "" if numbers else "; all of its recordings are whole"
    return Damage(path.name, f"its checksum is not that in {SUMS}{text}", numbers)
