"""Pieces of faces that glints are looked for in."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.records import FloatArray
from rfgen_sionna.tracing.glints import unit_normals
from rfgen_sionna.tracing.smooth import QUARTERS
from rfgen_sionna.tracing.tubes.skin import Skin

TURN, SHARP = 0.15, 0.5
"""Largest angle between the normals of a piece's corners [rad]: over more, misses are not linear any more; and where
faces are bent more sharply than `ROUND`, which return little."""
ROUND = 0.1
"""Radius of curvature [m]."""
MOST_DIVISIONS = 3
LONG, ASLANT = 0.1, 0.03
"""Longest edge of a piece [m], and over its distance from the radar: along a cylinder's side normals don't turn, but
where rays go from there does."""
_ALIKE = 1e-7
"""Corners of pieces are the same where places [m] and normals are alike to this."""


@dataclass(frozen=True)
class Pieces:
    """Pieces of faces that are searched for glints."""

    facet: NDArray[np.int64]
    """(piece,) face of the ray scene."""
    corners: FloatArray
    """(piece, corner, vertex) barycentric coordinates."""
    turn: FloatArray
    """(piece,) about how much normals turn over each [rad]."""
    node: NDArray[np.intp]
    """(piece, corner) which of the nodes each corner is: neighbours share them where normals go on smoothly."""
    at: NDArray[np.intp]
    """(node,) a corner of a piece, counted through all of them, that it is."""

    @staticmethod
    def of(skin: Skin, facet: NDArray[np.int64], source: FloatArray) -> Pieces:
        """Of some faces, divided until normals turn by no more than `TURN` over a piece, or `SHARP`, and none is longer
        than `LONG`, or `ASLANT` times its distance from the `source` (3,) [m]."""
        normals, ends = skin.normals[facet], skin.corners[facet]
        cos = np.einsum("fci,fci->fc", normals, normals[:, [1, 2, 0]]).min(axis=1, initial=1.0)
        turn = np.arccos(np.clip(cos, -1.0, 1.0))
        width = np.sqrt(((ends - ends[:, [1, 2, 0]]) ** 2).sum(axis=2)).max(axis=1, initial=0.0)
        most = np.where(width < ROUND * turn, SHARP, TURN)
        times = np.ceil(np.log2(np.maximum(turn / most, 1.0))).clip(0, MOST_DIVISIONS).astype(int)
        faces, parts, turns = [np.zeros(0, np.int64)], [np.zeros((0, 3, 3))], [np.zeros(0)]
        for count in range(MOST_DIVISIONS + 1):
            own, weights = facet[times == count], np.eye(3)[None]
            for _ in range(count):
                weights = np.einsum("qcv,pvw->pqcw", QUARTERS, weights).reshape(-1, 3, 3)
            faces.append(np.repeat(own, len(weights)))
            parts.append(np.tile(weights, (len(own), 1, 1)))
            turns.append(np.repeat(turn[times == count] / 2**count, len(weights)))
        of, corners, turn = _shortened(
            skin, source, np.concatenate(faces), np.concatenate(parts), np.concatenate(turns)
        )
        lane, place = np.repeat(of, 3), corners.reshape(-1, 3)
        _, point = skin.places(lane, place)
        known = np.round(np.column_stack([point, unit_normals(skin, lane, place)]) / _ALIKE).astype(np.int64)
        known = np.column_stack([known, skin.sheet[lane]])
        _, at, node = np.unique(known, axis=0, return_index=True, return_inverse=True)
        return Pieces(of, corners, turn, node.reshape(-1, 3), at)


def _shortened(
    skin: Skin, source: FloatArray, of: NDArray[np.int64], corners: FloatArray, turn: FloatArray
) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
    """Pieces of faces `of` (piece,) with `corners` (piece, corner, vertex) and their `turn` (piece,), halved across
    their longest edges until these are no longer than they may be, seen from the `source`."""
    done: list[tuple[NDArray[np.int64], FloatArray, FloatArray]] = []
    while True:
        ends = corners @ skin.corners[of]
        sides = np.sqrt(((ends[:, [1, 2, 0]] - ends[:, [2, 0, 1]]) ** 2).sum(axis=2))  # opposite corner
        near = np.sqrt(((ends - source) ** 2).sum(axis=2)).min(axis=1, initial=np.inf)
        long = sides.max(axis=1, initial=0.0) > np.maximum(LONG, ASLANT * near)
        done.append((of[~long], corners[~long], turn[~long]))
        if not long.any():
            break
        row, edge = np.arange(int(long.sum())), sides[long].argmax(axis=1)
        apex, left, right = (corners[long][row, (edge + k) % 3] for k in range(3))
        middle = 0.5 * (left + right)
        halves = [np.stack([apex, left, middle], axis=1), np.stack([apex, middle, right], axis=1)]
        of, corners, turn = np.tile(of[long], 2), np.concatenate(halves), np.tile(turn[long], 2)
    faces, parts, turns = zip(*done, strict=True)
    return np.concatenate(faces), np.concatenate(parts), np.concatenate(turns)
