"""Memory of this process and of the machine."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path


def resident_memory() -> int:
    """Memory of this process [bytes]; 0 where it is unknown."""
    with suppress(OSError, ValueError, IndexError):
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    return 0


def available_memory() -> int | None:
    """Memory that new processes can have [bytes], also within the limit of a container; None where it is unknown."""
    found: list[int] = []
    with suppress(OSError, ValueError, StopIteration, IndexError):
        line = next(each for each in Path("/proc/meminfo").read_text().splitlines() if each.startswith("MemAvailable"))
        found.append(int(line.split()[1]) * 1024)
    with suppress(OSError, ValueError):
        group = Path("/sys/fs/cgroup")
        found.append(int((group / "memory.max").read_text()) - int((group / "memory.current").read_text()))
    return max(0, min(found)) if found else None
