"""Shadows of actors on static paths."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.records import RadarPaths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.direct.time_error import leave_one_out

LEAVE_ONE_OUT_SCALE = 0.35
"""Typical error of a spline through all knots over that of predictions of single knots."""


@dataclass(frozen=True)
class Shadow:
    """Change of static paths by actors: gains times the visible share minus 1. Static paths plus shadow are what is
    left."""

    paths: RadarPaths
    index: NDArray[np.intp]
    """(path,) static path of each."""

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


@dataclass(frozen=True)
class IndirectShadows:
    """Shadows of actors on indirect static paths."""

    traced: tuple[Any, ...]
    """:class:`StaticIndirectPaths` of each kind."""
    times: FloatArray
    """(time,) [s]"""
    left: tuple[FloatArray, ...]
    """(path, time) visible share of each."""
    rays: int

    @staticmethod
    def of(
        traced: Sequence[Any],
        times: FloatArray,
        rays_at: Callable[[float], RayScene],
        vertices: Callable[[float], Sequence[FloatArray]],
    ) -> IndirectShadows:
        """Shadows at `times` [s] of actors with `vertices`, in the ray scenes `rays_at` these."""
        sent, left = 0, [np.ones((each.paths.num_paths, len(times))) for each in traced]
        for k, t in enumerate(times.tolist() if traced else ()):
            for each, share in zip(traced, left, strict=True):
                share[:, k], count = each.visible(rays_at(t), vertices(t))
                sent += count
        return IndirectShadows(tuple(traced), times, tuple(left), sent)

    def shadows(self, first: int) -> tuple[Shadow, ...]:
        """All of them, on paths numbered from `first` on."""
        found: list[Shadow] = []
        for each, share in zip(self.traced, self.left, strict=True):
            found += [shadow.of(first) for shadow in each.shadows(self.times, share)]
            first += each.paths.num_paths
        return tuple(shadow for shadow in found if shadow.paths.num_paths)

    def error(self, static: Any) -> float:
        """Error between the times, relative to the level of a `static` trace."""
        found, times = 0.0, len(self.times)
        for each, share in zip(self.traced, self.left, strict=True):
            if times > 2 and static.level > 0 and len(share):
                paths = each.paths
                waves = paths.a[0, 0, :, 0] * np.exp(-2j * np.pi * np.mod(paths.frequency * paths.tau[0, 0, :, 0], 1.0))
                off = waves @ (share @ leave_one_out(times).T)
                found = max(found, LEAVE_ONE_OUT_SCALE * float(np.sqrt(np.mean(np.abs(off) ** 2))) / static.level)
        return found
