"""Ways over the floor for walks and runs of clips: straight, to and fro, round a circle, around a room, with pauses."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.motion.clip_editing import at_times, headings, scaled
from rfgen_sionna.generative.motion.curves import ease
from rfgen_sionna.generative.motion.jumps import GRAVITY
from rfgen_sionna.generative.motion.resampling import runs
from rfgen_sionna.generative.motion.rotations import continuous
from rfgen_sionna.generative.motion.walk import BACK, WalkPath, back_and_forth
from rfgen_sionna.records import Motion

_STEP = 0.5
"""Width of the smoothing that takes steps and sway out of a way [s]."""
_TURNING = 1.6
"""Length from which a way to and fro turns back [s]; shorter ones are its first part."""
_SLOW = 0.3
"""Share of the speed in a half turn of a walk at 1 m/s; slow walks slow down less."""
_CENTRIPETAL = 3.5
"""Acceleration towards the middle of a circle that the pace allows [m/s^2]; leaning by 20 degrees."""
_PIVOT = 0.5
"""Height about which a body leans [m]: the feet go around outside, the pelvis inside."""
_STOPPING = 0.8
"""Time from the pace to a stop [s]: one and a half steps."""
_SMALLEST = 0.12
"""Share of the usual steps under which the person stands."""
_FOOT_PERIOD = 1.1
"""Time of two steps where contacts leave it open [s]."""


@dataclass(frozen=True)
class Stops:
    """How far the pace goes down over time."""

    pace: FloatArray
    """(frame,) share of the pace, 0 in a stop."""

    @classmethod
    def drawn(cls, count: int, rate: float, rng: np.random.Generator, wanted: bool) -> Stops:
        """Stops of 0.8 to 2 s after 1.5 to 3.5 s of way each; at least one where it fits, none if not `wanted`."""
        pace, t = np.ones(count), np.arange(count) / rate
        at = rng.uniform(0.25, 0.6) * min(t[-1], 4.0) if wanted else np.inf
        while at + _STOPPING < t[-1]:
            rest = rng.uniform(0.8, 2.0)
            down = ease((t - at) / _STOPPING) - ease((t - at - _STOPPING - rest) / _STOPPING)
            pace *= 1.0 - down
            at += 2.0 * _STOPPING + rest + rng.uniform(1.5, 3.5)
        return cls(pace)


def straightened(motion: Motion) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The way of a gait as if it went straight along +x.

    Returns:
        (frame,) direction of the way, continuous [rad]; (frame, 2) places, turned back step by step [m]; (frame, 2) the
        same without steps and sway.
    """
    level = motion.translation[:, :2]
    course = _course(motion)
    step = np.diff(level, axis=0)
    angle = -0.5 * (course[1:] + course[:-1])
    c, s = np.cos(angle), np.sin(angle)
    turned = np.stack([c * step[:, 0] - s * step[:, 1], s * step[:, 0] + c * step[:, 1]], axis=-1)
    places = np.concatenate([np.zeros((1, 2)), np.cumsum(turned, axis=0)])
    return course, places, _smooth(places, _STEP * motion.frame_rate)


def _smooth(points: FloatArray, width: float) -> FloatArray:
    margin = min(int(4 * width), len(points) - 1)
    wide = np.pad(points, ((margin, margin), (0, 0)), mode="reflect", reflect_type="odd")
    return np.asarray(gaussian_filter1d(wide, width, axis=0, mode="nearest")[margin : margin + len(points)])


def own_way(motion: Motion) -> FloatArray:
    """(frame, 2) way of the pelvis without steps and sway [m]."""
    return _smooth(motion.translation[:, :2], _STEP * motion.frame_rate)


def own_speed(motion: Motion) -> float:
    """Mean speed along the way [m/s]."""
    _, _, middle = straightened(motion)
    return float(np.linalg.norm(np.diff(middle, axis=0), axis=1).sum() / max(motion.duration, 1e-9))


