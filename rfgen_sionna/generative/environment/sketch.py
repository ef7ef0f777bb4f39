"""Sketches: a furnished place built of bricks, seen as an image is, for the network to paint over.

A small network learns what a sofa or a hedge returns sooner than where one stands, that walls are flat, and how a room
looks from elsewhere. So the furnishing of :mod:`rfgen_sionna.scene.furnished` decides where things stand; each becomes
one upright box. What the network is told of a pixel is the box in front of it: range, incidence, where on the box, of
which kind; and how far floor and walls lie. Shapes, materials, brightness and glints are the network's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.pir.codec import PirCodec
from rfgen_sionna.pir.view import View
from rfgen_sionna.records import SPEED_OF_LIGHT, FloatArray

if TYPE_CHECKING:
    from rfgen_sionna.scene.furnished.scene import FurnishedScene

CHANNELS = 7
"""Range and range of the shell as :class:`PirCodec` has them, cosine of incidence, three coordinates on the box in
-1 … 1, and the number of the kind."""
NONE = -1.0
"""Value of the last channel all over an image that has no sketch."""
_OUT_OF_WALL = 0.12
"""Openings lie this far within their walls [m], whose bricks are whole: theirs are thicker."""
_OPENINGS = ("door", "window", "garage door")
_BLOCK = 64
"""Bricks that are cast at once: memory stays small."""


@dataclass(frozen=True)
class Bricks:
    """Upright boxes."""

    centre: FloatArray
    """(brick, 3) [m]."""
    half: FloatArray
    """(brick, 3) half extents along their own axes [m]; some are flat."""
    yaw: FloatArray
    """(brick,) [rad]."""
    kinds: tuple[str, ...]
    """(brick,) what each stands for."""
    shell: int
    """How many are floor, walls, doors and windows; they come first."""

    @classmethod
    def of(cls, scene: FurnishedScene) -> Bricks:
        """One for each piece of furniture, each wall, and each part of doors and windows."""
        centre, half, yaw, kinds = [], [], [], []

        def add(kind: str, points: FloatArray, turned: float, grown: float = 0.0) -> None:
            c, s = np.cos(turned), np.sin(turned)
            own = points @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
            low, high = own.min(axis=0), own.max(axis=0)
            middle = 0.5 * (low + high)
            centre.append(middle @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]))
            half.append(0.5 * (high - low) + (grown, grown, 0.0))
            yaw.append(turned)
            kinds.append(kind)

        for kind, points in scene.shell:
            if kind == "ground":  # of a meadow with its bumps: a plane
                points = points * (1.0, 1.0, 0.0)
            add(kind, points, 0.0, _OUT_OF_WALL if kind in _OPENINGS else 0.0)
        shell = len(kinds)
        for item in scene.layout.items:
            add(item.kind, np.concatenate([part.points for part in item.parts]), float(np.radians(item.yaw)))
        return cls(np.array(centre), np.array(half), np.array(yaw), tuple(kinds), shell)

    def shown(self, view: View) -> Sketch:
        """What is seen of them. A brick around the viewpoint is not."""
        rays = view.directions.reshape(-1, 3)
        blocks = [self._cast(slice(k, k + _BLOCK), view, rays) for k in range(0, len(self.kinds), _BLOCK)]
        reach, facing = (np.concatenate(parts) for parts in zip(*blocks, strict=True))
        front, column = reach.argmin(axis=0), np.arange(len(rays))
        nearest = reach[front, column]
        there = np.isfinite(nearest)
        met = np.array(view.position) + np.where(there, nearest, 0.0)[:, None] * rays - self.centre[front]
        c, s = np.cos(self.yaw[front]), np.sin(self.yaw[front])
        own = np.stack([c * met[:, 0] + s * met[:, 1], c * met[:, 1] - s * met[:, 0], met[:, 2]], axis=-1)
        own = np.divide(own, self.half[front], out=np.zeros_like(own), where=self.half[front] > 1e-6)
        furniture = there & (front >= self.shell)
        behind = reach[: self.shell].min(axis=0, initial=np.inf)
        return Sketch(
            np.where(there, nearest, np.nan).reshape(view.resolution),
            np.where(np.isfinite(behind), behind, np.nan).reshape(view.resolution),
            np.where(there, facing[front, column], 0.0).reshape(view.resolution),
            np.where(furniture[:, None], own, 0.0).clip(-1.0, 1.0).reshape(*view.resolution, 3),
            np.where(there, front, -1).reshape(view.resolution),
        )

    def _cast(self, part: slice, view: View, rays: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(brick, ray) range at which each ray enters each of some bricks, inf for none; cosine of incidence."""
        half, yaw = self.half[part], self.yaw[part]
        c, s = np.cos(yaw), np.sin(yaw)
        offset = np.array(view.position) - self.centre[part]
        start = np.stack([c * offset[:, 0] + s * offset[:, 1], c * offset[:, 1] - s * offset[:, 0], offset[:, 2]])
        along = np.stack(
            [
                c[:, None] * rays[:, 0] + s[:, None] * rays[:, 1],
                c[:, None] * rays[:, 1] - s[:, None] * rays[:, 0],
                np.broadcast_to(rays[:, 2], (len(yaw), len(rays))),
            ]
        )
        inverse = 1.0 / np.where(np.abs(along) < 1e-12, 1e-12, along)
        one, other = (-half.T - start)[..., None] * inverse, (half.T - start)[..., None] * inverse
        first = np.minimum(one, other)
        enters, leaves = first.max(axis=0), np.maximum(one, other).min(axis=0)
        met = (enters <= leaves) & (enters > 0.0)
        facing = np.take_along_axis(np.abs(along), first.argmax(axis=0)[None], axis=0)[0]
        return np.where(met, enters, np.inf), facing


