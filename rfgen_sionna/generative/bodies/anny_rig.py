"""Bodies of anny (parametric human, Apache-2.0, data CC0) as a :class:`Rig`, from its rest pose to the T-pose."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import sparse

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.generative.bodies.rig import (
    PART_NAMES,
    Rig,
    body_mass,
    label_faces,
    measured_skeleton,
    trunk_vertices,
)
from rfgen_sionna.generative.motion.rotations import X, Y, Z, about, basis, between, normalised, transpose
from rfgen_sionna.generative.motion.skeleton import JOINT, JOINT_NAMES, PARENTS, SIDES, Skeleton, side_sign

if TYPE_CHECKING:
    import torch

_LOG = logging.getLogger(__name__)
_FINGER = {"thumb": 1, "index": 2, "middle": 3, "ring": 4, "pinky": 5}
_CENTRAL = {
    "pelvis": "root", "spine1": "spine05", "spine2": "spine03", "spine3": "spine02", "neck": "neck01",
    "head": "head",
}  # fmt: skip
_PAIRED = {
    "hip": "upperleg01", "knee": "lowerleg01", "ankle": "foot", "foot": "toe2-1", "collar": "clavicle",
    "shoulder": "upperarm01", "elbow": "lowerarm01", "wrist": "wrist",
}  # fmt: skip
_CENTRAL_BONES = {
    "root": "pelvis", "spine05": "spine1", "spine04": "spine1", "spine03": "spine2", "spine02": "spine3",
    "spine01": "spine3", "neck01": "neck", "neck02": "neck", "neck03": "head", "head": "head",
}  # fmt: skip
_PAIRED_BONES = {
    "upperleg": "hip", "lowerleg": "knee", "foot": "ankle", "toe": "foot", "clavicle": "collar", "shoulder": "collar",
    "upperarm": "shoulder", "lowerarm": "elbow", "wrist": "wrist", "metacarpal": "wrist",
}  # fmt: skip
_LIMB_PARTS = {
    "upperarm": "upper_arm", "lowerarm": "forearm", "wrist": "hand", "finger": "hand", "metacarpal": "hand",
    "upperleg": "thigh", "lowerleg": "shank", "foot": "foot", "toe": "foot",
}  # fmt: skip
_SUFFIX = {"left": ".L", "right": ".R"}


def _cache_is_empty() -> bool:
    from anny.models.model_data import CURRENT_DATA_VERSION
    from anny.paths import get_anny_cache_path

    return not any((get_anny_cache_path() / f"v{CURRENT_DATA_VERSION}").glob("build_compact_model_data_*"))


@lru_cache(maxsize=1)
def load_model() -> Any:
    """anny's model with its default rig and topology; its first start on a machine builds a cache, with a warning.

    Raises:
        ImportError: anny (or torch) is not installed.
    """
    try:
        import anny
    except ImportError as error:
        raise ImportError(
            "the human body comes from the package `anny` (with torch), which is not installed: pip install anny torch"
        ) from error
    if _cache_is_empty():
        _LOG.warning("anny's first start on this machine: building its cache (about 0.8 GB, 40 to 150 s), once")
    # weights above 1 for heavy persons, see phenotype.HEAVIEST
    return anny.Anny(skinning_method="lbs", extrapolate_phenotypes=True)


def rest_shape(parameters: dict[str, float]) -> tuple[FloatArray, FloatArray]:
    """Rest vertices (vertex, 3) and bone heads (bone, 3) in our frame [m] for anny's phenotype parameters."""
    model = load_model()
    import torch

    with torch.no_grad():
        out = model(phenotype_kwargs=parameters)
    return _our_frame(out["rest_vertices"][0]), _our_frame(out["rest_bone_heads"][0])


def _our_frame(points: torch.Tensor) -> FloatArray:
    """anny faces -y with z up and its left at +x."""
    p = points.detach().cpu().numpy().astype(np.float64)
    return np.stack([-p[:, 1], p[:, 0], p[:, 2]], axis=1)


def stature_and_mass(vertices: FloatArray) -> tuple[float, float]:
    """Height [m] and mass [kg] of a body at rest, from its vertices (vertex, 3)."""
    return float(np.ptp(vertices[:, 2])), body_mass(vertices, load_model().faces.numpy())


def build_rig(parameters: dict[str, float]) -> Rig:
    """Rigged body of anny's phenotype parameters (0 .. 1, weight up to `phenotype.HEAVIEST`)."""
    vertices, heads = rest_shape(parameters)
    model = load_model()
    names, parents = tuple(model.bone_labels), tuple(int(p) for p in model.bone_parents)
    faces = model.faces.numpy().astype(np.int32)
    w, i = model.vertex_bone_weights.numpy(), model.vertex_bone_indices.numpy()
    rows = np.repeat(np.arange(len(w)), w.shape[1])
    weights = sparse.csr_array((w.ravel().astype(np.float64), (rows, i.ravel())), shape=(len(w), len(names)))
    weights.sum_duplicates()
    weights.eliminate_zeros()
    weights = sparse.csr_array(weights / weights.sum(axis=1)[:, None])
    feet = [_foot_vertices(weights, names, suffix) for suffix in (".L", ".R")]
    to_t_pose = _t_pose_rotations(names, heads, vertices, feet)
    face_parts = label_faces(faces, weights, [bone_part(b) for b in names])
    trunk = trunk_vertices(faces, face_parts)
    skeleton = _skeleton_in_t_pose(names, heads, parents, to_t_pose, vertices, feet, trunk)
    height, mass = stature_and_mass(vertices)
    return Rig(
        vertices=vertices, faces=faces, weights=weights, bone_names=names, bone_parents=parents, heads=heads,
        to_t_pose=to_t_pose, joint_bones=np.array([names.index(joint_bone(j)) for j in JOINT_NAMES], np.int32),
        turn_bones=np.array(
            [names.index(joint_bone(j).replace("upperarm01", "upperarm02")) for j in JOINT_NAMES], np.int32
        ), bone_joints=np.array([JOINT[bone_joint(b)] for b in names], np.int32), skeleton=skeleton,
        part_names=PART_NAMES, face_parts=face_parts, height=height, mass=mass, parameters=dict(parameters),
    )  # fmt: skip


