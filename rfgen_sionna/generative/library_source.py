"""Motion from the clips of the motion library: a window by action and seed, cut, joined and varied to a length."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from types import MappingProxyType

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.action_definitions.sampled_series import period
from rfgen_sionna.generative.manner import Manner
from rfgen_sionna.generative.motion.clip_editing import (
    at_pace,
    cut,
    flights,
    held,
    joined,
    likeness,
    mirrored,
    pose_features,
    reversed_in_time,
    scaled,
    sway,
)
from rfgen_sionna.generative.motion.floor_ways import (
    Stops,
    along,
    floor_way,
    gait_period,
    own_speed,
    own_way,
    steady_part,
)
from rfgen_sionna.generative.motion.skeleton import JOINT_NAMES, NUM_BODY_JOINTS
from rfgen_sionna.generative.motion_library import LibraryClip, MotionLibrary
from rfgen_sionna.generative.prompts.prompt_error import PromptError
from rfgen_sionna.generative.repertoire import HELD, JUMPS, ONCE, OWN_PATHS, SIDED, WAYS, Window, windows
from rfgen_sionna.records import Motion

RATE = 20.0
"""Poses per second of clips [Hz]."""
PACES, SIZES = (0.85, 1.2), (0.9, 1.15)
"""Factors on the pace and the size of a clip that seeds draw."""
_UNEVEN = 0.05
"""Standard deviation of the difference in size between left and right."""
_TAIL = 3.0
"""Longest time before the end of a motion in which another clip may go on [s]."""
_DROPPED = 0.03
"""What a second that a join leaves out adds to the distance of its poses [m]."""
_ALIKE = 0.09
"""Distance of poses up to which a clip goes on as itself [m]; beyond, other clips are tried."""
_LEAST = 0.4
"""Shortest part that a joined clip adds [s]."""
_STILL = 0.35
"""Mean speed of joints up to which a person may stay in a pose [m/s]."""


_RATIOS = (0.5, 1.7)
"""Factors on the speed over the floor of a clip."""
_PERIODIC = 0.6
"""Autocorrelation from which a movement is one that goes on, such as waving, and not one after the other."""
_PACE_LIMITS = (0.5, 1.8)
"""Factors on the pace of a clip for a rate."""
_SHORTEST_WAY = 3.1
"""Way of a walk that turns back or goes around [m]."""
_FASTEST_ROUND = 2.9
"""Fastest run around, unless a speed is given [m/s]: the radius of its circle stays under 2.5 m."""
_SLOWEST_RUN = 2.2
"""Slowest mean speed of a run [m/s]."""
_FASTEST_HOP = 1.6
"""Fastest speed of a clip of hops [m/s]; faster ones are runs with a hop."""
_SLOWEST_CLIP = 1.6
"""Slowest speed of a clip of a run [m/s]; slower ones hardly leave the floor."""
_ROOM = 4.0
"""Longest way of a clip that is taken as it is [m]."""
_GAITS = MappingProxyType(
    {"walk": "walk_straight", "walk_to_and_fro": "walk_straight", "walk_in_a_circle": "walk_straight"}
)
"""Actions whose ways are made from clips of another one."""
_LEGS = ("hip", "knee", "ankle", "foot")
_ARMS = ("collar", "shoulder", "elbow", "wrist")
_TRUNK = ("spine", "neck", "head")


@dataclass(frozen=True)
class Draft:
    """A motion of clips, on the skeleton and at the rate of the library."""

    motion: Motion
    clips: tuple[str, ...]
    on_its_way: bool = False
    """Whether it has its place already: on a way about the origin."""


@cache
def library() -> MotionLibrary:
    """The shipped library."""
    return MotionLibrary()


@cache
def _clip(name: str) -> LibraryClip:
    return next(clip for clip in library() if clip.name == name)


def draft(action: str, duration: float, rng: np.random.Generator, manner: Manner, strength: float) -> Draft:
    """A motion of an action from clips.

    Args:
        action: one that :func:`~rfgen_sionna.generative.repertoire.windows` has.
        duration: at least this long [s].
        rng: of all choices.
        manner: how the action is done.
        strength: 1 for the usual variation of pace, size and evenness, 0 for none.
    """
    window, mirror = choose(action, rng, manner, duration, strength)
    pace = manner.pace * float(rng.uniform(*PACES) ** strength)
    size = manner.size * float(rng.uniform(*SIZES) ** strength)
    uneven = strength * float(np.clip(rng.normal(0.0, _UNEVEN), -2.0 * _UNEVEN, 2.0 * _UNEVEN))
    if action in JUMPS:
        pace /= np.sqrt(size)  # a flight of half the height takes 0.7 of the time
    count = int(np.ceil(duration * RATE - 1e-9)) + 1
    names = [window.clip]
    if action in ONCE:
        motion = _once(_edited(window, mirror, pace), _span(window, pace), count, rng)
        return Draft(_resized(motion, action, size, uneven), tuple(names))
    path = way_of(action, manner, window.speed * pace * duration) if strength > 0.0 else None
    if path is None:
        if manner.rate is None:
            motion = _repeated(action, window, mirror, pace, count, rng, names)
        else:
            motion = _at_rate(action, window, mirror, 60.0 / manner.rate, count, rng, names)
        return Draft(_resized(motion, action, size, uneven), tuple(dict.fromkeys(names)))
    if manner.rate is not None:  # steps
        pace = manner.rate / 120.0 * gait_period(_plain(window.clip))
        _check_pace(pace, manner.rate, action)
    own = [each.speed for each in windows().get(action, ()) if action in OWN_PATHS and action in _GAITS]
    asked = manner.speed_mps
    if asked is None and own:
        asked = float(own[int(rng.integers(len(own)))] * rng.uniform(*PACES)) * manner.pace * manner.size
        asked = max(asked, min(_SHORTEST_WAY / duration, 1.5))
    elif asked is None and action in ("run", "run_backwards"):
        fastest = _FASTEST_ROUND if path in ("circle", "loop") else np.inf
        asked = min(max(window.speed * pace * size, _SLOWEST_RUN if action == "run" else 0.0), fastest)
    if asked is not None:
        # half of the change of speed by cadence, half by the length of the steps
        ratio = asked / max(window.speed, 0.05)
        pace, size = float(np.sqrt(ratio)), float(np.sqrt(ratio))
        if manner.speed_mps is not None and not _RATIOS[0] <= ratio <= _RATIOS[1]:
            speeds = [each.speed for each in windows()[_GAITS.get(action, action)]]
            raise PromptError(
                f"speed: {manner.speed_mps:g} m/s with {action!r}; allowed are {_RATIOS[0] * min(speeds):.2g} to "
                f"{_RATIOS[1] * max(speeds):.2g} m/s"
            )
    gait = _repeated(_GAITS.get(action, action), window, mirror, pace, count + 1, rng, names, steady=True)
    speed = own_speed(gait)
    wanted = size * speed if asked is None else asked
    stops = Stops.drawn(count, RATE, rng, manner.pauses)
    way = floor_way(path, duration, wanted, gait_period(gait), rng)
    if manner.speed_mps is not None:
        # the mean speed counts, and half turns are slower
        share = float(np.interp(np.linspace(0.0, duration, 200), way.t, way.speed).mean() / wanted)
        faster = 1.0 / max(share, 0.6)
        wanted *= faster
        way = replace(way, x=faster * way.x, y=faster * way.y, speed=faster * way.speed)
    gait = _resized(gait, action, 1.0, uneven)
    gone = along(gait, way, wanted, wanted / max(speed, 1e-9), stops)
    return Draft(gone, tuple(dict.fromkeys(names)), on_its_way=True)


def way_of(action: str, manner: Manner, length: float) -> str | None:
    """Kind of way over the floor that an action takes, one of :data:`~rfgen_sionna.generative.manner.PATHS`.

    None leaves it to the clip.

    Args:
        action: the action.
        manner: its manner.
        length: of the clip's way in the time [m]; a longer one than a room allows goes round.
    """
    if action not in WAYS:
        return "circle" if action in JUMPS and length > _ROOM else None
    own = OWN_PATHS.get(action)
    if action == "walk_turn":
        return manner.path
    if manner.path is not None or own is not None:
        return manner.path or own
    if action in ("walk", "carry", "sneak", "limp", "march"):
        return "to_and_fro"
    if length > _ROOM or manner.pauses or manner.speed_mps is not None:
        return "circle"
    return None


def choose(
    action: str, rng: np.random.Generator, manner: Manner, duration: float, strength: float
) -> tuple[Window, bool]:
    """A window of one of the people who show an action, and whether it is mirrored."""
    options = [each for each in windows()[_GAITS.get(action, action)] if strength > 0.0 or each.mirror is not True]
    if manner.hand is not None:
        options = [each for each in options if each.side == manner.hand or (strength > 0.0 and each.side != "both")]
        if action not in SIDED or manner.hand == "both" or not options:
            raise PromptError(f"hand: {manner.hand!r} with {action!r}, whose clips show no such choice; leave it out")
    if action in ONCE:
        # the action must end within the time
        short = [each for each in options if (each.stop - each.start) / RATE <= duration * PACES[1]]
        options = short or [min(options, key=lambda each: each.stop - each.start)]
    if action not in WAYS | JUMPS:
        options = [each for each in options if each.speed * duration < _ROOM] or sorted(
            options, key=lambda each: each.speed
        )[: max(3, len(options) // 4)]
    if action == "run":
        options = [each for each in options if each.speed > _SLOWEST_CLIP]
    if action == "hop":
        options = [each for each in options if each.speed < _FASTEST_HOP]
    if manner.speed_mps is not None:
        near = sorted(options, key=lambda each: abs(np.log(max(each.speed, 0.05) / manner.speed_mps)))
        options = near[: max(6, len(near) // 6)]
    people = sorted({_clip(each.clip).subject for each in options})
    person = people[int(rng.integers(len(people)))]
    own = [each for each in options if _clip(each.clip).subject == person]
    window = own[int(rng.integers(len(own)))]
    coin = bool(rng.integers(2))
    if manner.hand in ("left", "right") and window.side != "both":
        return window, window.side != manner.hand
    if strength == 0.0:
        return window, False
    return window, coin if window.mirror is None else window.mirror


@cache
def _plain(name: str) -> Motion:
    return library().motion(name)


def _edited(window: Window, mirror: bool, pace: float) -> Motion:
    """The longest part of the clip that shows the action."""
    motion = cut(_plain(window.clip), window.first, window.last)
    motion = mirrored(motion) if mirror else motion
    return motion if pace == 1.0 else at_pace(motion, pace)


def _span(window: Window, pace: float) -> tuple[int, int]:
    """First frame and end of the shortest part within the longest one."""
    start, stop = window.start - window.first, window.stop - window.first
    return int(start / pace), int(np.ceil((stop - 1) / pace)) + 1


def _once(clip: Motion, span: tuple[int, int], count: int, rng: np.random.Generator) -> Motion:
    """The action once, the person keeping still before and after it."""
    start, stop = span
    spare = max(count - (stop - start), 0)
    start = max(0, start - int(spare * rng.uniform(0.2, 0.6)))
    stop = min(len(clip.translation), start + max(count, stop - start))
    motion = cut(clip, start, min(stop, len(clip.translation)))
    missing = count - len(motion.translation)
    if missing <= 0:
        return motion
    before = int(missing * rng.uniform(0.15, 0.45)) if _speed_at(motion, 0) < _STILL else 0
    if before:
        motion = reversed_in_time(_kept(reversed_in_time(motion), before, rng))
    return _kept(motion, missing - before, rng) if missing > before else motion


def _speed_at(motion: Motion, frame: int) -> float:
    """Mean speed of places and turns of joints about a frame, as metres of a joint [m/s]."""
    features = pose_features(cut(motion, max(frame - 2, 0), frame + 3))
    third = (features.shape[1] - 2) // 2
    return float(np.linalg.norm(features[:, third : 2 * third], axis=1).mean() / 0.12)


def _kept(motion: Motion, count: int, rng: np.random.Generator) -> Motion:
    """The motion, then `count` frames of its last pose with the sway of someone who stands or sits still."""
    still = [each for each in windows()["standing"] if _clip(each.clip).duration > 10.0]
    clip = _plain(still[int(rng.integers(len(still)))].clip)
    small = sway(clip, count, int(rng.integers(len(clip.translation))))
    calm = np.ones(NUM_BODY_JOINTS)
    calm[[k for k, name in enumerate(JOINT_NAMES[:NUM_BODY_JOINTS]) if name.endswith(_LEGS)]] = 0.0
    if motion.translation[-1, 2] < 0.7:
        calm[0] = 0.0
    return held(motion, count, calm[:, None] * small)


def _repeated(
    action: str, window: Window, mirror: bool, pace: float, count: int, rng: np.random.Generator, names: list[str],
    *, steady: bool = False,
) -> Motion:  # fmt: skip
    """The action from a window on, again and again, by clips that go on where poses are alike."""
    clip = _edited(window, mirror, pace)
    start, stop = _span(window, pace)
    stop = min(stop, len(clip.translation))
    if steady:
        clip = motion = cut(clip, *steady_part(clip, start, stop))
    else:
        spare = max(count - (stop - start), 0)
        first = max(0, start - int(rng.uniform(0.0, 1.0) * spare), min(stop - count, start))
        motion = cut(clip, first, min(len(clip.translation), max(stop, first + count)))
    others = [each for each in windows()[action] if each.clip != window.clip]
    kin = [each for each in others if _clip(each.clip).subject == _clip(window.clip).subject]
    while len(motion.translation) < count:
        tried = [(clip, "")]
        _, distance = _join(motion, clip)
        if distance > _ALIKE and (kin or others):
            pool = kin or others
            for k in rng.permutation(len(pool))[:3]:
                turned = bool(rng.integers(2)) if pool[k].mirror is None else bool(pool[k].mirror)
                if pool[k].side not in ("both",) and window.side != "both":
                    turned = (pool[k].side != window.side) != mirror
                other = _edited(pool[k], turned, pace)
                if steady:
                    other = cut(other, *steady_part(other, *_span(pool[k], pace)))
                tried.append((other, pool[k].clip))
        best = min(tried, key=lambda each: _join(motion, each[0])[1])
        (here, there), distance = _join(motion, best[0])
        if best[1]:
            names.append(best[1])
        before = len(motion.translation)
        motion = joined(cut(motion, 0, here + 1), cut(best[0], there, len(best[0].translation)))
        if len(motion.translation) <= before:
            motion = _kept(motion, count - len(motion.translation), rng)
    return cut(motion, 0, max(count, 2)) if action in WAYS or action in HELD else cut(motion, 0, count)


def _at_rate(
    action: str, window: Window, mirror: bool, interval: float, count: int, rng: np.random.Generator, names: list[str]
) -> Motion:
    """The action again and again, `interval` [s] from one time to the next."""
    clip = _edited(window, mirror, 1.0)
    start, stop = _span(window, 1.0)
    core = cut(clip, start, stop)
    features = pose_features(core)[:, :-2]
    time, match = period(features, longest_one=0.6 * core.duration)
    rate = 60.0 / interval
    if match > _PERIODIC:
        pace = time / interval
        if pace > _PACE_LIMITS[0]:
            _check_pace(pace, rate, action)
            return _repeated(action, window, mirror, pace, count, rng, names)
    spare = min(max(interval - core.duration, 0.0), 1.2)
    once = cut(clip, max(0, start - int(0.4 * spare * RATE)), stop + int(0.4 * spare * RATE))
    pace = max(float(rng.uniform(0.95, 1.05)), 1.02 * once.duration / interval)
    _check_pace(pace, rate, action)
    once = at_pace(once, pace)
    motion, times = once, 1
    while len(motion.translation) < count:
        wanted = round(times * interval * RATE)
        if wanted > len(motion.translation):
            motion = _kept(motion, wanted - len(motion.translation), rng)
        motion = joined(cut(motion, 0, wanted), once)
        times += 1
    return cut(motion, 0, count)


def _check_pace(pace: float, rate: float, action: str) -> None:
    low, high = _PACE_LIMITS
    if not low <= pace <= high:
        raise PromptError(
            f"rate: {rate:g} a minute with {action!r}; people whose clips show it reach {rate / pace * low:.2g} to "
            f"{rate / pace * high:.2g}"
        )


def _join(motion: Motion, other: Motion) -> tuple[tuple[int, int], float]:
    """Frames at which `other` may go on, (last of `motion`, first of `other`), and the distance of the poses [m]."""
    total, length = len(motion.translation), len(other.translation)
    tail = max(0, total - max(round(_TAIL * RATE), 2), total // 2 if total > 2 else 0)
    head = max(1, min(length - round(_LEAST * RATE), length // 2))
    away = likeness(pose_features(cut(motion, tail, total)), pose_features(cut(other, 0, head)))
    lost = (np.arange(tail, total)[::-1] - tail)[:, None] + np.arange(head)
    gain = length - lost
    cost = away + _DROPPED / RATE * lost
    cost[gain < _LEAST * RATE] += 10.0
    here, there = np.unravel_index(int(np.argmin(cost)), cost.shape)
    return (tail + int(here), int(there)), float(cost[here, there])


def _resized(motion: Motion, action: str, size: float, uneven: float) -> Motion:
    """The motion larger or smaller, and uneven between left and right."""
    if size == 1.0 and uneven == 0.0:
        return motion
    arms = _sizes(_ARMS, size, uneven)
    if action in JUMPS:
        return _flown(scaled(motion, arms, 1.0), size)
    if action in ONCE or action in HELD:
        return scaled(motion, arms, 1.0)
    trunk = np.ones(NUM_BODY_JOINTS)
    trunk[[k for k, name in enumerate(JOINT_NAMES[:NUM_BODY_JOINTS]) if name.startswith(_TRUNK)]] = size
    out = scaled(motion, arms * trunk * _sizes(_LEGS, size, uneven), size)
    if action in WAYS:
        translation = out.translation.copy()
        way = own_way(out)
        translation[:, :2] += (size - 1.0) * (way - way[:1])
        out = replace(out, translation=translation)
    return out


def _flown(motion: Motion, size: float) -> Motion:
    """The motion with flights `size` times as high."""
    translation = motion.translation.copy()
    for a, b in flights(motion):
        first, last = max(a - 1, 0), min(b, len(translation) - 1)
        line = np.linspace(translation[first, 2], translation[last, 2], last - first + 1)
        translation[first : last + 1, 2] = line + size * (translation[first : last + 1, 2] - line)
    return replace(motion, translation=translation)


def _sizes(names: Sequence[str], size: float, uneven: float) -> FloatArray:
    """(joint,) factors of the joints of these names."""
    out = np.ones(NUM_BODY_JOINTS)
    for k, name in enumerate(JOINT_NAMES[:NUM_BODY_JOINTS]):
        side, _, part = name.partition("_")
        if part in names:
            out[k] = size * (1.0 + uneven if side == "left" else 1.0 - uneven)
    return out
