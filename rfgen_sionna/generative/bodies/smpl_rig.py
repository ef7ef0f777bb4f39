"""Bodies of the SMPL family from the user's own licensed model files, as a :class:`Rig`.

Users get the files from the Max Planck Institute under its terms. Shape and skinning are used; corrective shapes by
pose (`posedirs`) are not.
"""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.bodies.rig import (
    PART_NAMES,
    Rig,
    body_mass,
    label_faces,
    measured_skeleton,
    trunk_vertices,
)
from rfgen_sionna.generative.motion import MEAN_ADULT, Skeleton
from rfgen_sionna.generative.motion.skeleton import JOINT, JOINT_NAMES, NUM_BODY_JOINTS, PARENTS, SIDES

_BODY = JOINT_NAMES[:NUM_BODY_JOINTS]
_FINGERS = JOINT_NAMES[NUM_BODY_JOINTS:]
_JOINTS = {
    "smpl": (*_BODY, "left_hand", "right_hand"),
    "smplh": (*_BODY, *_FINGERS),
    "smplx": (*_BODY, "jaw", "left_eye", "right_eye", *_FINGERS),
}
_SITES = {"smpl": "smpl.is.tue.mpg.de", "smplh": "mano.is.tue.mpg.de", "smplx": "smpl-x.is.tue.mpg.de"}
_GENDERS = ("neutral", "female", "male")
_KEYS = ("v_template", "shapedirs", "J_regressor", "weights", "kintree_table", "f")
_FOLLOWS = {
    "jaw": "head", "left_eye": "head", "right_eye": "head", "left_hand": "left_wrist", "right_hand": "right_wrist",
}  # fmt: skip
_SHAPES = 10
"""Shape parameters that are drawn from a seed."""


class BodyFileError(ValueError):
    """The body model file cannot be used."""


def smpl_file(folder: str | PathLike[str], model: str = "smplx", gender: str = "neutral") -> Path:
    """Path of a model's file, such as `folder/smplx/SMPLX_NEUTRAL.npz`, as in the package `smplx`.

    Raises:
        BodyFileError: unknown model or gender.
        FileNotFoundError: there is no such file; the message names it, its place and its source.
    """
    if model not in _JOINTS:
        raise BodyFileError(f"model: {model!r}; allowed are {', '.join(_JOINTS)}")
    if gender not in _GENDERS:
        raise BodyFileError(f"gender: {gender!r}; allowed are {', '.join(_GENDERS)}")
    path = Path(folder) / model / f"{model.upper()}_{gender.upper()}.npz"
    if not path.is_file():
        raise FileNotFoundError(
            f"the {model.upper()} body needs the licensed file {path.name}, which goes to {path}. It is given out at "
            f"https://{_SITES[model]} after registration (.pkl files are not read: convert them to .npz)"
        )
    return path


def smpl_person(
    folder: str | PathLike[str],
    *,
    model: str = "smplx",
    gender: str = "neutral",
    betas: ArrayLike | None = None,
    seed: int = 0,
) -> Rig:
    """Rigged body of a model of the SMPL family.

    Args:
        folder: folder of the user's model files (:func:`smpl_file`).
        model: "smpl", "smplh" or "smplx".
        gender: "neutral", "female" or "male".
        betas: shape parameters; None draws ten from the model's distribution.
        seed: seed of the shape.

    Raises:
        BodyFileError: unknown model or gender, wrong shape parameters, or an invalid file.
        FileNotFoundError: the licensed file is missing.
    """
    path = smpl_file(folder, model, gender)
    names = _JOINTS[model]
    data = _read(path, len(names))
    shapes = np.asarray(data["shapedirs"], np.float64)
    if betas is None:
        drawn = np.random.default_rng([seed, 61]).standard_normal(min(_SHAPES, shapes.shape[2]))
        betas = np.clip(drawn, -2.0, 2.0)
    shape = np.asarray(betas, np.float64)
    if shape.ndim != 1 or len(shape) > shapes.shape[2] or not np.isfinite(shape).all():
        raise BodyFileError(f"betas: shape {shape.shape}; allowed are up to {shapes.shape[2]} finite numbers")
    theirs = np.asarray(data["v_template"], np.float64) + shapes[..., : len(shape)] @ shape
    vertices = _our_frame(theirs)
    heads = _our_frame(np.asarray(data["J_regressor"], np.float64) @ theirs)
    # on the floor
    lift = np.array([0.0, 0.0, vertices[:, 2].min()])
    vertices, heads = vertices - lift, heads - lift
    faces = np.asarray(data["f"], np.int32)
    weights = sparse.csr_array(np.asarray(data["weights"], np.float64))
    joints = [_FOLLOWS.get(name, name) for name in names]
    follows = np.array([JOINT[j] for j in joints], np.int32)
    face_parts = label_faces(faces, weights, [_part(j) for j in joints])
    bones = np.array([_bone(name, names) for name in JOINT_NAMES], np.int32)
    return Rig(
        vertices=vertices, faces=faces, weights=weights, bone_names=names,
        bone_parents=_parents(data["kintree_table"]), heads=heads,
        # the rest pose is the T-pose
        to_t_pose=np.broadcast_to(np.eye(3), (len(names), 3, 3)).copy(), joint_bones=bones, turn_bones=bones,
        bone_joints=follows, skeleton=_skeleton(vertices, heads, names, weights, faces, face_parts),
        part_names=PART_NAMES, face_parts=face_parts, height=float(np.ptp(vertices[:, 2])),
        mass=body_mass(vertices, faces),
    )  # fmt: skip


