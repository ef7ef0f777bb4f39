"""Interpretation of prompts: target, action, orientation, distance, body, surroundings.

A pattern of :mod:`.vocabulary` reads a phrase, or the phrase is reported as not understood. The seed draws one of the
options that the words leave open ("raises an arm") and the negative prompt allows.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from rfgen_sionna.generative.decisions import DEFAULT, NEGATIVE, PROMPT, drawn
from rfgen_sionna.generative.manner import Manner
from rfgen_sionna.generative.motion.actions import ACTIONS
from rfgen_sionna.generative.motion.kinematic import preferred_hand
from rfgen_sionna.generative.prompts.body_prompt import draw_body
from rfgen_sionna.generative.prompts.environment_prompt import split_keyword
from rfgen_sionna.generative.prompts.phrases import Phrases, read_unwanted, read_wanted
from rfgen_sionna.generative.prompts.prompt_error import PromptError
from rfgen_sionna.generative.prompts.scene_prompt import CLIP, ScenePrompt, check_seed
from rfgen_sionna.generative.prompts.text_reader import negation_in, split_negative

T = TypeVar("T")


@dataclass(frozen=True)
class SourceReading:
    """Interpretation of a prompt by a motion source, for prompts without a single action of the grammar."""

    action: str
    origin: str
    """Origin of the action."""
    arms: str = ""
    """Action of the arms; empty for the same one."""
    arms_origin: str = ""
    """Origin of the action of the arms."""
    sentence: str = ""
    """Sentence for the source; empty if the name of the action suffices."""
    avoid: str = ""
    """Negative sentence for the source."""
    read: frozenset[str] = frozenset()
    """Phrases that the source understands and the grammar does not."""
    notes: tuple[str, ...] = ()
    """Warnings about replaced actions."""


class UnreadActionError(PromptError):
    """The grammar finds no single action; a motion source may."""

    def __init__(self, problem: str, advice: str) -> None:
        super().__init__(f"{problem}; {advice}")
        self.problem = problem
        """The message without the advice."""


def parse_prompt(
    prompt: str, negative: str = "", *, seed: int = 0, reading: SourceReading | None = None
) -> ScenePrompt:
    """Interpret a prompt and a negative prompt.

    Args:
        prompt: a sentence or keywords, such as "a tall man picks something up, facing left, at 2.5 m"; words after the
            keyword "negative:" join the negative prompt.
        negative: unwanted choices, such as "left arm", "facing away" or "child".
        seed: seed of open choices.
        reading: interpretation of the action by a motion source (:mod:`.prompt_reader`); None leaves the action
            to the grammar.

    Raises:
        UnreadActionError: no known target or action, or several actions.
        PromptError: several targets, unknown surroundings, a negation, a number out of range, or a contradiction.
        TypeError: a prompt is not a text.
        ValueError: the seed is invalid.
    """
    check_seed(seed)
    for name, text in (("prompt", prompt), ("negative", negative)):
        if not isinstance(text, str):
            raise TypeError(f"{name}: expected a text, got {type(text).__name__}")
    wanted, unwanted = split_negative(prompt)
    negative = ", ".join(part for part in (negative, unwanted) if part)
    said, denied = read_wanted(wanted), read_unwanted(negative)
    _refuse_negation(wanted, said, "prompt: {!r} negates something; unwanted choices go into the negative prompt")
    _refuse_negation(
        negative, denied, "negative prompt: {!r} negates what is forbidden already; name the unwanted choice alone"
    )
    if denied.targets and not denied.reader.understood:
        raise PromptError(f"negative prompt: {denied.targets[0]!r} forbids the only target that is known, a person")
    named = ("target", "action", "orientation", "distance", "azimuth", "speed", "surroundings")
    origins = dict.fromkeys(named, PROMPT)
    if not said.targets:
        if reading is None and (said.unused or not (said.actions or said.breathing or said.heart)):
            raise UnreadActionError(
                f"target: {prompt!r} names none that is known{_rest(said)}", f"known: a person, {_examples()}"
            )
        origins["target"] = DEFAULT
    options = _one_action(said, prompt) if reading is None else frozenset({reading.action})
    allowed = [
        a
        for a in (ACTIONS if reading is None else options)
        if a in options and not any(a in named for _, named in denied.actions)
    ]
    if not allowed:
        raise PromptError(forbidden(negative, sorted(options), prompt))
    action = allowed[int(np.random.default_rng([seed, 10]).integers(len(allowed)))]
    if len(allowed) > 1:
        origins["action"] = drawn(seed, allowed)
    understood, unread = tuple(said.reader.understood), said.unused
    if reading is not None:
        origins |= {"action": reading.origin, "arms": reading.arms_origin}
        understood, unread = _credited(said, reading)
    # a source that reads the sentence reads its hands, too
    by_source = reading is not None and bool(reading.sentence)
    by_clip = action.startswith(CLIP)
    if by_source or by_clip:
        hand, origins["hand"], unused = None, DEFAULT, tuple(words for words, _ in said.hands if by_clip)
    else:
        hand, origins["hand"], unused = _hand(said, denied, action, seed)
    periodic = by_source or (not by_clip and ACTIONS[action].periodic)
    orientation = _one("orientation", said.orientations, denied.orientations)
    if orientation is None and any(angle == 0.0 for _, angle in denied.orientations):
        # Facing the radar is the default: without it another orientation is drawn.
        others = [a for a in (90.0, 180.0, 270.0) if all(a != angle for _, angle in denied.orientations)]
        if not others:
            raise PromptError(f"orientation: the negative prompt {negative!r} leaves none")
        orientation = others[int(np.random.default_rng([seed, 11]).integers(len(others)))]
        origins["orientation"] = drawn(seed, [f"{angle:g}°" for angle in others])
    body, from_words = draw_body(said.body, denied.body, seed)
    distance, bearing = _one("distance", said.distances), _one("azimuth", said.bearings)
    speed = _one("speed", said.speeds, denied.speeds)
    surroundings = _one("surroundings", said.scenes, denied.scenes)
    breathing, heart = _one("breathing", said.breathing), _one("heart", said.heart)
    origins |= {name: PROMPT for name, value in (("breathing", breathing), ("heart", heart)) if value is not None}
    values = (True, True, orientation, distance, bearing, speed, surroundings)
    for name, value in zip(named, values, strict=True):
        if value is None:
            del origins[name]
    return ScenePrompt(
        text=prompt, negative=negative, seed=seed, action=action, choices=tuple(allowed), orientation_deg=orientation,
        distance_m=distance, bearing_deg=bearing, body=body, manner=Manner(speed=speed, hand=hand),
        surroundings=surroundings, breathing_rate=breathing, heart_rate=heart,
        understood=(
            *understood,
            *((words, "repeated, as this action is") for words in said.repeated if periodic),
            *((words, f"not {meaning}") for words, meaning in denied.reader.understood),
        ),
        unused=(
            *unread,
            *(() if periodic else said.repeated),
            *unused,
            *(phrase for phrase in denied.unused if reading is None or phrase not in reading.read),
        ), origins=origins | from_words, arms=reading.arms if reading else "",
        sentence=reading.sentence if reading else "", avoid=reading.avoid if reading else "",
        notes=reading.notes if reading else (),
    )  # fmt: skip


def _credited(said: Phrases, reading: SourceReading) -> tuple[tuple[tuple[str, str], ...], tuple[str, ...]]:
    """Understood and unused phrases of a prompt with an action by a motion source."""
    performed = {reading.action, reading.arms}
    others = {words for words, named in said.actions if not named & {*performed, "standing"}}
    meaning = f"action {reading.action}" + (f", arms {reading.arms}" if reading.arms else "")
    # a source reads all words of its sentence; an action by name alone leaves other actions unused
    kept = [(words, m) for words, m in said.reader.understood if words not in others or not m.startswith("action ")]
    read = [phrase for phrase in said.unused if phrase in reading.read]
    if reading.sentence:
        read += sorted(others)
    lost = () if reading.sentence else sorted(others)
    unused = (*(phrase for phrase in said.unused if phrase not in reading.read), *lost)
    return (*kept, *((phrase, f"{meaning}, read by the motion model") for phrase in read)), unused


def _refuse_negation(text: str, read: Phrases, message: str) -> None:
    # The whole text: phrases contain negations ("picks up a box without bending"); "environment: nothing" is a place.
    negation = negation_in(split_keyword(text)[0]) or negation_in(" , ".join(read.unused))
    if negation:
        raise PromptError(message.format(negation))


def forbidden(negative: str, actions: Sequence[str], prompt: str) -> str:
    """Message about actions of a prompt that its negative prompt forbids."""
    return f"action: the negative prompt {negative!r} forbids {' and '.join(actions)}, which {prompt!r} asks for"


def _one_action(said: Phrases, prompt: str) -> frozenset[str]:
    """Action of a prompt, or the actions that it leaves open."""
    named = list(said.actions)
    if any("standing" not in options for _, options in named):
        named = [n for n in named if "standing" not in n[1]]  # other actions include standing
    if any("jumping_jacks" in options for _, options in named):
        named = [n for n in named if n[1] != {"jump"}]
    if not named and (said.breathing or said.heart):
        return frozenset({"standing"})
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
    """Hand of a gesture, its origin, and words about hands without effect."""
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
    """Value of a quantity in a prompt; None without one, PromptError for several or a forbidden one."""
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
