"""Walks along a path on the floor by motion path editing (Gleicher 2001): the walked path is replaced by another."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.motion.resampling import resample_motion
from rfgen_sionna.generative.motion.rotations import continuous
from rfgen_sionna.records import Motion

REFERENCE_SPEED = 1.1
"""Walking speed of a mean adult at pace 1 [m/s]."""
SPEEDS = (0.4, 2.2)
"""Range of mean speeds along a path [m/s]: slow to fast walking."""
SHORTEST = 0.1
"""Shortest duration of a path [s]."""
LONGER = 1.5
"""Factor on the sampled duration, so that slow walks reach the end."""
_CORNER = 0.3
"""Width of the Gaussian that rounds corners [m]; about half a step."""
_TURN = 0.12
"""Width of the smoothing of the heading along the path [m]."""
_STEP_PERIOD = 0.5
"""Width of the smoothing that removes steps and sway from a walked path [s]."""
_STEP = 0.01
"""Resolution of a path [m]; well below its rounding."""


def check_path(path: ArrayLike, duration: float) -> FloatArray:
    """(point, 2) places on the floor [m], checked.

    Raises:
        ValueError: fewer than two points, values that are not finite, too short a duration, or a mean speed out of
            range, with rounded corners.
    """
    points = np.asarray(path, np.float64)
    if points.ndim != 2 or points.shape[1] != 2 or len(points) < 2 or not np.isfinite(points).all():
        raise ValueError(f"path: shape {points.shape}; allowed are two or more finite points (x, y) in metres")
    if duration < SHORTEST:
        raise ValueError(f"duration: {duration:g} s with a path; allowed is {SHORTEST:g} s and more")
    length, (low, high) = _length(points), SPEEDS
    if not low <= length / duration <= high:
        mean = f"{length:.2f} m in {duration:g} s is {length / duration:.2f} m/s"
        raise ValueError(f"path: {mean}; allowed are {low:g} to {high:g} m/s")
    return points


def path_pace(points: FloatArray, duration: float) -> float:
    """Factor on the usual speed for a path, 0.5 … 2."""
    return float(np.clip(_length(points) / duration / REFERENCE_SPEED, 0.5, 2.0))


def follow_path(motion: Motion, points: FloatArray, duration: float, *, timed: bool = True) -> Motion:
    """The walk along the path, from its first to its last point in `duration` [s].

    Args:
        motion: a walk of at least that duration.
        points: (point, 2) [m], see :func:`check_path`.
        duration: of the result [s].
        timed: whether playback speed adapts to the path; otherwise the step length does.
    """
    curve, heading = _rounded(points)
    length = _STEP * (len(curve) - 1)
    if timed:
        t = np.arange(len(motion.translation)) / motion.frame_rate
        gone = _gone(_own_way(motion))
        needed = float(np.interp(length, gone, t)) if gone[-1] >= length else float(t[-1])
        motion = resample_motion(replace(motion, frame_rate=motion.frame_rate * needed / duration), motion.frame_rate)
    motion = _first(motion, int(np.floor(duration * motion.frame_rate + 1e-9)) + 1)
    own = _own_way(motion)
    gone = _gone(own)
    place = gone * (length / max(float(gone[-1]), 1e-9)) / _STEP
    index = np.arange(len(curve))
    turn = np.interp(place, index, heading) - _heading(own)
    at = np.stack([np.interp(place, index, curve[:, k]) for k in range(2)], axis=-1)
    return _taken(motion, own, at, turn)


def follow_motion(motion: Motion, other: Motion, scale: float = 1.0) -> Motion:
    """The motion along the path and heading of another one, times `scale`, at every time; steps and sway stay."""
    other = resample_motion(replace(other, translation=scale * other.translation), motion.frame_rate)
    count = min(len(motion.translation), len(other.translation))
    motion, other = (_first(each, count) for each in (motion, other))
    # twist of the pelvis: unlike the heading, it has no flip in a fall
    facing, wanted = (2 * np.unwrap(np.arctan2(*continuous(m.rotations[:, 0]).T[2:])) for m in (motion, other))
    turn = _smooth((wanted - facing)[:, None], _STEP_PERIOD * motion.frame_rate)[:, 0]
    turn -= 2.0 * np.pi * np.round(np.median(turn) / (2.0 * np.pi))
    return _taken(motion, _own_way(motion), _own_way(other), turn)


def _taken(motion: Motion, own: FloatArray, at: FloatArray, turn: FloatArray) -> Motion:
    """The motion with its (frame, 2) path `own` [m] replaced by `at`, turned by (frame,) `turn` [rad]."""
    cos, sin = np.cos(turn), np.sin(turn)
    x, y = (motion.translation[:, :2] - own).T
    rotated = np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)
    translation = np.column_stack([at + rotated, motion.translation[:, 2]])
    rotations = motion.rotations.copy()
    rotations[:, 0] = (Rotation.from_euler("z", turn[:, None]) * Rotation.from_quat(rotations[:, 0])).as_quat()
    return replace(motion, rotations=continuous(rotations), translation=translation)


def _first(motion: Motion, count: int) -> Motion:
    contacts = None if motion.contacts is None else motion.contacts[:count]
    return replace(
        motion, rotations=motion.rotations[:count], translation=motion.translation[:count], contacts=contacts
    )


def _length(points: FloatArray) -> float:
    return _STEP * (len(_rounded(points)[0]) - 1) if np.ptp(points, axis=0).any() else 0.0


def _rounded(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(step, 2) points every centimetre of the path with rounded corners, and the heading (step,) [rad]."""
    curve = _evenly(_smooth(_evenly(points), _CORNER / _STEP))
    return curve, gaussian_filter1d(_heading(curve), _TURN / _STEP, mode="nearest")


def _evenly(points: FloatArray) -> FloatArray:
    """The same line in equal steps of about a centimetre, ends included."""
    gone = _gone(points)
    at = np.linspace(0.0, gone[-1], max(2, round(gone[-1] / _STEP) + 1))
    return np.stack([np.interp(at, gone, points[:, k]) for k in range(2)], axis=-1)


def _gone(points: FloatArray) -> FloatArray:
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=-1))])


def _own_way(motion: Motion) -> FloatArray:
    return _smooth(motion.translation[:, :2], _STEP_PERIOD * motion.frame_rate)


def _smooth(points: FloatArray, width: float) -> FloatArray:
    """Points smoothed along their first axis; end points stay."""
    margin = min(int(4 * width), len(points) - 1)
    wide = np.pad(points, ((margin, margin), (0, 0)), mode="reflect", reflect_type="odd")
    smooth = gaussian_filter1d(wide, width, axis=0, mode="nearest")
    return np.asarray(smooth[margin : margin + len(points)])


def _heading(points: FloatArray) -> FloatArray:
    step = np.gradient(points, axis=0)
    return np.unwrap(np.arctan2(step[:, 1], step[:, 0]))
