"""Layout maps: images of a furnished place built of primitives, input of the network.

:mod:`rfgen_sionna.scene.furnished` places the furniture, and :mod:`.primitives` builds it. A pixel holds the primitive
in front: range, incidence, place on the object, kind; and the range of floor and walls. The network adds surfaces,
returns of bent surfaces and small objects.
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
"""Range and range of the shell as in :class:`PirCodec`, cosine of incidence, three coordinates on the object in −1 … 1,
and number of the kind."""
NO_LAYOUT_MAP = -1.0
"""Last channel of an image without a layout map."""
_BLOCK = 64
"""Objects per batch of rays; bounds memory."""


def render_layout_map(place: PrimitiveScene, view: View) -> LayoutMap:
    """Layout map of a view. A primitive around the viewpoint is invisible."""
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
    """Layout map of a view, (row, column)."""

    range: FloatArray
    """[m]; NaN for empty pixels."""
    shell: FloatArray
    """Range of floor, walls and openings [m]; NaN without them."""
    cosine: FloatArray
    """Cosine of the angle of incidence."""
    place: FloatArray
    """(row, column, 3) coordinates on a piece of furniture, along its axes, −1 … 1; 0 elsewhere."""
    piece: NDArray[np.integer]
    """Index of the object in the place; −1 for none."""

    def kinds(self, place: PrimitiveScene, share: float = 0.004) -> list[str]:
        """Kinds that fill at least a share of the view, the largest first."""
        index, count = np.unique(self.piece[self.piece >= 0], return_counts=True)
        total: dict[str, int] = {}
        for which, pixels in zip(index.tolist(), count.tolist(), strict=True):
            total[place.kinds[which]] = total.get(place.kinds[which], 0) + pixels
        ordered = sorted(total, key=lambda kind: -total[kind])
        return [kind for kind in ordered if total[kind] >= share * self.piece.size]

    def channels(self, place: PrimitiveScene, known: Sequence[str], codec: PirCodec) -> NDArray[np.float32]:
        """(CHANNELS, row, column) input of a network with `known` kinds; see :func:`encode_layout_map`."""
        kind = kind_numbers(place.kinds, known)[self.piece]
        return encode_layout_map(
            self.range, self.shell, self.cosine, self.place, np.where(self.piece < 0, 0, kind), codec
        )


def kind_numbers(kinds: Sequence[str], known: Sequence[str]) -> NDArray[np.integer]:
    """Numbers of `kinds` in a network: from 1 in the order of `known`, 0 for others."""
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
    """(…, CHANNELS, row, column) from the fields of a :class:`LayoutMap` and numbers of the kinds (…, row, column)."""
    one, two = (
        codec.encode_arrays(np.isfinite(x), 2 / SPEED_OF_LIGHT * x, np.zeros(x.shape), clip=True)[..., 1, :, :]
        for x in (np.asarray(reach, np.float64), np.asarray(shell, np.float64))
    )
    return np.stack([one, two, cosine, *np.moveaxis(np.asarray(place), -1, 0), kind], axis=-3).astype(np.float32)
