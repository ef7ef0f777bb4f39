"""A person from recorded joints: motion, body of the same lengths, feet on the floor, and what is left over."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import gaussian_filter1d

from rfgen_sionna._short_repr import ShortRepr
from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.bodies.fitted_body import fitted_body
from rfgen_sionna.generative.bodies.grounding import sole_points
from rfgen_sionna.generative.bodies.phenotype import Phenotype, PhenotypeError, person
from rfgen_sionna.generative.bodies.retarget import bone_rotations, joint_rotations
from rfgen_sionna.generative.bodies.rig import Rig
from rfgen_sionna.generative.bodies.sequence import BodySequence
from rfgen_sionna.generative.motion.inverse_kinematics import body_size, motion_of_positions
from rfgen_sionna.generative.motion.joint_recording import JointRecording
from rfgen_sionna.generative.motion.skeleton import JOINT, SIDES, forward_kinematics
from rfgen_sionna.records import Motion

_LOG = logging.getLogger(__name__)
_STATURE = 1.70
"""Stature of the mean adult [m], to whom sizes relate."""
_STATURES = (1.5, 1.95)
"""Statures of adults of any gender [m]; the skin is scaled beyond."""
_FLOOR = 0.35
"""Quantile of the heights of the lower sole that is the floor: people stand or walk for most of a recording."""
_NEAR_FLOOR = 0.06
"""Height of a sole over or under the floor that is taken for an error of the recording [m]: a camera tilted by one
degree errs by it over 3.5 m."""
_TRUST_IN_FLOOR = 0.5
"""Share of a slow error of the height that moves the body; the rest may be of the ankles alone."""
_SLOW = 0.5
"""Smoothing time of the height over the floor [s]; slower than any step."""
_SIDE_SWAY = 0.2
"""Share of the way to whose sides no slope is fitted."""
_TRAVEL = 1.0
"""Least way of a person that shows whether the floor is level [m]."""
_SLOPE = 1.5
"""Slope of the floor that is warned of [degrees]: 8 cm over three metres."""
_HIP_CENTRED = 0.05
"""Smoothing time of the height of hips that were recorded as the origin [s]."""


@dataclass(frozen=True, repr=False)
class JointResidual(ShortRepr):
    """Distance of a body's joints from the smoothed ones of a recording [m], over its frames."""

    median: Mapping[str, float]
    """Joint -> median [m]."""
    percentile_95: Mapping[str, float]
    """Joint -> 95th percentile [m]."""
    noise: Mapping[str, float]
    """Joint -> median distance of the recorded positions from the smoothed ones [m]."""
    overall_median: float
    """Over all measured joints and frames [m]."""
    overall_percentile_95: float
    """Over all measured joints and frames [m]."""

    def __str__(self) -> str:
        lines = [f"joints: {_cm(self.overall_median)} from the recorded ones, 95 % {_cm(self.overall_percentile_95)}"]
        for name, middle in self.median.items():
            spread, noise = _cm(self.percentile_95[name]), _cm(self.noise[name])
            lines.append(f"  {name:<15} {_cm(middle)}, 95 % {spread}, smoothed by {noise}")
        return "\n".join(lines)


def _cm(length: float) -> str:
    return f"{100.0 * length:.1f} cm"


@dataclass(frozen=True, eq=False, repr=False)
class MeasuredPerson(ShortRepr):
    """A recorded person."""

    sequence: BodySequence
    """The body in motion, its floor at z = 0."""
    motion: Motion
    floor: float
    """Height of the floor in the recording [m]."""
    residual: JointResidual