def _read(path: Path, joints: int) -> dict[str, np.ndarray]:
    try:
        with np.load(path, allow_pickle=False) as file:
            missing = [key for key in _KEYS if key not in file.files]
            if missing:
                raise BodyFileError(f"{path.name}: {', '.join(missing)} missing; a model file of this family has them")
            data = {key: file[key] for key in _KEYS}
    except BodyFileError:
        raise
    except (OSError, ValueError) as error:
        raise BodyFileError(f"{path.name}: not a readable .npz file ({error})") from error
    n = len(data["v_template"])
    wanted = {"v_template": (n, 3), "J_regressor": (joints, n), "weights": (n, joints), "kintree_table": (2, joints)}
    for key, shape in wanted.items():
        if data[key].shape != shape:
            raise BodyFileError(f"{path.name}: {key} has shape {data[key].shape}; allowed is {shape}")
    if data["shapedirs"].ndim != 3 or data["shapedirs"].shape[:2] != (n, 3):
        raise BodyFileError(f"{path.name}: shapedirs has shape {data['shapedirs'].shape}; allowed is ({n}, 3, shapes)")
    if data["f"].ndim != 2 or data["f"].shape[1] != 3 or data["f"].max() >= n:
        raise BodyFileError(f"{path.name}: f has shape {data['f'].shape}; allowed are triangles of {n} vertices")
    return data


def _our_frame(points: FloatArray) -> FloatArray:
    """These models face +z with y up and their left at +x."""
    return points[:, [2, 0, 1]]


def _parents(table: np.ndarray) -> tuple[int, ...]:
    """Parents of the joints; the root's own is stored as -1 or as 2^32 - 1."""
    return (-1, *(int(p) for p in table[0][1:]))


def _bone(joint: str, names: tuple[str, ...]) -> int:
    """Bone of a joint; the hand replaces missing fingers."""
    if joint in names:
        return names.index(joint)
    return names.index(joint.partition("_")[0] + "_hand")


def _part(joint: str) -> str:
    """Part of the body that a joint moves."""
    side, _, rest = joint.partition("_")
    if joint in ("neck", "head"):
        return "head"
    limb = {"hip": "thigh", "knee": "shank", "ankle": "foot", "foot": "foot"}
    limb |= {"shoulder": "upper_arm", "elbow": "forearm", "wrist": "hand"}
    if side in SIDES and rest != "collar":
        return f"{side}_{limb.get(rest, 'hand')}"
    return "torso"


def _skeleton(
    vertices: FloatArray,
    heads: FloatArray,
    names: tuple[str, ...],
    weights: sparse.csr_array,
    faces: np.ndarray,
    face_parts: np.ndarray,
) -> Skeleton:
    """Skeleton in the rest pose."""
    offsets = np.zeros((len(JOINT_NAMES), 3))
    for j, p in enumerate(PARENTS):
        if p >= 0 and JOINT_NAMES[j] in names:
            offsets[j] = heads[names.index(JOINT_NAMES[j])] - heads[names.index(JOINT_NAMES[p])]
    fore = np.linalg.norm(offsets[JOINT["left_wrist"]])
    missing = [j for j, name in enumerate(JOINT_NAMES) if name not in names]
    # missing fingers are those of the mean adult, scaled by the forearm
    offsets[missing] = MEAN_ADULT.offsets[missing] * (fore / np.linalg.norm(MEAN_ADULT.offsets[JOINT["left_wrist"]]))
    soles = []
    for side in SIDES:
        ankle, toe = (names.index(f"{side}_{j}") for j in ("ankle", "foot"))
        moved = np.asarray(weights[:, [ankle, toe]].sum(axis=1)).ravel() > 0.9
        soles.append(vertices[moved] - heads[ankle])
    joints = np.zeros_like(offsets)
    for j, p in enumerate(PARENTS):
        if p >= 0:
            joints[j] = joints[p] + offsets[j]
    return measured_skeleton(offsets, joints, soles, vertices[trunk_vertices(faces, face_parts)] - heads[0])
