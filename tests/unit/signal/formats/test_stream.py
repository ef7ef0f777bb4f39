"""A recording in several files, with gaps, reads as the bytes put together by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rfgen_sionna.signal.formats import udp
from rfgen_sionna.signal.formats.stream import ByteStream
from tests.unit.signal.formats.test_losses import PACKET, dump


@settings(max_examples=40, deadline=None)
@given(data=st.data())
def test_files_and_gaps_read_as_their_bytes(tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    folder = tmp_path_factory.mktemp("stream")
    pieces = data.draw(st.lists(st.binary(min_size=1, max_size=40), min_size=1, max_size=4))
    files = []
    for number, piece in enumerate(pieces):
        files.append(folder / f"{number}")
        files[-1].write_bytes(piece)
    stream, wanted = ByteStream.of(files), b"".join(pieces)
    for _ in range(data.draw(st.integers(0, 3))):
        place, count = data.draw(st.integers(0, len(wanted))), data.draw(st.integers(1, 10))
        stream = stream.with_gap(place, count)
        wanted = wanted[:place] + (bytes(count) if place < len(wanted) else b"") + wanted[place:]
    assert stream.size == len(wanted)
    start, count = data.draw(st.integers(-5, len(wanted))), data.draw(st.integers(0, len(wanted) + 5))
    padded = bytes(5) + wanted + bytes(len(wanted) + 20)
    assert stream.read(start, count).tobytes() == padded[start + 5 : start + 5 + count]


@pytest.mark.parametrize("long", [False, True])
def test_packets_in_arrays_are_those_one_by_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, long: bool) -> None:
    rng = np.random.default_rng(0)
    content = rng.integers(0, 256, 60 * PACKET + 100, dtype=np.uint8).tobytes()
    order = [*range(20), *range(25, 40), 42, 41, 43, 43, *range(44, 61)]
    path = tmp_path / "dump.bin"
    path.write_bytes(dump(content, order, long))
    fast = udp.unpack([path])
    monkeypatch.setattr(udp, "_full_packets", lambda content, size: np.empty((0, 4), dtype=np.int64))
    slow = udp.unpack([path])
    for name in ("sources", "offsets", "starts", "lengths"):
        np.testing.assert_array_equal(getattr(fast, name), getattr(slow, name))
    assert fast.gaps == [(20 * PACKET, 5 * PACKET), (40 * PACKET, PACKET)]
