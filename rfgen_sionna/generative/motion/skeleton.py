"""The joint tree: SMPL-H's 22 body and 30 finger joints, named and ordered as there, in our frame.

Rest pose: T-pose facing +x, left side at +y, z up, palms down, elbows ready to bend forward, feet flat and
parallel. Only the order and the parents are SMPL-H's (Romero et al. 2017); the lengths are our own.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from rfgen_sionna._types import FloatArray

_BODY = (
    ("pelvis", None),
    ("left_hip", "pelvis"),
    ("right_hip", "pelvis"),
    ("spine1", "pelvis"),
    ("left_knee", "left_hip"),
    ("right_knee", "right_hip"),
    ("spine2", "spine1"),
    ("left_ankle", "left_knee"),
    ("right_ankle", "right_knee"),
    ("spine3", "spine2"),
    ("left_foot", "left_ankle"),
    ("right_foot", "right_ankle"),
    ("neck", "spine3"),
    ("left_collar", "spine3"),
    ("right_collar", "spine3"),
    ("head", "neck"),
    ("left_shoulder", "left_collar"),
    ("right_shoulder", "right_collar"),
    ("left_elbow", "left_shoulder"),
    ("right_elbow", "right_shoulder"),
    ("left_wrist", "left_elbow"),
    ("right_wrist", "right_elbow"),
)
FINGERS = ("index", "middle", "pinky", "ring", "thumb")
SIDES = ("left", "right")
HANDS = (*SIDES, "both")
"""What gestures are made with."""
PLANTED_BELOW = 0.3
"""Height over the floor beyond which no foot of an adult is planted, whatever is said of it [m]."""

_TREE = _BODY + tuple(
    (f"{side}_{finger}{k}", f"{side}_wrist" if k == 1 else f"{side}_{finger}{k - 1}")
    for side in SIDES
    for finger in FINGERS
    for k in (1, 2, 3)
)
JOINT_NAMES: tuple[str, ...] = tuple(name for name, _ in _TREE)
JOINT: dict[str, int] = {name: i for i, name in enumerate(JOINT_NAMES)}
"""Index of each joint."""
PARENTS: tuple[int, ...] = tuple(-1 if parent is None else JOINT[parent] for _, parent in _TREE)
NUM_BODY_JOINTS = len(_BODY)


def side_sign(side: str) -> int:
    """+1 for left, -1 for right (the sign of y)."""
    return {"left": 1, "right": -1}[side]


@dataclass(frozen=True)
class Skeleton:
    """Bone lengths of one person in the T-pose."""

    offsets: FloatArray
    """(52, 3) rest position of each joint relative to its parent [m]; the pelvis' own row is zero."""
    ankle_height: float
    """Height of the ankle joints over the sole [m]."""
    heel: FloatArray
    """(2, 3) point of the left and the right heel on which the foot rolls at touch-down, from the ankle [m]."""
    toe_height: float
    """Height of the toe joints over the sole [m]."""
    arm_slope: float = 0.08
    """How far a hanging arm must lead outwards to clear trunk and thighs: sideways over down."""
    joint_names: tuple[str, ...] = field(default=JOINT_NAMES)
    parents: tuple[int, ...] = field(default=PARENTS)

    def length(self, joint: str) -> float:
        """Distance of `joint` from its parent [m]."""
        return float(np.linalg.norm(self.offsets[JOINT[joint]]))

    def leg_length(self) -> float:
        """Hip to ankle, straight, mean of both sides [m]."""
        return 0.5 * sum(self.length(f"{s}_knee") + self.length(f"{s}_ankle") for s in SIDES)

    def standing_height(self) -> float:
        """Height of the pelvis joint over the floor when the legs are straight and vertical [m]."""
        drop = sum(self.offsets[JOINT[f"{s}_{j}"], 2] for s in SIDES for j in ("hip", "knee", "ankle"))
        return float(self.ankle_height - 0.5 * drop)

    def rest_positions(self) -> FloatArray:
        """(52, 3) joint positions of the rest pose with the pelvis at the origin [m]."""
        positions = np.zeros_like(self.offsets)
        for j, p in enumerate(self.parents):
            if p >= 0:
                positions[j] = positions[p] + self.offsets[j]
        return positions

    def scaled(self, factor: float) -> Skeleton:
        """The same proportions, `factor` times the size."""
        return Skeleton(
            self.offsets * factor,
            self.ankle_height * factor,
            self.heel * factor,
            self.toe_height * factor,
            self.arm_slope,
        )


def forward_kinematics(
    rotations: FloatArray, translation: FloatArray, offsets: FloatArray, parents: tuple[int, ...]
) -> FloatArray:
    """Joint positions from global joint rotations.

    Args:
        rotations: (..., joint, 3, 3) world rotation of each joint relative to the rest pose.
        translation: (..., 3) position of the root [m].
        offsets: (joint, 3) rest offsets from the parent [m].
        parents: parent of each joint, parents first.

    Returns:
        (..., joint, 3) positions [m].
    """
    positions = np.empty(rotations.shape[:-1])
    for j, p in enumerate(parents):
        if p < 0:
            positions[..., j, :] = translation
        else:
            positions[..., j, :] = positions[..., p, :] + rotations[..., p, :, :] @ offsets[j]
    return positions


def global_rotations(local: FloatArray, parents: tuple[int, ...]) -> FloatArray:
    """(..., joint, 3, 3) world rotations from rotations relative to the parent."""
    world = np.empty_like(local)
    for j, p in enumerate(parents):
        world[..., j, :, :] = local[..., j, :, :] if p < 0 else world[..., p, :, :] @ local[..., j, :, :]
    return world
