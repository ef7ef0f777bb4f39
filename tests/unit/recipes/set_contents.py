"""Files of a set that tests compare, copy and damage."""

from __future__ import annotations

from pathlib import Path


def contents(folder: Path) -> dict[str, bytes]:
    """All files of a set."""
    return {path.name: path.read_bytes() for path in folder.iterdir() if not path.name.startswith(".")}


def copy_of(folder: Path, target: Path) -> Path:
    target.mkdir()
    for path in folder.iterdir():
        (target / path.name).write_bytes(path.read_bytes())
    return target


def sums(folder: Path) -> str:
    return (folder / "SHA256SUMS").read_text()


def flipped(path: Path, place: int) -> None:
    """Change one bit of a file."""
    data = bytearray(path.read_bytes())
    data[place % len(data)] ^= 4
    path.write_bytes(data)
