"""What a motion is held to: given poses, given parts of the body, a path on the floor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import gaussian_filter1d

from rfgen_sionna.generative.diffusion.batches import SOFT
from rfgen_sionna.generative.diffusion.features import NUM_FEATURES, PARTS, HandBasis, encode
from rfgen_sionna.generative.diffusion.post import resampled
from rfgen_sionna.generative.diffusion.synthesis import FRAME_RATE
from rfgen_sionna.generative.motion import MEAN_ADULT
from rfgen_sionna.generative.motion.skeleton import SIDES
from rfgen_sionna.records import FloatArray, Motion

ALL_PARTS = tuple(PARTS)


@dataclass(frozen=True)
class Keep:
    """Part of a motion that must come out as it is.

    `parts` are names of :data:`rfgen_sionna.generative.diffusion.features.PARTS`: the place on the floor, pelvis, legs,
    trunk, left and right arm (with the hand).
    """

    motion: Motion
    parts: tuple[str, ...] = ALL_PARTS
    start: float = 0.0
    """From this time of the motion [s] ..."""
    stop: float = float("inf")
    """... to this, both in the motion's and the result's time."""

    def __post_init__(self) -> None:
        unknown = [p for p in self.parts if p not in PARTS]
        if unknown or not self.parts:
            raise ValueError(f"parts: {unknown or 'none'} given; allowed are {', '.join(PARTS)}")
        if not self.start < self.stop:
            raise ValueError(f"start, stop: {self.start} to {self.stop} s; start must come first")


def on_grid(motion: Motion, hands: HandBasis) -> FloatArray:
    """(frame, NUM_FEATURES) rows at 20 Hz of any motion with the body's joints, its path scaled to the mean adult."""
    legs = [motion.offsets[motion.joint_names.index(f"{s}_{j}")] for s in SIDES for j in ("knee", "ankle")]
    scale = MEAN_ADULT.leg_length() / (0.5 * float(np.sum(np.linalg.norm(legs, axis=-1))))
    rows = encode(resampled(motion, FRAME_RATE), hands)
    rows[:, :3] *= scale
    return rows


def hold(keeps: Sequence[Keep], hands: HandBasis, frames: int) -> tuple[FloatArray, FloatArray]:
    """(frame, NUM_FEATURES) what is given and (frame, part) where."""
    known = np.zeros((frames, NUM_FEATURES))
    given = np.zeros((frames, len(PARTS)))
    for keep in keeps:
        rows = on_grid(keep.motion, hands)
        t = np.arange(min(frames, len(rows))) / FRAME_RATE
        at = np.flatnonzero((t >= keep.start - 1e-9) & (t <= keep.stop + 1e-9))
        if not len(at):
            raise ValueError(f"start, stop: no pose of the motion lies between {keep.start} and {keep.stop} s")
        for part in keep.parts:
            columns = np.array(PARTS[part])
            known[at[:, None], columns] = rows[at[:, None], columns]
            given[at, ALL_PARTS.index(part)] = 1.0
    return known, given


def follow(path: ArrayLike, frames: int, duration: float) -> tuple[FloatArray, FloatArray]:
    """What is given, and where, for a walk along a path.

    Args:
        path: (point, 2) places on the floor [m], passed at constant speed; the first is the start.
        frames: of the motion.
        duration: time for the whole path [s].

    Raises:
        ValueError: fewer than two points, values that are not finite, or a mean speed over 3 m/s.
    """
    points = np.asarray(path, np.float64)
    if points.ndim != 2 or points.shape[1] != 2 or len(points) < 2 or not np.isfinite(points).all():
        raise ValueError(f"path: shape {points.shape}; allowed are two or more finite points (x, y) in metres")
    steps = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=-1))])
    if steps[-1] / duration > 3.0:
        raise ValueError(f"path: {steps[-1]:.1f} m in {duration:g} s is {steps[-1] / duration:.1f} m/s; allowed are 3")
    s = np.clip(np.arange(frames) / FRAME_RATE / duration, 0.0, 1.0) * steps[-1]
    xy = np.stack([np.interp(s, steps, points[:, k]) for k in range(2)], axis=-1)
    known = np.zeros((frames, NUM_FEATURES))
    known[:, :2] = gaussian_filter1d(xy, 0.25 * FRAME_RATE, axis=0, mode="nearest")
    given = np.zeros((frames, len(PARTS)))
    given[:, ALL_PARTS.index("place")] = SOFT
    return known, given