@dataclass(frozen=True)
class Sketch:
    """Bricks as a view shows them, (row, column)."""

    range: FloatArray
    """[m]; NaN where there is nothing."""
    shell: FloatArray
    """Range of floor, walls and openings alone [m]; NaN where there are none."""
    cosine: FloatArray
    """Of the incidence."""
    place: FloatArray
    """(row, column, 3) where on a piece of furniture, along its own axes; its surfaces are at -1 and 1. 0 elsewhere."""
    brick: NDArray[np.integer]
    """Which one; -1 is none."""

    def kinds(self, bricks: Bricks, share: float = 0.004) -> list[str]:
        """What fills at least a share of the view, the largest first."""
        index, count = np.unique(self.brick[self.brick >= 0], return_counts=True)
        total: dict[str, int] = {}
        for which, pixels in zip(index.tolist(), count.tolist(), strict=True):
            total[bricks.kinds[which]] = total.get(bricks.kinds[which], 0) + pixels
        ordered = sorted(total, key=lambda kind: -total[kind])
        return [kind for kind in ordered if total[kind] >= share * self.brick.size]

    def channels(self, bricks: Bricks, known: Sequence[str], codec: PirCodec) -> NDArray[np.float32]:
        """(CHANNELS, row, column) as a network is given it that knows some kinds; see :func:`encode`."""
        kind = numbers(bricks.kinds, known)[self.brick]
        return encode(self.range, self.shell, self.cosine, self.place, np.where(self.brick < 0, 0, kind), codec)


def numbers(kinds: Sequence[str], known: Sequence[str]) -> NDArray[np.integer]:
    """What each of `kinds` counts as for a network: from 1 in the order of those that it knows, 0 for others."""
    table = {name: number for number, name in enumerate(known, start=1)}
    return np.array([table.get(kind, 0) for kind in kinds], dtype=np.int64)


def encode(
    reach: FloatArray,
    shell: FloatArray,
    cosine: FloatArray,
    place: FloatArray,
    kind: NDArray[np.integer],
    codec: PirCodec,
) -> NDArray[np.float32]:
    """(…, CHANNELS, row, column) from the fields of a :class:`Sketch` and the numbers of the kinds (…, row, column)."""
    one, two = (
        codec.encode_arrays(np.isfinite(x), 2 / SPEED_OF_LIGHT * x, np.zeros(x.shape), clip=True)[..., 1, :, :]
        for x in (np.asarray(reach, np.float64), np.asarray(shell, np.float64))
    )
    return np.stack([one, two, cosine, *np.moveaxis(np.asarray(place), -1, 0), kind], axis=-3).astype(np.float32)


def no_sketch(count: int, rows: int, columns: int) -> NDArray[np.float32]:
    """(count, CHANNELS, row, column) of images without one."""
    out = np.zeros((count, CHANNELS, rows, columns), np.float32)
    out[:, -1] = NONE
    return out


def mirrored(sketch: NDArray[np.float32]) -> NDArray[np.float32]:
    """Of the images (…, CHANNELS, row, column) whose columns are swapped."""
    out = np.array(sketch[..., ::-1])
    out[..., 3, :, :] *= -1.0
    return out
