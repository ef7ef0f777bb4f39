"""What actors take from static paths."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.records import RadarPaths


@dataclass(frozen=True)
class Shadow:
    """Static paths weighted with what actors leave of them less 1: added to the static paths it is what is left."""

    paths: RadarPaths
    index: NDArray[np.intp]
    """(path,) static path that each takes from."""

    def at(self, index: NDArray[np.intp]) -> Shadow:
        """The same where `index` counts the static paths out of more."""
        return replace(self, index=index[self.index])

    def of(self, first: int) -> Shadow:
        """The same where the static paths are counted from `first` on."""
        return replace(self, index=self.index + first)


def cast_shadow(
    paths: RadarPaths, left: FloatArray, knots: FloatArray, within: NDArray[np.intp] | None = None
) -> tuple[Shadow, Shadow]:
    """Shadows on static `paths`, of a single knot, when `left` (path, time) is left of each at the knots [s].

    The first one changes from knot to knot, and holds the paths `within`, which are hidden in part, in any case. The
    second one stays as it is, with a single knot: most of what a body hides it hides all along.
    """
    changes = (left != left[:, :1]).any(axis=1)
    if within is not None:
        changes[within] = True
    steady = np.flatnonzero(~changes & (left[:, 0] != 1.0))
    index = np.flatnonzero(changes)
    weight, chosen, count = left[index] - 1.0, paths.select(index), len(knots)

    def over_time(values: FloatArray, axis: int) -> FloatArray:
        return np.broadcast_to(values, (*values.shape[:axis], count, *values.shape[axis + 1 :]))

    changing = replace(
        chosen,
        a=chosen.a * weight,
        dispersion=None if chosen.dispersion is None else chosen.dispersion * weight,
        tau=over_time(chosen.tau, 3),
        tau_rate=over_time(chosen.tau_rate, 3),
        times=knots,
        direction=over_time(chosen.direction, 1),
        arrival=over_time(chosen.arrival, 1),
    )
    return Shadow(changing, index), Shadow(_weighted(paths.select(steady), left[steady, :1] - 1.0), steady)


def _weighted(paths: RadarPaths, weight: FloatArray) -> RadarPaths:
    dispersion = None if paths.dispersion is None else paths.dispersion * weight
    return replace(paths, a=paths.a * weight, dispersion=dispersion)
