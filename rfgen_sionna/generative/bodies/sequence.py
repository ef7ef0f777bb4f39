"""Mesh sequence of a rigged body in motion."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from rfgen_sionna._short_repr import ShortRepr
from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.generative.bodies.grounding import rest_on_floor, rests_on_floor
from rfgen_sionna.generative.bodies.retarget import bone_rotations, joint_rotations, root_translation, same_proportions
from rfgen_sionna.generative.bodies.rig import Rig
from rfgen_sionna.generative.bodies.vital_signs import VitalSigns, skin_directions
from rfgen_sionna.generative.motion.rotations import to_matrices, to_quaternions
from rfgen_sionna.generative.motion.skeleton import JOINT_NAMES
from rfgen_sionna.records import Motion


@dataclass(frozen=True, eq=False, repr=False)
class BodySequence(ShortRepr):
    """Body posed by bone rotations and a root path; a :class:`~rfgen_sionna.records.MeshSequence`.

    Cubic splines join the root positions and the bones' quaternions, which are then normalised: vertices have
    continuous velocity and acceleration. Skinning is linear blending in float64.
    """

    rig: Rig
    rotations: FloatArray
    """(frame, bone, 3, 3) world rotations relative to the mesh's rest pose."""
    translation: FloatArray
    """(frame, 3) positions of the root joint [m]."""
    frame_rate: float
    """Poses per second [Hz]."""
    vital_signs: VitalSigns | None = None
    """Breathing and heartbeat; None for a still skin."""

    @property
    def faces(self) -> IntArray:
        """(face, 3) vertex indices."""
        return self.rig.faces

    @property
    def rest_vertices(self) -> FloatArray:
        """(vertex, 3) positions of the body model's rest pose [m]."""
        return self.rig.vertices

    @property
    def part_names(self) -> tuple[str, ...]:
        """head, torso, left_upper_arm, ..."""
        return self.rig.part_names

    @property
    def face_parts(self) -> IntArray:
        """(face,) index into `part_names`."""
        return self.rig.face_parts

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The 52 joints of SMPL-H."""
        return JOINT_NAMES

    @property
    def duration(self) -> float:
        """Time between the first and the last pose [s]."""
        return (len(self.translation) - 1) / self.frame_rate

    @cached_property
    def _curve(self) -> CubicSpline | None:
        n = len(self.translation)
        if n < 2:
            return None
        quaternions = to_quaternions(self.rotations).reshape(n, -1)
        return CubicSpline(np.arange(n) / self.frame_rate, np.hstack([self.translation, quaternions]))

    def pose(self, t: float) -> tuple[FloatArray, FloatArray]:
        """(bone, 3, 3) rotations and (3,) root position [m] at `t` [s]."""
        if self._curve is None:
            return self.rotations[0], self.translation[0]
        state = self._curve(min(max(float(t), 0.0), self.duration))
        return to_matrices(state[3:].reshape(-1, 4)), state[:3]

    def vertices(self, t: float) -> FloatArray:
        """(vertex, 3) positions at `t` [s] in metres."""
        rotations, translation = self.pose(t)
        skin = self.rig.skin(rotations, translation)
        if self.vital_signs is None or self._moving_skin is None:
            return skin
        breath, beat = self._moving_skin
        moved = self.vital_signs.volume(t) * breath + self.vital_signs.pulse(t) * beat
        return skin + self.rig.turn(moved, rotations)

    @cached_property
    def _moving_skin(self) -> tuple[FloatArray, FloatArray] | None:
        return None if self.vital_signs is None else skin_directions(self.rig, self.vital_signs)

    def joints(self, t: float) -> FloatArray:
        """(52, 3) joint positions at `t` [s] in metres."""
        return self.rig.bone_heads(*self.pose(t))[self.rig.joint_bones]

    def joint_rotations(self, t: float) -> FloatArray:
        """(52, 3, 3) world rotations of the joints relative to the T-pose at `t` [s]."""
        rotations, _ = self.pose(t)
        bones = self.rig.turn_bones
        return rotations[bones] @ np.swapaxes(self.rig.to_t_pose[bones], -1, -2)


def animate(rig: Rig, motion: Motion, vital_signs: VitalSigns | None = None) -> BodySequence:
    """Mesh sequence of a body that performs a motion, resting on the floor z = 0, and breathes by `vital_signs`.

    A motion of another skeleton is scaled to the body's legs. What carries the body, feet or other parts, is put on the
    floor, and planted feet are held in place; a motion made for this body stays as it is where it is on the floor.

    Raises:
        ValueError: the motion has unknown joints, or no pelvis.
    """
    joints = joint_rotations(motion)
    translation = root_translation(motion, rig.skeleton)
    rate = motion.frame_rate
    if not (same_proportions(motion, rig.skeleton) and rests_on_floor(rig, joints, translation, rate)):
        joints, translation = rest_on_floor(rig, joints, translation, motion.contacts, rate)
    return BodySequence(rig, bone_rotations(rig, joints), translation, rate, vital_signs)
