"""A body with the bone lengths of a measured person."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.bodies.rig import Rig, body_mass, measured_skeleton, trunk_vertices
from rfgen_sionna.generative.motion.rotations import normalised
from rfgen_sionna.generative.motion.skeleton import JOINT, NUM_BODY_JOINTS, PARENTS, SIDES, Skeleton

_LIMBS = {"hip": "knee", "knee": "ankle", "shoulder": "elbow", "elbow": "wrist"}
"""First joint of each limb's bone -> second."""


def fitted_body(rig: Rig, offsets: FloatArray) -> Rig:
    """The body with other bone lengths.

    Joints of the body move to their measured rest positions; limbs are stretched along their bones and the trunk
    between hips and shoulders, the rest is scaled evenly. Skin does not follow where a layout has a joint beside its
    anatomical place (hips further inside, the head's centre instead of its base): there only the centre of rotation
    moves.

    Args:
        rig: the body.
        offsets: (22, 3) rest positions of the joints relative to their parents [m], as in
            :func:`rfgen_sionna.generative.motion.inverse_kinematics.measured_offsets`.
    """
    old = _posed_heads(rig)
    at = old[rig.joint_bones]
    pivots, anatomy, stretch = _targets(at, np.asarray(offsets, np.float64))
    maps, heads = _bone_maps(rig, old, pivots, anatomy, stretch)
    w = rig.weights.tocoo()
    # each bone carries the rest vertices by its own affine map, blended by the skinning weights
    carried = np.einsum("kij,kj->ki", maps[w.col, :, :3], rig.vertices[w.row]) + maps[w.col, :, 3]
    columns = [np.bincount(w.row, w.data * carried[:, k], len(rig.vertices)) for k in range(3)]
    vertices = np.stack(columns, axis=-1).astype(np.float64)
    fitted = replace(
        rig, vertices=vertices, heads=heads, height=float(np.ptp(vertices[:, 2])),
        mass=body_mass(vertices, rig.faces), parameters=None,
        fitted_from=None if rig.parameters is None else (rig.parameters, np.asarray(offsets, np.float64)),
    )  # fmt: skip
    return replace(fitted, skeleton=_skeleton(fitted, at, offsets))


def _posed_heads(rig: Rig) -> FloatArray:
    """(bone, 3) heads in the T-pose, from the root's."""
    return rig.bone_heads(rig.to_t_pose, np.zeros(3))


