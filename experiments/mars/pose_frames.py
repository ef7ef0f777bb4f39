"""Clouds of consecutive frames with the joints of each, for networks; changes of both that keep them a pair.

Axes are the radar's: x lateral, y depth, z up [m]; receding Doppler is positive [m/s]. Intensities are left out:
levels of simulated and measured points need not agree.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from torch import Tensor

MAX_POINTS = 64
"""Points of a full frame of the board's list."""
FEATURES = 4
"""Numbers of a point: x, y, z, Doppler."""
JOINTS = 25
ROOT = 0
"""Joint SpineBase."""
MIRRORED = (0, 1, 2, 3, 8, 9, 10, 11, 4, 5, 6, 7, 16, 17, 18, 19, 12, 13, 14, 15, 20, 23, 24, 21, 22)
"""Number of each Kinect joint's counterpart on the other side of the body."""
FEET = (14, 15, 18, 19)
"""Ankles and feet."""


@dataclass(frozen=True)
class PoseFrames:
    """Clouds and joints of the consecutive frames of one movement of one person."""

    points: Tensor
    """(frame, MAX_POINTS, FEATURES) zero where no point is."""
    present: Tensor
    """(frame, MAX_POINTS) whether a point is."""
    joints: Tensor
    """(frame, JOINTS, 3) [m]"""

    def __len__(self) -> int:
        return len(self.joints)

    def __getitem__(self, frames: slice | Tensor) -> PoseFrames:
        return PoseFrames(self.points[frames], self.present[frames], self.joints[frames])


def pose_frames(frame: ArrayLike, position: ArrayLike, doppler: ArrayLike, joints: ArrayLike) -> PoseFrames:
    """Record of points (point,), (point, 3), (point,), by number of the frame in joints (frame, JOINTS, 3).

    The first `MAX_POINTS` points of a frame are kept.

    Raises
    ------
    ValueError
        If joints has another shape, or a point's frame isn't in it.
    """
    numbers = np.asarray(frame, np.int64)
    poses = np.asarray(joints, np.float32)
    if poses.shape[1:] != (JOINTS, 3):
        raise ValueError(f"joints has shape {poses.shape}: (frame, {JOINTS}, 3) is needed")
    if len(numbers) and not (numbers.min() >= 0 and numbers.max() < len(poses)):
        raise ValueError(f"frame has {numbers.min()} … {numbers.max()}, joints {len(poses)} frames: number them from 0")
    order = np.argsort(numbers, kind="stable")
    numbers = numbers[order]
    place = np.arange(len(numbers)) - np.searchsorted(numbers, numbers)
    kept = place < MAX_POINTS
    values = np.column_stack([np.asarray(position), np.asarray(doppler)])[order]
    points = np.zeros((len(poses), MAX_POINTS, FEATURES), np.float32)
    present = np.zeros((len(poses), MAX_POINTS), np.bool_)
    points[numbers[kept], place[kept]] = values[kept]
    present[numbers[kept], place[kept]] = True
    return PoseFrames(torch.from_numpy(points), torch.from_numpy(present), torch.from_numpy(poses))


def first_minutes(movements: Sequence[PoseFrames], minutes: float, frame_time_s: float = 0.1) -> list[PoseFrames]:
    """The same number of frames from the start of each movement, `minutes` together.

    Raises
    ------
    ValueError
        If a movement is shorter than its part.
    """
    count = round(minutes * 60 / frame_time_s / len(movements))
    shortest = min(map(len, movements))
    if not 0 < count <= shortest:
        raise ValueError(f"minutes is {minutes}: {count} frames a movement, where the shortest has {shortest}")
    return [movement[:count] for movement in movements]


def every(movements: Sequence[PoseFrames], step: int) -> list[PoseFrames]:
    """Each movement's frames 0, step, …, then those from 1, and so on to step − 1."""
    return [movement[first::step] for movement in movements for first in range(step)]


def chunks(
    movements: Sequence[PoseFrames], count: int, length: int, rng: np.random.Generator, *, consecutive: bool
) -> PoseFrames:
    """`count` runs of `length` frames of one movement each, consecutive or drawn from all of it, in order.

    Tensors get a first axis of runs; movements are drawn by their number of frames.
    """
    long_enough = [movement for movement in movements if len(movement) >= length]
    frames = np.array([len(movement) for movement in long_enough])
    drawn = []
    for which in rng.choice(len(frames), count, p=frames / frames.sum()):
        if consecutive:
            chosen = np.arange(length) + rng.integers(frames[which] - length + 1)
        else:
            chosen = np.sort(rng.choice(frames[which], length, replace=False))
        drawn.append(long_enough[which][torch.from_numpy(chosen)])
    return PoseFrames(
        torch.stack([item.points for item in drawn]),
        torch.stack([item.present for item in drawn]),
        torch.stack([item.joints for item in drawn]),
    )


@dataclass(frozen=True)
class Augmentation:
    """Random changes of runs; each is drawn anew for every run, jitter for every point."""

    dropped: float = 0.4
    """Largest share of points that go; shares are uniform from 0."""
    jitter_m: float = 0.03
    """Standard deviation of a point along each axis [m]."""
    jitter_doppler: float = 0.1
    """Standard deviation of a point's Doppler [m/s]."""
    shift_m: tuple[float, float, float] = (0.1, 0.1, 0.03)
    """Largest shift of person and points together along x, y, z [m]."""
    size: float = 0.15
    """Largest change of the size of body and motion about the feet, as a share."""
    mirrored: bool = True
    """Whether half of the runs change left and right."""

    def __call__(self, runs: PoseFrames, rng: np.random.Generator) -> PoseFrames:
        """Changed copies of runs (run, frame, …)."""
        count = len(runs)
        position, doppler = runs.points[..., :3], runs.points[..., 3:]
        joints = runs.joints

        scale = _column(1 + self.size * rng.uniform(-1, 1, count))
        floor = joints[..., FEET, :].mean((1, 2), keepdim=True)
        shift = torch.tensor(self.shift_m) * torch.from_numpy(rng.uniform(-1, 1, (count, 1, 1, 3))).float()
        place = floor * (1 - scale) + shift
        position, joints, doppler = position * scale + place, joints * scale + place, doppler * scale

        if self.mirrored:
            flip = torch.from_numpy(rng.random(count) < 0.5)
            sign = torch.tensor([-1.0, 1.0, 1.0])
            chosen = flip[:, None, None, None]
            position = torch.where(chosen, position * sign, position)
            joints = torch.where(chosen, joints[..., MIRRORED, :] * sign, joints)

        position = position + self.jitter_m * _normal(position.shape, rng)
        doppler = doppler + self.jitter_doppler * _normal(doppler.shape, rng)
        share = self.dropped * rng.random((count, 1, 1))
        present = runs.present & torch.from_numpy(rng.random(runs.present.shape) >= share)
        points = torch.cat([position, doppler], -1) * present[..., None]
        return PoseFrames(points, present, joints)


def _column(values: NDArray[np.float64]) -> Tensor:
    return torch.from_numpy(values).float()[:, None, None, None]


def _normal(shape: Any, rng: np.random.Generator) -> Tensor:
    return torch.from_numpy(rng.standard_normal(tuple(shape), np.float32))
