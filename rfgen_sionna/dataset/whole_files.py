"""Small text files of a data set, written whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path

from rfgen_sionna.dataset.shards import synced


def write_whole(path: Path, text: str) -> None:
    """Write a text (UTF-8) in place of the file that is there, also through a crash of the machine or a full disk.

    A file with this text is left as it is.
    """
    data = text.encode()
    if path.is_file() and path.read_bytes() == data:
        return
    temporary = path.parent / f".{path.name}.{os.getpid()}.tmp"
    try:
        temporary.write_bytes(data)
        synced(temporary)
        os.replace(temporary, path)
        synced(path.parent)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
