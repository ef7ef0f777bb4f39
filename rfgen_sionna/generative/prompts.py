"""From a sentence or keywords to what is simulated: target, action, orientation, distance, body, surroundings.

The grammar is explicit: a phrase is read by a pattern of :mod:`rfgen_sionna.generative.vocabulary` or it is
reported as not understood. Where the words leave a choice open ("raises an arm"), the seed draws one of the
possibilities that the negative prompt allows, and the report says so.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from rfgen_sionna.generative.body_prompt import BodyPrompt, PromptError, draw_body
from rfgen_sionna.generative.decisions import DEFAULT, NEGATIVE, PROMPT, Decision, drawn, tabulate
from rfgen_sionna.generative.environment_prompt import NOWHERE, EnvironmentPrompt, parse_environment, split_keyword
from rfgen_sionna.generative.motion.actions import ACTIONS
from rfgen_sionna.generative.motion.kinematic import preferred_hand
from rfgen_sionna.generative.phrases import Phrases, read_unwanted, read_wanted
from rfgen_sionna.generative.text_reader import negation_in, split_negative

T = TypeVar("T")

__all__ = [
    "DECIDED", "DEFAULT_DISTANCE", "BodyPrompt", "EnvironmentPrompt", "PromptError", "ScenePrompt", "UnreadActionError",
    "parse_environment", "parse_prompt",
]  # fmt: skip

DEFAULT_DISTANCE = 3.0
"""Distance from the radar where neither prompt nor caller says one [m]."""
DECIDED = "decided:"
"""Heading of the decisions in a report."""
_FACING = {0.0: ", facing the radar", 90.0: ", turned left", 180.0: ", back to the radar", 270.0: ", turned right"}
_UNITS = {"gender": "", "age": " years", "height": " m", "weight": " kg", "muscle": " (0 to 1)"}


@dataclass(frozen=True)
class SourceReading:
    """What a motion source makes of a prompt in which the grammar finds no one action."""

    action: str
    origin: str
    """Who decided on it."""
    arms: str = ""
    arms_origin: str = ""
    sentence: str = ""
    """What the source is to read itself; empty where the action's name says all."""
    avoid: str = ""
    """The same of the negative prompt."""
    read: frozenset[str] = frozenset()
    """The phrases that the source has read and the grammar has not."""
    notes: tuple[str, ...] = ()
    """What is done instead of what was asked for."""


