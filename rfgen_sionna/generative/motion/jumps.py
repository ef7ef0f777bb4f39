"""Jumps on the spot and jumping jacks: ballistic flight between pushes against the floor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.manner import Manner
from rfgen_sionna.generative.motion.balance import over_feet
from rfgen_sionna.generative.motion.curves import ease, hermite, keys, wander
from rfgen_sionna.generative.motion.postures import quiet, relaxed
from rfgen_sionna.generative.motion.skeleton import JOINT, SIDES
from rfgen_sionna.generative.motion.tracks import MotionTracks

GRAVITY = 9.81
"""[m/s²]"""
_LOWEST = 0.05
"""Height of the smallest jump of a mean adult [m]; it flies 0.2 s."""
_LEANING = 0.2
"""Height of the lowest jump of a mean adult with the whole lean of the trunk in its dip [m]."""
_ON_FLOOR = 0.3
"""Time of dip, landing and rest of the quickest jumps that end in standing [s]."""
_CONTACT = 0.2
"""Shortest time on the floor between jumps that follow one another [s]."""


def _airborne(tracks: MotionTracks, reach: float = 0.985) -> None:
    """Lower the pelvis until the planted legs reach the floor."""
    sk = tracks.skeleton
    longest = reach * sk.leg_length()
    planted = tracks.contacts
    for _ in range(4):
        _, joints = tracks.solve()
        over = 0.0
        for i, side in enumerate(SIDES):
            ankle, _, _ = tracks.foot_frames(side)
            gap = np.linalg.norm(ankle - joints[:, JOINT[f"{side}_hip"]], axis=-1) - longest
            over = max(over, float(np.max(gap[planted[:, i]], initial=0.0)))
        if over <= 1e-4:
            break
        tracks.pelvis[:, 2] -= over


def _leave_floor(
    times: list[float],
    states: list[list[float]],
    off: float,
    on: float,
    take_off: float,
    landing: float,
    slack: float,
    tuck: float,
) -> None:
    """Append knots of the feet's height in a flight from `off` to `on` [s], with vertical speeds `take_off` and
    `landing`.

    The feet start from rest while the body has full speed: the legs extend by `slack` [m], then the feet fly with the
    body; reversed before landing. `tuck` is the height by which they are drawn up in between [m].
    """
    rise, fall = (min(2.0 * slack / v, 0.4 * (on - off)) for v in (take_off, landing))
    up = take_off * rise - 0.5 * GRAVITY * rise**2 - slack
    down = landing * fall - 0.5 * GRAVITY * fall**2 - slack
    times += [off, off + rise, on - fall, on]
    states += [
        [0.0, 0.0, 0.0],
        [up, take_off - GRAVITY * rise, -GRAVITY],
        [down, -landing + GRAVITY * fall, -GRAVITY],
        [0.0, 0.0, 0.0],
    ]
    if tuck > 0.0:
        middle = 0.5 * (off + on)
        s = (middle - off) * take_off - 0.5 * GRAVITY * (middle - off) ** 2 - slack
        times.insert(-2, middle)
        states.insert(-2, [s + tuck, take_off - GRAVITY * (middle - off), -GRAVITY])


def jump(tracks: MotionTracks, rng: np.random.Generator, hand: str, manner: Manner) -> None:
    """Repeated jumps: dip with the arms back, push off, fly, land softly, stand.

    Where the rate leaves no time to stand, each landing is the next dip, in which the legs act as a spring.

    The centre of mass flies 0.08 to 0.3 m high; small jumps 0.05 m, as lower ones hardly leave the floor, and high
    ones 0.36 m.
    """
    t, sk = tracks.t, tracks.skeleton
    leg = sk.leg_length()
    quiet(tracks, rng, 0.7)
    relaxed(tracks, rng)
    drawn = rng.uniform(0.08, 0.3) if manner.amplitude is None else 0.165 * rng.uniform(0.93, 1.1)
    height = max(drawn * manner.size**2.3, _LOWEST) * leg / 0.82
    effort = np.clip(np.sqrt(height / 0.2), 0.45, 1.15)
    depth = rng.uniform(0.14, 0.24) * leg * effort
    take_off = np.sqrt(2.0 * GRAVITY * height)
    # height of the pelvis over standing as the toes leave the floor and touch it again
    leave, touch = 0.035 * min(effort, 1.0) * leg / 0.82, 0.0
    landing = np.sqrt(2.0 * GRAVITY * (height + leave - touch))
    flight = (take_off + landing) / GRAVITY
    dip, push, land, rest = (
        rng.uniform(0.34, 0.5) / manner.pace**0.5,
        np.clip(2.1 * depth / take_off, 0.2, 0.42),
        rng.uniform(0.26, 0.36),
        rng.uniform(0.35, 0.6) / manner.pace,
    )
    rebound = manner.rate is not None and 60.0 / manner.rate - push - flight < _ON_FLOOR
    if manner.rate is not None and rebound:
        contact = max(60.0 / manner.rate - flight, _CONTACT)
        dip, push, land, rest = 0.0, 0.5 * contact, 0.5 * contact, 0.0
        depth = min(take_off * contact / np.pi, 0.3 * leg)
    elif manner.rate is not None:
        free = 60.0 / manner.rate - push - flight
        dip, land = min(dip, 0.4 * free), min(land, 0.4 * free)
        rest = free - dip - land
    tucked = rng.uniform(0.0, 0.06) * leg * effort**2
    arms_up = rng.uniform(0.3, 1.5) * effort
    clock = rng.uniform(0.05, 0.4)
    times, z = [min(0.0, clock - 0.1)], [[0.0, 0.0, 0.0]]
    pitch_t, pitch = [times[0]], [[0.0, 0.0, 0.0]]
    lift_t, lift = [times[0]], [[0.0, 0.0, 0.0]]
    arm_t, arm = [times[0]], [0.0]
    airborne = np.zeros(tracks.n, bool)
    while times[-1] <= t[-1]:
        jitter = rng.uniform(0.93, 1.07)
        a = clock
        b, c = a + dip * jitter, a + dip * jitter + push
        d = c + flight
        e = d + land * (jitter if rebound else 1.0)
        f = e + rest * (rng.uniform(0.8, 1.3) if manner.rate is None else 1.0)
        flown = [[leave, take_off, -GRAVITY], [leave + height, 0.0, -GRAVITY], [touch, -landing, -GRAVITY]]
        if rebound:  # half a swing of a spring from touch-down to take-off
            times += [b, c, c + take_off / GRAVITY, d]
            z += [[-depth, 0.0, 2.0 * depth / push**2], *flown]
            arm_t += [b, c + 0.35 * flight]
            arm += [-0.05, 0.15 * arms_up]
        else:
            times += [a, b, c, c + take_off / GRAVITY, d, e, f]
            z += [[0.0, 0.0, 0.0], [-depth, 0.0, 0.6 * GRAVITY], *flown, [-0.75 * depth, 0.0, 0.3 * GRAVITY]]
            z.append([0.0, 0.0, 0.0])
            arm_t += [a + 0.06, b - 0.12, c + 0.35 * flight, e, f]
            arm += [0.0, -0.6, arms_up, 0.1, 0.0]
        point = np.radians(50.0) * min(effort, 1.0)
        pitch_t += [b + 0.4 * push, c, c + 0.3 * flight, c + 0.75 * flight, d, d + 0.13]
        pitch += [
            [0.0, 0.0, 0.0],
            [-0.75 * point, -2.5 * point / flight, 0.0],
            [-point, 0.0, 0.0],
            [-0.45 * point, 0.0, 0.0],
            [-0.42 * point, 0.0, 0.0],
            [0.0, 0.0, 0.0],
        ]
        _leave_floor(lift_t, lift, c, d, take_off, landing, 0.045 * leg * min(effort, 1.0) ** 2, tucked)
        airborne |= (t > c) & (t < d)
        clock = f
    tracks.pelvis[:, 2] += hermite(t, times, z)
    feet_pitch, feet_lift = hermite(t, pitch_t, pitch), hermite(t, lift_t, lift)
    for side in SIDES:
        foot = tracks.feet[side]
        foot.pitch, foot.lift = feet_pitch, np.maximum(feet_lift, 0.0)
        foot.loose = ease(feet_lift / (0.4 * height))
    tracks.contacts[:] = ~airborne[:, None]
    swing = keys(t, arm_t, arm)
    # The trunk leans as far as the jump is high: the smallest hops come from ankles and knees, the trunk upright.
    size = height * 0.82 / leg
    low = keys(t, *_dips(times, z)) * np.clip((size - _LOWEST) / (_LEANING - _LOWEST), 0.0, 1.0)
    tracks.pitch += 0.6 * low
    tracks.bend += 0.3 * low
    tracks.nod -= 0.5 * low
    for side in SIDES:
        arm_score = tracks.arms[side]
        out = rng.uniform(0.15, 0.3)
        arm_score.direction = np.stack([np.sin(swing), np.full_like(t, out), -np.cos(swing)], axis=-1)
        arm_score.pole = np.tile([-0.5, 0.8, -0.4], (tracks.n, 1))
        arm_score.elbow = 0.35 + rng.uniform(0.3, 0.7) * (1.0 - np.cos(swing))
    grounded = tracks.pelvis.copy()
    over_feet(tracks, ahead=0.055)
    tracks.pelvis[:, 2] = grounded[:, 2]
    _airborne(tracks, 0.972)


def hop(tracks: MotionTracks, rng: np.random.Generator, hand: str, manner: Manner) -> None:
    """Jumps that follow one another at twice the pace."""
    jump(tracks, rng, hand, replace(manner, speed=2.0 * (1.0 if manner.speed is None else manner.speed)))


def _dips(times: list[float], z: list[list[float]]) -> tuple[list[float], list[float]]:
    """Keys of the depth of the dips, 0 .. 1."""
    depth = max(-state[0] for state in z)
    return times, [max(-state[0] / depth, 0.0) for state in z]


def jumping_jacks(tracks: MotionTracks, rng: np.random.Generator, hand: str, manner: Manner) -> None:
    """Feet apart with arms overhead, feet together with arms down, a hop between.

    Arms rise 5 to 35 degrees ahead of the body's side plane: wrists of three captured people (CMU 13_30 and 13_31,
    Animated Drawings) are 16 to 31 degrees ahead of the shoulders at their height.
    """
    t, sk = tracks.t, tracks.skeleton
    leg = sk.leg_length()
    quiet(tracks, rng, 0.7)
    half = rng.uniform(0.48, 0.64) / manner.pace if manner.rate is None else 30.0 / manner.rate
    half = min(half, float(t[-1]) / 3.7) if manner.rate is None else half
    flight = min(rng.uniform(0.34, 0.42) * half * manner.size**0.5, 0.5 * half, 0.3)
    take_off = 0.5 * GRAVITY * flight
    dip = rng.uniform(0.035, 0.06) * leg / 0.82
    together = rng.uniform(0.07, 0.1) * leg / 0.82
    apart = together + rng.uniform(0.2, 0.32) * min(manner.size, 1.3) * leg / 0.82
    down, up = rng.uniform(0.1, 0.3), np.radians(rng.uniform(150.0, 170.0) * min(manner.size**0.5, 1.05))
    start = -rng.uniform(0.0, 2.0) * half
    ground = half - flight
    count = int(np.ceil((t[-1] - start) / half)) + 2
    times: list[float] = []
    z: list[list[float]] = []
    pitch_t: list[float] = []
    pitch: list[list[float]] = []
    lift_t: list[float] = []
    lift: list[list[float]] = []
    place_t: list[float] = []
    place: list[int] = []
    airborne = np.zeros(tracks.n, bool)
    rise = 0.04 * leg / 0.82
    for k in range(count):
        a = start + k * half  # touch-down
        c = a + ground  # take-off
        times += [a, a + 0.5 * ground, c, c + 0.5 * flight]
        top = 0.125 * GRAVITY * flight**2
        z += [
            [rise, -take_off, -GRAVITY],
            [-dip, 0.0, 0.5 * GRAVITY],
            [rise, take_off, -GRAVITY],
            [rise + top, 0.0, -GRAVITY],
        ]
        on_toes = -np.radians(24.0)
        pitch_t += [a, a + 0.4 * ground, a + 0.6 * ground, c]
        pitch += [[on_toes, 0.0, 0.0], [0.3 * on_toes, 0.0, 0.0], [0.3 * on_toes, 0.0, 0.0], [on_toes, 0.0, 0.0]]
        _leave_floor(lift_t, lift, c, c + flight, take_off, take_off, 0.03 * leg, 0.0)
        place_t += [a, c]
        place += [k % 2, k % 2]
        airborne |= (t > c) & (t < c + flight)
    tracks.pelvis[:, 2] += hermite(t, times, z)
    spread = keys(t, place_t, place)
    feet_pitch, feet_lift = hermite(t, pitch_t, pitch), np.maximum(hermite(t, lift_t, lift), 0.0)
    tracks.contacts[:] = ~airborne[:, None]
    # the arms reach their ends just after touch-down
    wave = 0.5 - 0.5 * np.cos(np.pi * (t - start - 0.12 * half) / half)
    ahead = np.radians(rng.uniform(5.0, 35.0))
    for side in SIDES:
        foot = tracks.feet[side]
        sign = 1.0 if side == "left" else -1.0
        foot.place[:, 1] = sign * (together + spread * (apart - together))
        foot.pitch, foot.lift = feet_pitch, feet_lift
        foot.yaw = foot.yaw + sign * 0.12 * spread
        angle = down + (up - down) * wave * rng.uniform(0.97, 1.03)
        arm = tracks.arms[side]
        reach = np.sin(angle)
        arm.direction = np.stack([0.08 + np.sin(ahead) * reach, np.cos(ahead) * reach, -np.cos(angle)], axis=-1)
        arm.elbow = 0.12 + 0.25 * np.sin(np.pi * wave) + 0.02 * wander(t, rng, 1.0)
        tracks.hands[side].curl *= rng.uniform(0.2, 0.8)
        tracks.hands[side].pronation -= 0.3 * wave
    heights: FloatArray = tracks.pelvis[:, 2].copy()
    over_feet(tracks, ahead=0.09)
    tracks.pelvis[:, 2] = heights
    _airborne(tracks, 0.94)
