"""Actions of the phrases of a prompt: one, several of which the seed draws, or one of the arms over one of the legs."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

from rfgen_sionna.generative.action_catalogue import ACTION_CLAUSES
from rfgen_sionna.generative.performing import performable
from rfgen_sionna.generative.prompts.action_reader import ActionReader, ActionReading
from rfgen_sionna.generative.prompts.prompt_error import PromptError
from rfgen_sionna.generative.prompts.text_reader import AFTERWARDS
from rfgen_sionna.generative.prompts.unmade_variants import (
    refuse_limbs,
    refuse_passive,
    refuse_unmade,
    words_without_effect,
)
from rfgen_sionna.generative.prompts.vocabulary import FILLERS
from rfgen_sionna.generative.prompts.word_order import FAMILIES, limb_side

_PART_WORDS = {
    "hand": "arm", "hands": "arm", "arms": "arm", "foot": "leg", "feet": "leg", "knee": "leg", "legs": "leg",
    "leftwards": "left", "rightwards": "right", "anticlockwise": "counterclockwise",
}  # fmt: skip
_NAME_PARTS = frozenset({"left", "right", "arm", "leg", "swipe", "circle", "clockwise", "counterclockwise"})
_SMALL = frozenset({"the", "a", "an", "to", "of", "or", "and", "his", "her", "their"})


_NO_NEWS = FILLERS | {
    "hand", "hands", "arm", "arms", "leg", "legs", "foot", "feet", "back", "forth", "left", "right", "up", "down",
    "towards", "toward", "leftwards", "rightwards", "forward", "forwards", "backwards", "t", "y", "kept", "both",
}  # fmt: skip
"""Words whose absence from the wordings of an action means nothing."""
_COUNTS = (
    r"\b(?:once|twice|thrice|(?:two|three|four|five|six|seven|eight|nine|ten|twelve|twenty)"
    r"(?= (?:times|[a-z]+s\b))(?: times)?)\b(?! (?:hands|arms|feet|legs|fists|fingers))"
)
"""Numbers of repetitions: the duration gives these."""


@dataclass(frozen=True)
class ActionChoice:
    """Actions of a prompt."""

    options: tuple[str, ...]
    """The action, or several that the words leave open."""
    arms: tuple[str, ...] = ()
    """The same of the arms, where the legs do another action."""
    side: str = ""
    """"left" or "right" in the words, where the action leaves it open."""
    lost: tuple[str, ...] = ()
    """Words without effect."""
    known: str = ""
    """Phrase that was read."""


def choose_action(clauses: Sequence[str], prompt: str) -> ActionChoice:
    """Actions of the clauses of a prompt; clauses beside the one that names an action have no effect.

    Raises:
        PromptError: nothing that can be done is near enough, or there are several actions.
        ImportError: the packages of the reader are missing.
    """
    refuse_passive(prompt)
    refuse_limbs(prompt)
    phrase = " , ".join(clauses)
    parts = [part.strip(" ,") for part in re.split(r"\bor\b", phrase) if part.strip(" ,")]
    if len(parts) > 1:
        readings = [read_action(part) for part in parts]
        if all(reading.possible for reading in readings):
            for part, each in zip(parts, readings, strict=True):
                refuse_unmade(each.options or (each.action,), part)
            return ActionChoice(
                tuple(dict.fromkeys(a for r in readings for a in r.options or (r.action,))), known=phrase
            )
    reading = read_action(phrase)
    if not reading.possible:
        near = "; ".join(dict.fromkeys(f"a person {ACTION_CLAUSES.get(name, name)}" for name in reading.nearest))
        raise PromptError(
            f"action: {prompt!r} cannot be done: {reading.reason}; the nearest that can be done are: {near}"
        )
    refuse_unmade(reading.options or (reading.action,), phrase)
    sides = set(re.findall(r"\b(left|right)\b", phrase))
    mirrored = {"left", "right"} & set("_".join((*reading.options, reading.action)).split("_"))
    sequence = AFTERWARDS.search(phrase) is not None
    if len(sides) == 2 and len(parts) == 1 and (sequence or (len(reading.options) > 1 and mirrored)):
        raise PromptError(
            f'action: {prompt!r} names several, to the left and to the right; name one, or write "left or right" to '
            "have one drawn"
        )
    arms = _open(reading.arms, phrase) if reading.arms else ()
    lost = tuple(word for word in reading.unknown if word not in _NO_NEWS)
    lost += tuple(words for words in re.findall(_COUNTS, phrase) if not set(words.split()) & set(lost))
    options = reading.options or (reading.action,)
    lost += tuple(words for words in words_without_effect(options, phrase) if words not in lost)
    return ActionChoice(options, arms, reading.side, lost, phrase)


def named_actions(phrase: str) -> frozenset[str]:
    """Actions that a phrase of a negative prompt forbids: by side, limb or direction, or by meaning with all their
    kinds; empty for none."""
    words = {_PART_WORDS.get(word, word) for word in phrase.replace("counter clockwise", "counterclockwise").split()}
    words -= _SMALL
    if words and words <= _NAME_PARTS:
        return frozenset(action for action in ACTION_CLAUSES if words <= set(action.split("_")))
    reading = read_action(phrase)
    if not reading.possible:
        return frozenset()
    named = set(reading.options or (reading.action,))
    kinds = {each for each in ACTION_CLAUSES for name in named if set(name.split("_")) < set(each.split("_"))}
    return frozenset(named | kinds)


@cache
def read_action(phrase: str) -> ActionReading:
    """Reading of a phrase with a person as its subject."""
    return _reader().read(f"a person {phrase}")


@cache
def _reader() -> ActionReader:
    return ActionReader(performable())


def _open(action: str, phrase: str) -> tuple[str, ...]:
    """Action of the arms, with the one of the other side if the words name none."""
    family = next((family for family in FAMILIES.values() if action in family), (action,))
    return (action,) if limb_side(phrase) or action in ("kick", "fall") else family
