"""Where a made motion takes place on the floor, and which way it turns there."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from rfgen_sionna.generative.diffusion.features import PLACES, TURN, heading, turned
from rfgen_sionna.generative.diffusion.synthesis import FRAME_RATE
from rfgen_sionna.records import FloatArray

_FASTEST = 9.0
"""Rate of turning beyond which the pelvis flips rather than turns [rad/s]: brisk about-turns take half a second."""
_TURNS = (0.1, 0.15, 0.2, 0.3, 0.4)
"""Times over which flips are spread, the shortest that does [s]."""


def settled(rows: FloatArray) -> FloatArray:
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
            # the nearer of both senses: the person still starts facing ahead
            yaw -= np.pi * np.round(yaw / np.pi)
            if abs(yaw) < np.radians(25.0):
                out = turned(out, -yaw)
                out[:, :2] -= 0.5 * (out[:, :2].min(axis=0) + out[:, :2].max(axis=0))
    return out


def turning(rows: FloatArray) -> FloatArray:
    """Feature rows in which nobody turns round faster than people can.

    Where the network leaves open which way somebody turns, the two ways cancel each other halfway, and what is left
    flips from one pose to the next.
    """
    yaw = heading(rows)
    even = yaw
    for width in _TURNS:
        fast = np.abs(np.gradient(even)) * FRAME_RATE > _FASTEST
        if not fast.any():
            break
        reach = round(3.0 * width * FRAME_RATE)
        share = maximum_filter1d(fast.astype(np.float64), 2 * reach + 1)
        share = gaussian_filter1d(share, 0.3 * reach, mode="nearest")
        even = yaw + share * (gaussian_filter1d(yaw, width * FRAME_RATE, mode="nearest") - yaw)
    turn = even - yaw
    if not turn.any():
        return rows
    c, s = np.cos(turn)[:, None], np.sin(turn)[:, None]
    out = rows.copy()
    for part in (TURN, PLACES):
        vectors = rows[:, part].reshape(len(rows), -1, 3)
        x, y = vectors[..., 0], vectors[..., 1]
        out[:, part] = np.stack([c * x - s * y, s * x + c * y, vectors[..., 2]], axis=-1).reshape(len(rows), -1)
    return out


def put_back(rows: FloatArray, where: FloatArray) -> FloatArray:
    """Rows that start over the origin facing ahead, moved to where other rows start."""
    out = turned(rows, float(np.arctan2(where[0, TURN.start + 1], where[0, TURN.start])))
    out[:, :2] += where[0, :2] - out[0, :2]
    return out
