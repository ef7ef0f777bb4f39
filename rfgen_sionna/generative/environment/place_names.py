"""What a view of a place is called: captions in several wordings, and what is not in it for negative prompts."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

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

OUTDOORS = ("street", "playground", "open field")
_PLURAL = ("tyres",)


def article(noun: str) -> str:
    """The noun with "a" or "an"; plurals stay."""
    if noun in _PLURAL:
        return noun
    return f"{'an' if noun[0] in 'aeiou' else 'a'} {noun}"
