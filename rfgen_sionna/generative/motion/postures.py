"""Standing and the held postures: T, Y, an arm or a leg raised."""

from __future__ import annotations

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.manner import Manner
from rfgen_sionna.generative.motion.balance import fit_height, over_feet
from rfgen_sionna.generative.motion.curves import keys, wander
from rfgen_sionna.generative.motion.skeleton import SIDES
from rfgen_sionna.generative.motion.tracks import ARM_POLE, MotionTracks


def quiet(tracks: MotionTracks, rng: np.random.Generator, amount: float = 1.0) -> None:
    """Postural sway, breathing and small movements of a standing person.

    Sway of the trunk by about 5 mm rms (quiet stance), and 12 to 18 breaths a minute.
    """
    t = tracks.t
    tracks.sway[:, 0] += amount * wander(t, rng, 0.004)
    tracks.sway[:, 1] += amount * wander(t, rng, 0.003)
    tracks.lean += amount * wander(t, rng, 0.006)
    tracks.bend += amount * wander(t, rng, 0.008) + rng.uniform(-0.02, 0.05)
    tracks.turn += amount * wander(t, rng, 0.012)
    tracks.yaw += amount * wander(t, rng, 0.006)
    tracks.nod += amount * wander(t, rng, 0.03) + rng.uniform(-0.05, 0.08)
    tracks.look += amount * wander(t, rng, 0.05, 0.05, 0.4)
    tracks.tilt += amount * wander(t, rng, 0.015)
    breath = 2.0 * np.pi * (rng.uniform(0.2, 0.3) * t + rng.uniform())
    tracks.shrug += (0.012 * np.sin(breath))[:, None]
    tracks.bend -= 0.006 * np.sin(breath)
    for side in SIDES:
        arm, hand = tracks.arms[side], tracks.hands[side]
        arm.direction += amount * np.stack([wander(t, rng, 0.012), wander(t, rng, 0.008), np.zeros_like(t)], axis=-1)
        arm.elbow += amount * wander(t, rng, 0.02)
        hand.flexion += amount * wander(t, rng, 0.03)
        hand.curl += amount * wander(t, rng, 0.03)[:, None, None] + rng.uniform(-0.05, 0.1)


def relaxed(tracks: MotionTracks, rng: np.random.Generator) -> None:
    """Personal manner: angle of the arms to the side, bend of the elbows."""
    wide, bent, ahead = rng.uniform(0.08, 0.2), rng.uniform(0.15, 0.4), rng.uniform(-0.03, 0.08)
    for side in SIDES:
        tracks.arms[side].direction[:, 1] = wide + rng.uniform(-0.02, 0.02)
        tracks.arms[side].direction[:, 0] = ahead + rng.uniform(-0.02, 0.02)
        tracks.arms[side].elbow[:] = bent + rng.uniform(-0.05, 0.05)


def stand_up_straight(tracks: MotionTracks) -> None:
    """Finish standing tracks: weight over the feet, legs within reach."""
    over_feet(tracks)
    fit_height(tracks)


def standing(tracks: MotionTracks, rng: np.random.Generator, hand: str, manner: Manner) -> None:
    """Quiet standing with shifts of weight between the legs."""
    relaxed(tracks, rng)
    quiet(tracks, rng, rng.uniform(0.8, 1.4))
    shift = np.clip(wander(tracks.t, rng, rng.uniform(0.0, 0.08), 0.05, 0.2 * manner.pace), -0.25, 0.25)
    over_feet(tracks, 0.5 + shift)
    fit_height(tracks)


def lift_arm(tracks: MotionTracks, side: str, direction: FloatArray, elbow: float, amount: FloatArray) -> None:
    """Turn an arm from hanging (`amount` 0) to `direction` (3,) (`amount` 1, (n,)) by the smallest rotation."""
    arm = tracks.arms[side]
    start = arm.direction / np.linalg.norm(arm.direction, axis=-1, keepdims=True)
    goal = direction / np.linalg.norm(direction)
    angle = np.arccos(np.clip(start @ goal, -1.0, 1.0))[:, None]
    a = amount[:, None]
    arm.direction = (np.sin((1.0 - a) * angle) * start + np.sin(a * angle) * goal) / np.sin(angle)
    arm.elbow += (elbow - arm.elbow) * amount


def _both_arms(tracks: MotionTracks, rng: np.random.Generator, elevation: float) -> None:
    tilt = np.clip(rng.normal(0.0, np.radians(1.5)), -0.05, 0.05)
    for side in SIDES:
        e = elevation + np.clip(rng.normal(0.0, np.radians(2.0)), -0.06, 0.06) + wander(tracks.t, rng, np.radians(1.2))
        forward = rng.uniform(0.0, 0.12) + wander(tracks.t, rng, 0.01)
        e = e + (tilt if side == "left" else -tilt)
        tracks.arms[side].direction = np.stack([forward, np.cos(e), np.sin(e)], axis=-1)
        tracks.arms[side].elbow[:] = rng.uniform(0.05, 0.15) + wander(tracks.t, rng, 0.01)
        hand = tracks.hands[side]
        hand.pronation[:] = rng.uniform(-0.2, 0.2)
        hand.flexion[:] = rng.uniform(-0.1, 0.1)
        hand.curl *= rng.uniform(0.1, 0.5)


