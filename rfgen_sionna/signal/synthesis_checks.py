"""Checks of paths and times before samples are synthesised."""

from __future__ import annotations

from typing import Any

import numpy as np

from rfgen_sionna.radar import Radar
from rfgen_sionna.radar.profile import is_number
from rfgen_sionna.records import RadarPaths

MAX_TIME = 1e10
"""Starts of frames, at most [s], either way: beyond it a float64 has no digits left for the times of chirps."""
_VALUES = ("a", "tau", "tau_rate", "times", "direction", "arrival", "dispersion")


def check_synthesis(radar: Radar, paths: RadarPaths, start: float, eps: float, tx_gains: Any) -> None:
    """Make sure that these are arguments of :func:`~rfgen_sionna.signal.synthesize` at all.

    Raises
    ------
    TypeError
        If `radar` is no Radar, or `paths` are no RadarPaths.
    ValueError
        Naming the argument, or the field of the paths, its value and what is allowed.
    """
    if not isinstance(radar, Radar):
        raise TypeError(f"radar is a {type(radar).__name__}: a Radar is needed (Radar.load('awr1843'))")
    if not isinstance(paths, RadarPaths):
        raise TypeError(f"paths is a {type(paths).__name__}: RadarPaths are needed, such as of Simulator.paths")
    if not (is_number(start) and abs(start) <= MAX_TIME):
        raise ValueError(f"start is {start!r}: a time of -{MAX_TIME:g} … {MAX_TIME:g} s is needed")
    if not (is_number(eps) and 1e-14 <= eps <= 0.1):
        raise ValueError(f"eps is {eps!r}: a value in 1e-14 … 0.1 is needed")
    if tx_gains is not None:
        _check_tx_gains(tx_gains, len(radar.tx_positions))
    for name in _VALUES:
        if getattr(paths, name) is not None:
            _check_finite(f"paths.{name}", np.asarray(getattr(paths, name)))


def _check_tx_gains(tx_gains: Any, count: int) -> None:
    gains = np.asarray(tx_gains)
    if gains.shape != (count,):
        raise ValueError(f"tx_gains has shape {gains.shape}: one factor for each of {count} Tx is needed")
    if gains.dtype.kind not in "iufc" or not np.isfinite(gains).all():
        raise ValueError(f"tx_gains is {tx_gains!r}: finite numbers are needed")


def _check_finite(what: str, values: np.ndarray[Any, Any]) -> None:
    if values.dtype.kind not in "iufc":
        raise ValueError(f"{what} is of type {values.dtype}: numbers are needed")
    # A sum that is finite has nothing in it that is not, and takes one look at each value.
    with np.errstate(over="ignore", invalid="ignore"):
        if np.isfinite(values.sum()):
            return
    if len(bad := np.argwhere(~np.isfinite(values))):
        where = tuple(bad[0].tolist())
        raise ValueError(
            f"{what} has {len(bad)} values that are NaN or infinite, the first is {values[where]} at {where}: finite "
            "ones are needed"
        )
