"""Motion from the clips of the motion library: a window by action and seed, cut, joined and varied to a length."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.clip_choice import (
    GAITS,
    PACES,
    RATE,
    ROOM,
    SIZES,
    SPEED_RATIOS,
    choose,
    edited,
    plain_clip,
    span_at,
)
from rfgen_sionna.generative.clip_sequences import at_rate, check_pace, once, repeated, restless
from rfgen_sionna.generative.manner import Manner
from rfgen_sionna.generative.motion.clip_editing import flights, scaled
from rfgen_sionna.generative.motion.floor_ways import Stops, along, floor_way, gait_period, own_speed, own_way
from rfgen_sionna.generative.motion.skeleton import JOINT_NAMES, NUM_BODY_JOINTS
from rfgen_sionna.generative.prompts.prompt_error import PromptError
from rfgen_sionna.generative.repertoire import BALLISTIC, CALM, HELD, JUMPS, LEAPS, ONCE, OWN_PATHS, WAYS, windows
from rfgen_sionna.records import Motion

_BALLISTIC = 0.3
"""Share of the variation of pace of who falls or flies."""
_UNEVEN = 0.05
"""Standard deviation of the difference in size between left and right."""
_SHORTEST_WAY = 3.1
"""Way of a walk that turns back or goes around [m]."""
_FASTEST_ROUND = 2.9
"""Fastest run around, unless a speed is given [m/s]: the radius of its circle stays under 2.5 m."""
_SLOWEST_RUN = 2.2
"""Slowest mean speed of a run [m/s]."""
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
    pace = manner.pace * float(rng.uniform(*PACES) ** (strength * (_BALLISTIC if action in BALLISTIC else 1.0)))
    size = manner.size * float(rng.uniform(*SIZES) ** strength)
    uneven = strength * float(np.clip(rng.normal(0.0, _UNEVEN), -2.0 * _UNEVEN, 2.0 * _UNEVEN))
    height = size if action in JUMPS else 1.0
    if action in JUMPS:
        pace /= np.sqrt(size)  # a flight of half the height takes 0.7 of the time
    count = int(np.ceil(duration * RATE - 1e-9)) + 1
    names = [window.clip]
    if action in ONCE:
        if strength > 0.0 and manner.speed is None:  # it ends within the time
            pace = max(pace, min((window.stop - window.start) / (count - 2), PACES[1]))
        motion = once(edited(window, mirror, pace), span_at(window, pace), count, rng)
        return Draft(_resized(motion, action, size, uneven), tuple(names))
    path = way_of(action, manner, window.speed * pace * duration) if strength > 0.0 else None
    if path is None:
        if manner.rate is None:
            motion = repeated(action, window, mirror, pace, count, rng, names)
        else:
            motion = at_rate(action, window, mirror, 60.0 / manner.rate, count, rng, names)
        motion = _resized(motion, action, size, uneven)
        if action in CALM and strength > 0.0:
            motion = restless(motion, rng, strength)
        return Draft(motion, tuple(dict.fromkeys(names)))
    if manner.rate is not None:  # steps
        pace = manner.rate / 120.0 * gait_period(plain_clip(window.clip))
        check_pace(pace, manner.rate, action)
    own = [each.speed for each in windows().get(action, ()) if action in OWN_PATHS and action in GAITS]
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
        if manner.speed_mps is not None and not SPEED_RATIOS[0] <= ratio <= SPEED_RATIOS[1]:
            speeds = [each.speed for each in windows()[GAITS.get(action, action)]]
            raise PromptError(
                f"speed: {manner.speed_mps:g} m/s with {action!r}; allowed are {SPEED_RATIOS[0] * min(speeds):.2g} to "
                f"{SPEED_RATIOS[1] * max(speeds):.2g} m/s"
            )
    gait = repeated(GAITS.get(action, action), window, mirror, pace, count + 1, rng, names, steady=True)
    speed = own_speed(gait)
    wanted = size * speed if asked is None else asked
    stops = Stops.drawn(count, RATE, rng, manner.pauses)
    way = floor_way(path, duration, wanted, gait_period(gait), rng)
    if manner.speed_mps is not None or own:
        # the mean speed counts, and half turns are slower
        share = float(np.interp(np.linspace(0.0, duration, 200), way.t, way.speed).mean() / wanted)
        faster = 1.0 / max(share, 0.6)
        wanted *= faster
        way = replace(way, x=faster * way.x, y=faster * way.y, speed=faster * way.speed)
    gait = _resized(gait, action, height, uneven)
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
        return "circle" if action in LEAPS and length > ROOM else None
    own = OWN_PATHS.get(action)
    if action == "walk_turn":
        return manner.path
    if manner.path is not None or own is not None:
        return manner.path or own
    if action in ("walk", "carry", "sneak", "limp", "march"):
        return "to_and_fro"
    if length > ROOM or manner.pauses or manner.speed_mps is not None:
        return "circle"
    return None


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
