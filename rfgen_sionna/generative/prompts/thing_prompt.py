"""Prompts about animals and things: "a dog runs", "a car drives towards the radar at 5 m/s".

The subject of the sentence picks the kind; places, speeds and surroundings are read by the patterns of prompts about
people, actions and parameters by those of the kind.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

from rfgen_sionna.generative.decisions import DEFAULT, PROMPT, Decision, drawn
from rfgen_sionna.generative.manner import Manner
from rfgen_sionna.generative.prompts import thing_words, vocabulary
from rfgen_sionna.generative.prompts.environment_prompt import NOWHERE, read_scenes, refuse_unknown_place, split_keyword
from rfgen_sionna.generative.prompts.human_nouns import PERSON
from rfgen_sionna.generative.prompts.manner_prompt import PACES, REPEATED
from rfgen_sionna.generative.prompts.prompt_error import PromptError
from rfgen_sionna.generative.prompts.quantities import (
    ALTITUDE,
    AZIMUTH,
    DISTANCE,
    ORIENTATION,
    VEHICLE_SPEED,
    open_angles,
    read_azimuth,
    read_lengths,
)
from rfgen_sionna.generative.prompts.scene_prompt import ScenePrompt
from rfgen_sionna.generative.prompts.text_reader import (
    AFTERWARDS,
    Reader,
    compile_pattern,
    negation_in,
    number,
    split_negative,
    without_request,
)
from rfgen_sionna.generative.things.thing_catalogue import THINGS
from rfgen_sionna.generative.things.thing_kind import ThingKind

PACED = frozenset({"seconds", "turns_per_second", "wing_beats_per_second"})
"""Parameters that "slowly" and "quickly" change."""


@dataclass(frozen=True)
class ThingPrompt(ScenePrompt):
    """Interpreted prompt about an animal or a thing; `target` is its kind."""

    way: str = ""
    """"to" and "away" from the radar, "left", "right" and "past" as seen from it; empty for none."""
    height_m: float | None = None
    """Height of the origin over the floor [m]."""
    values: Mapping[str, float] = field(default_factory=dict, hash=False)
    """Parameters of the kind."""

    def decisions(self) -> list[Decision]:
        """Decisions by words and defaults."""
        kind = THINGS[self.target]
        rows = [
            ("target", kind.description),
            ("action", f"{self.action}: {kind.actions[self.action].description}"),
            ("surroundings", self.surroundings or NOWHERE),
        ]
        return [Decision(name, value, self.origins.get(name, DEFAULT)) for name, value in rows]


def read_thing(prompt: str, negative: str = "", *, seed: int = 0) -> ThingPrompt | None:
    """Interpret a prompt whose subject is an animal or a thing; None for others.

    Raises:
        PromptError: an unknown action, several of a thing, a number out of range, a negation, or a negative prompt.
        TypeError: a prompt is not a text.
    """
    for name, given in (("prompt", prompt), ("negative", negative)):
        if not isinstance(given, str):
            raise TypeError(f"{name}: expected a text, got {type(given).__name__}")
    wanted, unwanted = split_negative(prompt)
    text, scenes = split_keyword(without_request(wanted))
    reader = Reader(text)
    kind = _take_subject(reader)
    if kind is None:
        scenes += read_scenes(reader)
        kind = _take_subject(reader)
        if kind is None:
            return None
    if negative or unwanted:
        raise PromptError(
            f"negative prompt: {', '.join(filter(None, (negative, unwanted)))!r}, but a prompt about a {kind.name} has "
            "none: leave it out"
        )
    negation = negation_in(text)
    if negation:
        raise PromptError(f"prompt: {negation!r} negates something; say what the {kind.name} does instead")
    later = AFTERWARDS.search(wanted.lower())
    if later:
        raise PromptError(f"action: {later.group()!r} joins several actions; a prompt about a {kind.name} has one")
    return _Reading(kind, reader, scenes).prompt(prompt, seed)


def _take_subject(reader: Reader) -> ThingKind | None:
    """Kind of the subject, whose words are taken."""
    attribute = compile_pattern(thing_words.ATTRIBUTES)
    people = [m for m in compile_pattern(PERSON).finditer(reader.text) if not attribute.fullmatch(m.group())]
    found = [
        (m.start(), -m.end(), kind.name, m)
        for kind in THINGS.values()
        for m in compile_pattern(kind.nouns).finditer(reader.text)
    ]
    if not found:
        return None
    start, _, name, match = min(found, key=lambda each: each[:3])
    if any(m.start() < start for m in people):
        return None
    before = compile_pattern(thing_words.SUBJECT).fullmatch(reader.text[:start].rstrip() + " ") if start else None
    if start and (before is None or not before.group().strip()):
        before = re.fullmatch(compile_pattern(thing_words.SUBJECT).pattern, reader.text[:start])
        if before is None:
            return None
    if before is not None and before["count"]:
        reader.erase(*before.span("count"))
    kept = match.span("verb") if match.groupdict().get("verb") else (match.end(), match.end())
    reader.erase(match.start(), kept[0] - (kept[0] < match.end()))
    reader.erase(min(kept[1] + 1, match.end()), match.end())
    reader.note(match, f"target {name}")
    return THINGS[name]


class _Reading:
    """The phrases of a prompt about a kind."""

    def __init__(self, kind: ThingKind, reader: Reader, scenes: list[tuple[str, str]]) -> None:
        self.kind, self.reader, self.scenes = kind, reader, scenes
        self.found, self.one = reader.found, reader.one

    def parameters(self) -> dict[str, float]:
        """Parameters of the kind by their patterns."""
        values = {}
        for name, parameter in self.kind.parameters.items():
            if not parameter.words:
                continue
            for match in self.reader.take(parameter.words):
                groups = match.groupdict()
                value = number(groups.get("value") or groups["value2"])
                unit, per = groups.get("unit") or "", groups.get("per") or ""
                if "turns" in name and (unit == "rpm" or per.startswith("m")):
                    value /= 60.0
                elif unit[:1] == "c":
                    value *= 0.01
                low, high = parameter.allowed
                if not low <= value <= high:
                    raise PromptError(
                        f"{name}: {match.group()!r} is {value:g} ({parameter.meaning}); allowed are {low:g} to {high:g}"
                    )
                self.found.setdefault(name, []).append((match.group(), value))
                self.reader.note(match, f"{name} {value:g}")
            value_ = self.one(name)
            if value_ is not None:
                values[name] = float(str(value_))
        return values

    def prompt(self, prompt: str, seed: int) -> ThingPrompt:
        """The interpreted prompt."""
        kind, reader = self.kind, self.reader
        values = self.parameters()
        for quantity in (VEHICLE_SPEED, ALTITUDE):
            quantity.read(reader)
        read_lengths(reader, height=False)
        read_azimuth(reader)
        reader.take(vocabulary.IN_VIEW, "within the radar's view, where everything is")
        moves = [name for name, each in kind.actions.items() if each.speed > 0.0]
        ways = []
        for way, pattern in thing_words.MOVING_WAYS if moves else ():
            if reader.find("way", pattern, way, f"moves: {way}"):
                ways.append(way)
        self._actions()
        if moves and "action" not in self.found and reader.find("moves", thing_words.MOVE, True, "moves"):
            ways.append("")
        ORIENTATION.read(reader)
        notes = open_angles(reader)
        for angle, pattern in vocabulary.ORIENTATION_PATTERNS:
            reader.find("orientation", pattern, (angle, angle), f"orientation {angle:g}°")
        other = compile_pattern(thing_words.OTHER_WAYS).search(reader.text) if moves else None
        if other:
            raise PromptError(
                f"way: {other.group()!r} of a {kind.name} is none that is known; known are towards the radar, away "
                "from it, to the left, to the right, past it; Actor.thing takes any path"
            )
        if moves:
            for way, pattern in thing_words.WAYS:
                reader.find("way", pattern, way, f"way {way}")
        for factor, pattern in PACES:
            reader.find("pace", pattern, factor, f"speed × {factor:g}")
        self.scenes += read_scenes(reader)
        self.found["surroundings"] = list(self.scenes)
        refuse_unknown_place(reader)
        reader.take(REPEATED, "repeated, as it is")
        named: dict[str, str] = {}
        speed, pace = VEHICLE_SPEED.draw(reader, seed, named), self.one("pace")
        action = self._action(prompt, bool(ways or speed is not None), speed)
        moving = kind.actions[action].speed > 0.0
        does = f"a {kind.name} that {kind.actions[action].description}"
        for name in ("way", "speed"):
            if name in self.found and not moving:
                words = ", ".join(repr(words) for words, _ in self.found[name])
                raise PromptError(f"{name}: the prompt says {words}, but {does} stays in place")
        if pace is not None and not moving and not PACED.intersection(kind.parameters):
            raise PromptError(f"speed: {self.found['pace'][0][0]!r} has no effect on {does}")
        if {way for _, way in self.found.get("way", [])} > {"past"}:  # "passes to the left"
            self.found["way"] = [(words, way) for words, way in self.found["way"] if way != "past"]
        given = {q.name: q.draw(reader, seed, named) for q in (DISTANCE, AZIMUTH, ORIENTATION, ALTITUDE)}
        turned = given["orientation"]
        if pace is not None:
            named["speed"] = PROMPT
        if self.scenes:
            named["surroundings"] = PROMPT
        named |= {"target": PROMPT, "action": PROMPT if self.found.get("action") or ways else DEFAULT}
        place = self.one("surroundings")
        manner = Manner(speed=pace, speed_mps=speed)
        return ThingPrompt(
            text=prompt, negative="", seed=seed, action=action, target=kind.name, choices=(action,),
            orientation_deg=None if turned is None else turned % 360.0, distance_m=given["distance"],
            bearing_deg=given["azimuth"], manner=manner, surroundings=None if place is None else str(place),
            understood=tuple(reader.understood), unused=reader.rest(vocabulary.FILLERS), origins=named,
            way=str(self.one("way") or ""),
            height_m=given["height"], values=values, notes=notes,
        )  # fmt: skip

    def _actions(self) -> None:
        # longer phrases first: "stands up" is not "stands"
        hits = [
            (match.start(), -match.end(), name)
            for name, each in self.kind.actions.items()
            for match in compile_pattern(each.words).finditer(self.reader.text)
        ]
        for start, end, name in sorted(hits):
            words = self.reader.text[start:-end]
            if "~" in words:
                continue
            self.reader.erase(start, -end)
            self.found.setdefault("action", []).append((words, name))
            self.reader.understood.append((words, f"action {name}"))

    def _action(self, prompt: str, moves: bool, speed: float | None) -> str:
        """The action; of several the one beside "stand", which others include."""
        kind = self.kind
        known = ", ".join(f"{name} ({each.description})" for name, each in kind.actions.items())
        said = dict.fromkeys(str(name) for _, name in self.found.get("action", []))
        if len(said) > 1:
            said.pop("stand", None)
        if len(said) > 1:
            words = ", ".join(repr(words) for words, _ in self.found["action"])
            raise PromptError(f"action: the prompt names several ({words}); name one that a {kind.name} does: {known}")
        if said:
            return next(iter(said))
        unread = self.reader.rest(vocabulary.FILLERS)
        if moves:
            movers = {name: each for name, each in kind.actions.items() if each.speed > 0.0}
            fit = {name: each for name, each in movers.items() if (speed or 0.0) <= each.fastest}
            if not fit:
                text = "" if speed is None else f" at {speed:g} m/s"
                raise PromptError(f"speed: a {kind.name} does not move{text}; known: {known}")
            return next(iter(fit)) if speed is None else min(fit, key=lambda name: abs(fit[name].speed - speed))
        if unread:
            raise PromptError(
                f"action: {prompt!r} names none that is known of a {kind.name} (not understood: "
                f"{', '.join(map(repr, unread))}); known: {known}"
            )
        return kind.alone or ("stand" if "stand" in kind.actions else next(iter(kind.actions)))


def way_origin(said: ThingPrompt, seed: int) -> str:
    """Origin of the way of a prompt."""
    return PROMPT if said.way and said.way != "past" else drawn(seed, ("left", "right"))
