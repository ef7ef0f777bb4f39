"""From features to a motion on a person: smooth at a higher rate, on that person's legs, feet planted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.diffusion.features import FRAME_RATE, HandBasis, decode
from rfgen_sionna.generative.diffusion.floor_contact import keep_body_above_floor
from rfgen_sionna.generative.diffusion.foot_lock import lock_feet, root_from_feet
from rfgen_sionna.generative.diffusion.hand_floor_contact import keep_hands_above_floor
from rfgen_sionna.generative.diffusion.joint_clamping import clamp_joint_angles
from rfgen_sionna.generative.diffusion.self_penetration import separate_arms_from_trunk
from rfgen_sionna.generative.motion import MEAN_ADULT, Skeleton
from rfgen_sionna.records import Motion

RATE = 60.0
"""Poses per second of a finished motion [Hz]."""


def to_motion(
    features: FloatArray,
    hands: HandBasis,
    skeleton: Skeleton | None = None,
    rate: float = RATE,
    *,
    free: bool = True,
    legs: NDArray[np.bool_] | None = None,
    bend: Callable[[Motion], Motion] | None = None,
) -> Motion:
    """The motion of (frame, NUM_FEATURES) rows at 20 Hz on a skeleton.

    Args:
        features: rows in their own units.
        hands: the fingers' components.
        skeleton: of the person; None for a mean adult. The path is scaled with the legs.
        rate: poses per second of the result [Hz].
        free: whether the pelvis may give way to the steps, and arms to the trunk; not where parts were asked for.
        legs: (frame,) rows in which the legs were given and stay as they are, planted or not; None: in none. Only where
            the rest isn't free.
        bend: what takes the walk to another way, once its feet carry it.
    """
    skeleton = skeleton or MEAN_ADULT
    # bent and planted at no lower rate than usual: whole steps lie between poses that are far apart
    motion = clamp_joint_angles(resample_motion(decode(features, hands, FRAME_RATE), max(rate, RATE)))
    scale = skeleton.leg_length() / MEAN_ADULT.leg_length()
    height = skeleton.standing_height() - scale * MEAN_ADULT.standing_height()
    translation = motion.translation * scale
    translation[:, 2] += height
    motion = replace(motion, translation=translation, offsets=skeleton.offsets)
    if not free:
        motion = motion if bend is None else bend(motion)
        kept = None if legs is None else _at_rate(legs, motion)
        return resample_motion(lock_feet(motion, skeleton, ride=False, kept=kept), rate)
    carried = root_from_feet(separate_arms_from_trunk(motion, skeleton), skeleton)
    planted = lock_feet(carried if bend is None else bend(carried), skeleton)
    # limbs that are turned back within their limits may come under it again
    return resample_motion(
        keep_body_above_floor(clamp_joint_angles(keep_hands_above_floor(keep_body_above_floor(planted), skeleton))),
        rate,
    )


def _at_rate(rows: NDArray[np.bool_], motion: Motion) -> NDArray[np.bool_]:
    """Poses of the motion of which the rows on both sides, at 20 Hz, are marked."""
    at = np.arange(len(motion.translation)) * FRAME_RATE / motion.frame_rate
    last = len(rows) - 1
    before, after = (np.clip(near.astype(int), 0, last) for near in (np.floor(at + 1e-9), np.ceil(at - 1e-9)))
    return np.asarray(rows[before] & rows[after])


def resample_motion(motion: Motion, rate: float) -> Motion:
    """The motion along cubic splines through its poses, at another rate."""
    n = len(motion.translation)
    if n < 2 or rate == motion.frame_rate:
        return motion
    t = np.arange(n) / motion.frame_rate
    # as many poses as fit, the last one kept
    fine = np.arange(int(np.floor((n - 1) * rate / motion.frame_rate + 1e-9)) + 1) / rate
    quaternions = CubicSpline(t, motion.rotations.reshape(n, -1))(fine).reshape(len(fine), -1, 4)
    contacts = motion.contacts
    if contacts is not None:
        contacts = contacts[np.minimum(np.round(fine * motion.frame_rate).astype(int), n - 1)]
    return replace(
        motion,
        rotations=quaternions / np.linalg.norm(quaternions, axis=-1, keepdims=True),
        translation=np.asarray(CubicSpline(t, motion.translation)(fine), np.float64),
        frame_rate=rate,
        contacts=contacts,
    )
