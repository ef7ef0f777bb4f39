"""What carries a body on the floor z = 0: heights of its parts, and of the body while it is not in flight."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from scipy.linalg import solveh_banded
from scipy.ndimage import gaussian_filter1d, grey_opening, label, maximum_filter1d

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.bodies.retarget import bone_rotations
from rfgen_sionna.generative.bodies.rig import Rig
from rfgen_sionna.generative.motion.balance import centre_of_mass
from rfgen_sionna.generative.motion.curves import ease
from rfgen_sionna.generative.motion.jumps import GRAVITY
from rfgen_sionna.generative.motion.skeleton import JOINT, SIDES, forward_kinematics

PALM = 0.03
"""Height of the underside of a wrist over the floor when the palm is on it [m], for a stature of 1.7 m."""
LONGEST_FLIGHT = 1.2
"""Time after which a body over the floor hovers [s]: a jump of 1.7 m."""
_BELOW, _ABOVE = 0.008, 0.012
"""How far a body may be under and over the floor that carries it [m]; smoothing needs some play."""
_SETTLING = 0.12
"""Smoothing time of the correction of heights [s]."""


def part_heights(
    rig: Rig, joints: FloatArray, translation: FloatArray, parts: Sequence[str] = ()
) -> dict[str, FloatArray]:
    """(frame,) height of the lowest vertex of each part over z = 0 [m].

    Args:
        rig: the body.
        joints: (frame, 52, 3, 3) world rotations of the joints relative to the T-pose.
        translation: (frame, 3) root positions [m].
        parts: of the rig; empty for all.
    """
    rotations = bone_rotations(rig, joints)
    shift = rig.bone_heads(rotations, translation) - np.einsum("fbij,bj->fbi", rotations, rig.heads)
    names = parts or rig.part_names
    rows, of_part = rig.outer_vertices
    wanted = np.isin(of_part, [rig.part_names.index(name) for name in names])
    heights, of_part = rig.heights(rotations[:, :, 2], shift[:, :, 2], rows[wanted]), of_part[wanted]
    return {name: heights[of_part == rig.part_names.index(name)].min(axis=0) for name in names}


def body_size(rig: Rig) -> float:
    """Stature over that of a mean adult."""
    return rig.height / 1.7


def lowest(heights: dict[str, FloatArray], parts: Iterable[str]) -> FloatArray:
    """(frame,) height of the lowest vertex of `parts`, "torso" or "foot" for both feet [m]."""
    wanted = tuple(parts)
    return np.asarray(np.min([h for name, h in heights.items() if name.endswith(wanted)], axis=0))


def carrying_height(rig: Rig, joints: FloatArray, translation: FloatArray, frame_rate: float) -> FloatArray:
    """(frame,) height of the parts that carry the body [m].

    Trunk and thighs carry before feet and head that are a little lower, and where the others are not under the centre
    of mass; arms carry who is upside down, or has nothing else near them. Other feet, heads and hands give way.

    Args:
        rig: the body.
        joints: (frame, 52, 3, 3) world rotations of the joints.
        translation: (frame, 3) root positions [m].
        frame_rate: [Hz].
    """
    heights = part_heights(rig, joints, translation)
    size = body_size(rig)
    trunk = joints[:, JOINT["spine1"], 2, 2]
    level = ease((0.77 - trunk) / 0.35)
    core = lowest(heights, ("torso", "thigh"))
    ends = lowest(heights, ("shank", "foot", "head"))
    # toes under an upright foot carry; a foot on its instep gives way
    instep = ease((-joints[:, [JOINT["left_ankle"], JOINT["right_ankle"]], 2, 2].max(axis=1) - 0.1) / 0.4)
    low = _give_way(core, ends, size * (0.02 + 0.04 * level * instep), size * (0.03 + 0.02 * level * instep))
    low += _unsupported(rig, joints, translation, low, core, frame_rate) * np.maximum(core - low, 0.0)
    wrists = lowest(heights, ("forearm",)) - PALM * size
    inverted = ease((-0.05 - trunk) / 0.25)
    return _give_way(low, wrists, size * (0.25 - 0.19 * inverted), size * (0.2 - 0.1 * inverted))


def _unsupported(
    rig: Rig, joints: FloatArray, translation: FloatArray, low: FloatArray, core: FloatArray, frame_rate: float
) -> FloatArray:
    """(frame,) 0 .. 1: for 1 s or more, the trunk is still near the floor, its mass beside the limbs that are down."""
    size = body_size(rig)
    places = forward_kinematics(joints, translation, rig.skeleton.offsets, rig.skeleton.parents)
    limbs = places[:, [JOINT[f"{side}_{joint}"] for side in SIDES for joint in ("ankle", "foot", "knee", "wrist")]]
    down = limbs[..., 2] < (low + 0.12 * size)[:, None]
    angles = np.arange(8) * np.pi / 4.0
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    reach = np.where(down[..., None], limbs[..., :2] @ directions.T, -np.inf).max(axis=1)
    beside = (centre_of_mass(places)[:, :2] @ directions.T - reach).max(axis=1) / size
    speed = (
        np.abs(np.gradient(gaussian_filter1d(core, 0.05 * frame_rate))) * frame_rate if len(core) > 1 else 0.0 * core
    )
    near = ease((0.28 * size - (core - low)) / (0.05 * size))
    found = near * ease((beside - 0.06) / 0.08) * ease((0.5 - speed / size) / 0.3)
    lasting = grey_opening(found, max(1, round(frame_rate)), mode="nearest")
    return np.asarray(gaussian_filter1d(lasting, 0.15 * frame_rate, mode="nearest"))


def lies(rig: Rig, joints: FloatArray, heights: dict[str, FloatArray]) -> np.ndarray:
    """(frame,) whether the trunk is level and on the floor.

    Args:
        rig: the body.
        joints: (frame, 52, 3, 3) world rotations of the joints.
        heights: (frame,) of each part, as :func:`part_heights` gives them [m].
    """
    level = np.abs(joints[:, [JOINT["spine1"], JOINT["spine3"]], 2, 2]).max(axis=1) < 0.4
    return np.asarray(level & (heights["torso"] < 0.06 * body_size(rig)))


def _give_way(carrier: FloatArray, end: FloatArray, play: FloatArray | float, fade: FloatArray | float) -> FloatArray:
    """(frame,) the lower of two heights; an end up to `play` under the carrier does not count, a lower one does."""
    under = np.maximum(carrier - end, 0.0)
    return carrier - ease((under - play) / fade) * under


def hover(low: FloatArray, upright: np.ndarray, root: FloatArray, size: float, frame_rate: float) -> FloatArray:
    """(frame,) height of a body over the floor while it is not in flight, smooth in time [m].

    Args:
        low: (frame,) height of the parts that carry [m].
        upright: (frame,) whether the body is on stretched legs: it may be on something.
        root: (frame,) height of the root [m].
        size: stature over that of a mean adult.
        frame_rate: [Hz].
    """
    smooth = gaussian_filter1d(root, 0.03 * frame_rate, mode="nearest")
    falling = np.gradient(np.gradient(smooth)) * frame_rate**2 < -0.45 * GRAVITY
    flying = (low > 0.02 * size) & falling
    raised, count = label(low > 0.08 * size)
    for k in range(1, count + 1):
        frames = raised == k
        leaps = frames.sum() < LONGEST_FLIGHT * frame_rate and bool(falling[frames].any())
        if leaps or upright[frames].mean() > 0.6:
            flying |= frames
    flying = maximum_filter1d(flying, 3)
    if flying.all():
        return np.zeros_like(low)
    # the first and the last support count beyond
    first, last = np.flatnonzero(~flying)[[0, -1]]
    low = low[np.clip(np.arange(len(low)), first, last)]
    weight = np.where(flying, 0.0, 1.0)
    weight[:first] = weight[last + 1 :] = 1.0
    for _ in range(12):
        curve = _smoothed(low, weight, _SETTLING * frame_rate)
        over = low - curve
        outside = ~flying & ((over < -_BELOW) | (over > _ABOVE))
        if not outside.any():
            break
        weight[outside] *= 3.0
    return curve


def _smoothed(values: FloatArray, weight: FloatArray, time: float) -> FloatArray:
    """(frame,) curve near `values` by `weight` with small second differences over `time` [frames]; Whittaker 1922."""
    n, stiff = len(values), max(time, 0.5) ** 4
    bands = np.zeros((3, n))
    bands[2] = weight
    bands[2, 2:] += stiff
    bands[2, 1:-1] += 4.0 * stiff
    bands[2, :-2] += stiff
    bands[1, 2:] -= 2.0 * stiff
    bands[1, 1:-1] -= 2.0 * stiff
    bands[0, 2:] += stiff
    bands[2] += 1e-9 * stiff
    curve: FloatArray = solveh_banded(bands, weight * values)
    return curve
