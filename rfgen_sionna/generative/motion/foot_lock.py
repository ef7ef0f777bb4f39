"""Planted feet without sliding: the legs follow by inverse kinematics."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.motion.resampling import runs
from rfgen_sionna.generative.motion.rotations import X, normalised, to_matrices, to_quaternions, transpose
from rfgen_sionna.generative.motion.skeleton import (
    JOINT,
    MEAN_ADULT,
    PLANTED_BELOW,
    SIDES,
    Skeleton,
    forward_kinematics,
    global_rotations,
    two_bone,
)
from rfgen_sionna.records import Motion

_SHORTEST = 0.07
"""Duration below which a plant counts as noise [s]."""
_ROLLING = 0.012
"""Height of the toes over the heel while the foot rolls on its heel [m]; above the noise of flat feet."""
_RIDE = 0.06
"""Width of the smoothing of the pelvis' height [s]."""
_BENT = 0.08
"""Distance of the knee from the line from hip to ankle from which it gives the direction of the bend [m]."""
_STRAIGHT = 0.992
"""Share of the leg's length to which it is stretched for a foot's place; the knee pops in straighter ones."""
_CLEAR = 0.018
"""Clearance of a swinging foot at mid-swing [m]."""
_RELEASE = 0.1
"""Half the time of a step of a planted foot that drifts [s]."""
_STEP = 0.04
"""Height of that step [m]."""
_FURTHEST = 0.12
"""Largest shift of a planted foot [m]; a longer drift is split."""


def lock_feet(motion: Motion, skeleton: Skeleton = MEAN_ADULT) -> Motion:
    """The motion with planted toes held still and no foot below the floor; the pelvis moves vertically to put the lower
    planted foot on it.

    Args:
        motion: on `skeleton`, with contacts; without them only the floor is kept.
        skeleton: lengths of the legs.
    """
    world = global_rotations(to_matrices(motion.rotations), motion.parents)
    root = motion.translation.copy()
    places = forward_kinematics(world, root, motion.offsets, motion.parents)
    low = np.stack([_clearance(places, world, skeleton, side) for side in SIDES], axis=-1)
    # high feet are not planted (handstand)
    contacts = None if motion.contacts is None else motion.contacts & (low < PLANTED_BELOW)
    if contacts is not None and contacts.any():
        planted = np.where(contacts, low, np.inf).min(axis=-1)
        at = np.flatnonzero(np.isfinite(planted))
        rise = np.interp(np.arange(len(planted)), at, planted[at])
        rise = gaussian_filter1d(rise, _RIDE * motion.frame_rate, mode="nearest")
        root[:, 2] -= rise
        places[..., 2] -= rise[:, None]
        low -= rise[:, None]
    for i, side in enumerate(SIDES):
        hip, knee, ankle, toe = (JOINT[f"{side}_{j}"] for j in ("hip", "knee", "ankle", "foot"))
        shift = np.zeros((len(places), 3))
        least = np.zeros(len(places))
        if contacts is not None:
            heel = places[:, ankle] + world[:, ankle] @ skeleton.heel[i]
            rolling = places[:, toe, 2] - skeleton.toe_height > heel[:, 2] + _ROLLING
            held, offset, stepping = _hold(places[:, toe], heel, rolling, contacts[:, i], motion.frame_rate)
            contacts[:, i] &= ~stepping
            offset[held, 2] = -low[held, i]
            shift = _between(held, offset)
            least = _swing_height(~contacts[:, i], motion.frame_rate)
            least = np.maximum(least, _STEP / _CLEAR * _swing_height(stepping, motion.frame_rate))
        shift[:, 2] = np.maximum(shift[:, 2], least - low[:, i])
        lengths = skeleton.length(f"{side}_knee"), skeleton.length(f"{side}_ankle")
        start, end = places[:, hip], places[:, ankle]
        pole = pole_direction(places[:, knee] - start, end - start, world[:, hip] @ X)
        # relative to the solution without shift, so that a zero shift turns nothing
        _, *before = two_bone(start, end, pole, *lengths)
        target = within_reach(start, end, end + shift, sum(lengths))
        _, *after = two_bone(start, target, pole, *lengths)
        for joint, old, new in zip((hip, knee), before, after, strict=True):
            world[:, joint] = new @ transpose(old) @ world[:, joint]
    local = world.copy()
    for j, p in enumerate(motion.parents):
        if p >= 0:
            local[:, j] = transpose(world[:, p]) @ world[:, j]
    return replace(motion, rotations=to_quaternions(local), translation=root, contacts=contacts)


