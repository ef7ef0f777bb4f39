"""Motions of actions, by name: from the motion library, or by rules of movement, checked by their definitions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from types import MappingProxyType

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.action_definitions import DEFINED_ACTIONS, MotionSignals, Verdict, check
from rfgen_sionna.generative.library_source import draft, way_of
from rfgen_sionna.generative.manner import Manner
from rfgen_sionna.generative.motion import ACTIONS, MEAN_ADULT, KinematicSource, Skeleton
from rfgen_sionna.generative.motion.arm_overlay import standing_still, stooped, with_arms, with_fingers
from rfgen_sionna.generative.motion.clip_editing import joint_places, placed
from rfgen_sionna.generative.motion.floor_contact import keep_body_above_floor
from rfgen_sionna.generative.motion.floor_ways import Stops, along, floor_way, gait_period, own_speed
from rfgen_sionna.generative.motion.foot_lock import lock_feet
from rfgen_sionna.generative.motion.kinematic import MAX_DURATION
from rfgen_sionna.generative.motion.resampling import resample_motion
from rfgen_sionna.generative.motion.skeleton import JOINT, NUM_BODY_JOINTS, SIDES
from rfgen_sionna.generative.prompts.prompt_error import PromptError
from rfgen_sionna.generative.repertoire import (
    ARMS_FREE,
    HELD,
    JUMPS,
    OFF_THE_FLOOR,
    ONCE,
    OWN_PATHS,
    POSTURES,
    WAYS,
    windows,
)
from rfgen_sionna.records import Motion

ATTEMPTS = 7
"""Motions that are tried, the first of the given seed."""
FRAME_RATE = 60.0
"""Poses per second of a varied motion of clips [Hz]."""
SHORTEST = 1.0
"""Length from which motions are checked [s]: shorter ones hold no whole action."""
_OWN_WAYS = {"walk": "to_and_fro", "walk_straight": "straight"}
"""Ways of gaits by rules; others go straight."""
_POSED = 1.5
"""Time after which a posture of the arms no longer changes [s]."""
_STOOP = float(np.radians(14.0))
"""Bend of the trunk of who is tired [rad]."""
_LOW, _SLOW = 0.035, 0.6
"""Height over the floor [m] and speed [m/s] under which a foot stands."""
_SPEED_OFF = 0.25
"""Largest difference of the mean speed from a given one, share: who sets off, turns or sways has another."""
_HIGHEST_JUMP = 0.7
"""Height of the feet in a high jump of the usual size [m]; a smaller one is lower by its amplitude."""
_MOVES = 0.5
"""Speed from which a foot is not planted [m/s]."""
SHORTEST_WAY, SHORTEST_WAY_BACK = 1.5, 2.5
"""The same of ways over the floor [s], and of those back or around: of shorter ones the first part is checked."""
EXACT = frozenset(
    {
        "t_pose", "sit_up", "push_up", "wave", "clap", "phone", "type", "boxing", "stretch", "point", "wash_window",
        "nod", "shake_head", "both_arms_forward", "left_arm_horizontal", "right_arm_horizontal", "arms_folded",
        "arms_on_hips", "hands_behind_back", "hands_in_pockets", "salute", "beckon", "wipe", "brush_teeth", "comb",
        "cough", "knock", "stir",
    }
)  # fmt: skip
"""Actions whose rules are more exact than their clips, or whose clips are of fewer than three people."""
FEW_CLIPS = frozenset(
    {"sit", "sit_down", "stand_up", "sit_and_stand", "lie", "drink", "throw", "swing_arms", "look_around"}
)
"""Actions of a handful of clips: of every other seed or so, rules come first."""


@dataclass(frozen=True)
class PerformingSource:
    """A :class:`~rfgen_sionna.generative.motion.MotionSource` of all that :func:`perform` can do."""

    strength: float | None = None
    """Share of the usual variation of clips, 0 (as they are) to 1; None takes 1."""

    def __call__(
        self,
        action: str,
        duration: float,
        seed: int,
        *,
        skeleton: Skeleton | None = None,
        hand: str | None = None,
        speed: float = 1.0,
        manner: Manner | None = None,
        arms: str = "",
    ) -> Motion:
        """A motion by :func:`perform`, with its errors; `hand` and `speed` (unless 1) go before those of `manner`."""
        manner = manner or Manner()
        manner = replace(manner, hand=hand or manner.hand, speed=manner.speed if speed == 1.0 else speed)
        return perform(action, duration, seed, skeleton=skeleton, manner=manner, arms=arms, strength=self.strength)


@cache
def performable() -> Mapping[str, tuple[str, ...]]:
    """Actions that can be asked for, with their sources, the first one first: "clips" and "rules"."""
    found: dict[str, tuple[str, ...]] = {}
    for action in sorted(DEFINED_ACTIONS):
        sources = [name for name, has in (("clips", windows()), ("rules", ACTIONS)) if action in has]
        if sources:
            found[action] = tuple(sources[::-1] if action in EXACT else sources)
    return MappingProxyType(found)


def perform(
    action: str,
    duration: float,
    seed: int,
    *,
    skeleton: Skeleton | None = None,
    manner: Manner | None = None,
    arms: str = "",
    strength: float | None = None,
) -> Motion:
    """A motion that shows an action, by its definition.

    Clips of the motion library come first: one of the people who show the action, mirrored, cut, joined to the length,
    and varied in pace, size and evenness. Rules of movement follow for what no clip has.

    Args:
        action: one of :func:`performable`.
        duration: length [s].
        seed: of all choices.
        skeleton: proportions of the person; None takes a mean adult.
        manner: how the action is done.
        arms: action of the arms over the legs of `action`, or empty.
        strength: share of the usual variation, 0 to 1; 0 plays a clip as it is. None takes 1.

    Raises:
        PromptError: the action cannot be performed that way, or no motion of a few seeds shows it; with the reasons.
        ValueError: a duration or strength out of range.
    """
    if action not in performable():
        raise PromptError(f"action: {action!r} cannot be performed; allowed are {', '.join(performable())}")
    if not (np.isfinite(duration) and 0.0 < duration <= MAX_DURATION):
        raise ValueError(f"duration: {duration!r} s; allowed is more than 0 and at most {MAX_DURATION:g} s")
    share = 1.0 if strength is None else float(strength)
    if not 0.0 <= share <= 1.0:
        raise ValueError(f"strength: {strength!r}; allowed are 0, a clip as it is, to 1, the usual variation")
    reasons: tuple[str, ...] = ()
    manner, body = manner or Manner(), skeleton or MEAN_ADULT
    _check_manner(action, manner)
    posture = "" if manner.arm_posture is None else POSTURES[manner.arm_posture]
    arms = _checked_arms(action, arms, posture)
    if arms and action == "standing":
        action, arms = arms, ""
    for motion, verdict in trials(action, duration, seed, body, manner, share, arms=arms, posture=posture):
        missed = (*_missed_speed(motion, manner), *_missed_height(motion, action, manner, body))
        if verdict.true and not missed:
            return replace(motion, seed=seed)
        reasons = reasons or (*verdict.reasons, *missed)
    done = f"{action!r} with the arms of {arms or posture!r}" if arms or posture else repr(action)
    raise PromptError(f"action: no motion of {ATTEMPTS} shows {done} for {duration:g} s: {'; '.join(reasons)}")


def _missed_speed(motion: Motion, manner: Manner) -> tuple[str, ...]:
    """Why a motion has not the speed over the floor that its manner gives; empty if it has."""
    if manner.speed_mps is None or manner.pauses:
        return ()
    steps = np.linalg.norm(np.diff(motion.translation[:, :2], axis=0), axis=-1)
    mean = float(steps.sum() * motion.frame_rate / max(len(steps), 1))
    if abs(mean - manner.speed_mps) <= max(_SPEED_OFF * manner.speed_mps, 0.1):
        return ()
    return (f"mean speed over the floor [m/s]: {mean:.2g}, {manner.speed_mps:g} is asked for",)


def _missed_height(motion: Motion, action: str, manner: Manner, body: Skeleton) -> tuple[str, ...]:
    """Why a jump is higher than a small one; empty if it is not, or no small one is asked for."""
    if action not in JUMPS or manner.amplitude is None or manner.amplitude >= 1.0:
        return ()
    toes = joint_places(motion)[:, [JOINT[f"{side}_foot"] for side in SIDES], 2].min(axis=1) - body.toe_height
    highest = _HIGHEST_JUMP * manner.amplitude * body.leg_length() / MEAN_ADULT.leg_length()
    if toes.max() <= highest:
        return ()
    return (f"highest rise of the lower foot [m]: {toes.max():.2g}, at most {highest:.2g} is asked for",)


def _check_manner(action: str, manner: Manner) -> None:
    """Check that an action can have a way over the floor, a speed and a rate.

    Raises:
        PromptError: it cannot, or its name contradicts the way.
    """
    given = "path" if manner.path else "speed" if manner.speed_mps is not None else "pauses" if manner.pauses else ""
    if given and action not in WAYS:
        raise PromptError(f"{given}: {action!r} does not lead over the floor; leave it out, or ask for a walk or a run")
    own = OWN_PATHS.get(action)
    if own is not None and manner.path not in (None, own):
        raise PromptError(f"path: {manner.path!r} with {action!r}; ask for a walk")
    if manner.lying is not None and action != "lie":
        raise PromptError(f"lying: {manner.lying!r} with {action!r}; leave it out, or ask for 'lie'")
    if manner.rate is not None and (action in ONCE or action in HELD):
        raise PromptError(f"rate: {action!r} is not repeated; leave it out")


def _checked_arms(action: str, arms: str, posture: str) -> str:
    """Action of the arms, if the legs' action leaves them free.

    Raises:
        PromptError: it does not, or the arms have two things to do.
    """
    if arms and arms not in performable():
        raise PromptError(f"arms: {arms!r} cannot be performed; allowed are {', '.join(performable())}")
    if (arms or posture) and action not in ARMS_FREE:
        held = f"arms: {arms!r}" if arms else f"arm posture: {posture!r}"
        free = ", ".join(sorted(ARMS_FREE & performable().keys()))
        raise PromptError(f"{held} with {action!r}, which does not leave the arms free; {free} do")
    if arms and posture:
        raise PromptError(f"arms: {arms!r}, and held as {posture!r} at the same time; leave one of them out")
    return arms


def trials(
    action: str, duration: float, seed: int, skeleton: Skeleton, manner: Manner, strength: float, *, arms: str = "",
    posture: str = "",
) -> Iterator[tuple[Motion, Verdict]]:  # fmt: skip
    """Motions that are tried one after the other, of each source, with what the definition says of them."""
    own = replace(manner, arm_posture=None, hand=None if arms else manner.hand)
    refused: ValueError | None = None
    sources = performable()[action]
    if strength == 0.0 and "clips" in sources and manner.lying is None:
        sources = ("clips",)  # as it is, or not at all
    elif (manner.amplitude is not None or manner.rate is not None) and action not in WAYS and "rules" in sources:
        sources = ("rules", *(each for each in sources if each != "rules"))  # they keep numbers
    elif manner.lying is not None:
        sources = ("rules",)  # clips are not sorted by it
    elif action in FEW_CLIPS and strength > 0.0 and np.random.default_rng([seed, len(sources)]).uniform() < 0.6:
        sources = sources[::-1]
    for source in sources:
        for attempt in range(ATTEMPTS):
            one = seed if attempt == 0 else int(np.random.SeedSequence([seed, attempt]).generate_state(1)[0])
            try:
                if source == "rules":
                    motion = _by_rules(action, duration, one, skeleton, own)
                else:
                    motion = _from_clips(action, duration, one, skeleton, own, strength)
            except ValueError as error:  # what clips cannot do rules may
                refused = error
                break
            if arms or posture:
                other = _arms_of(arms or posture, duration, one, skeleton, manner, strength)
                motion = with_arms(motion, other, skeleton)
            over_legs = arms or (posture if posture != "standing" else "")
            yield motion, _verdict(motion, action, duration, over_legs, skeleton)
    if refused is not None:
        raise PromptError(str(refused)) from refused


def _by_rules(action: str, duration: float, seed: int, skeleton: Skeleton, manner: Manner) -> Motion:
    """A motion by rules; gaits along the way that is asked for."""
    source = KinematicSource()
    path = way_of(action, manner, np.inf) if action in WAYS else None
    if path is None or (action in _OWN_WAYS and not manner.pauses and path == _OWN_WAYS[action]):
        return source(action, duration, seed, skeleton=skeleton, manner=manner)
    straight = "walk_straight" if action == "walk" else action
    gait = replace(source, frame_rate=FRAME_RATE)(straight, duration + 0.5, seed, skeleton=skeleton, manner=manner)
    rng = np.random.default_rng([seed, *action.encode()])
    speed = own_speed(gait)
    stops = Stops.drawn(int(np.ceil(duration * FRAME_RATE - 1e-9)) + 1, FRAME_RATE, rng, manner.pauses)
    way = floor_way(path, duration, speed, gait_period(gait), rng)
    gone = lock_feet(along(gait, way, speed, 1.0, stops), skeleton)
    return replace(with_still_contacts(gone), action=action)


def _verdict(motion: Motion, action: str, duration: float, arms: str, skeleton: Skeleton) -> Verdict:
    if duration < (SHORTEST_WAY if action in WAYS else SHORTEST):
        return Verdict(action, True, ())
    part = duration < SHORTEST_WAY_BACK and action in ("walk_to_and_fro", "walk_in_a_circle")
    verdict = check(MotionSignals(motion), "walk" if part else action)
    if verdict.true and arms in DEFINED_ACTIONS:
        return check(MotionSignals(standing_still(motion, skeleton)), arms)
    return verdict


def _arms_of(action: str, duration: float, seed: int, skeleton: Skeleton, manner: Manner, strength: float) -> Motion:
    """The motion whose arms are taken."""
    hand, still = Manner(hand=manner.hand), action in POSTURES.values()
    if still or performable()[action][0] == "rules":
        allowed = hand if ACTIONS[action].hands else Manner()
        length = min(duration, _POSED) if still else duration
        return KinematicSource()(action, length, seed, skeleton=skeleton, manner=allowed)
    return _from_clips(action, duration, seed, skeleton, hand, strength)


def _from_clips(action: str, duration: float, seed: int, body: Skeleton, manner: Manner, strength: float) -> Motion:
    rng = np.random.default_rng([seed, *action.encode()])
    made = draft(action, duration, rng, manner, strength)
    motion = made.motion if made.on_its_way else placed(made.motion, way=action in WAYS)
    motion = replace(motion, action=action, seed=seed, clips=made.clips)
    motion = on_skeleton(motion, body)
    if strength == 0.0:
        return motion
    if manner.tired and action in ARMS_FREE:
        motion = stooped(motion, _STOOP, 0.7 * _STOOP)
    motion = resample_motion(motion, FRAME_RATE)
    if action in OFF_THE_FLOOR:
        return with_fingers(motion, body)
    return with_fingers(
        with_still_contacts(keep_body_above_floor(lock_feet(with_standing_contacts(motion, body), body))), body
    )


def _foot_speeds(motion: Motion, places: FloatArray) -> FloatArray:
    """(frame, side) speed over the floor of the stiller of ankle and toes [m/s]."""
    speeds = [
        np.linalg.norm(np.gradient(places[:, [JOINT[f"{side}_{name}"] for side in SIDES], :2], axis=0), axis=-1)
        for name in ("ankle", "foot")
    ]
    return np.minimum(*speeds) * motion.frame_rate


def with_standing_contacts(motion: Motion, body: Skeleton) -> Motion:
    """The motion with contacts of all feet that stand: low and slow ones, too, which the clips' own labels miss."""
    places = joint_places(motion)
    low = np.minimum(
        *(places[:, [JOINT[f"{side}_{name}"] for side in SIDES], 2] - height
          for name, height in (("ankle", body.ankle_height), ("foot", body.toe_height)))
    )  # fmt: skip
    standing = (low < _LOW) & (_foot_speeds(motion, places) < _SLOW)
    return replace(motion, contacts=standing if motion.contacts is None else motion.contacts | standing)


def with_still_contacts(motion: Motion) -> Motion:
    """The motion without contacts of feet that move."""
    if motion.contacts is None:
        return motion
    return replace(motion, contacts=motion.contacts & (_foot_speeds(motion, joint_places(motion)) < _MOVES))


def on_skeleton(motion: Motion, skeleton: Skeleton) -> Motion:
    """A motion of the library's skeleton on another one: the way and the height of the pelvis by the legs."""
    scale = skeleton.leg_length() / MEAN_ADULT.leg_length()
    translation = motion.translation * scale
    translation[:, 2] += skeleton.standing_height() - scale * MEAN_ADULT.standing_height()
    return replace(motion, translation=translation, offsets=skeleton.offsets[:NUM_BODY_JOINTS])
