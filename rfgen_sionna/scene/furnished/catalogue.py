"""Furnished places by name."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np

from rfgen_sionna.scene.furnished.furnished_scene import FurnishedScene, assemble
from rfgen_sionna.scene.furnished.layout import Plan
from rfgen_sionna.scene.furnished.places.homes import bedroom, living_room
from rfgen_sionna.scene.furnished.places.outside import open_field, playground, street
from rfgen_sionna.scene.furnished.places.passages import corridor, garage
from rfgen_sionna.scene.furnished.places.work import classroom, lab, office
from rfgen_sionna.scene.scene_errors import SceneError

_MAKERS: Mapping[str, tuple[Callable[[np.random.Generator], Plan], bool]] = MappingProxyType(
    {
        "living room": (living_room, True),
        "bedroom": (bedroom, True),
        "office": (office, True),
        "lab": (lab, True),
        "corridor": (corridor, True),
        "classroom": (classroom, True),
        "garage": (garage, True),
        "street": (street, False),
        "playground": (playground, False),
        "open field": (open_field, False),
    }
)
"""Place to its maker and whether it is indoors."""

PLACES: tuple[str, ...] = tuple(_MAKERS)
"""Names of all places."""


def furnished(place: str, seed: int = 0, frequency: float = 77e9) -> FurnishedScene:
    """A furnished place, a scene for :class:`~rfgen_sionna.simulation.Simulator`.

    The floor is z = 0, free for a radar at (0, 0, 1) that points along +x and a person at 1.2 m < x < 4.3 m,
    \\|y\\| < 1.2 m (less in a narrow corridor).

    Parameters
    ----------
    place
        One of :data:`PLACES`, in any spelling: "living room", "a living_room".
    seed
        Seed of sizes, furniture, finishes and positions.
    frequency
        Frequency of the surfaces' scattering coefficients [Hz].

    Raises
    ------
    SceneError
        There is no such place.
    TypeError, ValueError
        The seed is no whole number of at least 0, or the frequency is not positive.
    """
    name = place_name(place)
    if isinstance(seed, bool) or not isinstance(seed, (int, np.integer)):
        raise TypeError(f"seed: {seed!r} given, a whole number of at least 0 is needed")
    if seed < 0:
        raise ValueError(f"seed: {seed} given, a whole number of at least 0 is needed")
    if not (np.isfinite(frequency) and frequency > 0.0):
        raise ValueError(f"frequency: {frequency!r} given, a positive value [Hz] is needed")
    make, indoors = _MAKERS[name]
    rng = np.random.default_rng([int(seed), zlib.crc32(name.encode())])
    return assemble(name, int(seed), make(rng), indoors, float(frequency))


def place_name(place: str) -> str:
    """Name in :data:`PLACES` of a text.

    Raises
    ------
    SceneError, TypeError
        There is no such place, or `place` is no text.
    """
    if not isinstance(place, str):
        raise TypeError(f"place: {type(place).__name__} given, one of {', '.join(PLACES)} is needed")
    words = place.lower().replace("_", " ").replace("-", " ").split()
    while words and words[0] in ("a", "an", "the", "in", "furnished"):
        words = words[1:]
    name = " ".join(words)
    aliases = {"laboratory": "lab", "field": "open field", "livingroom": "living room", "hallway": "corridor"}
    name = aliases.get(name, name)
    if name not in PLACES:
        raise SceneError(f"unknown place {place!r}; there are {', '.join(PLACES)}")
    return name
