"""The body that follows a movement's joints, on the radar's clock, and where the radar stands."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import rfgen_sionna as rfgen
from experiments.mars.recordings import FRAME_PERIOD_S, MarsMovement
from rfgen_sionna.generative.bodies import VitalSigns
from rfgen_sionna.processing.boards import CHAINS, OutOfBoxChain
from rfgen_sionna.radar import ElementPattern

POSE_FILE = Path(__file__).parent / "results" / "pose.json"
"""The pose that `experiments.mars.fit` found on subject 2."""
BREATHING = {"breathing_rate": 20.0, "belly_depth": 12e-3, "chest_depth": 8e-3, "heart_rate": 100.0}
"""Vital signs of people who exercise, twice as deep as at rest: an assumption, not a fit. It stands for sway, too,
which a Kinect does not see."""


@dataclass(frozen=True)
class MarsPose:
    """Where MARS's radar is from its Kinect, and by how much both clocks differ; the data set leaves it open."""

    height_m: float
    """Radar over the Kinect [m]."""
    lateral_m: float
    """Radar to the right of the Kinect, along the data's x [m]."""
    range_bias_m: float
    """Range that the board adds, with the unknown depth of the radar before the Kinect [m]."""
    squint_deg: float
    """Peak of the elements' elevation pattern over the horizon, to which the board is level."""
    lag_s: float
    """Time of the joints at the middle of a radar frame, less the frame's time [s]."""
    gain_db: float
    """Level of the person over the noise, more than simulated."""
    full_scale_dbm: float
    """Power of a full-scale tone at the receiver's input, which gives the steps of the samples."""

    def radar(self) -> rfgen.Radar:
        """The IWR1443 in MARS's configuration, in the Kinect's world: x depth, y to the left, z up."""
        radar = rfgen.Radar.load("iwr1443boost", preset="mars", position=(0.0, -self.lateral_m, self.height_m))
        pattern = radar.pattern
        if not isinstance(pattern, ElementPattern):
            raise TypeError(f"pattern is a {type(pattern).__name__}: one of two cuts is needed to shift one")
        angles = tuple(float(each) for each in np.clip(np.add(pattern.elevation_deg, self.squint_deg), -90.0, 90.0))
        return replace(radar, pattern=replace(pattern, elevation_deg=angles))

    def chain(self) -> OutOfBoxChain:
        """The board's chain."""
        return replace(CHAINS["mars"], full_scale_dbm=self.full_scale_dbm)


def read_pose(file: Path = POSE_FILE) -> MarsPose:
    """A pose that :func:`write_pose` wrote, or the "pose" of the fit's result."""
    return MarsPose(**json.loads(file.read_text())["pose"])


def pose_record(pose: MarsPose) -> dict[str, float]:
    """A pose for JSON."""
    return {name: round(float(value), 4) for name, value in asdict(pose).items()}


def to_world(positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Positions (..., 3) of the data's axes (x lateral, y depth, z up) in the Kinect's world."""
    return np.stack([positions[..., 1], -positions[..., 0], positions[..., 2]], axis=-1)


def frame_times(movement: MarsMovement) -> NDArray[np.float64]:
    """(row,) time of each radar frame since the first one [s], by its number."""
    return FRAME_PERIOD_S * (movement.number - movement.number[0])


def joint_track(movement: MarsMovement) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times (row,) [s] on the clock of :func:`frame_times` and world positions (row, 25, 3) [m] of the joints.

    Joints are at the host's stamps, whose median difference from the numbers is taken off; rows whose stamp is not
    after those before are left out.
    """
    late = movement.stamp - movement.stamp[0] - frame_times(movement)
    times = movement.stamp - movement.stamp[0] - np.median(late)
    kept = np.concatenate([[True], times[1:] > np.maximum.accumulate(times)[:-1] + 1e-3])
    return times[kept], to_world(movement.joints[kept])


@lru_cache(maxsize=16)
def moving_body(movement: MarsMovement, seed: int = 0) -> tuple[rfgen.Actor, float]:
    """The breathing body that follows the joints, and the time of its start on the clock of :func:`frame_times` [s]."""
    times, joints = joint_track(movement)
    longest = float(np.diff(times).max()) + 1.0
    actor = rfgen.Actor.from_joints(joints, names=movement.names, times=times, longest_gap=longest, seed=seed)
    return actor.with_vital_signs(VitalSigns(**BREATHING, seed=seed)), float(times[0])


def instants(movement: MarsMovement, rows: NDArray[np.int64], pose: MarsPose, start: float) -> NDArray[np.float64]:
    """(frame,) times on the body's clock, which begins at `start`, of the middle of the radar frames of `rows` [s]."""
    return frame_times(movement)[rows] + pose.lag_s - start
