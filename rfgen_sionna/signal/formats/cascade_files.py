"""Locations of the frames of a cascade capture, from the indices and data files of its devices."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rfgen_sionna.signal.formats.capture import CaptureFormatError
from rfgen_sionna.signal.formats.files import warn_or_raise

DEVICES = ("master", "slave1", "slave2", "slave3")
DATA_NAME = re.compile(r"(master|slave[123])_(\d{4})_(data|idx)\.bin")

HEADER = np.dtype([("tag", "<u4"), ("version", "<u4"), ("flags", "<u4"), ("frames", "<u4"), ("size", "<u8")])
_FIELDS = {"tag": "<u2", "version": "<u2", "flags": "<u4", "width": "<u2", "height": "<u2", "pitch": "4<u4"}
ENTRY = np.dtype([*_FIELDS.items(), ("size", "<u4"), ("time", "<u8"), ("offset", "<u8")])
FILE_TAG = 0x746B6362  # first word of a header
FRAME_TAG = 0x6469  # first word of an entry, the bytes "id"
_FORMER_TAG = 0x6964  # in older files of this package, whose width is the number of samples
WORDS_PER_SAMPLE = 8  # I and Q of 4 receivers


@dataclass(frozen=True)
class FrameLocation:
    """One frame of one device."""

    file: Path
    offset: int
    stamp: int | None
    """Time stamp of the index; None without an index."""


@dataclass(frozen=True)
class Frames:
    """Shape of a frame in the index."""

    samples: int
    """Of a chirp."""
    height: int
    """Chirps of a frame, all slots."""
    size: int
    """[bytes] of one device."""

    def fits(self, entry: Any) -> bool:
        """Whether an entry of an index has this shape."""
        found = (int(entry["width"]), int(entry["height"]), int(entry["size"]))
        return is_entry(entry) and found == (self.width(entry), self.height, self.size)

    def width(self, entry: Any) -> int:
        """Width of an entry of this shape: words of a chirp and device, in older files of this package its samples."""
        return self.samples if int(entry["tag"]) == _FORMER_TAG else self.samples * WORDS_PER_SAMPLE


def is_entry(entry: Any) -> bool:
    """Whether the first word is that of an entry."""
    return int(entry["tag"]) in (FRAME_TAG, _FORMER_TAG)


@dataclass(frozen=True)
class _Index:
    """Entries of one index, None for a damaged entry; `damaged` also where entries are missing."""

    entries: tuple[Any, ...] = ()
    damaged: bool = True


def find_frames(folder: Path, shape: Frames, partial: bool) -> tuple[dict[str, dict[int, FrameLocation]], int]:
    """Frames of each device by their number in the capture, and the number of frames in all.

    The indices of the other devices, which are synchronous, replace a missing or damaged index.

    Raises
    ------
    CaptureFormatError, FileNotFoundError
        A file is missing or contradicts the others; with `partial` only where no frame is left.
    """
    files: dict[str, dict[int, Path]] = {name: {} for name in DEVICES}
    for path in sorted(folder.glob("*_data.bin")):
        if match := DATA_NAME.fullmatch(path.name):
            files[match[1]][int(match[2])] = path
    for name in DEVICES:
        if not files[name]:
            message = f"capture file '{folder / f'{name}_0000_data.bin'}' does not exist"
            if not partial or not any(files.values()):
                raise FileNotFoundError(message)
            warn_or_raise(f"{message}: the receivers of {name} are left out", partial)
    groups = sorted({number for own in files.values() for number in own})
    if absent := sorted(set(range(groups[-1])) - set(groups)):
        warn_or_raise(f"capture files '{folder / f'*_{absent[0]:04d}_data.bin'}' do not exist", partial)
    contents = []
    for group in groups:
        present = {name: own[group] for name, own in files.items() if group in own}
        indices = {name: _index(folder, name, group, shape, partial, name in present) for name in DEVICES}
        count = max(len(index.entries) for index in indices.values())
        if not count:
            count = max(path.stat().st_size // shape.size for path in present.values())
            if count:
                warn_or_raise(f"'{folder}': file {group} has no index that counts its frames", partial)
        contents.append((group, present, indices, count))
    full = max(count for *_, count in contents)
    found: dict[str, dict[int, FrameLocation]] = {name: {} for name in DEVICES}
    total = 0
    for (group, present, indices, count), before in zip(contents, [-1, *groups], strict=False):
        total += full * (group - before - 1)  # the host fills a file before it begins the next
        for name, path in present.items():
            own = indices[name]
            known = [own.entries]
            if own.damaged:
                known += [index.entries for other, index in indices.items() if other != name]
            for number, place in _whole(path, known, count, shape, partial):
                found[name][total + number] = place
        total += count
    return found, total


def _index(folder: Path, name: str, group: int, shape: Frames, partial: bool, needed: bool) -> _Index:
    """Readable entries of one index."""
    path = folder / f"{name}_{group:04d}_idx.bin"
    if not path.is_file():
        master = path.with_name(f"master_{group:04d}_idx.bin")
        if needed and not master.is_file():  # often only the master's index is kept
            if not partial:
                raise FileNotFoundError(f"capture file '{path}' does not exist")
            warn_or_raise(f"capture file '{path}' does not exist", partial)
        return _Index()
    content = path.read_bytes()
    if len(content) < HEADER.itemsize:
        warn_or_raise(f"'{path}' has {len(content)} bytes; its header alone has {HEADER.itemsize}", partial)
        return _Index()
    header = np.frombuffer(content, dtype=HEADER, count=1)[0]
    if header["tag"] != FILE_TAG:
        warn_or_raise(f"'{path}' begins with 0x{header['tag']:08x}; an index begins with 0x{FILE_TAG:08x}", partial)
    present = (len(content) - HEADER.itemsize) // ENTRY.itemsize
    declared = int(header["frames"])
    wanted = HEADER.itemsize + declared * ENTRY.itemsize
    if len(content) != wanted:
        warn_or_raise(
            f"'{path}' has {len(content):,} bytes; a header and {declared} entries are {wanted:,}: "
            f"{abs(wanted - len(content)):,} bytes are {'missing' if len(content) < wanted else 'too many'}",
            partial,
        )
    entries = np.frombuffer(content, dtype=ENTRY, count=present, offset=HEADER.itemsize)
    if header["tag"] == FILE_TAG:
        entries = entries[:declared]
    for number, entry in enumerate(entries):
        device = int(entry["flags"]) >> 8
        if is_entry(entry) and 0 < device < len(DEVICES) and DEVICES[device] != name:
            warn_or_raise(
                f"'{path}', frame {number}: flags 0x{entry['flags']:x} are those of {DEVICES[device]}: a file was "
                "renamed, or belongs to another recording",
                partial,
            )
            break
    usable: list[Any] = []
    for number, entry in enumerate(entries):
        usable.append(entry if shape.fits(entry) else None)
        if usable[-1] is None:
            warn_or_raise(_damage(path, number, entry, shape), partial)
    if len(usable) and not any(entry is not None for entry in usable) and all(map(is_entry, entries)):
        # Frames of another shape, not damage.
        raise CaptureFormatError(_damage(path, 0, entries[0], shape))
    return _Index(tuple(usable), damaged=len(content) != wanted or any(entry is None for entry in usable))


def _damage(path: Path, number: int, entry: Any, shape: Frames) -> str:
    if not is_entry(entry):
        return f"'{path}', frame {number}: tag 0x{entry['tag']:04x}; 0x{FRAME_TAG:04x} is needed"
    return (
        f"'{path}', frame {number}: width {entry['width']} (samples × 4 Rx × I and Q), height {entry['height']} "
        f"(chirps × loops), {entry['size']} bytes; the radar's frames have {shape.width(entry)}, {shape.height}, "
        f"{shape.size} bytes"
    )


def _whole(
    data: Path, indices: list[tuple[Any, ...]], count: int, shape: Frames, partial: bool
) -> Iterator[tuple[int, FrameLocation]]:
    """Number and location of the whole frames of one data file, each by the first index that has it."""
    size, unknown = data.stat().st_size, not any(indices)
    for number in range(count):
        entry = next((known[number] for known in indices if number < len(known) and known[number] is not None), None)
        if entry is None and not unknown:
            continue
        offset = number * shape.size if entry is None else int(entry["offset"])
        if offset + shape.size > size:
            warn_or_raise(
                f"'{data}' has {size:,} bytes; frame {number} is at {offset:,} … {offset + shape.size:,}: "
                f"{offset + shape.size - max(size, offset):,} of its {shape.size:,} bytes are missing, "
                f"and {count - number - 1} frames after it",
                partial,
            )
            return
        yield number, FrameLocation(data, offset, None if entry is None else int(entry["time"]))
