"""Pictures of levels with a bounded number of cells, for viewers."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib import colormaps
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray

MOST_PIXELS = 144
"""Rows, and columns, of a picture; cells beyond are joined to their maximum."""
MOST_COLUMNS = 1024
"""Columns of a picture over the time of a whole run."""
NOTHING = 255
"""Byte of a cell without a level."""
_GREY = (217, 222, 227)
"""Red, green and blue of such a cell."""


def reduced(level: FloatArray, most_columns: int = MOST_PIXELS) -> FloatArray:
    """Picture of at most :data:`MOST_PIXELS` rows and `most_columns`, each cell the maximum of those it joins."""
    for axis, most in enumerate((MOST_PIXELS, most_columns)):
        step = -(-level.shape[axis] // most)
        level = np.maximum.reduceat(level, np.arange(0, level.shape[axis], step), axis=axis)
    return level


def even_columns(time: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Evenly spaced times, and of each the nearest of the `values` (time, ...), where there are pauses between them."""
    if len(time) < 3:
        return time, values
    step = float(np.diff(time).min())
    count = min(round((time[-1] - time[0]) / step) + 1, 4 * MOST_COLUMNS)
    if count == len(time):
        return time, values
    even = np.linspace(time[0], time[-1], count)
    after = np.searchsorted(time, even).clip(1, len(time) - 1)
    nearest = np.where(even - time[after - 1] <= time[after] - even, after - 1, after)
    return even, values[nearest]


def cell_span(values: FloatArray, most: int = MOST_PIXELS, alone: float = 1.0) -> list[float]:
    """First and last border of the cells of an axis after :func:`reduced`; a single cell is `alone` wide."""
    cell = float(np.mean(np.diff(values))) if len(values) > 1 else alone
    step = -(-len(values) // most)
    first = float(values[0]) - cell / 2
    return [first, first + cell * step * -(-len(values) // step)]


def level_bytes(image: FloatArray, low: float, high: float) -> NDArray[np.uint8]:
    """Levels as 0 … 254 between the limits; :data:`NOTHING` where there is none."""
    part = (image - low) / (high - low) * 254
    return np.where(np.isnan(part), NOTHING, np.nan_to_num(part, nan=0.0).clip(0, 254).round()).astype(np.uint8)


def coloured(levels: NDArray[np.uint8], colour_map: str) -> NDArray[np.uint8]:
    """(..., 3) red, green and blue of levels (...)."""
    table: NDArray[Any] = np.empty((256, 3), np.uint8)
    table[:NOTHING] = (colormaps[colour_map](np.linspace(0, 1, NOTHING))[:, :3] * 255).round()
    table[NOTHING] = _GREY
    return np.asarray(table[levels])
