"""Gestures from a few key places of the hands: one writer for all of them, spreads that the seed draws from.

Lengths are those of a mean adult and grow with the arm. Places and directions are those of the working hand, y
outwards; angles of the trunk are towards its side, or bring its shoulder ahead.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import CubicSpline

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.manner import Manner
from rfgen_sionna.generative.motion.balance import fit_height, over_feet
from rfgen_sionna.generative.motion.curves import ease, keys, wander
from rfgen_sionna.generative.motion.postures import quiet, relaxed
from rfgen_sionna.generative.motion.skeleton import FINGERS, MEAN_ADULT, SIDES, side_sign, soft_limit
from rfgen_sionna.generative.motion.tracks import ARM_POLE, MotionTracks

Range = tuple[float, float]
Place = tuple[Range, Range, Range]
Vector = tuple[float, float, float]

OPEN_HAND = np.array([[0.06, 0.06, 0.04]] * 4 + [[0.0, 0.05, 0.05]])
LOOSE_HAND = np.array([[0.3, 0.35, 0.2]] * 4 + [[0.1, 0.15, 0.15]])
GRIP = np.array([[0.85, 0.8, 0.45]] * 4 + [[0.3, 0.35, 0.3]])
FIST = np.array([[1.25, 1.45, 0.8]] * 4 + [[0.35, 0.45, 0.5]])
POINTING = np.array([[0.1, 0.1, 0.05]] + [[1.25, 1.45, 0.8]] * 3 + [[0.35, 0.45, 0.5]])
"""(finger, joint) flexions [rad] of a pointing index, as above of other hands, in the order of `FINGERS`."""

_BODY = ("turn", "bend", "lean", "nod", "look", "tilt", "pitch", "sink", "weight", "hangs")
"""What moves beside the hand: trunk and head [rad], pelvis down [m], share of the weight on the other foot, and whether
the arm hangs, 1."""
_ARM = MEAN_ADULT.length("left_elbow") + MEAN_ADULT.length("left_wrist")
_SLOWEST = 2.0
"""Factor on the usual time of a move beyond which a slower rhythm has rests instead."""
HERE: Place = ((0.0, 0.0), (0.0, 0.0), (0.0, 0.0))


@dataclass(frozen=True, eq=False)
class Key:
    """One key place of a cycle; directions and curl that are None are the gesture's."""

    seconds: Range
    """Time of the move to it [s]."""
    move: Place = HERE
    """From the gesture's place [m]; grows with the amplitude."""
    fingers: Vector | None = None
    palm: Vector | None = None
    curl: FloatArray | None = None
    body: Mapping[str, Range] = field(default_factory=dict)
    """Of `_BODY`, beside the gesture's own."""
    swift: bool = False
    """Whether it keeps its time at any pace, and much of its size: strikes."""


@dataclass(frozen=True, eq=False)
class KeyedGesture:
    """A cycle of key places of one hand or both."""

    keys: tuple[Key, ...]
    at: Place | None = HERE
    """Of the wrist in the frame of `anchor` [m]; None leaves the arms free."""
    anchor: str = "shoulder"
    fingers: Vector = (1.0, 0.0, 0.0)
    palm: Vector = (0.0, -1.0, 0.0)
    """Directions of the stretched fingers and of the palm in the axes of the chest."""
    curl: FloatArray = field(default_factory=lambda: LOOSE_HAND)
    pole: Vector = (-0.35, 0.6, -1.0)
    """Direction of the elbow."""
    other: str | Place = ""
    """The other hand: "" free, "hangs", "mirror" and "alternate" doing the same in step and in turn, or held at a
    place."""
    follow: float = 0.0
    """Share of the moves that a held hand makes too, as with a stick."""
    flows: bool = False
    """Whether the hand passes the keys without stopping, as in a swing."""
    rises: bool = True
    """Whether a longer motion may begin with hanging arms."""
    repeats: float = 0.0
    """Cycles that fit into the shortest motion: the rhythm is quicker then."""
    counted: int = 1
    """Repetitions that people count in one cycle."""
    body: Mapping[str, Range] = field(default_factory=dict)
    """Of `_BODY`, held throughout."""
    stagger: Range = (0.0, 0.0)
    """Distance of the other foot ahead of that of the working side [m]."""
    taps: float = 0.0
    """Movement of each finger by itself [rad]."""
    still: float = 1.0
    """Factor on the drift of the hand."""


