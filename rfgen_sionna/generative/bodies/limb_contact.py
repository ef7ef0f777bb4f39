"""Limbs and head on the floor: they give way to it; hands that support, and limbs of who lies, rest on it."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import binary_opening, gaussian_filter1d, maximum_filter1d

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.bodies.body_support import PALM, body_size, lies, lowest, part_heights
from rfgen_sionna.generative.bodies.rig import Rig
from rfgen_sionna.generative.motion.curves import ease
from rfgen_sionna.generative.motion.rotations import X, Y, Z, about, normalised, transpose
from rfgen_sionna.generative.motion.skeleton import FINGERS, JOINT, SIDES, forward_kinematics, side_sign, two_bone

_SETTLE = 0.12
"""Time over which a limb is lifted and lowered [s]."""
_NEAR = 0.08
"""Height under which a hand that is still supports [m]."""
_STILL = 0.3
"""Speed under which a hand is still [m/s]."""


def rest_limbs(rig: Rig, joints: FloatArray, translation: FloatArray, frame_rate: float) -> None:
    """Turn arms, hands, neck and trunk of a body on the floor, in place, so that none is under it.

    Args:
        rig: the body.
        joints: (frame, 52, 3, 3) world rotations of the joints, changed in place.
        translation: (frame, 3) root positions [m], changed in place.
        frame_rate: [Hz].
    """
    width = max(1.0, _SETTLE * frame_rate)
    heights = part_heights(rig, joints, translation)
    lying = lies(rig, joints, heights)
    if lying.any():
        _let_down(rig, joints, translation, heights, lying, frame_rate)
        heights = part_heights(rig, joints, translation)
    for side in SIDES:
        arm = ("upper_arm", "forearm", "hand")
        if lowest(heights, [f"{side}_{part}" for part in arm]).min() < _NEAR:
            _rest_arm(rig, joints, translation, side, heights, width, frame_rate)
    under = _lift(-heights["head"], width)
    if under.any():
        _raise_head(rig, joints, under)
    low = np.min(list(part_heights(rig, joints, translation).values()), axis=0)
    translation[:, 2] += _lift(-low - 0.01, width)


def _let_down(
    rig: Rig,
    joints: FloatArray,
    translation: FloatArray,
    heights: dict[str, FloatArray],
    lying: np.ndarray,
    frame_rate: float,
) -> None:
    """Let still limbs and the head of who lies down to the floor, in place: a little over it, beside the trunk."""
    size, places = body_size(rig), _places(rig, joints, translation)
    trunk = places[:, JOINT["neck"], :2] - places[:, 0, :2]
    along = trunk / np.maximum(np.linalg.norm(trunk, axis=1), 1e-6)[:, None]

    def drop(joint: str, height: FloatArray, highest: float, aside: float) -> FloatArray:
        at = places[:, JOINT[joint]]
        still = np.linalg.norm(np.gradient(at, axis=0), axis=1) * frame_rate < _STILL
        away = at[:, :2] - places[:, 0, :2]
        ahead = np.sum(away * along, axis=1)
        beyond = (ahead < 0.0) | (ahead > 1.2 * np.linalg.norm(trunk, axis=1))
        beside = beyond | (np.linalg.norm(away - ahead[:, None] * along, axis=1) > aside * size)
        rests = lying & still & beside & (height < highest * size)
        rests = binary_opening(rests, np.ones(max(1, round(0.3 * frame_rate))))
        smooth = gaussian_filter1d(np.where(rests, np.maximum(height, 0.0), 0.0), 0.1 * frame_rate, mode="nearest")
        return np.where(rests.any(), smooth, 0.0)

    for side in SIDES:
        hand = np.minimum(heights[f"{side}_hand"], heights[f"{side}_forearm"])
        foot = np.minimum(heights[f"{side}_foot"], heights[f"{side}_shank"])
        for chain, low, aside in (("shoulder elbow wrist", hand, 0.24), ("hip knee ankle", foot, 0.0)):
            names = [f"{side}_{joint}" for joint in chain.split()]
            shift = drop(names[-1], low, 0.2, aside)
            if shift.any():
                _move_end(rig, joints, places, names, -shift)
    nod = drop("head", heights["head"], 0.2, 0.0)
    if nod.any():
        _raise_head(rig, joints, -np.minimum(nod, 0.06 * size))


def _lift(under: FloatArray, width: float) -> FloatArray:
    """(frame,) smooth upper envelope of `under` (frame,) where it is positive [m]."""
    under = np.maximum(under, 0.0)
    reach = max(1, round(width))
    lift: FloatArray = gaussian_filter1d(
        maximum_filter1d(under, 2 * reach + 1, mode="nearest"), width / 2.0, mode="nearest", radius=reach
    )
    return lift


def _rest_arm(
    rig: Rig,
    joints: FloatArray,
    translation: FloatArray,
    side: str,
    heights: dict[str, FloatArray],
    width: float,
    frame_rate: float,
) -> None:
    wrist, name, arm = JOINT[f"{side}_wrist"], f"{side}_hand", (f"{side}_upper_arm", f"{side}_forearm")
    palm = PALM * body_size(rig)
    places = _places(rig, joints, translation)
    hand, forearm = heights[name], heights[f"{side}_forearm"]
    still = np.linalg.norm(np.gradient(places[:, wrist], axis=0), axis=1) * frame_rate < _STILL
    supports = still & (forearm < palm + _NEAR) & (hand < _NEAR)
    # a hand flat on the floor has its wrist a palm's height over it
    goal = np.where(supports & (hand < palm), palm, 0.0)
    shift = _lift(goal - forearm, width)
    hovering = np.where(supports, np.maximum(np.minimum(hand, forearm - palm), 0.0), 0.0)
    shift -= gaussian_filter1d(hovering, width / 2.0, mode="nearest")
    if shift.any():
        _move_end(rig, joints, places, [f"{side}_{joint}" for joint in ("shoulder", "elbow", "wrist")], shift)
    for _ in range(2):
        heights = part_heights(rig, joints, translation, arm)
        under = _lift(-np.min(list(heights.values()), axis=0), width)
        if under.any():
            _raise_elbow(rig, joints, _places(rig, joints, translation), side, under)
    for _ in range(2):
        under = _lift(-part_heights(rig, joints, translation, (name,))[name], width)
        if under.any():
            _bend_wrist(rig, joints, side, under)


def _places(rig: Rig, joints: FloatArray, translation: FloatArray) -> FloatArray:
    return forward_kinematics(joints, translation, rig.skeleton.offsets, rig.skeleton.parents)


def _move_end(rig: Rig, joints: FloatArray, places: FloatArray, names: list[str], shift: FloatArray) -> None:
    """Raise the end of a limb, of joints `names`, by `shift` (frame,) [m]; hand or foot keeps its orientation."""
    first, middle, end = (JOINT[name] for name in names)
    lengths = rig.skeleton.length(names[1]), rig.skeleton.length(names[2])
    pole = (joints[:, first] + joints[:, middle]) @ (X if names[0].endswith("hip") else -X)
    # relative to the solution without a shift, so that none turns nothing
    _, *before = two_bone(places[:, first], places[:, end], pole, *lengths)
    _, *after = two_bone(places[:, first], places[:, end] + shift[:, None] * Z, pole, *lengths)
    for joint, old, new in zip((first, middle), before, after, strict=True):
        joints[:, joint] = new @ transpose(old) @ joints[:, joint]


def _raise_elbow(rig: Rig, joints: FloatArray, places: FloatArray, side: str, lift: FloatArray) -> None:
    """Turn the arm about the line from shoulder to wrist, outwards, so that the elbow rises by about `lift` [m]."""
    shoulder, elbow, wrist = (JOINT[f"{side}_{j}"] for j in ("shoulder", "elbow", "wrist"))
    axis = normalised(places[:, wrist] - places[:, shoulder])
    arm = places[:, elbow] - places[:, shoulder]
    aside = arm - np.sum(arm * axis, axis=1, keepdims=True) * axis
    out = Z + 0.7 * side_sign(side) * joints[:, JOINT["spine3"]] @ Y
    out -= np.sum(out * axis, axis=1, keepdims=True) * axis
    turned = normalised(aside + (lift / np.maximum(out[:, 2], 0.2))[:, None] * out)
    # a straight arm has no elbow to turn
    radius = np.linalg.norm(aside, axis=1)
    cosine = np.sum(turned * aside, axis=1) / np.maximum(radius, 1e-9)
    sine = np.sum(np.cross(aside, turned) * axis, axis=1) / np.maximum(radius, 1e-9)
    rotation = about(axis, np.arctan2(sine, cosine) * ease(radius / 0.04))
    for joint in (shoulder, elbow):
        joints[:, joint] = rotation @ joints[:, joint]


def _bend_wrist(rig: Rig, joints: FloatArray, side: str, under: FloatArray) -> None:
    """Bend a hand upwards in the wrist until its lowest point is higher by `under` (frame,) [m]."""
    wrist, middle = JOINT[f"{side}_wrist"], rig.skeleton.offsets[JOINT[f"{side}_middle1"]]
    hand = [wrist, *(JOINT[f"{side}_{finger}{k}"] for finger in FINGERS for k in (1, 2, 3))]
    along = joints[:, wrist] @ normalised(middle)
    # a hand that hangs bends towards its back
    _raise(joints, hand, along, along + joints[:, wrist] @ Z, under / (1.6 * np.linalg.norm(middle)))


def _raise_head(rig: Rig, joints: FloatArray, under: FloatArray) -> None:
    """Bend the neck so that the head rises by `under` (frame,) [m], or sinks."""
    along = joints[:, JOINT["neck"]] @ normalised(rig.skeleton.offsets[JOINT["head"]])
    _raise(joints, [JOINT["neck"], JOINT["head"]], along, along, under / (2.0 * rig.skeleton.length("head")))


def _raise(joints: FloatArray, moved: list[int], along: FloatArray, towards: FloatArray, lift: FloatArray) -> None:
    """Turn the joints `moved` together in the upright plane of `towards` (frame, 3): unit vectors `along` (frame, 3)
    rise by `lift` (frame,)."""
    ahead = towards[:, :2] / np.maximum(np.linalg.norm(towards[:, :2], axis=1), 1e-6)[:, None]
    level = np.sum(along[:, :2] * ahead, axis=1)
    reach = np.maximum(np.hypot(level, along[:, 2]), 1e-6)
    angle = np.arcsin(np.clip((along[:, 2] + lift) / reach, -1.0, 1.0)) - np.arctan2(along[:, 2], level)
    axis = np.stack([ahead[:, 1], -ahead[:, 0], np.zeros(len(along))], axis=-1)
    rotation = about(axis, np.where(lift != 0.0, angle, 0.0))
    for joint in moved:
        joints[:, joint] = rotation @ joints[:, joint]
