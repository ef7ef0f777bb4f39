"""From a sentence or keywords to what is simulated: target, action, orientation, distance, body, surroundings.

The grammar is explicit: a phrase is read by a pattern of :mod:`rfgen_sionna.generative.vocabulary` or it is
reported as not understood. Where the words leave a choice open ("raises an arm"), the seed draws one of the
possibilities that the negative prompt allows, and the report says so.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from rfgen_sionna.generative.body_prompt import BodyPrompt, PromptError, draw_body
from rfgen_sionna.generative.motion.actions import ACTIONS
from rfgen_sionna.generative.phrases import Phrases, read_unwanted, read_wanted
from rfgen_sionna.generative.reading import Reader, compile_pattern
from rfgen_sionna.generative.vocabulary import FILLERS, FREE_SPACE, NEGATION, SCENE_PATTERNS

T = TypeVar("T")

__all__ = ["BodyPrompt", "EnvironmentPrompt", "PromptError", "ScenePrompt", "parse_environment", "parse_prompt"]


@dataclass(frozen=True)
class ScenePrompt:
    """What a prompt asks for. None stands where it leaves the choice to the simulation."""

    text: str
    negative: str
    seed: int
    action: str
    """Key of the registry of actions."""
    target: str = "person"
    choices: tuple[str, ...] = ()
    """The actions that both prompts leave open; `action` is one of them, drawn from the seed."""
    orientation_deg: float | None = None
    """Angle by which the person is turned from facing the radar, counter-clockwise seen from above, so
    towards the person's own left [degrees, 0 to 360)."""
    distance_m: float | None = None
    """Distance from the radar [m]."""
    body: BodyPrompt = field(default_factory=BodyPrompt)
    hand: str | None = None
    """"left" or "right": the hand of a gesture."""
    speed: float | None = None
    """Factor on the action's usual speed."""
    surroundings: str | None = None
    """Name of a scene."""
    understood: tuple[tuple[str, str], ...] = ()
    """(phrase, what it was read as)."""
    unused: tuple[str, ...] = ()
    """Phrases that were not understood and have no effect."""
    notes: tuple[str, ...] = ()
    """What the seed decided, and other remarks."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """One sentence for each phrase without effect."""
        return tuple(f"prompt: {phrase!r} was not understood and has no effect" for phrase in self.unused)

    def report(self) -> str:
        """Several lines: what was understood, what was drawn, what was not understood."""
        lines = [f"prompt: {self.text}"]
        if self.negative:
            lines.append(f"negative: {self.negative}")
        width = max(len(phrase) for phrase, _ in self.understood)
        lines += [f"  {phrase:<{width}}  {meaning}" for phrase, meaning in self.understood]
        lines += [f"  {note}" for note in self.notes]
        lines += [f"  not understood, no effect: {phrase}" for phrase in self.unused]
        return "\n".join(lines)


@dataclass(frozen=True)
class EnvironmentPrompt:
    """The surroundings a text asks for."""

    text: str
    scene: str
    """Name of a scene."""
    unused: tuple[str, ...] = ()

    @property
    def warnings(self) -> tuple[str, ...]:
        """One sentence for each phrase without effect."""
        return tuple(f"environment: {phrase!r} was not understood and has no effect" for phrase in self.unused)


def parse_prompt(prompt: str, negative: str = "", *, seed: int = 0) -> ScenePrompt:
    """Read what a prompt and a negative prompt ask for.

    Args:
        prompt: a sentence or keywords, such as "a tall man picks something up, facing left, at 2.5 m".
        negative: what is not wanted: it takes away choices, such as "left arm", "facing away" or "child".
        seed: seed for what both leave open.

    Raises:
        PromptError: no known target or action, several of them, a negation inside `prompt`, a number out of
            range, or two statements that contradict each other. The message lists what is known.
    """
    for name, text in (("prompt", prompt), ("negative", negative)):
        if not isinstance(text, str):
            raise TypeError(f"{name}: expected a text, got {type(text).__name__}")
    said, denied = read_wanted(prompt), read_unwanted(negative)
    negation = compile_pattern(NEGATION).search(" ".join(said.unused))
    if negation:
        raise PromptError(
            f"prompt: {negation.group()!r} negates something; say what you don't want in the negative prompt instead"
        )
    if denied.targets and not denied.reader.understood:
        raise PromptError(f"negative prompt: {denied.targets[0]!r} forbids the only target that is known, a person")
    notes: list[str] = []
    if not said.targets:
        if said.unused or not said.actions:
            raise PromptError(
                f"target: {prompt!r} names none that is known{_rest(said)}; known: a person, {_examples()}"
            )
        notes.append("no target named: a person")
    options = _one_action(said, prompt)
    allowed = [a for a in ACTIONS if a in options and not any(a in named for _, named in denied.actions)]
    if not allowed:
        asked = " and ".join(sorted(options))
        raise PromptError(f"action: the negative prompt {negative!r} forbids {asked}, which {prompt!r} asks for")
    action = allowed[int(np.random.default_rng([seed, 10]).integers(len(allowed)))]
    if len(allowed) > 1:
        notes.append(f"action {action} drawn from {' or '.join(allowed)} (seed {seed})")
    hand, unused = _hand(said, denied, action)
    orientation = _one("orientation", said.orientations, denied.orientations)
    if orientation is None and any(angle == 0.0 for _, angle in denied.orientations):
        # Facing the radar is what a prompt without orientation gets, so forbidding it asks for another one.
        others = [a for a in (90.0, 180.0, 270.0) if all(a != angle for _, angle in denied.orientations)]
        if not others:
            raise PromptError(f"orientation: the negative prompt {negative!r} leaves none")
        orientation = others[int(np.random.default_rng([seed, 11]).integers(len(others)))]
        notes.append(f"orientation {orientation:g}° drawn (seed {seed})")
    body, drawn = draw_body(said.body, denied.body, seed)
    return ScenePrompt(
        text=prompt,
        negative=negative,
        seed=seed,
        action=action,
        choices=tuple(allowed),
        orientation_deg=orientation,
        distance_m=_one("distance", said.distances),
        body=body,
        hand=hand,
        speed=_one("speed", said.speeds, denied.speeds),
        surroundings=_one("surroundings", said.scenes, denied.scenes),
        understood=(
            *said.reader.understood,
            *((words, f"not {meaning}") for words, meaning in denied.reader.understood),
        ),
        unused=(*said.unused, *unused, *denied.unused),
        notes=(*notes, *drawn),
    )


def parse_environment(text: str | None) -> EnvironmentPrompt | None:
    """Read which scene a text asks for; None, an empty text or "free space" is no surroundings at all.

    Raises:
        PromptError: no known scene, or several.
    """
    if text is None:
        return None
    if not isinstance(text, str):
        raise TypeError(f"environment: expected a text or None, got {type(text).__name__}")
    reader = Reader(text)
    if not reader.text or reader.take(rf"<a>(?:{FREE_SPACE})"):
        return None
    scenes = [scene for scene, pattern in SCENE_PATTERNS.items() if reader.take(rf"<a>(?:{pattern})", scene)]
    if len(scenes) != 1:
        found = f"names several scenes ({', '.join(scenes)})" if scenes else "names no scene that is known"
        raise PromptError(f"environment: {text!r} {found}; known: free space, {', '.join(sorted(SCENE_PATTERNS))}")
    return EnvironmentPrompt(text=text, scene=scenes[0], unused=reader.rest(FILLERS))


def _one_action(said: Phrases, prompt: str) -> frozenset[str]:
    """The action of a prompt, or the actions that it leaves open."""
    named = list(said.actions)
    if any("standing" not in options for _, options in named):
        named = [n for n in named if "standing" not in n[1]]  # everybody stands while doing something
    if any("jumping_jacks" in options for _, options in named):
        named = [n for n in named if n[1] != {"jump"}]
    if not named:
        raise PromptError(f"action: {prompt!r} names none that is known{_rest(said)}; known: {_examples()}")
    if re.search(r"\bor\b", said.reader.text):
        return frozenset().union(*(options for _, options in named))
    options = frozenset(ACTIONS).intersection(*(options for _, options in named))
    if not options:
        words = ", ".join(repr(words) for words, _ in named)
        raise PromptError(
            f'action: the prompt names several ({words}); name one, or join them with "or" to have one drawn'
        )
    return options


def _hand(said: Phrases, denied: Phrases, action: str) -> tuple[str | None, tuple[str, ...]]:
    """The hand of a gesture, and the words about hands that have no effect on this action."""
    if not ACTIONS[action].one_handed:
        return None, tuple(words for words, _ in said.hands)
    hand = _one("hand", said.hands, denied.hands)
    if hand is None and len({side for _, side in denied.hands}) == 1:
        hand = "right" if denied.hands[0][1] == "left" else "left"
    return hand, ()


def _one(name: str, said: list[tuple[str, T]], denied: Sequence[tuple[str, T]] = ()) -> T | None:
    """The one value that a prompt names, None where it names none."""
    if len({value for _, value in said}) > 1:
        raise PromptError(f"{name}: the prompt names several: {', '.join(repr(words) for words, _ in said)}")
    for words, value in denied:
        if said and value == said[0][1]:
            raise PromptError(f"{name}: the prompt asks for {said[0][0]!r}, the negative prompt forbids it ({words!r})")
    return said[0][1] if said else None


def _rest(said: Phrases) -> str:
    return f" (not understood: {', '.join(map(repr, said.unused))})" if said.unused else ""


def _examples() -> str:
    return ", ".join(action.description for action in ACTIONS.values())
