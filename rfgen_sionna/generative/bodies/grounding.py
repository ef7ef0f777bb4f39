"""Floor contact of a motion from another body: height of the root, and planted feet held in place."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d, label, maximum_filter1d

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.bodies.body_support import body_size, carrying_height, hover, lies, lowest, part_heights
from rfgen_sionna.generative.bodies.limb_contact import rest_limbs
from rfgen_sionna.generative.bodies.rig import Rig
from rfgen_sionna.generative.motion.curves import ease
from rfgen_sionna.generative.motion.rotations import X, Z, normalised
from rfgen_sionna.generative.motion.skeleton import JOINT, PLANTED_BELOW, SIDES, forward_kinematics, from_rest, two_bone

CONTACT_HEIGHT = 0.04
"""Upper bound of a planted sole's height over the floor [m], without labels: above the noise of captured feet."""
CONTACT_SPEED = 0.5
"""Upper bound of a planted sole's speed [m/s], without contact labels: a third of walking speed."""
BLEND = 0.12
"""Time between a free and a held foot [s]: the double support of a step."""
RIDE = 0.03
"""Smoothing time of the pelvis over planted feet [s]: a few frames of captured motion."""


def sole_points(rig: Rig, joints: FloatArray, positions: FloatArray, side: str) -> FloatArray:
    """(frame, 3, 3) heel, ball and toe tip under the sole [m]; `joints` are rotations (frame, 52, 3, 3)."""
    sk, i = rig.skeleton, SIDES.index(side)
    ankle, toe = JOINT[f"{side}_ankle"], JOINT[f"{side}_foot"]
    ball = sk.offsets[toe] * [1.0, 1.0, 0.0] - [0.0, 0.0, sk.ankle_height]
    tip = np.array([0.25 * np.linalg.norm(sk.offsets[toe]), 0.0, -sk.toe_height])
    return np.stack(
        [
            positions[:, ankle] + joints[:, ankle] @ sk.heel[i],
            positions[:, ankle] + joints[:, ankle] @ ball,
            positions[:, toe] + joints[:, toe] @ tip,
        ],
        axis=1,
    )


def _positions(rig: Rig, joints: FloatArray, translation: FloatArray) -> FloatArray:
    return forward_kinematics(joints, translation, rig.skeleton.offsets, rig.skeleton.parents)


def find_contacts(soles: FloatArray, frame_rate: float) -> np.ndarray:
    """(frame, 2) planted feet: low and slow sole points (frame, 2, 3, 3), without gaps and blips of one frame."""
    low = soles[..., 2].min(axis=2) < CONTACT_HEIGHT
    speed = np.linalg.norm(np.gradient(soles, axis=0)[..., :2], axis=-1).min(axis=2) * frame_rate
    planted = low & (speed < CONTACT_SPEED)
    closed = planted.copy()
    closed[1:-1] |= planted[:-2] & planted[2:]
    alone = closed.copy()
    alone[1:-1] &= closed[:-2] | closed[2:]
    return alone


def rests_on_floor(rig: Rig, joints: FloatArray, translation: FloatArray, frame_rate: float) -> bool:
    """Whether no part is more than 2 cm under the floor, none that carries more than 3 cm over it, and nobody lies.

    Args:
        rig: the body.
        joints: (frame, 52, 3, 3) world rotations of the joints.
        translation: (frame, 3) root positions [m].
        frame_rate: [Hz].
    """
    heights = part_heights(rig, joints, translation)
    if np.min(list(heights.values())) < -0.02 or lies(rig, joints, heights).any():
        return False
    low = carrying_height(rig, joints, translation, frame_rate)
    if len(low) < 3:
        return bool(np.all(low < 0.03))
    upright = _upright(rig, joints, translation)
    return bool(np.all(np.abs(hover(low, upright, translation[:, 2], body_size(rig), frame_rate)) < 0.03))


def rest_on_floor(
    rig: Rig, joints: FloatArray, translation: FloatArray, contacts: np.ndarray | None, frame_rate: float
) -> tuple[FloatArray, FloatArray]:
    """Joint rotations (frame, 52, 3, 3) and root positions (frame, 3) [m] of a body that the floor carries.

    What carries is on the floor: feet, or knees, trunk, hands of who is not on the feet. Planted feet are still.
    Flights stay flights; who climbs, upright over the floor, stays there.

    Args:
        rig: the body.
        joints: (frame, 52, 3, 3) world rotations of the joints.
        translation: (frame, 3) root positions [m].
        contacts: (frame, 2) planted left and right foot; None finds them by height and speed.
        frame_rate: [Hz].
    """
    joints, translation = joints.copy(), translation.copy()
    low = carrying_height(rig, joints, translation, frame_rate)
    upright = _upright(rig, joints, translation)
    base = np.quantile(low[upright] if upright.any() else low, 0.15)
    translation[:, 2] -= base
    if len(translation) >= 3:
        translation[:, 2] -= hover(low - base, upright, translation[:, 2], body_size(rig), frame_rate)
        _plant_feet(rig, joints, translation, contacts, frame_rate)
    rest_limbs(rig, joints, translation, frame_rate)
    return joints, translation