def t_pose(tracks: MotionTracks, rng: np.random.Generator, hand: str, manner: Manner) -> None:
    """Both arms held out sideways at shoulder height."""
    quiet(tracks, rng, 1.0)
    _both_arms(tracks, rng, np.radians(rng.uniform(-3.0, 3.0)))
    stand_up_straight(tracks)


def y_pose(tracks: MotionTracks, rng: np.random.Generator, hand: str, manner: Manner) -> None:
    """Both arms held up and out, like a Y."""
    quiet(tracks, rng, 1.0)
    _both_arms(tracks, rng, np.radians(rng.uniform(42.0, 55.0)))
    stand_up_straight(tracks)


def hold_envelope(
    t: FloatArray, rng: np.random.Generator, pace: float, rise: tuple[float, float], shift: float = 0.0
) -> tuple[FloatArray, FloatArray]:
    """Repeated raise of a limb: up in `rise` [s], held for some seconds, down.

    Returns:
        (n,) height, 0 .. 1, and (n,) weight on the other side, 0 .. 1; the weight shifts `shift` [s] before the limb.
    """
    up, shift = rng.uniform(*rise) / pace, shift / pace
    times, lifted, weight = [0.0], [0.0], [0.0]
    clock = rng.uniform(0.05, 0.3) / pace
    while times[-1] <= t[-1]:
        hold, rest = rng.uniform(3.5, 6.0) / pace, rng.uniform(0.5, 1.2) / pace
        steps = [(0.0, 0.0, 0.0), (shift, 0.0, 1.0), (up, 1.0, 1.0), (hold, 1.0, 1.0), (up * 1.1, 0.0, 1.0)]
        for step, value, share in [*steps, (shift, 0.0, 0.0)]:
            clock += step
            if clock > times[-1]:
                times.append(clock)
                lifted.append(value)
                weight.append(share)
        clock += rest
    return keys(t, times, lifted), keys(t, times, weight)


def arm_raised(tracks: MotionTracks, rng: np.random.Generator, hand: str, manner: Manner, side: str) -> None:
    """An arm rises and stays up."""
    relaxed(tracks, rng)
    quiet(tracks, rng, 1.0)
    amount, _ = hold_envelope(tracks.t, rng, manner.pace, (0.6, 1.1))
    out, high = np.radians(rng.uniform(15.0, 50.0)), np.radians(rng.uniform(50.0, 75.0))
    direction = np.array([np.cos(out) * np.cos(high), np.sin(out) * np.cos(high), np.sin(high)])
    tracks.arms[side].pole = (
        np.tile([-0.5, 1.0, -0.6], (tracks.n, 1)) * amount[:, None] + ARM_POLE * (1 - amount)[:, None]
    )
    lift_arm(tracks, side, direction, rng.uniform(0.1, 0.35), amount)
    tracks.arms[side].direction += 0.01 * np.stack([wander(tracks.t, rng, 1.0) for _ in range(3)], axis=-1)
    palm = tracks.hands[side]
    palm.pronation += amount * rng.uniform(-0.2, 0.7)
    palm.curl *= (1.0 - 0.7 * amount)[:, None, None]
    tracks.lean += amount * rng.uniform(0.0, 0.05) * (1 if side == "left" else -1)
    stand_up_straight(tracks)


def leg_raised(tracks: MotionTracks, rng: np.random.Generator, hand: str, manner: Manner, side: str) -> None:
    """A leg is lifted forwards and held, with balance on the other."""
    relaxed(tracks, rng)
    quiet(tracks, rng, 1.2)
    sk, foot = tracks.skeleton, tracks.feet[side]
    amount, shifted = hold_envelope(tracks.t, rng, manner.pace, (0.7, 1.2), rng.uniform(0.4, 0.55))
    hip, knee = np.radians(rng.uniform(65.0, 90.0)), np.radians(rng.uniform(30.0, 90.0))
    hip_angle = hip * amount * (1.0 + 0.02 * wander(tracks.t, rng, 1.0))
    knee_angle = knee * np.sin(np.pi * np.minimum(amount, 1.0)) * 0.25 + knee * amount
    thigh, shank = sk.length(f"{side}_knee"), sk.length(f"{side}_ankle")
    up = thigh * (1.0 - np.cos(hip_angle)) + shank * (1.0 - np.cos(hip_angle - knee_angle))
    forward = thigh * np.sin(hip_angle) + shank * np.sin(hip_angle - knee_angle)
    foot.place[:, 0] += forward
    foot.place[:, 1] *= 1.0 - 0.25 * amount
    foot.lift += up
    foot.pitch += 0.9 * (hip_angle - knee_angle) + amount * np.radians(rng.uniform(-22.0, 0.0))
    foot.loose[:] = 1.0
    tracks.contacts[:, SIDES.index(side)] = amount < 1e-6
    tracks.bend -= 0.06 * amount
    tracks.pitch -= 0.10 * amount * hip
    for s in SIDES:
        tracks.arms[s].direction[:, 1] += amount * rng.uniform(0.1, 0.45)
    other = 0.0 if side == "left" else 1.0
    over_feet(tracks, 0.5 + (other - 0.5) * 0.97 * shifted)
    fit_height(tracks)
