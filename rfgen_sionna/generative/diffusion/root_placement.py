"""Placement of the root: position and direction on the floor, limits of turn rate and speed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, gaussian_filter1d, maximum_filter1d

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.diffusion.features import (
    CONTACTS,
    FRAME_RATE,
    LOCAL,
    TRACKED_POSITIONS,
    TURN,
    from_six,
    heading,
    joint_positions,
    turned,
)
from rfgen_sionna.generative.motion.foot_lock import TRANSITION
from rfgen_sionna.generative.motion.rotations import to_matrices, to_quaternions

_FASTEST = 9.0
"""Largest turn rate of the pelvis [rad/s]: brisk about-turns take half a second."""
_TURNS = (0.1, 0.15, 0.2, 0.3, 0.4)
"""Widths of the smoothing of fast turns, the first sufficient one is used [s]."""
_SWIFTEST = 9.0
"""Largest speed of a joint [m/s]: feet of runners, hands of boxers."""
_FASTEST_SPIN = 20.0
"""Largest turn rate of a joint against its parent [rad/s]."""
_SPREAD = (*_TURNS, 0.6, 0.8)
"""Widths of the smoothing of jumps [s]."""


def centre_on_origin(rows: FloatArray) -> FloatArray:
    """Feature rows with the middle of the path over the origin, and a walk back and forth along x."""
    out = rows.copy()
    low, high = rows[:, :2].min(axis=0), rows[:, :2].max(axis=0)
    out[:, :2] -= 0.5 * (low + high)
    if np.linalg.norm(high - low) > 0.6:
        centred = out[:, :2] - out[:, :2].mean(axis=0)
        values, axes = np.linalg.eigh(centred.T @ centred)
        x, y = axes[:, -1]
        if values[0] < 0.1 * values[-1]:
            yaw = np.arctan2(y, x)
            # nearer sense: the person still starts facing ahead
            yaw -= np.pi * np.round(yaw / np.pi)
            if abs(yaw) < np.radians(25.0):
                out = turned(out, -yaw)
                out[:, :2] -= 0.5 * (out[:, :2].min(axis=0) + out[:, :2].max(axis=0))
    return out


def limit_turn_rate(rows: FloatArray) -> FloatArray:
    """Feature rows with a turn rate that people reach; faster turns are smoothed."""
    yaw = heading(rows)
    even = yaw
    for width in _TURNS:
        fast = np.abs(np.gradient(even)) * FRAME_RATE > _FASTEST
        if not fast.any():
            break
        reach = round(3.0 * width * FRAME_RATE)
        share = maximum_filter1d(fast.astype(np.float64), 2 * reach + 1)
        share = gaussian_filter1d(share, 0.3 * reach, mode="nearest")
        even = even + share * (gaussian_filter1d(even, width * FRAME_RATE, mode="nearest") - even)
    turn = even - yaw
    if not turn.any():
        return rows
    c, s = np.cos(turn)[:, None], np.sin(turn)[:, None]
    out = rows.copy()
    for part in (TURN, TRACKED_POSITIONS):
        vectors = rows[:, part].reshape(len(rows), -1, 3)
        x, y = vectors[..., 0], vectors[..., 1]
        out[:, part] = np.stack([c * x - s * y, s * x + c * y, vectors[..., 2]], axis=-1).reshape(len(rows), -1)
    return out


def free_placement(rows: FloatArray) -> FloatArray:
    """Feature rows centred on the origin, with a turn rate and speeds that people reach."""
    return centre_on_origin(limit_speed(limit_turn_rate(rows)))


def limit_speed(rows: FloatArray, free: NDArray[np.bool_] | None = None) -> FloatArray:
    """Feature rows with speeds that people reach; jumps between poses are smoothed.

    Args:
        rows: in their own units.
        free: (frame,) rows that may change; None allows all.
    """
    out = rows
    turns = slice(TURN.start, LOCAL.stop)
    others = np.setdiff1d(
        np.arange(rows.shape[1]), [*range(turns.start, turns.stop), *range(CONTACTS.start, CONTACTS.stop)]
    )
    may = np.ones(len(rows))
    if free is not None and not free.all():
        may = np.clip(distance_transform_edt(free) / (TRANSITION * FRAME_RATE), 0.0, 1.0)
    for width in _SPREAD:
        fast = _jumps(out) & (may > 0.0)
        if not fast.any():
            break
        reach = round(3.0 * width * FRAME_RATE)
        share = maximum_filter1d(fast.astype(np.float64), 2 * reach + 1)
        share = may * gaussian_filter1d(share, 0.3 * reach, mode="nearest")
        before, out = out, out.copy()
        quaternions = to_quaternions(from_six(before[:, turns].reshape(len(rows), -1, 6)))
        for values, columns in ((before[:, others], others), (quaternions, turns)):
            even = gaussian_filter1d(values, width * FRAME_RATE, axis=0, mode="nearest")
            new = values + share.reshape(-1, *[1] * (values.ndim - 1)) * (even - values)
            new = new if columns is others else _to_six(new)
            out[:, columns] = np.where(share[:, None] > 0.0, new, before[:, columns])
    return out


def _to_six(quaternions: FloatArray) -> FloatArray:
    """(frame, 6 joint) columns of (frame, joint, 4) quaternions of any length."""
    return np.swapaxes(to_matrices(quaternions)[..., :2], -1, -2).reshape(len(quaternions), -1)


def _jumps(rows: FloatArray) -> NDArray[np.bool_]:
    """(frame,) rows with a joint that is too fast, to the next row or from the previous one."""
    speed = np.linalg.norm(np.diff(joint_positions(rows), axis=0), axis=-1) * FRAME_RATE
    six = rows[:, TURN.start : LOCAL.stop].reshape(len(rows), -1, 6)
    turn = from_six(six)
    cosine = 0.5 * (np.einsum("fjkl,fjkl->fj", turn[1:], turn[:-1]) - 1.0)
    rate = np.arccos(np.clip(cosine, -1.0, 1.0)) * FRAME_RATE
    fast = (speed > _SWIFTEST).any(axis=1) | (rate > _FASTEST_SPIN).any(axis=1)
    return np.concatenate([fast, [False]]) | np.concatenate([[False], fast])


def move_to_start(rows: FloatArray, where: FloatArray) -> FloatArray:
    """Rows from the origin facing +x, moved to the start of other rows."""
    out = turned(rows, float(np.arctan2(where[0, TURN.start + 1], where[0, TURN.start])))
    out[:, :2] += where[0, :2] - out[0, :2]
    return out
