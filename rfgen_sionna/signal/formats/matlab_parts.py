"""What is left of a MATLAB file that was cut off: its description, and where its frames lie.

Version 5 is a header of 128 bytes and elements one after another, each with a tag of kind and length; a matrix holds
all real parts of an array, then all imaginary ones (MathWorks, "MAT-File Level 5 File Format"). Version 7.3 is HDF5,
whose superblock says how long the file was.
"""

from __future__ import annotations

import io
import os
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

_HEADER_5, _MATRIX, _SINGLE = 128, 14, 7
_SUPERBLOCK = b"\x89HDF\r\n\x1a\n"


@dataclass(frozen=True)
class Cut:
    """A file that ends too early."""

    message: str
    """Which bytes are missing."""
    description: str | None = None
    """The variable of that name, if it is whole."""
    frames: int = 0
    """How many frames are whole."""
    parts: tuple[NDArray[np.complex64] | NDArray[np.float32], ...] = ()
    """Frames on the disk (frame, sample, rx, tx, chirp): complex ones, or real and imaginary parts."""

    def frame(self, number: int) -> NDArray[np.complex64]:
        """(sample, rx, tx, chirp)"""
        if len(self.parts) == 1:
            return np.asarray(self.parts[0][number], dtype=np.complex64)
        real, imaginary = (part[number] for part in self.parts)
        return np.asarray(real + 1j * imaginary, dtype=np.complex64)


@dataclass(frozen=True)
class _Element:
    """A variable of a file of version 5."""

    start: int
    stop: int
    name: str | None
    """None where the file ends before it, or the variable is compressed."""
    dims: tuple[int, ...] = ()
    places: tuple[int, ...] = ()
    """Offsets of real and imaginary parts, of single precision."""


def _elements(stream: io.BufferedReader, size: int) -> Iterator[_Element]:
    place = _HEADER_5
    while place < size:
        stream.seek(place)
        tag = stream.read(8)
        if len(tag) < 8:
            yield _Element(place, place + 8, None)
            return
        kind, length = struct.unpack("<II", tag)
        found = _Element(place, place + 8 + length, None)
        if kind == _MATRIX:
            found = _matrix(stream.read(min(length, 512)), found)
        yield found
        place = found.stop


