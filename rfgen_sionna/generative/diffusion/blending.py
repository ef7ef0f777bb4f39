"""Transitions between given poses and generated ones."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.diffusion.features import FRAME_RATE, LOCAL, PARTS, TRACKED_POSITIONS, TURN, from_six
from rfgen_sionna.generative.motion.resampling import runs

EASE = 0.6
"""Duration of a transition [s]: about half a step of walking."""
_PLACE, _PELVIS = (tuple(PARTS).index(part) for part in ("place", "pelvis"))
_ROTATIONS = (TURN.start, *range(LOCAL.start, LOCAL.stop, 6))
"""First columns of rotations, six each."""
_VECTORS = (TURN, TRACKED_POSITIONS)
"""Columns of consecutive vectors (x, y, z)."""


def blend_transitions(rows: FloatArray, given: NDArray[np.bool_]) -> FloatArray:
    """(frame, NUM_FEATURES) rows whose free intervals continue the given ones.

    Heading and place on the floor are shifted rigidly, with a gradual transition between two given intervals; all other
    features converge within `EASE`.

    Args:
        rows: in their own units.
        given: (frame, part) whether parts are given; given parts stay unchanged.
    """
    out = rows.copy()
    for start, stop in runs(~(given[:, _PLACE] | given[:, _PELVIS])):
        ends = [given[frame, [_PLACE, _PELVIS]].all() for frame in (start - 1, min(stop, len(rows) - 1))]
        before, after = out[:start] if ends[0] else out[:0], out[stop:] if ends[1] else out[len(out) :]
        out[start:stop] = _turned(out[start:stop], before, after)
    for part, (name, columns) in enumerate(PARTS.items()):
        for start, stop in runs(~given[:, part]):
            own = out[:, list(columns)]
            shift = _shift(own[start:stop], own[:start], own[stop:], whole=name == "place")
            joints = [k for k in _ROTATIONS if k in columns]
            turned = [_carried(out[:, k : k + 6], start, stop) for k in joints]
            out[start:stop, list(columns)] += shift
            for k, rotations in zip(joints, turned, strict=True):
                out[start:stop, k : k + 6] = rotations
    return out


def _turned(rows: FloatArray, before: FloatArray, after: FloatArray) -> FloatArray:
    """Free rows turned about the vertical to continue the heading of the given rows around them."""
    heading, *beside = (np.unwrap(np.arctan2(each[:, TURN][:, 1], each[:, TURN][:, 0]))[:, None]
                        for each in (rows, before, after))  # fmt: skip
    angle = _shift(heading, *beside, whole=True, period=2 * np.pi)[:, 0]
    cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]

    def turn(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        return cos * x - sin * y, sin * x + cos * y

    out = rows.copy()
    for columns in _VECTORS:
        x, y = (np.arange(columns.start + axis, columns.stop, 3) for axis in (0, 1))
        out[:, x], out[:, y] = turn(rows[:, x], rows[:, y])
    steps = np.diff(rows[:, :2], axis=0, prepend=rows[:1, :2])
    out[:, :2] = rows[:1, :2] + np.cumsum(np.hstack(turn(steps[:, :1], steps[:, 1:])), axis=0)
    return out


def _shift(
    rows: FloatArray, before: FloatArray, after: FloatArray, *, whole: bool, period: float | None = None
) -> FloatArray:
    """(frame, column) offset of free `rows` between given ones, either of which may be empty; `whole` spreads it over
    the interval. Angles have a `period`."""
    count = len(rows)
    ends = []
    if len(before):
        ends.append((_onward(before[::-1]) - rows[0], np.arange(count)))
    if len(after):
        ends.append((_onward(after) - rows[-1], np.arange(count)[::-1]))
    total = np.zeros((count, rows.shape[1]))
    for gap, away in ends:
        if period is not None:
            gap = gap - period * np.rint(gap / period)
        reach = (count if len(ends) > 1 else np.inf) if whole else EASE * FRAME_RATE
        ramp = np.clip(away / reach, 0.0, 1.0)
        total += (0.5 + 0.5 * np.cos(np.pi * ramp))[:, None] * gap
    return total


def _carried(six: FloatArray, start: int, stop: int) -> FloatArray:
    """(frame, 6) free rotations of one joint from `start` to `stop`, turned about a fixed axis towards the given
    ones."""
    own = Rotation.from_matrix(from_six(six))
    free = out = own[start:stop]
    count = stop - start
    for beside, end, away in (
        (own[:start][::-1], 0, np.arange(count)),
        (own[stop:], count - 1, np.arange(count)[::-1]),
    ):
        if not len(beside):
            continue
        onward = beside[0] * beside[1].inv() * beside[0] if len(beside) > 1 else beside[0]
        ramp = 0.5 + 0.5 * np.cos(np.pi * np.clip(away / (EASE * FRAME_RATE), 0.0, 1.0))
        out = Rotation.from_rotvec(ramp[:, None] * (onward * free[end].inv()).as_rotvec()) * out
    return np.asarray(out.as_matrix()[:, :, :2].transpose(0, 2, 1).reshape(count, 6))


def _onward(given: FloatArray) -> FloatArray:
    """Linear extrapolation of given frames, the nearest first."""
    return np.asarray(2.0 * given[0] - given[1] if len(given) > 1 else given[0])
