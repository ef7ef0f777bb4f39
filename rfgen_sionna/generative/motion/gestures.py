"""Gestures of one hand in front of the body: swipes, push, pull, circles, click, finger swing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.manner import Manner
from rfgen_sionna.generative.motion.curves import keys, wander
from rfgen_sionna.generative.motion.postures import quiet, relaxed, stand_up_straight
from rfgen_sionna.generative.motion.skeleton import FINGERS, side_sign
from rfgen_sionna.generative.motion.tracks import GESTURE_POLE, MotionTracks

OPEN_HAND = np.array([[0.06, 0.06, 0.04]] * 4 + [[0.0, 0.05, 0.05]])
FIST = np.array([[1.25, 1.45, 0.8]] * 4 + [[0.35, 0.45, 0.5]])
POINTING = np.array([[0.1, 0.1, 0.05]] + [[1.25, 1.45, 0.8]] * 3 + [[0.35, 0.45, 0.5]])
"""(finger, joint) flexions [rad] of a pointing index, as above of an open hand and a fist, in the order of
`FINGERS`."""


def _ready(tracks: MotionTracks, rng: np.random.Generator, hand: str) -> float:
    """Quiet standing with the working arm's elbow down; returns the arm's reach [m]."""
    relaxed(tracks, rng)
    quiet(tracks, rng, 0.9)
    sk, arm = tracks.skeleton, tracks.arms[hand]
    arm.pole = np.tile(GESTURE_POLE * [1.0, rng.uniform(0.7, 1.4), 1.0], (tracks.n, 1))
    tracks.look[:] += side_sign(hand) * rng.uniform(-0.05, 0.1)
    return sk.length(f"{hand}_elbow") + sk.length(f"{hand}_wrist")


def _wrist(tracks: MotionTracks, hand: str, from_shoulder: FloatArray, reach: float) -> None:
    """Place the wrist at (n, 3) from the shoulder, in units of the arm's reach, in the chest's frame (y outwards)."""
    a, b = (tracks.skeleton.length(f"{hand}_{j}") for j in ("elbow", "wrist"))
    d = np.clip(np.linalg.norm(from_shoulder, axis=-1) * reach, abs(a - b) + 0.02, 0.985 * reach)
    tracks.arms[hand].direction = from_shoulder
    tracks.arms[hand].elbow = np.arccos(np.clip((d**2 - a**2 - b**2) / (2.0 * a * b), -1.0, 1.0))


def _repeat(
    t: FloatArray,
    rng: np.random.Generator,
    durations: Sequence[float],
    values: Sequence[Sequence[float]],
    manner: Manner,
) -> FloatArray:
    """(n, d) values of repeated key poses (k, d) with a personal rhythm; `durations` [s] are of the move to each
    key."""
    total = sum(durations) / manner.pace
    clock = -rng.uniform(0.0, 1.0) * total
    times, states = [clock - 1e-3], [np.asarray(values[-1], float)]
    while times[-1] <= t[-1]:
        tempo, size = rng.uniform(0.92, 1.08), rng.uniform(0.93, 1.07)
        centre = np.mean(values, axis=0)
        for duration, value in zip(durations, values, strict=True):
            clock += duration * tempo / manner.pace
            times.append(clock)
            states.append(centre + size * (np.asarray(value, float) - centre))
    return keys(t, times, np.array(states))


def _drift(tracks: MotionTracks, rng: np.random.Generator, size: float = 0.012) -> FloatArray:
    return np.stack([wander(tracks.t, rng, size, 0.15, 1.2) for _ in range(3)], axis=-1)


def swipe(tracks: MotionTracks, rng: np.random.Generator, hand: str, manner: Manner, towards: int) -> None:
    """A quick stroke of the open hand across the body; `towards` is +1 for the person's left."""
    reach = _ready(tracks, rng, hand)
    s = side_sign(hand)
    width, level = rng.uniform(0.75, 1.0), rng.uniform(-0.35, -0.12)
    middle = -0.08  # across the body, + on the hand's side
    end, begin = middle + 0.5 * width * s * towards, middle - 0.5 * width * s * towards
    forward = rng.uniform(0.55, 0.68)
    back = forward - rng.uniform(0.08, 0.2)
    stroke, pause, again = rng.uniform(0.3, 0.45), rng.uniform(0.12, 0.3), rng.uniform(0.65, 0.95)
    values = [
        (forward, end, level, 1.0),
        (forward - 0.04, end, level - 0.03, 1.0),
        (back, 0.5 * (begin + end), level - rng.uniform(0.1, 0.22), 0.3),
        (forward, begin, level, 1.0),
        (forward, begin, level, 1.0),
    ]
    state = _repeat(tracks.t, rng, (stroke, pause, 0.55 * again, 0.55 * again, 0.5 * pause), values, manner)
    _wrist(tracks, hand, state[:, :3] + _drift(tracks, rng), reach)
    wrist = tracks.hands[hand]
    flat = state[:, 3]
    # the palm faces the stroke: neutral inwards, pronated outwards
    inwards = -s * towards
    wrist.pronation[:] = (0.15 if inwards > 0 else 1.0) + rng.uniform(-0.15, 0.15)
    across = (state[:, 1] - middle) / (0.5 * width)
    wrist.flexion = -0.1 + 0.25 * across * (1 if inwards > 0 else 0.6)
    wrist.deviation = 0.1 + wander(tracks.t, rng, 0.02)
    wrist.curl = OPEN_HAND * rng.uniform(0.5, 2.0) + 0.35 * (1.0 - flat)[:, None, None] * (FIST - OPEN_HAND) * 0.5
    tracks.turn += 0.12 * s * across * rng.uniform(0.5, 1.2)
    stand_up_straight(tracks)


