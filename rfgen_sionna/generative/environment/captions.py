"""What a view of a place is called: captions in several wordings, and what is not in it for negative prompts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np

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
"""What each place is called; the first is its name."""

USUAL: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "living room": (
            "sofa",
            "television",
            "armchair",
            "bookshelf",
            "sideboard",
            "table",
            "floor lamp",
            "plant",
            "coffee table",
            "rug",
        ),
        "bedroom": ("bed", "wardrobe", "nightstand", "chest of drawers", "armchair", "desk", "plant", "floor lamp"),
        "office": (
            "desk",
            "office chair",
            "bookshelf",
            "filing cabinet",
            "whiteboard",
            "plant",
            "coat rack",
            "cupboard",
        ),
        "lab": ("workbench", "stool", "sink", "cabinet", "gas cylinder", "shelf"),
        "corridor": ("door", "bench", "plant", "locker", "radiator", "picture", "coat rack"),
        "classroom": ("desk", "chair", "blackboard", "whiteboard", "cupboard", "bookshelf"),
        "garage": ("car", "bicycle", "shelf", "workbench", "tyres", "dustbin"),
        "street": ("car", "lamp post", "tree", "house", "bicycle", "traffic sign", "bench", "hedge"),
        "playground": ("swing", "slide", "seesaw", "climbing frame", "sandpit", "bench", "tree", "spring rider"),
        "open field": ("tree", "bush", "fence", "rock", "hay bale", "hedge"),
    }
)
"""What such places usually hold."""

TEMPLATES = (
    "{a} {place}",
    "{a} {place} with {things}",
    "{a} {place}, {things}",
    "in {a} {place} with {things}",
    "{things} in {a} {place}",
    "{a} {place} where there is {things}",
    "the inside of {a} {place} with {things}",
    "{a} {place} furnished with {things}",
    "{a} {place}. There is {things}.",
    "radar view of {a} {place} with {things}",
    "view into {a} {place}, one sees {things}",
    "{place}: {things}",
)
OUTDOORS = ("street", "playground", "open field")
_INSIDE = ("the inside of", "furnished")
_PLURAL = ("tyres",)
BACKGROUND = ("floor", "ceiling", "ground", "wall", "skirting board", "pavement", "kerb", "person")
"""What every such place has: no caption names it."""


def named(objects: Sequence[str]) -> list[str]:
    """The kinds that a caption may name, in the order given, each once."""
    found = dict.fromkeys(kind for kind in objects if not any(word in kind.split() for word in _words()))
    return list(found)


def _words() -> set[str]:
    return {word for kind in BACKGROUND for word in kind.split()}


def article(noun: str) -> str:
    """The noun with "a" or "an"; plurals stay."""
    if noun in _PLURAL:
        return noun
    return f"{'an' if noun[0] in 'aeiou' else 'a'} {noun}"


def listed(things: Sequence[str]) -> str:
    """Several nouns as a phrase: "a sofa, a rug and a plant"."""
    phrases = [article(thing) for thing in things]
    return phrases[0] if len(phrases) == 1 else f"{', '.join(phrases[:-1])} and {phrases[-1]}"


def caption(place: str, objects: Sequence[str], rng: np.random.Generator, people: int = 0) -> str:
    """One wording of what a view shows.

    Parameters
    ----------
    place
        A key of :data:`NAMES`.
    objects
        Kinds of furniture in view, the largest first; some of them are named.
    rng
        Chooses the wording.
    people
        How many there are in view.
    """
    names = NAMES[place]
    name = names[0] if rng.random() < 0.5 else names[int(rng.integers(len(names)))]
    things = named(objects)[:5]
    if things:
        count = int(rng.integers(1, min(3, len(things)) + 1))
        chosen = sorted(rng.choice(len(things), count, replace=False).tolist())
        templates = [t for t in TEMPLATES if place not in OUTDOORS or not any(word in t for word in _INSIDE)]
        form = templates[0] if rng.random() < 0.2 else templates[int(rng.integers(1, len(templates)))]
        text = form.format(a=article(name).split()[0], place=name, things=listed([things[i] for i in chosen]))
    else:
        text = f"{'an empty' if rng.random() < 0.5 else article(name).split()[0]} {name}"
    if people:
        text = f"{text}, {'a person' if people == 1 else f'{people} people'} in it"
    return text


def absent(place: str, kinds: Sequence[str]) -> list[str]:
    """What such a place usually holds and this one, with its `kinds`, does not."""
    return [thing for thing in USUAL[place] if thing not in kinds]


def negative(place: str, without: Sequence[str], rng: np.random.Generator) -> str:
    """A negative prompt: some of the things that are not there, or another place."""
    if without and rng.random() < 0.8:
        count = int(rng.integers(1, min(3, len(without)) + 1))
        return ", ".join(without[i] for i in sorted(rng.choice(len(without), count, replace=False).tolist()))
    others = [name for name in NAMES if name != place]
    return article(others[int(rng.integers(len(others)))])