def gait_period(motion: Motion) -> float:
    """Time of two steps [s], from the contacts."""
    if motion.contacts is None:
        return _FOOT_PERIOD
    lands = [np.diff([a for a, _ in runs(motion.contacts[:, k])]) for k in range(2)]
    times = np.concatenate(lands) / motion.frame_rate
    return float(np.clip(np.median(times), 0.5, 2.5)) if len(times) else _FOOT_PERIOD


def floor_way(kind: str, end: float, speed: float, period: float, rng: np.random.Generator) -> WalkPath:
    """A way of a kind of :data:`~rfgen_sionna.generative.manner.PATHS` for `end` [s] at `speed` [m/s].

    It begins towards +x; its middle is the origin.
    """
    if kind == "to_and_fro" and end >= _TURNING:
        return _to_and_fro(end, speed, period, rng)
    t = np.arange(0.0, end + 1.0, 1.0 / 480.0)
    sense = 1 if rng.uniform() < 0.5 else -1
    if kind in ("straight", "to_and_fro"):
        heading = np.zeros_like(t)
    elif kind == "circle":
        widest = max(speed * end / (2.25 * np.pi), 0.4)  # around and a little more
        radius = max(min(rng.uniform(0.9, 1.6), widest), speed**2 / _CENTRIPETAL)
        heading = sense * speed * t / radius
    else:
        heading = sense * _loop(speed * t, speed * end, rng)
    x = np.cumsum(speed * np.cos(heading)) / 480.0
    y = np.cumsum(speed * np.sin(heading)) / 480.0
    inside = t <= end
    x -= 0.5 * (x[inside].min() + x[inside].max())
    y -= 0.5 * (y[inside].min() + y[inside].max())
    return WalkPath(t, x, y, heading, np.full_like(t, speed))


def _loop(gone: FloatArray, total: float, rng: np.random.Generator) -> FloatArray:
    """Headings along a rectangle with round corners, walked around once where the way is long enough [rad]."""
    corner = 0.4
    around = np.clip(total / rng.uniform(1.02, 1.1), 6.0, 14.0)
    straight = (around - 2.0 * np.pi * corner) / 2.0
    length = straight * rng.uniform(0.5, 0.62)
    sides = np.tile([length, straight - length], 64)
    start = -rng.uniform(0.2, 0.6) * length
    heading = np.zeros_like(gone)
    at = start
    for side in sides:
        at += side
        heading += 0.5 * np.pi * np.clip((gone - at) / (0.5 * np.pi * corner), 0.0, 1.0)
        at += 0.5 * np.pi * corner
        if at > gone[-1]:
            break
    return heading


def _to_and_fro(end: float, speed: float, period: float, rng: np.random.Generator) -> WalkPath:
    length = max(rng.uniform(0.8, 1.6) * speed, 0.45)
    if end > 8.0:
        length *= rng.uniform(1.0, 1.8)
    turn_time = rng.uniform(1.6, 2.1) * period
    sense = 1 if rng.uniform() < 0.5 else -1
    slow = float(np.clip(_SLOW / speed, _SLOW, 0.8))
    ahead = length / speed * (1.0 - rng.uniform(0.0, 0.4))
    missing = ahead + turn_time + BACK - end
    if missing > 0.0:
        ahead = max(ahead - missing, 0.3)
        turn_time = max(turn_time - max(ahead + turn_time + BACK - end, 0.0), 1.2 * period)
    return back_and_forth(end, speed, length, turn_time, sense, start=length / speed - ahead, slow=slow)


