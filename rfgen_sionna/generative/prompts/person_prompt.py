"""Prompts about a person: who does what, where and how; the seed draws what the words leave open."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from rfgen_sionna.generative.decisions import DEFAULT, NEGATIVE, PROMPT, argument, drawn
from rfgen_sionna.generative.manner import Manner
from rfgen_sionna.generative.motion.actions import ACTIONS
from rfgen_sionna.generative.motion.kinematic import preferred_hand
from rfgen_sionna.generative.prompts.action_choice import ActionChoice, choose_action, named_actions
from rfgen_sionna.generative.prompts.body_prompt import draw_body
from rfgen_sionna.generative.prompts.clauses import ARMS
from rfgen_sionna.generative.prompts.environment_prompt import split_keyword
from rfgen_sionna.generative.prompts.manner_prompt import read_lying
from rfgen_sionna.generative.prompts.person_words import PersonWords, read_unwanted, read_wanted
from rfgen_sionna.generative.prompts.prompt_error import PromptError
from rfgen_sionna.generative.prompts.quantities import (
    AGE,
    AZIMUTH,
    BREATHING,
    DISTANCE,
    HEART,
    HEIGHT,
    ORIENTATION,
    RATE,
    SPEED,
    WEIGHT,
    open_angles,
)
from rfgen_sionna.generative.prompts.scene_prompt import CLIP, ScenePrompt, check_seed
from rfgen_sionna.generative.prompts.text_reader import negation_in, split_negative
from rfgen_sionna.generative.prompts.vocabulary import WAYS as WAY_ANGLES
from rfgen_sionna.generative.repertoire import HELD, ONCE, WAYS

_ONE_HANDED = frozenset({"drink", "phone", "point", "punch", "put_down", "reach", "throw", "wash_window", "wave"})
"""Actions of clips with one hand, beside those of the rules."""
POSTURE_ACTIONS = {
    "on_hips": "arms_on_hips", "folded": "arms_folded", "behind_back": "hands_behind_back",
    "in_pockets": "hands_in_pockets",
}  # fmt: skip
"""Posture of the arms -> action of somebody who stands so."""
_TWO_HANDED = frozenset({"carry", "climb_ladder", "lift", "push_up", "sweep"})
_HELD = HELD | ONCE | {name for name, each in ACTIONS.items() if not each.periodic}
"""Actions without repetition."""
_STILL = frozenset({"standing", "sit", "lie", "t_pose", "y_pose", *POSTURE_ACTIONS.values()})
"""Actions without a pace and a size."""
_BACKWARDS = frozenset({"walk_backwards", "run_backwards", "fall_backward"})
_SIDEWAYS = frozenset({"sidestep", "fall_sideways"})
_GESTURES = frozenset({"push", "pull", "throw", "point", "reach"})
"""Actions whose "towards the radar" is the way of the hand."""
_WALKS = {"straight": "walk_straight", "to_and_fro": "walk_to_and_fro", "circle": "walk_in_a_circle", "loop": "walk"}
"""Way -> action of a walk."""
_RUNNER = re.compile(r"\b(?:jogger|runner|sprinter)\b")
_WALKING = re.compile(r"\b(?:walk|stroll|step|stride|march|pace|pacing|saunter|wander|amble|shuffle|trudge)")
"""Words by which a runner walks; a runner who passes runs."""
_SPRINT = 1.6
"""Factor of a sprint on the usual speed of a run, the one of "very fast"."""


def read_person(prompt: str, negative: str = "", *, seed: int = 0, clip: str = "") -> ScenePrompt:
    """Interpret a prompt about a person, and its negative prompt.

    Args:
        prompt: a sentence or keywords, such as "a tall man picks something up, facing left, at 2.5 m"; words after the
            keyword "negative:" join the negative prompt.
        negative: unwanted choices, such as "left arm", "facing away" or "child".
        seed: seed of open choices and of ranges.
        clip: name of a clip that the person moves as; the actions of the prompt then have no effect.

    Raises:
        PromptError: nothing that can be done is near enough, several actions or persons, unknown surroundings, a
            negation, a number out of range, or a contradiction.
        TypeError: a prompt is not a text.
        ValueError: the seed is invalid.
        ImportError: the packages of the action reader are missing.
    """
    check_seed(seed)
    for name, text in (("prompt", prompt), ("negative", negative)):
        if not isinstance(text, str):
            raise TypeError(f"{name}: expected a text, got {type(text).__name__}")
    wanted, unwanted = split_negative(prompt)
    negative = ", ".join(part for part in (negative, unwanted) if part)
    said, denied = read_wanted(wanted), read_unwanted(negative)
    _refuse_negation(wanted, said, "prompt: {!r} negates something; unwanted choices go into the negative prompt")
    _refuse_negation(
        negative, denied, "negative prompt: {!r} negates what is forbidden already; name the unwanted choice alone"
    )
    if denied.targets and not denied.reader.understood:
        raise PromptError(f"negative prompt: {denied.targets[0]!r} forbids the only target that is known, a person")
    origins = {"target": PROMPT if said.targets else DEFAULT, "action": PROMPT}
    one = {name: _one(said, denied, name) for name in ("pace", "amplitude", "arm posture")}
    surroundings = _surroundings(said, denied)
    if surroundings is not None:
        origins["surroundings"] = PROMPT
    forbidden = {phrase: named_actions(phrase) for phrase in denied.clauses()}
    reader = said.reader
    vital = {"breathing", "heart"} & reader.found.keys()
    if clip:
        notes = tuple(f"prompt: {phrase!r} has no effect: motion is the clip '{clip}'" for phrase in said.clauses())
        choice, origins["action"] = ActionChoice((f"{CLIP}{clip}",)), argument("motion")
    else:
        choice, notes = _chosen(said, prompt, bool(vital)), ()
    notes += open_angles(reader)
    mapped = dict(_on_the_way(each, said) for each in choice.options)
    action, options = _draw("action", tuple(mapped), forbidden, seed, negative, prompt, origins)
    path = mapped[action]
    without: tuple[str, ...] = ("repeated",) if action in _HELD and not choice.arms else ()
    if action in _STILL and not choice.arms:
        without, one = ("repeated", "pace", "amplitude"), {"arm posture": one["arm posture"]}
    arms = ""
    if choice.arms:
        arms, _ = _draw("arms", choice.arms, forbidden, seed, negative, prompt, origins)
    effectless = tuple(words for name in without for words, _ in reader.found.get(name, []))
    if action == "run" and re.search(r"\bsprint", choice.known) and not {"pace", "speed", "rate"} & reader.found.keys():
        one["pace"] = _SPRINT
    orientation = _orientation(said, denied, action, seed, origins)
    hand, hands_lost = _hand(said, denied, arms or action, seed, origins)
    lying = read_lying(choice.known) if action == "lie" else None
    if action in _SIDEWAYS or (not lying and choice.side and not said.read_hands() and "way" not in reader.found):
        side = choice.side or "(?:left|right)"
        found = re.findall(
            rf"(?:(?:to|on|onto) )?(?:(?:the|his|her|their) )?\b{side}(?:wards?)?\b(?: side)?", choice.known
        )
        hands_lost = (*hands_lost, *found)
    for quantity in (HEIGHT, WEIGHT, AGE):
        value = quantity.draw(reader, seed, origins)
        if value is not None:
            said.body.values[quantity.name] = reader.found[quantity.name][0][0], value
    body, from_words = draw_body(said.body, denied.body, seed)
    values = {q.name: q.draw(reader, seed, origins) for q in (DISTANCE, AZIMUTH, SPEED, RATE, BREATHING, HEART)}
    said_so = {"speed": one.get("pace"), "path": path} | {name: reader.one(name) for name in ("tired", "pauses")} | one
    origins |= {name: PROMPT for name, value in said_so.items() if value is not None and name not in origins}
    manner = Manner(
        speed=one.get("pace") if values["speed"] is None else None, speed_mps=values["speed"],
        amplitude=one.get("amplitude"), rate=values["rate"], path=path, pauses="pauses" in reader.found,
        arm_posture=None if action in POSTURE_ACTIONS.values() else one["arm posture"],
        tired="tired" in reader.found, lying=lying, hand=hand,
    )  # fmt: skip
    return ScenePrompt(
        text=prompt, negative=negative, seed=seed, action=action, choices=options, orientation_deg=orientation,
        distance_m=values["distance"], bearing_deg=values["azimuth"], body=body, manner=manner, arms=arms,
        surroundings=surroundings, breathing_rate=values["breathing"], heart_rate=values["heart"], notes=notes,
        understood=(
            *(each for each in reader.understood if each[0] not in effectless),
            *(((choice.known, f"action {action}{f', arms {arms}' if arms else ''}"),) if choice.known else ()),
            *((words, f"not {meaning}") for words, meaning in denied.reader.understood),
            *((words, f"not {' or '.join(sorted(named))}") for words, named in forbidden.items() if named),
        ),
        unused=(
            *said.lost, *choice.lost, *hands_lost, *effectless, *denied.lost,
            *(phrase for phrase, named in forbidden.items() if not named),
        ),
        origins=origins | from_words,
    )  # fmt: skip


def _chosen(said: PersonWords, prompt: str, vital: bool) -> ActionChoice:
    """Actions of the clauses; a person with nothing but vital signs or a posture of the arms stands."""
    clauses = said.clauses()
    if not clauses and not vital and "arm posture" not in said.reader.found:
        raise PromptError(
            f"action: {prompt!r} names none; say what the person does, such as 'walks back and forth', 'falls "
            "backwards' or 'sits down'"
        )
    choice = choose_action(clauses, prompt) if clauses else ActionChoice(("standing",))
    runner = any(_RUNNER.search(who) for who in said.targets) and not _WALKING.search(prompt.lower())
    if runner and set(choice.options) <= {"walk", *_WALKS.values()}:
        choice = replace(choice, options=("run",))
    posture = POSTURE_ACTIONS.get(said.reader.one("arm posture"))
    return replace(choice, options=(posture,)) if posture and choice.options == ("standing",) else choice


def _draw(
    name: str, options: Sequence[str], forbidden: dict[str, frozenset[str]], seed: int, negative: str, prompt: str,
    origins: dict[str, str],
) -> tuple[str, tuple[str, ...]]:  # fmt: skip
    """An option that the negative prompt allows, by the seed, and all of these."""
    denied = frozenset[str]().union(*forbidden.values())
    allowed = tuple(each for each in options if each not in denied)
    if not allowed:
        raise PromptError(
            f"{name}: the negative prompt {negative!r} forbids {' and '.join(options)}, which {prompt!r} asks for"
        )
    origins[name] = origins.get(name, PROMPT) if len(allowed) == 1 else drawn(seed, allowed)
    return allowed[int(np.random.default_rng([seed, 10]).integers(len(allowed)))], allowed


def _on_the_way(action: str, said: PersonWords) -> tuple[str, str | None]:
    """Action with the way over the floor that the words name, and that way."""
    if action not in WAYS:
        return action, None
    path = said.way()
    if path is None and "way" in said.reader.found:
        path = "straight"
    if action == "walk_turn" and path == "straight":
        return action, None
    if path is not None and action in ("walk", "walk_turn", *_WALKS.values()):
        return _WALKS[path], path
    return action, path


def _orientation(
    said: PersonWords, denied: PersonWords, action: str, seed: int, origins: dict[str, str]
) -> float | None:
    """Orientation [degrees] in the words, or left by the negative prompt."""
    reader = said.reader
    back = 180.0 if action in _BACKWARDS else 0.0
    drawn_way = ""
    ways = reader.found.get("way", []) if action not in _GESTURES | _SIDEWAYS else []
    for words, way in ways:
        if way == "across":
            way = ("left", "right")[int(np.random.default_rng([seed, 13]).integers(2))]
            drawn_way = drawn(seed, ("90°", "270°"))
        angle = (WAY_ANGLES[way] + back) % 360.0
        reader.found.setdefault("orientation", []).append((words, (angle, angle)))
        reader.understood.append((words, f"that way: orientation {angle:g}°"))
    turned = ORIENTATION.draw(reader, seed, origins)
    if drawn_way:
        origins["orientation"] = drawn_way
    unwanted = {low % 360.0: words for words, (low, _) in denied.reader.found.get("orientation", [])}
    if turned is not None:
        if turned % 360.0 in unwanted:
            raise PromptError(
                f"orientation: the prompt asks for {reader.found['orientation'][0][0]!r}, the negative prompt forbids "
                f"it ({unwanted[turned % 360.0]!r})"
            )
        return turned % 360.0
    if 0.0 not in unwanted:
        return None
    others = [each for each in (90.0, 180.0, 270.0) if each not in unwanted]
    if not others:
        raise PromptError(f"orientation: the negative prompt {said.reader.said!r} leaves none")
    origins["orientation"] = drawn(seed, [f"{each:g}°" for each in others])
    return others[int(np.random.default_rng([seed, 11]).integers(len(others)))]


def _hand(
    said: PersonWords, denied: PersonWords, action: str, seed: int, origins: dict[str, str]
) -> tuple[str | None, tuple[str, ...]]:
    """Hand of an action, and words about hands without effect."""
    words = dict(said.read_hands())
    known = ACTIONS.get(action)
    by_rules = known is not None and known.one_handed
    if not by_rules and action not in _ONE_HANDED:
        arms = action in ARMS | _TWO_HANDED or action.startswith(CLIP) or {"left", "right"} & set(action.split("_"))
        return None, () if arms else tuple(words)
    allowed = known.hands if known is not None and by_rules else ("left", "right")
    hands = set(words.values())
    if len(hands) > 1:
        raise PromptError(f"hand: the prompt names several: {', '.join(map(repr, words))}")
    hand = next(iter(hands), None)
    forbidden = {each: phrase for phrase, each in denied.read_hands()}
    sides = forbidden.keys() - {"both"}
    if hand in forbidden or sides == {"left", "right"} or (sides and hand == "both"):
        phrases = " and ".join(map(repr, forbidden.values()))
        raise PromptError(f"hand: the negative prompt forbids {phrases}, which {action!r} is done with")
    if hand in allowed:
        origins["hand"] = PROMPT
        return hand, ()
    if len(sides) == 1:
        origins["hand"] = NEGATIVE
        return "right" if "left" in sides else "left", tuple(words)
    if not by_rules:
        return None, tuple(words)
    origins["hand"] = drawn(seed)
    return preferred_hand(action, seed), tuple(words)


def _one(said: PersonWords, denied: PersonWords, name: str) -> Any:
    """Value of a word for the manner; PromptError for several or a forbidden one."""
    value = said.reader.one(name)
    for words, unwanted in denied.reader.found.get(name, []):
        if value is not None and value == unwanted:
            raise PromptError(
                f"{'speed' if name == 'pace' else name}: the prompt asks for {said.reader.found[name][0][0]!r}, the "
                f"negative prompt forbids it ({words!r})"
            )
    return value


def _surroundings(said: PersonWords, denied: PersonWords) -> str | None:
    """Name of the surroundings."""
    named = {scene: words for words, scene in said.scenes}
    if len(named) > 1:
        raise PromptError(
            f"surroundings: the prompt names several: {', '.join(repr(words) for words, _ in said.scenes)}"
        )
    for words, scene in denied.scenes:
        if scene in named:
            raise PromptError(
                f"surroundings: the prompt asks for {named[scene]!r}, the negative prompt forbids it ({words!r})"
            )
    return next(iter(named), None)


def _refuse_negation(text: str, read: PersonWords, message: str) -> None:
    # The whole text: phrases contain negations ("picks up a box without bending"); "environment: nothing" is a place.
    negation = negation_in(split_keyword(text)[0]) or negation_in(" , ".join(read.clauses()))
    if negation:
        raise PromptError(message.format(negation))
