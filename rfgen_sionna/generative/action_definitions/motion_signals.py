"""What is measured on a motion to say which actions it shows, whatever its rate, body, place and heading.

Lengths are those of a mean adult: joint positions are scaled by the height of the pelvis of the standing body. Samples
are 20 Hz apart. Pairs are left, right.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.action_definitions.sampled_series import RATE, Flags, rate_of, smooth, stretches
from rfgen_sionna.generative.motion.balance import centre_of_mass
from rfgen_sionna.generative.motion.rotations import to_matrices
from rfgen_sionna.generative.motion.skeleton import (
    JOINT,
    MEAN_ADULT,
    NUM_BODY_JOINTS,
    SIDES,
    forward_kinematics,
    global_rotations,
)
from rfgen_sionna.records import Motion

STANDING = MEAN_ADULT.standing_height()
"""Height of the pelvis of a mean adult who stands [m]."""
_LEG = MEAN_ADULT.leg_length()
_ANKLE = MEAN_ADULT.ankle_height
_TOE = MEAN_ADULT.toe_height


class MotionSignals:
    """Signals of one motion, computed on first use.

    Parameters
    ----------
    motion
        A motion with the 22 joints of the body (fingers may follow), on the floor z = 0.

    Raises
    ------
    ValueError
        The motion has other joints, or fewer than three poses.
    """

    def __init__(self, motion: Motion) -> None:
        if tuple(motion.joint_names[:NUM_BODY_JOINTS]) != MEAN_ADULT.joint_names[:NUM_BODY_JOINTS]:
            raise ValueError(
                f"motion: joints {', '.join(motion.joint_names[:3])}, ...; definitions of actions need the body's 22 "
                "joints, pelvis first (Actor.from_joints makes them from other layouts)"
            )
        if len(motion.translation) < 3:
            raise ValueError(f"motion: {len(motion.translation)} poses; at least 3 are needed to measure movement")
        world = global_rotations(to_matrices(motion.rotations), motion.parents)
        places = forward_kinematics(world, motion.translation, motion.offsets, motion.parents)
        own = np.arange(len(places)) / motion.frame_rate
        self.time = np.arange(int(np.floor(own[-1] * RATE + 1e-6)) + 1) / RATE
        """(sample,) [s]"""
        if len(self.time) < 3:
            raise ValueError(f"motion: {motion.duration:.3g} s long; at least 0.1 s is needed to measure movement")
        scale = STANDING / _standing_height(motion.offsets)
        self.joints = scale * _sampled(places, own, self.time)
        """(sample, joint, 3) positions [m]"""
        self.orientations = {
            name: _sampled(world[:, JOINT[name]], own, self.time)
            for name in ("pelvis", "spine3", "head", "left_wrist", "right_wrist")
        }
        """(sample, 3, 3) world orientations, up to the bend between two poses."""
        index = [motion.joint_names.index(f"{side}_index1") for side in SIDES if f"{side}_index1" in motion.joint_names]
        self.index_flexion = _sampled(_flexion(motion, index), own, self.time) if len(index) == len(SIDES) else None
        """(sample, 2) flexion of the index finger's knuckle [degrees]; None without fingers."""

    def joint(self, name: str) -> FloatArray:
        """(sample, 3) position of a joint [m]."""
        return self.joints[:, JOINT[name]]

    def pair(self, name: str) -> FloatArray:
        """(sample, 2, 3) positions of the left and the right joint [m]."""
        return self.joints[:, [JOINT[f"{side}_{name}"] for side in SIDES]]

    @property
    def duration(self) -> float:
        """[s]"""
        return float(self.time[-1])

    # heights and posture

    @cached_property
    def pelvis_height(self) -> FloatArray:
        """(sample,) over the floor [m]"""
        return self.joint("pelvis")[:, 2]

    @cached_property
    def head_height(self) -> FloatArray:
        """(sample,) over the floor [m]"""
        return self.joint("head")[:, 2]

    @cached_property
    def feet(self) -> FloatArray:
        """(sample, 2) height of the lower of ankle and toe joint over where it is when the foot stands flat [m]"""
        return np.minimum(self.pair("ankle")[..., 2] - _ANKLE, self.pair("foot")[..., 2] - _TOE)

    @cached_property
    def legs(self) -> FloatArray:
        """(sample,) height of the pelvis over the lower foot's sole, as a share of that of standing"""
        return (self.pelvis_height - self.feet.min(axis=1)) / STANDING

    @cached_property
    def inclination(self) -> FloatArray:
        """(sample,) angle of the trunk, pelvis to neck, from the vertical [degrees]"""
        trunk = self.joint("neck") - self.joint("pelvis")
        return _angle(trunk, np.array([0.0, 0.0, 1.0]))

    @cached_property
    def front(self) -> FloatArray:
        """(sample,) upward share of the direction that the chest faces: -1 prone, 1 supine"""
        trunk = self.joint("neck") - self.joint("pelvis")
        across = (
            self.joint("left_shoulder")
            - self.joint("right_shoulder")
            + self.joint("left_hip")
            - self.joint("right_hip")
        )
        front = np.cross(across, trunk)
        return front[:, 2] / np.maximum(np.linalg.norm(front, axis=1), 1e-9)

    @cached_property
    def knee_flexion(self) -> FloatArray:
        """(sample, 2) [degrees], 0 for a straight leg"""
        hip, knee, ankle = self.pair("hip"), self.pair("knee"), self.pair("ankle")
        return _angle(knee - hip, ankle - knee)

    @cached_property
    def thigh_elevation(self) -> FloatArray:
        """(sample, 2) angle of the thigh from hanging [degrees], 90 for a horizontal one"""
        return _angle(self.pair("knee") - self.pair("hip"), np.array([0.0, 0.0, -1.0]))

    @cached_property
    def hip_flexion(self) -> FloatArray:
        """(sample, 2) angle between thigh and trunk, 0 in line [degrees]"""
        trunk = self.joint("pelvis") - self.joint("neck")
        return _angle(self.pair("knee") - self.pair("hip"), trunk[:, None])

    @cached_property
    def elbow_flexion(self) -> FloatArray:
        """(sample, 2) [degrees], 0 for a straight arm"""
        shoulder, elbow, wrist = self.pair("shoulder"), self.pair("elbow"), self.pair("wrist")
        return _angle(elbow - shoulder, wrist - elbow)

    @cached_property
    def arm_elevation(self) -> FloatArray:
        """(sample, 2) angle of the line from shoulder to wrist from hanging [degrees]"""
        return _angle(self.pair("wrist") - self.pair("shoulder"), np.array([0.0, 0.0, -1.0]))

    # heading and places in the person's axes

    @cached_property
    def heading(self) -> FloatArray:
        """(sample,) angle to which the pelvis faces, continuous in time [rad]"""
        return self._facing("hip")

    @cached_property
    def chest_heading(self) -> FloatArray:
        """(sample,) angle to which the shoulders face, continuous in time [rad]"""
        return self._facing("shoulder")

    def _facing(self, name: str) -> FloatArray:
        across = np.diff(self.pair(name), axis=1)[:, 0]  # left to right
        facing = np.arctan2(across[:, 0], -across[:, 1])
        level = np.hypot(across[:, 0], across[:, 1]) / np.maximum(np.linalg.norm(across, axis=1), 1e-9)
        # a line between two joints that stands upright has no heading: keep the last one
        known = np.where(level > 0.5, np.arange(len(level)), -1)
        first = int(np.argmax(known >= 0))
        kept = np.maximum.accumulate(known)
        return np.unwrap(facing[np.where(kept < 0, first, kept)])

    def ahead(self, vectors: FloatArray) -> FloatArray:
        """(sample, ..., 3) vectors in the person's axes: ahead, to the left, up."""
        c, s = np.cos(self.heading), np.sin(self.heading)
        shape = (-1, *(1,) * (vectors.ndim - 2))
        c, s = c.reshape(shape), s.reshape(shape)
        x, y = vectors[..., 0], vectors[..., 1]
        return np.stack([c * x + s * y, c * y - s * x, vectors[..., 2]], axis=-1)

    @cached_property
    def wrists(self) -> FloatArray:
        """(sample, 2, 3) wrists from the middle of the shoulders, ahead, left and up [m]"""
        return self.ahead(self.pair("wrist") - self.pair("shoulder").mean(axis=1, keepdims=True))

    @cached_property
    def hands_over_shoulders(self) -> FloatArray:
        """(sample, 2) height of each wrist over its shoulder [m]"""
        return (self.pair("wrist") - self.pair("shoulder"))[..., 2]

    @cached_property
    def hand_height(self) -> FloatArray:
        """(sample, 2) height of the wrists over the floor [m]"""
        return self.pair("wrist")[..., 2]

    @cached_property
    def hand_to_head(self) -> FloatArray:
        """(sample, 2) distance of each wrist from the head joint [m]"""
        return np.linalg.norm(self.pair("wrist") - self.joint("head")[:, None], axis=-1)

    @cached_property
    def hands_apart(self) -> FloatArray:
        """(sample,) distance between the wrists [m]"""
        return np.linalg.norm(np.diff(self.pair("wrist"), axis=1)[:, 0], axis=-1)

    @cached_property
    def feet_apart(self) -> FloatArray:
        """(sample, 2) distance between the ankles ahead and across [m], unsigned"""
        return np.abs(self.ahead(np.diff(self.pair("ankle"), axis=1))[:, 0, :2])

    @cached_property
    def reach(self) -> FloatArray:
        """(sample, 2) distance from shoulder to wrist as a share of the straight arm"""
        straight = MEAN_ADULT.length("left_elbow") + MEAN_ADULT.length("left_wrist")
        own = np.linalg.norm(self.pair("elbow") - self.pair("shoulder"), axis=-1) + np.linalg.norm(
            self.pair("wrist") - self.pair("elbow"), axis=-1
        )
        return np.linalg.norm(self.pair("wrist") - self.pair("shoulder"), axis=-1) / np.maximum(own, 0.2 * straight)

    # speeds

    @cached_property
    def velocity(self) -> FloatArray:
        """(sample, 3) of the pelvis, ahead, left and up, over 0.3 s [m/s]"""
        return self.ahead(smooth(rate_of(self.joint("pelvis")), 0.3))

    @cached_property
    def speed(self) -> FloatArray:
        """(sample,) horizontal speed of the pelvis over 0.3 s [m/s]"""
        return np.hypot(self.velocity[:, 0], self.velocity[:, 1])

    @cached_property
    def ankle_speed(self) -> FloatArray:
        """(sample, 2) relative to the pelvis [m/s]"""
        return np.linalg.norm(rate_of(self.pair("ankle") - self.joint("pelvis")[:, None]), axis=-1)

    @cached_property
    def wrist_velocity(self) -> FloatArray:
        """(sample, 2, 3) relative to the shoulders, ahead, left and up [m/s]"""
        return rate_of(self.wrists)

    @cached_property
    def wrist_speed(self) -> FloatArray:
        """(sample, 2) relative to the shoulders [m/s]"""
        return np.linalg.norm(self.wrist_velocity, axis=-1)

    @cached_property
    def foot_speed(self) -> FloatArray:
        """(sample, 2) horizontal speed of the stiller of ankle and toe joint [m/s]"""
        speeds = [np.linalg.norm(rate_of(self.pair(name))[..., :2], axis=-1) for name in ("ankle", "foot")]
        return np.minimum(*speeds)

    @cached_property
    def activity(self) -> FloatArray:
        """(sample,) mean speed of wrists, ankles, head and pelvis in the world [m/s]"""
        names = ("left_wrist", "right_wrist", "left_ankle", "right_ankle", "head", "pelvis")
        return np.mean([np.linalg.norm(rate_of(self.joint(name)), axis=-1) for name in names], axis=0)

    # support

    @cached_property
    def planted(self) -> Flags:
        """(sample, 2) whether the foot is down, within 5 cm"""
        return self.feet < 0.05

    @cached_property
    def mass(self) -> FloatArray:
        """(sample, 3) centre of mass [m]"""
        return centre_of_mass(self.joints)

    @cached_property
    def fall_of_mass(self) -> FloatArray:
        """(sample,) downward acceleration of the centre of mass, over 0.1 s [m/s^2]; 9.8 in free flight"""
        height = self.mass[:, 2]
        if len(height) < 5:
            return np.zeros(len(height))
        inner = (height[:-2] - 2.0 * height[1:-1] + height[2:]) * RATE**2
        return -smooth(np.concatenate([inner[:1], inner, inner[-1:]]), 0.1)

    @cached_property
    def airborne(self) -> Flags:
        """(sample,) whether nothing carries: both feet are over the floor, the centre of mass falls nearly freely"""
        return self._carried_by_nothing(0.03)

    def _carried_by_nothing(self, over: float) -> Flags:
        off = (self.feet.min(axis=1) > over) & (self.pelvis_height > 0.4 * STANDING)
        return off & (self.fall_of_mass > 3.5)

    @cached_property
    def flights(self) -> list[tuple[int, int]]:
        """First sample and end of each flight of 0.1 s or more, the feet 4.5 cm or more over the floor"""
        return self.flights_over(0.045)

    def flights_over(self, height: float) -> list[tuple[int, int]]:
        """First sample and end of each flight of 0.1 s or more: the centre of mass leaves upwards and falls freely, the
        feet `height` [m] or more over the floor; bodies upside down or level left out."""
        rise = rate_of(self.mass[:, 2])
        lower = self.feet.min(axis=1)
        return [
            (a, b)
            for a, b in stretches(self._carried_by_nothing(height / 1.5))
            if b - a >= 2
            and self.inclination[a:b].min() < 60.0
            and rise[max(a - 1, 0) : a + 1].max() > 0.2
            and lower[a:b].max() > height
            and self.fall_of_mass[a:b].max() > 5.5
        ]

    @property
    def longest_flight(self) -> float:
        """[s]"""
        return max((b - a for a, b in self.flights), default=0) / RATE

    @cached_property
    def steps(self) -> list[tuple[int, int, int]]:
        """(first sample, end, foot) of every swing of a foot that ends at least 0.12 m away, in the order of ends"""
        found = []
        place = self.pair("ankle")[..., :2]
        for foot in range(2):
            still = smooth(self.foot_speed[:, foot], 0.1) < 0.45
            for a, b in stretches(~still):
                if (
                    b - a >= 2
                    and np.linalg.norm(place[min(b, len(place) - 1), foot] - place[max(a - 1, 0), foot]) > 0.12
                ):
                    found.append((a, b, foot))
        return sorted(found, key=lambda step: step[1])

    @cached_property
    def path(self) -> float:
        """Length of the way of the pelvis over the floor [m]"""
        way = smooth(self.joint("pelvis")[:, :2], 0.6)
        return float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())

    @cached_property
    def roam(self) -> float:
        """Greatest distance of the pelvis over the floor from its median place, in the mean over 0.6 s [m]"""
        way = smooth(self.joint("pelvis")[:, :2], 0.6)
        return float(np.linalg.norm(way - np.median(way, axis=0), axis=1).max())

    @cached_property
    def displacement(self) -> FloatArray:
        """(3,) of the pelvis from start to end, in the axes of the start [m]"""
        c, s = np.cos(self.heading[0]), np.sin(self.heading[0])
        x, y, z = self.joint("pelvis")[-1] - self.joint("pelvis")[0]
        return np.array([c * x + s * y, c * y - s * x, z])

    @cached_property
    def head_turns(self) -> FloatArray:
        """(sample, 2) yaw and pitch of the head relative to the chest [degrees]; up is negative pitch"""
        relative = np.swapaxes(self.orientations["spine3"], 1, 2) @ self.orientations["head"]
        ahead = relative[:, :, 0]
        return np.degrees(
            np.stack([np.arctan2(ahead[:, 1], ahead[:, 0]), -np.arcsin(np.clip(ahead[:, 2], -1.0, 1.0))], axis=-1)
        )


