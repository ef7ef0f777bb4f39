"""Places of packets that a recording lacks, estimated from its chirps: the same scene again in every loop.

Bytes after a missing packet come 1,456 too early. Where a loop differs from the one before, but agrees with it when
it is taken 1,456 bytes earlier, a packet is missing. Packets begin at multiples of 1,456 bytes of the recording.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.signal.formats.losses import PACKET
from rfgen_sionna.signal.formats.stream import ByteStream

_FIRST = 64  # loops for the usual difference of two loops
_SIMILAR = 0.5
"""Largest usual difference of two loops, in shares of that of independent noise, at which a break stands out."""
_BREAK = 3.0  # usual differences of a loop to be looked at
_GAIN = 0.5  # share of the difference that a break may leave
_ROUNDING = 1e-3  # usual difference of noise-free loops [LSB²]
_MOST_PACKETS = 64  # of one break
_MOST_SEARCHES = 200  # loops that differ without a break: in a scene of fast motion there are many


def find_breaks(stream: ByteStream, loop_size: int, missing: int) -> list[tuple[int, int]] | None:
    """Place [bytes, of the complete recording] and number of packets of each break, `missing` packets at most.

    None: successive loops differ as noise does, and show nothing. An empty list: no break, so that the end is missing,
    or the start.
    """
    words = loop_size // 2
    total = stream.size // loop_size
    if total < 3:
        return None

    def span(loop: int, lost: int, loops: int) -> NDArray[np.float32]:
        start = loop * loop_size - lost
        count = max(0, min(loops * loop_size, stream.size - start))
        return stream.read(start, count - count % 2).view("<i2").astype(np.float32)

    first = [span(loop, 0, 1) for loop in range(min(total, _FIRST))]
    usual = float(np.median([np.mean((b - a) ** 2) for a, b in pairwise(first)]))
    power = float(np.median([np.mean(a**2) for a in first]))
    if usual > _SIMILAR * 2.0 * power:
        return None
    found: list[tuple[int, int]] = []
    loop, lost, left, before = 1, 0, missing, first[0]
    older: NDArray[np.float32] | None = None  # the loop before `before`, where it is whole
    searches, threshold = 0, _BREAK * max(usual, _ROUNDING)
    if np.mean((first[1] - first[0]) ** 2) > threshold:
        # A break in the first two loops: later ones are shifted, but agree with each other.
        grid = range(0, 2 * words, PACKET // 2)
        place, packets = _best_break(span, 0, 0, lambda packets: span(2, packets * PACKET, 1), grid, left)
        if packets:
            found, lost, left = [(2 * place, packets)], packets * PACKET, left - packets
            loop = -(-(2 * place + lost) // loop_size)
            loop, before = loop + 1, span(loop, lost, 1)
    while left and (loop + 1) * loop_size - lost <= stream.size:
        now = span(loop, lost, 1)
        if np.mean((now - before) ** 2) <= threshold:
            loop, older, before = loop + 1, before, now
            continue
        # A break near the end of a loop shows only in the next one.
        base, model = (loop, before) if older is None else (loop - 1, older)
        places = range(-base * loop_size % PACKET // 2, (loop - base + 1) * words, PACKET // 2)
        place, packets = _best_break(span, base, lost, model, places, left)
        if not packets and searches == _MOST_SEARCHES:
            return found or None
        if not packets:
            searches += 1
            loop, older, before = loop + 1, before, now  # something moved
            continue
        position = base * loop_size + 2 * place
        found.append((position, packets))
        lost, left = lost + packets * PACKET, left - packets
        loop, older, before = -(-(position + packets * PACKET) // loop_size), None, model
    return found


def _best_break(
    span: Callable[[int, int, int], NDArray[np.float32]],
    loop: int,
    lost: int,
    model: Callable[[int], NDArray[np.float32]] | NDArray[np.float32],
    places: range,
    most: int,
) -> tuple[int, int]:
    """Place [words after the start of `loop`] and packets of the break that leaves the least difference to `model`,
    a loop without a break or a function of the missing packets that gives one; (0, 0) if none explains half of it."""
    best, plain = (np.inf, 0, 0), np.inf
    for packets in range(1, min(most, _MOST_PACKETS) + 1):
        whole, alike = (model(packets), model(0)) if callable(model) else (model, model)
        words = len(whole)
        loops = 3 + -(-packets * PACKET // (2 * words))
        kept, moved = span(loop, lost, loops), span(loop, lost + packets * PACKET, loops)
        if packets == 1:
            plain = float(np.mean((kept - np.tile(alike, loops)[: len(kept)]) ** 2))
        tiled = np.tile(whole, loops)
        unbroken = (kept - tiled[: len(kept)]) ** 2
        broken = (moved - tiled[: len(moved)]) ** 2
        heads = np.concatenate([[0.0], np.cumsum(unbroken, dtype=np.float64)])
        tails = np.concatenate([np.cumsum(broken[::-1], dtype=np.float64)[::-1], [0.0]])
        for place in places:
            after = place + packets * PACKET // 2
            if place < len(heads) and after < len(moved):
                error = float(heads[place] + tails[after]) / (place + len(moved) - after)
                best = min(best, (error, place, packets))
    return best[1:] if best[0] <= _GAIN * plain else (0, 0)
