"""Surroundings from an image: one diffuse path a pixel, and occlusion between them and traced actors.

A pixel's phase is unknown: its path has the pixel's energy and a random phase, drawn once, so that static clutter stays
coherent from chirp to chirp.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray
from rfgen_sionna.pir.view import View
from rfgen_sionna.records import PathKind, Pir, RadarPaths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.relative_scene import from_world, to_world

if TYPE_CHECKING:
    from rfgen_sionna.radar import Radar

GUIDES, SUBPIXELS = 2, 6
"""Visibility rays across a pixel, and across a pixel at an actor's silhouette: its share is exact to about 1/100."""
SOFT_EDGE = 0.3
"""Depth over which paths behind the surroundings fade [m]: the accuracy of imagined times of arrival."""
OBJECT_NAME = "environment"
_RATE_STEP = 1e-3
"""Half the time step of the central difference of delays [s]: motion within it is straight to rounding."""


class ImageSurroundings:
    """Paths and occlusion of surroundings from an image.

    Parameters
    ----------
    pir
        The image, in physical units. Its pixels are fixed points of the world, with energies for the image's viewpoint,
        which should be near the radar.
    radar
        The radar, static or moving.
    seed
        Seed of the phases.

    Raises
    ------
    ValueError
        If the image has values that no radar receives; the message names the channel (:func:`check_image`).
    """

    def __init__(self, pir: Pir, radar: Radar, seed: int) -> None:
        check_image("environment", pir)
        self.view = View.of(pir)
        energy = pir.energy.ravel()
        self.pixel = np.flatnonzero(energy > 0)
        """(path,) pixels with energy, counted row by row."""
        self._radar, self._start = radar, pir.time
        self._amplitude = np.sqrt(energy[self.pixel])
        self._distance = 0.5 * SPEED_OF_LIGHT * pir.time_of_arrival.ravel()[self.pixel]
        self._velocity = pir.velocity.ravel()[self.pixel]
        self._directions = self.view.directions.reshape(-1, 3)[self.pixel]
        # Phases of all pixels: a pixel's phase does not depend on the energy of others.
        phases = np.random.default_rng([seed, PathKind.ENVIRONMENT]).uniform(0.0, 2 * np.pi, self.view.size)
        self._phasor = np.exp(1j * phases[self.pixel])

    @property
    def moves(self) -> bool:
        """Whether delays change: the radar or a pixel's point moves."""
        return self._radar.trajectory is not None or bool(np.any(self._velocity))

    def paths(self, times: FloatArray, visible_share: FloatArray) -> RadarPaths:
        """Paths of the pixels at knots `times` (time,) [s], with visible shares `visible_share` (path, time)."""
        still = np.zeros((len(self._radar.tx_positions), len(self._radar.rx_positions), len(self.pixel), len(times)))
        tau, rate = still, still
        if self.moves:
            tau = np.stack([self._delays(self.points(t)) for t in times.tolist()], axis=-1)
            ahead, behind = (
                np.stack([self._delays(self.points(t + step)) for t in times.tolist()], axis=-1)
                for step in (_RATE_STEP, -_RATE_STEP)
            )
            rate = (ahead - behind) / (2 * _RATE_STEP)
        else:
            tau = still + self._delays(self.points(self._start))[..., None]
        points = np.stack([self.points(t) for t in times.tolist()], axis=1)
        offset = points - np.asarray(self._radar.position)
        direction = offset / np.linalg.norm(offset, axis=2, keepdims=True)
        # Diffuse returns keep the elements' polarisation.
        gain = (self._phasor * self._amplitude)[:, None] * np.sqrt(visible_share)
        gain = gain * float(self._radar.tx_field @ self._radar.rx_field)
        count = len(self.pixel)
        return RadarPaths(
            a=np.broadcast_to(gain, tau.shape), tau=tau, tau_rate=rate, times=np.asarray(times, dtype=np.float64),
            frequency=self._radar.center_frequency, direction=direction, arrival=direction,
            object_id=np.zeros(count, np.int32), part_id=np.zeros(count, np.int32),
            kind=np.full(count, PathKind.ENVIRONMENT, np.uint8), bounces=np.ones(count, np.uint8),
            object_names=(OBJECT_NAME,), part_names=(OBJECT_NAME,), facet=np.full(count, -1, np.int32),
        )  # fmt: skip

    def visible_share(self, rays: RayScene, t: float) -> FloatArray:
        """(path,) unoccluded share of each pixel at `t` [s], for occluders `rays` in the radar's apparent frame."""
        rows, columns = self.view.resolution
        share = np.full(self.view.size, np.nan)
        share[self.pixel] = self._unoccluded_share(rays, t, self.pixel, GUIDES)
        # Silhouettes: rays disagree within a pixel or with its neighbours.
        padded = np.pad(share.reshape(rows, columns), 1, constant_values=np.nan)
        around = np.stack([padded[r : r + rows, c : c + columns] for r in range(3) for c in range(3)])
        lowest, highest = (np.where(np.isnan(around), other, around).reshape(9, -1) for other in (np.inf, -np.inf))
        silhouette = self.pixel[(lowest.min(axis=0) < highest.max(axis=0))[self.pixel]]
        share[silhouette] = self._unoccluded_share(rays, t, silhouette, SUBPIXELS)
        return share[self.pixel]

    def unoccluded_share(self, paths: RadarPaths) -> FloatArray:
        """(path, time) 1 for paths in front of the surroundings, falling to 0 over `SOFT_EDGE` behind them.

        Depths are interpolated between pixels, so that moving facets fade smoothly.
        """
        weight = np.empty((paths.num_paths, len(paths.times)))
        for k, t in enumerate(paths.times.tolist()):
            direction, origin = paths.arrival[:, k], np.asarray(self._radar.position)
            if self._radar.trajectory is not None:
                direction, origin = to_world(direction, self._radar, t), np.asarray(self._radar.at(t).position)
            weight[:, k] = self._transmitted(origin + paths.range[:, k, None] * direction)
        return weight

    def occluded(self, _: FloatArray, targets: FloatArray, /) -> FloatArray:
        """(target,) occluded share, 0 … 1, of points (target, 3) of the world [m], seen from the image's viewpoint."""
        return 1.0 - self._transmitted(targets)

    def _transmitted(self, points: FloatArray) -> FloatArray:
        """(point,) 1 for points (point, 3) of the world [m] before the surroundings, falling to 0 behind them."""
        distance = np.full(self.view.size, np.inf)
        distance[self.pixel] = self._distance
        offset = points - np.asarray(self.view.position)
        return self._fade(distance, np.linalg.norm(offset, axis=1), *self.view.coordinates(offset))

    def _fade(self, distance: FloatArray, reach: FloatArray, row: FloatArray, column: FloatArray) -> FloatArray:
        """(path,) bilinear blend of the shares by the four nearest pixels' depths; 1 outside of the view."""
        rows, columns = self.view.resolution
        around, poles = self.view.plane.closed
        known = np.isfinite(row) & np.isfinite(column)
        row, column = np.where(known, row, -9.0), np.where(known, column, -9.0)
        top, left = np.floor(row).astype(np.intp), np.floor(column).astype(np.intp)
        total = np.zeros(len(reach))
        for r, by_row in ((top, top + 1 - row), (top + 1, row - top)):
            for c, by_column in ((left, left + 1 - column), (left + 1, column - left)):
                if around:
                    c = c % columns
                at = np.clip(r, 0, rows - 1) if poles else r
                inside = known & (at >= 0) & (at < rows) & (c >= 0) & (c < columns)
                nearest = np.where(inside, distance[np.where(inside, at * columns + c, 0)], np.inf)
                depth = np.clip((reach - nearest) / SOFT_EDGE, 0.0, 1.0)
                total += by_row * by_column * (1.0 - depth**2 * (3.0 - 2.0 * depth))
        return total

    def points(self, t: float) -> FloatArray:
        """(path, 3) apparent positions of the pixels' points at `t` [s], in the radar's frame [m]."""
        return self._apparent_positions(
            (self._distance + self._velocity * (t - self._start))[:, None] * self._directions, t
        )

    def _apparent_positions(self, offsets: FloatArray, t: float) -> FloatArray:
        """Apparent positions at `t` [s] of points at `offsets` from the image's viewpoint, world frame [m]."""
        points = np.asarray(self.view.position) + offsets
        return points if self._radar.trajectory is None else from_world(points, self._radar, t)

    def _delays(self, points: FloatArray) -> FloatArray:
        """(tx, rx, path) [s]"""
        ends = self._radar.tx_world, self._radar.rx_world
        to_tx, to_rx = (np.linalg.norm(points - end[:, None], axis=2) for end in ends)
        return np.asarray((to_tx[:, None] + to_rx) / SPEED_OF_LIGHT)

    def _unoccluded_share(self, rays: RayScene, t: float, pixels: NDArray[np.intp], split: int) -> FloatArray:
        """(pixel,) share of unoccluded rays, `split` across each of `pixels`."""
        if len(pixels) == 0:
            return np.zeros(0)
        rows, columns = self.view.resolution
        grid = self.view.subpixels(split).reshape(rows, split, columns, split, 3).transpose(0, 2, 1, 3, 4)
        chosen = grid.reshape(self.view.size, split * split, 3)[pixels]
        own = np.searchsorted(self.pixel, pixels)
        distance = self._distance[own] + self._velocity[own] * (t - self._start)
        targets = self._apparent_positions(distance[:, None, None] * chosen, t).reshape(-1, 3)
        occluded = rays.occluded(np.asarray(self._radar.position), targets)
        return 1.0 - occluded.reshape(len(pixels), -1).mean(axis=1)