ARM_HOLDS: Mapping[str, KeyedGesture] = {
    "on_hips": KeyedGesture(
        (Key((1.0, 2.0)),), ((-0.04, 0.02), (0.20, 0.225), (0.11, 0.16)), "pelvis", other="mirror", rises=False,
        fingers=(0.75, -0.6, -0.3), palm=(-0.5, -0.8, 0.0), pole=(-0.35, 1.0, -0.1), curl=LOOSE_HAND, still=0.2,
    ),
    "folded": KeyedGesture(
        (Key((1.0, 2.0)),), ((0.18, 0.21), (-0.08, -0.03), (-0.21, -0.16)), "chest", rises=False,
        other=((0.13, 0.16), (-0.07, -0.02), (-0.25, -0.21)), curl=GRIP,
        fingers=(-0.25, -1.0, 0.3), palm=(-1.0, 0.2, -0.2), pole=(-0.1, 0.5, -1.0), still=0.3,
    ),
    "clasped": KeyedGesture(
        (Key((1.0, 2.0)),), ((0.16, 0.2), (0.03, 0.06), (0.02, 0.2)), "pelvis", other="mirror", rises=False, curl=GRIP,
        fingers=(0.35, -1.0, -0.3), palm=(-1.0, -0.4, 0.0), pole=(-0.4, 1.0, -0.5), still=0.3,
    ),
    "behind_back": KeyedGesture(
        (Key((1.0, 2.0)),), ((-0.18, -0.15), (0.03, 0.07), (0.02, 0.1)), "pelvis", other="mirror", rises=False,
        fingers=(-0.1, -1.0, -0.4), palm=(-1.0, 0.1, 0.0), pole=(-0.6, 1.0, 0.2), still=0.2,
    ),
    "in_pockets": KeyedGesture(
        (Key((1.0, 2.0)),), ((0.02, 0.07), (0.19, 0.215), (0.02, 0.06)), "pelvis", other="mirror", rises=False,
        fingers=(0.35, -0.25, -1.0), palm=(0.0, -1.0, 0.2), pole=(-1.0, 0.6, -0.1), still=0.2,
    ),
}  # fmt: skip
"""Postures of arms that an action leaves free, beside "hanging"; lengths as above."""
_HABITS = {
    1: {"": 0.72, "in_pockets": 0.14, "on_hips": 0.1, "behind_back": 0.04},
    2: {"": 0.6, "clasped": 0.14, "in_pockets": 0.08, "folded": 0.07, "behind_back": 0.06, "on_hips": 0.05},
}
"""How often people hold one free arm, or two, in some way: of the idle people in the library's clips (idle_*) a quarter
clasp or fold their hands; those of one arm are estimates."""


def perform(
    tracks: MotionTracks,
    rng: np.random.Generator,
    hand: str,
    manner: Manner,
    what: KeyedGesture | tuple[KeyedGesture, ...],
    side: str | None = None,
) -> None:
    """Write a gesture of a standing person, one of several if there are; with the hand of `side` if it has one."""
    if isinstance(what, tuple):
        what = what[rng.integers(len(what))]
    hand = side or hand
    t, s = tracks.t, side_sign(hand)
    relaxed(tracks, rng)
    quiet(tracks, rng)
    ahead = 0.5 * s * rng.uniform(*what.stagger)
    for side in SIDES:
        tracks.feet[side].place[:, 0] -= side_sign(side) * ahead
    # draws of a rhythm depend on the length of the motion: they have a generator of their own
    times, states, total = _cycles(np.random.default_rng(rng.integers(1 << 62)), what, manner, float(t[-1]))
    hanging, begin, lasts = rng.uniform() < 0.5, rng.uniform(0.1, 0.5), rng.uniform(0.8, 1.4) / manner.pace
    rise = ease((t - begin) / lasts) if what.rises and hanging and t[-1] >= 4.0 else np.ones_like(t)
    held = {name: rng.uniform(*what.body.get(name, (0.0, 0.0))) for name in _BODY}
    swings = [(hand, _between(t, times, states, what.flows), s)]
    other = SIDES[1 - SIDES.index(hand)]
    if what.other == "mirror":
        lag = np.clip(rng.normal(0.0, 0.012), -0.03, 0.03)
        swings.append((other, _between(t + lag, times, states, what.flows), 0))
    elif what.other == "alternate":
        swings.append((other, _between(t + 0.5 * total, times, states, what.flows), -s))
    at = _drawn(rng, what.at or HERE)
    weight = 0.5 + np.clip(rng.normal(0.0, 0.1) + wander(t, rng, rng.uniform(0.0, 0.06), 0.05, 0.2), -0.3, 0.3)
    for side, state, sign in swings:
        moved = dict(zip(_BODY, state[:, 9 : 9 + len(_BODY)].T, strict=True))
        if what.at is not None:
            _put(tracks, rng, side, what, state, rise * (1.0 - moved["hangs"]), at)
        if side == hand:
            moved = {name: moved[name] + held[name] for name in _BODY}
        _move_body(tracks, moved, sign, side == hand or sign != 0)
        weight -= 0.5 * sign * moved["weight"]
    if not isinstance(what.other, str):
        state = swings[0][1].copy()
        state[:, :3] *= what.follow * np.array([1.0, -1.0, 1.0])
        _put(tracks, rng, other, what, state, rise, _drawn(rng, what.other))
    elif not what.other:
        free = SIDES if what.at is None else (other,)
        names, odds = zip(*_HABITS[len(free)].items(), strict=True)
        if (habit := str(rng.choice(names, p=odds))) in ARM_HOLDS:
            hold_arms(tracks, rng, habit, free)
    over_feet(tracks, np.clip(weight, 0.1, 0.9))
    fit_height(tracks)