def _to_and_fro(
    tracks: MotionTracks,
    rng: np.random.Generator,
    hand: str,
    manner: Manner,
    reaches: Sequence[tuple[float, float]],
    times: Sequence[tuple[float, float]],
    drawn_in: tuple[float, float],
    grip: Sequence[float],
) -> tuple[FloatArray, FloatArray]:
    """(n,) grip and (n,) nearness (0 far .. 1 near) of a repeated reach of the hand in front of the body.

    `reaches` are ranges of near, far, level and side of the wrist from the shoulder [arm's reach], `times` of out, held
    far, back and held near [s]; `drawn_in` offsets the near position outwards and downwards.
    """
    reach = _ready(tracks, rng, hand)
    near, far, level, side = (rng.uniform(*between) for between in reaches)
    durations = [rng.uniform(*between) for between in times]
    out, back = (far, side, level), (near, side + drawn_in[0], level - drawn_in[1])
    values = [(*place, closed) for place, closed in zip((out, out, back, back), grip, strict=True)]
    state = _repeat(tracks.t, rng, durations, values, manner)
    _wrist(tracks, hand, state[:, :3] + _drift(tracks, rng), reach)
    return state[:, 3], (far - state[:, 0]) / (far - near)


def push(tracks: MotionTracks, rng: np.random.Generator, hand: str, manner: Manner) -> None:
    """The palm moves forwards quickly and back slowly."""
    reaches = (0.34, 0.44), (0.88, 0.95), (-0.25, 0.0), (-0.2, 0.1)
    times = (0.3, 0.42), (0.15, 0.35), (0.7, 1.0), (0.1, 0.35)
    out, _ = _to_and_fro(tracks, rng, hand, manner, reaches, times, (0.06, 0.06), (1.0, 1.0, 0.0, 0.0))
    wrist = tracks.hands[hand]
    wrist.pronation = 1.2 + 0.1 * out + rng.uniform(-0.1, 0.05)
    wrist.flexion = -0.75 - 0.3 * out + rng.uniform(-0.06, 0.1)
    wrist.curl = np.broadcast_to(OPEN_HAND * rng.uniform(0.5, 1.8), (tracks.n, 5, 3)).copy()
    tracks.turn += -0.1 * side_sign(hand) * out * rng.uniform(0.6, 1.4)
    tracks.pitch += 0.04 * out
    stand_up_straight(tracks)


def pull(tracks: MotionTracks, rng: np.random.Generator, hand: str, manner: Manner) -> None:
    """The hand reaches out slowly, grasps, and moves to the body quickly."""
    reaches = (0.34, 0.45), (0.86, 0.94), (-0.35, -0.1), (-0.15, 0.1)
    times = (0.75, 1.1), (0.18, 0.3), (0.32, 0.45), (0.15, 0.4)
    grip, nearness = _to_and_fro(tracks, rng, hand, manner, reaches, times, (0.12, 0.15), (0.0, 1.0, 1.0, 0.3))
    closed, wrist = np.clip(grip, 0.0, 1.0)[:, None, None], tracks.hands[hand]
    wrist.pronation[:] = rng.uniform(0.2, 0.9)
    wrist.flexion = -0.15 + 0.2 * closed[:, 0, 0]
    wrist.curl = OPEN_HAND + closed * (FIST - OPEN_HAND) * 0.92
    tracks.turn += 0.12 * side_sign(hand) * nearness * rng.uniform(0.5, 1.2)
    tracks.pitch -= 0.03 * nearness
    stand_up_straight(tracks)