def along(motion: Motion, path: WalkPath, speed: float, size: float, stops: Stops) -> Motion:
    """The walk or run along a way.

    Args:
        motion: a gait of at least as many frames as `stops`, whose own way is left out.
        path: the way.
        speed: pace of the way [m/s].
        size: share of the gait's own steps that the pace needs.
        stops: where the pace goes down.
    """
    rate = motion.frame_rate
    phase = _sum(ease(stops.pace / 0.4), rate)
    gait = at_times(motion, phase)
    course, places, middle = straightened(motion)
    at = np.arange(len(middle)) / rate
    sway = np.stack([np.interp(phase, at, (places - middle)[:, k]) for k in range(2)], axis=-1)
    # the way goes on as the gait does, faster and slower
    pace = np.linalg.norm(np.gradient(middle, axis=0), axis=1) * rate
    gone = _sum(stops.pace * np.interp(phase, at, pace / max(pace.mean(), 1e-9)), rate)
    x, y, heading = path.at(gone)
    share = np.interp(gone, path.t, path.speed) / speed * stops.pace
    course = np.interp(phase, at, course)
    count = len(phase)
    steps = np.minimum(size * share, 1.3)
    legs = np.ones((count, len(motion.joint_names)))
    for k, name in enumerate(motion.joint_names):
        if name.endswith(("hip", "knee", "ankle", "foot")):
            legs[:, k] = steps
        elif name.endswith(("shoulder", "elbow")):
            legs[:, k] = 0.3 + 0.7 * np.minimum(steps, 1.0)
    gait = scaled(gait, legs, 1.0)
    turn = heading - course
    # who goes around leans inwards
    pull = speed * share * np.gradient(heading) * rate
    lean = np.arctan(gaussian_filter1d(pull, 0.3 * rate, mode="nearest") / GRAVITY)
    onto = Rotation.from_euler("ZX", np.stack([heading, -lean], axis=-1))
    pivot = np.array([0.0, 0.0, _PIVOT])
    own = np.column_stack([sway, gait.translation[:, 2]]) - pivot
    translation = onto.apply(own) + pivot + np.column_stack([x, y, np.zeros(count)])
    rotations = gait.rotations.copy()
    back = Rotation.from_rotvec((turn - heading)[:, None] * np.array([0.0, 0.0, 1.0]))
    rotations[:, 0] = (onto * back * Rotation.from_quat(rotations[:, 0])).as_quat()
    contacts = gait.contacts
    if contacts is not None:
        contacts = contacts | (steps < _SMALLEST)[:, None]
    return replace(gait, rotations=continuous(rotations), translation=translation, contacts=contacts)


def _sum(values: FloatArray, rate: float) -> FloatArray:
    """(frame,) integral over time of (frame,) values, from 0."""
    return np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]))]) / rate


def steady_part(motion: Motion, start: int, stop: int) -> tuple[int, int]:
    """First frame and end of the steady part of a gait, about that from `start` to `stop`: one pace, one direction."""
    step = np.gradient(own_way(motion), axis=0) * motion.frame_rate
    pace = np.linalg.norm(step, axis=1)
    usual = float(np.median(pace[start:stop]))
    along = np.median(step[start:stop], axis=0)
    along = along / max(float(np.linalg.norm(along)), 1e-9)
    steady = (pace > 0.7 * usual) & (pace < 1.4 * usual) & (step @ along > 0.7 * pace)
    for a, b in runs(steady):
        if a < stop and b > start:
            start, stop = min(a, start), max(b, stop)
            break
    return start, stop


def _course(motion: Motion) -> FloatArray:
    """(frame,) direction of a gait's own way, continuous [rad]; where it stands, its heading."""
    step = np.gradient(_smooth(motion.translation[:, :2], 0.5 * _STEP * motion.frame_rate), axis=0)
    facing = headings(motion)
    direction = np.arctan2(step[:, 1], step[:, 0])
    # the angle between way and heading changes slowly: sideways and backwards stay so
    offset = np.exp(1j * (direction - facing)) * np.linalg.norm(step, axis=1)
    smooth = gaussian_filter1d(offset, 1.0 * motion.frame_rate, mode="nearest")
    slow = gaussian_filter1d(facing, 0.5 * _STEP * motion.frame_rate, mode="nearest")
    return np.asarray(slow + np.unwrap(np.angle(smooth)), np.float64)