def _upright(rig: Rig, joints: FloatArray, translation: FloatArray) -> np.ndarray:
    """(frame,) whether the pelvis is over a stretched leg, with the trunk up."""
    positions = _positions(rig, joints, translation)
    feet = np.min([positions[:, JOINT[f"{side}_ankle"], 2] for side in SIDES], axis=0)
    trunk = normalised(positions[:, JOINT["neck"]] - positions[:, 0])
    hanging = joints[:, [JOINT[f"{side}_hip"] for side in SIDES], 2, 2].max(axis=1) > 0.6
    return np.asarray((positions[:, 0, 2] - feet > 0.6 * rig.skeleton.leg_length()) & (trunk[:, 2] > 0.6) & hanging)


def _plant_feet(
    rig: Rig, joints: FloatArray, translation: FloatArray, contacts: np.ndarray | None, frame_rate: float
) -> None:
    """Hold planted feet still on the floor, in place; free ones stay over it."""
    positions = _positions(rig, joints, translation)
    soles = np.stack([sole_points(rig, joints, positions, side) for side in SIDES], axis=1)
    planted = find_contacts(soles, frame_rate) if contacts is None else contacts
    planted = planted & (soles[..., 2].min(axis=2) < PLANTED_BELOW)  # not in a handstand
    blend = max(1, round(BLEND * frame_rate))
    for i, side in enumerate(SIDES):
        shift = _held(soles[:, i], planted[:, i], blend)
        # free feet stay above the floor
        under = np.maximum(-(soles[:, i, :, 2].min(axis=1) + shift[:, 2]), 0.0)
        shift[:, 2] += _envelope(under, blend)
        _move_foot(rig, joints, positions, side, shift)
    heights = part_heights(rig, joints, translation)
    others = lowest(heights, ("torso", "thigh", "shank")) <= 0.02
    carried = planted & ~others[:, None]
    for _ in range(2 if carried.any() else 0):  # the second round corrects the smoothing of the first
        # a leg may be too short: the pelvis sinks until the lower of the planted feet is on the floor
        low = np.stack([_lowest_vertex(rig, joints, translation, side) for side in SIDES], axis=-1)
        rise = np.where(others, 0.0, np.where(carried, low, np.inf).min(axis=1))
        at = np.flatnonzero(np.isfinite(rise))
        rise = np.interp(np.arange(len(rise)), at, rise[at])
        translation[:, 2] -= gaussian_filter1d(rise, RIDE * frame_rate, mode="nearest")
    for side in SIDES:
        # vertices of the sole beside the three points
        under = np.maximum(-_lowest_vertex(rig, joints, translation, side) - 0.002, 0.0)
        if under.max() > 0.0:
            _move_foot(rig, joints, _positions(rig, joints, translation), side, _envelope(under, blend)[:, None] * Z)


def _envelope(under: FloatArray, blend: int) -> FloatArray:
    """(frame,) smooth lift of at least about `under` (frame,) [m], that begins and ends `blend` frames aside."""
    lift: FloatArray = gaussian_filter1d(maximum_filter1d(under, 2 * blend + 1), blend / 3.0, truncate=3.0)
    return lift


def _lowest_vertex(rig: Rig, joints: FloatArray, translation: FloatArray, side: str) -> FloatArray:
    """(frame,) height of the lowest vertex of a foot [m]."""
    foot = f"{side}_foot"
    return part_heights(rig, joints, translation, (foot,))[foot]


def _held(sole: FloatArray, planted: np.ndarray, blend: int) -> FloatArray:
    """(frame, 3) shift of a foot that holds its slowest point on the floor while planted [m]."""
    n = len(planted)
    runs, count = label(planted)
    total, weight = np.zeros((n, 3)), np.zeros(n)
    t = np.arange(n)
    for k in range(1, count + 1):
        frames = np.flatnonzero(runs == k)
        points = sole[frames]
        still = (
            int(np.argmin(np.linalg.norm(np.diff(points[..., :2], axis=0), axis=-1).sum(axis=0)))
            if len(frames) > 1
            else 1
        )
        goal = np.array([*np.mean(points[:, still, :2], axis=0), 0.0])
        fade = ease((t - (frames[0] - blend)) / blend) * ease((frames[-1] + blend - t) / blend)
        inside = np.clip(t, frames[0], frames[-1])
        total += fade[:, None] * (goal - sole[inside, still])
        weight += fade
    return total / np.maximum(weight, 1.0)[:, None]


def _move_foot(rig: Rig, joints: FloatArray, positions: FloatArray, side: str, shift: FloatArray) -> None:
    """Rotate hip and knee in place: the ankle moves by `shift` (frame, 3) [m], the foot keeps its orientation."""
    sk = rig.skeleton
    hip, knee, ankle = (JOINT[f"{side}_{j}"] for j in ("hip", "knee", "ankle"))
    target = positions[:, ankle] + shift
    # the knee keeps its direction
    forward = joints[:, hip] @ X + joints[:, knee] @ X
    _, thigh, shank = two_bone(
        positions[:, hip], target, forward, sk.length(f"{side}_knee"), sk.length(f"{side}_ankle")
    )
    joints[:, hip] = from_rest(thigh, normalised(sk.offsets[knee]), X)
    joints[:, knee] = from_rest(shank, normalised(sk.offsets[ankle]), X)
