"""Captions of simulated falls, in the simple and the progressive present."""

from __future__ import annotations

_TEXTS: dict[str, tuple[tuple[str, str], ...]] = {
    "trip": (
        ("trips while walking and falls forward to the floor", "is tripping while walking and falling forward"),
        ("catches a foot on something and falls forward", "is catching a foot on something and falling forward"),
    ),
    "forward": (
        ("falls forward to the floor", "is falling forward to the floor"),
        ("loses balance and falls forward", "is losing balance and falling forward"),
    ),
    "backward": (
        ("falls backward to the floor", "is falling backward to the floor"),
        ("loses balance and falls backward", "is losing balance and falling backward"),
    ),
    "left": (
        ("falls to the left side", "is falling sideways to the left"),
        ("loses balance and falls on the left side", "is losing balance and falling to the left"),
    ),
    "right": (
        ("falls to the right side", "is falling sideways to the right"),
        ("loses balance and falls on the right side", "is losing balance and falling to the right"),
    ),
    "slip": (
        ("slips while walking and falls to the floor", "is slipping on the floor and falling"),
        ("slips on a wet floor and falls down", "is slipping on a wet floor and falling down"),
    ),
    "faint": (
        ("faints and sinks to the floor", "is fainting and sinking to the floor"),
        ("collapses to the floor", "is collapsing to the floor"),
    ),
    "from_chair": (
        ("falls off a chair to the floor", "is falling off a chair to the floor"),
        ("slumps and falls from a chair", "is slumping and falling from a chair"),
    ),
    "sink": (
        ("sits down heavily on a chair", "is sinking heavily onto a chair"),
        ("drops onto a chair", "is dropping onto a chair"),
    ),
    "stumble": (
        ("stumbles while walking and catches the balance", "is stumbling while walking and recovering"),
        ("trips over something and walks on", "is tripping over something and walking on"),
    ),
}


def captions(kind: str) -> tuple[str, ...]:
    """Sentences that are true of each clip of a kind."""
    return tuple(f"a person {words}" for pair in _TEXTS[kind] for words in pair)
