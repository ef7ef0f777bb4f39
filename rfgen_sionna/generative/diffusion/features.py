"""Feature rows of a motion: its representation in the model.

A row is one pose at 20 Hz on the mean adult: root position and orientation, joint rotations as the first two columns of
their matrices (Zhou et al. 2019), wrists, ankles and toes relative to the root, contacts, and principal components of
the fingers. All but the fingers is lossless.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.motion import JOINT_NAMES, MEAN_ADULT, PARENTS, Skeleton
from rfgen_sionna.generative.motion.rotations import to_matrices, to_quaternions
from rfgen_sionna.generative.motion.skeleton import JOINT, NUM_BODY_JOINTS, forward_kinematics, global_rotations
from rfgen_sionna.records import Motion

FRAME_RATE = 20.0
"""Poses per second of feature rows [Hz]."""
HAND_COMPONENTS = 6
"""Principal components of the fingers of a hand."""
HAND_JOINTS = {
    side: tuple(j for j, name in enumerate(JOINT_NAMES) if j >= NUM_BODY_JOINTS and name.startswith(side))
    for side in ("left", "right")
}
TRACKED = tuple(JOINT[f"{s}_{j}"] for j in ("wrist", "ankle", "foot") for s in ("left", "right"))
"""Joints whose positions are features."""

ROOT = slice(0, 3)
TURN = slice(3, 9)
LOCAL = slice(9, 9 + 6 * (NUM_BODY_JOINTS - 1))
TRACKED_POSITIONS = slice(LOCAL.stop, LOCAL.stop + 3 * len(TRACKED))
CONTACTS = slice(TRACKED_POSITIONS.stop, TRACKED_POSITIONS.stop + 2)
HANDS = slice(CONTACTS.stop, CONTACTS.stop + 2 * HAND_COMPONENTS)
NUM_FEATURES = HANDS.stop

MIRROR_ROTVEC = np.array([-1.0, 1.0, -1.0])
"""Signs of a rotation vector's components in a mirror image, left for right."""


def _columns(joints: tuple[str, ...], tracked: tuple[str, ...] = ()) -> list[int]:
    out: list[int] = []
    for name in joints:
        start = LOCAL.start + 6 * (JOINT[name] - 1)
        out += range(start, start + 6)
    for name in tracked:
        start = TRACKED_POSITIONS.start + 3 * TRACKED.index(JOINT[name])
        out += range(start, start + 3)
    return out


def _arm(side: str) -> list[int]:
    hand = HANDS.start + HAND_COMPONENTS * ("left", "right").index(side)
    joints = tuple(f"{side}_{j}" for j in ("collar", "shoulder", "elbow", "wrist"))
    return [*_columns(joints, (f"{side}_wrist",)), *range(hand, hand + HAND_COMPONENTS)]


PARTS = MappingProxyType(
    {
        "place": (0, 1),
        "pelvis": tuple(range(2, TURN.stop)),
        "legs": tuple(
            _columns(
                tuple(f"{s}_{j}" for s in ("left", "right") for j in ("hip", "knee", "ankle", "foot")),
                tuple(f"{s}_{j}" for s in ("left", "right") for j in ("ankle", "foot")),
            )
            + list(range(CONTACTS.start, CONTACTS.stop))
        ),
        "trunk": tuple(_columns(("spine1", "spine2", "spine3", "neck", "head"))),
        "left_arm": tuple(_arm("left")),
        "right_arm": tuple(_arm("right")),
    }
)
"""Part of the body -> its columns; every column has one part."""


@dataclass(frozen=True)
class HandBasis:
    """Principal components of the finger rotations of a left hand; right hands are mirrored."""

    mean: FloatArray
    """(45,) rotation vectors of the 15 finger joints of a relaxed hand [rad]."""
    components: FloatArray
    """(HAND_COMPONENTS, 45) orthonormal rows."""

    def encode(self, rotations: FloatArray, side: str) -> FloatArray:
        """(frame, HAND_COMPONENTS) from (frame, 15, 4) quaternions relative to the parent."""
        vectors = Rotation.from_quat(rotations.reshape(-1, 4)).as_rotvec().reshape(len(rotations), 15, 3)
        if side == "right":
            vectors = vectors * MIRROR_ROTVEC
        return (vectors.reshape(len(rotations), 45) - self.mean) @ self.components.T

    def decode(self, coefficients: FloatArray, side: str) -> FloatArray:
        """(frame, 15, 3, 3) rotations relative to the parent."""
        vectors = (self.mean + coefficients @ self.components).reshape(len(coefficients), 15, 3)
        if side == "right":
            vectors = vectors * MIRROR_ROTVEC
        return Rotation.from_rotvec(vectors.reshape(-1, 3)).as_matrix().reshape(len(coefficients), 15, 3, 3)


