"""Reading of a prompt, about a person, an animal or a thing."""

from __future__ import annotations

from rfgen_sionna.generative.prompts.actor_clauses import split_actors
from rfgen_sionna.generative.prompts.person_prompt import read_person
from rfgen_sionna.generative.prompts.prompt_error import PromptError
from rfgen_sionna.generative.prompts.scene_prompt import ScenePrompt
from rfgen_sionna.generative.prompts.thing_prompt import read_thing


def read_prompt(prompt: str, negative: str = "", *, seed: int = 0) -> ScenePrompt:
    """Interpret a prompt about one actor: a :class:`~.thing_prompt.ThingPrompt` about an animal or a thing, another one
    about a person.

    Args:
        prompt: a sentence or keywords, such as "a tall man picks something up, facing left, at 2.5 m" or "a dog runs";
            words after the keyword "negative:" join the negative prompt.
        negative: unwanted choices, such as "left arm", "facing away" or "child".
        seed: seed of open choices and of ranges such as "at 2 to 4 m".

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
    return read_person(prompt, negative, seed=seed) if thing is None else thing
