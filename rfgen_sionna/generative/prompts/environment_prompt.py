"""Surroundings in a text: in a prompt, after a keyword, or as a description of their own."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from os import fspath
from typing import Any

from rfgen_sionna.generative.furniture import EMPTY, SURFACES, names, take_compounds
from rfgen_sionna.generative.prompts import vocabulary
from rfgen_sionna.generative.prompts.prompt_error import PromptError
from rfgen_sionna.generative.prompts.text_reader import Reader, compile_pattern, negation_in
from rfgen_sionna.scene.load import check_scene_file, is_path, is_scene
from rfgen_sionna.scene.scene_errors import SceneError

NOWHERE = "free space"
"""Name of empty surroundings."""
PLACE_PATTERNS = {
    "bedroom": r"bed ?room|sleeping room|room to sleep in",
    "office": r"office(?: room)?|work ?room|study",
    "lab": r"(?:(?:research|science) )?lab(?:oratory)?",
    "corridor": r"corridor|hallway|passage(?:way)?|(?:long |entrance )?hall",
    "classroom": r"class ?room|lecture room|school ?room",
    "garage": r"(?:(?:car|workshop) )?garage",
    "playground": r"(?:children )?play ?ground|play area",
    "open field": r"(?:open |grass )?field|meadow|grassland",
}
"""Furnished place (:data:`rfgen_sionna.scene.furnished.PLACES`) without a scene file -> pattern."""
_PLACES_OF_SCENES = {
    "living_room": "living room", "simple_street_canyon": "street", "simple_street_canyon_with_cars": "street",
}  # fmt: skip
"""Scene file -> name of the same kind of furnished or imagined place."""
_PATTERNS = {**vocabulary.SCENE_PATTERNS, **PLACE_PATTERNS}
_COMMON_WORDS = vocabulary.COMMON_SCENE_WORDS | set(PLACE_PATTERNS)
KNOWN = (
    f"known: {NOWHERE}; the places {', '.join(sorted({*_PLACES_OF_SCENES.values(), *PLACE_PATTERNS}))}; the scenes "
    f"{', '.join(sorted(vocabulary.SCENE_PATTERNS))}"
)

SOURCES = {
    "scene": "the scene of a file",
    "furnished": "a place furnished by the seed",
    "diffusion": "an image drawn by a diffusion model",
    "none": "free space, whatever the prompt says",
}
"""Sources of surroundings in an `environment` argument -> meaning."""
_SOURCE = re.compile(r"\s*(\w+)\s*(?::(.*))?", re.DOTALL)
_GIVEN = "a text, the path of a scene file, a scene, or None"

_KEYWORD = re.compile(
    r"""["']?\b(?:environment|surroundings|scene|location|place|room|background|setting)\b["']?\s*[:=]([^,;.\n}]*)""",
    re.IGNORECASE,
)
_SOMETHING_ELSE = re.compile(
    r"\w*\d|(?:at|in|with|facing|looking|turned|away|towards?|from|very|fast|quick|and|[a-z]+ly)\b"
)


@dataclass(frozen=True)
class EnvironmentPrompt:
    """Requested surroundings."""

    text: str
    scene: str
    """Name of a scene or its file, or of a furnished place."""
    unused: tuple[str, ...] = ()
    """Phrases without effect."""
    given: Any = None
    """Path of a scene file or a scene, as :func:`rfgen_sionna.load_scene` takes; None for words."""

    @property
    def has_file(self) -> bool:
        """Whether there is such a scene file."""
        return self.given is not None or self.scene in vocabulary.SCENE_PATTERNS

    @property
    def place(self) -> str | None:
        """Name as a furnished or imagined place; None for scenes of a file only, such as cities."""
        return _PLACES_OF_SCENES.get(self.scene, self.scene if self.scene in PLACE_PATTERNS else None)

    @property
    def is_name(self) -> bool:
        """Whether the text is the name of a scene file, as for `load_scene`."""
        return self.has_file and self.text.strip() == self.scene

    def warnings(self, *, imagined: bool = False) -> tuple[str, ...]:
        """One sentence for each phrase without effect; furniture has an effect in an `imagined` place."""
        lost = self.unused
        if imagined:
            readers = [Reader(phrase) for phrase in lost]
            for reader in readers:
                for pattern in (EMPTY, *(each[0] for each in SURFACES), *(name.pattern for name in names())):
                    reader.take(pattern)
            lost = tuple(phrase for reader in readers for phrase in reader.rest(vocabulary.FILLERS))
        return tuple(f"environment: {phrase!r} was not understood and has no effect" for phrase in lost)