def _move_body(tracks: MotionTracks, moved: Mapping[str, FloatArray], sign: int, level: bool) -> None:
    """Trunk, head and pelvis of one hand's states: what leans to a side by `sign` of its side, 1 the left, the rest if
    `level`."""
    tracks.yaw -= 0.3 * sign * moved["turn"]  # hips and spine share it
    tracks.turn -= 0.7 * sign * moved["turn"]
    tracks.lean -= sign * moved["lean"]
    tracks.tilt -= sign * moved["tilt"]
    tracks.look += sign * moved["look"]
    if level:
        tracks.bend += moved["bend"]
        tracks.nod += moved["nod"]
        tracks.pitch += moved["pitch"]
        tracks.pelvis[:, 2] -= moved["sink"]


def hold_arms(tracks: MotionTracks, rng: np.random.Generator, posture: str, sides: Sequence[str]) -> None:
    """Arms of `sides` in one of `ARM_POSTURES`, or with clasped hands."""
    if posture in ARM_HOLDS:
        what = ARM_HOLDS[posture]
        at = _drawn(rng, what.at or HERE)
        for side in sides:
            own = at if side == "right" or isinstance(what.other, str) else _drawn(rng, what.other)
            _put(tracks, rng, side, what, _still(what, tracks.n), np.ones(tracks.n), own)
        return
    for side in sides:
        arm = tracks.arms[side]
        arm.target, tracks.hands[side].aim = None, None
        for track in (arm.direction, arm.elbow):
            middle = track.mean(axis=0)
            track[:] = middle + 0.15 * (track - middle)


def _drawn(rng: np.random.Generator, place: Place) -> FloatArray:
    return np.array([rng.uniform(*each) for each in place])


def _still(what: KeyedGesture, n: int) -> FloatArray:
    return np.tile(_state(what, what.keys[0], np.random.default_rng(0)), (n, 1))


def _state(what: KeyedGesture, key: Key, rng: np.random.Generator) -> FloatArray:
    """(k,) move, directions of fingers and palm, body, curls."""
    body = [rng.uniform(*key.body.get(name, (0.0, 0.0))) for name in _BODY]
    curl = what.curl if key.curl is None else key.curl
    return np.concatenate(
        [
            [rng.uniform(*each) for each in key.move],
            what.fingers if key.fingers is None else key.fingers,
            what.palm if key.palm is None else key.palm,
            body,
            curl.ravel(),
        ]
    )


def _times(what: KeyedGesture, rng: np.random.Generator, manner: Manner, end: float) -> FloatArray:
    """(k + 1,) times of the moves to each key, and of a rest in the last one [s]."""
    swift = np.array([key.swift for key in what.keys])
    seconds = np.array([rng.uniform(*key.seconds) for key in what.keys])
    seconds = np.where(swift, seconds, seconds / manner.pace)
    total = seconds.sum()
    if manner.rate is not None:
        wanted = 60.0 * what.counted / manner.rate
    else:
        wanted = min(total, end / what.repeats) if what.repeats else total
    slow = seconds[~swift].sum()
    if wanted > total or slow > 0.5 * total:
        factor = np.clip((wanted - (total - slow)) / max(slow, 1e-9), 0.4, _SLOWEST)
        seconds = np.where(swift, seconds, factor * seconds)
    seconds *= min(wanted / seconds.sum(), 1.0)
    return np.append(seconds, wanted - seconds.sum())


