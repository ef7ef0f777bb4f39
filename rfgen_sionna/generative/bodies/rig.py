"""Rigged mesh in NumPy, without torch: vertices, bones, weights, parts and skeleton."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.spatial import ConvexHull

from rfgen_sionna._short_repr import ShortRepr
from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.generative.motion.skeleton import JOINT, JOINT_NAMES, SIDES, Skeleton

_DENSITY = 980.0
"""Mean density of a body [kg/m^3]: anny's anthropometry."""
PART_NAMES: tuple[str, ...] = (
    "head", "torso",
    *(f"{side}_{part}" for side in SIDES for part in ("upper_arm", "forearm", "hand", "thigh", "shank", "foot")),
)  # fmt: skip


@dataclass(frozen=True, repr=False)
class Rig(ShortRepr):
    """Rigged body in its rest pose, facing +x with +y to the left and z up."""

    vertices: FloatArray
    """(vertex, 3) rest positions [m]."""
    faces: IntArray
    """(face, 3) vertex indices, counter-clockwise seen from outside."""
    weights: sparse.csr_array
    """(vertex, bone) skinning weights, rows sum to one."""
    bone_names: tuple[str, ...]
    bone_parents: tuple[int, ...]
    """-1 for the root; parents precede children."""
    heads: FloatArray
    """(bone, 3) rest position of each bone's joint [m]."""
    to_t_pose: FloatArray
    """(bone, 3, 3) rotation from the mesh's rest pose to the T-pose, the reference of skeletons and motions."""
    joint_bones: IntArray
    """(52,) bone whose head is each joint of the skeleton."""
    turn_bones: IntArray
    """(52,) bone with each joint's rotation; of a twisted limb, its last bone."""
    bone_joints: IntArray
    """(bone,) joint that each bone follows."""
    skeleton: Skeleton
    part_names: tuple[str, ...]
    face_parts: IntArray
    """(face,) index into `part_names`."""
    height: float
    """Stature [m]."""
    mass: float
    """Body mass [kg]."""
    parameters: Mapping[str, float] | None = None
    """Parameters of the body model; None if unknown."""
    fitted_from: tuple[Mapping[str, float], FloatArray] | None = None
    """Parameters of the body that a fitted one was made from, and the rest positions (22, 3) of its joints relative to
    their parents [m]; None for others."""

    @cached_property
    def ancestors(self) -> FloatArray:
        """(bone, bone) 1 if the column is the row's bone or one of its ancestors below the root."""
        chain = np.zeros((len(self.heads), len(self.heads)))
        for b, p in enumerate(self.bone_parents):
            if p >= 0:
                chain[b] = chain[p]
                chain[b, b] = 1.0
        return chain

    @cached_property
    def head_offsets(self) -> FloatArray:
        """(bone, 3) rest head relative to the parent's head [m]; the root's row is zero."""
        parents = np.maximum(self.bone_parents, 0)
        offsets = self.heads - self.heads[parents]
        offsets[0] = 0.0
        return offsets

    @cached_property
    def _skin(self) -> sparse.csr_array:
        """(vertex, 4 bone) weight times homogeneous rest vertex: skinning is one sparse product."""
        w = self.weights.tocoo()
        homogeneous = np.hstack([self.vertices, np.ones((len(self.vertices), 1))])
        data = (w.data[:, None] * homogeneous[w.row]).ravel()
        rows = np.repeat(w.row, 4)
        columns = (4 * w.col[:, None] + np.arange(4)).ravel()
        return sparse.csr_array((data, (rows, columns)), shape=(len(self.vertices), 4 * len(self.heads)))

    def bone_heads(self, rotations: FloatArray, translation: FloatArray) -> FloatArray:
        """(..., bone, 3) positions of the bone heads [m].

        Args:
            rotations: (..., bone, 3, 3) world rotations relative to the mesh's rest pose.
            translation: (..., 3) world position of the root bone's head [m].
        """
        parents = np.maximum(self.bone_parents, 0)
        steps = np.einsum("...bij,bj->...bi", rotations[..., parents, :, :], self.head_offsets)
        return np.einsum("ab,...bi->...ai", self.ancestors, steps) + translation[..., None, :]

    def skin(self, rotations: FloatArray, translation: FloatArray, rows: IntArray | None = None) -> FloatArray:
        """(vertex, 3) vertices of one pose by linear blend skinning [m].

        Args:
            rotations: (bone, 3, 3) world rotations relative to the mesh's rest pose.
            translation: (3,) world position of the root bone's head [m].
            rows: indices of the vertices; None takes all.
        """
        heads = self.bone_heads(rotations, translation)
        shift = heads - np.einsum("bij,bj->bi", rotations, self.heads)
        transforms = np.concatenate([np.swapaxes(rotations, -1, -2), shift[:, None, :]], axis=1).reshape(-1, 3)
        skin = self._skin if rows is None else self._skin[rows]
        return skin @ transforms

    @cached_property
    def outer_vertices(self) -> tuple[IntArray, IntArray]:
        """Indices of the vertices that can be the lowest of a pose, and (k,) their parts, indices of `part_names`.

        They are the corners of the convex hull of the vertices that follow each joint.
        """
        joints = self.bone_joints[np.asarray(self.weights.argmax(axis=1)).ravel()]
        part = np.zeros(len(self.vertices), np.int32)
        part[self.faces] = self.face_parts[:, None]
        used = np.zeros(len(self.vertices), bool)
        used[self.faces] = True
        corners = []
        for joint in np.unique(joints):
            own = np.flatnonzero((joints == joint) & used)
            thick = len(own) > 3 and np.linalg.matrix_rank(self.vertices[own] - self.vertices[own].mean(axis=0)) == 3
            corners.append(own[ConvexHull(self.vertices[own]).vertices] if thick else own)
        rows = np.concatenate(corners)
        return rows, part[rows]

    def heights(self, rotations: FloatArray, shift: FloatArray, rows: IntArray) -> FloatArray:
        """(k, frame) heights of the vertices `rows` (k,) in many poses [m].

        Args:
            rotations: (frame, bone, 3) upward rows of the bones' world rotations relative to the mesh's rest pose.
            shift: (frame, bone) upward translations of the bones [m].
            rows: indices of the vertices.
        """
        transforms = np.concatenate([rotations, shift[..., None]], axis=-1).reshape(len(rotations), -1)
        return np.asarray(self._skin[rows] @ transforms.T)

    def turn(self, vectors: FloatArray, rotations: FloatArray) -> FloatArray:
        """(vertex, 3) vectors of the rest pose, such as displacements of the skin, turned with the skin.

        Args:
            vectors: (vertex, 3) in the rest pose.
            rotations: (bone, 3, 3) world rotations relative to the mesh's rest pose.
        """
        turned = np.zeros_like(vectors)
        moved = np.flatnonzero(np.any(vectors != 0.0, axis=1))
        blended = (self.weights[moved] @ rotations.reshape(len(rotations), 9)).reshape(-1, 3, 3)
        turned[moved] = np.einsum("vij,vj->vi", blended, vectors[moved])
        return turned


