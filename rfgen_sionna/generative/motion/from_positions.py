"""Joint rotations from joint positions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.ndimage import gaussian_filter1d

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.motion.rotations import X, between, normalised, perpendicular, to_quaternions, transpose
from rfgen_sionna.generative.motion.skeleton import (
    JOINT,
    JOINT_NAMES,
    MEAN_ADULT,
    NUM_BODY_JOINTS,
    PARENTS,
    SIDES,
    side_sign,
)
from rfgen_sionna.records import Motion

_AXES = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""From y up, facing z, left at +x to the package's frame."""

_BENT = np.radians(20.0)
"""Flexion from which a limb's plane of bending gets full weight [rad]; bounds the effect of position noise."""


def motion_from_positions(positions: FloatArray, frame_rate: float, *, action: str = "") -> Motion:
    """A motion on the mean adult whose joints follow positions.

    Bones take their directions from the positions; hips and shoulders turn so that knees and elbows bend in their
    plane. Unobservable angles (twist of a straight limb, forearms, fingers) stay at rest.

    Args:
        positions: (frame, 22, 3) SMPL's body joints [m], z up, floor at z = 0.
        frame_rate: poses per second [Hz].
        action: label.

    Raises:
        ValueError: wrong shape, no frames, values that are not finite, or a frame rate that is not positive.
    """
    p = np.asarray(positions, np.float64)
    if p.ndim != 3 or p.shape[1:] != (NUM_BODY_JOINTS, 3) or not len(p):
        raise ValueError(f"positions: shape {p.shape}; allowed is (frames, {NUM_BODY_JOINTS}, 3)")
    if not np.isfinite(p).all():
        raise ValueError("positions: values are not finite; remove those frames")
    if not (np.isfinite(frame_rate) and frame_rate > 0.0):
        raise ValueError(f"frame_rate: {frame_rate!r} Hz; allowed is more than 0")
    world = np.empty((len(p), NUM_BODY_JOINTS, 3, 3))
    rest = MEAN_ADULT.offsets

    def bones(joint: str, *children: str) -> tuple[FloatArray, FloatArray]:
        theirs = np.stack([p[:, JOINT[c]] - p[:, JOINT[joint]] for c in children], axis=1)
        # zero-length bones at rest (spine1) take +x
        ours = np.stack([rest[JOINT[c]] + 1e-9 * X for c in children])
        return normalised(theirs), normalised(ours)

    world[:, 0] = _fitted(*bones_of_pelvis(p, rest))
    for name, child in (("spine1", "spine2"), ("spine2", "spine3")):
        d, u = bones(name, child)
        world[:, JOINT[name]] = _swung(world[:, PARENTS[JOINT[name]]], u[0], d[:, 0])
    chest = JOINT["spine3"]
    world[:, chest] = _fitted(*bones("spine3", "neck", "left_collar", "right_collar"))
    d, u = bones("neck", "head")
    world[:, JOINT["neck"]] = _swung(world[:, chest], u[0], d[:, 0])
    world[:, JOINT["head"]] = world[:, JOINT["neck"]]
    for side in SIDES:
        s = side_sign(side)
        for chain, bend in ((("hip", "knee", "ankle", "foot"), X), (("collar", "shoulder", "elbow", "wrist"), -X)):
            a, b, c, e = (JOINT[f"{side}_{name}"] for name in chain)
            if chain[0] == "collar":
                d, u = bones(f"{side}_collar", f"{side}_shoulder")
                world[:, a] = _swung(world[:, chest], u[0], d[:, 0])
                _limb(world, p, (PARENTS[a], a), (b, c, e), bend, rest)
                world[:, e] = world[:, c]
            else:
                _limb(world, p, (PARENTS[a], PARENTS[a]), (a, b, c), bend, rest)
                d, u = bones(f"{side}_ankle", f"{side}_foot")
                world[:, c] = _foot(world[:, b], u[0], d[:, 0], s)
                world[:, e] = world[:, c]
    local = world.copy()
    for j in range(1, NUM_BODY_JOINTS):
        local[:, j] = transpose(world[:, PARENTS[j]]) @ world[:, j]
    legs = [np.linalg.norm(p[:, JOINT[f"{s}_{b}"]] - p[:, JOINT[f"{s}_{a}"]], axis=-1)
            for s in SIDES for a, b in (("hip", "knee"), ("knee", "ankle"))]  # fmt: skip
    scale = 2.0 * MEAN_ADULT.leg_length() / float(np.sum([np.median(length) for length in legs]))
    # the pelvis joint of other skeletons lies elsewhere between the hips
    hips = 0.5 * (p[:, JOINT["left_hip"]] + p[:, JOINT["right_hip"]])
    middle = 0.5 * (rest[JOINT["left_hip"]] + rest[JOINT["right_hip"]])
    return Motion(
        rotations=to_quaternions(local),
        translation=hips * scale - world[:, 0] @ middle,
        frame_rate=float(frame_rate),
        joint_names=JOINT_NAMES[:NUM_BODY_JOINTS],
        parents=PARENTS[:NUM_BODY_JOINTS],
        offsets=rest[:NUM_BODY_JOINTS],
        action=action,
    )