def check_image(name: str, pir: Pir) -> None:
    """Check that the values of a PIR are physical; `name` is its name in messages.

    Raises
    ------
    TypeError, ValueError
        The message names the channel, its first wrong value and the allowed range.
    """
    if not isinstance(pir, Pir):
        raise TypeError(f"{name} is a {type(pir).__name__}: a Pir is needed")
    View.of(pir)
    energy, arrival, velocity = pir.energy, pir.time_of_arrival, pir.velocity
    if np.ndim(energy) != 2 or np.shape(arrival) != np.shape(energy) or np.shape(velocity) != np.shape(energy):
        shapes = np.shape(energy), np.shape(arrival), np.shape(velocity)
        raise ValueError(f"{name}: energy, time_of_arrival and velocity have shapes {shapes}: one is needed for all")
    limits = (
        ("energy", np.isfinite(energy) & (energy >= 0) & (energy <= 1), "0 … 1, at most the sent energy,"),
        ("time_of_arrival", (energy == 0) | ((arrival > 0) & (arrival < 1e-3)), "0 … 1e-3 s at energy above 0"),
        ("velocity", (energy == 0) | (np.abs(velocity) < 1e4), "-1e4 … 1e4 m/s at energy above 0"),
    )
    for channel, right, allowed in limits:
        if not np.all(right):
            place = tuple(int(i) for i in np.argwhere(~right)[0])
            raise ValueError(f"{name}.{channel}{list(place)} is {getattr(pir, channel)[place]!r}: {allowed} is allowed")
