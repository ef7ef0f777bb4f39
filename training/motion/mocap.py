"""Packs of motion capture, on the mean adult and in our frame."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.motion import JOINT_NAMES, MEAN_ADULT, PARENTS
from rfgen_sionna.generative.motion.rotations import X, normalised, to_matrices, to_quaternions, transpose
from rfgen_sionna.generative.motion.skeleton import (
    JOINT,
    NUM_BODY_JOINTS,
    SIDES,
    forward_kinematics,
    from_rest,
    global_rotations,
    two_bone,
)
from rfgen_sionna.records import Motion

_AXES = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""From the pack's axes (y up, rest pose facing +z, left at +x) to ours."""
_RADII = {
    "pelvis": 0.10, "hip": 0.08, "spine1": 0.09, "spine2": 0.10, "spine3": 0.10, "neck": 0.06, "head": 0.09,
    "collar": 0.07, "shoulder": 0.05, "elbow": 0.04, "wrist": 0.03, "knee": 0.05,
    "ankle": MEAN_ADULT.ankle_height, "foot": MEAN_ADULT.toe_height,
}  # fmt: skip
"""Distance of the skin from each joint [m]: soles of the mean adult, elsewhere of a slim one."""
_FILES = ("motions.npz", "clips.json")


@dataclass(frozen=True)
class MocapClip:
    """One captured clip."""

    name: str
    action: str
    captions: tuple[str, ...]
    licence: str
    source: str
    subject: str
    kind: str
    motion: Motion


def read_pack(folder: Path) -> list[MocapClip]:
    """All clips of the pack, at 20 Hz.

    Raises:
        FileNotFoundError: a file of the pack is missing; the message says which.
    """
    for name in _FILES:
        if not (folder / name).is_file():
            raise FileNotFoundError(f"no {name} in {folder}: the mocap folder needs {' and '.join(_FILES)}")
    records = json.loads((folder / "clips.json").read_text(encoding="utf-8"))
    with np.load(folder / "motions.npz", allow_pickle=False) as pack:
        quat, trans = pack["quat"].astype(np.float64), pack["trans"].astype(np.float64)
        offsets, parents = pack["offsets"] @ _AXES.T, tuple(int(p) for p in pack["parents"])
        rate = float(pack["fps"])
    out = []
    for record in records:
        rows = slice(record["start"], record["start"] + record["frames"])
        out.append(
            MocapClip(
                record["name"],
                record["action"],
                tuple(record["captions"]),
                record["licence"],
                record["source"],
                record["subject"],
                record["kind"],
                on_mean_adult(to_matrices(np.roll(quat[rows], -1, axis=-1)), trans[rows], offsets, parents, rate),
            )
        )
    return out


def on_mean_adult(
    local: FloatArray, translation: FloatArray, offsets: FloatArray, parents: tuple[int, ...], rate: float
) -> Motion:
    """A clip in the pack's axes, on the mean adult: ankles keep their place in proportion to the legs.

    Args:
        local: (frame, 22, 3, 3) rotations relative to the parent, y up.
        translation: (frame, 3) of the pelvis [m], y up.
        offsets: (22, 3) of the clip's own skeleton, in our axes [m].
        parents: of its joints.
        rate: poses per second [Hz].
    """
    local = _AXES @ local @ _AXES.T
    legs = sum(np.linalg.norm(offsets[JOINT[f"{s}_{j}"]]) for s in SIDES for j in ("knee", "ankle"))
    scale = 2.0 * MEAN_ADULT.leg_length() / float(legs)
    translation = translation @ _AXES.T
    world = global_rotations(local, parents)
    theirs = forward_kinematics(world, translation, offsets, parents)
    root = translation * scale
    places = forward_kinematics(world, root, MEAN_ADULT.offsets[:NUM_BODY_JOINTS], parents)
    for side in SIDES:
        hip, knee, ankle = (JOINT[f"{side}_{j}"] for j in ("hip", "knee", "ankle"))
        # hips are not in proportion: the ankle is put where the clip has it under the pelvis
        target = root + scale * (theirs[:, ankle] - theirs[:, 0])
        bend = world[:, hip] @ X
        _, thigh, shank = two_bone(
            places[:, hip], target, bend, MEAN_ADULT.length(f"{side}_knee"), MEAN_ADULT.length(f"{side}_ankle")
        )
        world[:, hip] = from_rest(thigh, normalised(MEAN_ADULT.offsets[knee]), X)
        world[:, knee] = from_rest(shank, normalised(MEAN_ADULT.offsets[ankle]), X)
    for j in range(1, NUM_BODY_JOINTS):
        local[:, j] = transpose(world[:, parents[j]]) @ world[:, j]
    places = forward_kinematics(world, root, MEAN_ADULT.offsets[:NUM_BODY_JOINTS], parents)
    root[:, 2] -= np.percentile(_clearance(places), 5.0)
    places = forward_kinematics(world, root, MEAN_ADULT.offsets[:NUM_BODY_JOINTS], parents)
    return Motion(
        rotations=to_quaternions(local),
        translation=root,
        frame_rate=rate,
        joint_names=JOINT_NAMES[:NUM_BODY_JOINTS],
        parents=PARENTS[:NUM_BODY_JOINTS],
        offsets=MEAN_ADULT.offsets[:NUM_BODY_JOINTS],
        contacts=find_contacts(places, rate),
    )


def _clearance(places: FloatArray) -> FloatArray:
    """(frame,) height of the lowest part of the body over the floor [m], which a person who lies or crawls has not at
    the feet."""
    radii = np.array(
        [_RADII[name.removeprefix("left_").removeprefix("right_")] for name in JOINT_NAMES[:NUM_BODY_JOINTS]]
    )
    return np.asarray((places[..., 2] - radii).min(axis=1))


def find_contacts(places: FloatArray, rate: float, height: float = 0.05, speed: float = 0.35) -> np.ndarray:
    """(frame, 2) whether the left and right foot is planted: toe or ankle low, and slow in the plane.

    Args:
        places: (frame, 22, 3) joint positions [m].
        rate: poses per second [Hz].
        height: over the resting height of the joint [m].
        speed: [m/s].
    """
    out = np.zeros((len(places), 2), bool)
    for i, side in enumerate(SIDES):
        for joint, rest in (("foot", MEAN_ADULT.toe_height), ("ankle", MEAN_ADULT.ankle_height)):
            p = places[:, JOINT[f"{side}_{joint}"]]
            v = np.linalg.norm(np.gradient(p, axis=0)[:, :2], axis=-1) * rate if len(p) > 1 else np.zeros(len(p))
            out[:, i] |= (p[:, 2] < rest + height) & (v < speed)
    return out
