"""From images back to paths: traced paths, surroundings from an image, and what a refined image changes in both.

Traced paths keep their phases and delays. Of an image they take energy alone: within a pixel every path is multiplied
by the root of the ratio of the refined to the mixed energy. Energy where nothing was becomes diffuse paths with random
phases. `rasterise` of the result is the refined image again.

Over time an image is refined at key instants. In between a path's gain goes smoothly from what its place on the body
was given at one to what it was given at the next: were it looked up in the image as the body moves, every pixel border
would be a step, and steps are broadband Doppler.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.pir.image_surroundings import ImageSurroundings, check_image
from rfgen_sionna.pir.rasterisation import rasterise
from rfgen_sionna.pir.view import View
from rfgen_sionna.records import Pir, RadarPaths

if TYPE_CHECKING:
    from rfgen_sionna.radar import Radar

MAX_GAIN_DB = 15.0
"""By how much a refined image raises or lowers traced energy at most, where nothing else is asked for."""

PositionsAt = Callable[[float], FloatArray]
"""Time [s] to the (path, 3) points that paths belong to [m]."""


@dataclass(frozen=True)
class _RefinedKey:
    """What one refined image changes."""

    time: float
    gain: FloatArray
    """(pixel,) natural logarithm of the factor of amplitudes."""
    added: ImageSurroundings
    """Pixels that had no path."""


class Refinement:
    """Refined images at key instants, as a change of paths.

    Parameters
    ----------
    mixed
        The images of the paths as they are, :func:`~rfgen_sionna.pir.rasterisation.rasterise`, of one view.
    refined
        The images that paths are to make; those of the same instants. Their times of arrival and velocities count only
        where `mixed` has no energy.
    radar
        The radar.
    seed
        Seed of the phases of what is added.
    most_gain_db
        Largest change of traced energy.

    Raises
    ------
    ValueError
        If the images don't fit together, or hold what no radar receives.
    """

    def __init__(
        self,
        mixed: Sequence[Pir],
        refined: Sequence[Pir],
        radar: Radar,
        seed: int,
        most_gain_db: float = MAX_GAIN_DB,
    ) -> None:
        if not mixed or len(mixed) != len(refined):
            raise ValueError(f"refined: {len(refined)} images for {len(mixed)} mixed ones; one for each is needed")
        if not (math.isfinite(most_gain_db) and most_gain_db >= 0):
            raise ValueError(f"most_gain_db is {most_gain_db!r}: a finite level [dB] of at least 0 is needed")
        self.view = View.of(mixed[0])
        times = [image.time for image in mixed]
        if sorted(set(times)) != times:
            raise ValueError(f"mixed: instants are {times}; they must ascend")
        limit = most_gain_db / 20.0 * math.log(10.0)
        self._keys = []
        for number, (occlude_traced, after) in enumerate(zip(mixed, refined, strict=True)):
            check_image(f"refined[{number}]", after)
            if View.of(occlude_traced) != self.view or View.of(after) != self.view:
                raise ValueError(f"refined[{number}]: its view or that of mixed[{number}] is not that of mixed[0]")
            there = occlude_traced.energy > 0
            ratio = np.ones(there.shape)
            # No factor is 0: what is faded out may have to come back.
            np.divide(
                np.maximum(after.energy, np.finfo(np.float64).tiny), occlude_traced.energy, out=ratio, where=there
            )
            gain = np.clip(0.5 * np.log(ratio), -limit, limit)
            extra = replace(after, energy=np.where(there, 0.0, after.energy), time=occlude_traced.time)
            self._keys.append(_RefinedKey(occlude_traced.time, gain.ravel(), ImageSurroundings(extra, radar, seed + 1)))

    def __call__(self, paths: RadarPaths, places: PositionsAt) -> RadarPaths:
        """`paths` with the gains that the images give to their places."""
        weights = self._weights(paths.times)
        used = np.flatnonzero(weights.any(axis=1))
        levels = np.stack([self._at(self._keys[k], places(self._keys[k].time)) for k in used], axis=1)
        if not levels.any():
            return paths
        factor = np.exp(levels @ weights[used])
        return replace(
            paths,
            a=paths.a * factor,
            dispersion=None if paths.dispersion is None else paths.dispersion * factor,
        )

    def added(self, times: FloatArray) -> list[RadarPaths]:
        """Diffuse paths at knots `times` (time,) [s] for energy where no path was; they fade from key to key."""
        weights = self._weights(times)
        return [
            key.added.paths(times, np.broadcast_to(weights[k] ** 2, (len(key.added.pixel), len(times))))
            for k, key in enumerate(self._keys)
            if weights[k].any() and len(key.added.pixel)
        ]

    def _at(self, key: _RefinedKey, points: FloatArray) -> FloatArray:
        """(path,) logarithmic gains at `points` (path, 3) [m]; 0 outside of the view."""
        pixel = self.view.pixels(points - np.asarray(self.view.position))
        return np.where(pixel >= 0, key.gain[np.maximum(pixel, 0)], 0.0)

    def _weights(self, times: FloatArray) -> FloatArray:
        """(key, time) shares of the key instants, smooth from one to the next; the first and the last one hold on."""
        keys = np.array([key.time for key in self._keys])
        if len(keys) == 1:
            return np.ones((1, len(times)))
        after = np.clip(np.searchsorted(keys, times), 1, len(keys) - 1)
        u = np.clip((times - keys[after - 1]) / (keys[after] - keys[after - 1]), 0.0, 1.0)
        share = u**2 * (3.0 - 2.0 * u)
        weights = np.zeros((len(keys), len(times)))
        weights[after - 1, np.arange(len(times))] = 1.0 - share
        weights[after, np.arange(len(times))] += share
        return weights


def mix_paths(
    paths: RadarPaths, surroundings: ImageSurroundings, times: FloatArray, visible_share: FloatArray
) -> list[RadarPaths]:
    """Traced paths, and the surroundings' at knots `times` (time,) [s], as either lets the other be seen.

    `visible_share` (path, time) is the share of the surroundings' pixels that no actor hides.
    """
    if len(surroundings.pixel) == 0:
        return [paths]
    return [occlude_traced(paths, surroundings), surroundings.paths(times, visible_share)]


def occlude_traced(paths: RadarPaths, surroundings: ImageSurroundings) -> RadarPaths:
    """What the surroundings leave of traced paths."""
    if len(surroundings.pixel) == 0:
        return paths
    weight = surroundings.unoccluded_share(paths)
    return replace(
        paths,
        a=paths.a * weight,
        dispersion=None if paths.dispersion is None else paths.dispersion * weight,
    )


def image(parts: Sequence[RadarPaths], view: View, t: float) -> Pir:
    """The image of several sets of paths, each with knots of its own, at `t` [s]."""
    return rasterise(concatenate_paths([part.at(np.array([t])) for part in parts]), view, t)


def concatenate_paths(parts: Sequence[RadarPaths]) -> RadarPaths:
    """Sets of paths with the same knots as one; objects and parts are numbered through all of them."""
    objects = tuple(dict.fromkeys(name for each in parts for name in each.object_names))
    pieces = tuple(dict.fromkeys(name for each in parts for name in each.part_names))

    def renumbered(index: IntArray, own: tuple[str, ...], names: tuple[str, ...]) -> IntArray:
        return np.array([names.index(name) for name in own], np.int32)[index]

    return RadarPaths.concatenate(
        [
            replace(
                each,
                object_id=renumbered(each.object_id, each.object_names, objects),
                part_id=renumbered(each.part_id, each.part_names, pieces),
                object_names=objects,
                part_names=pieces,
            )
            for each in parts
        ]
    )
