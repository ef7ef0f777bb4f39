"""Surroundings in a recipe: one name for each place, whatever packages are installed, and its size."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from rfgen_sionna.generative.environment_setup import ImageOptions, chosen_source
from rfgen_sionna.generative.prompts.environment_prompt import in_words, parse_environment, split_source
from rfgen_sionna.recipes.recording_spec import FREE_SPACE
from rfgen_sionna.scene.furnished import furnished
from rfgen_sionna.scene.load import available_scenes, is_path
from rfgen_sionna.scene.scene import Interior, read_interior

CHECKED_LAYOUTS = 3
"""Layouts of a furnished place whose sizes are checked: its first ones."""


@dataclass(frozen=True)
class Place:
    """One of the surroundings of a recipe."""

    name: str
    """As :class:`~rfgen_sionna.recipes.RecordingSpec` has it."""
    kind: str
    """"none", "scene", "furnished" or "diffusion"."""
    file: str | None = None
    """Absolute path of a scene that the recipe gives by a file, whose `name` is that of the file."""

    @property
    def has_layouts(self) -> bool:
        """Whether a seed makes different places of it."""
        return self.kind in ("furnished", "diffusion")


def read_place(text: str, located: Callable[[str], Path]) -> Place:
    """The place of a text such as "free space", "living_room", "furnished: an office", "an office" or "street.xml".

    A place in words is furnished, unless a source says otherwise.

    Args:
        text: the words.
        located: function that gives the absolute path of a file.

    Raises:
        ValueError, OSError, ImportError: there is no such place or file, words have no effect, or packages are missing.
    """
    source, _, words = text.partition(":")
    if is_path(words.strip() or text) and (not words or source.strip() == "scene"):
        text = str(located(words.strip() or text))
    source, words_or_path = split_source(text)
    request = parse_environment(words_or_path)
    if request is None:
        if source not in ("none", "auto") or (source == "auto" and words_or_path is None):
            raise ValueError(f"{text!r} names no place; name one ('{source}: an office')")
        return Place(FREE_SPACE, "none")
    if request.unused:
        raise ValueError(f"{text!r}: {request.unused[0]!r} was not understood and has no effect; leave it out")
    if source == "auto":
        source = "scene" if request.is_name or request.place is None else "furnished"
    source = chosen_source(source, request, ImageOptions())
    if source == "scene":
        return Place(Path(text).name, source, text) if request.given else Place(request.scene, source)
    return Place(f"{source}: {request.place if source == 'furnished' else request.text}", source)


def check_names(places: Iterable[Place]) -> None:
    """ValueError if two scenes have one name: recordings know their place by it, wherever the file lies."""
    known: dict[str, Place] = {}
    for place in places:
        first = known.setdefault(place.name, place)
        if place.kind == "scene" and scene_file(first).resolve() != scene_file(place).resolve():
            raise ValueError(
                f"'{place.file}' and '{first.file}' are both named '{place.name}': rename one of the files, as "
                "recordings have the names of their places without folders"
            )


def prompted_place(surroundings: str) -> Place:
    """The place that a prompt names, furnished where there is no scene of this package for it."""
    request = in_words(surroundings)
    if request is None:
        return Place(FREE_SPACE, "none")
    if request.has_file:
        return Place(request.scene, "scene")
    return Place(f"furnished: {request.place}", "furnished")


def scene_file(place: Place) -> Path:
    """File of a scene."""
    return available_scenes()[place.name] if place.file is None else Path(place.file)


@lru_cache(maxsize=64)
def interiors(place: Place, seeds: tuple[int, ...]) -> tuple[Interior, ...]:
    """Free space of the first layouts of a place with these seeds, or of its scene; empty where it is not bounded."""
    if place.kind == "furnished":
        found = [furnished(place.name.partition(":")[2].strip(), seed).interior for seed in seeds[:CHECKED_LAYOUTS]]
        return tuple(each for each in found if each is not None)
    if place.kind == "scene":
        path = scene_file(place)
        one = read_interior(path.with_suffix(".toml"))
        return () if one is None else (one,)
    return ()
