"""Constraints of a motion: given poses, given parts of the body."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.diffusion.features import FRAME_RATE, NUM_FEATURES, PARTS, HandBasis, encode
from rfgen_sionna.generative.motion import MEAN_ADULT
from rfgen_sionna.generative.motion.resampling import resample_motion
from rfgen_sionna.generative.motion.skeleton import SIDES
from rfgen_sionna.records import Motion

ALL_PARTS = tuple(PARTS)
SOFT = 0.5
"""Mark of a path that is given roughly."""


@dataclass(frozen=True)
class MotionConstraint:
    """Part of a motion that the result keeps.

    `parts` are names of :data:`rfgen_sionna.generative.diffusion.features.PARTS`: the place on the floor, pelvis, legs,
    trunk, left and right arm (with the hand).
    """

    motion: Motion
    parts: tuple[str, ...] = ALL_PARTS
    start: float = 0.0
    """First time of the kept interval [s] ..."""
    stop: float = float("inf")
    """... and last one, both in the motion's and the result's time."""

    def __post_init__(self) -> None:
        unknown = [p for p in self.parts if p not in PARTS]
        if unknown or not self.parts:
            raise ValueError(f"parts: {unknown or 'none'} given; allowed are {', '.join(PARTS)}")
        if not self.start < self.stop:
            raise ValueError(f"start, stop: {self.start} to {self.stop} s; start must come first")
        if self.stop < 0.0:
            raise ValueError(f"stop: {self.stop} s; allowed is 0 and more")


def resampled_features(motion: Motion, hands: HandBasis) -> FloatArray:
    """(frame, NUM_FEATURES) rows at 20 Hz of a motion with the body's joints; the path is scaled to the mean adult."""
    scale = MEAN_ADULT.leg_length() / leg_length(motion)
    rows = encode(resample_motion(motion, FRAME_RATE), hands)
    rows[:, :3] *= scale
    return rows


def leg_length(motion: Motion) -> float:
    """Length of the legs of a motion's skeleton [m]."""
    legs = [motion.offsets[motion.joint_names.index(f"{s}_{j}")] for s in SIDES for j in ("knee", "ankle")]
    return 0.5 * float(np.sum(np.linalg.norm(legs, axis=-1)))


def constrained_rows(keeps: Sequence[MotionConstraint], hands: HandBasis, frames: int) -> tuple[FloatArray, FloatArray]:
    """(frame, NUM_FEATURES) given features and (frame, part) mask of them."""
    known = np.zeros((frames, NUM_FEATURES))
    given = np.zeros((frames, len(PARTS)))
    for keep in keeps:
        rows = resampled_features(keep.motion, hands)
        t = np.arange(min(frames, len(rows))) / FRAME_RATE
        at = np.flatnonzero((t >= keep.start - 1e-9) & (t <= keep.stop + 1e-9))
        if not len(at):
            raise ValueError(f"start, stop: no pose of the motion lies between {keep.start} and {keep.stop} s")
        for part in keep.parts:
            columns = np.array(PARTS[part])
            known[at[:, None], columns] = rows[at[:, None], columns]
            given[at, ALL_PARTS.index(part)] = 1.0
    return known, given


def spread(given: NDArray) -> NDArray:
    """(frame, NUM_FEATURES) mask of given features, from (frame, part)."""
    out = np.zeros((len(given), NUM_FEATURES))
    for k, part in enumerate(ALL_PARTS):
        out[:, list(PARTS[part])] = given[:, k : k + 1] > 0.0
    return out
