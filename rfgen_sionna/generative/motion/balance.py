"""Balance of a standing person: centre of mass over the feet, legs within reach."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d, minimum_filter1d

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.motion.skeleton import JOINT, SIDES
from rfgen_sionna.generative.motion.tracks import MotionTracks

# Share of body mass and position of the centre along the segment from its upper joint:
# Winter, Biomechanics and Motor Control of Human Movement, 4th ed. (2009), table 4.1.
_SEGMENTS: tuple[tuple[str, str, float, float], ...] = (
    ("neck", "head", 0.081, 1.0),
    ("pelvis", "neck", 0.497, 0.5),
    *(
        segment
        for s in SIDES
        for segment in (
            (f"{s}_shoulder", f"{s}_elbow", 0.028, 0.436),
            (f"{s}_elbow", f"{s}_wrist", 0.016, 0.430),
            (f"{s}_wrist", f"{s}_middle1", 0.006, 0.506),
            (f"{s}_hip", f"{s}_knee", 0.100, 0.433),
            (f"{s}_knee", f"{s}_ankle", 0.0465, 0.433),
            (f"{s}_ankle", f"{s}_foot", 0.0145, 0.5),
        )
    ),
)


def centre_of_mass(joints: FloatArray) -> FloatArray:
    """(..., 3) centre of mass [m] of a body with joint positions (..., 52, 3) [m], or (..., 22, 3) without fingers:
    the hands count at the wrists then."""
    total = np.zeros((*joints.shape[:-2], 3))
    for upper, lower, share, at in _SEGMENTS:
        a = joints[..., JOINT[upper], :]
        b = joints[..., JOINT[lower], :] if JOINT[lower] < joints.shape[-2] else a
        total += share * (a + at * (b - a))
    return total / sum(share for _, _, share, _ in _SEGMENTS)


def over_feet(tracks: MotionTracks, weight: FloatArray | float = 0.5, ahead: float = 0.05) -> None:
    """Shift the pelvis so that the centre of mass stays over the support.

    Args:
        tracks: changed in place; `tracks.sway` is added to the centre of mass.
        weight: share of the weight on the left foot, (n,) or constant.
        ahead: distance of the support in front of the ankles [m], for legs of 0.82 m.
    """
    left, right = (tracks.feet[s] for s in SIDES)
    w = np.broadcast_to(np.asarray(weight, float), (tracks.n,))[:, None]
    support = w * left.place + (1.0 - w) * right.place
    support = support + ahead * tracks.skeleton.leg_length() / 0.82 * np.stack(
        [np.cos(tracks.yaw), np.sin(tracks.yaw)], axis=-1
    )
    for _ in range(3):
        _, joints = tracks.solve(fingers=False)
        tracks.pelvis[:, :2] += support + tracks.sway - centre_of_mass(joints)[:, :2]


def fit_height(tracks: MotionTracks, reach: float = 0.985) -> None:
    """Lower the pelvis by one constant so that no leg is longer than `reach` of its length."""
    sk = tracks.skeleton
    longest = reach * sk.leg_length()
    for _ in range(4):
        _, joints = tracks.solve(fingers=False)
        over = 0.0
        for side in SIDES:
            ankle, _, _ = tracks.foot_frames(side)
            over = max(over, float(np.max(np.linalg.norm(ankle - joints[:, JOINT[f"{side}_hip"]], axis=-1)) - longest))
        if over <= 1e-4:
            return
        tracks.pelvis[:, 2] -= over


def ride_height(tracks: MotionTracks, reach: float = 0.99, sigma: float = 0.04) -> None:
    """Lower the pelvis smoothly to within reach of both legs, as in walking.

    The lower envelope of the highest pelvis that both legs allow is smoothed over `sigma` [s].
    """
    sk = tracks.skeleton
    longest = reach * sk.leg_length()
    step = float(tracks.t[1] - tracks.t[0]) if tracks.n > 1 else 1.0
    width = max(1, round(2.0 * sigma / step))
    for _ in range(2):
        _, joints = tracks.solve(fingers=False)
        allowed = np.full(tracks.n, np.inf)
        for side in SIDES:
            ankle, _, _ = tracks.foot_frames(side)
            hip = joints[:, JOINT[f"{side}_hip"]]
            aside = np.sum((hip - ankle)[:, :2] ** 2, axis=-1)
            up = np.sqrt(np.maximum(longest**2 - aside, (0.5 * longest) ** 2))
            allowed = np.minimum(allowed, ankle[:, 2] + up - (hip[:, 2] - tracks.pelvis[:, 2]))
        low = minimum_filter1d(np.minimum(allowed, tracks.pelvis[:, 2]), 2 * width + 1, mode="nearest")
        tracks.pelvis[:, 2] = gaussian_filter1d(low, sigma / step, mode="nearest", truncate=2.0 * step * width / sigma)
