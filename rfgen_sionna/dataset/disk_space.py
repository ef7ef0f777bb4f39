"""Sizes of runs on the disk."""

from __future__ import annotations

import math
import shutil
from pathlib import Path

import numpy as np

from rfgen_sionna.radar import Radar


class DiskSpaceError(ValueError):
    """A file that its disk has no room for."""


def frame_bytes(radar: Radar, pir_resolution: tuple[int, int] | None = None) -> int:
    """Size of the samples and the image of one frame in a file [bytes]."""
    return np.dtype(radar.sample_type).itemsize * math.prod(radar.frame_shape) + image_bytes(pir_resolution)


def image_bytes(pir_resolution: tuple[int, int] | None) -> int:
    """Size of the image of one frame in a file [bytes]; 0 for None."""
    return 0 if pir_resolution is None else 12 * math.prod(pir_resolution)


def check_free(target: Path, needed: int) -> None:
    """DiskSpaceError if the disk of the file `target` has less than `needed` bytes free."""
    free = shutil.disk_usage(target.parent).free
    if needed > free:
        raise DiskSpaceError(
            f"output '{target}' takes {bytes_text(needed)}, and '{target.parent}' has {bytes_text(free)} free: take a "
            "shorter duration, or another folder"
        )


def bytes_text(count: float) -> str:
    """A size in words, "3.51 MB"."""
    power = min(int(math.log10(max(count, 1.0)) // 3), 5)
    return f"{count / 1000.0**power:.3g} {('B', 'kB', 'MB', 'GB', 'TB', 'PB')[power]}"
