"""Paths to images and back: rasterising, mixing with imagined surroundings, and gains from refined images.

Refinement changes the energy of traced paths, not their phases and delays: every path of a pixel is multiplied by the
root of the ratio of refined to mixed energy. Energy in empty pixels becomes diffuse paths with random phases. The
rasterised result is the refined image again.

Images are refined at key times. A path's gain is that of its facet at each key time and goes smoothly from one to the
next: gains by the current pixel would step at every pixel border, and steps are broadband Doppler.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray, IntArray
from rfgen_sionna.pir.image_surroundings import ImageSurroundings, check_image
from rfgen_sionna.pir.view import View
from rfgen_sionna.records import PathKind, Pir, RadarPaths

if TYPE_CHECKING:
    from rfgen_sionna.radar import Radar

MAX_GAIN_DB = 15.0
"""Upper bound of the change of traced energy by a refined image [dB]: that of path diffusion."""
INCOHERENT = (PathKind.DIFFUSE, PathKind.ENVIRONMENT)
"""Kinds of paths with random phases: their energies add up."""

PositionsAt = Callable[[float], FloatArray]
"""Time [s] to the (path, 3) positions of paths [m]."""


def rasterise(paths: RadarPaths, view: View, t: float) -> Pir:
    """PIR of `paths` at time `t` [s]: energy, time of arrival and velocity per pixel.

    A path's direction of arrival selects its pixel; paths outside of the view are left out. Within a pixel the gains of
    traced paths add up with their phases at `paths.frequency`, and the energies of paths with random phases without;
    both are means over the element pairs, without element patterns. Time of arrival and velocity are weighted with the
    energies of the single paths.

    Parameters
    ----------
    paths
        Traced from the view's position.
    view
        Geometry of the image.
    t
        Time within the paths' knots [s].
    """
    now = paths.at(np.array([t]))
    pixel = view.pixels(now.arrival[:, 0])
    chosen = np.flatnonzero(pixel >= 0)
    pixel, a = pixel[chosen], now.a[:, :, chosen, 0]
    delay, rate = (values[:, :, chosen, 0].mean(axis=(0, 1)) for values in (now.tau, now.tau_rate))

    def total(weights: FloatArray) -> FloatArray:
        return np.bincount(pixel, weights=weights, minlength=view.size).astype(np.float64, copy=False)

    random = np.isin(now.kind[chosen], INCOHERENT)
    power = np.mean(np.abs(a) ** 2, axis=(0, 1))
    energy = total(np.where(random, power, 0.0))
    turned = np.where(random, 0.0, a) * np.exp(-2j * np.pi * np.mod(paths.frequency * now.tau[:, :, chosen, 0], 1.0))
    for gains in turned.reshape(-1, len(chosen)):
        energy += (total(gains.real) ** 2 + total(gains.imag) ** 2) / (a.shape[0] * a.shape[1])
    weight = total(power)
    hit = weight > 0
    arrival, velocity = np.full(view.size, np.nan), np.zeros(view.size)
    arrival[hit] = total(power * delay)[hit] / weight[hit]
    velocity[hit] = 0.5 * SPEED_OF_LIGHT * total(power * rate)[hit] / weight[hit]
    return view.pir(energy, arrival, velocity, t)


@dataclass(frozen=True)
class _KeyImage:
    """Changes by one refined image."""

    time: float
    gain: FloatArray
    """(pixel,) natural logarithm of the amplitude factor."""
    added: ImageSurroundings
    """Pixels without a path before."""


class Refinement:
    """Refined images at key times, as a change of paths.

    Parameters
    ----------
    mixed
        Rasterised images of the paths before the change (:func:`rasterise`), of one view.
    refined
        Wanted images at the same times. Their times of arrival and velocities count where `mixed` has no energy.
    radar
        The radar.
    seed
        Seed of the phases of added paths.

    Raises
    ------
    ValueError
        If the images differ in number, view or time, or have values that no radar receives.
    """

    def __init__(self, mixed: Sequence[Pir], refined: Sequence[Pir], radar: Radar, seed: int) -> None:
        if not mixed or len(mixed) != len(refined):
            raise ValueError(f"refined: {len(refined)} images for {len(mixed)} mixed ones; one for each is needed")
        self.view = View.of(mixed[0])
        times = [image.time for image in mixed]
        if sorted(set(times)) != times:
            raise ValueError(f"mixed: times are {times}; ascending times are needed")
        limit = MAX_GAIN_DB / 20.0 * math.log(10.0)
        self._keys = []
        for number, (before, after) in enumerate(zip(mixed, refined, strict=True)):
            check_image(f"refined[{number}]", after)
            if View.of(before) != self.view or View.of(after) != self.view:
                raise ValueError(f"refined[{number}]: its view or that of mixed[{number}] is not that of mixed[0]")
            there = before.energy > 0
            ratio = np.ones(there.shape)
            # No factor is 0, since the next key time may raise the energy again.
            np.divide(np.maximum(after.energy, np.finfo(np.float64).tiny), before.energy, out=ratio, where=there)
            gain = np.clip(0.5 * np.log(ratio), -limit, limit)
            extra = replace(after, energy=np.where(there, 0.0, after.energy), time=before.time)
            self._keys.append(_KeyImage(before.time, gain.ravel(), ImageSurroundings(extra, radar, seed + 1)))

    def __call__(self, paths: RadarPaths, places: PositionsAt) -> RadarPaths:
        """`paths` with the refined gains at their positions (`places`)."""
        weights = self._weights(paths.times)
        used = np.flatnonzero(weights.any(axis=1))
        levels = np.stack([self._gains_at(self._keys[k], places(self._keys[k].time)) for k in used], axis=1)
        return _scaled(paths, np.exp(levels @ weights[used])) if levels.any() else paths

    def added(self, times: FloatArray) -> list[RadarPaths]:
        """Diffuse paths at knots `times` (time,) [s] in pixels without a path, blended from key time to key time."""
        weights = self._weights(times)
        return [
            key.added.paths(times, np.broadcast_to(weights[k] ** 2, (len(key.added.pixel), len(times))))
            for k, key in enumerate(self._keys)
            if weights[k].any() and len(key.added.pixel)
        ]

    def _gains_at(self, key: _KeyImage, points: FloatArray) -> FloatArray:
        """(path,) logarithmic gains at `points` (path, 3) [m]; 0 outside of the view."""
        pixel = self.view.pixels(points - np.asarray(self.view.position))
        return np.where(pixel >= 0, key.gain[np.maximum(pixel, 0)], 0.0)

    def _weights(self, times: FloatArray) -> FloatArray:
        """(key, time) weights of the key times; constant before the first and after the last."""
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
    """Traced paths and those of imagined surroundings, each occluded by the other.

    Parameters
    ----------
    paths
        Traced paths.
    surroundings
        The surroundings.
    times
        (time,) knots of the surroundings' paths [s].
    visible_share
        (path, time) share of each of the surroundings' pixels in front of which no actor stands.
    """
    if len(surroundings.pixel) == 0:
        return [paths]
    unoccluded = _scaled(paths, surroundings.unoccluded_share(paths))
    return [unoccluded, surroundings.paths(times, visible_share)]


def _scaled(paths: RadarPaths, factor: FloatArray) -> RadarPaths:
    """`paths` with gains times `factor` (path, time)."""
    dispersion = None if paths.dispersion is None else paths.dispersion * factor
    return replace(paths, a=paths.a * factor, dispersion=dispersion)


def image(parts: Sequence[RadarPaths], view: View, t: float) -> Pir:
    """PIR of several sets of paths at time `t` [s]; each set may have its own knots."""
    return rasterise(concatenate_paths([part.at(np.array([t])) for part in parts]), view, t)


def concatenate_paths(parts: Sequence[RadarPaths]) -> RadarPaths:
    """One set of paths from several with the same knots, with a common list of object and part names."""
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