def _cycles(
    rng: np.random.Generator, what: KeyedGesture, manner: Manner, end: float
) -> tuple[list[float], FloatArray, float]:
    """Times [s] and states of repeated keys with a personal rhythm, and the length of a cycle [s]."""
    seconds = _times(what, rng, manner, end)
    values = [_state(what, key, rng) for key in what.keys]
    total = float(seconds.sum())
    uneven = 0.08 if manner.rate is None else 0.03
    # the first key and what follows it are within the motion
    spare = end - (1.0 + uneven) * float(seconds[:2].sum())
    first = rng.uniform(0.0, min(spare, total)) if spare > 0.0 else rng.uniform(0.3, 0.7) * spare
    strikes = [key.swift for key in what.keys]
    steps = list(zip(seconds, [*values, values[-1]], [*strikes, strikes[-1]], strict=True))
    steps = steps if seconds[-1] > 1e-6 else steps[:-1]
    scaled = np.zeros(len(values[0]), bool)
    scaled[:3], scaled[9 : 9 + _BODY.index("hangs")] = True, True
    before = 1 + int(np.ceil(max(first, 0.0) / total))
    tempos = rng.uniform(1.0 - uneven, 1.0 + uneven, before + 2 + int((end + total) / ((1.0 - uneven) * total)))
    clock = first - total * tempos[:before].sum()
    times, states = [clock - 1e-3], [np.where(scaled, manner.size, 1.0) * values[-1]]
    for tempo in tempos:
        size = manner.size * rng.uniform(0.93, 1.07)
        for step, value, strike in steps:
            clock += step * tempo
            times.append(clock)
            states.append(np.where(scaled, np.sqrt(size) if strike else size, 1.0) * value)
    return times, np.array(states), total


def _between(t: FloatArray, times: list[float], states: FloatArray, flows: bool) -> FloatArray:
    if not flows:
        return keys(t, times, states)
    curve: FloatArray = CubicSpline(times[1:], states[1:])(np.maximum(t, times[1]))
    return curve


def _put(
    tracks: MotionTracks,
    rng: np.random.Generator,
    side: str,
    what: KeyedGesture,
    state: FloatArray,
    raised: FloatArray,
    at: FloatArray,
) -> None:
    """Hand, wrist and fingers of one side from the states of a gesture around the place `at` (3,) [m]."""
    arm, palm, t, sk = tracks.arms[side], tracks.hands[side], tracks.t, tracks.skeleton
    at = at + 0.008 * what.still * rng.normal(size=3)
    drift = what.still * np.stack([wander(t, rng, 0.006, 0.1, 1.0) for _ in range(3)], axis=-1)
    reach = sk.length(f"{side}_elbow") + sk.length(f"{side}_wrist")
    target = (at + state[:, :3] + drift) * reach / _ARM
    if what.anchor == "shoulder":
        distance = np.linalg.norm(target, axis=-1)
        longest = rng.uniform(0.955, 0.99) * reach
        target *= (soft_limit(distance, longest, 0.05) / np.maximum(distance, 1e-6))[:, None]
    arm.target, arm.target_weight, arm.anchor = target, raised, what.anchor
    pole = np.array(what.pole) * [1.0, rng.uniform(0.7, 1.3), 1.0]
    arm.pole = ARM_POLE + raised[:, None] * (pole - ARM_POLE)
    tilted = np.array([rng.normal(0.0, 0.1) for _ in range(3)])
    aim = state[:, 3:9].reshape(-1, 2, 3)
    palm.aim = aim + np.cross(tilted, aim) + np.stack([wander(t, rng, 0.03) for _ in range(3)], axis=-1)[:, None]
    curl = state[:, -5 * 3 :].reshape(-1, 5, 3) * rng.uniform(0.85, 1.1)
    if what.taps:
        for k in range(len(FINGERS)):
            curl[:, k, 0] += what.taps * wander(t, rng, 1.0, 1.5, 5.0)
    palm.curl = palm.curl + raised[:, None, None] * (curl - palm.curl)
