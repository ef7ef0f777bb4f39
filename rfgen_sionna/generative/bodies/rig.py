"""A rigged mesh: vertices, bones and weights in plain NumPy, so that tracing needs no torch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.generative.motion.skeleton import Skeleton


@dataclass(frozen=True)
class Rig:
    """A body at rest, in our frame (facing +x, left at +y, z up), and what its bones move.

    `to_t_pose` turns each bone from the mesh's own rest pose (arms half down) into the T-pose in which
    :class:`~rfgen_sionna.generative.motion.Skeleton` and every :class:`~rfgen_sionna.records.Motion` count.
    """

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
    """(bone, 3, 3) rotation from the mesh's rest pose to the T-pose."""
    joint_bones: IntArray
    """(52,) bone whose head is each joint of the skeleton."""
    turn_bones: IntArray
    """(52,) bone that turns as each joint does; where a limb twists along its length, the end of the twist."""
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
    """The body model's parameters, where it was made from such."""

    @cached_property
    def ancestors(self) -> FloatArray:
        """(bone, bone) 1 where the column is the row's bone or one of its ancestors below the root."""
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
        """Bone head positions.

        Args:
            rotations: (..., bone, 3, 3) world rotations relative to the mesh's rest pose.
            translation: (..., 3) world position of the root bone's head [m].

        Returns:
            (..., bone, 3) positions [m].
        """
        parents = np.maximum(self.bone_parents, 0)
        steps = np.einsum("...bij,bj->...bi", rotations[..., parents, :, :], self.head_offsets)
        return np.einsum("ab,...bi->...ai", self.ancestors, steps) + translation[..., None, :]

    def skin(self, rotations: FloatArray, translation: FloatArray, rows: IntArray | None = None) -> FloatArray:
        """(vertex, 3) linear blend skinning of one pose [m]; `rows` picks vertices.

        Args:
            rotations: (bone, 3, 3) world rotations relative to the mesh's rest pose.
            translation: (3,) world position of the root bone's head [m].
        """
        heads = self.bone_heads(rotations, translation)
        shift = heads - np.einsum("bij,bj->bi", rotations, self.heads)
        transforms = np.concatenate([np.swapaxes(rotations, -1, -2), shift[:, None, :]], axis=1).reshape(-1, 3)
        skin = self._skin if rows is None else self._skin[rows]
        return skin @ transforms
