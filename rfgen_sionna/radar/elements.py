"""Positions of a radar's elements."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from rfgen_sionna._types import FloatArray

_LARGEST = 10.0
"""How far an element may lie from the centre [m]."""


def checked_elements(end: str, positions: ArrayLike, names: Sequence[str]) -> FloatArray:
    """A read-only copy of the positions (element, 3) [m] of the "tx" or "rx" elements, each with a name of its own.

    Raises
    ------
    ValueError
        Naming the field, its value and what is allowed.
    """
    field = f"radar.{end}_positions"
    array = np.array(positions, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] != 3 or len(array) == 0 or not np.all(np.isfinite(array)):
        raise ValueError(f"{field} has shape {array.shape}: finite (element, 3) positions [m] are needed")
    if np.abs(array).max() > _LARGEST:
        raise ValueError(f"{field} reaches {np.abs(array).max():g} m: elements lie within {_LARGEST:g} m of the centre")
    gaps = np.linalg.norm(array[:, None] - array[None], axis=-1) + np.eye(len(array))
    if gaps.min() < 1e-6:
        i, j = np.argwhere(gaps < 1e-6)[0]
        raise ValueError(f"{field}: elements {i} and {j} are at the same place {array[i].tolist()} m")
    if len(names) != len(array) or len(set(names)) != len(names):
        raise ValueError(f"radar.{end}_names is {tuple(names)!r}: a different name for each of {len(array)} elements")
    array.setflags(write=False)
    return array