@dataclass(frozen=True)
class ScenePrompt:
    """What a prompt asks for. None stands where it leaves the choice to the simulation."""

    text: str
    negative: str
    seed: int
    action: str
    """Key of the registry of actions, or what a source that reads sentences calls a captured one."""
    target: str = "person"
    choices: tuple[str, ...] = ()
    """The actions that both prompts leave open; `action` is one of them, drawn from the seed."""
    orientation_deg: float | None = None
    """Angle by which the person is turned from facing the radar, counter-clockwise seen from above, so
    towards the person's own left [degrees, 0 to 360)."""
    distance_m: float | None = None
    """Distance from the radar over the floor [m]."""
    bearing_deg: float | None = None
    """Angle to the radar's boresight at which the person is, seen from above, positive to the radar's left
    [degrees, -90 to 90]."""
    body: BodyPrompt = field(default_factory=BodyPrompt)
    hand: str | None = None
    """"left", "right" or "both": the hand of a gesture; the seed draws it where no words say it."""
    speed: float | None = None
    """Factor on the action's usual speed."""
    surroundings: str | None = None
    """Name of a scene, or "free space"."""
    understood: tuple[tuple[str, str], ...] = ()
    """(phrase, what it was read as)."""
    unused: tuple[str, ...] = ()
    """Phrases that were not understood and have no effect."""
    origins: Mapping[str, str] = field(default_factory=dict, hash=False)
    """Where each value comes from that is not None (see :mod:`rfgen_sionna.generative.decisions`)."""
    arms: str = ""
    """What the arms do beside the action, or empty."""
    sentence: str = ""
    """What the motion source reads itself, without distances, bodies and the like; empty where `action` says all."""
    avoid: str = ""
    """What the negative prompt says to a source that reads `sentence`."""
    notes: tuple[str, ...] = ()
    """Sentences about what is done instead of what was asked for."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """One sentence for each thing done instead and each phrase without effect."""
        return (*self.notes, *(f"prompt: {phrase!r} was not understood and has no effect" for phrase in self.unused))

    def decisions(self) -> list[Decision]:
        """Everything that is decided before there is a body: what words say, defaults, and what the seed drew."""
        known = ACTIONS.get(self.action)
        action = f"{self.action}: {known.description if known else 'as captured people do it'}"
        angle, bearing = self.orientation_deg or 0.0, self.bearing_deg or 0.0
        rows = [("target", f"a {self.target}"), ("action", action)]
        if self.arms:
            rows.append(("arms", f"{self.arms}: {ACTIONS[self.arms].description}"))
        if self.hand is not None:
            rows.append(("hand", self.hand))
        rows += [
            ("orientation", f"{angle:g}°{_FACING.get(angle, '')}"),
            ("distance", f"{DEFAULT_DISTANCE if self.distance_m is None else self.distance_m:g} m"),
            ("azimuth", f"{bearing:g}°{'' if bearing else ', straight ahead'}"),
            ("speed", f"× {1.0 if self.speed is None else self.speed:g}"),
            ("surroundings", self.surroundings or NOWHERE),
        ]
        found = [Decision(name, value, self.origins.get(name, DEFAULT)) for name, value in rows]
        for trait, value in self.body.traits().items():
            origin = self.origins.get(trait, drawn(self.seed))
            text = "open" if value is None else value if isinstance(value, str) else f"{value:g}{_UNITS[trait]}"
            found.append(Decision(trait, text, origin))
        return found

    def words(self) -> str:
        """Several lines: the phrases, and what each was read as."""
        lines = [f"prompt: {self.text}"]
        if self.negative:
            lines.append(f"negative: {self.negative}")
        width = max((len(phrase) for phrase, _ in self.understood), default=0)
        lines += [f"  {phrase:<{width}}  {meaning}" for phrase, meaning in self.understood]
        return "\n".join(lines)

    def report(self, decisions: Sequence[Decision] | None = None) -> str:
        """Several lines: what was understood and what was not, what is decided and where each value comes from.

        Args:
            decisions: what is known by now; None is :meth:`decisions`, in which a body that no words describe is
                still open.
        """
        lines = [self.words(), *(f"  {note}" for note in self.notes)]
        lines += [f"  not understood, no effect: {phrase}" for phrase in self.unused]
        lines += [DECIDED, *tabulate(self.decisions() if decisions is None else decisions)]
        return "\n".join(lines)


class UnreadActionError(PromptError):
    """The words name no one action that the grammar knows; another reader may know it."""

    def __init__(self, what: str, advice: str) -> None:
        super().__init__(f"{what}; {advice}")
        self.what = what
        """What is wrong, without what is allowed."""


def parse_prompt(prompt: str, negative: str = "", *, seed: int = 0, spoken: SourceReading | None = None) -> ScenePrompt:
    """Read what a prompt and a negative prompt ask for.

    Args:
        prompt: a sentence or keywords, such as "a tall man picks something up, facing left, at 2.5 m"; what follows
            the keyword "negative:" joins the negative prompt.
        negative: what is not wanted: it takes away choices, such as "left arm", "facing away" or "child".
        seed: seed for what both leave open.
        spoken: what a motion source makes of it (:func:`~rfgen_sionna.generative.sentences.read_prompt` asks one); the
            words of the action are then its concern.

    Raises:
        UnreadActionError: no known target or action, or several actions.
        PromptError: several targets, unknown surroundings, a negation inside either prompt,
            a number out of range, or two statements that contradict each other. The message lists what is known.
        ValueError: a seed that is none.
    """
    check_seed(seed)
    for name, text in (("prompt", prompt), ("negative", negative)):
        if not isinstance(text, str):
            raise TypeError(f"{name}: expected a text, got {type(text).__name__}")
    wanted, unwanted = split_negative(prompt)
    negative = ", ".join(part for part in (negative, unwanted) if part)
    said, denied = read_wanted(wanted), read_unwanted(negative)
    _refuse_negation(
        wanted, said, "prompt: {!r} negates something; say what you don't want in the negative prompt instead"
    )
    _refuse_negation(
        negative, denied, "negative prompt: {!r} negates what is forbidden already; name just what is not wanted"
    )
    if denied.targets and not denied.reader.understood:
        raise PromptError(f"negative prompt: {denied.targets[0]!r} forbids the only target that is known, a person")
    named = ("target", "action", "orientation", "distance", "azimuth", "speed", "surroundings")
    origins = dict.fromkeys(named, PROMPT)
    if not said.targets:
        if spoken is None and (said.unused or not said.actions):
            raise UnreadActionError(
                f"target: {prompt!r} names none that is known{_rest(said)}", f"known: a person, {_examples()}"
            )
        origins["target"] = DEFAULT
    options = _one_action(said, prompt) if spoken is None else frozenset({spoken.action})
    allowed = [
        a
        for a in (ACTIONS if spoken is None else options)
        if a in options and not any(a in named for _, named in denied.actions)
    ]
    if not allowed:
        asked = " and ".join(sorted(options))
        raise PromptError(f"action: the negative prompt {negative!r} forbids {asked}, which {prompt!r} asks for")
    action = allowed[int(np.random.default_rng([seed, 10]).integers(len(allowed)))]
    if len(allowed) > 1:
        origins["action"] = drawn(seed, allowed)
    understood, unread = tuple(said.reader.understood), said.unused
    if spoken is not None:
        origins |= {"action": spoken.origin, "arms": spoken.arms_origin}
        understood, unread = _credited(said, spoken)
    # the source that reads the sentence reads of hands, too
    by_source = spoken is not None and bool(spoken.sentence)
    hand, origins["hand"], unused = (None, DEFAULT, ()) if by_source else _hand(said, denied, action, seed)
    periodic = by_source or ACTIONS[action].periodic
    orientation = _one("orientation", said.orientations, denied.orientations)
    if orientation is None and any(angle == 0.0 for _, angle in denied.orientations):
        # Facing the radar is what a prompt without orientation gets, so forbidding it asks for another one.
        others = [a for a in (90.0, 180.0, 270.0) if all(a != angle for _, angle in denied.orientations)]
        if not others:
            raise PromptError(f"orientation: the negative prompt {negative!r} leaves none")
        orientation = others[int(np.random.default_rng([seed, 11]).integers(len(others)))]
        origins["orientation"] = drawn(seed, [f"{angle:g}°" for angle in others])
    body, from_words = draw_body(said.body, denied.body, seed)
    distance, bearing = _one("distance", said.distances), _one("azimuth", said.bearings)
    speed = _one("speed", said.speeds, denied.speeds)
    surroundings = _one("surroundings", said.scenes, denied.scenes)
    values = (True, True, orientation, distance, bearing, speed, surroundings)
    for name, value in zip(named, values, strict=True):
        if value is None:
            del origins[name]
    return ScenePrompt(
        text=prompt,
        negative=negative,
        seed=seed,
        action=action,
        choices=tuple(allowed),
        orientation_deg=orientation,
        distance_m=distance,
        bearing_deg=bearing,
        body=body,
        hand=hand,
        speed=speed,
        surroundings=surroundings,
        understood=(
            *understood,
            *((words, "repeated, as this action is") for words in said.repeated if periodic),
            *((words, f"not {meaning}") for words, meaning in denied.reader.understood),
        ),
        unused=(
            *unread,
            *(() if periodic else said.repeated),
            *unused,
            *(phrase for phrase in denied.unused if spoken is None or phrase not in spoken.read),
        ),
        origins=origins | from_words,
        arms=spoken.arms if spoken else "",
        sentence=spoken.sentence if spoken else "",
        avoid=spoken.avoid if spoken else "",
        notes=spoken.notes if spoken else (),
    )


def _credited(said: Phrases, spoken: SourceReading) -> tuple[tuple[tuple[str, str], ...], tuple[str, ...]]:
    """What is understood and what is not, where a motion source has read the words of the action."""
    performed = {spoken.action, spoken.arms}
    others = {words for words, named in said.actions if not named & {*performed, "standing"}}
    meaning = f"action {spoken.action}" + (f", arms {spoken.arms}" if spoken.arms else "")
    # a source that reads the sentence reads all of its words; by its name alone an action is no other one, too
    kept = [(words, m) for words, m in said.reader.understood if words not in others or not m.startswith("action ")]
    read = [phrase for phrase in said.unused if phrase in spoken.read]
    if spoken.sentence:
        read += sorted(others)
    lost = () if spoken.sentence else sorted(others)
    unused = (*(phrase for phrase in said.unused if phrase not in spoken.read), *lost)
    return (*kept, *((phrase, f"{meaning}, read by the motion model") for phrase in read)), unused


def _refuse_negation(text: str, read: Phrases, message: str) -> None:
    # Words of an action swallow a negation ("picks up a box without bending"), so the whole text counts; but
    # "environment: nothing" is a place.
    negation = negation_in(split_keyword(text)[0]) or negation_in(" , ".join(read.unused))
    if negation:
        raise PromptError(message.format(negation))


def check_seed(seed: int) -> None:
    """Whether numpy takes it.

    Raises:
        ValueError: it is no whole number of at least 0.
    """
    if isinstance(seed, bool) or not isinstance(seed, (int, np.integer)) or seed < 0:
        raise ValueError(f"seed is {seed!r}: a whole number of at least 0 is needed")


def _one_action(said: Phrases, prompt: str) -> frozenset[str]:
    """The action of a prompt, or the actions that it leaves open."""
    named = list(said.actions)
    if any("standing" not in options for _, options in named):
        named = [n for n in named if "standing" not in n[1]]  # everybody stands while doing something
    if any("jumping_jacks" in options for _, options in named):
        named = [n for n in named if n[1] != {"jump"}]
    if not named:
        raise UnreadActionError(f"action: {prompt!r} names none that is known{_rest(said)}", f"known: {_examples()}")
    if re.search(r"\bor\b", said.reader.text):
        return frozenset().union(*(options for _, options in named))
    options = frozenset(ACTIONS).intersection(*(options for _, options in named))
    if not options:
        words = ", ".join(repr(words) for words, _ in named)
        raise UnreadActionError(
            f"action: the prompt names several ({words})", 'name one, or join them with "or" to have one drawn'
        )
    return options


def _hand(said: Phrases, denied: Phrases, action: str, seed: int) -> tuple[str | None, str, tuple[str, ...]]:
    """The hand of a gesture, where it comes from, and the words about hands that have no effect on this action."""
    if not ACTIONS[action].one_handed:
        return None, DEFAULT, tuple(words for words, _ in said.hands)
    hand = _one("hand", said.hands, denied.hands)
    sides = {side for _, side in denied.hands} - {"both"}
    if sides == {"left", "right"} or (sides and hand == "both"):
        words = " and ".join(repr(words) for words, side in denied.hands if side in sides)
        raise PromptError(f"hand: the negative prompt forbids {words}, which {action!r} is done with")
    if hand in ACTIONS[action].hands:
        return hand, PROMPT, ()
    unused = tuple(words for words, _ in said.hands)
    if len(sides) == 1:
        return "right" if sides == {"left"} else "left", NEGATIVE, unused
    return preferred_hand(action, seed), drawn(seed), unused


def _one(name: str, said: list[tuple[str, T]], denied: Sequence[tuple[str, T]] = ()) -> T | None:
    """The one value that a prompt names, None where it names none."""
    if len({value for _, value in said}) > 1:
        raise PromptError(f"{name}: the prompt names several: {', '.join(repr(words) for words, _ in said)}")
    for words, value in denied:
        if said and value == said[0][1]:
            raise PromptError(f"{name}: the prompt asks for {said[0][0]!r}, the negative prompt forbids it ({words!r})")
    return said[0][1] if said else None


def _rest(said: Phrases) -> str:
    return f" (not understood: {', '.join(map(repr, said.unused))})" if said.unused else ""


def _examples() -> str:
    return ", ".join(action.description for action in ACTIONS.values())