def split_source(environment: Any) -> tuple[str, Any]:
    """Source and words of an `environment` argument: "furnished: an office", "an office", "furnished".

    Returns
    -------
    One of :data:`SOURCES`, or "auto" without one; and the words, the path or the scene, or None without any.

    Raises
    ------
    PromptError
        If the text before a colon is no source, or words follow "none".
    FileNotFoundError
        If there is no scene file of a path.
    TypeError
        If `environment` is neither a text, a path, a scene nor None.
    """
    if environment is None:
        return "auto", None
    if is_scene(environment):
        return "scene", environment
    match = _SOURCE.fullmatch(environment) if isinstance(environment, str) else None
    named = match is not None and match[1].lower() in SOURCES
    if not named and is_path(environment):
        check_scene_file(environment)
        return "scene", environment
    if not isinstance(environment, str):
        raise TypeError(f"environment: expected {_GIVEN}, got {type(environment).__name__}")
    if match is None or (match[2] is None and not named):
        return "auto", environment
    source, words = match[1].lower(), (match[2] or "").strip()
    if not named:
        allowed = ", ".join(f"'{name}' ({meaning})" for name, meaning in SOURCES.items())
        raise PromptError(f"environment: {source!r} is no source of surroundings; allowed before the colon: {allowed}")
    if source == "none" and words:
        raise PromptError(f"environment: {environment!r} names a place, but 'none' is free space: leave one out")
    if is_path(words):
        if source != "scene":
            raise PromptError(f"environment: {words!r} is a scene file, which the source {source!r} cannot take")
        check_scene_file(words)
    return source, words or None


def with_source(environment: Any, source: str) -> Any:
    """`environment` with a `source`, the deprecated argument `surroundings`."""
    if source == "auto" or (source == "scene" and is_scene(environment)):
        return environment
    if is_scene(environment):
        raise PromptError(f"surroundings is {source!r}, but environment is a scene: leave one out")
    if environment is not None and not isinstance(environment, str):
        environment = fspath(environment)
    return source if environment is None else f"{source}: {environment}"


def parse_environment(text: Any) -> EnvironmentPrompt | None:
    """Surroundings of a text, the path of a scene file or a scene; None for None, an empty text or "free space".

    Raises:
        PromptError: no known scene, several, or a negation.
        FileNotFoundError: there is no scene file of a path.
        TypeError: `text` is none of these.
    """
    if text is None:
        return None
    if is_scene(text):
        name = str(getattr(text, "name", "sionna scene"))
        return EnvironmentPrompt(text=name, scene=name, given=text)
    if is_path(text):
        check_scene_file(text)
        return EnvironmentPrompt(text=fspath(text), scene=fspath(text), given=text)
    if not isinstance(text, str):
        raise TypeError(f"environment: expected {_GIVEN}, got {type(text).__name__}")
    reader = Reader(text)
    if not reader.text:
        return None
    furniture = take_compounds(reader)
    scenes = [NOWHERE] if reader.take(rf"<a>(?:{vocabulary.NO_SCENE})") else []
    if negation := negation_in(reader.text):
        raise PromptError(
            f"environment: {text!r} negates something ({negation!r}); say which one is wanted, {KNOWN}; unwanted "
            "contents of an imagined place go into the negative environment prompt"
        )
    scenes += _take_scenes(reader)
    if len(scenes) != 1:
        found = f"names several scenes ({', '.join(scenes)})" if scenes else "names no scene that is known"
        raise PromptError(f"environment: {text!r} {found}; {KNOWN}")
    if scenes == [NOWHERE]:
        return None
    return EnvironmentPrompt(text=text, scene=scenes[0], unused=(*furniture, *reader.rest(vocabulary.FILLERS)))


