"""Packets of a DCA1000, as dumped from its UDP port with their headers.

A packet has a sequence number from 1 (uint32), the number of bytes of data before it (48 bits), both little-endian, and
up to 1,456 bytes of data (TI SPRUIJ4, DCA1000EVM Data Capture Card). Raw files of mmWave Studio 2.0 have the length of
the data (uint32) between the two (e2e.ti.com, thread 811382: a file begins with the words 1, 0, 1456, 0, 0, 0, 0).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.signal.formats.capture import CaptureFormatError
from rfgen_sionna.signal.formats.losses import PACKET
from rfgen_sionna.signal.formats.stream import ByteStream

_SHORT, _LONG = 10, 14  # bytes of a header, without and with the length of the data
_MOST_SKIPPED = 1 << 20  # packets between two that are seen one after the other


@dataclass(frozen=True)
class _Packet:
    sequence: int
    before: int
    """Bytes of data before the packet."""
    length: int
    offset: int
    """First byte of its data in the file."""


def header_size(path: Path) -> int:
    """Bytes of the header of each packet in a dump, 10 or 14; 0 for a file without headers."""
    with path.open("rb") as stream:
        content = np.frombuffer(stream.read(_LONG + PACKET + _LONG), dtype=np.uint8)
    for size in (_SHORT, _LONG):
        if len(content) < size:
            continue
        first = _header(content, 0, size)
        if size == _LONG and not 0 < first.length <= PACKET:
            continue
        step = size + (first.length if size == _LONG else PACKET)
        if len(content) >= step + size:
            second = _header(content, step, size)
            if first.sequence != second.sequence and _follows(first, second):
                return size
        elif first.sequence == 1 and first.before == 0 and len(content) <= step:
            return size
    return 0


def unpack(files: Sequence[Path]) -> ByteStream:
    """Data of the packets in `files`, in the order of their numbers; lost packets are gaps, repeated ones count once.

    Raises
    ------
    CaptureFormatError
        A file without headers, or bytes that are no packet; the message has their place.
    """
    tables = []
    for source, file in enumerate(files):
        size = header_size(file)
        if not size:
            raise CaptureFormatError(
                f"'{file}' has no packet headers, others of the recording have: put one kind into a folder"
            )
        found = _packets(file, size)
        tables.append(np.column_stack([np.full(len(found), source), found]))
    table = np.concatenate(tables)
    table = table[np.argsort(table[:, 2], kind="stable")]
    _, numbers, starts, lengths, _ = table.T
    repeated = 1 + np.flatnonzero(starts[1:] < (starts + lengths)[:-1])
    for packet in repeated:
        first, second = table[packet - 1], table[packet]
        if first[2] != second[2] or _data(files, first) != _data(files, second):
            raise CaptureFormatError(
                f"'{files[second[0]]}', byte {second[4]:,}: packet {numbers[packet]} comes twice, with other data; "
                "these are two recordings: split the file where the numbers begin again"
            )
    sources, _, starts, lengths, offsets = np.delete(table, repeated, axis=0).T
    return ByteStream(tuple(files), sources, offsets, starts, lengths)


def _data(files: Sequence[Path], row: NDArray[np.int64]) -> bytes:
    source, _, _, length, offset = row.tolist()
    with files[source].open("rb") as stream:
        stream.seek(offset)
        return stream.read(length)


def _header(content: NDArray[np.uint8], at: int, size: int) -> _Packet:
    fields = content[at : at + size].tobytes()
    length = int.from_bytes(fields[4:8], "little") if size == _LONG else PACKET
    return _Packet(int.from_bytes(fields[:4], "little"), int.from_bytes(fields[-6:], "little"), length, at + size)


def _follows(packet: _Packet, other: _Packet) -> bool:
    """Whether numbers and byte counts of two packets, in any order, agree with full packets between them."""
    steps = other.sequence - packet.sequence
    return abs(steps) < _MOST_SKIPPED and other.before - packet.before == steps * PACKET


def _packets(path: Path, size: int) -> NDArray[np.int64]:
    """(packet, 4) number, bytes of data before it, length, and first byte in the file, in the order of the file."""
    content = np.memmap(path, dtype=np.uint8, mode="r")
    at, end, found = 0, len(content), []
    while at + size <= end:
        run = _full_packets(content[at:], size)
        if len(run):
            run[:, 3] += at
            found.append(run)
            at = int(run[-1, 3] + run[-1, 2])
        packet = _header(content, at, size)
        after = packet.offset + packet.length
        if size == _SHORT and not (
            0 <= end - after < size or (after + size <= end and _follows(packet, _header(content, after, size)))
        ):
            after = _next(content, packet, size)
        if after > end or (size == _LONG and not 0 < packet.length <= PACKET):
            raise CaptureFormatError(
                f"'{path}', byte {at:,}: no packet of a DCA1000 (number {packet.sequence}, {packet.before:,} bytes "
                f"before it); the dump is damaged or cut there: shorten the file to {at:,} bytes"
            )
        found.append(np.array([[packet.sequence, packet.before, after - packet.offset, packet.offset]]))
        at = after
    if at != end:
        raise CaptureFormatError(f"'{path}' ends within the header of a packet: shorten the file to {at:,} bytes")
    return np.concatenate(found)


def _full_packets(content: NDArray[np.uint8], size: int) -> NDArray[np.int64]:
    """(packet, 4) as in :func:`_packets`: the full packets at the beginning that a header of the same count follows."""
    step = size + PACKET
    count = len(content) // step
    heads = content[: count * step].reshape(count, step)[:, :size].astype(np.int64)
    weights = 256 ** np.arange(6)
    numbers, before = heads[:, :4] @ weights[:4], heads[:, -6:] @ weights
    same = before - before[:1] == (numbers - numbers[:1]) * PACKET
    if size == _LONG:
        same &= heads[:, 4:8] @ weights[:4] == PACKET
    full = count if same.all() else int(np.argmin(same))
    offsets = np.arange(count) * step + size
    return np.column_stack([numbers, before, np.full(count, PACKET), offsets])[: max(full - 1, 0)]


def _next(content: NDArray[np.uint8], packet: _Packet, size: int) -> int:
    """End of a packet that is not full: the header after it counts its bytes; else the file ends with it."""
    number = (packet.sequence + 1).to_bytes(4, "little")
    data = content[packet.offset : packet.offset + PACKET + size].tobytes()
    place = data.find(number)
    while place >= 0:
        if int.from_bytes(data[place + 4 : place + size], "little") == packet.before + place and place + size <= len(
            data
        ):
            return packet.offset + place
        place = data.find(number, place + 1)
    rest = len(content) - packet.offset
    return len(content) if rest <= PACKET else len(content) + 1
