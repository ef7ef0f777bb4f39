"""Surroundings known from an image: diffuse paths for its pixels, and who hides whom.

A pixel's time of arrival is right to centimetres and its phase is unknown: it becomes one path of the pixel's energy
with a random phase, drawn once and kept, so that static clutter stays coherent from chirp to chirp.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray
from rfgen_sionna.pir.view import View
from rfgen_sionna.records import PathKind, Pir, RadarPaths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.relative import from_world, to_world

if TYPE_CHECKING:
    from rfgen_sionna.radar import Radar

GUIDES, SUBPIXELS = 2, 6
"""Rays across a pixel that look for actors in front of it, and across one at an actor's outline: the share that is
hidden comes out to about a hundredth."""
SOFT_EDGE = 0.3
"""Depth [m] over which what stands behind the surroundings fades: their times of arrival are no more exact."""
OBJECT_NAME = "environment"
_RATE_STEP = 1e-3


class ImageSurroundings:
    """What an image of surroundings returns to a radar, and what it hides.

    Parameters
    ----------
    pir
        The image, in physical units. Its pixels are points of the world. They needn't be seen from where the radar
        stands, but their energies are those at the image's viewpoint, so that it should be near.
    radar
        The radar. If it moves, the points stay where they are in the world.
    seed
        Seed of the phases.

    Raises
    ------
    ValueError
        If the image holds what no radar receives; the message names the channel (:func:`check_image`).
    """

    def __init__(self, pir: Pir, radar: Radar, seed: int) -> None:
        check_image("environment", pir)
        self.view = View.of(pir)
        energy = pir.energy.ravel()
        self.pixel = np.flatnonzero(energy > 0)
        """(path,) the pixels that return something, counted row by row."""
        self._radar, self._start = radar, pir.time
        self._amplitude = np.sqrt(energy[self.pixel])
        self._distance = 0.5 * SPEED_OF_LIGHT * pir.time_of_arrival.ravel()[self.pixel]
        self._velocity = pir.velocity.ravel()[self.pixel]
        self._directions = self.view.directions.reshape(-1, 3)[self.pixel]
        # A phase belongs to its pixel, whichever others return something.
        phases = np.random.default_rng([seed, PathKind.ENVIRONMENT]).uniform(0.0, 2 * np.pi, self.view.size)
        self._phasor = np.exp(1j * phases[self.pixel])

    @property
    def moves(self) -> bool:
        """Whether delays change: the radar moves, or something in the image does."""
        return self._radar.trajectory is not None or bool(np.any(self._velocity))

    def paths(self, times: FloatArray, visible_share: FloatArray) -> RadarPaths:
        """The pixels' paths at knots `times` (time,) [s], of which the share `visible_share` (path, time) is not
        hidden."""
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
        # Whatever the elements' polarisation, diffuse returns are taken to keep it.
        gain = (self._phasor * self._amplitude)[:, None] * np.sqrt(visible_share)
        gain = gain * float(self._radar.tx_field @ self._radar.rx_field)
        count = len(self.pixel)
        return RadarPaths(
            a=np.broadcast_to(gain, tau.shape),
            tau=tau,
            tau_rate=rate,
            times=np.asarray(times, dtype=np.float64),
            frequency=self._radar.center_frequency,
            direction=direction,
            arrival=direction,
            object_id=np.zeros(count, np.int32),
            part_id=np.zeros(count, np.int32),
            kind=np.full(count, PathKind.ENVIRONMENT, np.uint8),
            bounces=np.ones(count, np.uint8),
            object_names=(OBJECT_NAME,),
            part_names=(OBJECT_NAME,),
            facet=np.full(count, -1, np.int32),
        )

    def visible_share(self, rays: RayScene, t: float) -> FloatArray:
        """(path,) share of each pixel that nothing in `rays`, which stand as the radar sees them at `t` [s], hides."""
        rows, columns = self.view.resolution
        share = np.full(self.view.size, np.nan)
        share[self.pixel] = self._unoccluded_share(rays, t, self.pixel, GUIDES)
        # Outlines: where guiding rays disagree within a pixel or with its neighbours.
        padded = np.pad(share.reshape(rows, columns), 1, constant_values=np.nan)
        around = np.stack([padded[r : r + rows, c : c + columns] for r in range(3) for c in range(3)])
        lowest, highest = (np.where(np.isnan(around), other, around).reshape(9, -1) for other in (np.inf, -np.inf))
        outline = self.pixel[(lowest.min(axis=0) < highest.max(axis=0))[self.pixel]]
        share[outline] = self._unoccluded_share(rays, t, outline, SUBPIXELS)
        return share[self.pixel]

    def unoccluded_share(self, paths: RadarPaths) -> FloatArray:
        """(path, time) 1 for paths that end before the surroundings, falling to 0 over `SOFT_EDGE` behind them.

        Between pixels it is interpolated, so that what moves fades smoothly.
        """
        weight = np.empty((paths.num_paths, len(paths.times)))
        for k, t in enumerate(paths.times.tolist()):
            direction, origin = paths.arrival[:, k], np.asarray(self._radar.position)
            if self._radar.trajectory is not None:
                direction, origin = to_world(direction, self._radar, t), np.asarray(self._radar.at(t).position)
            weight[:, k] = self._let_through(origin + paths.range[:, k, None] * direction)
        return weight

    def occluded(self, _: FloatArray, targets: FloatArray, /) -> FloatArray:
        """(target,) how much of a return from points (target, 3) of the world [m] the surroundings keep back, 0 … 1.

        From wherever the points are looked at: it is the image's viewpoint that counts.
        """
        return 1.0 - self._let_through(targets)

    def _let_through(self, points: FloatArray) -> FloatArray:
        """(point,) 1 for points (point, 3) of the world [m] before the surroundings, falling to 0 behind them."""
        distance = np.full(self.view.size, np.inf)
        distance[self.pixel] = self._distance
        offset = points - np.asarray(self.view.position)
        return self._fade(distance, np.linalg.norm(offset, axis=1), *self.view.coordinates(offset))

    def _fade(self, distance: FloatArray, reach: FloatArray, row: FloatArray, column: FloatArray) -> FloatArray:
        """(path,) blend of what the four nearest pixels let through; outside of the view nothing hides."""
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
        """(path, 3) where the pixels' points are at `t` [s], as the radar sees them then [m]."""
        return self._apparent_positions(
            (self._distance + self._velocity * (t - self._start))[:, None] * self._directions, t
        )

    def _apparent_positions(self, offsets: FloatArray, t: float) -> FloatArray:
        """Points by their offsets from the image's viewpoint, world frame, where the radar sees them at `t` [s]."""
        points = np.asarray(self.view.position) + offsets
        return points if self._radar.trajectory is None else from_world(points, self._radar, t)

    def _delays(self, points: FloatArray) -> FloatArray:
        """(tx, rx, path) [s]"""
        to_tx, to_rx = (
            np.linalg.norm(points - ends[:, None], axis=2) for ends in (self._radar.tx_world, self._radar.rx_world)
        )
        return np.asarray((to_tx[:, None] + to_rx) / SPEED_OF_LIGHT)

    def _unoccluded_share(self, rays: RayScene, t: float, pixels: NDArray[np.intp], split: int) -> FloatArray:
        """(pixel,) share of the rays, `split` across each of `pixels`, that reach its point."""
        if len(pixels) == 0:
            return np.zeros(0)
        rows, columns = self.view.resolution
        grid = self.view.subpixels(split).reshape(rows, split, columns, split, 3).transpose(0, 2, 1, 3, 4)
        chosen = grid.reshape(self.view.size, split * split, 3)[pixels]
        own = np.searchsorted(self.pixel, pixels)
        distance = self._distance[own] + self._velocity[own] * (t - self._start)
        targets = self._apparent_positions(distance[:, None, None] * chosen, t).reshape(-1, 3)
        hidden = rays.occluded(np.asarray(self._radar.position), targets)
        return 1.0 - hidden.reshape(len(pixels), -1).mean(axis=1)


