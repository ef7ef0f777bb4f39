"""Standing, and a leg held up."""

from __future__ import annotations

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.manner import Manner
from rfgen_sionna.generative.motion.balance import fit_height, over_feet
from rfgen_sionna.generative.motion.curves import keys, wander
from rfgen_sionna.generative.motion.skeleton import SIDES, side_sign
from rfgen_sionna.generative.motion.tracks import MotionTracks


def quiet(tracks: MotionTracks, rng: np.random.Generator, amount: float = 1.0) -> None:
    """Postural sway, breathing and small movements of a standing person, and how the person carries itself.

    Sway of the trunk by about 5 mm rms (quiet stance), and 12 to 18 breaths a minute. Head and feet are as in the
    library's clips of idle people (idle_*_genuine, accad_*_Stand): gaze 10 degrees up to 30 down and 20 to a side.
    """
    t = tracks.t
    tracks.sway[:, 0] += amount * wander(t, rng, 0.004)
    tracks.sway[:, 1] += amount * wander(t, rng, 0.003)
    tracks.lean += amount * wander(t, rng, 0.006) + np.clip(rng.normal(0.0, 0.015), -0.03, 0.03)
    tracks.bend += amount * wander(t, rng, 0.008) + rng.uniform(-0.03, 0.1)
    tracks.turn += amount * wander(t, rng, 0.012) + np.clip(rng.normal(0.0, 0.04), -0.08, 0.08)
    tracks.yaw += amount * wander(t, rng, 0.006) + np.clip(rng.normal(0.0, 0.06), -0.15, 0.15)
    tracks.roll += np.clip(rng.normal(0.0, 0.02), -0.05, 0.05)
    tracks.pitch += np.clip(rng.normal(0.0, 0.04), -0.08, 0.08)
    tracks.pelvis[:, 2] -= np.clip(rng.normal(0.0, 0.012), 0.0, 0.03)
    tracks.nod += amount * wander(t, rng, 0.03) + np.clip(rng.normal(0.1, 0.12), -0.15, 0.4)
    tracks.look += amount * wander(t, rng, 0.05, 0.05, 0.4) + np.clip(rng.normal(0.0, 0.1), -0.25, 0.25)
    tracks.tilt += amount * wander(t, rng, 0.015) + rng.normal(0.0, 0.02)
    ahead = np.clip(rng.normal(0.0, 0.025), -0.06, 0.06)
    breath = 2.0 * np.pi * (rng.uniform(0.2, 0.3) * t + rng.uniform())
    tracks.shrug += (0.012 * np.sin(breath))[:, None]
    tracks.bend -= 0.006 * np.sin(breath)
    for side in SIDES:
        arm, hand = tracks.arms[side], tracks.hands[side]
        tracks.feet[side].place[:, 0] += ahead * side_sign(side)
        arm.direction += amount * np.stack([wander(t, rng, 0.012), wander(t, rng, 0.008), np.zeros_like(t)], axis=-1)
        arm.elbow += amount * wander(t, rng, 0.02)
        hand.flexion += amount * wander(t, rng, 0.03)
        hand.curl += amount * wander(t, rng, 0.03)[:, None, None] + rng.uniform(-0.05, 0.1)


def relaxed(tracks: MotionTracks, rng: np.random.Generator) -> None:
    """Personal manner of hanging arms: angle to the side and ahead, bend of the elbows.

    As in the library's clips of idle people whose hands hang: elbows bent by 10 to 55 degrees, wrists 5 to 22 degrees
    from hanging.
    """
    wide, ahead = rng.uniform(0.08, 0.27), rng.uniform(-0.06, 0.22)
    bent = rng.gamma(3.0, 0.16)
    for side in SIDES:
        tracks.arms[side].direction[:, 1] = wide + rng.uniform(-0.04, 0.04)
        tracks.arms[side].direction[:, 0] = ahead + rng.uniform(-0.04, 0.04)
        tracks.arms[side].elbow[:] = np.clip(bent + rng.uniform(-0.1, 0.1), 0.12, 1.0)


def stand_up_straight(tracks: MotionTracks) -> None:
    """Finish standing tracks: weight over the feet, legs within reach."""
    over_feet(tracks)
    fit_height(tracks)


def hold_envelope(
    t: FloatArray, rng: np.random.Generator, pace: float, rise: tuple[float, float], shift: float = 0.0
) -> tuple[FloatArray, FloatArray]:
    """Repeated raise of a limb: up in `rise` [s], held for some seconds, down.

    Returns:
        (n,) height, 0 .. 1, and (n,) weight on the other side, 0 .. 1; the weight shifts `shift` [s] before the limb.
    """
    up, shift = rng.uniform(*rise) / pace, shift / pace
    clock = min(rng.uniform(0.05, 0.3) / pace, 0.4 * float(t[-1]) - up - shift)  # short motions begin on the way
    times, lifted, weight = [min(clock, 0.0) - 1e-3], [0.0], [0.0]
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


def leg_raised(tracks: MotionTracks, rng: np.random.Generator, hand: str, manner: Manner, side: str) -> None:
    """A leg is lifted forwards and held, with balance on the other."""
    relaxed(tracks, rng)
    quiet(tracks, rng, 1.2)
    sk, foot = tracks.skeleton, tracks.feet[side]
    amount, shifted = hold_envelope(tracks.t, rng, manner.pace, (0.7, 1.2), rng.uniform(0.4, 0.55))
    hip = np.radians(np.clip(rng.uniform(65.0, 90.0) * manner.size, 35.0, 95.0))
    knee = np.radians(rng.uniform(30.0, 90.0))
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