def _take_scenes(reader: Reader) -> list[str]:
    """Take the scenes of a description, without contents: "a living room with a box" is one scene."""
    found = []
    for scene, pattern in _PATTERNS.items():
        found += [(match, scene) for match in reader.take(rf"<a>(?:{pattern})")]
    first = min((match.start() for match, _ in found), default=0)
    inside = re.compile(r"\bwith\b").search(reader.text, first)
    for match, _ in found:
        if inside and match.start() > inside.start():
            reader.text = reader.text[: match.start()] + match.group() + reader.text[match.end() :]
    return list(dict.fromkeys(scene for match, scene in found if not inside or match.start() < inside.start()))


def in_words(scene: str) -> EnvironmentPrompt | None:
    """Surroundings of the name of a scene, as if described in words."""
    request = parse_environment(scene)
    if request is None or request.place is None:
        return request
    return replace(request, text=f"{'an' if request.place[0] in 'aeiou' else 'a'} {request.place}")


def split_keyword(text: str) -> tuple[str, list[tuple[str, str]]]:
    """Text without keywords such as "environment: a living room", and (words, scene) of each of them.

    Raises:
        PromptError: a keyword has no known scene.
    """
    found = []
    for match in _KEYWORD.finditer(text):
        try:
            named = parse_environment(match[1].strip(" \"'"))
        except (SceneError, RuntimeError) as error:  # the path of no file, or of a home that nobody has
            raise PromptError(f"environment: {error}") from error
        found.append((match.group().strip(), NOWHERE if named is None else named.scene))
    return _KEYWORD.sub(" , ", text), found


def read_scenes(reader: Reader) -> list[tuple[str, str]]:
    """Take the surroundings of a prompt: (words, scene)."""
    found: list[tuple[str, str]] = []

    def take(pattern: str, scene: str) -> None:
        for match in compile_pattern(pattern).finditer(reader.text):
            how = [match.span(name) for name in match.groupdict() if match[name] is not None]
            start, end = how[0] if how else (match.end(), match.end())
            reader.erase(match.start(), max(match.start(), start - (start < end)))  # a space stays before the rest
            reader.erase(end, match.end())
            found.append((match.group(), scene))
            reader.note(match, f"surroundings {scene}")

    take(vocabulary.FREE_SPACE, NOWHERE)
    for scene, pattern in _PATTERNS.items():
        # Common words such as "box" name a scene after "in a" or alone between commas.
        if scene in _COMMON_WORDS:
            inside = vocabulary.SCENE_PREFIX if found else vocabulary.SCENE_PREFIX.replace("|or", "")
            here, alone = (rf"<a>(?P<{name}>(?:{vocabulary.HOW} )*?)(?:{pattern})" for name in ("how", "how2"))
            take(rf"{inside} {here}|(?:(?<=, )|^){alone}(?= ,|$)", scene)
        else:
            take(rf"(?:(?:in|inside|within|at) <a>)?(?:{pattern})", scene)
    return found


def refuse_unknown_place(reader: Reader) -> None:
    """Raise a PromptError for an unknown place in the rest of a prompt."""
    found = [m.group() for m in compile_pattern(vocabulary.UNKNOWN_PLACE).finditer(reader.text)]
    for match in compile_pattern(vocabulary.PLACE_LIKE).finditer(reader.text):
        start, end = match.span("place")
        # an action at the end ("in a big jump") is no place, unless another read phrase follows
        after = re.search(r"(?<=[a-z]) ~", match["place"])
        if after and _SOMETHING_ELSE.match(reader.said, start + after.start() + 1):
            end = start + after.start()
        if "~" not in reader.text[end - 1] and not vocabulary.NO_PLACES.intersection(reader.text[start:end].split()):
            found.append(reader.said[match.start() : end])
    if found:
        raise PromptError(f"surroundings: {found[0]!r} names none that is known; {KNOWN}")