def _standing_height(offsets: FloatArray) -> float:
    """Height of the pelvis of a body over its soles; soles as far below the ankles as a mean adult's, scaled [m]."""
    drop = -0.5 * sum(offsets[JOINT[f"{side}_{name}"], 2] for side in SIDES for name in ("hip", "knee", "ankle"))
    leg = 0.5 * sum(np.linalg.norm(offsets[JOINT[f"{side}_{name}"]]) for side in SIDES for name in ("knee", "ankle"))
    return float(max(drop, 0.5 * leg) + _ANKLE * leg / _LEG)


def _sampled(values: FloatArray, own: FloatArray, time: FloatArray) -> FloatArray:
    """Values (frame, ...) at `own` times, at `time`, linear between frames."""
    at = np.clip(np.interp(time, own, np.arange(len(own))), 0, len(own) - 1)
    low = np.minimum(np.floor(at + 1e-9).astype(int), len(own) - 2)
    part = (at - low).reshape(-1, *(1,) * (values.ndim - 1))
    sampled: FloatArray = (1.0 - part) * values[low] + part * values[low + 1]
    return sampled


def _flexion(motion: Motion, joints: list[int]) -> FloatArray:
    """(frame, joint) angle by which a joint is turned from the rest pose [degrees]"""
    turned = Rotation.from_quat(motion.rotations[:, joints].reshape(-1, 4)).magnitude()
    return np.degrees(turned).reshape(-1, len(joints))


def _angle(a: FloatArray, b: FloatArray) -> FloatArray:
    """Angle between vectors (..., 3) [degrees]."""
    lengths = np.linalg.norm(a, axis=-1) * np.linalg.norm(b, axis=-1)
    return np.degrees(np.arccos(np.clip(np.sum(a * b, axis=-1) / np.maximum(lengths, 1e-12), -1.0, 1.0)))
