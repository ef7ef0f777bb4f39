"""Phrases of a prompt or of a negative prompt, by the patterns of :mod:`rfgen_sionna.generative.prompts.vocabulary`."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field

from rfgen_sionna.generative.motion.actions import ACTIONS
from rfgen_sionna.generative.prompts import vocabulary
from rfgen_sionna.generative.prompts.body_prompt import SIMPLE_NOUNS, BodyWords
from rfgen_sionna.generative.prompts.environment_prompt import read_scenes, refuse_unknown_place, split_keyword
from rfgen_sionna.generative.prompts.prompt_error import PromptError
from rfgen_sionna.generative.prompts.text_reader import Reader, compile_pattern, number

_OTHER = {"left": "right", "right": "left"}


@dataclass
class Phrases:
    """Values in a text, each with its words."""

    reader: Reader
    actions: list[tuple[str, frozenset[str]]] = field(default_factory=list)
    """(words, possible actions)."""
    hands: list[tuple[str, str]] = field(default_factory=list)
    orientations: list[tuple[str, float]] = field(default_factory=list)
    distances: list[tuple[str, float]] = field(default_factory=list)
    bearings: list[tuple[str, float]] = field(default_factory=list)
    speeds: list[tuple[str, float]] = field(default_factory=list)
    breathing: list[tuple[str, float]] = field(default_factory=list)
    """Breaths a minute."""
    heart: list[tuple[str, float]] = field(default_factory=list)
    """Heartbeats a minute."""
    scenes: list[tuple[str, str]] = field(default_factory=list)
    targets: list[str] = field(default_factory=list)
    body: BodyWords = field(default_factory=BodyWords)
    repeated: list[str] = field(default_factory=list)
    """Words for repetition."""
    ignored: list[str] = field(default_factory=list)
    """Understood phrases without effect on the action."""

    @property
    def unused(self) -> tuple[str, ...]:
        """Phrases without effect."""
        return (*self.ignored, *self.reader.rest(vocabulary.FILLERS))

    def names(self, part: str) -> bool:
        """Whether an action read so far has `part` in its name."""
        return any(part in action for _, named in self.actions for action in named)


def read_wanted(text: str) -> Phrases:
    """Read a prompt.

    Raises:
        PromptError: several persons, several numbers for one value, a number out of range, a position behind the
            radar, or an unknown place.
    """
    text, scenes = split_keyword(text)
    said = Phrases(Reader(text), scenes=scenes)
    reader = said.reader
    reader.understood += [(words, f"surroundings {scene}") for words, scene in scenes]
    _refuse_misreadable(reader.text)
    said.body.read_numbers(reader)
    for name, rates, patterns in (
        ("breaths", said.breathing, vocabulary.BREATHING_PATTERNS),
        ("heartbeats", said.heart, vocabulary.HEART_PATTERNS),
    ):
        for rate, pattern in patterns:
            for m in reader.take(pattern):
                rates.append((m.group(), number(m["value"]) if rate is None else rate))
                reader.note(m, f"{rates[-1][1]:g} {name} a minute")
    for pattern in vocabulary.DISTANCE_PATTERNS:
        for m in reader.take(pattern):
            _distance(said, m, m["value"], m.groupdict().get("unit") or "m")
    for m in reader.take(vocabulary.BARE_LENGTH):
        _bare_length(said, m)
    unread = compile_pattern(vocabulary.UNREAD_DISTANCE).search(reader.text)
    if unread:
        raise PromptError(f'distance: {unread.group()!r} is no number of metres; write it like "at 2.5 m"')
    for pattern in vocabulary.BEARING_PATTERNS:
        for m in reader.take(pattern):
            _bearing(said, m)
    _read_common(said)
    _read_second_halves(said)
    for m in reader.take(
        r"(?:(?:with|using|by) )?<a>(?P<side>left|right) (?:hand|arm|index finger|finger)|hand (?P<side2>left|right)"
    ):
        side = m["side"] or m["side2"]
        said.hands.append((m.group(), side))
        reader.note(m, f"{side} hand")
    named = frozenset[str]().union(*(options for _, options in said.actions))
    if not named or any(ACTIONS[action].one_handed for action in named):
        for m in reader.take(
            rf"(?:with|using|by) (?:{vocabulary.BOTH_HANDS}|<a>(?:hands|arms))|hand both|both (?:index )?fingers"
        ):
            if _both_hands(said, m.group(), named or ACTIONS):
                reader.note(m, "both hands")
    said.repeated = [m.group() for m in reader.take(vocabulary.REPEATED)]
    for m in reader.take(rf"(?:<n> )?{vocabulary.PLURAL}"):
        raise PromptError(
            f"target: {m.group()!r} is more than one person; a prompt describes one, a Simulator takes several"
        )
    for m in reader.take(vocabulary.PERSON):
        said.targets.append(m.group())
        reader.note(m, "target person" + said.body.read_noun(m.group()))
    refuse_unknown_place(reader)
    return said


def _refuse_misreadable(text: str) -> None:
    several = compile_pattern(vocabulary.SEVERAL_NUMBERS).search(text)
    if several:
        quantity = (
            "distance"
            if compile_pattern(r"[a-z\d. ]*(?:m|met(?:re|er)s?|cm|feet|foot|ft)").fullmatch(several.group())
            else "numbers"
        )
        raise PromptError(f"{quantity}: the prompt names several: {several.group()!r}; give one number")
    behind = compile_pattern(vocabulary.BEHIND).search(text)
    if behind:
        raise PromptError(
            f"azimuth: {behind.group()!r} is out of the radar's view; a person stands in front of it, at an azimuth "
            "of -90° to 90°"
        )


def _distance(said: Phrases, match: re.Match[str], value: str, unit: str) -> None:
    metres = round(number(value) * vocabulary.METRES[unit[0]], 3)
    if metres <= 0:
        raise PromptError(f"distance: {match.group()!r} is {metres:g} m; it must be positive")
    said.distances.append((match.group(), metres))
    said.reader.note(match, f"distance {metres:g} m")


def _bare_length(said: Phrases, match: re.Match[str]) -> None:
    """A length without its quantity: a height if it is written like heights of people, or a distance."""
    value, unit = (match["value"], match["unit"]) if match["value"] else (match["value2"], match["unit2"])
    metres = number(value) * vocabulary.METRES[unit[0]]
    if not 1.3 <= metres <= 2.3:
        _distance(said, match, value, unit)
    elif unit[0] == "c" or (unit[0] == "f" and "." in value):  # centimetres, feet and inches
        said.body.take_value(said.reader, match, "height", metres)
    elif {"weight", "age"} & said.body.values.keys() and "height" not in said.body.values:
        raise PromptError(
            f"distance: {match.group()!r} may be a height or a distance; "
            f'write "{metres:g} m tall" or "{metres:g} m away"'
        )
    else:
        _distance(said, match, value, unit)


def _bearing(said: Phrases, match: re.Match[str]) -> None:
    side = match["side"]
    angle = number(match["angle"]) * (-1.0 if side == "right" else 1.0)
    if not -90.0 <= angle <= 90.0:
        raise PromptError(
            f"azimuth: {match.group()!r} is {angle:g}°; allowed are -90° to 90°, positive to the radar's left"
        )
    said.bearings.append((match.group(), angle + 0.0))
    said.reader.note(match, f"place at azimuth {angle + 0.0:g}°")


def _read_second_halves(said: Phrases) -> None:
    """Take phrases without their verb: "raises the left arm and the right leg", "swipes left and right"."""
    reader = said.reader
    if said.names("_raised"):
        for m in reader.take(r"(?:(?:and|then|and then) )?<a>(?P<side>left|right) (?P<limb>arm|hand|leg|foot|knee)"):
            limb = "arm" if m["limb"] in ("arm", "hand") else "leg"
            _name_all(said, m, [m["side"], limb, "raised"])
    again = r"(?:(?:and then|and|then) |(?<=or ))"
    if said.names("swipe_"):
        way = r"<a>(?:own )?(?P<side>left|right)(?:wards?)?(?: side)?(?! (?:hand|arm))"
        for m in [*reader.take(rf"{again}(?:to )?{way}"), *reader.take(rf"to {way}")]:
            _name_all(said, m, ["swipe", m["side"]])
    if said.names("circle_"):
        for m in reader.take(rf"{again}(?P<turn>clockwise|(?:counter|anti) ?clockwise)"):
            _name_all(said, m, ["circle", "clockwise" if m["turn"] == "clockwise" else "counterclockwise"])


def read_unwanted(text: str) -> Phrases:
    """Read a negative prompt; single words ("left", "arm", "clockwise") name all actions with them."""
    text, scenes = split_keyword(text)
    said = Phrases(Reader(text), scenes=scenes)
    said.reader.understood += [(words, f"surroundings {scene}") for words, scene in scenes]
    _read_common(said)
    reader = said.reader
    both_walks = frozenset({"walk", "walk_straight"})
    said.actions = [
        (words, both_walks if named == {"walk"} and not compile_pattern(vocabulary.TO_AND_FRO).search(words) else named)
        for words, named in said.actions
    ]
    for m in reader.take(rf"(?:with|using|by) (?:{vocabulary.BOTH_HANDS})|(?:both|two) (?:of )?<a>hands"):
        said.hands.append((m.group(), "both"))
        reader.note(m, "both hands")
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
    for m in reader.take(vocabulary.PERSON):  # "a person" alone forbids everything
        said.targets.append(m.group())
    return said


def _both_hands(said: Phrases, words: str, named: Iterable[str]) -> bool:
    """Note words for both hands; False, and without effect, if no action allows both."""
    both = any("both" in ACTIONS[action].hands for action in named)
    if both:
        said.hands.append((words, "both"))
    else:
        said.ignored.append(words)
    return both


def _name_all(said: Phrases, match: re.Match[str], words: list[str]) -> None:
    named = frozenset(action for action in ACTIONS if set(words) <= set(action.split("_")))
    if named:
        said.actions.append((match.group(), named))
        said.reader.note(match, f"action {' or '.join(sorted(named))}")


def _read_common(said: Phrases) -> None:
    reader = said.reader
    _read_speeds(said, vocabulary.PACE_PATTERNS)
    both_ways = compile_pattern(vocabulary.TO_AND_FRO).search(reader.text)
    for template, pattern in vocabulary.ACTION_PATTERNS:
        for m in reader.take(pattern):
            groups = m.groupdict()
            named = _fill(template, groups)
            both = compile_pattern(vocabulary.BOTH_HANDS).search(m.group()) if ACTIONS[min(named)].one_handed else None
            if both:
                _both_hands(said, both.group(), named)
            said.actions.append((m.group(), named))
            reader.note(m, f"action {' or '.join(sorted(named))}")
            for way in vocabulary.WAYS.keys() & groups.keys():
                if groups[way]:
                    reader.erase(*m.span(way))
                    said.orientations.append((groups[way], vocabulary.WAYS[way]))
                    reader.understood.append((groups[way], f"walks that way: orientation {vocabulary.WAYS[way]:g}°"))
            if groups.get("ahead"):
                reader.erase(*m.span("ahead"))
            if groups.get("side") and "arm" not in template and "leg" not in template:
                said.hands.append((m.group(), groups["side"]))
    for m in reader.take(r"the (?P<side>left|right) one"):
        _name_all(said, m, [m["side"]])
    if said.names("walk"):
        reader.take(vocabulary.TO_AND_FRO, "action walk")
    reader.take(vocabulary.IN_VIEW, "within the radar's view, where everything is")
    for m in [*reader.take(vocabulary.ORIENTATION_NUMBER), *reader.take(vocabulary.TURN_PATTERN)]:
        turned = number(m["angle"])
        if not -180.0 <= turned <= 360.0:
            raise PromptError(f"orientation: {m.group()!r} is {turned:g}°; allowed are 0° to 360° or -180° to 180°")
        angle = turned * (-1.0 if m["side"] == "right" else 1.0) % 360.0
        said.orientations.append((m.group(), angle))
        reader.note(m, f"orientation {angle:g}°")
    for angle, pattern in vocabulary.ORIENTATION_PATTERNS:
        for m in reader.take(pattern):
            said.orientations.append((m.group(), angle))
            reader.note(m, f"orientation {angle:g}°")
    for angle, pattern in vocabulary.WAY_PATTERNS:
        for m in reader.take(pattern):
            said.orientations.append((m.group(), angle))
            reader.note(m, f"orientation {angle:g}°")
            if not both_ways:  # a walk towards the radar is one way
                said.actions = [(w, frozenset({"walk_straight"}) if n == {"walk"} else n) for w, n in said.actions]
    _read_speeds(said, vocabulary.SPEED_PATTERNS)
    said.scenes += read_scenes(reader)
    said.body.read_adjectives(reader)


def _read_speeds(said: Phrases, patterns: Iterable[tuple[float, str]]) -> None:
    for speed, pattern in patterns:
        for m in said.reader.take(pattern):
            said.speeds.append((m.group(), speed))
            said.reader.note(m, f"speed × {speed:g}")


def _fill(template: str, groups: dict[str, str | None]) -> frozenset[str]:
    """Actions of a template, with the groups of a match; missing groups leave all options."""
    for name in ("side", "direction"):
        if f"{{{name}}}" in template:
            sides = [groups[name] or ""] if groups.get(name) else ["left", "right"]
            return frozenset(template.replace(f"{{{name}}}", side) for side in sides)
    if "{other}" in template:
        side = groups.get("side") or groups.get("side2")
        sides = [_OTHER[side]] if side else ["left", "right"]
        return frozenset(template.replace("{other}", side) for side in sides)
    if "{turn}" in template:
        turn = groups.get("turn") or groups.get("turn2")
        turns = ["clockwise", "counterclockwise"]
        if turn:
            turns = turns[:1] if turn == "clockwise" else turns[1:]
        return frozenset(template.replace("{turn}", t) for t in turns)
    return frozenset({template})
