"""Largest number of surfaces on a path."""

from __future__ import annotations

import numpy as np

MOST_BOUNCES = 3
"""Surfaces on the longest paths that are traced: wall, body, wall."""


def check_max_bounces(value: int | None) -> int:
    """Number of surfaces of a `max_bounces` argument, 1 … 3; None allows all `MOST_BOUNCES`. Raises ValueError
    otherwise."""
    if value is None:
        return MOST_BOUNCES
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or not 1 <= value <= MOST_BOUNCES:
        raise ValueError(f"max_bounces is {value!r}: None or 1 … {MOST_BOUNCES} is needed")
    return int(value)
