"""Occlusion of actors by one another and by the scene, checked before a run."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.scene.checks.radar_distance import Obstacle, surface_of

if TYPE_CHECKING:
    pass

OCCLUSION_TIMES = 9
"""Times of a run at which occlusion is tested; a warning needs no more."""
OCCLUSION_POINTS = 64
"""Least number of an actor's vertices for its occluded share, to about 2 %."""
MUCH_OCCLUDED = 0.35
"""Largest occluded share of an actor without a warning: legs behind a table."""


class Occluder(Protocol):
    """Surfaces, or an image of surroundings, that may occlude an actor."""

    def occluded(self, origins: FloatArray, targets: FloatArray, /) -> NDArray[np.bool_] | FloatArray:
        """(target,) occlusion of targets (target, 3) [m] from an origin (3,) [m], as a bool or a share 0 … 1."""


def is_occluded(radar: Radar, occluder: Occluder | None, actor: Obstacle, start: float, stop: float) -> bool:
    """Whether `occluder` occludes all of an actor at all tested times from `start` to `stop` [s]."""
    if occluder is None:
        return False
    return all(_occluded_share(radar, occluder, actor, t) == 1.0 for t in _test_times(start, stop))


def warn_occluded(
    radar: Radar,
    occluder: Occluder,
    actors: Sequence[Obstacle],
    start: float,
    stop: float,
    what: str,
    *,
    much: bool,
    stacklevel: int,
) -> None:
    """Warn of actors that `occluder`, called `what`, occludes at all tested times; with `much`, also of those that it
    occludes by more than :data:`MUCH_OCCLUDED` at one of them."""
    for actor in actors:
        if is_occluded(radar, occluder, actor, start, stop):
            text = f"is behind the {what} all along: the radar receives nothing of it"
        elif much:
            share, t = max((_occluded_share(radar, occluder, actor, t), -t) for t in _test_times(start, stop))
            if share <= MUCH_OCCLUDED:
                continue
            text = f"is behind the {what}, or in them, by {share:.0%} at t = {-t:.2f} s: the radar receives the rest"
        else:
            continue
        warnings.warn(f"actor '{actor.name}' {text}", stacklevel=stacklevel + 1)


def _test_times(start: float, stop: float) -> list[float]:
    return [float(t) for t in np.linspace(start, stop, OCCLUSION_TIMES if stop > start else 1)]


def _occluded_share(radar: Radar, occluder: Occluder, actor: Obstacle, t: float) -> float:
    """Occluded share of an actor at `t` [s], 0 … 1."""
    vertices = surface_of(actor).vertices(t)
    points = vertices[:: max(1, len(vertices) // OCCLUSION_POINTS)]
    return float(occluder.occluded(np.asarray(radar.pose(t)[0]), points).mean())