def _targets(at: FloatArray, offsets: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Centres of rotation and anatomical joints (52, 3) in the T-pose from the pelvis [m], and (52, 3, 3) stretch of
    the skin around each, for a body whose joints are at (52, 3) `at`."""
    n = NUM_BODY_JOINTS
    pivots = np.zeros_like(at)
    for j in range(1, n):
        pivots[j] = pivots[PARENTS[j]] + offsets[j]
    hips, shoulders = ((JOINT[f"left_{name}"], JOINT[f"right_{name}"]) for name in ("hip", "shoulder"))
    hip, old_hip = pivots[list(hips)].mean(axis=0), at[list(hips)].mean(axis=0)
    rise = pivots[list(shoulders), 2].mean() - hip[2]
    old_rise = at[list(shoulders), 2].mean() - old_hip[2]
    legs = sum(np.linalg.norm(offsets[JOINT[f"{s}_{j}"]]) for s in SIDES for j in ("knee", "ankle"))
    old_legs = sum(np.linalg.norm(at[JOINT[f"{s}_{b}"]] - at[JOINT[f"{s}_{a}"]])
                   for s in SIDES for a, b in (("hip", "knee"), ("knee", "ankle")))  # fmt: skip
    size = float((0.5 * legs + rise) / (0.5 * old_legs + old_rise))
    trunk = size * np.diag([1.0, 1.0, rise / (size * old_rise)])
    stretch = np.tile(size * np.eye(3), (len(at), 1, 1))
    anatomy = hip + (at - old_hip) @ trunk
    for name in ("pelvis", "spine1", "spine2", "spine3"):
        stretch[JOINT[name]] = trunk
    anatomy[JOINT["head"]] = anatomy[JOINT["neck"]] + size * (at[JOINT["head"]] - at[JOINT["neck"]])
    for side in SIDES:
        for first, second in _LIMBS.items():
            a, b = JOINT[f"{side}_{first}"], JOINT[f"{side}_{second}"]
            anatomy[b] = pivots[b]
            if first == "hip":
                # the skin of a thigh stays under the anatomical hip
                anatomy[a] = [pivots[a, 0], pivots[b, 1], pivots[a, 2]]
            else:
                anatomy[a] = pivots[a]
            bone, old = anatomy[b] - anatomy[a], at[b] - at[a]
            along = normalised(old)
            factor = np.linalg.norm(bone) / (size * np.linalg.norm(old))
            stretch[a] = size * (np.eye(3) + (factor - 1.0) * np.outer(along, along))
        anatomy[JOINT[f"{side}_foot"]] = pivots[JOINT[f"{side}_ankle"]] + size * (
            at[JOINT[f"{side}_foot"]] - at[JOINT[f"{side}_ankle"]]
        )
    for j in range(n, len(at)):
        pivots[j] = pivots[PARENTS[j]] + size * (at[j] - at[PARENTS[j]])
        anatomy[j] = pivots[j]
    return pivots, anatomy, stretch


def _bone_maps(
    rig: Rig, old: FloatArray, pivots: FloatArray, anatomy: FloatArray, stretch: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(bone, 3, 4) affine maps of the rest vertices, and (bone, 3) new heads at rest [m]."""
    of_bone = {int(bone): j for j, bone in reversed(list(enumerate(rig.joint_bones)))}
    posed = np.empty_like(old)
    for b in range(len(old)):
        # bones between two joints turn about the next one down, so that their share of a turn moves no joint
        joint = of_bone.get(b, _next_joint(rig, b, of_bone))
        own = int(rig.bone_joints[b])
        posed[b] = pivots[joint] if joint >= 0 else anatomy[own] + stretch[own] @ (old[b] - old[rig.joint_bones[own]])
    heads = np.empty_like(old)
    for b, parent in enumerate(rig.bone_parents):
        if parent < 0:
            heads[b] = rig.heads[b]
        else:
            heads[b] = heads[parent] + rig.to_t_pose[parent].T @ (posed[b] - posed[parent])
    maps = np.empty((len(old), 3, 4))
    for b in range(len(old)):
        own, turn = int(rig.bone_joints[b]), rig.to_t_pose[b]
        start = rig.joint_bones[own]
        # a rest vertex, in the T-pose, around the anatomical joint, and back to rest around the new head
        maps[b, :, :3] = turn.T @ stretch[own] @ turn
        shift = anatomy[own] + stretch[own] @ (old[b] - old[start]) - posed[b]
        maps[b, :, 3] = heads[b] + turn.T @ shift - maps[b, :, :3] @ rig.heads[b]
    return maps, heads


def _next_joint(rig: Rig, bone: int, of_bone: dict[int, int]) -> int:
    """Joint at the end of a chain of bones below `bone`, or -1 if it ends without one."""
    children = [b for b, parent in enumerate(rig.bone_parents) if parent == bone]
    if len(children) != 1:
        return -1
    return of_bone[children[0]] if children[0] in of_bone else _next_joint(rig, children[0], of_bone)


def _skeleton(rig: Rig, at: FloatArray, offsets: FloatArray) -> Skeleton:
    """Skeleton with the given body joints, and the fingers where the bones have them."""
    heads = _posed_heads(rig)
    joints = heads[rig.joint_bones]
    whole = np.zeros_like(at)
    for j, parent in enumerate(PARENTS):
        if parent >= 0:
            whole[j] = joints[j] - joints[parent]
    whole[: len(offsets)] = offsets
    soles = []
    for side in SIDES:
        ankle = rig.joint_bones[JOINT[f"{side}_ankle"]]
        part = rig.part_names.index(f"{side}_foot")
        rows = np.unique(rig.faces[rig.face_parts == part])
        soles.append((rig.vertices[rows] - rig.heads[ankle]) @ rig.to_t_pose[ankle].T)
    posed = rig.skin(rig.to_t_pose, np.zeros(3), trunk_vertices(rig.faces, rig.face_parts))
    return measured_skeleton(whole, joints, soles, posed)