def encode(motion: Motion, hands: HandBasis) -> FloatArray:
    """(frame, NUM_FEATURES) rows of a motion with SMPL's 22 body joints, with or without fingers.

    Lengths are unscaled: the motion's legs must have the mean adult's length.

    Raises:
        ValueError: the motion lacks joints of the body.
    """
    if motion.joint_names[:NUM_BODY_JOINTS] != JOINT_NAMES[:NUM_BODY_JOINTS]:
        raise ValueError(f"motion.joint_names: {motion.joint_names}; the first 22 must be SMPL's body joints, in order")
    n = len(motion.translation)
    local = to_matrices(motion.rotations[:, :NUM_BODY_JOINTS])
    out = np.zeros((n, NUM_FEATURES))
    out[:, ROOT] = motion.translation
    six = np.swapaxes(local[..., :2], -1, -2).reshape(n, NUM_BODY_JOINTS, 6)
    out[:, TURN] = six[:, 0]
    out[:, LOCAL] = six[:, 1:].reshape(n, -1)
    places = body_positions(local, motion.translation)[:, TRACKED]
    out[:, TRACKED_POSITIONS] = (places - motion.translation[:, None]).reshape(n, -1)
    out[:, CONTACTS] = 0.0 if motion.contacts is None else motion.contacts
    if motion.joint_names == JOINT_NAMES:
        coefficients = [hands.encode(motion.rotations[:, joints], side) for side, joints in HAND_JOINTS.items()]
        out[:, HANDS] = np.concatenate(coefficients, axis=1)
    return out


def decode(features: FloatArray, hands: HandBasis, frame_rate: float, *, action: str = "") -> Motion:
    """The motion of (frame, NUM_FEATURES) rows on the mean adult; rotations become orthonormal."""
    n = len(features)
    local = np.empty((n, len(JOINT_NAMES), 3, 3))
    local[:, 0] = from_six(features[:, TURN])
    local[:, 1:NUM_BODY_JOINTS] = from_six(features[:, LOCAL].reshape(n, -1, 6))
    for side, coefficients in zip(HAND_JOINTS, np.split(features[:, HANDS], 2, axis=1), strict=True):
        local[:, HAND_JOINTS[side]] = hands.decode(coefficients, side)
    return Motion(
        rotations=to_quaternions(local),
        translation=features[:, ROOT].copy(),
        frame_rate=frame_rate,
        joint_names=JOINT_NAMES,
        parents=PARENTS,
        offsets=MEAN_ADULT.offsets,
        contacts=features[:, CONTACTS] > 0.5,
        action=action,
    )


def from_six(six: FloatArray) -> FloatArray:
    """(..., 3, 3) rotations from their first two columns (..., 6), by Gram-Schmidt."""
    a, b = six[..., :3], six[..., 3:]
    x = a / np.maximum(np.linalg.norm(a, axis=-1, keepdims=True), 1e-9)
    b = b - np.sum(x * b, axis=-1, keepdims=True) * x
    y = b / np.maximum(np.linalg.norm(b, axis=-1, keepdims=True), 1e-9)
    return np.stack([x, y, np.cross(x, y)], axis=-1)


def body_positions(local: FloatArray, translation: FloatArray, skeleton: Skeleton = MEAN_ADULT) -> FloatArray:
    """(frame, 22, 3) joint positions [m] from (frame, 22 or 52, 3, 3) rotations relative to the parent."""
    parents = PARENTS[:NUM_BODY_JOINTS]
    world = global_rotations(local[:, :NUM_BODY_JOINTS], parents)
    return forward_kinematics(world, translation, skeleton.offsets[:NUM_BODY_JOINTS], parents)


def joint_positions(features: FloatArray) -> FloatArray:
    """(frame, 22, 3) joint positions [m] of feature rows."""
    n = len(features)
    six = np.concatenate([features[:, None, TURN], features[:, LOCAL].reshape(n, -1, 6)], axis=1)
    return body_positions(from_six(six), features[:, ROOT])


def heading(features: FloatArray) -> FloatArray:
    """(frame,) direction of the pelvis in the horizontal plane [rad], unwrapped."""
    return np.unwrap(np.arctan2(features[:, TURN.start + 1], features[:, TURN.start]))


def turned(features: FloatArray, yaw: float) -> FloatArray:
    """Feature rows turned by `yaw` [rad] about the vertical through the origin."""
    c, s = np.cos(yaw), np.sin(yaw)
    matrix = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    out = features.copy()
    for part in (ROOT, TURN, TRACKED_POSITIONS):
        rows = features[:, part].reshape(len(features), -1, 3)
        out[:, part] = (rows @ matrix.T).reshape(len(features), -1)
    return out


def recentred(features: FloatArray, frame: int = 0) -> FloatArray:
    """Feature rows turned and shifted so that pose `frame` is over the origin facing +x; heights stay."""
    out = features.copy()
    out[:, :2] -= features[frame, :2]
    return turned(out, -float(np.arctan2(out[frame, TURN.start + 1], out[frame, TURN.start])))


def arms_of(action: str, hand: str) -> list[str]:
    """Arms that an action of the arms uses."""
    return {"left_arm_raised": ["left_arm"], "right_arm_raised": ["right_arm"]}.get(
        action, [f"{hand}_arm"] if hand else ["left_arm", "right_arm"]
    )


def replace_parts(base: FloatArray, other: FloatArray, parts: Sequence[str]) -> FloatArray:
    """Feature rows of `base` with parts of the body from `other`; positions follow from the rotations."""
    out = base.copy()
    for part in parts:
        out[:, list(PARTS[part])] = other[:, list(PARTS[part])]
    places = joint_positions(out)[:, list(TRACKED)] - out[:, None, ROOT]
    out[:, TRACKED_POSITIONS] = places.reshape(len(out), -1)
    return out
