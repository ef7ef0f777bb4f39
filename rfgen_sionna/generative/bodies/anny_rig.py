"""Bodies from anny (parametric human, Apache-2.0, data CC0), read out once into a :class:`Rig`."""

from __future__ import annotations

import logging
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import sparse

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.generative.bodies.body_parts import PART_NAMES, label_faces
from rfgen_sionna.generative.bodies.rig import Rig
from rfgen_sionna.generative.bodies.tpose import bone_joint, joint_bone, skeleton_in_t_pose, t_pose_rotations
from rfgen_sionna.generative.motion.skeleton import JOINT, JOINT_NAMES

if TYPE_CHECKING:
    import torch

_LOG = logging.getLogger(__name__)
_DENSITY = 980.0
"""Mean density of a body [kg/m^3], the value of anny's own anthropometry."""


def _cache_is_cold() -> bool:
    from anny.models.model_data import CURRENT_DATA_VERSION
    from anny.paths import get_anny_cache_path

    return not any((get_anny_cache_path() / f"v{CURRENT_DATA_VERSION}").glob("build_compact_model_data_*"))


@lru_cache(maxsize=1)
def load_model() -> Any:
    """anny's model with its default rig and topology.

    The first start on a machine builds a cache of about 0.8 GB in 40 to 150 s; a warning says so.

    Raises:
        ImportError: if anny (and torch) are not installed.
    """
    try:
        import anny
    except ImportError as error:
        raise ImportError(
            "the human body comes from the package `anny` (with torch), which is not installed: pip install anny torch"
        ) from error
    if _cache_is_cold():
        _LOG.warning("anny's first start on this machine: building its cache (about 0.8 GB, 40 to 150 s), once")
    # beyond 1 only where a heavy person needs it, see phenotype.HEAVIEST
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
    faces = load_model().faces.numpy()
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    volume = abs(float(np.einsum("ij,ij->", a, np.cross(b, c)))) / 6.0
    return float(np.ptp(vertices[:, 2])), _DENSITY * volume


def build_rig(parameters: dict[str, float]) -> Rig:
    """The rigged body for anny's phenotype parameters (0 .. 1, weight a little more)."""
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
    to_t_pose = t_pose_rotations(names, heads, vertices, feet)
    face_parts = label_faces(faces, weights, names)
    trunk = [PART_NAMES.index(part) for part in ("torso", "left_thigh", "right_thigh")]
    around = np.unique(faces[np.isin(face_parts, trunk)])
    skeleton = skeleton_in_t_pose(names, heads, parents, to_t_pose, vertices, feet, around)
    height, mass = stature_and_mass(vertices)
    return Rig(
        vertices=vertices,
        faces=faces,
        weights=weights,
        bone_names=names,
        bone_parents=parents,
        heads=heads,
        to_t_pose=to_t_pose,
        joint_bones=np.array([names.index(joint_bone(j)) for j in JOINT_NAMES], np.int32),
        turn_bones=np.array(
            [names.index(joint_bone(j).replace("upperarm01", "upperarm02")) for j in JOINT_NAMES], np.int32
        ),
        bone_joints=np.array([JOINT[bone_joint(b)] for b in names], np.int32),
        skeleton=skeleton,
        part_names=PART_NAMES,
        face_parts=face_parts,
        height=height,
        mass=mass,
        parameters=dict(parameters),
    )


def _foot_vertices(weights: sparse.csr_array, names: tuple[str, ...], suffix: str) -> IntArray:
    columns = [k for k, n in enumerate(names) if n.endswith(suffix) and n.startswith(("foot", "toe"))]
    return np.flatnonzero(np.asarray(weights[:, columns].sum(axis=1)).ravel() > 0.9).astype(np.int32)
