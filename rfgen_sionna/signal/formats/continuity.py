"""Places of packets that a recording lacks, estimated from its chirps: the same scene again in every loop.

Bytes after a missing packet come 1,456 too early. Where a loop differs from the one before more than loops usually do,
but not when what follows some byte is taken 1,456 bytes earlier, a packet is missing before that byte. Packets begin at
multiples of 1,456 bytes of the recording.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.signal.formats.losses import PACKET
from rfgen_sionna.signal.formats.stream import ByteStream

_WORDS = PACKET // 2  # of a packet
_RECENT = 64  # differences of successive loops that give the usual one
_DEVIATIONS = 8.0  # standard deviations from the usual difference to a break
_LEAST_DEVIATION = 0.02  # of a difference, in shares of the usual one
_ROUNDING = 1e-3  # usual difference of noise-free loops [LSB²]
_MOST_PACKETS = 64  # of one break
_MOST_HIDDEN = 16  # packets up to which each number must stand out
_MOST_SEARCHES = 200  # loops that differ without a break: in a scene of fast motion there are many

Words = NDArray[np.float32]


class _TypicalDifference:
    """Running median of the mean square difference of successive loops, with its deviation."""

    def __init__(self, first: list[float]) -> None:
        self.recent = deque(first, maxlen=_RECENT)

    @property
    def margin(self) -> float:
        """Distance from the median to a break [LSB²]; infinite without any differences."""
        if not self.recent:
            return np.inf
        usual = max(float(np.median(self.recent)), _ROUNDING)
        deviation = 1.4826 * float(np.median(np.abs(np.asarray(self.recent) - usual)))
        return _DEVIATIONS * max(deviation, _LEAST_DEVIATION * usual)

    @property
    def limit(self) -> float:
        """Largest difference without a break [LSB²]."""
        return self.margin + (float(np.median(self.recent)) if self.recent else 0.0)


def find_breaks(stream: ByteStream, loop_size: int, loops_per_frame: int, missing: int) -> list[tuple[int, int]] | None:
    """Place [bytes, of the complete recording] and number of packets of each break, `missing` packets at most.

    None: a break would not stand out of the differences of successive loops (noise, fast motion). An empty list: no
    break is seen; the end of the recording is missing, or packets at its start or between two frames.
    """
    words, total = loop_size // 2, stream.size // loop_size
    if total < 4:
        return None

    def span(loop: int, lost: int, loops: int = 1) -> Words:
        start = loop * loop_size - lost
        count = max(0, min(loops * loop_size, stream.size - start))
        return stream.read(start, count - count % 2).view("<i2").astype(np.float32)

    first = [span(loop, 0) for loop in range(min(total, 2 * _RECENT))]
    steps = [(loop % loops_per_frame == 0, _difference(first[loop - 1], first[loop])) for loop in range(1, len(first))]
    kinds = {border: _TypicalDifference([step for kind, step in steps if kind == border]) for border in (False, True)}
    inside = kinds[loops_per_frame == 1]

    def is_hidden(packets: int) -> bool:
        """Whether a loop that is taken so many packets too early differs hardly more than usual, somewhere."""
        loops = np.unique(np.linspace(1, total - 1, _RECENT).astype(int))
        moved = [_difference(span(loop - 1, 0), span(loop, packets * PACKET)) for loop in loops.tolist()]
        return float(np.quantile(moved, 0.05)) <= inside.limit

    if any(map(is_hidden, range(1, min(missing, _MOST_HIDDEN) + 1))):
        return None
    found: list[tuple[int, int]] = []
    loop, lost, left, searches = 1, 0, missing, 0
    before = first[0]
    while left and (loop + 1) * loop_size - lost <= stream.size:
        now, kind = span(loop, lost), kinds[loop % loops_per_frame == 0]
        step = _difference(before, now)
        if step <= kind.limit:
            kind.recent.append(step)
            loop, before = loop + 1, now
            continue
        # A break near the end of a loop shows only in the next one.
        base = max(0, loop - 2)
        place, packets = _best_break(span, base, loop, lost, left, words, loops_per_frame, inside)
        if packets:
            position = base * loop_size + 2 * place
            found.append((position, packets))
            lost, left = lost + packets * PACKET, left - packets
            loop = -(-(position + packets * PACKET) // loop_size)
            now = span(loop, lost)
        elif (searches := searches + 1) > _MOST_SEARCHES:
            return found or None
        loop, before = loop + 1, now
    return found


def _difference(before: Words, after: Words) -> float:
    """Mean square difference [LSB²]."""
    return float(np.mean((after - before[: len(after)]) ** 2))


def _best_break(
    span: Callable[[int, int, int], Words],
    base: int,
    loop: int,
    lost: int,
    left: int,
    words: int,
    loops_per_frame: int,
    usual: _TypicalDifference,
) -> tuple[int, int]:
    """Place [words after the start of loop `base`] and number of packets of the break in `loop` or the loop before it
    that leaves the least difference between successive loops; (0, 0) if none leaves a usual one."""
    best, plain, pairs = (np.inf, 0, 0), np.inf, 0
    start = max(0, loop - 1 - base) * words
    grid = range(start + (-base * words - start) % _WORDS, (loop + 1 - base) * words, _WORDS)
    for packets in range(1, min(left, _MOST_PACKETS) + 1):
        gap = packets * _WORDS
        loops = loop - base + 3 + -(-gap // words)
        kept, moved = span(base, lost, loops), span(base, lost + packets * PACKET, loops)
        borders = [(base + row) % loops_per_frame == 0 and loops_per_frame > 1 for row in range(loops)]
        if packets == 1:
            plain, pairs = _roughness(kept, words, 0, 0, borders), len(kept) // words - 1 - sum(borders[1:])
        for place in grid:
            # At the end of a frame, the next one in the place of a shifted loop's end looks like a break.
            rest = -(base * words + place + gap) % (loops_per_frame * words)
            if place + gap < len(moved) and rest >= gap:
                whole = np.concatenate([kept[:place], moved[place:]])
                best = min(best, (_roughness(whole, words, place, gap, borders), place, packets))
    # At least one loop must become as loops usually are.
    return best[1:] if best[0] <= usual.limit and (plain - best[0]) * pairs >= usual.margin else (0, 0)


def _roughness(content: Words, words: int, place: int, gap: int, borders: list[bool]) -> float:
    """Mean square difference of successive loops within frames, without `gap` words from `place` on: there the loop
    before counts on, and differences from it by the square of the number of loops between, as in a steady motion."""
    total, count = 0.0, 0
    last: Words | None = None
    steps = np.ones(words, np.float32)
    for row in range(len(content) // words):
        now = content[row * words : (row + 1) * words].copy()
        low, high = (min(max(edge - row * words, 0), words) for edge in (place, place + gap))
        if last is not None and not borders[row]:
            squares = ((now - last) / steps) ** 2
            squares[low:high] = np.nan
            total += float(np.nansum(squares))
            count += int(np.count_nonzero(~np.isnan(squares)))
        now[low:high] = np.nan if last is None else last[low:high]
        steps[:low], steps[low:high], steps[high:] = 1, steps[low:high] + 1, 1
        last = now
    return total / count if count else np.inf
