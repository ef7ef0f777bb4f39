"""Shadows of actors on static paths."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.records import RadarPaths


@dataclass(frozen=True)
class Shadow:
    """Change of static paths by actors: gains times the visible share minus 1. Static paths plus shadow are what is
    left."""

    paths: RadarPaths
    index: NDArray[np.intp]
    """(path,) static path of each, or its number in
    :class:`~rfgen_sionna.tracing.static.shadowed_facets.ShadowedFacets`."""

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
    return Shadow(changing, index), Shadow(_weighted(paths.select(steady), left[steady, :1] - 1.0), steady)


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


def _weighted(paths: RadarPaths, weight: FloatArray) -> RadarPaths:
    dispersion = None if paths.dispersion is None else paths.dispersion * weight
    return replace(paths, a=paths.a * weight, dispersion=dispersion)
