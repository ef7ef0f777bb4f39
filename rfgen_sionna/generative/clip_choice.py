"""Which window of the motion library an action is taken from, by its manner and seed."""

from __future__ import annotations

from functools import cache
from types import MappingProxyType

import numpy as np

from rfgen_sionna.generative.manner import Manner
from rfgen_sionna.generative.motion.clip_editing import at_pace, cut, mirrored
from rfgen_sionna.generative.motion_library import LibraryClip, MotionLibrary
from rfgen_sionna.generative.prompts.prompt_error import PromptError
from rfgen_sionna.generative.repertoire import LEAPS, ONCE, SIDED, WAYS, Window, windows
from rfgen_sionna.records import Motion

RATE = 20.0
"""Poses per second of clips [Hz]."""
PACES, SIZES = (0.85, 1.2), (0.9, 1.15)
"""Factors on the pace and the size of a clip that seeds draw."""
_ENOUGH = 3
"""People from whom on keyframed clips are left out."""
_FASTEST_HOP = 1.6
"""Fastest speed of a clip of hops [m/s]; faster ones are runs with a hop."""
_SLOWEST_CLIP = 1.6
"""Slowest speed of a clip of a run [m/s]; slower ones hardly leave the floor."""
SPEED_RATIOS = (0.5, 1.7)
"""Factors on the speed over the floor of a clip."""
ROOM = 4.0
"""Longest way of a clip that is taken as it is [m]."""
GAITS = MappingProxyType(
    {"walk": "walk_straight", "walk_to_and_fro": "walk_straight", "walk_in_a_circle": "walk_straight"}
)
"""Actions whose ways are made from clips of another one."""


@cache
def library() -> MotionLibrary:
    """The shipped library."""
    return MotionLibrary()


@cache
def clip_record(name: str) -> LibraryClip:
    return next(clip for clip in library() if clip.name == name)


@cache
def plain_clip(name: str) -> Motion:
    return library().motion(name)


def choose(
    action: str, rng: np.random.Generator, manner: Manner, duration: float, strength: float
) -> tuple[Window, bool]:
    """A window of one of the people who show an action, and whether it is mirrored."""
    options = [each for each in windows()[GAITS.get(action, action)] if strength > 0.0 or each.mirror is not True]
    # hands of animators exaggerate: real people first, where there are some
    real = [each for each in options if clip_record(each.clip).kind != "keyframed"]
    if len({clip_record(each.clip).subject for each in real}) >= _ENOUGH:
        options = real
    if manner.hand is not None:
        options = [each for each in options if each.side == manner.hand or (strength > 0.0 and each.side != "both")]
        if action not in SIDED or manner.hand == "both" or not options:
            raise PromptError(f"hand: {manner.hand!r} with {action!r}, whose clips show no such choice; leave it out")
    if action in ONCE:
        # the action must end within the time
        short = [each for each in options if (each.stop - each.start) / RATE <= duration * PACES[1]]
        options = short or [min(options, key=lambda each: each.stop - each.start)]
    if action not in WAYS | LEAPS:
        options = [each for each in options if each.speed * duration < ROOM] or sorted(
            options, key=lambda each: each.speed
        )[: max(3, len(options) // 4)]
    if action == "run":
        options = [each for each in options if each.speed > _SLOWEST_CLIP]
    if action == "hop":
        options = [each for each in options if each.speed < _FASTEST_HOP]
    if (wanted := manner.speed_mps) is not None:
        near = sorted(options, key=lambda each: abs(np.log(max(each.speed, 0.05) / wanted)))
        reach = [each for each in near if SPEED_RATIOS[0] <= wanted / max(each.speed, 0.05) <= SPEED_RATIOS[1]]
        options = (reach or near)[: max(6, len(near) // 6)]
    people = sorted({clip_record(each.clip).subject for each in options})
    person = people[int(rng.integers(len(people)))]
    own = [each for each in options if clip_record(each.clip).subject == person]
    window = own[int(rng.integers(len(own)))]
    coin = bool(rng.integers(2))
    if manner.hand in ("left", "right") and window.side != "both":
        return window, window.side != manner.hand
    if strength == 0.0:
        return window, False
    return window, coin if window.mirror is None else window.mirror


def edited(window: Window, mirror: bool, pace: float) -> Motion:
    """The longest part of the clip that shows the action."""
    motion = cut(plain_clip(window.clip), window.first, window.last)
    motion = mirrored(motion) if mirror else motion
    return motion if pace == 1.0 else at_pace(motion, pace)


def span_at(window: Window, pace: float) -> tuple[int, int]:
    """First frame and end of the shortest part within the longest one."""
    start, stop = window.start - window.first, window.stop - window.first
    return int(start / pace), int(np.ceil((stop - 1) / pace)) + 1
