"""What words name, by the words themselves: places and furniture.

The encoder of :mod:`.text` learnt from whole captions. Of bare nouns, as negative prompts are, it makes anything.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache

from rfgen_sionna.generative.body_prompt import PromptError
from rfgen_sionna.generative.environment.captions import BACKGROUND, NAMES, USUAL, inflected
from rfgen_sionna.generative.negation import negation_in
from rfgen_sionna.generative.reading import Reader, normalise
from rfgen_sionna.generative.surroundings import PLACE_PATTERNS, EnvironmentPrompt
from rfgen_sionna.generative.vocabulary import FILLERS, SCENE_PATTERNS


@dataclass(frozen=True)
class Named:
    """What a text names."""

    places: tuple[str, ...]
    """By the names of :data:`~rfgen_sionna.generative.environment.captions.NAMES`."""
    things: tuple[str, ...]
    """Kinds of furniture, doors and windows, in alphabetical order."""
    rest: tuple[str, ...]
    """Phrases that name neither."""


def read(text: str, kinds: Iterable[str] = ()) -> Named:
    """What a text names, singular or plural, with or without articles: "sofas and a chest of drawers".

    Args:
        text: a sentence, or nouns.
        kinds: of furniture that are known beside those of :data:`~rfgen_sionna.generative.environment.captions.USUAL`.
    """
    reader = Reader(text)
    found = {meaning for pattern, meaning in _patterns(frozenset(kinds)) if reader.take(pattern)}
    return Named(
        tuple(place for place in NAMES if place in found),
        tuple(sorted(found - NAMES.keys())),
        reader.rest(FILLERS),
    )


def refuse_negation(text: str) -> None:
    """Refuse a prompt that says what isn't there.

    Raises:
        PromptError: it does; what the surroundings are without is the negative prompt's.
    """
    if negation := negation_in(text):
        raise PromptError(
            f"prompt: {text!r} negates something ({negation!r}); say what isn't there as negative=..., such as "
            "negative='a sofa'"
        )


@cache
def _patterns(kinds: frozenset[str]) -> Sequence[tuple[str, str]]:
    """(pattern, place or kind), in the order in which they are taken: an "office chair" is no office, and in a
    "car garage" no car is named."""
    known = sorted(kinds.union(*USUAL.values()) - {*BACKGROUND})
    things = [(inflected(kind), kind) for kind in known]
    names = [(inflected(normalise(name)), place) for place, said in NAMES.items() for name in said]
    names.sort(key=lambda each: -len(each[0]))
    scenes = [
        (pattern, place)
        for scene, pattern in {**SCENE_PATTERNS, **PLACE_PATTERNS}.items()
        if (place := EnvironmentPrompt(scene, scene).place)
    ]
    return (
        *(each for each in things if " " in each[1]),
        *names,
        *scenes,
        *(each for each in things if " " not in each[1]),
    )
