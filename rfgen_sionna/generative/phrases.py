"""Everything that one text names, before the prompt and the negative prompt are weighed against each other."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from rfgen_sionna.generative.body_prompt import SIMPLE_NOUNS, BodyWords, PromptError
from rfgen_sionna.generative.motion.actions import ACTIONS
from rfgen_sionna.generative.reading import Reader, number
from rfgen_sionna.generative.vocabulary import (
    ACTION_PATTERNS,
    COMMON_SCENE_WORDS,
    DISTANCE_PATTERNS,
    FILLERS,
    IN_VIEW,
    METRES,
    ORIENTATION_PATTERNS,
    PERSON,
    PLURAL,
    SCENE_PATTERNS,
    SPEED_PATTERNS,
    TURN_PATTERN,
)

_OTHER = {"left": "right", "right": "left"}


@dataclass
class Phrases:
    """What a text names, each with the words that name it."""

    reader: Reader
    actions: list[tuple[str, frozenset[str]]] = field(default_factory=list)
    """(words, the actions they may mean)."""
    hands: list[tuple[str, str]] = field(default_factory=list)
    orientations: list[tuple[str, float]] = field(default_factory=list)
    distances: list[tuple[str, float]] = field(default_factory=list)
    speeds: list[tuple[str, float]] = field(default_factory=list)
    scenes: list[tuple[str, str]] = field(default_factory=list)
    targets: list[str] = field(default_factory=list)
    body: BodyWords = field(default_factory=BodyWords)

    @property
    def unused(self) -> tuple[str, ...]:
        """The phrases that were not understood."""
        return self.reader.rest(FILLERS)


def read_wanted(text: str) -> Phrases:
    """Read a prompt.

    Raises:
        PromptError: more than one person, or a number out of range.
    """
    said = Phrases(Reader(text))
    reader = said.reader
    said.body.read_numbers(reader)
    for pattern in DISTANCE_PATTERNS:
        for m in reader.take(pattern):
            metres = round(number(m["value"]) * METRES[m["unit"][0]], 3)
            if metres <= 0:
                raise PromptError(f"distance: {m.group()!r} is {metres:g} m; it must be positive")
            said.distances.append((m.group(), metres))
            reader.note(m, f"distance {metres:g} m")
    _read_common(said)
    for m in reader.take(r"(?:(?:with|using|by) )?<a>(?P<side>left|right) (?:hand|arm|index finger|finger)"):
        said.hands.append((m.group(), m["side"]))
        reader.note(m, f"{m['side']} hand")
    for m in reader.take(rf"(?:<n> )?{PLURAL}"):
        raise PromptError(
            f"target: {m.group()!r} is more than one person; a prompt describes one, a Simulator takes several"
        )
    for m in reader.take(PERSON):
        said.targets.append(m.group())
        reader.note(m, "target person" + said.body.read_noun(m.group()))
    return said


def read_unwanted(text: str) -> Phrases:
    """Read a negative prompt: beside phrases, single words ("left", "arm", "clockwise") name all they occur in."""
    said = Phrases(Reader(text))
    _read_common(said)
    reader = said.reader
    for m in reader.take(r"(?:(?P<side>left|right) )?(?P<limb>arm|hand|leg|foot|feet|knee|swipe|circle)s?"):
        limb = {"arm": "arm", "hand": "arm", "swipe": "swipe", "circle": "circle"}.get(m["limb"], "leg")
        _name_all(said, m, [w for w in (m["side"], limb) if w])
        if m["side"] and limb == "arm":
            said.hands.append((m.group(), m["side"]))
    for m in reader.take(r"(?:to the )?(?P<side>left|right)"):
        _name_all(said, m, [m["side"]])
        said.hands.append((m.group(), m["side"]))
    for m in reader.take(r"clockwise|(?:counter|anti) ?clockwise"):
        _name_all(said, m, ["clockwise" if m.group() == "clockwise" else "counterclockwise"])
    for trait, classes, nouns in SIMPLE_NOUNS:
        said.body.take_classes(reader, nouns, trait, classes)
    for m in reader.take(PERSON):  # "a person jumping" forbids the jumping; "a person" alone forbids everything
        said.targets.append(m.group())
    return said


def _name_all(said: Phrases, match: re.Match[str], words: list[str]) -> None:
    named = frozenset(action for action in ACTIONS if set(words) <= set(action.split("_")))
    if named:
        said.actions.append((match.group(), named))
        said.reader.note(match, f"action {' or '.join(sorted(named))}")


def _read_common(said: Phrases) -> None:
    reader = said.reader
    for template, pattern in ACTION_PATTERNS:
        for m in reader.take(pattern):
            groups = m.groupdict()
            named = _fill(template, groups)
            said.actions.append((m.group(), named))
            reader.note(m, f"action {' or '.join(sorted(named))}")
            if groups.get("side") and "arm" not in template and "leg" not in template:
                said.hands.append((m.group(), groups["side"]))
    for m in reader.take(r"the (?P<side>left|right) one"):
        _name_all(said, m, [m["side"]])
    reader.take(IN_VIEW, "within the radar's view, where everything is")
    for m in reader.take(TURN_PATTERN):
        angle = number(m["angle"]) * (-1.0 if m["side"] == "right" else 1.0) % 360.0
        said.orientations.append((m.group(), angle))
        reader.note(m, f"orientation {angle:g}°")
    for angle, pattern in ORIENTATION_PATTERNS:
        for m in reader.take(pattern):
            said.orientations.append((m.group(), angle))
            reader.note(m, f"orientation {angle:g}°")
    for speed, pattern in SPEED_PATTERNS:
        for m in reader.take(pattern):
            said.speeds.append((m.group(), speed))
            reader.note(m, f"speed × {speed:g}")
    for scene, pattern in SCENE_PATTERNS.items():
        # "box" or "street" are common words: they name a scene only after "in a" or alone between commas.
        inside = rf"(?:in|inside|within|at|on) <a>(?:{pattern})|(?:(?<=, )|^)<a>(?:{pattern})(?= ,|$)"
        for m in reader.take(
            inside if scene in COMMON_SCENE_WORDS else rf"(?:(?:in|inside|within|at) <a>)?(?:{pattern})"
        ):
            said.scenes.append((m.group(), scene))
            reader.note(m, f"surroundings {scene}")
    said.body.read_adjectives(reader)


def _fill(template: str, groups: dict[str, str | None]) -> frozenset[str]:
    """The actions that a template stands for; what the phrase doesn't say stays open."""
    for name in ("side", "direction"):
        if f"{{{name}}}" in template:
            sides = [groups[name] or ""] if groups.get(name) else ["left", "right"]
            return frozenset(template.replace(f"{{{name}}}", side) for side in sides)
    if "{other}" in template:
        sides = [_OTHER[groups["side"] or ""]] if groups.get("side") else ["left", "right"]
        return frozenset(template.replace("{other}", side) for side in sides)
    if "{turn}" in template:
        turn = groups.get("turn") or groups.get("turn2")
        turns = (
            ["clockwise", "counterclockwise"]
            if not turn
            else ["clockwise" if turn == "clockwise" else "counterclockwise"]
        )
        return frozenset(template.replace("{turn}", t) for t in turns)
    return frozenset({template})