def measured_person(
    recording: JointRecording, *, body: Rig | Phenotype | None, seed: int, action: str
) -> MeasuredPerson:
    """A body with the recording's bone lengths that follows its joints.

    Args:
        recording: smooth joints.
        body: body whose bones get the recorded lengths; None draws one of the recorded stature.
        seed: seed of the attributes that `body` leaves open.
        action: label of the motion.

    Raises:
        PhenotypeError: the attributes of `body` are out of reach.
        ImportError: anny (or torch) is not installed.
    """
    motion = motion_of_positions(recording.positions, recording.frame_rate, lengths=recording.lengths, action=action)
    rig = fitted_body(body if isinstance(body, Rig) else _drawn(recording, body, seed), motion.offsets)
    joints = joint_rotations(motion)
    lowest = _lowest_sole(rig, joints, motion.translation)
    floor, drop = _floor(lowest, recording)
    motion = replace(motion, translation=motion.translation - drop[:, None] * [0.0, 0.0, 1.0])
    sequence = BodySequence(rig, bone_rotations(rig, joints), motion.translation, motion.frame_rate)
    heads = rig.bone_heads(sequence.rotations, sequence.translation)[:, rig.joint_bones] + [0.0, 0.0, floor]
    wanted = recording.positions
    if recording.hip_centred:
        wanted = wanted - drop[:, None, None] * [0.0, 0.0, 1.0]
    distance = np.stack(
        [np.linalg.norm(heads[:, JOINT[name]] - wanted[:, JOINT[name]], axis=-1) for name in recording.measured]
    )
    residual = JointResidual(
        {name: float(np.median(row)) for name, row in zip(recording.measured, distance, strict=True)},
        {name: float(np.quantile(row, 0.95)) for name, row in zip(recording.measured, distance, strict=True)},
        {name: recording.noise[name] for name in recording.measured},
        float(np.median(distance)), float(np.quantile(distance, 0.95)),
    )  # fmt: skip
    return MeasuredPerson(sequence, motion, floor, residual)


def _drawn(recording: JointRecording, phenotype: Phenotype | None, seed: int) -> Rig:
    """Body of a phenotype, as tall as the recorded person where the phenotype leaves the height open."""
    wanted = phenotype or Phenotype()
    if wanted.height is not None:
        return person(wanted, seed=seed)
    height = float(np.clip(_STATURE * body_size(recording.positions), *_STATURES))
    try:
        return person(replace(wanted, height=height), seed=seed)
    except PhenotypeError:
        return person(wanted, seed=seed)  # of a child, say; the skin is scaled


def _lowest_sole(rig: Rig, joints: FloatArray, translation: FloatArray) -> FloatArray:
    """(frame,) height of the lower sole [m]."""
    places = forward_kinematics(joints, translation, rig.skeleton.offsets, rig.skeleton.parents)
    soles = np.stack([sole_points(rig, joints, places, side) for side in SIDES], axis=1)
    return np.asarray(soles[..., 2].min(axis=(1, 2)))


def _warn_of_slope(lowest: FloatArray, recording: JointRecording) -> None:
    """Warn of a floor that rises along the person's way, as a tilted camera sees it."""
    way = recording.positions[:, JOINT["pelvis"], :2]
    way = way - way.mean(axis=0)
    if np.ptp(way, axis=0).max() < _TRAVEL:
        return
    slope = np.linalg.lstsq(way, lowest - lowest.mean(), rcond=_SIDE_SWAY)[0]
    angle = float(np.degrees(np.arctan(np.linalg.norm(slope))))
    if angle > _SLOPE:
        _LOG.warning(
            "the floor rises by %.1f degrees along the way, towards (%.2f, %.2f): the camera was tilted, or somebody "
            "climbs; level the positions first (multiply them by a rotation)", angle, *slope / np.linalg.norm(slope),
        )  # fmt: skip


def _floor(lowest: FloatArray, recording: JointRecording) -> tuple[float, FloatArray]:
    """Height of the floor, and (frame,) drop of the body that puts its feet on z = 0 [m]."""
    if recording.hip_centred:
        return 0.0, gaussian_filter1d(lowest, _HIP_CENTRED * recording.frame_rate, mode="nearest")
    _warn_of_slope(lowest, recording)
    floor = float(np.quantile(lowest, _FLOOR))
    over = lowest - floor
    near = np.abs(over) < _NEAR_FLOOR
    frames = np.arange(len(over))
    hover = gaussian_filter1d(np.interp(frames, frames[near], over[near]), _SLOW * recording.frame_rate, mode="nearest")
    return floor, floor + _TRUST_IN_FLOOR * hover
