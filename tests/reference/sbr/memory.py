"""Uniform tubes are as many as their level says: whether there is memory for them is asked before it is taken.

A process that takes more than there is ends without a word.
"""

from __future__ import annotations

import re
from pathlib import Path

TUBE_BYTES = 3000
"""What a tube takes at the peak, whatever it hits: 2.6 kB measured at levels 6 to 9, and some to spare."""
GAIN_BYTES = 180
"""What a path takes for each pair of elements until all paths are put together: 170 B measured in a room."""
_CGROUP = Path("/sys/fs/cgroup")


def check_memory(level: int, needed: int, what: str) -> None:
    """Refuse what takes `needed` bytes; `what` says what that is.

    Raises
    ------
    ValueError
        If so much is not free.
    """
    free = available_memory()
    if free is not None and needed > free:
        raise ValueError(
            f"level is {level}: {what} take {needed / 1e9:.3g} GB of memory, {free / 1e9:.3g} GB are free: a lower "
            "level, fewer bounces or 'adaptive' sampling is needed"
        )


def available_memory() -> int | None:
    """Memory that can still be had [bytes], by this machine or this container; None where the system doesn't tell."""
    found = [1024 * size for size in _sizes(Path("/proc/meminfo"), "MemAvailable:")]
    try:
        most, used = (int((_CGROUP / name).read_text()) for name in ("memory.max", "memory.current"))
    except (OSError, ValueError):  # no container, or one without a limit: "max"
        return min(found, default=None)
    # What files hold is given back before the limit is met.
    return min([*found, most - used + sum(_sizes(_CGROUP / "memory.stat", "inactive_file"))])


def _sizes(path: Path, name: str) -> list[int]:
    """The number after a `name` at the start of a line of a file of the system, if there is one."""
    try:
        return [int(size) for size in re.findall(rf"(?m)^{name}\s+(\d+)", path.read_text())]
    except OSError:
        return []
