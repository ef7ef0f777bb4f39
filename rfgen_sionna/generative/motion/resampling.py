"""Motions at other rates, and runs of frames."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from rfgen_sionna.records import Motion


def resample_motion(motion: Motion, rate: float) -> Motion:
    """The motion at another rate, along cubic splines through its poses."""
    n = len(motion.translation)
    if n < 2 or rate == motion.frame_rate:
        return motion
    t = np.arange(n) / motion.frame_rate
    fine = np.arange(int(np.floor((n - 1) * rate / motion.frame_rate + 1e-9)) + 1) / rate
    quaternions = CubicSpline(t, motion.rotations.reshape(n, -1))(fine).reshape(len(fine), -1, 4)
    contacts = motion.contacts
    if contacts is not None:
        contacts = contacts[np.minimum(np.round(fine * motion.frame_rate).astype(int), n - 1)]
    return replace(
        motion,
        rotations=quaternions / np.linalg.norm(quaternions, axis=-1, keepdims=True),
        translation=np.asarray(CubicSpline(t, motion.translation)(fine), np.float64),
        frame_rate=rate,
        contacts=contacts,
    )


def runs(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """(first, last + 1) of each run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
