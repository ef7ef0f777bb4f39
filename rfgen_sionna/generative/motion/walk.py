"""Walking: back and forth with a stepped turn at each end, or straight ahead."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from scipy.integrate import cumulative_trapezoid

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.manner import Manner
from rfgen_sionna.generative.motion.balance import ride_height
from rfgen_sionna.generative.motion.curves import bump, cruise, ease, hermite, keys, wander
from rfgen_sionna.generative.motion.postures import relaxed
from rfgen_sionna.generative.motion.skeleton import JOINT, SIDES, side_sign
from rfgen_sionna.generative.motion.tracks import MotionTracks

STANCE = 0.62
"""Share of the gait cycle with the foot on the floor (Perry and Burnfield, Gait Analysis, 2nd ed. 2010)."""
WALK_RATIO = 0.0065
"""Step length over cadence [m/(steps/min)], near constant in adults (Sekiya et al. 1996)."""
BACK = 0.8
"""Least duration of the way back [s] in a motion that is long enough."""
SHORTEST_AHEAD = 0.45
"""Least duration of the way there in a short motion [s]."""
QUICKEST_TURN = 1.5
"""Shortest half turn [gait cycles]: three steps, as for healthy adults at their own pace."""
_MARGIN = 2.5
"""Extension of a path before and after the motion [s]: more than the longest gait cycle."""


@dataclass(frozen=True)
class LegCycle:
    """Gait cycle of one leg, in shares of the cycle."""

    lands: float
    """Touch-down, after that of the left leg of an even gait."""
    stance: float = STANCE
    """Time on the floor."""
    over: float = 0.26
    """Time from touch-down until the body passes over the foot."""
    push: float = 1.0
    """Rise of the heel in the push-off, of the usual one."""


EVEN: Mapping[str, LegCycle] = MappingProxyType({"left": LegCycle(0.0), "right": LegCycle(0.5)})
"""Gait of healthy people."""


@dataclass(frozen=True)
class WalkPath:
    """Densely sampled path of the body."""

    t: FloatArray
    """(m,) [s]."""
    x: FloatArray
    y: FloatArray
    heading: FloatArray
    """(m,) [rad]."""
    speed: FloatArray
    """(m,) [m/s]."""

    def at(self, t: FloatArray | float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """x, y [m] and heading [rad] at `t` [s]."""
        x, y, heading = (np.asarray(np.interp(t, self.t, c), np.float64) for c in (self.x, self.y, self.heading))
        return x, y, heading


def back_and_forth(
    end: float, speed: float, length: float, turn_time: float, sense: int, start: float, slow: float = 0.12
) -> WalkPath:
    """Straight lines of `length` [m] with half turns (`sense` +1 to the left) of `turn_time` [s] between.

    Time 0 is `start` [s] after the beginning of a line towards +x.
    """
    slowing = 0.3
    straight = length / speed
    t = np.arange(-_MARGIN, end + _MARGIN, 1.0 / 480.0)
    half = straight + turn_time
    first = np.floor((-_MARGIN + start) / half)
    heading = np.zeros_like(t)
    times, speeds = [t[0] + start - half], [1.0]
    for k in range(int(first) - 1, int((end + _MARGIN + start) / half) + 2):
        turn = k * half + straight
        heading += sense * np.pi * cruise((t + start - turn) / turn_time, 0.3)
        times += [turn - slowing, turn + 0.3 * turn_time, turn + 0.7 * turn_time, turn + turn_time + slowing]
        speeds += [1.0, slow, slow, 1.0]
    order = np.argsort(times, kind="stable")
    pace = speed * keys(t + start, np.asarray(times)[order].tolist(), np.asarray(speeds)[order])
    # begin towards +x
    heading -= heading[np.searchsorted(t, -start)] if start < _MARGIN else heading[0]
    x = cumulative_trapezoid(pace * np.cos(heading), t, initial=0.0)
    y = cumulative_trapezoid(pace * np.sin(heading), t, initial=0.0)
    inside = (t >= -start) & (t <= max(end, 2.0 * half - start))
    x -= 0.5 * (x[inside].min() + x[inside].max())
    y -= 0.5 * (y[inside].min() + y[inside].max())
    return WalkPath(t, x, y, heading, pace)


def straight(end: float, speed: float) -> WalkPath:
    """Path along +x at constant speed, through x = 0 at half time."""
    t = np.arange(-_MARGIN, end + _MARGIN, 1.0 / 480.0)
    still = np.zeros_like(t)
    return WalkPath(t, speed * (t - 0.5 * end), still, still, np.full_like(t, speed))


def own_pace(
    tracks: MotionTracks, rng: np.random.Generator, manner: Manner, usual: tuple[float, float] = (0.85, 1.35)
) -> tuple[float, float]:
    """A person's speed [m/s] and step length [m], from the leg length; `usual` speeds of an adult [m/s].

    The speed and the rate of `manner` are those of the person; its rate counts steps.
    """
    size = tracks.skeleton.leg_length() / 0.82
    pace = rng.uniform(*usual) * manner.pace * np.sqrt(size)
    own = rng.uniform(0.94, 1.06) * size**0.75
    if manner.rate is not None:
        step = WALK_RATIO * manner.rate * own if manner.speed_mps is None else 60.0 * manner.speed_mps / manner.rate
        return step * manner.rate / 60.0, step
    pace = pace if manner.speed_mps is None else manner.speed_mps
    # v = step * cadence and step = ratio * cadence * 60
    return pace, np.sqrt(WALK_RATIO * 60.0 * pace) * own


def walk(tracks: MotionTracks, rng: np.random.Generator, hand: str, manner: Manner) -> None:
    """Back and forth over 1 to 1.6 m, forwards first; shorter in short motions."""
    end = float(tracks.t[-1])
    pace, step = own_pace(tracks, rng, manner)
    period = 2.0 * step / pace
    length = rng.uniform(0.9, 1.5)
    turn_time = rng.uniform(2.1, 2.5) * period
    sense = 1 if rng.uniform() < 0.5 else -1
    ahead = length / pace * (1.0 - rng.uniform(0.0, 0.5))
    # short motions: shorten the way there, then the turn, to leave time for the way back
    missing = ahead + turn_time + BACK - end
    if missing > 0.0:
        ahead = max(ahead - missing, min(ahead, SHORTEST_AHEAD))
        turn_time = max(turn_time - max(ahead + turn_time + BACK - end, 0.0), QUICKEST_TURN * period)
    path = back_and_forth(end, pace, length, turn_time, sense, start=length / pace - ahead)
    gait(tracks, rng, path, pace, step)


def walk_straight(tracks: MotionTracks, rng: np.random.Generator, hand: str, manner: Manner) -> None:
    """Straight ahead for the whole duration."""
    pace, step = own_pace(tracks, rng, manner)
    gait(tracks, rng, straight(float(tracks.t[-1]), pace), pace, step)


def gait(
    tracks: MotionTracks,
    rng: np.random.Generator,
    path: WalkPath,
    pace: float,
    step: float,
    legs: Mapping[str, LegCycle] = EVEN,
) -> dict[str, FloatArray]:
    """Write the whole body's gait on a path, with speed `pace` [m/s] and step length `step` [m].

    Returns:
        (n,) phase of each leg's cycle from its touch-down, by side [rad].
    """
    t = tracks.t
    period = 2.0 * step / pace
    begin = rng.uniform(-period, 0.0)
    liveliness = np.interp(t, path.t, path.speed) / pace
    x, y, heading = path.at(t)
    relaxed(tracks, rng)
    phase: dict[str, FloatArray] = {}
    for side in SIDES:
        contact = begin + legs[side].lands * period
        phase[side] = 2.0 * np.pi * (t - contact) / period
        _feet(tracks, side, path, period, contact, step, legs[side], rng)
    left = phase["left"]
    middle = left - 2.0 * np.pi * 0.26
    lively = 0.35 + 0.65 * liveliness
    sway = rng.uniform(0.015, 0.028) * np.cos(middle)
    tracks.pelvis[:, 0] = x - sway * np.sin(heading)
    tracks.pelvis[:, 1] = y + sway * np.cos(heading)
    tracks.pelvis[:, 2] += rng.uniform(0.016, 0.022) * step / 0.65 * lively * np.cos(2.0 * middle)
    tracks.yaw = heading - np.radians(rng.uniform(3.0, 6.0)) * lively * np.cos(left)
    tracks.roll = np.radians(rng.uniform(2.0, 4.0)) * lively * np.cos(middle)
    tracks.pitch = np.radians(rng.uniform(1.0, 5.0)) * lively
    tracks.turn = np.radians(rng.uniform(5.0, 10.0)) * lively * np.cos(left)
    tracks.lean = -0.8 * tracks.roll
    turning = np.gradient(heading, t)
    tracks.look = np.clip(0.22 * turning, -0.6, 0.6) + wander(t, rng, 0.04) - 0.5 * tracks.turn
    tracks.nod = wander(t, rng, 0.02) + rng.uniform(-0.03, 0.08)
    swing, bent, lag = rng.uniform(0.25, 0.5), rng.uniform(0.25, 0.5), rng.uniform(0.0, 0.35)
    for side, other in zip(SIDES, SIDES[::-1], strict=True):
        arm = tracks.arms[side]
        forward = lively * swing * rng.uniform(0.85, 1.15) * np.cos(phase[other] - lag) + 0.05
        arm.direction = np.stack([np.sin(forward), np.full_like(t, rng.uniform(0.1, 0.2)), -np.cos(forward)], axis=-1)
        arm.elbow = bent + 0.25 * lively * (1.0 + np.sin(phase[other] - lag + 1.2))
        tracks.hands[side].flexion += 0.08 * np.cos(phase[other] - lag - 0.6)
    ride_height(tracks)
    return phase


def _feet(
    tracks: MotionTracks,
    side: str,
    path: WalkPath,
    period: float,
    contact: float,
    step: float,
    leg: LegCycle,
    rng: np.random.Generator,
) -> None:
    """Write one foot: planted as the body passes over, rolling from heel to toe, swinging between."""
    t, sk, s, i = tracks.t, tracks.skeleton, side_sign(side), SIDES.index(side)
    foot = tracks.feet[side]
    width = rng.uniform(0.5, 0.75) * abs(sk.offsets[JOINT["left_hip"], 1])
    toe_out, clearance = rng.uniform(0.05, 0.16), rng.uniform(0.018, 0.035)
    heel_up, toe_up = np.radians(rng.uniform(50.0, 62.0)), np.radians(rng.uniform(14.0, 22.0))
    ahead = sk.rest_positions()[JOINT[f"{side}_ankle"], 0] + 0.01
    first = int(np.floor((t[0] - contact) / period)) - 1
    count = int(np.ceil((t[-1] - contact) / period)) + 2 - first
    lands = contact + period * (first + np.arange(count + 1))
    # the body passes over the foot a quarter of a cycle after touch-down
    x, y, heading = path.at(np.asarray(lands + leg.over * period, np.float64))
    places = np.stack(
        [
            x + ahead * np.cos(heading) - s * width * np.sin(heading),
            y + ahead * np.sin(heading) + s * width * np.cos(heading),
        ],
        axis=-1,
    )
    yaws = heading + s * toe_out
    strides = np.linalg.norm(np.diff(places, axis=0), axis=-1) / (2.0 * step)
    reach = np.clip(0.25 + 0.75 * np.concatenate([strides, strides[-1:]]), 0.25, 1.0)
    times: list[float] = []
    states: list[list[float]] = []
    for k, land in enumerate(lands):
        before = toe_up * (reach[k - 1] - 0.25) / 0.75 if k else 0.0
        after = toe_up * (reach[k] - 0.25) / 0.75
        push = heel_up * leg.push * reach[k]
        for share, state in (
            (0.0, [before, -6.0 * before / period, 0.0]),
            (0.10, [0.0, 0.0, 0.0]),
            (0.30, [0.0, 0.0, 0.0]),
            (leg.stance, [-0.92 * push, -3.0 * push / period, 0.0]),
            (leg.stance + 0.07, [-push, 0.0, 0.0]),
            (leg.stance + 0.24, [0.0, 10.0 * after / period, 0.0]),
        ):
            times.append(land + share * period)
            states.append(state)
    foot.pitch = hermite(t, times, states)
    k = np.clip(np.floor((t - lands[0]) / period).astype(int), 0, count - 1)
    share = (t - lands[k]) / period
    swing = (share - leg.stance) / (1.0 - leg.stance)
    moved = cruise(swing, 0.42)[:, None]
    foot.place = places[k] + moved * (places[k + 1] - places[k])
    foot.yaw = yaws[k] + ease(swing) * (yaws[k + 1] - yaws[k])
    foot.lift = clearance * bump(swing) * (0.7 + 0.3 * reach[k])
    # the pivot changes to the heel in the air and back to the toes on the flat foot
    foot.heel = np.where(share < leg.stance, 1.0 - ease((share - 0.12) / 0.18), ease((swing - 0.45) / 0.35))
    tracks.contacts[:, i] = share <= leg.stance
