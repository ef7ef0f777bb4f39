"""Files of a capture: names, atomic writes, whole frames or an error on a read."""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rfgen_sionna.signal.formats.capture import CaptureFormatError, CaptureWarning


def data_file(path: str | os.PathLike[str], standard: str) -> Path:
    """`path`, or `standard` inside it where it is a folder or has no suffix."""
    target = Path(path)
    return target / standard if target.is_dir() or not target.suffix else target


def companion(path: Path, suffix: str) -> Path:
    """Path of a data file with another suffix."""
    return path.with_name(path.stem + suffix)


@contextmanager
def atomic_files(paths: Sequence[Path], overwrite: bool) -> Iterator[list[Path]]:
    """Temporary names to write to. They replace `paths` at the end of the block; after an error they are removed.

    Raises
    ------
    FileExistsError
        One of `paths` exists and `overwrite` is false.
    """
    for path in paths:
        if path.exists() and not overwrite:
            raise FileExistsError(f"'{path}' exists: choose another name, or allow overwriting")
    for folder in {path.parent for path in paths}:
        folder.mkdir(parents=True, exist_ok=True)
    parts = [path.with_name(path.name + ".part") for path in paths]
    try:
        yield parts
        for part, path in zip(parts, paths, strict=True):
            os.replace(part, path)
    finally:
        for part in parts:
            part.unlink(missing_ok=True)


def need_file(path: Path) -> Path:
    """`path`, checked to be a file (else FileNotFoundError)."""
    if not path.is_file():
        raise FileNotFoundError(f"capture file '{path}' does not exist")
    return path


def write_json(path: Path, record: dict[str, Any]) -> None:
    path.write_text(json.dumps(record, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")


def read_json(path: Path) -> dict[str, Any]:
    """JSON object in `path`; anything else is a CaptureFormatError."""
    try:
        record = json.loads(path.read_text(encoding="utf-8-sig"))
    except (ValueError, UnicodeDecodeError) as error:
        raise CaptureFormatError(f"'{path}' is not JSON: {error}") from error
    if not isinstance(record, dict):
        raise CaptureFormatError(f"'{path}' holds {type(record).__name__}; a JSON object is needed")
    return record


def warn_or_raise(message: str, partial: bool) -> None:
    """Report a damaged capture: a CaptureWarning where `partial`, else a CaptureFormatError."""
    if not partial:
        raise CaptureFormatError(message + "; partial=True reads the whole frames")
    warnings.warn(message, CaptureWarning, stacklevel=4)


def whole_frames(
    path: Path,
    frame_size: int,
    expected: int | None,
    partial: bool,
    header: int = 0,
    *,
    size: int | None = None,
    filled: int | None = None,
    note: str = "",
) -> int:
    """Number of frames of `frame_size` bytes to read from a file, after a header.

    `size` [bytes] replaces that of the file, `filled` is the size with missing bytes filled in, and `note` is added to
    a message.

    Raises
    ------
    CaptureFormatError
        The file ends within a frame, or does not hold the `expected` frames; with `partial` only where it holds none.
    """
    size = path.stat().st_size if size is None else size
    present, rest = divmod(size - header, frame_size)
    message = ""
    if expected is not None and (missing := header + expected * frame_size - size):
        message = f"'{path}' has {size:,} bytes; {expected} frames of {frame_size:,} bytes are {size + missing:,}: "
        if missing > 0:
            message += f"{missing:,} bytes are missing, from byte {size:,} (frame {present}) on"
        else:
            message += f"{-missing:,} bytes are too many"
    elif rest:
        message = (
            f"'{path}' has {size:,} bytes and ends within frame {present}: "
            f"{rest:,} of its {frame_size:,} bytes are there, {frame_size - rest:,} are missing"
        )
    message += note if message else ""
    if filled is not None:
        present = filled // frame_size
    frames = present if expected is None else min(present, expected)
    if frames == 0:
        raise CaptureFormatError(message or f"'{path}' is empty: one frame has {frame_size:,} bytes")
    if message:
        warn_or_raise(message, partial)
    return frames
