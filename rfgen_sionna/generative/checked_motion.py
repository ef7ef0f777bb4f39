"""Motion of a prompt by its source: that of a learned one is checked by the definition of its action, tried again, or
refused."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import islice
from types import MappingProxyType

import numpy as np

from rfgen_sionna.generative.action_definitions import MotionSignals, check
from rfgen_sionna.generative.motion import MotionSource, SentenceSource, Skeleton
from rfgen_sionna.generative.motion_library import MotionLibrary
from rfgen_sionna.generative.prompts import PromptError, ScenePrompt
from rfgen_sionna.records import Motion

ATTEMPTS = 4
"""Motions that are tried, the first of the given seed."""
SHORTEST = 1.0
"""Length from which motions are checked [s]: shorter ones hold no whole action."""
_RUN = ("run", "run_start", "run_stop", "run_stop_run", "run_turn_left", "run_turn_right", "run_jump", "run_jump_stop")
CHECKED: Mapping[str, tuple[str, ...]] = MappingProxyType(
    dict.fromkeys(_RUN, ("run",))
    | dict.fromkeys(("fast_walk", "slow_walk", "stride_walk"), ("walk",))
    | dict.fromkeys(("getup", "getup_down", "getup_side"), ("get_up",))
    | {
        "arm_circles": ("arm_circles",),
        "bow": ("bow",),
        "cartwheel": ("cartwheel",),
        "crawl": ("crawl",),
        "crouch": ("crouch",),
        "drink": ("drink",),
        "fall": ("fall",),
        "hops": ("hop",),
        "jump_forward": ("jump_forward",),
        "kick": ("kick",),
        "knee_elbow": ("knee_to_elbow",),
        "ladder": ("climb_ladder",),
        "leap": ("leap",),
        "lie": ("lie",),
        "nod": ("nod",),
        "reach": ("reach",),
        "sit": ("sit", "sit_down"),
        "squat": ("squat",),
        "stand_up": ("stand_up",),
        "steps": ("climb_stairs",),
    }
)
"""Captured action of the learned source -> definitions, one of which must hold. Each of these is right on 95 % of the
library's clips; actions by rules hold theirs for every seed and are not checked again."""


def true_motion(make: Callable[[int], Motion], action: str, seed: int) -> Motion:
    """The motion `make(seed)` if it shows `action`, or that of the first of a few further seeds that does.

    Parameters
    ----------
    make
        Motion of a seed.
    action
        Its label; motions of actions that are not in `CHECKED`, and those under `SHORTEST`, are returned unchecked.
    seed
        The first seed; the further ones are derived from it.

    Raises
    ------
    PromptError
        No motion shows the action; the message gives the reasons against the first one, and clips that show it.
    """
    motion = make(seed)
    wanted = CHECKED.get(action)
    if wanted is None or motion.duration < SHORTEST:
        return motion
    reasons: tuple[str, ...] = ()
    for attempt in range(ATTEMPTS):
        tried = motion if attempt == 0 else make(int(np.random.SeedSequence([seed, attempt]).generate_state(1)[0]))
        signals = MotionSignals(tried)
        verdicts = [check(signals, name) for name in wanted]
        if any(verdicts):
            return tried if attempt == 0 else replace(tried, seed=seed)
        reasons = reasons or min((verdict.reasons for verdict in verdicts), key=len)
    raise PromptError(
        f"action: {ATTEMPTS} motions by the motion model were tried, and none shows {action!r} ({'; '.join(reasons)}); "
        f"captured motion does: {_clips(action, wanted)}"
    )


def _clips(action: str, wanted: Sequence[str]) -> str:
    """How to take clips of the library that show an action instead."""
    library = MotionLibrary()
    clips = (clip.name for clip in library.actions.get(action, ()))
    names = list(islice((name for name in clips if any(check(library.motion(name), each) for each in wanted)), 3))
    if not names:
        return "see rfgen motions"
    others = f", or {', '.join(names[1:])}" if names[1:] else ""
    return f"Actor.from_motion(MotionLibrary().motion({names[0]!r})){others}"


def performed_motion(said: ScenePrompt, duration: float, seed: int, skeleton: Skeleton, source: MotionSource) -> Motion:
    """Motion of a prompt by its source.

    Raises
    ------
    PromptError
        The source reads sentences, and no motion of a few seeds shows what the prompt says.
    """
    speed = 1.0 if said.speed is None else said.speed
    if not (said.sentence and isinstance(source, SentenceSource)):
        return source(said.action, duration, seed, skeleton=skeleton, hand=said.hand, speed=speed)

    def make(seed: int) -> Motion:
        return source.generate(
            said.sentence, duration=duration, seed=seed, negative=said.avoid, skeleton=skeleton, speed=speed,
            action=said.action, arms=said.arms,
        )  # fmt: skip

    return true_motion(make, said.action, seed)