def bones_of_pelvis(p: FloatArray, rest: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(frame, 2, 3) and (2, 3) unit vectors from hip to hip and up the spine, in the poses and at rest."""
    hips = p[:, JOINT["left_hip"]] - p[:, JOINT["right_hip"]]
    spine = p[:, JOINT["spine2"]] - 0.5 * (p[:, JOINT["left_hip"]] + p[:, JOINT["right_hip"]])
    hip, spine2 = rest[JOINT["left_hip"]], rest[JOINT["spine1"]] + rest[JOINT["spine2"]]
    other = rest[JOINT["right_hip"]]
    theirs = np.stack([normalised(hips), normalised(spine)], axis=1)
    return theirs, normalised(np.stack([hip - other, spine2 - 0.5 * (hip + other)]))


def _fitted(directions: FloatArray, rest: FloatArray) -> FloatArray:
    """(n, 3, 3) rotations that fit (k, 3) unit vectors to (n, k, 3) by least squares (Kabsch 1976)."""
    u, _, vt = np.linalg.svd(np.einsum("nki,kj->nij", directions, rest))
    sign = np.sign(np.linalg.det(u @ vt))
    u[:, :, 2] *= sign[:, None]
    return u @ vt


def _swung(parent: FloatArray, rest: FloatArray, direction: FloatArray) -> FloatArray:
    """(n, 3, 3) parent's rotation, turned by the smallest angle so that its bone `rest` points along `direction`."""
    return between(parent @ rest, direction) @ parent


def _limb(
    world: FloatArray,
    p: FloatArray,
    parents: tuple[int, int],
    joints: tuple[int, int, int],
    bend: FloatArray,
    rest: FloatArray,
) -> None:
    """Write the rotations of a limb's two bones between `joints` into `world` (n, 22, 3, 3); `parents` are the joint
    whose rotation the swing starts from (trunk) and the bone's parent, `bend` (3,) the bend direction at rest."""
    a, b, c = joints
    first, second = normalised(p[:, b] - p[:, a]), normalised(p[:, c] - p[:, b])
    calm = _swung(world[:, parents[1]], normalised(rest[b]), first)
    usual = calm @ bend
    seen = first - second
    flexion = np.arccos(np.clip(np.sum(first * second, axis=-1), -1.0, 1.0))
    weight = np.clip(flexion / _BENT, 0.0, 1.0)[:, None]
    # position noise would spin a straight limb: average the bend direction over time, weighted by flexion
    side = weight * seen / np.maximum(np.linalg.norm(seen, axis=-1, keepdims=True), 1e-9) + (1.0 - weight) * usual
    side = gaussian_filter1d(side, 1.0, axis=0, mode="nearest") if len(side) > 3 else side
    for joint, child, direction in ((a, b, first), (b, c, second)):
        m0 = perpendicular(bend, normalised(rest[child]))
        m = perpendicular(side + 1e-6 * usual, direction)
        u0 = normalised(rest[child])
        world[:, joint] = _frames(direction, m) @ _frames(u0[None], m0[None]).transpose(0, 2, 1)


def _frames(u: FloatArray, m: FloatArray) -> FloatArray:
    return np.stack([u, m, np.cross(u, m)], axis=-1)


def _foot(shank: FloatArray, rest: FloatArray, direction: FloatArray, side: int) -> FloatArray:
    """(n, 3, 3) rotation of a foot along `direction` without roll against the shank."""
    across = shank @ np.array([0.0, float(side), 0.0])
    m0 = perpendicular(np.array([0.0, float(side), 0.0]), rest)
    return _frames(direction, perpendicular(across, direction)) @ _frames(rest[None], m0[None]).transpose(0, 2, 1)


def from_y_up(positions: FloatArray, frame_rate: float, action: str = "", prompt: str = "") -> Motion:
    """A motion from (frame, 22, 3) positions [m], y up: it starts over the origin facing +x, on the floor."""
    p = np.asarray(positions, np.float64) @ _AXES.T
    across = p[0, JOINT["left_hip"]] - p[0, JOINT["right_hip"]]
    yaw = np.arctan2(-across[0], across[1])
    c, s = np.cos(yaw), np.sin(yaw)
    p = (p - [*p[0, 0, :2], 0.0]) @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]).T
    p[..., 2] -= np.percentile(p[..., 2].min(axis=1), 5.0)
    return replace(motion_from_positions(p, frame_rate, action=action), prompt=prompt)