def within_reach(start: FloatArray, end: FloatArray, target: FloatArray, longest: float) -> FloatArray:
    """(frame, 3) targets of an ankle that stretch the leg further than it is only softly, up to nearly straight."""
    own, wanted = np.linalg.norm(end - start, axis=-1), np.linalg.norm(target - start, axis=-1)
    room = np.maximum(_STRAIGHT * longest - own, 1e-3)
    more = np.maximum(wanted - own, 0.0)
    reached = np.where(more > 0.0, own + room * np.tanh(more / room), wanted)
    return start + (target - start) * (reached / np.maximum(wanted, 1e-9))[:, None]


def pole_direction(thigh: FloatArray, leg: FloatArray, ahead: FloatArray) -> FloatArray:
    """(frame, 3) direction in which the knee is off the line from hip to ankle; that of `ahead` for a straight leg."""
    u = normalised(leg)
    off = thigh - np.sum(thigh * u, axis=-1, keepdims=True) * u
    size = np.linalg.norm(off, axis=-1, keepdims=True)
    bent = np.clip(size / _BENT, 0.0, 1.0)
    return bent * off / np.maximum(size, 1e-9) + (1.0 - bent) * ahead


def _clearance(places: FloatArray, world: FloatArray, skeleton: Skeleton, side: str) -> FloatArray:
    """(frame,) height of the toe joint over its rest or of the heel, whichever is lower [m]."""
    ankle = JOINT[f"{side}_ankle"]
    heel = places[:, ankle, 2] + (world[:, ankle] @ skeleton.heel[SIDES.index(side)])[:, 2]
    return np.minimum(places[:, JOINT[f"{side}_foot"], 2] - skeleton.toe_height, heel)


def _swing_height(swinging: NDArray[np.bool_], rate: float) -> FloatArray:
    """(frame,) least height of a swinging foot [m]."""
    out = np.zeros(len(swinging))
    for first, last in runs(swinging):
        if last - first >= _SHORTEST * rate:
            s = (np.arange(first, last) - first + 1) / (last - first + 1)
            # rises early, before the foot is fast
            out[first:last] = _CLEAR * (1.0 - (2.0 * s - 1.0) ** 6)
    return out


def _hold(
    toe: FloatArray, heel: FloatArray, rolling: NDArray[np.bool_], down: NDArray[np.bool_], rate: float
) -> tuple[NDArray[np.bool_], FloatArray, NDArray[np.bool_]]:
    """(frame,) held frames, their (frame, 3) shift, and (frame,) frames of steps of feet that drift too far.

    A foot that lands on its heel (`rolling`) keeps the heel where it is as the toes land; then the toes stay.
    """
    held, stepping = np.zeros(len(toe), bool), np.zeros(len(toe), bool)
    offset = np.zeros_like(toe)
    release = max(1, round(_RELEASE * rate))
    for first, last in runs(down):
        if last - first < max(2, round(_SHORTEST * rate)):
            continue
        held[first:last] = True
        flat = np.flatnonzero(~rolling[first:last])
        landed = first + int(flat[0]) if len(flat) else last
        start = landed
        for stop in range(landed + 1, last + 1):
            spot = toe[start:stop, :2].mean(axis=0)
            drift = np.abs(toe[start:stop, :2] - spot).max()
            if drift > _FURTHEST or stop == last:
                offset[start:stop, :2] = spot - toe[start:stop, :2]
                if stop < last:
                    step = slice(max(first, stop - release), min(last, stop + release))
                    held[step], stepping[step] = False, True
                start = stop
        if landed > first:
            spot = heel[landed, :2] + offset[landed, :2] if landed < last else heel[first:last, :2].mean(axis=0)
            shift = spot - heel[first:landed, :2]
            far = np.maximum(np.linalg.norm(shift, axis=-1, keepdims=True) / _FURTHEST, 1.0)
            offset[first:landed, :2] = shift / far
    return held, offset, stepping


def _between(held: NDArray[np.bool_], offset: FloatArray) -> FloatArray:
    """Shifts interpolated smoothly between held intervals."""
    at = np.flatnonzero(held)
    if not len(at):
        return np.zeros_like(offset)
    out = offset.copy()
    for a, b in pairwise(at):
        if b - a > 1:
            s = np.arange(1, b - a) / (b - a)
            s = (s * s * (3.0 - 2.0 * s))[:, None]
            out[a + 1 : b] = offset[a] + s * (offset[b] - offset[a])
    out[: at[0]], out[at[-1] + 1 :] = offset[at[0]], offset[at[-1]]
    return out
