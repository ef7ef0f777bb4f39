"""Captions of views of places, in several wordings, and what is not in them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np

from rfgen_sionna.generative.environment.requested_objects import NAMES, OUTDOORS

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
_INSIDE = ("the inside of", "furnished")
BACKGROUND = ("floor", "ceiling", "ground", "wall", "skirting board", "pavement", "kerb", "person")
"""What every such place has: no caption names it."""

_PLURAL = ("tyres",)


def named(objects: Sequence[str]) -> list[str]:
    """The kinds that a caption may name, in the order given, each once."""
    found = dict.fromkeys(kind for kind in objects if not any(word in kind.split() for word in _words()))
    return list(found)


def _words() -> set[str]:
    return {word for kind in BACKGROUND for word in kind.split()}


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


def article(noun: str) -> str:
    """The noun with "a" or "an"; plurals stay."""
    if noun in _PLURAL:
        return noun
    return f"{'an' if noun[0] in 'aeiou' else 'a'} {noun}"
