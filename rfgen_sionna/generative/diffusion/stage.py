"""Where a made motion takes place on the floor."""

from __future__ import annotations

import numpy as np

from rfgen_sionna.generative.diffusion.features import TURN, turned
from rfgen_sionna.records import FloatArray


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


def put_back(rows: FloatArray, where: FloatArray) -> FloatArray:
    """Rows that start over the origin facing ahead, moved to where other rows start."""
    out = turned(rows, float(np.arctan2(where[0, TURN.start + 1], where[0, TURN.start])))
    out[:, :2] += where[0, :2] - out[0, :2]
    return out
