"""A motion performed by a body."""

from __future__ import annotations

from rfgen_sionna.generative.bodies.grounding import stand_on_floor
from rfgen_sionna.generative.bodies.retarget import bone_rotations, joint_rotations, root_translation, same_proportions
from rfgen_sionna.generative.bodies.rig import Rig
from rfgen_sionna.generative.bodies.sequence import BodySequence
from rfgen_sionna.records import Motion


def animate(rig: Rig, motion: Motion) -> BodySequence:
    """The mesh sequence of a body that performs a motion, its feet on the floor z = 0.

    A motion made for this very body is taken as it is; any other is scaled to its legs, set on the floor, and its
    planted feet are held in place.

    Raises:
        ValueError: the motion has joints that the skeleton does not know.
    """
    joints = joint_rotations(motion)
    translation = root_translation(motion, rig.skeleton)
    if not same_proportions(motion, rig.skeleton):
        joints, translation = stand_on_floor(rig, joints, translation, motion.contacts, motion.frame_rate)
    return BodySequence(rig, bone_rotations(rig, joints), translation, motion.frame_rate)
