"""Tolerance `rtol`: its meaning, bounds and defaults.

`rtol` is the tolerated relative error of the return of each actor and of the static scene: 0.01 is 0.1 dB or 0.6
degrees, 0.1 is 0.9 dB or 6 degrees. The error is as smooth in time as the motion, so that it adds no Doppler.
"""

from __future__ import annotations

from numbers import Real
from typing import Annotated, Any

from annotated_types import Interval

MIN_RTOL, MAX_RTOL = 1e-8, 0.3
"""Bounds, both allowed."""
DEFAULT_RTOL = 0.1
"""Default for prompts: `generate`, recipes and the command line."""
SIMULATOR_RTOL = 0.01
"""Default of `Simulator` and `Tracer`."""
RTOL_RANGE = f"{MIN_RTOL:g} … {MAX_RTOL:g}"
"""The bounds in messages and help texts."""

Rtol = Annotated[float, Interval(ge=MIN_RTOL, le=MAX_RTOL)]
"""Type of a checked tolerance in tables."""


def check_rtol(value: Any) -> float:
    """Tolerance of an argument `rtol`. Raises ValueError outside the bounds, or for anything but a number."""
    is_number = isinstance(value, Real) and not isinstance(value, bool)
    if not (is_number and MIN_RTOL <= value <= MAX_RTOL):
        raise ValueError(f"rtol is {value!r}: a value in {RTOL_RANGE} is needed")
    return float(value)