def check_image(name: str, pir: Pir) -> None:
    """Whether an image holds what a radar may receive.

    Raises
    ------
    TypeError, ValueError
        Naming the channel, its first wrong value and what is allowed.
    """
    if not isinstance(pir, Pir):
        raise TypeError(f"{name} is a {type(pir).__name__}: a Pir is needed")
    View.of(pir)
    energy, arrival, velocity = pir.energy, pir.time_of_arrival, pir.velocity
    if np.ndim(energy) != 2 or np.shape(arrival) != np.shape(energy) or np.shape(velocity) != np.shape(energy):
        shapes = np.shape(energy), np.shape(arrival), np.shape(velocity)
        raise ValueError(
            f"{name}: energy, time_of_arrival and velocity have shapes {shapes}: one (row, column) is needed"
        )
    limits = (
        ("energy", np.isfinite(energy) & (energy >= 0) & (energy <= 1), "0 … 1, as no more returns than was sent"),
        ("time_of_arrival", (energy == 0) | ((arrival > 0) & (arrival < 1e-3)), "0 … 1e-3 s where energy returns"),
        ("velocity", (energy == 0) | (np.abs(velocity) < 1e4), "-1e4 … 1e4 m/s where energy returns"),
    )
    for channel, right, allowed in limits:
        if not np.all(right):
            place = tuple(int(i) for i in np.argwhere(~right)[0])
            raise ValueError(f"{name}.{channel}{list(place)} is {getattr(pir, channel)[place]!r}: {allowed} is allowed")