def _foot_vertices(weights: sparse.csr_array, names: tuple[str, ...], suffix: str) -> IntArray:
    columns = [k for k, n in enumerate(names) if n.endswith(suffix) and n.startswith(("foot", "toe"))]
    return np.flatnonzero(np.asarray(weights[:, columns].sum(axis=1)).ravel() > 0.9).astype(np.int32)


def bone_part(bone: str) -> str:
    """Name of the part that a bone of anny's rig moves."""
    if bone.startswith(("head", "neck", "eye")):
        return "head"
    side = {"L": "left_", "R": "right_"}.get(bone.rpartition(".")[2], "")
    part = next((part for prefix, part in _LIMB_PARTS.items() if bone.startswith(prefix)), None)
    return side + part if side and part else "torso"


def joint_bone(joint: str) -> str:
    """Bone of anny's rig whose head is the joint."""
    if joint in _CENTRAL:
        return _CENTRAL[joint]
    side, _, name = joint.partition("_")
    suffix = _SUFFIX[side]
    if name in _PAIRED:
        return _PAIRED[name] + suffix
    return f"finger{_FINGER[name[:-1]]}-{name[-1]}{suffix}"


def bone_joint(bone: str) -> str:
    """Joint of the skeleton that a bone of anny's rig follows."""
    stem, _, suffix = bone.rpartition(".")
    if suffix not in ("L", "R"):
        return _CENTRAL_BONES[bone]
    side = {"L": "left", "R": "right"}[suffix]
    if stem in ("eye", "pelvis"):
        return {"eye": "head", "pelvis": "pelvis"}[stem]
    if stem.startswith("finger"):
        number, joint = int(stem[6]), stem[8]
        return f"{side}_{next(k for k, v in _FINGER.items() if v == number)}{joint}"
    return f"{side}_{next(joint for prefix, joint in _PAIRED_BONES.items() if stem.startswith(prefix))}"


def _t_pose_rotations(
    names: tuple[str, ...], heads: FloatArray, vertices: FloatArray, foot_vertices: Sequence[IntArray]
) -> FloatArray:
    """(bone, 3, 3) rotation of each bone from the rest pose to the T-pose.

    Limbs are aligned by direction and hinge, hands by the line of the knuckles, fingers to the palm's plane, feet
    forwards with heel and ball level. `foot_vertices` are the vertices of foot and toes for each side.
    """
    at = {name: heads[i] for i, name in enumerate(names)}
    rotation = dict.fromkeys(names, np.eye(3))
    for i, side in enumerate(SIDES):
        s, d = side_sign(side), _SUFFIX[side]
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
    """Angle [rad] of the line under heel and ball, positive if it rises to the front."""
    x = points[:, 0]
    back, front = x < np.quantile(x, 0.3), (x > np.quantile(x, 0.55)) & (x < np.quantile(x, 0.9))
    slope = 0.0
    for _ in range(5):
        z = points[:, 2] * np.cos(slope) - x * np.sin(slope)
        heel, ball = np.argmin(np.where(back, z, np.inf)), np.argmin(np.where(front, z, np.inf))
        slope = float(np.arctan2(points[ball, 2] - points[heel, 2], x[ball] - x[heel]))
    return slope


def _skeleton_in_t_pose(
    names: tuple[str, ...],
    heads: FloatArray,
    parents: tuple[int, ...],
    to_t_pose: FloatArray,
    vertices: FloatArray,
    foot_vertices: Sequence[IntArray],
    trunk: IntArray,
) -> Skeleton:
    """Skeleton of the body in the T-pose; `trunk` holds the vertices of torso and thighs."""
    posed = np.zeros_like(heads)
    for b, p in enumerate(parents):
        if p >= 0:
            posed[b] = posed[p] + to_t_pose[p] @ (heads[b] - heads[p])
    index = {name: i for i, name in enumerate(names)}
    joints = np.stack([posed[index[joint_bone(j)]] for j in JOINT_NAMES])
    soles = []
    for side, feet in zip(SIDES, foot_vertices, strict=True):
        # the toe joint is the mean of the three inner ones, which carry the push-off
        joints[JOINT[f"{side}_foot"]] = np.mean([posed[index[f"toe{k}-1{_SUFFIX[side]}"]] for k in (1, 2, 3)], axis=0)
        ankle = index["foot" + _SUFFIX[side]]
        soles.append((vertices[feet] - heads[ankle]) @ to_t_pose[ankle].T)
    offsets = np.array([joints[j] - joints[p] if p >= 0 else np.zeros(3) for j, p in enumerate(PARENTS)])
    return measured_skeleton(offsets, joints, soles, vertices[trunk] - heads[0])