def circle(tracks: MotionTracks, rng: np.random.Generator, hand: str, manner: Manner, clockwise: bool) -> None:
    """Circles of the hand in a plane in front of the body; the sense is from the person's view."""
    reach = _ready(tracks, rng, hand)
    s, t = side_sign(hand), tracks.t
    period = rng.uniform(1.0, 1.6) / manner.pace
    radius, flat = rng.uniform(0.26, 0.36), rng.uniform(0.85, 1.1)
    angle = 2.0 * np.pi * (t / period + rng.uniform()) + 0.25 * wander(t, rng, 1.0, 0.1, 0.4)
    # from the person's view; right is -y in the world, -s outwards
    right = np.sin(angle) if clockwise else -np.sin(angle)
    up = np.cos(angle)
    forward = rng.uniform(0.6, 0.7)
    centre = np.array([forward, rng.uniform(-0.2, 0.05), rng.uniform(-0.3, -0.12)])
    size = radius * (1.0 + 0.05 * wander(t, rng, 1.0))
    path = np.stack([-0.08 * up * radius, -s * right * size * flat, up * size], axis=-1)
    _wrist(tracks, hand, centre + path + _drift(tracks, rng, 0.008), reach)
    wrist = tracks.hands[hand]
    wrist.pronation[:] = rng.uniform(0.6, 1.2)
    wrist.flexion = 0.1 - 0.15 * up
    wrist.curl = np.broadcast_to(POINTING if rng.uniform() < 0.5 else OPEN_HAND * 3.0, (tracks.n, 5, 3)).copy()
    tracks.turn += -0.05 * right
    stand_up_straight(tracks)


def click(tracks: MotionTracks, rng: np.random.Generator, hand: str, manner: Manner) -> None:
    """The index finger taps forwards and down; the hand follows slightly."""
    reach = _ready(tracks, rng, hand)
    spot = np.array([rng.uniform(0.6, 0.75), rng.uniform(-0.2, 0.05), rng.uniform(-0.3, -0.1)])
    press, lift, wait = rng.uniform(0.12, 0.18), rng.uniform(0.16, 0.24), rng.uniform(0.3, 0.7)
    state = _repeat(tracks.t, rng, (press, 0.06, lift, wait), [(1.0,), (1.0,), (0.0,), (0.0,)], manner)
    tap = state[:, 0]
    poke = rng.uniform(0.02, 0.06)
    _wrist(
        tracks,
        hand,
        spot + np.stack([poke * tap, 0.0 * tap, -0.3 * poke * tap], axis=-1) + _drift(tracks, rng, 0.006),
        reach,
    )
    wrist = tracks.hands[hand]
    wrist.pronation[:] = rng.uniform(1.0, 1.3)
    wrist.flexion = -0.3 + rng.uniform(0.08, 0.2) * tap
    curl = np.broadcast_to(POINTING, (tracks.n, 5, 3)).copy()
    bend, knuckle = rng.uniform(0.5, 0.75), rng.uniform(0.55, 0.8)
    curl[:, FINGERS.index("index"), 0] = -0.15 + knuckle * tap
    curl[:, FINGERS.index("index"), 1] = 0.2 + bend * tap
    curl[:, FINGERS.index("index"), 2] = 0.1 + 0.5 * bend * tap
    wrist.curl = curl
    stand_up_straight(tracks)


def finger_swing(tracks: MotionTracks, rng: np.random.Generator, hand: str, manner: Manner) -> None:
    """The raised index finger swings from side to side, from wrist and knuckle."""
    reach = _ready(tracks, rng, hand)
    t = tracks.t
    # elbow tucked in: upright forearm
    tracks.arms[hand].pole = np.tile([-0.35, 0.15, -1.0], (tracks.n, 1))
    spot = np.array([rng.uniform(0.45, 0.55), rng.uniform(0.0, 0.2), rng.uniform(0.0, 0.15)])
    _wrist(tracks, hand, spot + _drift(tracks, rng, 0.006), reach)
    rate = rng.uniform(1.3, 2.2) * manner.pace
    angle = 2.0 * np.pi * (rate * t + rng.uniform()) + 0.3 * wander(t, rng, 1.0, 0.1, 0.5)
    size = rng.uniform(0.8, 1.15) * (1.0 + 0.08 * wander(t, rng, 1.0))
    wag = size * np.sin(angle)
    wrist = tracks.hands[hand]
    wrist.pronation[:] = rng.uniform(1.05, 1.3)
    wrist.flexion[:] = rng.uniform(-0.2, 0.0)
    wrist.deviation = -0.1 + np.radians(14.0) * wag
    curl = np.broadcast_to(POINTING, (tracks.n, 5, 3)).copy()
    curl[:, FINGERS.index("index"), :2] += (0.05 * np.cos(angle))[:, None]
    wrist.curl = curl
    wrist.spread[:, FINGERS.index("index")] = np.radians(13.0) * size * np.sin(angle - 0.4)
    stand_up_straight(tracks)
