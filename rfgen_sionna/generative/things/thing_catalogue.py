"""Animals and things by name."""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping
from types import MappingProxyType

from rfgen_sionna.generative.things import animal_kinds, cycling, household, pushed, road_vehicles, rotors
from rfgen_sionna.generative.things.thing_kind import ThingAction, ThingKind

THINGS: Mapping[str, ThingKind] = MappingProxyType(
    {
        kind.name: kind
        for module in (animal_kinds, road_vehicles, cycling, rotors, household, pushed)
        for kind in module.KINDS
    }
)
"""Every kind by its name."""


def things() -> Mapping[str, ThingKind]:
    """Animals and things by name, with their actions, sizes and parameters."""
    return THINGS


def thing_kind(name: str) -> ThingKind:
    """Kind of a name, such as "robot vacuum".

    Raises:
        ValueError: there is none; the message has the nearest names.
        TypeError: the name is no text.
    """
    if not isinstance(name, str):
        raise TypeError(f"thing: {name!r} given, the name of an animal or a thing is needed")
    key = re.sub(r"[\s_-]+", "_", name.strip().lower())
    if key in THINGS:
        return THINGS[key]
    near = difflib.get_close_matches(key, THINGS, 3, 0.5)
    hint = f", did you mean {' or '.join(map(repr, near))}?" if near else ""
    raise ValueError(f"thing: unknown {name!r}{hint}; known are {', '.join(THINGS)}")


def thing_action(kind: ThingKind, action: str | None) -> tuple[str, ThingAction]:
    """Name and record of an action of a kind; None takes its first.

    Raises:
        ValueError: it has no such action.
    """
    if action is None:
        action = next(iter(kind.actions))
    if action not in kind.actions:
        raise ValueError(f"action: {action!r} is none of a {kind.name}; it has {', '.join(kind.actions)}")
    return action, kind.actions[action]


def bounces_of(name: str) -> int:
    """Surfaces on the paths of the return of a kind; 1 for anything else."""
    return THINGS[name].bounces if name in THINGS else 1