def label_faces(faces: IntArray, weights: sparse.csr_array, bone_parts: Sequence[str]) -> IntArray:
    """(face,) index into `PART_NAMES`: the part with the largest skinning weights at the face's corners.

    Args:
        faces: (face, 3) vertex indices.
        weights: (vertex, bone) skinning weights.
        bone_parts: (bone,) name of each bone's part.
    """
    of_bone = np.array([PART_NAMES.index(part) for part in bone_parts])
    membership = sparse.csr_array(
        (np.ones(len(of_bone)), (np.arange(len(of_bone)), of_bone)), shape=(len(of_bone), len(PART_NAMES))
    )
    share = (weights @ membership).toarray()
    return np.argmax(share[faces].sum(axis=1), axis=1).astype(np.int32)


def body_mass(vertices: FloatArray, faces: IntArray) -> float:
    """Mass [kg] of a closed body of vertices (vertex, 3) [m] and faces (face, 3)."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    volume = abs(float(np.einsum("ij,ij->", a, np.cross(b, c)))) / 6.0
    return _DENSITY * volume


def trunk_vertices(faces: IntArray, face_parts: IntArray) -> IntArray:
    """Indices of the vertices of torso and thighs."""
    trunk = [PART_NAMES.index(part) for part in ("torso", "left_thigh", "right_thigh")]
    return np.unique(faces[np.isin(face_parts, trunk)])


def measured_skeleton(
    offsets: FloatArray, joints: FloatArray, soles: Sequence[FloatArray], trunk: FloatArray
) -> Skeleton:
    """Skeleton of a body in the T-pose.

    Args:
        offsets: (52, 3) joint positions relative to their parents [m].
        joints: (52, 3) joint positions from the pelvis [m].
        soles: (vertex, 3) vertices of the left and of the right foot from their ankles [m].
        trunk: (vertex, 3) vertices of torso and thighs from the pelvis [m].
    """
    floors = [float(sole[:, 2].min()) for sole in soles]
    heels = [[_heel_pivot(sole, floor), 0.0, floor] for sole, floor in zip(soles, floors, strict=True)]
    toes = [offsets[JOINT[f"{side}_foot"], 2] - floor for side, floor in zip(SIDES, floors, strict=True)]
    ankle = float(np.mean([-floor for floor in floors]))
    return Skeleton(offsets, ankle, np.array(heels), float(np.mean(toes)), _arm_slope(joints, trunk))


def _heel_pivot(sole: FloatArray, floor: float) -> float:
    """Pivot under the heel (x from the ankle [m]) of a foot with raised toes.

    A heel is round: the pivot leaves the smallest gap or dent from 0 to 20 degrees.
    """
    candidates = np.linspace(sole[:, 0].min(), 0.0, 41)
    worst = np.zeros_like(candidates)
    for angle in np.radians(np.arange(2.0, 21.0, 3.0)):
        # height of a point (x, z) over a pivot (p, floor), toes up by the angle
        lowest = float(np.min(sole[:, 0] * np.sin(angle) + (sole[:, 2] - floor) * np.cos(angle)))
        worst = np.maximum(worst, np.abs(lowest - candidates * np.sin(angle)))
    return float(candidates[np.argmin(worst)])


def _arm_slope(joints: FloatArray, trunk: FloatArray) -> float:
    """Sideways over down of a hanging arm that just clears trunk and thighs."""
    shoulder, elbow, wrist = (joints[JOINT_NAMES.index(f"left_{j}")] for j in ("shoulder", "elbow", "wrist"))
    length = float(np.linalg.norm(elbow - shoulder) + np.linalg.norm(wrist - elbow))
    down = shoulder[2] - trunk[:, 2]
    # half a forearm's thickness; the uppermost third of an arm touches every chest
    thick = 0.08 * length
    clear = (down > 0.35 * length) & (down < 1.25 * length)
    slope = (trunk[clear, 1] + thick - shoulder[1]) / down[clear]
    return float(np.clip(slope.max(), 0.05, 0.5))
