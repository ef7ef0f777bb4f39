"""Objects and places that words name, by patterns, and names of places.

The encoder of :mod:`.place_encoder` is trained on whole captions and unreliable on bare nouns, as in negative prompts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType

from rfgen_sionna.generative.furniture import EMPTY, SURFACES, names
from rfgen_sionna.generative.prompts.environment_prompt import PLACE_PATTERNS, EnvironmentPrompt
from rfgen_sionna.generative.prompts.prompt_error import PromptError
from rfgen_sionna.generative.prompts.text_reader import Reader, inflected, negation_in, normalise
from rfgen_sionna.generative.prompts.vocabulary import FILLERS, SCENE_PATTERNS

NAMES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "living room": ("living room", "lounge", "sitting room", "family room"),
        "bedroom": ("bedroom", "sleeping room", "room to sleep in"),
        "office": ("office", "office room", "work room", "study"),
        "lab": ("lab", "laboratory", "research lab", "science laboratory"),
        "corridor": ("corridor", "hallway", "passage", "long hall"),
        "classroom": ("classroom", "school room", "lecture room", "class room"),
        "garage": ("garage", "car garage", "workshop garage"),
        "street": ("street", "road in a town", "residential street", "city street"),
        "playground": ("playground", "children's playground", "play area"),
        "open field": ("open field", "meadow", "field", "grassland"),
    }
)
"""Place -> its names; the first is the main one."""

OUTDOORS = ("street", "playground", "open field")

_PLAIN = frozenset((
    "furnished", "indoor", "inside", "interior", "it", "man", "people", "person", "radar", "room", "scene", "seen",
    "sees", "somebody", "someone", "typical", "usual", "view", "where", "woman",
))  # fmt: skip
"""Words without information on a place."""


@dataclass(frozen=True)
class NamedObjects:
    """Objects that a text names."""

    places: tuple[str, ...]
    """Keys of :data:`NAMES`."""
    words: tuple[tuple[str, tuple[str, ...]], ...]
    """Words for furniture, doors and windows, with their possible kinds."""
    rest: tuple[str, ...]
    """Remaining phrases."""
    surfaces: tuple[tuple[str, str, tuple[str, ...]], ...] = ()
    """Words for finishes of walls, floors and ceilings ("a carpeted floor"), with the surface and its possible finishes
    (:data:`~rfgen_sionna.scene.furnished.finishes.FINISHES`)."""

    @property
    def lost(self) -> tuple[str, ...]:
        """Remaining phrases that may describe a place."""
        return tuple(each for each in self.rest if not {*each.split()} <= _PLAIN and not Reader(each).take(EMPTY))

    @property
    def meant(self) -> tuple[tuple[str, ...], ...]:
        """Possible kinds of each word."""
        return tuple(kinds for _, kinds in self.words)

    @property
    def things(self) -> tuple[str, ...]:
        """All kinds of furniture, doors and windows, in alphabetical order."""
        return tuple(sorted({kind for kinds in self.meant for kind in kinds}))


def read_objects(text: str) -> NamedObjects:
    """Objects in a text, singular or plural, with or without articles: "sofas and a chest of drawers"."""
    reader = Reader(text)
    surfaces = [
        (match.group(), surface, meant) for pattern, surface, meant in SURFACES for match in reader.take(pattern)
    ]
    found = [(match.group(), meant) for pattern, meant in _patterns() for match in reader.take(pattern)]
    places = {place for _, meant in found for place in meant}
    return NamedObjects(
        tuple(place for place in NAMES if place in places),
        tuple((words, meant) for words, meant in found if not NAMES.keys() & set(meant)),
        reader.rest(FILLERS),
        tuple(surfaces),
    )


def is_empty(text: str) -> bool:
    """Whether a text describes an empty place: "an empty office"."""
    return bool(Reader(text).take(EMPTY))


def check_words(prompt: str, negative: str, fields: tuple[str, str] = ("prompt", "negative")) -> None:
    """Refuse contradictory prompts.

    Args:
        prompt: description of the surroundings.
        negative: absent objects; empty for none.
        fields: names of the two in messages.

    Raises:
        ValueError: the prompt is empty, or the negative prompt is no text.
        PromptError: one of them has a negation, or the negative prompt excludes an object of the prompt.
    """
    wanted, unwanted = fields
    if not isinstance(prompt, str) or not prompt.strip():
        raise ValueError(f"{wanted} is {prompt!r}: a description of the surroundings is needed")
    if not isinstance(negative, str):
        raise ValueError(f"{unwanted} is {negative!r}: words for what isn't there are needed, or '' for none")
    if word := negation_in(prompt):
        raise PromptError(
            f"{wanted}: {prompt!r} negates something ({word!r}); say what isn't there as {unwanted}=..., such as "
            f"{unwanted}='a sofa'"
        )
    if word := negation_in(negative):
        raise PromptError(
            f"{unwanted}: {negative!r} negates what is left out already ({word!r}); name just what isn't there, "
            f"such as {unwanted}='a sofa'"
        )
    asked, excluded = read_objects(prompt), read_objects(negative)
    clash = [words for words, kinds in asked.words if {*kinds} <= {*excluded.things}]
    # "office desk" is a desk, "desk, office" a place as well
    denied = [read_objects(part) for part in negative.split(",")]
    clash += [place for each in denied if not each.words for place in each.places if place in asked.places]
    if clash:
        raise PromptError(
            f"{wanted}: {prompt!r} asks for {clash[0]!r}, which {unwanted} {negative!r} excludes: take it out "
            "of one of them"
        )


@cache
def _patterns() -> Sequence[tuple[str, tuple[str, ...]]]:
    """(pattern, place or kinds) in order of use: "office chair" before "office", "car garage" before "car"."""
    things = names()
    places = [(inflected(normalise(name)), (place,)) for place, said in NAMES.items() for name in said]
    places.sort(key=lambda each: -len(each[0]))
    scenes = [
        (pattern, (place,))
        for scene, pattern in {**SCENE_PATTERNS, **PLACE_PATTERNS}.items()
        if (place := EnvironmentPrompt(scene, scene).place)
    ]
    return (
        *((name.pattern, name.kinds) for name in things if name.compound),
        *places,
        *scenes,
        *((name.pattern, name.kinds) for name in things if not name.compound),
    )
