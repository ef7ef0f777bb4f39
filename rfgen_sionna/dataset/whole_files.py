"""Files that are there whole or not at all, also after a crash of the machine or on a full disk."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def whole_file(target: Path) -> Iterator[Path]:
    """Path beside `target` to write to; its file takes the name `target` when the block ends without an exception."""
    temporary = target.with_name(f".{target.name}.{os.getpid()}.tmp")
    try:
        temporary.unlink(missing_ok=True)
        yield temporary
        synced(temporary)
        os.replace(temporary, target)
        with suppress(OSError):  # a file system whose folders cannot be waited for
            synced(target.parent)
    finally:
        temporary.unlink(missing_ok=True)


def write_whole(path: Path, text: str) -> None:
    """Write a text (UTF-8) in place of the file that is there; a file with this text is left as it is."""
    data = text.encode()
    if path.is_file() and path.read_bytes() == data:
        return
    with whole_file(path) as temporary:
        temporary.write_bytes(data)


def synced(path: Path) -> None:
    """Wait until the file or folder is on the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