def _matrix(head: bytes, found: _Element) -> _Element:
    """Name, size and places of a matrix, as far as the first bytes after its tag go."""
    at, fields = 0, []
    try:
        for _ in range(3):  # flags, dimensions, name
            kind, length = struct.unpack_from("<II", head, at)
            small = kind >> 16  # up to 4 bytes lie in the tag itself
            body = head[at + 4 : at + 4 + small] if small else head[at + 8 : at + 8 + length]
            if len(body) < (small or length):
                return found
            fields.append(body)
            at += 8 if small else 8 + -(-length // 8) * 8
        dims = tuple(int(number) for number in np.frombuffer(fields[1], "<i4"))
        kind, length = struct.unpack_from("<II", head, at)
    except struct.error:
        return found
    first = found.start + 8 + at + 8
    second = first + -(-length // 8) * 8 + 8
    single = kind == _SINGLE and second + length <= found.stop
    return _Element(found.start, found.stop, fields[2].decode("latin-1"), dims, (first, second) if single else ())


def cut_version_5(path: Path) -> Cut | None:
    """What is left of a file of version 5; None where nothing is missing."""
    size = path.stat().st_size
    if size < _HEADER_5:
        return Cut(f"'{path}' has {size:,} bytes; the header of a MATLAB file alone has {_HEADER_5}")
    description, adc, last, named = None, None, None, True
    with path.open("rb") as stream:
        header = stream.read(_HEADER_5)
        for last in _elements(stream, size):
            named &= last.name is not None  # inside a compressed element nothing is seen
            if last.name == "adc":
                adc = last
            elif last.name == "description" and last.stop <= size:
                stream.seek(last.start)
                description = _text(header + stream.read(last.stop - last.start))
    if last is None:
        return Cut(f"'{path}' has {size:,} bytes: no variable follows the header")
    if last.stop <= size:
        if adc is None and named:
            return Cut(f"'{path}' has {size:,} bytes without the variable 'adc', which followed from byte {size:,} on")
        return None
    missing = last.stop - size
    message = (
        f"'{path}' has {size:,} bytes; {f'variable {last.name!r}' if last.name else 'a variable'} reaches to byte "
        f"{last.stop:,}: {missing:,} bytes are missing, from byte {size:,} on"
    )
    if adc is None or not adc.places or len(adc.dims) < 4:
        return Cut(message, description)
    shape = adc.dims[:4]
    count, frame_size = int(np.prod(adc.dims[4:], dtype=int)), 4 * int(np.prod(shape))
    kept = [max(0, min(size - place, count * frame_size)) // frame_size for place in adc.places]
    message += f"; of {count} frames the real parts of {kept[0]} and the imaginary parts of {kept[1]} are there"
    parts = tuple(
        np.memmap(path, dtype="<f4", mode="r", offset=place, shape=(kept[1], *shape[::-1]))
        for place in (adc.places if kept[1] else ())
    )
    return Cut(message, description, kept[1], parts)


def _text(content: bytes) -> str | None:
    from scipy.io import loadmat

    try:
        return str(np.ravel(loadmat(io.BytesIO(content))["description"])[0])
    except Exception:  # SciPy raises what comes
        return None


class _Padded(io.RawIOBase):
    """A file with zeros after its end, as long as its superblock says: HDF5 opens it then."""

    def __init__(self, path: Path, length: int) -> None:
        self._file, self._length, self._place = path.open("rb"), length, 0

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        self._place = offset + {os.SEEK_SET: 0, os.SEEK_CUR: self._place, os.SEEK_END: self._length}[whence]
        return self._place

    def tell(self) -> int:
        return self._place

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        self._file.seek(self._place)
        count = max(0, min(len(buffer), self._length - self._place))
        content = self._file.read(count).ljust(count, b"\0")
        buffer[:count] = content
        self._place += count
        return count

    def close(self) -> None:
        self._file.close()
        super().close()


def cut_version_7_3(path: Path) -> Cut | None:
    """What is left of a file of version 7.3; None where nothing is missing, or it is no HDF5 of that kind."""
    import h5py

    size = path.stat().st_size
    with path.open("rb") as stream:
        stream.seek(512)
        block = stream.read(48)
    if len(block) < 48:
        return Cut(f"'{path}' has {size:,} bytes; the header of a MATLAB file of version 7.3 alone has {512 + 96}")
    if not block.startswith(_SUPERBLOCK) or block[8] > 1 or block[13] != 8:
        return None
    extra = 4 if block[8] == 1 else 0
    with path.open("rb") as stream:
        stream.seek(512 + 24 + extra)
        base, _, end = struct.unpack("<QQQ", stream.read(24).ljust(24, b"\0"))
    length = end if end >= base else base + end
    if size >= length:
        return None
    message = (
        f"'{path}' has {size:,} bytes; its superblock says {length:,}: {length - size:,} bytes are missing, "
        f"from byte {size:,} on"
    )
    try:
        with _Padded(path, length) as padded, h5py.File(padded, "r") as file:
            description = "".join(chr(letter) for letter in file["description"][:].ravel())
            adc = file["adc"]
            shape, offset = adc.shape, adc.id.get_offset()
    except (OSError, KeyError, RuntimeError, ValueError, TypeError):
        return Cut(message)
    if not description.strip("\0"):
        return Cut(message)
    if offset is None or len(shape) != 5:
        return Cut(message, description)
    frame_size = 8 * int(np.prod(shape[1:]))
    kept = max(0, min((size - offset) // frame_size, shape[0]))
    message += f"; {kept} of {shape[0]} frames are whole"
    parts = (np.memmap(path, dtype="<c8", mode="r", offset=offset, shape=(kept, *shape[1:])),) if kept else ()
    return Cut(message, description, kept, parts)
