"""Reading of a prompt, about a person, an animal or a thing."""

from __future__ import annotations

from dataclasses import replace

from rfgen_sionna.generative.prompts.actor_clauses import split_actors
from rfgen_sionna.generative.prompts.body_prompt import TRAITS
from rfgen_sionna.generative.prompts.person_prompt import read_person
from rfgen_sionna.generative.prompts.prompt_error import PromptError
from rfgen_sionna.generative.prompts.scene_prompt import ScenePrompt
from rfgen_sionna.generative.prompts.thing_prompt import read_thing


def read_prompt(prompt: str, negative: str = "", *, seed: int = 0, body_seed: int | None = None) -> ScenePrompt:
    """Interpret a prompt about one actor: a :class:`~.thing_prompt.ThingPrompt` about an animal or a thing, another one
    about a person.

    Args:
        prompt: a sentence or keywords, such as "a tall man picks something up, facing left, at 2.5 m" or "a dog runs";
            words after the keyword "negative:" join the negative prompt.
        negative: unwanted choices, such as "left arm", "facing away" or "child".
        seed: seed of open choices and of ranges such as "at 2 to 4 m".
        body_seed: seed of the words about a person's body, such as "tall"; None is `seed`.

    Raises:
        PromptError: the prompt cannot be carried out; with the nearest that can.
        TypeError: a prompt is not a text.
        ValueError: the seed is invalid.
        ImportError: the packages of the action reader are missing.
    """
    several = split_actors(prompt) if isinstance(prompt, str) else None
    if several is not None:
        raise PromptError(
            f"target: the prompt names {len(several.clauses)} actors; rfgen_sionna.actors_from_prompt makes them all"
        )
    thing = read_thing(prompt, negative, seed=seed)
    if thing is not None:
        return thing
    said = read_person(prompt, negative, seed=seed)
    return said if body_seed is None else with_body_of(said, read_person(prompt, negative, seed=body_seed))


def with_body_of(said: ScenePrompt, other: ScenePrompt) -> ScenePrompt:
    """The interpreted prompt with the body of another reading of it."""
    origins = {name: origin for name, origin in said.origins.items() if name not in TRAITS}
    origins |= {name: origin for name, origin in other.origins.items() if name in TRAITS}
    return replace(said, body=other.body, origins=origins)
