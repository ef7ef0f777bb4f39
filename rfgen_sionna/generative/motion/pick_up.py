"""Picking something up from the ground."""

from __future__ import annotations

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.manner import Manner
from rfgen_sionna.generative.motion.balance import fit_height, over_feet
from rfgen_sionna.generative.motion.curves import keys
from rfgen_sionna.generative.motion.limits import joint_angles
from rfgen_sionna.generative.motion.postures import quiet, relaxed
from rfgen_sionna.generative.motion.skeleton import FINGERS, JOINT, SIDES, side_sign
from rfgen_sionna.generative.motion.tracks import MotionTracks


def pick_up(tracks: MotionTracks, rng: np.random.Generator, hand: str, manner: Manner) -> None:
    """Bend hips, knees and back, reach to the floor with one hand or both, grasp, stand up again."""
    t, sk = tracks.t, tracks.skeleton
    leg = sk.leg_length()
    relaxed(tracks, rng)
    quiet(tracks, rng, 0.7)
    both = rng.uniform() < 0.4
    squat = rng.uniform(0.28, 0.42) * leg
    stoop = rng.uniform(0.32, 0.5)
    down, hold, up = (rng.uniform(*r) / manner.pace for r in ((0.9, 1.3), (0.25, 0.55), (0.9, 1.4)))
    clock, between = rng.uniform(0.1, 0.5) / manner.pace, (0.4 / manner.pace, 0.9 / manner.pace)
    squeeze = min(1.0, 0.9 * float(t[-1]) / (clock + down + hold + up))  # a short motion holds it once
    if manner.rate is not None:
        squeeze = min(squeeze, 54.0 / manner.rate / (down + hold + up))
        between = (60.0 / manner.rate - squeeze * (down + hold + up),) * 2
    clock, down, hold, up = (squeeze * each for each in (clock, down, hold, up))
    times, low, grip = [0.0], [0.0], [(0.0, 0.0)]
    carried = 0.0
    while times[-1] <= t[-1]:
        carried = 1.0 - carried
        for step, depth in ((0.0, 0.0), (down, 1.0), (hold, 1.0), (up, 0.0)):
            clock += step
            times.append(clock)
            low.append(depth)
        grip += [(clock - up - hold, 1.0 - carried), (clock - up - 0.05, carried)]
        clock += rng.uniform(*between)
    amount = keys(t, times, low)
    # trunk and head start before the knees
    early = keys(t + 0.08, times, low)
    closing = keys(t, [g[0] for g in grip], [g[1] for g in grip])
    tracks.pelvis[:, 2] -= squat * amount
    tracks.pitch += stoop * early
    tracks.bend += rng.uniform(0.6, 0.85) * early
    tracks.nod += rng.uniform(-0.25, 0.15) * amount
    tracks.knee_out += (rng.uniform(0.05, 0.25) * amount)[:, None]
    aside = rng.uniform(0.0, 0.12) if both else rng.uniform(-0.02, 0.1)
    forward, height = rng.uniform(0.3, 0.4) * leg / 0.82, rng.uniform(0.11, 0.17) * leg / 0.82
    if not both:
        tracks.turn += side_sign(hand) * -rng.uniform(0.05, 0.3) * amount
        tracks.lean += side_sign(hand) * -rng.uniform(0.0, 0.1) * amount
    for side in SIDES:
        s, arm = side_sign(side), tracks.arms[side]
        reaching = both or side == hand
        if reaching:
            arm.target = np.tile([forward, s * aside + (s * 0.1 if both else 0.0), height], (tracks.n, 1))
            arm.target_weight = amount
            arm.pole = arm.pole + amount[:, None] * (np.array([-0.6, 0.9, -0.5]) - arm.pole)
            grasp = tracks.hands[side]
            grasp.curl = (
                grasp.curl + closing[:, None, None] * (np.tile([0.85, 0.75, 0.4], (5, 1)) - grasp.curl) * _thumb_less()
            )
            grasp.flexion += 0.25 * amount
        else:
            # free hand to the thigh
            swing = rng.uniform(0.6, 0.9)
            rest = np.array([np.sin(swing), 0.15, -np.cos(swing)])
            arm.direction += amount[:, None] * (rest - arm.direction)
            arm.elbow += 0.5 * amount
    over_feet(tracks, ahead=0.075)
    fit_height(tracks)
    _reach_down(tracks)
    _spare_hips(tracks, amount)
    _above_ground(tracks)


def _thumb_less() -> np.ndarray:
    """(5, 1) closing of thumb and fingers."""
    return np.array([1.0, 1.0, 1.0, 1.0, 0.45])[:, None]


def _reach_down(tracks: MotionTracks) -> None:
    """Bend the trunk further where a hand does not reach its target."""
    for _ in range(3):
        _, p = tracks.solve()
        short = 0.0
        for side in SIDES:
            arm = tracks.arms[side]
            if arm.target is None or arm.target_weight is None:
                continue
            gap = np.linalg.norm(p[:, JOINT[f"{side}_wrist"]] - arm.target, axis=-1)
            short = max(short, float(np.max(gap[arm.target_weight > 0.999], initial=0.0)))
            weight = arm.target_weight
        if short < 0.01:
            return
        tracks.bend += weight * min(0.9 * short, 0.12)
        tracks.pelvis[:, 2] -= weight * 0.5 * short
        over_feet(tracks, ahead=0.075)


def _spare_hips(tracks: MotionTracks, amount: FloatArray, most: float = 115.0) -> None:
    """Tilt the pelvis less where the hips would bend more than `most` [degrees]."""
    for _ in range(3):
        rotations, _ = tracks.solve()
        excess = float(np.max(joint_angles(rotations)["hip flexion"])) - most
        if excess <= 0.0:
            return
        tracks.pitch -= amount * np.radians(excess)
        over_feet(tracks, ahead=0.075)


def _above_ground(tracks: MotionTracks, clearance: float = 0.02) -> None:
    """Lift the wrists' targets until the fingertips are above the ground."""
    for _ in range(3):
        _, p = tracks.solve()
        for side in SIDES:
            arm = tracks.arms[side]
            if arm.target is None:
                continue
            lowest = np.inf
            for finger in FINGERS:
                middle, last = (p[:, JOINT[f"{side}_{finger}{k}"]] for k in (2, 3))
                # fingertip: the last bone is about as long as the one before
                lowest = min(lowest, float(np.min(np.minimum(last, 2.0 * last - middle)[:, 2])))
            arm.target[:, 2] += max(clearance - lowest, 0.0)
