"""Folders of exports, which are there whole or not at all."""

from __future__ import annotations

import csv
import hashlib
import json
import os
import shutil
import string
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rfgen_sionna.dataset.store import OutputError

Progress = Callable[[int, int], None]
"""Function of the number of finished recordings and of all."""
_PLAIN = frozenset(f"{string.ascii_letters}{string.digits}_-")
_LONGEST_NAME = 120
"""Longest name of a file or folder that a text gives [bytes]."""


def file_name(text: str) -> str:
    """Name of a file or folder for a text out of a set, such as an action or a split: a different one for each text.

    Letters A to z, digits, `_`, `-` and inner points stay; other bytes (UTF-8) are written %2F, as in addresses. Texts
    beyond 120 bytes are cut, and end with a digest.
    """
    plain = "".join(
        chr(byte) if chr(byte) in _PLAIN or (byte == ord(".") and place) else f"%{byte:02X}"
        for place, byte in enumerate(text.encode("utf-8", "surrogatepass"))
    )
    if len(plain) > _LONGEST_NAME:
        digest = hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()
        return f"{plain[: _LONGEST_NAME - 18]}%-{digest[:16]}"
    return plain or "%"


def split_folder(split: str) -> str:
    """Name of the folder of a split; "all" for recordings without one."""
    return file_name(split or "all")


@contextmanager
def new_folder(path: str | PathLike[str], overwrite: bool = False) -> Iterator[Path]:
    """Folder to write to, which gets the name `path` when the block ends without an exception.

    Raises
    ------
    OutputError
        If there is something at `path` (without `overwrite`), or its parent does not exist.
    """
    target = Path(path)
    if not target.name:
        raise OutputError(f"output '{target}': the name of a new folder is needed")
    if target.exists() and not overwrite:
        raise OutputError(f"output '{target}' exists; choose another name, or pass overwrite=True (--overwrite)")
    if target.is_file():
        raise OutputError(f"output '{target}' is a file: the name of a folder is needed")
    if not target.parent.is_dir():
        raise OutputError(f"output '{target}': the folder '{target.parent}' does not exist; create it first")
    partial = target.with_name(f".{target.name}.partial")
    try:
        if partial.exists():
            shutil.rmtree(partial)
        partial.mkdir()
        yield partial
        if target.exists():
            shutil.rmtree(target)
        os.replace(partial, target)
    except OSError as error:
        shutil.rmtree(partial, ignore_errors=True)
        raise OutputError(f"output '{target}' cannot be written: {error.strerror or error}") from error
    except BaseException:
        shutil.rmtree(partial, ignore_errors=True)
        raise


def save_array(path: Path, values: ArrayLike) -> None:
    """Write a .npy file, and the folder that it is in; arrays of objects, which would be pickled, are a TypeError."""
    array = np.asarray(values)
    if array.dtype.hasobject:
        raise TypeError(f"'{path.name}' would hold {array.dtype}: an array of numbers is needed")
    path.parent.mkdir(parents=True, exist_ok=True)
    np.save(path, array, allow_pickle=False)


def save_table(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write a CSV file with the keys of the first row as its header."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def save_record(path: Path, record: Mapping[str, Any]) -> None:
    """Write a JSON file."""
    path.write_text(json.dumps(record, indent=2, ensure_ascii=False, default=str) + "\n", encoding="utf-8")
