"""Course of a movement over its frames: mean Doppler, its spread, and range, of clouds and of a stick figure.

The stick figure is a predictor without electromagnetics: the middles of a person's bones, moved by the recorded joints,
with a weight for each kind of bone. A simulation has to come nearer to the radar than that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from experiments.mars.body import MarsPose, instants, joint_track
from experiments.mars.recordings import MarsClouds, MarsMovement
from rfgen_sionna.evaluation import DopplerCourse, course_of_points
from rfgen_sionna.generative.motion.joint_recording import record_joints
from rfgen_sionna.generative.motion.skeleton import JOINT, SIDES

BONES = {
    "head": ("neck", "head"), "chest": ("spine2", "neck"), "belly": ("pelvis", "spine2"),
    "upper arm": ("shoulder", "elbow"), "forearm": ("elbow", "wrist"), "thigh": ("hip", "knee"),
    "shin": ("knee", "ankle"), "foot": ("ankle", "foot"),
}  # fmt: skip
"""Ends of the bones of the stick figure; both sides of a limb have the same weight."""


@dataclass(frozen=True)
class MarsCourse:
    """What a movement shows over its frames; NaN in frames without points."""

    doppler: DopplerCourse
    range: NDArray[np.float64]
    """(frame,) median distance of the points [m]."""


def course_of_clouds(clouds: MarsClouds) -> MarsCourse:
    """Course of points, weighted by their intensity; the range is the median over the points."""
    frames = len(clouds.row)
    doppler = course_of_points(clouds.frame, clouds.doppler, clouds.intensity, frames)
    ends = np.searchsorted(clouds.frame, np.arange(frames + 1))
    distance = clouds.distance
    middle = [float(np.median(distance[first:last])) if last > first else np.nan for first, last in pairwise(ends)]
    return MarsCourse(doppler, np.array(middle))


@lru_cache(maxsize=64)
def _bone_middles(movement: MarsMovement) -> tuple[float, float, NDArray[np.float64]]:
    """Start [s] and rate [Hz] of the smooth joints, and middles of the bones (sample, bone, side, 3) [m]."""
    times, joints = joint_track(movement)
    longest = float(np.diff(times).max()) + 1.0
    recorded = record_joints(joints, names=movement.names, times=times, longest_gap=longest)
    place = recorded.positions
    middles = [
        np.stack([(place[:, _joint(start, side)] + place[:, _joint(end, side)]) / 2 for side in SIDES], axis=1)
        for start, end in BONES.values()
    ]
    return float(times[0]), recorded.frame_rate, np.stack(middles, axis=1)


def bone_courses(
    movement: MarsMovement, pose: MarsPose, rows: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Radial velocity [m/s] and distance [m] of the bones' middles, (row, bone, side), from the radar of `pose`, in the
    radar frames of `rows`."""
    start, rate, middles = _bone_middles(movement)
    distance = np.linalg.norm(middles - pose.radar().position, axis=-1)
    velocity = np.gradient(distance, 1 / rate, axis=0)
    at = instants(movement, rows, pose, start) * rate
    below = np.clip(np.floor(at).astype(int), 0, len(distance) - 2)
    share = np.clip(at - below, 0.0, 1.0)[:, None, None]
    found = [course[below] * (1 - share) + course[below + 1] * share for course in (velocity, distance)]
    return found[0], found[1]


@dataclass(frozen=True)
class StickFigure:
    """Weights of the bones, by least squares against measured Doppler."""

    weights: NDArray[np.float64]
    """(bone,) of `BONES`; their sum is the scale of the mean Doppler."""
    range_offset_m: float
    """Measured range less the figure's."""

    @staticmethod
    def fit(movements: Sequence[MarsMovement], pose: MarsPose) -> StickFigure:
        """The figure of the least squared errors of mean and mean square of the Doppler over all frames of
        `movements`; the mean square has a constant of its own, for the width of a bin.

        Raises
        ------
        ValueError
            If no bone moves as the radar measured.
        """
        rows, measured, offsets = [], [], []
        for movement in movements:
            seen = course_of_clouds(movement.clouds)
            velocity, distance = bone_courses(movement, pose, movement.clouds.row)
            kept = np.isfinite(seen.doppler.centroid)
            mean, constant = seen.doppler.centroid[kept], np.ones((int(kept.sum()), 1))
            rows.append(np.hstack([velocity[kept].mean(axis=2), 0 * constant]))
            rows.append(np.hstack([(velocity[kept] ** 2).mean(axis=2), constant]))
            measured += [mean, mean**2 + seen.doppler.spread[kept] ** 2]
            offsets.append((seen.range, distance))
        weights = nnls(np.concatenate(rows), np.concatenate(measured))[0][:-1]
        if not weights.any():
            raise ValueError("no bone's velocity goes with the measured mean Doppler: radar and joints do not pair")
        away = [seen_range - _weighted_median(distance, weights) for seen_range, distance in offsets]
        return StickFigure(weights, float(np.nanmedian(np.concatenate(away))))

    def course(self, movement: MarsMovement, pose: MarsPose, rows: NDArray[np.int64]) -> MarsCourse:
        """Course in the radar frames of `rows`."""
        velocity, distance = bone_courses(movement, pose, rows)
        share = np.repeat(self.weights[:, None] / 2 / self.weights.sum(), 2, axis=1)
        mean = (velocity * share).sum(axis=(1, 2))
        spread = np.sqrt((share * (velocity - mean[:, None, None]) ** 2).sum(axis=(1, 2)))
        middle = _weighted_median(distance, self.weights) + self.range_offset_m
        return MarsCourse(DopplerCourse(mean * self.weights.sum(), spread), middle)


def _joint(name: str, side: str) -> int:
    return JOINT[name] if name in JOINT else JOINT[f"{side}_{name}"]


def _weighted_median(values: NDArray[np.float64], weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """(row,) of (row, bone, side) by the weights (bone,)."""
    flat = values.reshape(len(values), -1)
    order = np.argsort(flat, axis=1)
    total = np.cumsum(np.repeat(weights, 2)[order], axis=1)
    middle = np.argmax(total >= total[:, -1:] / 2, axis=1)
    return np.take_along_axis(flat, np.take_along_axis(order, middle[:, None], axis=1), axis=1)[:, 0]
