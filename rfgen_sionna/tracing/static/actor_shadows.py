"""Shadows of actors on static paths."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.records import RadarPaths
from rfgen_sionna.tracing.direct.samples import Shadows
from rfgen_sionna.tracing.direct.time_error import leave_one_out

LEAVE_ONE_OUT_SCALE = 0.35
"""Typical error of a spline through all knots over that of predictions of single knots."""


OMITTED = 0.1
"""Share of the tolerance for what the weakest shadowed paths return together, each by its magnitude."""


@dataclass(frozen=True)
class Shadow:
    """Change of static paths by actors: gains times the visible share minus 1. Static paths plus shadow are what is
    left."""

    paths: RadarPaths
    index: NDArray[np.intp]
    """(path,) static path of each; -1 for a path of its own, of a facet of a large face whose edges are paths."""

    def at(self, index: NDArray[np.intp]) -> Shadow:
        """The same, with `index` mapped to the numbers `index[...]` of a larger set of paths."""
        return replace(self, index=index[self.index])

    def of(self, first: int) -> Shadow:
        """The same, with static paths numbered from `first` on."""
        return replace(self, index=self.index + first)


def cast_shadow(
    paths: RadarPaths, left: FloatArray, knots: FloatArray, within: NDArray[np.intp] | None = None
) -> tuple[Shadow, Shadow]:
    """Shadows on single-knot static `paths` with visible share `left` (path, time) at the `knots` [s].

    The first one holds paths whose share changes, and in any case the partly occluded paths `within`. The second one
    holds constant shares, with a single knot.
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
        chosen, a=chosen.a * weight, dispersion=None if chosen.dispersion is None else chosen.dispersion * weight,
        tau=over_time(chosen.tau, 3), tau_rate=over_time(chosen.tau_rate, 3), times=knots,
        direction=over_time(chosen.direction, 1), arrival=over_time(chosen.arrival, 1),
    )  # fmt: skip
    return Shadow(changing, index), Shadow(weighted(paths.select(steady), left[steady, :1] - 1.0), steady)


def cast_shadows(static: Any, times: FloatArray, shadows: Sequence[Shadows]) -> tuple[tuple[Shadow, ...], float]:
    """Shadows on the direct paths of a `static` trace at each of the `times` [s], and their error between these,
    relative to the static reference level."""
    every = np.unique(np.concatenate([np.zeros(0, np.intp), *(index for index, _ in shadows)]))
    if not len(every):
        return (), 0.0
    left = np.ones((len(every), len(times)))
    for k, (index, share) in enumerate(shadows):
        left[np.searchsorted(every, index), k] = share
    strength = static.strength_of(every)
    if static.level > 0:  # oblique facets return next to nothing
        some = significant((1.0 - left.min(axis=1)) * strength, OMITTED * static.returns.rtol * static.level)
        every, left = every[some], left[some]
    paths, weight = static.paths_of(every)
    every = np.where(every < len(static.facets), every, -1)
    changing, steady = (shadow.at(every) for shadow in cast_shadow(paths, left, times))
    missed = 0.0
    if len(times) > 2 and static.level > 0:
        frequency = np.float64(paths.frequency)
        waves = paths.a[0, 0, :, 0] * np.exp(-2j * np.pi * np.mod(frequency * paths.tau[0, 0, :, 0], 1.0))
        off = (waves * weight) @ (left @ leave_one_out(len(times)).T)
        missed = LEAVE_ONE_OUT_SCALE * float(np.sqrt(np.mean(np.abs(off) ** 2))) / static.level
    return tuple(each for each in (changing, steady) if each.paths.num_paths), missed


def significant(strength: FloatArray, allowed: float) -> NDArray[np.intp]:
    """Indices, ascending, of all but the weakest ones, whose root of the sum of squares is at most `allowed`."""
    order = np.argsort(strength, kind="stable")
    return np.sort(order[np.cumsum(strength[order] ** 2) > allowed**2])


@dataclass(frozen=True)
class StaticIndirectPaths:
    """Paths within the static scene besides direct ones, without actors."""

    paths: RadarPaths
    """Single knot."""
    error: float
    """Estimated error, relative to the static reference level."""
    rays: int
    """Rays sent."""

    def shadows(self, knots: FloatArray, left: FloatArray) -> tuple[Shadow, Shadow]:
        """As :func:`cast_shadow`, with the visible share `left` (path, time) at the `knots` [s]."""
        return cast_shadow(self.paths, left, knots)


def weighted(paths: RadarPaths, weight: FloatArray) -> RadarPaths:
    """The `paths` with gains times `weight` (path, time)."""
    dispersion = None if paths.dispersion is None else paths.dispersion * weight
    return replace(paths, a=paths.a * weight, dispersion=dispersion)
