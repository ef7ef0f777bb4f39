"""Sketches: a furnished place built of bricks, seen as an image is, for the network to paint over.

A small network learns what a sofa or a hedge returns sooner than where one stands, that walls are flat, and how a room
looks from elsewhere. So the furnishing of :mod:`rfgen_sionna.scene.furnished` decides where things stand, and each is
built of a few bricks (:mod:`.primitives`). What the network is told of a pixel is the brick in front of it: range,
incidence, where on the piece, of which kind; and how far floor and walls lie. Surfaces, glints of what isn't flat, and
what is too small for a brick are the network's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray
from rfgen_sionna.generative.environment.primitives import PrimitiveScene
from rfgen_sionna.pir.codec import PirCodec
from rfgen_sionna.pir.view import View

CHANNELS = 7
"""Range and range of the shell as :class:`PirCodec` has them, cosine of incidence, three coordinates on the piece in
-1 … 1, and the number of the kind."""
NO_LAYOUT_MAP = -1.0
"""Value of the last channel all over an image that has no sketch."""
_BLOCK = 64
"""Pieces that are cast at once: memory stays small."""


def render_layout_map(place: PrimitiveScene, view: View) -> LayoutMap:
    """What a view shows of a place of bricks. A brick around the viewpoint is not seen."""
    rays = view.directions.reshape(-1, 3)
    nearest, behind = np.full(len(rays), np.inf), np.full(len(rays), np.inf)
    facing, front = np.zeros(len(rays)), np.full(len(rays), -1, np.intp)
    starts = np.searchsorted(place.owner, np.arange(len(place.kinds) + 1))
    for block in range(0, len(place.kinds), _BLOCK):
        enters, cosine = place.bounding_boxes[block : block + _BLOCK].cast(view.position, rays)
        for piece, (reach, own) in enumerate(zip(enters, cosine, strict=True), start=block):
            if piece < place.shell:
                reach = np.where(reach > 0.0, reach, np.inf)
                behind = np.minimum(behind, reach)
            else:
                met = np.flatnonzero(reach < nearest)
                if not len(met):
                    continue
                parts = place.parts[starts[piece] : starts[piece + 1]]
                each, cosines = parts.cast(view.position, rays[met])
                each[each <= 0.0] = np.inf
                best = each.argmin(axis=0)
                reach, own = np.full(len(rays), np.inf), np.zeros(len(rays))
                reach[met], own[met] = (np.take_along_axis(x, best[None], 0)[0] for x in (each, cosines))
            closer = reach < nearest
            nearest[closer], facing[closer], front[closer] = reach[closer], own[closer], piece
    there = front >= 0
    points = np.array(view.position) + np.where(there, nearest, 0.0)[:, None] * rays
    own = np.where((front >= place.shell)[:, None], place.bounding_boxes.own(points, front), 0.0)
    return LayoutMap(
        np.where(there, nearest, np.nan).reshape(view.resolution),
        np.where(np.isfinite(behind), behind, np.nan).reshape(view.resolution),
        facing.reshape(view.resolution),
        own.clip(-1.0, 1.0).reshape(*view.resolution, 3),
        front.reshape(view.resolution),
    )


@dataclass(frozen=True)
class LayoutMap:
    """A place of bricks as a view shows it, (row, column)."""

    range: FloatArray
    """[m]; NaN where there is nothing."""
    shell: FloatArray
    """Range of floor, walls and openings alone [m]; NaN where there are none."""
    cosine: FloatArray
    """Of the incidence."""
    place: FloatArray
    """(row, column, 3) where on a piece of furniture, along its own axes from -1 to 1. 0 elsewhere."""
    piece: NDArray[np.integer]
    """Which one of the place; -1 is none."""

    def kinds(self, place: PrimitiveScene, share: float = 0.004) -> list[str]:
        """What fills at least a share of the view, the largest first."""
        index, count = np.unique(self.piece[self.piece >= 0], return_counts=True)
        total: dict[str, int] = {}
        for which, pixels in zip(index.tolist(), count.tolist(), strict=True):
            total[place.kinds[which]] = total.get(place.kinds[which], 0) + pixels
        ordered = sorted(total, key=lambda kind: -total[kind])
        return [kind for kind in ordered if total[kind] >= share * self.piece.size]

    def channels(self, place: PrimitiveScene, known: Sequence[str], codec: PirCodec) -> NDArray[np.float32]:
        """(CHANNELS, row, column) as a network is given it that knows some kinds; see :func:`encode_layout_map`."""
        kind = kind_numbers(place.kinds, known)[self.piece]
        return encode_layout_map(
            self.range, self.shell, self.cosine, self.place, np.where(self.piece < 0, 0, kind), codec
        )


def kind_numbers(kinds: Sequence[str], known: Sequence[str]) -> NDArray[np.integer]:
    """What each of `kinds` counts as for a network: from 1 in the order of those that it knows, 0 for others."""
    table = {name: number for number, name in enumerate(known, start=1)}
    return np.array([table.get(kind, 0) for kind in kinds], dtype=np.int64)


def encode_layout_map(
    reach: FloatArray,
    shell: FloatArray,
    cosine: FloatArray,
    place: FloatArray,
    kind: NDArray[np.integer],
    codec: PirCodec,
) -> NDArray[np.float32]:
    """(…, CHANNELS, row, column) from the fields of a :class:`LayoutMap` and the numbers of the kinds (…, row,
    column)."""
    one, two = (
        codec.encode_arrays(np.isfinite(x), 2 / SPEED_OF_LIGHT * x, np.zeros(x.shape), clip=True)[..., 1, :, :]
        for x in (np.asarray(reach, np.float64), np.asarray(shell, np.float64))
    )
    return np.stack([one, two, cosine, *np.moveaxis(np.asarray(place), -1, 0), kind], axis=-3).astype(np.float32)


def mirrored(layout_map: NDArray[np.float32]) -> NDArray[np.float32]:
    """Of the images (…, CHANNELS, row, column) whose columns are swapped."""
    out = np.array(layout_map[..., ::-1])
    out[..., 3, :, :] *= -1.0
    return out
